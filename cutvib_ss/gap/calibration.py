"""
From evidence to probabilities that come true: nine numbers, fitted to sealed campaigns and kept with the package.

Evidence is tempered: where even the best cause leaves more than noise, differences of χ² are divided by what it leaves, for a
likelihood that is wrong everywhere is no measure of confidence. Half of the prior lies on no cause at all. "Unknown" is judged on
held-out records: it takes its share by how much the best cause leaves there, and never all, for a search may have missed the cause.
A shifted length or damping coefficient leaves it a share however well it fits: what nobody has catalogued often acts as one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cutvib_ss.results import FloatArray

FILE = Path(__file__).parent / "data" / "calibration.json"
"""Where the fitted numbers are kept; `cutvib blind calibrate` writes it."""


HOTTER = 3.0
"""How much higher the temperature of doubt is, and how much softer the edge of "unknown" is there."""


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
    most_unknown : float
        Largest share of "unknown" before doubt.
    doubt : float
        Part of all probability that goes by a judgement `HOTTER` times as hesitant: what comes close behind is never ruled out.
    unspecific : float
        Part of the probability of an unspecific cause that goes to "unknown": a spring beside the tool acts as another length
        of the tool would, a damper of another law as another damping.
    """

    temperature: float = 2.0
    detection: float = 40.0
    pairs: float = 0.2
    left_over: float = 1.13
    sharpness: float = 0.015
    of_the_gap: float = 1e-4
    most_unknown: float = 0.9
    doubt: float = 0.02
    unspecific: float = 0.3


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
    unspecific : frozenset of str
        Candidates as which causes outside the catalogue appear.
    """

    log_evidence: Mapping[str, float]
    causes: Mapping[str, int]
    reduced: float
    held: Mapping[str, float] = field(default_factory=dict)
    unspecific: frozenset[str] = frozenset()


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
    log_evidence, acting = _arrays(evidence)
    unspecific = np.array([name in evidence.unspecific for name in evidence.log_evidence])
    judged = {name: left if np.isfinite(left) else np.inf for name, left in evidence.held.items()}
    held = np.array([judged.get(name, np.nan) for name in evidence.log_evidence])
    shares = posteriors(log_evidence, acting, unspecific, held, np.float64(evidence.reduced), judged["none"], numbers)
    return dict(zip([*evidence.log_evidence, "unknown"], shares.tolist(), strict=True))


def tempered(evidence: Evidence, numbers: Calibration) -> dict[str, float]:
    """
    Probability of each cause and of none, "unknown" apart.

    Parameters
    ----------
    evidence : Evidence
        Of a campaign; nothing need be judged yet.
    numbers : Calibration
        The scales.

    Returns
    -------
    dict of str to float
        By candidate; they sum to one.
    """
    odds = _odds(*_arrays(evidence), np.float64(evidence.reduced), numbers)
    return dict(zip(evidence.log_evidence, odds.tolist(), strict=True))


def posteriors(
    log_evidence: FloatArray,
    acting: FloatArray,
    unspecific: NDArray[np.bool_],
    held: FloatArray,
    reduced: ArrayLike,
    tuned: ArrayLike,
    numbers: Calibration,
) -> FloatArray:
    """
    Probabilities of many campaigns at once.

    Parameters
    ----------
    log_evidence : ndarray, shape (..., candidate)
        Minus infinity where a campaign has fewer candidates than others.
    acting : ndarray, shape (..., candidate)
        How many causes act together in each: 0, 1 or 2.
    unspecific : ndarray of bool, shape (..., candidate)
        As which of them causes outside the catalogue appear.
    held : ndarray, shape (..., candidate)
        Reduced χ² on held-out records; NaN where not judged.
    reduced, tuned : array_like, shape (...)
        Reduced χ² of the best candidate on what it was fitted to, and of the re-tuned model on held-out records.
    numbers : Calibration
        The scales.

    Returns
    -------
    ndarray, shape (..., candidate + 1)
        Shares of the candidates, then that of "unknown".
    """
    odds = _odds(log_evidence, acting, reduced, numbers)
    best = np.argmax(np.where(np.isnan(held), -1.0, odds), axis=-1)
    left = np.take_along_axis(held, best[..., None], axis=-1)[..., 0]

    def shares(odds: FloatArray, sharpness: float) -> FloatArray:
        at = replace(numbers, sharpness=sharpness)
        unknown = _unknown(left, np.asarray(tuned, dtype=np.float64), at)[..., None]
        # What may have been missed is no more probable for that.
        share = np.maximum(unknown, numbers.unspecific * unspecific)
        return np.concatenate([(1.0 - share) * odds, np.sum(share * odds, axis=-1, keepdims=True)], axis=-1)

    hot = replace(numbers, temperature=HOTTER * numbers.temperature)
    hesitant = shares(_odds(log_evidence, acting, reduced, hot), HOTTER * numbers.sharpness)
    return np.asarray((1.0 - numbers.doubt) * shares(odds, numbers.sharpness) + numbers.doubt * hesitant)


def _arrays(evidence: Evidence) -> tuple[FloatArray, FloatArray]:
    names = evidence.log_evidence
    return np.array([names[n] for n in names]), np.array([float(evidence.causes[n]) for n in names])


def _odds(log_evidence: FloatArray, acting: FloatArray, reduced: ArrayLike, numbers: Calibration) -> FloatArray:
    heat = numbers.temperature * np.maximum(1.0, reduced)[..., None]
    real = np.isfinite(log_evidence)
    singles = np.maximum(np.sum(real & (acting == 1), axis=-1, keepdims=True), 1)
    # Half on none; of the other half, pairs share a part as if all pairs of causes had been tried.
    prior = np.log(np.select([acting == 0, acting == 1], [0.5, 0.5 / singles], 0.5 * numbers.pairs / singles**2))
    score = (log_evidence - acting * numbers.detection) / heat + prior
    weight = np.exp(score - score.max(axis=-1, keepdims=True))
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))


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
        0 to `most_unknown`.
    """
    return float(_unknown(np.float64(reduced), np.float64(tuned), numbers))


def _unknown(reduced: ArrayLike, tuned: FloatArray | np.float64, numbers: Calibration) -> FloatArray:
    centre = numbers.left_over + numbers.of_the_gap * np.clip(tuned - 1.0, 0.0, 1e9)
    # Relative to the centre, so that a wide margin does not make a sharper edge. What is not finite is beyond all edges.
    left = np.where(np.isfinite(reduced), reduced, 1e12)
    step = (left - centre) / (numbers.sharpness * centre / numbers.left_over)
    return np.asarray(numbers.most_unknown / (1.0 + np.exp(-np.clip(step, -60.0, 60.0))))
