"""
Unknown functions of frequency, fitted to all records of a group at given tuning.

Line by line the functions are one or two complex numbers, which every record of a set shares; all lines are solved together by
damped Gauss-Newton steps, from the inversion of each single response and from the neighbouring lines' solutions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.modification import Modification
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Group
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.response.batched import inverse
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class Rows:
    """Records on which the functions are fitted."""

    group: Group  # The records
    sets: np.ndarray  # Which set of functions each row takes part in: one for all, or one a level or record
    weight: FloatArray  # Reciprocal of E|error|²
    tail: ComplexArray  # What the blocks cut off of the model
    window: FloatArray  # Factor of an exponential window on the response alone

    @property
    def count(self) -> int:
        """Number of sets."""
        return int(self.sets.max()) + 1

    def but(self, left_out: np.ndarray) -> FloatArray:
        """Weights without some rows."""
        return np.where(left_out[:, None, None], 0.0, self.weight)

    def by_set(self, values: np.ndarray) -> np.ndarray:
        """Sums over the rows of each set."""
        out = np.zeros((self.count, *values.shape[1:]), dtype=values.dtype)
        np.add.at(out, self.sets, values)
        return out

    def of_rows(self, functions: ComplexArray) -> ComplexArray:
        """The functions as each row has them."""
        mine: ComplexArray = functions[self.sets].swapaxes(0, 1)
        return mine


def rows_of(model: Model, group: Group, sets: np.ndarray, blow_at: float) -> Rows:
    """Records with their weights."""
    shown = Prediction(model, group, blow_at)
    tail = shown.tail
    error = (
        group.variance
        + (SETTINGS.stiffness_model_error * np.abs(group.data)) ** 2
        + (SETTINGS.stiffness_tail_error * np.abs(tail)) ** 2
    )
    return Rows(group, sets, 1.0 / error, tail, np.asarray(shown.window, dtype=np.float64))


def squares_left(
    rows: Rows, m: Modification, gain: ComplexArray, functions: ComplexArray, weight: FloatArray
) -> FloatArray:
    """Weighted squares that functions leave."""
    shown = m.shown(rows.of_rows(functions))
    with np.errstate(all="ignore"):
        squares = np.sum(weight * np.abs(rows.group.data - gain * shown) ** 2, axis=1)
    return rows.by_set(np.where(np.isfinite(squares), squares, 1e30))


def fitted_functions(
    rows: Rows,
    m: Modification,
    gain: ComplexArray,
    weight: FloatArray,
    start: ComplexArray | None = None,
    sweeps: int = 1,
) -> tuple[ComplexArray, FloatArray]:
    """The functions that explain the records best, each line on its own."""
    if start is None:
        functions, best = _inverted(rows, m, gain, weight)
        functions, best = _climbed(rows, m, gain, weight, functions, best, 1e-3, SETTINGS.stiffness_steps)
    else:
        functions, best = start, squares_left(rows, m, gain, start, weight)
        functions, best = _climbed(rows, m, gain, weight, functions, best, 1e-3, SETTINGS.stiffness_steps_nearby)
    for side in (1, -1) * sweeps:
        near = np.roll(functions, side, axis=-1)
        left = squares_left(rows, m, gain, near, weight)
        near, left = _climbed(rows, m, gain, weight, near, left, 1e-2, SETTINGS.stiffness_steps_nearby)
        better = left < best
        functions, best = np.where(better[:, None], near, functions), np.where(better, left, best)
    return functions, best


def smoothing_cost(rows: Rows, m: Modification, gain: ComplexArray, functions: ComplexArray) -> FloatArray:
    """Squares that smooth functions of frequency would leave beyond the fitted ones."""
    matrix, _ = _normal(rows, m, gain, rows.weight, functions)
    curvature = np.nan_to_num(np.abs(np.einsum("iisf->sif", matrix)))
    u = np.log(rows.group.freq)
    basis = np.polynomial.chebyshev.chebvander(
        2.0 * (u - u[0]) / max(u[-1] - u[0], 1e-12) - 1.0, min(SETTINGS.stiffness_degree, u.size - 1)
    )
    # A set's share of the data, against which a distance is far.
    usual = rows.group.data.size / rows.group.freq.size / rows.count
    cost = np.zeros((len(functions), u.size))
    for own, weights, total in zip(functions, curvature, cost, strict=True):
        for value, weight in zip(own, weights, strict=True):
            off = np.zeros(u.size)
            for _ in range(SETTINGS.stiffness_reweighted):
                root = np.sqrt(weight / (1.0 + off / usual))
                smooth = basis @ np.linalg.lstsq(basis * root[:, None], value * root, rcond=None)[0]
                off = weight * np.abs(value - smooth) ** 2
            total += off
    return cost


def _inverted(rows: Rows, m: Modification, gain: ComplexArray, weight: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """At each line the best of no elements and the inversions of single responses."""
    best_one: ComplexArray = np.zeros((rows.count, m.functions, rows.group.freq.size), dtype=np.complex128)
    best = squares_left(rows, m, gain, best_one, weight)
    asked = m.inverted(rows.group.data / gain)
    if asked is None:
        return best_one, best
    # One row of every set at a time.
    turn = np.array([np.count_nonzero(rows.sets[:i] == k) for i, k in enumerate(rows.sets)])
    for k in range(int(turn.max()) + 1):
        mine = np.flatnonzero(turn == k)
        for j, c in np.ndindex(len(asked), asked.shape[2]):
            trial = np.zeros_like(best_one)
            trial[rows.sets[mine], j] = asked[j, mine, c]
            left = squares_left(rows, m, gain, trial, weight)
            better = left < best
            best_one, best = np.where(better[:, None], trial, best_one), np.where(better, left, best)
    return best_one, best


def _climbed(
    rows: Rows,
    m: Modification,
    gain: ComplexArray,
    weight: FloatArray,
    functions: ComplexArray,
    best: FloatArray,
    damping: float,
    iterations: int,
) -> tuple[ComplexArray, FloatArray]:
    """Damped Gauss-Newton steps, every line with a damping of its own."""
    lam = np.full(best.shape, damping)
    one = np.eye(m.functions)[:, :, None, None]
    for _ in range(iterations):
        matrix, gradient = _normal(rows, m, gain, weight, functions)
        size = np.abs(np.einsum("iilf->ilf", matrix))
        floor = 1e-12 * size.max(axis=0) + 1e-300
        with np.errstate(all="ignore"):
            step = np.einsum("ijlf,jlf->ilf", _inverse(matrix + one * (size * lam + floor)), gradient)
        trial = functions + step.swapaxes(0, 1)
        left = squares_left(rows, m, gain, trial, weight)
        better = left < best
        gained = float(np.sum(np.where(better, best - left, 0.0)))
        functions, best = np.where(better[:, None], trial, functions), np.where(better, left, best)
        lam = np.where(better, lam / 5, lam * 10)
        if gained < SETTINGS.stiffness_gain * float(best.sum()):
            break
    return functions, best


def _normal(
    rows: Rows, m: Modification, gain: ComplexArray, weight: FloatArray, functions: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Curvature (function, function, set, frequency) and gradient of the functions."""
    shown, slopes = m.sloped(rows.of_rows(functions))
    slopes, left = np.nan_to_num(slopes * gain), np.nan_to_num(rows.group.data - gain * shown)
    weighted = slopes.conj() * weight
    matrix = np.einsum("ipcf,jpcf->pijf", weighted, slopes)
    gradient = np.einsum("ipcf,pcf->pif", weighted, left)
    return np.moveaxis(rows.by_set(matrix), 0, -2), np.moveaxis(rows.by_set(gradient), 0, -2)


