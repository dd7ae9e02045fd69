"""What may be concluded from the causes' probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from cutvib_ss.gap.calibration import probability_unknown, shipped
from cutvib_ss.gap.result import Cause, Verdict

SURE = 0.9
SET = 0.95


LINEAR_LEAVES = 2e-4
"""Part of the re-tuned model's excess that a right linear cause may leave: it is not simulated, and nothing in it is guessed."""


def sufficient(reduced: float, tuned: float, linear: bool) -> bool:
    """
    Whether what a cause leaves is no more than a right one would.

    Parameters
    ----------
    reduced : float
        Reduced χ² with the cause.
    tuned : float
        Reduced χ² of the re-tuned model.
    linear : bool
        Whether the cause is linear.

    Returns
    -------
    bool
        True up to the point at which "unknown" is as probable.
    """
    numbers = shipped()
    if linear:
        numbers = replace(numbers, of_the_gap=min(numbers.of_the_gap, LINEAR_LEAVES))
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
