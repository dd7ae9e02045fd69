"""
From evidence to probabilities: evidence times prior, normalised over all hypotheses.

Half of the prior lies on no cause. Known causes share theirs equally by effect and place, however many variants each has; an
unknown element shares its by place; sums of two share theirs as if all were tried. What was not fitted
on all lines counts nothing. Where even the best hypothesis leaves more than noise, its likelihood is wrong everywhere:
differences of log evidence are then divided by its reduced χ², on held-out records if that is more (quasi-likelihood,
McCullagh and Nelder 1989, chapter 9), and by the number of residuals that tell the same thing
(`likelihood.Directions.correlation`), but for the priors of tuning and calibration (`tempered`). What held-out records say of
them: `held_out_rules`; what an unknown form does: `known_form`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from cutvib_ss.diagnosis.held_out import HeldOut
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.tempered import tempered_evidence
from cutvib_ss.results import FloatArray

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
    """Probability of every hypothesis by name; they sum to one. Log evidence is tempered by `heat` (`temperature`)."""
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
    evidence = np.array([tempered_evidence(r.fit, heat) if r.refined else -np.inf for r in ranked])
    total = np.array(score) + evidence - evidence.max()
    weight = np.exp(total - total.max())
    return dict(zip([r.name for r in ranked], (weight / weight.sum()).tolist(), strict=True))


def temperature(best: HeldOut) -> float:
    """By what differences of log evidence are divided, for what the best hypothesis leaves."""
    fit = best.ranked.fit
    return max(1.0, best.reduced, fit.chi2 / fit.count) * fit.correlation


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


def that_are_means(
    ranked: Sequence[Ranked],
    odds: Mapping[str, float],
    held: Callable[[Ranked], HeldOut],
    changes: Mapping[int, FloatArray],
) -> dict[str, float]:
    """
    Probabilities in which linear causes give way to something unknown where the machine changes within records.

    The mean response of a machine that changes differs from that of the machine in between by no more than what it changes by. What
    a cause explains is that, or the cause: by the squares of both, over the noise. Together they may sum to less than one.
    """
    out, none = dict(odds), ranked[0]
    linear = [r for r in ranked[1:] if r.fit.hypothesis.linear and kind_of(r.fit.hypothesis) in ("known", "sums")]
    for r in linear if changes else ():
        if out[r.name] < SETTINGS.verdict_hardly:
            continue
        pairs = list(zip(held(none).records, held(r).records, strict=True))
        explained = sum(float(np.sum(np.abs(b.predicted - a.predicted) ** 2 * a.entry.precision)) for a, b in pairs)
        moved = sum(float(np.sum(changes.get(a.entry.record, 0.0) * a.entry.precision)) for a, _ in pairs)
        out[r.name] *= explained / (explained + moved) if explained > 0.0 else 0.0
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


def is_there(*fitted: Ranked) -> bool:
    """Whether no linear cause of some fits may as well be nothing; of restoring forces deviations say little of that."""
    return not any(e.linear for r in fitted for e in r.fit.of_no_size)


def best(ranked: Iterable[Ranked]) -> Ranked | None:
    """That of most evidence."""
    return max(ranked, key=lambda r: r.fit.log_evidence, default=None)


def give(odds: dict[str, float], one: Ranked, other: Ranked, part: float = 1.0) -> None:
    """Pass a part of one hypothesis' probability on to another."""
    odds[other.name] += part * odds[one.name]
    odds[one.name] -= part * odds[one.name]
