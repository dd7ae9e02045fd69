"""
What the data determine: singular values of the weighted Jacobian, and intervals for the combinations they reach.

The fit minimises |r(u)|² over u, the parameters as parts of the ranges between their bounds. Its weights are not the
inverse variances of the noise, so its covariance is A⁻¹ (Jᵀ Σ J) A⁻¹ with A = Jᵀ J and Σ the noise of the weighted
residuals: what the measurement knows of its noise or the scatter about the fit, whichever is larger, and what is not
known of each channel's sensitivity, which moves all its values together. Where the data say nothing A is singular;
there the bounds are what is known, an even distribution of variance 1/12 in u, which joins as further residuals. A
parameter or combination counts as determined where less than a third of what the bounds leave is left, and that not
because of the bounds on others.

Bounds push the fit aside where the noise would carry it beyond. The estimate of a combination is therefore that of the
data alone, one Gauss-Newton step from the fit; a parameter on a bound is reported as such.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from scipy import stats

from cutvib_ss.identification.bounded_fit import HeadFit, vector
from cutvib_ss.identification.fitted_data import FitData
from cutvib_ss.identification.tool_side import TOOL_SIDE_UNITS, tool_side, tool_side_gradient
from cutvib_ss.model.head import HEAD_PARAMETERS, HEAD_UNITS
from cutvib_ss.results import FloatArray, read_only

Status: TypeAlias = Literal["determined", "not determined", "on lower bound", "on upper bound"]

_BOUNDS_VARIANCE = 1.0 / 12.0
_DETERMINED = 1.0 / 3.0
_BORROWED = 1.0 / 3.0  # largest variance that comes from the bounds, over that which comes from the data
_ROUNDING = 1e-10
_SMOOTH_NORM = (1.0 + 1.0 / 3.0 + 1.0 / 5.0) ** 0.5  # root of the summed mean squares of P_0, P_1 and P_2
_SAME_AS_PARAMETER = {"tool_mass": "m2"}


@dataclass(frozen=True)
class Estimate:
    """
    A parameter or a combination of parameters, and what is known of it.

    Parameters
    ----------
    name : str
        Its name.
    unit : str
        Its SI unit.
    value : float
        Its value: a parameter's in the fit, a combination's from the data alone.
    status : str
        ``"determined"``, ``"not determined"`` (by the data), ``"on lower bound"`` or ``"on upper bound"``.
    std : float or None
        One standard deviation; None unless it is determined.
    interval : tuple of float or None
        All intervals of one kind hold together with the stated probability; None unless it is determined.
    """

    name: str
    unit: str
    value: float
    status: Status
    std: float | None = None
    interval: tuple[float, float] | None = None


@dataclass(frozen=True)
class Determination:
    """
    What the data determine of the head's parameters.

    Parameters
    ----------
    singular_values : array_like, shape (10,)
        Of the weighted Jacobian over the noise, descending: how many standard deviations of noise a direction moves the
        responses over the whole range between the bounds.
    directions : array_like, shape (10, 10)
        Columns: the directions in parameters as parts of their ranges, in the order of ``singular_values``.
    n_determined : int
        Number of directions that the data determine.
    parameters : tuple of Estimate
        The ten parameters.
    combinations : tuple of Estimate
        The eight combinations that the tool can tell.
    level : float
        Probability with which all intervals of the parameters, or of the combinations, hold together.
    """

    singular_values: FloatArray
    directions: FloatArray
    n_determined: int
    parameters: tuple[Estimate, ...]
    combinations: tuple[Estimate, ...]
    level: float

    def __post_init__(self) -> None:
        for name in ("singular_values", "directions"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))


def determination(fit: HeadFit, data: FitData, level: float = 0.99, calibration: float = 0.0) -> Determination:
    """
    What the data behind a fit determine.

    Parameters
    ----------
    fit : HeadFit
        The fit.
    data : FitData
        What was fitted.
    level : float
        Probability with which all intervals of one kind hold together (Bonferroni).
    calibration : float
        One standard deviation of each channel's sensitivity, as a fraction of it.

    Returns
    -------
    Determination
        Singular values, and estimates of parameters and combinations.
    """
    noise = _noise(fit, data)
    scale = float(np.mean(noise))
    j, n = fit.jacobian, len(HEAD_PARAMETERS)
    known = scale / _BOUNDS_VARIANCE
    left, singular, right = np.linalg.svd(j, full_matrices=False)
    # What rounding alone leaves of a direction is nothing: the bounds must then speak for it.
    singular = np.where(singular > _ROUNDING * singular[0], singular, 0.0)
    answer = singular / (singular**2 + known)
    heard = answer[:, None] * left.T
    systematic = heard @ (calibration * _gains(data))
    by_data = (heard * noise) @ heard.T + systematic @ systematic.T
    by_bounds = np.diag(known * scale / (singular**2 + known) ** 2)
    covariances = (right.T @ by_data @ right, right.T @ by_bounds @ right)
    step = -right.T @ (heard @ fit.residual)
    told = [_told(e, (by_data, by_bounds)) for e in np.eye(n)]
    width = vector(fit.bounds[1]) - vector(fit.bounds[0])
    at_fit, gradients = tool_side(fit.head), tool_side_gradient(fit.head)
    combinations = []
    for name, unit in TOOL_SIDE_UNITS.items():
        g = gradients[name] * width
        bound = fit.on_bound.get(_SAME_AS_PARAMETER.get(name, ""))
        value = at_fit[name] if bound else at_fit[name] + float(g @ step)
        combinations.append(_estimate(name, unit, value, bound, g, covariances, len(TOOL_SIDE_UNITS), level))
    parameters = [
        _estimate(name, unit, value, fit.on_bound.get(name), w * e, covariances, n, level)
        for name, unit, value, w, e in zip(HEAD_PARAMETERS, HEAD_UNITS, vector(fit.head), width, np.eye(n))
    ]
    return Determination(singular / np.sqrt(scale), right.T, sum(told), tuple(parameters), tuple(combinations), level)


def _told(gradient: FloatArray, covariances: tuple[FloatArray, FloatArray]) -> bool:
    """Whether the data tell what moves along a gradient: closely, and not through the bounds on other parameters."""
    by_data, by_bounds = (float(gradient @ c @ gradient) for c in covariances)
    alone = float(gradient @ gradient) * _BOUNDS_VARIANCE
    borrowed = by_bounds > _BORROWED * by_data and by_bounds > _BORROWED**4 * alone
    return by_data + by_bounds <= _DETERMINED**2 * alone and not borrowed


def _estimate(
    name: str, unit: str, value: float, bound: str | None, gradient: FloatArray,
    covariances: tuple[FloatArray, FloatArray], count: int, level: float,
) -> Estimate:  # fmt: skip
    if bound is not None:
        return Estimate(name, unit, float(value), "on lower bound" if bound == "lower" else "on upper bound")
    if not _told(gradient, covariances):
        return Estimate(name, unit, float(value), "not determined")
    # Data without noise leave a variance of nothing, which rounding may put below zero.
    std = float(np.sqrt(max(sum(float(gradient @ c @ gradient) for c in covariances), 0.0)))
    half = float(stats.norm.ppf(1.0 - (1.0 - level) / (2 * count))) * std
    return Estimate(name, unit, float(value), "determined", std, (float(value - half), float(value + half)))


def _noise(fit: HeadFit, data: FitData) -> FloatArray:
    """Variance of each weighted residual, real parts then imaginary parts."""
    outputs, lines = data.measured.shape
    # Real and imaginary parts of one response share one noise level; the fit has taken away some of it.
    squares = fit.residual.reshape(2, outputs, lines) ** 2 / data.weights
    lost = 1.0 - len(HEAD_PARAMETERS) / fit.residual.size
    power = data.weights * squares.mean(axis=(0, 2))[:, None] / lost
    if data.variance is not None:
        known = data.weights * data.variance / 2
        # Where the model misses by more than noise, what it misses stands for what is not known.
        power = known * np.maximum(power.sum(axis=1) / known.sum(axis=1), 1.0)[:, None]
    floor = 1e-24 * float(np.mean(data.weights * np.abs(data.measured) ** 2))
    return np.tile(np.maximum(power, floor).ravel(), 2)


def _gains(data: FitData) -> FloatArray:
    """How a slowly varying error of each channel's sensitivity moves the weighted residuals, shape (residual, pattern)."""
    outputs, lines = data.measured.shape
    # The tolerance says "smooth over frequency": an offset, a slope and a bow over the band, together of unit variance on the
    # average.
    shapes = np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, lines), 2).T / _SMOOTH_NORM
    moved = np.sqrt(data.weights) * data.measured
    columns = np.zeros((2, outputs, lines, outputs, len(shapes)))
    for k in range(outputs):
        columns[0, k, :, k], columns[1, k, :, k] = (part[:, None] * shapes.T for part in (moved[k].real, moved[k].imag))
    return columns.reshape(2 * outputs * lines, -1)
