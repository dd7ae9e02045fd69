"""
From evidence to probabilities: evidence times prior, normalised over all hypotheses.

Half of the prior lies on no cause. Known causes share theirs equally by effect and place, however many variants each has; an
unknown element shares its by place; sums of two share theirs as if all were tried. What was not fitted
on all lines counts nothing. Where even the best hypothesis leaves more than noise, its likelihood is wrong everywhere:
differences of log evidence are then divided by its reduced χ², on held-out records if that is more (quasi-likelihood,
McCullagh and Nelder 1989, chapter 9), and by the number of residuals that tell the same thing
(`likelihood.Directions.correlation`). A second known cause has to leave noise (`judged_on_held_out`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special, stats

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.held_out import HeldOut, share
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Effect

UNKNOWN = "unknown"


@dataclass(frozen=True)
class Counts:
    """How many causes (effect and place) and places of an unknown element were considered; sums are of two of these."""

    known: int
    unknown: int

    @property
    def sums(self) -> int:
        """Pairs of causes, and of a cause and an unknown element."""
        return max(self.known * (self.known - 1) // 2 + self.known * self.unknown, 1)


def kind_of(hypothesis: Hypothesis) -> str:
    """``"none"``, ``"known"``, ``"unknown"`` or ``"sums"``."""
    causes = hypothesis.causes
    if len(causes) < 2:
        return "none" if not causes else "unknown" if causes[0][0] == UNKNOWN else "known"
    return "sums"


def probabilities(
    ranked: Sequence[Ranked], counts: Counts, variants: dict[tuple[str, str], int], heat: float
) -> dict[str, float]:
    """Probability of every hypothesis by name; they sum to one. Log evidence counts divided by `heat` (`temperature`)."""
    share = {"none": 1.0, "known": 1.0 / max(counts.known, 1), "unknown": 1.0 / max(counts.unknown, 1)}
    share["sums"] = 1.0 / counts.sums
    score = []
    for r in ranked:
        h = r.fit.hypothesis
        # A cause that takes two values or channels at once is one of as many variants as there are pairs of them.
        each = max(variants.get((h.effect, h.place), 1), 1) ** (len(h.effects) if len(h.causes) == 1 else 1)
        prior = SETTINGS.priors[kind_of(h)] * share[kind_of(h)] / each
        score.append(np.log(prior))
    # What was not fitted on all lines has no evidence to count with: it lay far behind on few.
    evidence = np.array([r.fit.log_evidence if r.refined else -np.inf for r in ranked])
    total = np.array(score) + (evidence - evidence.max()) / heat
    weight = np.exp(total - total.max())
    return dict(zip([r.name for r in ranked], (weight / weight.sum()).tolist(), strict=True))


def temperature(best: HeldOut) -> float:
    """By what differences of log evidence are divided, for what the best hypothesis leaves."""
    fit = best.ranked.fit
    return max(1.0, best.reduced, fit.chi2 / fit.count) * fit.correlation


def judged_on_held_out(
    ranked: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut], heat: float
) -> dict[str, float]:
    """
    Probabilities in which every hypothesis has to show on records that its fit has not seen; they sum to one or less.

    Differences of log evidence and of log predictive density are divided by `heat` (`temperature`).
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
        if self.bare and (known or kind_of(r.fit.hypothesis) == UNKNOWN):
            self.by_both_leads(r, self.bare)
        if kind_of(r.fit.hypothesis) == UNKNOWN:
            self.with_what_predicts_more(r)
        parts = [(c,) for c in causes if c[0] != UNKNOWN]
        first = _best(x for x in self.fitted if x.fit.hypothesis.causes in parts) if len(causes) > 1 else None
        if first is None:
            return
        if not known and _of_one_part(r.fit.hypothesis):
            self.of_one_place(r, first)
        elif held(r).log_density >= held(first).log_density:
            if known and self.is_doubtful(r):
                self.second_is_not_proven(r, first)
        elif known:
            self.by_both_leads(r, first)
        else:
            # What it predicts, the known part alone predicts better.
            _give(self.odds, r, first)

    def is_doubtful(self, both: Ranked) -> bool:
        """Whether two known causes leave more than noise, or less only because their model errs by more than is believed."""
        return self.held(both).reduced > SETTINGS.verdict_noise or _of_another_form(both, self.held)

    def closed(self, first: Ranked, both: Ranked) -> float:
        """Part of the excess that the first of two parts closes alone."""
        return share(self.held(self.bare) if self.bare else None, self.held(first), self.held(both))

    def without_what_may_be_nothing(self, r: Ranked, fit: Fit, part: float = 1.0) -> bool:
        """Pass on the probability of causes of which one may be nothing in a fit, unless it is there: the rest is discrepancy."""
        less = self.with_what_is_there(fit)
        # The strength and the stiffness of a restoring force are known along a ridge that does not pass through nothing: there its
        # deviation says little, and what it predicts of other records decides.
        if less is not None:
            predicted = self.held(r).log_density - self.held(less).log_density
            if not r.fit.hypothesis.linear and predicted > _by_chance(len(r.fit.stds)):
                return False
            _give(self.odds, r, less, part)
        return True

    def within_tolerance(self, r: Ranked) -> None:
        """Pass on most of the probability of causes of which one is no more than its part may differ from the model by itself."""
        # The tolerance is that of a matrix, and tuning moves all of it: its parts differ among themselves by as much.
        less = self._without(r.fit, r.fit.tolerated)
        if less is not None:
            _give(self.odds, r, less, SETTINGS.verdict_form)

    def with_what_is_there(self, fit: Fit) -> Ranked | None:
        """The best hypothesis of those causes of which a fit holds that they are there."""
        return self._without(fit, fit.of_no_size)

    def _without(self, fit: Fit, effects: Sequence[Effect]) -> Ranked | None:
        """The best hypothesis of the causes of a fit but for some."""
        rest = Hypothesis(tuple(e for e in fit.hypothesis.effects if e not in effects))
        return _best(x for x in self.fitted if x.fit.hypothesis.causes == rest.causes)

    def without_what_is_only_its_error(self, r: Ranked) -> None:
        """Pass on the probability of causes of which one is nothing without its discrepancy; a single one is something unknown."""
        less = self.with_what_is_there(r.fit.corrected)
        if less is None or not less.fit.hypothesis.effects:
            self.odds[r.name] = 0.0
        else:
            _give(self.odds, r, less if self.is_enough(less, r) else self.beside_something(less))

    def by_both_leads(self, r: Ranked, simpler: Ranked) -> None:
        """Share the probability of a hypothesis with a simpler one that predicts held-out records better."""
        predicted = self.held(r).log_density - self.held(simpler).log_density
        # What a value tuned far out of its tolerance predicts, its shift predicts as well: the lead is the prior's, and what more
        # parameters cost by chance says nothing against it.
        if predicted >= (-_by_chance(len(r.fit.stds)) if simpler.fit.tuned_away else 0.0):
            return
        # The lead was estimated twice, by evidence and by prediction, and the two disagree in its sign: the mean of both decides,
        # and the hypothesis keeps half at most.
        lead = r.fit.log_evidence - simpler.fit.log_evidence
        own, other = self.odds[r.name], self.odds[simpler.name]
        ratio = np.log(max(own, 1e-300) / max(other, 1e-300)) + (predicted - lead) / (2.0 * self.heat)
        kept = (own + other) * min(0.5, float(special.expit(ratio)))
        if kept < own:
            _give(self.odds, r, simpler, 1.0 - kept / own)

    def with_what_predicts_more(self, unknown: Ranked) -> None:
        """Share the probability of an unknown element with a known cause of its place that predicts held-out records better."""
        place = unknown.fit.hypothesis.place
        known = _best(
            x for x in self.fitted if kind_of(x.fit.hypothesis) == "known" and x.fit.hypothesis.place == place
        )
        if known and self.held(known).log_density > self.held(unknown).log_density:
            # Evidence says that its form is not the known one, prediction that it is: neither is sure.
            _give(self.odds, unknown, known, 0.5)

    def mainly_known(self, unknown: Ranked) -> None:
        """Pass on the probability of an unknown element to a known cause with it beside, which closes most of the excess alone."""
        place = unknown.fit.hypothesis.place
        sums = [x for x in self.fitted if kind_of(x.fit.hypothesis) == "sums" and _of_one_part(x.fit.hypothesis)]
        both = _best(x for x in sums if x.fit.hypothesis.causes[-1] == (UNKNOWN, place))
        if both is None:
            return
        first = _best(x for x in self.fitted if x.fit.hypothesis.causes == both.fit.hypothesis.causes[:1])
        # The smooth function of the element holds what the cause does as well; that the cause is there, the cause shows. Beside the
        # cause the element takes what it took, or both are another explanation, and a worse one.
        if first and _is_there(first, both) and self.closed(first, unknown) > 0.5:
            alone, beside = (x.fit.log_evidence - first.fit.log_evidence for x in (unknown, both))
            if beside > 0.5 * alone:
                _give(self.odds, unknown, both)

    def of_one_place(self, both: Ranked, first: Ranked) -> None:
        """Pass on the probability of a known cause beside something unknown at its place: there is one part, of another form."""
        place = both.fit.hypothesis.causes[-1:]
        unknown = _best(x for x in self.fitted if x.fit.hypothesis.causes == place)
        if unknown is None:
            return
        # The kind is known where the cause alone closes most of the excess. It keeps what such an answer keeps if it leaves far
        # more than noise (`of_known_form`).
        _give(self.odds, both, first if _is_there(first, both) and self.closed(first, both) > 0.5 else unknown)

    def is_enough(self, first: Ranked, both: Ranked) -> bool:
        """Whether the first of two causes alone closes all but a few percent of the excess."""
        return self.closed(first, both) >= SETTINGS.verdict_closed

    def beside_something(self, first: Ranked) -> Ranked:
        """A cause beside something unknown; alone, if no such fit is at hand."""
        beside = [x for x in self.fitted if x.fit.hypothesis.causes[:1] == first.fit.hypothesis.causes]
        return _best(x for x in beside if x.fit.hypothesis.causes[-1][0] == UNKNOWN) or first

    def second_is_not_proven(self, both: Ranked, first: Ranked) -> None:
        """Pass on the probability of two known causes that leave more than noise."""
        # What the form of a first cause leaves is structured: of many second causes some takes a part of it away.
        if self.is_enough(first, both):
            _give(self.odds, both, first)
            return
        target = self.beside_something(first)
        # If the second predicts more than something unknown does, its kind is right and its form is not known: it keeps what such
        # an answer keeps (`of_known_form`).
        better = self.held(both).log_density > self.held(target).log_density
        _give(self.odds, both, target, 1.0 - SETTINGS.verdict_form if better else 1.0)

    def no_cause_leaves_noise(self, bare: Ranked) -> None:
        """Where the re-tuned model leaves far more than noise, something unknown is there."""
        unknown = _best(x for x in self.fitted if kind_of(x.fit.hypothesis) == UNKNOWN)
        # Held against the noise as stated: the model's own factor on the noise takes up what is not the machine's.
        left = self.held(bare).against_stated
        if unknown and left > SETTINGS.verdict_misfit:
            _give(self.odds, bare, unknown)
        elif left > SETTINGS.fit_hopeless:
            # No element of unknown form was fitted: what this loses lies on something unknown.
            self.odds[bare.name] *= 1.0 - SETTINGS.verdict_form


