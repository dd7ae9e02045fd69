"""What may be concluded from the causes' probabilities."""

from __future__ import annotations

from collections.abc import Sequence

from cutvib_ss.gap.calibration import probability_unknown, shipped
from cutvib_ss.gap.result import Cause, Verdict

SURE = 0.9
SET = 0.95


def sufficient(reduced: float, tuned: float) -> bool:
    """
    Whether what a cause leaves is no more than a right one would.

    Parameters
    ----------
    reduced : float
        Reduced χ² with the cause.
    tuned : float
        Reduced χ² of the re-tuned model.

    Returns
    -------
    bool
        True up to the point at which "unknown" is as probable.
    """
    numbers = shipped()
    return probability_unknown(reduced, tuned, numbers) < 0.5 * numbers.most_unknown


def ambiguity_set(causes: Sequence[Cause]) -> tuple[int, ...]:
    """
    The smallest set of causes that carries 0.95.

    Parameters
    ----------
    causes : sequence of Cause
        Most probable first.

    Returns
    -------
    tuple of int
        Indices.
    """
    total, out = 0.0, []
    for i, cause in enumerate(causes):
        out.append(i)
        total += cause.probability
        if total >= SET - 1e-9:
            break
    return tuple(out)


def verdict(causes: Sequence[Cause]) -> Verdict:
    """
    What may be concluded.

    Parameters
    ----------
    causes : sequence of Cause
        Most probable first.

    Returns
    -------
    {"no_gap", "explained", "ambiguous", "unknown"}
        The verdict.
    """
    best = causes[0]
    if best.effect == "none":
        return "no_gap" if best.probability >= 0.5 else "ambiguous"
    if best.effect == "unknown":
        return "unknown"
    unknown = next((c.probability for c in causes if c.effect == "unknown"), 0.0)
    if unknown >= 0.5:
        return "unknown"
    return "explained" if best.probability >= SURE else "ambiguous"
