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

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from cutvib_ss.diagnosis.held_out import HeldOut, share
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS

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
    ranked: Sequence[Ranked], counts: Counts, variants: dict[tuple[str, str], int], left: float = 1.0
) -> dict[str, float]:
    """Probability of every hypothesis by name; they sum to one. The best leaves `left` times the noise on held-out records."""
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
    total = np.array(score) + (evidence - evidence.max()) / temperature(ranked, left)
    weight = np.exp(total - total.max())
    return dict(zip([r.name for r in ranked], (weight / weight.sum()).tolist(), strict=True))


def temperature(ranked: Sequence[Ranked], left: float) -> float:
    """By what differences of log evidence are divided, where the best leaves `left` times the noise on held-out records."""
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    return max(1.0, left, best.fit.chi2 / best.fit.count) * best.fit.correlation


def judged_on_held_out(
    ranked: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut], heat: float
) -> dict[str, float]:
    """
    Probabilities in which every hypothesis has to show on records that its fit has not seen; they sum to one or less.

    Differences of log evidence and of log predictive density are divided by `heat` (`temperature`).
    """
    out = dict(odds)
    bare = next((r for r in ranked if not r.fit.hypothesis.effects), None)
    asked = [r for r in ranked if out[r.name] >= SETTINGS.verdict_hardly]
    for r in asked:
        causes = r.fit.hypothesis.causes
        known = bool(causes) and all(effect != UNKNOWN for effect, _ in causes)
        if not known and held(r).reduced > SETTINGS.fit_run_away:
            # It shows that something unknown is there, but not what.
            out[r.name] = 0.0
        if known and bare:
            _by_both_leads(r, bare, out, held, heat)
        first = _first_alone(r, ranked) if len(causes) > 1 else None
        if first is None:
            continue
        if not known and causes[0][1] == causes[-1][1]:
            _of_one_place(r, first, bare, ranked, out, held)
        elif held(r).log_density >= held(first).log_density:
            if known and held(r).reduced > SETTINGS.verdict_noise:
                _second_is_not_proven(r, first, bare, ranked, out, held)
        elif known:
            _by_both_leads(r, first, out, held, heat)
        else:
            # What it predicts, the known part alone predicts better.
            _give(out, r, first)
    if bare and out[bare.name] >= SETTINGS.verdict_hardly:
        _no_cause_leaves_noise(bare, ranked, out, held)
    return out


def _first_alone(both: Ranked, ranked: Sequence[Ranked]) -> Ranked | None:
    """The better of a sum's known parts by itself."""
    parts = [(c,) for c in both.fit.hypothesis.causes if c[0] != UNKNOWN]
    alone = [x for x in ranked if x.refined and x.fit.hypothesis.causes in parts]
    return max(alone, key=lambda x: x.fit.log_evidence, default=None)


def _by_both_leads(
    r: Ranked, simpler: Ranked, odds: dict[str, float], held: Callable[[Ranked], HeldOut], heat: float
) -> None:
    """Share the probability of a hypothesis with a simpler one that predicts held-out records better."""
    predicted = held(r).log_density - held(simpler).log_density
    if predicted >= 0.0:
        return
    # The lead was estimated twice, by evidence and by prediction, and the two disagree in its sign: the mean of both decides, and
    # the hypothesis keeps half at most.
    lead = r.fit.log_evidence - simpler.fit.log_evidence
    both = odds[r.name] + odds[simpler.name]
    ratio = np.log(max(odds[r.name], 1e-300) / max(odds[simpler.name], 1e-300)) + (predicted - lead) / (2.0 * heat)
    kept = both * min(0.5, float(special.expit(ratio)))
    if kept < odds[r.name]:
        _give(odds, r, simpler, 1.0 - kept / odds[r.name])