def that_drift_by_chance(
    ranked: Sequence[Ranked], odds: Mapping[str, float], chance: Callable[[Ranked], float]
) -> dict[str, float]:
    """
    Probabilities in which a linear answer whose records drift in the order of their levels gives way to something unknown.

    Drift does not ask for the level, so that it orders by chance alone, with a probability of p: whatever something unknown would
    do, the evidence against that is no more than 1/(-e p ln p) (Sellke, Bayarri and Berger 2001, The American Statistician 55,
    62-71). Or it is a trend in time, of a machine that warms, and every session was measured from soft to hard (`level_trend`).
    What such an answer keeps follows from these and the priors of no cause and of something unknown. With the rest the
    probabilities sum to one.
    """
    out = dict(odds)
    linear = [r for r in ranked if r.fit.hypothesis.linear and kind_of(r.fit.hypothesis) in ("none", "known")]
    for r in linear:
        if out[r.name] >= SETTINGS.verdict_hardly and (p := chance(r)) < SETTINGS.level_drift:
            ordered = SETTINGS.level_trend + (1.0 - SETTINGS.level_trend) * float(special.entr(p)) * np.e
            out[r.name] *= 1.0 / (1.0 + SETTINGS.priors["unknown"] / (SETTINGS.priors["none"] * ordered))
    return out


