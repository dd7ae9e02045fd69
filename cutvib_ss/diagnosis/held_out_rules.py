"""
What hypotheses keep of their probability once they are held against records that their fit has not seen.

A second known cause has to leave noise, and no cause may predict less than what is simpler.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from cutvib_ss.diagnosis.discrepancy import ALONG_THE_RAIL
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.held_out import HeldOut, share
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.known_form import of_another_form
from cutvib_ss.diagnosis.posterior import UNKNOWN, best, give, is_there, kind_of
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.tempered import tempered_evidence
from cutvib_ss.effects.base import Effect


def judged_on_held_out(
    ranked: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut], heat: float
) -> dict[str, float]:
    """
    Probabilities in which every hypothesis has to show on records that its fit has not seen; they sum to one or less.

    Log evidence is tempered by `heat` (`temperature`), and differences of log predictive density are divided by it.
    """
    bare = next((r for r in ranked if not r.fit.hypothesis.effects), None)
    rules = _HeldOutRules(tuple(r for r in ranked if r.refined), bare, dict(odds), held, heat)
    for r in [r for r in ranked if odds[r.name] >= SETTINGS.verdict_hardly]:
        rules.ask(r)
    if bare and rules.odds[bare.name] >= SETTINGS.verdict_hardly:
        rules.no_cause_leaves_noise(bare)
    for r in rules.fitted:
        if kind_of(r.fit.hypothesis) == UNKNOWN and rules.odds[r.name] >= SETTINGS.verdict_hardly:
            rules.mainly_known(r)
    return rules.odds


@dataclass(frozen=True)
class _HeldOutRules:
    """What hypotheses keep of their probability once they are held against records that were left out."""

    fitted: tuple[Ranked, ...]  # On all lines
    bare: Ranked | None  # The re-tuned model without a cause
    odds: dict[str, float]  # Passed on in place
    held: Callable[[Ranked], HeldOut]
    heat: float  # By what differences of log densities are divided

    def ask(self, r: Ranked) -> None:
        """Hold one hypothesis against the model without a cause, and a sum against its known part alone."""
        causes, held = r.fit.hypothesis.causes, self.held
        known = bool(causes) and all(effect != UNKNOWN for effect, _ in causes)
        if not known and held(r).reduced > SETTINGS.fit_run_away:
            # It shows that something unknown is there, but not what.
            self.odds[r.name] = 0.0
        if (known or len(causes) > 1) and r.fit.of_no_size:
            self.without_what_may_be_nothing(r, r.fit)
        elif known and r.fit.corrected.of_no_size and self.without_what_may_be_nothing(r, r.fit.corrected, 0.5):
            # With its discrepancy it is something, without it nothing: either there is no cause, or one that nothing here has.
            self.without_what_is_only_its_error(r)
        if causes and r.fit.tolerated:
            self.within_tolerance(r)
        # What was fitted to a record predicts nothing of it.
        if held(r).unseen:
            if self.bare and (known or kind_of(r.fit.hypothesis) == UNKNOWN):
                self.by_both_leads(r, self.bare)
            if kind_of(r.fit.hypothesis) == UNKNOWN:
                self.with_what_predicts_more(r)
            elif kind_of(r.fit.hypothesis) == "known":
                self.with_another_that_predicts_more(r)
        parts = [(c,) for c in causes if c[0] != UNKNOWN]
        first = best(x for x in self.fitted if x.fit.hypothesis.causes in parts) if len(causes) > 1 else None
        if first is None:
            return
        if not held(r).unseen:
            self.of_one_record(r, first)
        elif not known and _of_one_part(r.fit.hypothesis):
            self.of_one_place(r, first)
        elif held(r).log_density >= held(first).log_density:
            if known and self.is_doubtful(r):
                self.second_is_not_proven(r, first)
            elif known and self.may_be_its_form(r, first):
                give(self.odds, r, first, self.of_its_form(r, first))
            elif known and self.may_be_one_element(r, first):
                give(self.odds, r, first, SETTINGS.verdict_form)
        elif known:
            self.by_both_leads(r, first)
            if self.may_be_one_element(r, first):
                give(self.odds, r, first, SETTINGS.verdict_form)
        else:
            # What it predicts, the known part alone predicts better.
            give(self.odds, r, first)

    def is_doubtful(self, both: Ranked) -> bool:
        """Whether two known causes leave more than noise, or less only because their model errs by more than is believed."""
        return self.held(both).reduced > SETTINGS.verdict_noise or of_another_form(both, self.held)

    def may_be_its_form(self, both: Ranked, first: Ranked) -> bool:
        """Whether a first cause leaves no more to a second than the largest error of a cause that is believed."""
        # The discrepancy of a restoring force holds small errors of its form. Pairs with so small a second cause are as rare as
        # causes in another form that some second cause fits. Linear causes that still err by more than most beside it are in one.
        errs = not first.fit.hypothesis.linear or both.fit.spread.is_large("cause")
        return errs and 1.0 - self.closed(first, both) <= SETTINGS.sizes["cause"][-1][0] ** 2

    def may_be_one_element(self, both: Ranked, first: Ranked) -> bool:
        """Whether two linear elements act between the same points: they are one of another form, as a panel with two modes is."""
        return _at_one_port(both.fit.hypothesis) and self.closed(first, both) > 0.5

    def of_its_form(self, both: Ranked, first: Ranked) -> float:
        """Part of the probability of two causes that the first alone has where the second may be its form."""
        with_both = both.fit.spread
        if any(e.linear for e in both.fit.hypothesis.effects) or not both.fit.hypothesis.at_one_port:
            return 1.0 - SETTINGS.verdict_form
        # A second force of its own port is there where the error of the first's form goes with it; else it took a part of that.
        gone = first.fit.spread.is_large("cause") and not with_both.is_large("cause")
        return 0.0 if gone else 1.0

    def closed(self, first: Ranked, both: Ranked) -> float:
        """Part of the excess that the first of two parts closes alone."""
        return share(self.held(self.bare) if self.bare else None, self.held(first), self.held(both))

    def without_what_may_be_nothing(self, r: Ranked, fit: Fit, part: float = 1.0) -> bool:
        """Pass on the probability of causes of which one may be nothing in a fit, unless it is there: the rest is discrepancy."""
        less = self.with_whatis_there(fit)
        # The strength and the stiffness of a restoring force are known along a ridge that does not pass through nothing: there its
        # deviation says little, and what it predicts of other records decides.
        if less is not None:
            predicted = self.held(r).log_density - self.held(less).log_density
            if not r.fit.hypothesis.linear and predicted > _by_chance(len(r.fit.stds)):
                return False
            give(self.odds, r, less, part)
        return True

    def within_tolerance(self, r: Ranked) -> None:
        """Pass on most of the probability of causes of which one is no more than its part may differ from the model by itself."""
        # The tolerance is that of a matrix, and tuning moves all of it: its parts differ among themselves by as much. A
        # channel's is of gain and phase: a sensor may err by as much in another form over frequency than calibration is tuned in.
        less = self._without(r.fit, r.fit.tolerated)
        if less is not None:
            give(self.odds, r, less, SETTINGS.verdict_form)

    def with_whatis_there(self, fit: Fit) -> Ranked | None:
        """The best hypothesis of those causes of which a fit holds that they are there."""
        return self._without(fit, fit.of_no_size)

    def _without(self, fit: Fit, effects: Sequence[Effect]) -> Ranked | None:
        """The best hypothesis of the causes of a fit but for some."""
        rest = Hypothesis(tuple(e for e in fit.hypothesis.effects if e not in effects))
        return best(x for x in self.fitted if x.fit.hypothesis.causes == rest.causes)

    def without_what_is_only_its_error(self, r: Ranked) -> None:
        """Pass on the probability of causes of which one is nothing without its discrepancy; a single one is something unknown."""
        less = self.with_whatis_there(r.fit.corrected)
        if less is None or not less.fit.hypothesis.effects:
            self.odds[r.name] = 0.0
        else:
            give(self.odds, r, less if self.is_enough(less, r) else self.beside_something(less))

    def by_both_leads(self, r: Ranked, simpler: Ranked) -> None:
        """Share the probability of a hypothesis with a simpler one that predicts held-out records better."""
        predicted = (self.held(r).log_density - self.held(simpler).log_density) / self.heat
        # What a value tuned far out of its tolerance predicts, its shift predicts as well: the lead is the prior's, and what more
        # parameters cost by chance says nothing against it. A shift beside which others stay as far out is not what moved them.
        relieved = simpler.fit.tuned_away and not r.fit.tuned_away
        if predicted >= (-_by_chance(len(r.fit.stds)) if relieved else 0.0):
            return
        # The lead was estimated twice, by evidence and by prediction, and the two disagree in its sign: the mean of both decides,
        # and the hypothesis keeps half at most.
        lead = tempered_evidence(r.fit, self.heat) - tempered_evidence(simpler.fit, self.heat)
        own, other = self.odds[r.name], self.odds[simpler.name]
        # A probability too small for a number is known by its evidence.
        leads = np.log(own / other) if min(own, other) > 0.0 else lead
        ratio = leads + (predicted - lead) / 2.0
        kept = (own + other) * min(0.5, float(special.expit(ratio)))
        if kept < own:
            give(self.odds, r, simpler, 1.0 - kept / own)

    def with_what_predicts_more(self, unknown: Ranked) -> None:
        """Share the probability of an unknown element with a known cause of its place that predicts held-out records better."""
        place = unknown.fit.hypothesis.place
        known = best(x for x in self.fitted if kind_of(x.fit.hypothesis) == "known" and x.fit.hypothesis.place == place)
        if known and self.held(known).log_density > self.held(unknown).log_density:
            # Evidence says that its form is not the known one, prediction that it is: neither is sure.
            give(self.odds, unknown, known, 0.5)

    def with_another_that_predicts_more(self, r: Ranked) -> None:
        """Share the probability of a known cause with another answer that leads in prediction by more than it lags in evidence."""
        near = [x for x in self.fitted if x is not r and self.odds[x.name] >= SETTINGS.verdict_hardly]
        other = max(
            (x for x in near if kind_of(x.fit.hypothesis) in ("known", UNKNOWN)),
            key=lambda x: self.held(x).log_density,
            default=None,
        )
        if other is None or self.odds[r.name] == 0.0:
            return
        predicted = self.held(other).log_density - self.held(r).log_density
        if predicted > max(r.fit.log_evidence - other.fit.log_evidence, _by_chance(len(r.fit.stds))):
            # Each leads by one of two estimates: neither is sure.
            both = self.odds[r.name] + self.odds[other.name]
            give(self.odds, r, other, max(1.0 - SETTINGS.verdict_form * both / self.odds[r.name], 0.0))

    def mainly_known(self, unknown: Ranked) -> None:
        """Pass on the probability of an unknown element to a known cause with it beside, which closes most of the excess alone."""
        place = unknown.fit.hypothesis.place
        sums = [x for x in self.fitted if kind_of(x.fit.hypothesis) == "sums" and _of_one_part(x.fit.hypothesis)]
        both = best(x for x in sums if x.fit.hypothesis.causes[-1] == (UNKNOWN, place))
        if both is None:
            return
        first = best(x for x in self.fitted if x.fit.hypothesis.causes == both.fit.hypothesis.causes[:1])
        # The smooth function of the element holds what the cause does as well; that the cause is there, the cause shows. Beside the
        # cause the element takes what it took, or both are another explanation, and a worse one.
        if first and is_there(first, both) and self.closed(first, unknown) > 0.5:
            alone, beside = (x.fit.log_evidence - first.fit.log_evidence for x in (unknown, both))
            if beside > 0.5 * alone:
                give(self.odds, unknown, both)

    def of_one_place(self, both: Ranked, first: Ranked) -> None:
        """Pass on most of the probability of a known cause beside something unknown at its place: there is one, of another form."""
        place = both.fit.hypothesis.causes[-1:]
        unknown = best(x for x in self.fitted if x.fit.hypothesis.causes == place)
        if unknown is None:
            return
        if not is_there(first, both) or self.closed(first, both) <= 0.5:
            give(self.odds, both, unknown)
            return
        # The kind is known where the cause alone closes most of the excess, but not its form: what the element beside it adds shows
        # that. A cause that leaves far more than noise loses as much later (`of_known_form`).
        give(self.odds, both, first, 1.0 if of_another_form(first, self.held) else SETTINGS.verdict_form)

    def of_one_record(self, both: Ranked, first: Ranked) -> None:
        """Pass on the probability of two parts where no record was held out: nothing shows that the second predicts."""
        if self.is_enough(first, both):
            give(self.odds, both, first)
            return
        parts = [(c,) for c in both.fit.hypothesis.causes]
        alone = best(x for x in self.fitted if x.fit.hypothesis.causes in parts)
        give(self.odds, both, alone or first, 1.0 - SETTINGS.verdict_form)

    def is_enough(self, first: Ranked, both: Ranked) -> bool:
        """Whether the first of two causes alone closes all but a few percent of the excess, by itself."""
        # What values far out of their tolerance close, nobody believes of them: there the second cause is in the tuning.
        return self.closed(first, both) >= SETTINGS.verdict_closed and (both.fit.tuned_away or not first.fit.tuned_away)

    def takes_all(self, both: Ranked, first: Ranked) -> bool:
        """Whether two causes close all but a few percent of what the first of them leaves, which alone is no answer."""
        alone, with_both = self.held(first), self.held(both)
        if alone.against_stated <= SETTINGS.verdict_misfit:
            return False
        return share(alone, with_both, with_both) >= SETTINGS.verdict_closed

    def beside_something(self, first: Ranked) -> Ranked:
        """A cause beside something unknown; alone, if no such fit is at hand."""
        beside = [x for x in self.fitted if x.fit.hypothesis.causes[:1] == first.fit.hypothesis.causes]
        return best(x for x in beside if x.fit.hypothesis.causes[-1][0] == UNKNOWN) or first

    def second_is_not_proven(self, both: Ranked, first: Ranked) -> None:
        """Pass on the probability of two known causes that leave more than noise."""
        # What the form of a first cause leaves is structured: of many second causes some takes a part of it away, but none all.
        if self.is_enough(first, both) and not self.takes_all(both, first):
            give(self.odds, both, first)
            return
        target = self.beside_something(first)
        if self.held(both).log_density <= self.held(target).log_density:
            give(self.odds, both, target)
        elif self.held(both).reduced > SETTINGS.verdict_noise:
            # If the second predicts more than something unknown does, its kind is right and its form is not known: it keeps what
            # such an answer keeps. Where both leave noise, but only by an error beyond belief, `of_known_form` says the same.
            give(self.odds, both, target, 1.0 - SETTINGS.verdict_form)

    def no_cause_leaves_noise(self, bare: Ranked) -> None:
        """Where the re-tuned model leaves far more than noise, something unknown is there."""
        unknown, known = (best(x for x in self.fitted if kind_of(x.fit.hypothesis) == k) for k in (UNKNOWN, "known"))
        # Held against the noise as stated: the model's own factor on the noise takes up what is not the machine's.
        if self.held(bare).against_stated <= SETTINGS.verdict_misfit:
            return
        # What is white is noise, of a channel or an estimate, that is larger than stated.
        if bare.fit.correlation <= 1.0:
            return
        if unknown is None:
            # No element of unknown form was fitted: what this loses lies on something unknown.
            self.odds[bare.name] *= 1.0 - SETTINGS.verdict_form
        elif known is None or self.held(unknown).log_density >= self.held(known).log_density:
            give(self.odds, bare, unknown)
        else:
            # An element that predicts less than a known cause does is not what is there.
            self.odds[bare.name] = 0.0


def _by_chance(parameters: int) -> float:
    """Log density that so many parameters more gain or lose by chance, in nineteen of twenty campaigns."""
    return 0.5 * float(stats.chi2.ppf(SETTINGS.verdict_set, parameters)) if parameters else 0.0


def _at_one_port(h: Hypothesis) -> bool:
    """Whether two linear causes act between the same points: along the rail, or of a structure as a whole, parts differ."""
    [place, *others] = {e.place for e in h.effects}
    wide = (*ALONG_THE_RAIL, "structure")
    return h.linear and not others and not any(e.measurement for e in h.effects) and place not in wide


def _of_one_part(h: Hypothesis) -> bool:
    """Whether a known cause and an unknown element sit at one place, or are both of one channel of the measurement."""
    known, unknown = h.effects[0], h.effects[-1]
    channels = {getattr(known, "channel", ""), getattr(unknown, "port", "")}
    return known.place == unknown.place and (not unknown.measurement or len(channels) == 1)
