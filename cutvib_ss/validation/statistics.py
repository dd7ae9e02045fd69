"""Intervals and calibration figures: pure functions of arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from cutvib_ss.results import FloatArray

BOOTSTRAPS = 4000
SIMULATIONS = 4000
BINS = 10


@dataclass(frozen=True)
class Estimate:
    """A figure with its interval."""

    value: float  # The figure; NaN without cases
    low: float  # 95 % interval
    high: float
    cases: int  # Cases behind it


def proportion(hits: Sequence[bool]) -> Estimate:
    """
    Part of cases that hold, with the exact interval of Clopper and Pearson.

    >>> estimate = proportion([False] * 300)
    >>> estimate.value, round(estimate.high, 4)
    (0.0, 0.0122)
    """
    n = len(hits)
    if n == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    k = int(np.sum(np.asarray(hits, dtype=bool)))
    interval = stats.binomtest(k, n).proportion_ci(0.95, method="exact")
    return Estimate(k / n, float(interval.low), float(interval.high), n)


def resampled(
    values: Sequence[float], figure: Callable[[FloatArray], FloatArray] = lambda v: np.mean(v, axis=-1)
) -> Estimate:
    """A figure of a sample, by default its mean, with a bootstrap interval over the cases."""
    sample = np.asarray(values, dtype=np.float64)
    if sample.size == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    pick = np.random.default_rng(0).integers(0, sample.size, (BOOTSTRAPS, sample.size))
    low, high = np.quantile(figure(sample[pick]), [0.025, 0.975])
    return Estimate(float(figure(sample)), float(low), float(high), sample.size)


def quantile(values: Sequence[float], q: float) -> Estimate:
    """A quantile with the interval that order statistics give it."""
    sample = np.sort(np.asarray(values, dtype=np.float64))
    n = sample.size
    if n == 0:
        return Estimate(np.nan, np.nan, np.nan, 0)
    # The number of values below the quantile is binomial, whatever their distribution.
    below, above = int(stats.binom.ppf(0.025, n, q)), int(stats.binom.ppf(0.975, n, q)) + 1
    low = sample[below - 1] if below > 0 else -np.inf
    high = sample[above - 1] if above <= n else np.inf
    return Estimate(float(np.quantile(sample, q)), float(low), float(high), n)


@dataclass(frozen=True)
class Bin:
    """Answers of about one confidence."""

    low: float  # Limits of the confidence
    high: float
    confidence: float  # Mean confidence; NaN in an empty bin
    right: Estimate  # Part of them that is right


def reliability(confidence: Sequence[float], right: Sequence[bool]) -> tuple[Bin, ...]:
    """How often answers are right, by how sure they were."""
    p, hit = np.asarray(confidence, dtype=np.float64), np.asarray(right, dtype=bool)
    which = _bin_of(p)
    out = []
    for k in range(BINS):
        own = which == k
        mean = float(p[own].mean()) if own.any() else np.nan
        out.append(Bin(k / BINS, (k + 1) / BINS, mean, proportion(hit[own].tolist())))
    return tuple(out)


def calibration_error(confidence: Sequence[float], right: Sequence[bool]) -> float:
    """
    Expected calibration error: mean distance of stated and true rates over ten bins, weighted by their cases.

    Guo, Pleiss, Sun, Weinberger, "On calibration of modern neural networks" (2017), Eq. 5.
    """
    return float(_errors(np.asarray(confidence, dtype=np.float64), np.asarray(right, dtype=np.float64)[None])[0])


def calibration_error_if_perfect(confidence: Sequence[float]) -> tuple[float, float]:
    """What the expected calibration error would be if every stated probability came true: chance alone."""
    p = np.asarray(confidence, dtype=np.float64)
    if p.size == 0:
        return np.nan, np.nan
    right = np.random.default_rng(0).random((SIMULATIONS, p.size)) < p
    errors = _errors(p, right.astype(np.float64))
    return float(errors.mean()), float(np.quantile(errors, 0.95))


def _bin_of(confidence: FloatArray) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    # A bin holds its upper end, as the last one must.
    return np.clip(np.ceil(confidence * BINS).astype(np.int64) - 1, 0, BINS - 1)


def _errors(confidence: FloatArray, right: FloatArray) -> FloatArray:
    """Calibration error of each row of ``right``."""
    if confidence.size == 0:
        return np.full(right.shape[0], np.nan)
    member = (_bin_of(confidence)[:, None] == np.arange(BINS)).astype(np.float64)
    out: FloatArray = np.abs((right - confidence) @ member).sum(axis=1) / confidence.size
    return out


def risk_coverage(confidence: Sequence[float], right: Sequence[bool]) -> tuple[FloatArray, FloatArray]:
    """Part of wrong answers among the surest, against how many are counted in."""
    p, wrong = np.asarray(confidence, dtype=np.float64), 1.0 - np.asarray(right, dtype=np.float64)
    order = np.argsort(-p, kind="stable")
    p, wrong = p[order], wrong[order]
    n = np.arange(1, p.size + 1)
    last = np.append(p[1:] != p[:-1], True) if p.size else np.zeros(0, dtype=bool)
    return (n / max(p.size, 1))[last], (np.cumsum(wrong) / n)[last]
