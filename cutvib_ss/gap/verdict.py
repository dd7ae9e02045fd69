"""
From fits to probabilities and a verdict.

Evidence is tempered: where even the best cause leaves more than noise, differences of χ² are divided by what it leaves, for a
likelihood that is wrong everywhere is no measure of confidence. Half of the prior lies on no cause at all. "Unknown" is judged on
held-out records: it takes its share by how much the best cause leaves there. The scales below are not calibrated against
sealed campaigns; the probabilities are to be read as an order of confidence.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from cutvib_ss.gap.result import Cause, Verdict

TEMPERATURE = 2.0
"""By which differences of log evidence are divided at best."""
DETECTION = 40.0
"""Log evidence that a cause has to bring over the re-tuned model: percent-level precision shows the model's own approximations."""
LEFT_OVER = (1.35, 0.05)
"""Reduced χ² on held-out records at which "unknown" is as probable as the best cause, and how quickly that turns …"""
OF_THE_GAP = 1e-3
"""… to which this part of the re-tuned model's excess is added: a law that closes 99.9 % of a gap a thousand times the noise is
right, though what it leaves (a discretisation, say) can be measured."""
SURE = 0.9
SET = 0.95


def probabilities(log_evidence: Mapping[str, float], reduced: float) -> dict[str, float]:
    """
    Probability of each cause and of none, "unknown" apart.

    Parameters
    ----------
    log_evidence : mapping of str to float
        By candidate; ``"none"`` among them.
    reduced : float
        Reduced χ² of the best of them, on the data they were fitted to.

    Returns
    -------
    dict of str to float
        Probabilities that sum to one.
    """
    names = list(log_evidence)
    heat = TEMPERATURE * max(1.0, reduced)
    causes = max(len(names) - 1, 1)
    score = np.array(
        [
            log_evidence[n] / heat + (np.log(0.5) if n == "none" else np.log(0.5 / causes) - DETECTION / heat)
            for n in names
        ]
    )
    weight = np.exp(score - score.max())
    return dict(zip(names, (weight / weight.sum()).tolist(), strict=True))


def probability_unknown(reduced: float, tuned: float = 1.0) -> float:
    """
    Share of "unknown", from what the best cause leaves on held-out records.

    Parameters
    ----------
    reduced : float
        Reduced χ² there.
    tuned : float
        Reduced χ² of the re-tuned model there.

    Returns
    -------
    float
        0 to 1.
    """
    if not np.isfinite(reduced):
        return 1.0
    centre = LEFT_OVER[0] + OF_THE_GAP * max(tuned - 1.0, 0.0)
    # Relative to the centre, so that a wide margin does not make a sharper edge.
    step = (reduced - centre) / (LEFT_OVER[1] * centre / LEFT_OVER[0])
    return float(1.0 / (1.0 + np.exp(-np.clip(step, -60, 60))))


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
