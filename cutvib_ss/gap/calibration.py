"""
From evidence to probabilities that come true: seven numbers, fitted to sealed campaigns and kept with the package.

Evidence is tempered: where even the best cause leaves more than noise, differences of χ² are divided by what it leaves, for a
likelihood that is wrong everywhere is no measure of confidence. Half of the prior lies on no cause at all. "Unknown" is judged on
held-out records: it takes its share by how much the best cause leaves there.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path

import numpy as np

FILE = Path(__file__).parent / "data" / "calibration.json"
"""Where the fitted numbers are kept; `cutvib blind calibrate` writes it."""


@dataclass(frozen=True)
class Calibration:
    """
    The numbers behind the stated probabilities.

    Parameters
    ----------
    temperature : float
        By which differences of log evidence are divided at best.
    detection : float
        Log evidence that each cause has to bring over the model without it: percent-level precision shows the model's own
        approximations.
    pairs : float
        Prior of all pairs of causes against all single ones.
    left_over : float
        Reduced χ² on held-out records at which "unknown" is as probable as all else.
    sharpness : float
        How quickly that turns, in reduced χ².
    of_the_gap : float
        Part of the re-tuned model's excess that is added to `left_over`: a law that closes 99.9 % of a gap a thousand times
        the noise is right, though what it leaves can be measured.
    doubt : float
        Part of all probability that is spread evenly: no answer is surer than this leaves it.
    """

    temperature: float = 2.0
    detection: float = 40.0
    pairs: float = 0.2
    left_over: float = 1.35
    sharpness: float = 0.05
    of_the_gap: float = 1e-3
    doubt: float = 0.0


@cache
def shipped() -> Calibration:
    """
    The numbers that ship with the package.

    Returns
    -------
    Calibration
        The fitted ones; those set by judgement where there is no file.
    """
    if not FILE.is_file():
        return Calibration()
    numbers = json.loads(FILE.read_text(encoding="utf-8"))["numbers"]
    return Calibration(**{f.name: float(numbers[f.name]) for f in fields(Calibration)})


@dataclass(frozen=True)
class Evidence:
    """
    What the fits say of one campaign.

    Parameters
    ----------
    log_evidence : mapping of str to float
        By candidate; ``"none"`` among them.
    causes : mapping of str to int
        How many causes act together in each candidate: 0, 1 or 2.
    reduced : float
        Reduced χ² of the best of them, on the data that they were fitted to.
    held : mapping of str to float
        Reduced χ² on held-out records, of ``"none"`` and of the candidates that were judged there.
    """

    log_evidence: Mapping[str, float]
    causes: Mapping[str, int]
    reduced: float
    held: Mapping[str, float]


def posterior(evidence: Evidence, numbers: Calibration) -> dict[str, float]:
    """
    Probability of every candidate, of none and of "unknown".

    Parameters
    ----------
    evidence : Evidence
        Of a campaign.
    numbers : Calibration
        The scales.

    Returns
    -------
    dict of str to float
        By candidate, and ``"unknown"``; they sum to one.
    """
    odds = tempered(evidence, numbers)
    judged = [name for name in odds if name in evidence.held]
    best = max(judged, key=lambda name: odds[name])
    unknown = probability_unknown(evidence.held[best], evidence.held["none"], numbers)
    even = numbers.doubt / (len(odds) + 1)
    out = {name: (1.0 - numbers.doubt) * (1.0 - unknown) * p + even for name, p in odds.items()}
    out["unknown"] = (1.0 - numbers.doubt) * unknown + even
    return out


def tempered(evidence: Evidence, numbers: Calibration) -> dict[str, float]:
    """
    Probability of each cause and of none, "unknown" apart.

    Parameters
    ----------
    evidence : Evidence
        Of a campaign.
    numbers : Calibration
        The scales.

    Returns
    -------
    dict of str to float
        By candidate; they sum to one.
    """
    heat = numbers.temperature * max(1.0, evidence.reduced)
    names = list(evidence.log_evidence)
    acting = np.array([evidence.causes[name] for name in names])
    singles = max(int(np.sum(acting == 1)), 1)
    # Half on none; of the other half, pairs share a part as if all pairs of causes had been tried.
    prior = np.log([0.5, 0.5 / singles, 0.5 * numbers.pairs / singles**2])[np.minimum(acting, 2)]
    score = np.array([evidence.log_evidence[name] for name in names]) / heat + prior - acting * numbers.detection / heat
    weight = np.exp(score - score.max())
    return dict(zip(names, (weight / weight.sum()).tolist(), strict=True))


def probability_unknown(reduced: float, tuned: float, numbers: Calibration) -> float:
    """
    Share of "unknown", from what the best cause leaves on held-out records.

    Parameters
    ----------
    reduced : float
        Reduced χ² there.
    tuned : float
        Reduced χ² of the re-tuned model there.
    numbers : Calibration
        The scales.

    Returns
    -------
    float
        0 to 1; 1 where the reduced χ² is not finite.
    """
    if not np.isfinite(reduced):
        return 1.0
    centre = numbers.left_over + numbers.of_the_gap * max(tuned - 1.0, 0.0)
    # Relative to the centre, so that a wide margin does not make a sharper edge.
    step = (reduced - centre) / (numbers.sharpness * centre / numbers.left_over)
    return float(1.0 / (1.0 + np.exp(-np.clip(step, -60.0, 60.0))))