def _of_one_place(
    both: Ranked,
    first: Ranked,
    bare: Ranked | None,
    ranked: Sequence[Ranked],
    odds: dict[str, float],
    held: Callable[[Ranked], HeldOut],
) -> None:
    """Pass on the probability of a known cause beside something unknown at its place: there is one part, of another form."""
    place = both.fit.hypothesis.causes[-1:]
    unknown = [x for x in ranked if x.refined and x.fit.hypothesis.causes == place]
    if not unknown:
        return
    # The kind is known where the cause alone closes most of the excess, and then keeps what such an answer keeps
    # (`of_known_form`).
    if share(held(bare) if bare else None, held(first), held(both)) > 0.5:
        _give(odds, both, first, SETTINGS.verdict_form)
    _give(odds, both, max(unknown, key=lambda x: x.fit.log_evidence))


def _no_cause_leaves_noise(
    bare: Ranked, ranked: Sequence[Ranked], odds: dict[str, float], held: Callable[[Ranked], HeldOut]
) -> None:
    """Where the re-tuned model leaves far more than noise, something unknown is there."""
    unknown = [x for x in ranked if x.refined and kind_of(x.fit.hypothesis) == UNKNOWN]
    # Held against the noise as stated: the model's own factor on the noise takes up what is not the machine's.
    if unknown and held(bare).against_stated > SETTINGS.verdict_misfit:
        _give(odds, bare, max(unknown, key=lambda x: x.fit.log_evidence))


def _second_is_not_proven(
    both: Ranked,
    first: Ranked,
    bare: Ranked | None,
    ranked: Sequence[Ranked],
    odds: dict[str, float],
    held: Callable[[Ranked], HeldOut],
) -> None:
    """Pass on the probability of two known causes that leave more than noise."""
    # What the form of a first cause leaves is structured: of many second causes some takes a part of it away. The first cause
    # alone is the answer where it closes all but a few percent, and else the first beside something unknown.
    if share(held(bare) if bare else None, held(first), held(both)) >= SETTINGS.verdict_closed:
        _give(odds, both, first)
        return
    beside = [x for x in ranked if x.refined and x.fit.hypothesis.causes[:1] == first.fit.hypothesis.causes]
    partly = [x for x in beside if x.fit.hypothesis.causes[-1][0] == UNKNOWN]
    target = max(partly, key=lambda x: x.fit.log_evidence, default=first)
    # If the second predicts more than something unknown does, its kind is right and its form is not known: it keeps what such an
    # answer keeps (`of_known_form`).
    better = held(both).log_density > held(target).log_density
    _give(odds, both, target, 1.0 - SETTINGS.verdict_form if better else 1.0)


def _give(odds: dict[str, float], one: Ranked, other: Ranked, part: float = 1.0) -> None:
    """Pass a part of one hypothesis' probability on to another."""
    odds[other.name] += part * odds[one.name]
    odds[one.name] -= part * odds[one.name]


def of_known_form(
    ranked: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut]
) -> dict[str, float]:
    """
    Probabilities in which an answer is not sure that only stands because its model errs by more than is believed.

    Where a parameter of a restoring force ends at what the motion allows, or discrepancies or tuned values lie beyond
    what is believed (`Fit.beyond_belief`), or held-out records show far more than noise as stated, the form is not known, and
    no more is the cause. What such answers lose lies on something unknown: with it the probabilities sum to one. A linear cause
    ends where another takes over: a resonance far above the band is a mass. Where an unknown element, too, leaves far more than
    noise, it may as well be a known cause in a form that nothing here has, and the nearest one has the rest.
    """
    out = dict(odds)
    known = [r for r in ranked if kind_of(r.fit.hypothesis) in ("known", "sums") and r.refined]
    for r in known:
        if out[r.name] < SETTINGS.verdict_hardly:
            continue
        beyond = bool(r.fit.at_end) and not r.fit.hypothesis.linear
        if beyond or r.fit.beyond_belief or held(r).against_stated > SETTINGS.verdict_misfit:
            out[r.name] *= SETTINGS.verdict_form
    named = [r for r in known if r.fit.hypothesis.causes[-1][0] != UNKNOWN]
    nearest = max(named, key=lambda r: r.fit.log_evidence, default=None)
    for r in ranked:
        if nearest is None or kind_of(r.fit.hypothesis) != UNKNOWN or out[r.name] < SETTINGS.verdict_hardly:
            continue
        if held(r).against_stated > SETTINGS.verdict_misfit:
            _give(out, r, nearest, 1.0 - SETTINGS.verdict_form)
    return out