def _inverse(matrices: ComplexArray) -> ComplexArray:
    """Inverses of (n, n, set, frequency)."""
    n, _, *rest = matrices.shape
    return inverse(matrices.reshape(n, n, -1)).reshape(n, n, *rest)


def followed(
    rows: Rows, m: Modification, gain: ComplexArray, functions: ComplexArray, outer: ComplexArray
) -> tuple[ComplexArray, FloatArray]:
    """How fitted functions follow other unknowns, and their own standard deviation at each line."""
    _, inner = m.sloped(rows.of_rows(functions))
    inner = np.nan_to_num(inner * gain)
    weighted = inner.conj() * rows.weight
    matrix = np.moveaxis(rows.by_set(np.einsum("ipcf,jpcf->pijf", weighted, inner)), 0, -2)
    pulled = np.array([rows.by_set(np.einsum("ipcf,pcf->pif", weighted, np.nan_to_num(o))) for o in outer])
    size = np.sqrt(np.abs(np.einsum("iilf->ilf", matrix)) + 1e-300)
    spread = _inverse(matrix / (size[:, None] * size[None]) + 1e-12 * np.eye(m.functions)[:, :, None, None])
    # A line at which nothing is told of a function leaves it unknown.
    with np.errstate(over="ignore"):
        inverted = spread / (size[:, None] * size[None])
    slopes: ComplexArray = -np.einsum("ijlf,xljf->xlif", inverted, pulled)
    # E|error|² = 1/weight is shared by the two parts.
    std: FloatArray = np.sqrt(np.abs(np.einsum("iilf->lif", inverted)) / 2)
    return slopes, std