def that_may_hide(
    odds: Mapping[str, float],
    none: str,
    known: Mapping[tuple[str, str], float],
    evidence: Mapping[tuple[str, str], float],
    counts: Counts,
) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """
    Probabilities beside the answer that there is no cause, with those of causes too small to be seen; all sum to what they did.

    A fit to one of them stops anywhere, and is held for nothing. But its evidence is known, to first order: that of no cause times
    `evidence`, for whatever the records allow of the prior of its size is as likely as nothing. It counts once at most: what
    speaks for a cause is for its fit to say. `known` is what causes have of their fits.
    """
    ratio = SETTINGS.priors["known"] / max(counts.known, 1) / SETTINGS.priors["none"]
    more = {c: max(odds[none] * ratio * min(e, 1.0) - known.get(c, 0.0), 0.0) for c, e in evidence.items()}
    whole = 1.0 + sum(more.values())
    return {name: p / whole for name, p in odds.items()}, {c: p / whole for c, p in more.items()}


def _by_chance(parameters: int) -> float:
    """Log density that so many parameters more gain or lose by chance, in nineteen of twenty campaigns."""
    return 0.5 * float(stats.chi2.ppf(SETTINGS.verdict_set, parameters)) if parameters else 0.0


def _is_there(*fitted: Ranked) -> bool:
    """Whether no linear cause of some fits may as well be nothing; of restoring forces deviations say little of that."""
    return not any(e.linear for r in fitted for e in r.fit.of_no_size)


