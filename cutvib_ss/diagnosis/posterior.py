"""
From evidence to probabilities: evidence times prior, normalised over all hypotheses.

Half of the prior lies on no cause. Known causes share theirs equally by effect and place, however many variants each has; an
unknown element shares its by place; sums of two share theirs as if all were tried. What was not fitted
on all lines counts nothing. Where even the best hypothesis leaves more than noise, its likelihood is wrong everywhere:
differences of log evidence are then divided by its reduced χ² (quasi-likelihood, McCullagh and Nelder 1989, chapter 9),
and by the number of residuals that tell the same thing (`likelihood.Directions.correlation`). So a second cause that takes away
part of what the form of the first leaves does not pass for known: it has to leave noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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
    effects = hypothesis.effects
    if len(effects) < 2:
        return "none" if not effects else "unknown" if effects[0].effect == UNKNOWN else "known"
    return "sums"


def probabilities(ranked: Sequence[Ranked], counts: Counts, variants: dict[tuple[str, str], int]) -> dict[str, float]:
    """Probability of every hypothesis by name; they sum to one."""
    share = {"none": 1.0, "known": 1.0 / max(counts.known, 1), "unknown": 1.0 / max(counts.unknown, 1)}
    share["sums"] = 1.0 / counts.sums
    score = []
    for r in ranked:
        h = r.fit.hypothesis
        prior = SETTINGS.priors[kind_of(h)] * share[kind_of(h)] / max(variants.get((h.effect, h.place), 1), 1)
        score.append(np.log(prior))
    # What was not fitted on all lines has no evidence to count with: it lay far behind on few.
    evidence = np.array([r.fit.log_evidence if r.refined else -np.inf for r in ranked])
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    heat = max(1.0, best.fit.chi2 / best.fit.count) * best.fit.correlation
    total = np.array(score) + (evidence - evidence.max()) / heat
    weight = np.exp(total - total.max())
    return dict(zip([r.name for r in ranked], (weight / weight.sum()).tolist(), strict=True))