def _of_one_part(h: Hypothesis) -> bool:
    """Whether a known cause and an unknown element sit at one place, or are both of one channel of the measurement."""
    known, unknown = h.effects[0], h.effects[-1]
    channels = {getattr(known, "channel", ""), getattr(unknown, "port", "")}
    return known.place == unknown.place and (not unknown.measurement or len(channels) == 1)


def _of_another_form(r: Ranked, held: Callable[[Ranked], HeldOut]) -> bool:
    """Whether causes only stand because their model errs by more than is believed."""
    beyond = bool(r.fit.at_end) and not r.fit.hypothesis.linear
    return beyond or r.fit.beyond_belief or held(r).against_stated > SETTINGS.verdict_misfit


def _leaves_more(cause: HeldOut, bare: HeldOut) -> bool:
    """Whether a cause leaves a larger error of held-out records than the re-tuned model, by more than its standard error."""
    more = np.array([j.squares - other.squares for j, other in zip(cause.records, bare.records, strict=True)])
    return bool(more.mean() > np.std(more, ddof=1) / np.sqrt(more.size)) if more.size > 1 else False


def _best(ranked: Iterable[Ranked]) -> Ranked | None:
    """That of most evidence."""
    return max(ranked, key=lambda r: r.fit.log_evidence, default=None)


def _give(odds: dict[str, float], one: Ranked, other: Ranked, part: float = 1.0) -> None:
    """Pass a part of one hypothesis' probability on to another."""
    odds[other.name] += part * odds[one.name]
    odds[one.name] -= part * odds[one.name]


def of_known_form(
    ranked: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut]
) -> dict[str, float]:
    """
    Probabilities in which an answer whose form nothing here has is not sure.

    Where a parameter of a restoring force ends at what the motion allows, or discrepancies or tuned values lie beyond
    what is believed (`Fit.beyond_belief`), or held-out records show far more than noise as stated, or a larger error than the
    re-tuned model has there, the form is not known, and no more is the cause. What such answers lose lies on something unknown:
    with it the probabilities sum to one. A linear cause ends where another takes over: a resonance far above the band is a mass.

    An unknown element has no form that could err, but a known cause in a form that the catalogue lacks fits no other hypothesis
    either: no evidence tells the two apart, and priors have to. A known cause of its place is the answer in another form, and
    keeps what such an answer keeps, where it leaves no more of what the element explains than the largest error of its dynamic
    stiffness that is believed: squared, since the excess is of squares. Else the nearest known cause has the rest of an unknown
    element, and of a known cause beside one the nearest pair of that cause with another known one, where it leaves no more than
    noise.
    """
    out = dict(odds)
    likely = [r for r in ranked if odds[r.name] >= SETTINGS.verdict_hardly and r.fit.hypothesis.causes]
    bare = next((r for r in ranked if r.refined and not r.fit.hypothesis.effects), None)
    strained = [
        r
        for r in likely
        if kind_of(r.fit.hypothesis) != UNKNOWN
        and r.refined
        and (_of_another_form(r, held) or (bare is not None and _leaves_more(held(r), held(bare))))
    ]
    for r in strained:
        out[r.name] *= SETTINGS.verdict_form
    # What may as well be nothing is no form of anything.
    named = [r for r in ranked if r.refined and UNKNOWN not in dict(r.fit.hypothesis.causes) and _is_there(r)]
    for r in [r for r in likely if r not in strained and r.fit.hypothesis.causes[-1][0] == UNKNOWN]:
        known, part = _another_form(r, named, out, held)
        if known:
            _give(out, r, known, part)
    return out


def _another_form(
    r: Ranked, named: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut]
) -> tuple[Ranked | None, float]:
    """The known cause that something unknown may be in another form, and the part of its probability that it has then."""
    *first, _ = r.fit.hypothesis.causes
    rest = 1.0 - SETTINGS.verdict_form
    if first:
        nearest = _best(x for x in named if len(x.fit.hypothesis.causes) > 1 and first[0] in x.fit.hypothesis.causes)
        return (nearest, rest) if nearest and held(nearest).reduced <= SETTINGS.verdict_noise else (None, rest)
    single = [x for x in named if kind_of(x.fit.hypothesis) == "known"]
    bare = _best(x for x in named if not x.fit.hypothesis.causes)
    here = _best(x for x in single if x.fit.hypothesis.place == r.fit.hypothesis.place)
    if bare and here and _as_much(held(here).squares, held(r).squares, held(bare).squares):
        # Of what both have together it keeps as much as the answer in another form does.
        both = odds[here.name] + odds[r.name]
        return here, max(SETTINGS.verdict_form * both - odds[here.name], 0.0) / odds[r.name]
    return _best(x for x in named if x.fit.hypothesis.causes), rest


def _as_much(known: float, unknown: float, bare: float) -> bool:
    """Whether a known cause closes what an unknown element does but for the largest error of a cause, by their mean squares."""
    return known < bare and known - unknown <= SETTINGS.sizes["cause"][-1][0] ** 2 * (bare - unknown)
