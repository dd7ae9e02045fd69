"""
The tuning around unknown dynamic stiffnesses: variable projection.

Tuning, calibration and a variant's shape are common to all lines. A step in them is taken in what the functions cannot follow:
the part of the derivatives that is normal to the functions' own, line by line. The functions then follow.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.modification import Lines, Modification
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_stiffness import Rows, fitted_functions, followed
from cutvib_ss.diagnosis.variants import Variant
from cutvib_ss.effects.base import Model
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class Free:
    """Functions fitted to one variant of a place, with the tuning that serves them."""

    variant: Variant  # Where
    x: FloatArray  # Tuning and calibration, as unknowns of `Problem`
    shape: float  # The variant's shape
    functions: tuple[ComplexArray, ...]  # The functions, one array a group
    objective: float  # χ² of the residual, with the priors' squares


class Outer:
    """Tuning, calibration and shape around the functions of variants."""

    def __init__(self, nominal: Model, rows: Sequence[Rows]) -> None:
        self.rows = tuple(rows)
        self.problem = Problem(nominal, [r.group for r in rows], Hypothesis())
        self._lines: dict[bytes, tuple[Lines, ...]] = {}

    @property
    def size(self) -> int:
        """Unknowns of tuning and calibration; the instant of a blow moves only tails, which are known to some percent."""
        return self.problem.n_tuning + self.problem.n_calibration

    def lines(self, x: FloatArray) -> tuple[Lines, ...]:
        """The tuned model at the lines of each group; variants share it."""
        key = x[: self.problem.n_tuning].tobytes()
        if key not in self._lines:
            model = self.problem.tuned(x)
            self._lines[key] = tuple(Lines(model, r.group, r.tail, r.window) for r in self.rows)
        return self._lines[key]

    def gains(self, x: FloatArray) -> list[ComplexArray]:
        """Calibration errors of each group."""
        return [self.problem.calibration_of(r.group.channels, r.group.freq, x) for r in self.rows]

    def modifications(self, variant: Variant, x: FloatArray, shape: float) -> list[Modification]:
        """How a variant's functions enter the tuned model."""
        return [variant.at(lines, shape) for lines in self.lines(x)]

    def at(self, variant: Variant, x: FloatArray, shape: float, near: Free | None = None) -> Free:
        """The functions at given tuning and shape."""
        parts = zip(self.rows, self.modifications(variant, x, shape), self.gains(x), strict=True)
        found, total = [], float(x @ x)
        for i, (rows, m, gain) in enumerate(parts):
            start = None if near is None else near.functions[i]
            functions, left = fitted_functions(rows, m, gain, rows.weight, start, sweeps=0)
            found.append(functions)
            total += 2.0 * float(left.sum())
        return Free(variant, x, shape, tuple(found), total)

    def climb(self, free: Free, iterations: int) -> Free:
        """Tuning, calibration and shape moved to where the functions explain most."""
        damping = 1e-3
        low, high = free.variant.bounds
        unit = (high - low) / SETTINGS.projection_shape_steps
        for _ in range(iterations):
            matrix, gradient = self._projected(free, unit)
            before = free.objective
            for _ in range(SETTINGS.projection_tries):
                step = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), gradient)
                x = free.x.copy()
                x[: self.size] = np.clip(x[: self.size] + step[: self.size], -SETTINGS.fit_within, SETTINGS.fit_within)
                shape = float(np.clip(free.shape + unit * step[-1], low, high)) if free.variant.starts else 0.0
                trial = self.at(free.variant, x, shape, free)
                if trial.objective < free.objective:
                    free, damping = trial, damping / 10
                    break
                damping = max(damping, 1e-4) * 10
            if before - free.objective < SETTINGS.projection_gain * before:
                break
        return free

    def deviation(self, free: Free) -> tuple[FloatArray, ...]:
        """Standard deviation of fitted functions, that of tuning, calibration and shape included."""
        unit = (free.variant.bounds[1] - free.variant.bounds[0]) / SETTINGS.projection_shape_steps
        matrix, _ = self._projected(free, unit)
        root = np.linalg.cholesky(np.linalg.inv(matrix))
        out = []
        for i, (rows, m, gain) in enumerate(self._parts(free)):
            outer = np.array(self._outer(free, unit, i))
            slopes, own = followed(rows, m, gain, free.functions[i], outer)
            moved = np.tensordot(root.T, slopes, 1)
            out.append(np.sqrt(own**2 + np.sum(np.abs(moved) ** 2, axis=0) / 2))
        return tuple(out)

    def _parts(self, free: Free) -> Iterator[tuple[Rows, Modification, ComplexArray]]:
        modifications = self.modifications(free.variant, free.x, free.shape)
        return zip(self.rows, modifications, self.gains(free.x), strict=True)

    def _projected(self, free: Free, unit: float) -> tuple[FloatArray, FloatArray]:
        """Normal equations of the outer unknowns, in what the functions cannot follow."""
        shaped = int(bool(free.variant.starts))
        gradient = np.append(-free.x[: self.size], np.zeros(shaped))
        matrix = np.diag(np.append(np.ones(self.size), np.full(shaped, 1e-6)))
        for i, (rows, m, gain) in enumerate(self._parts(free)):
            shown, slopes = m.sloped(rows.of_rows(free.functions[i]))
            with np.errstate(all="ignore"):
                left = rows.group.data - gain * shown
                normal, right = _residual_rows(rows, self._outer(free, unit, i), slopes * gain, left)
            matrix += normal
            gradient += right
        return matrix, gradient

    def _outer(self, free: Free, unit: float, i: int) -> list[ComplexArray]:
        """Derivatives of a group's responses to tuning, calibration and shape, the functions held."""
        functions = self.rows[i].of_rows(free.functions[i])
        gain = self.gains(free.x)[i]
        here = free.variant.at(self.lines(free.x)[i], free.shape).shown(functions)
        out = []
        with np.errstate(all="ignore"):
            for k in range(self.problem.n_tuning):
                if k in self.problem.parts.all:
                    # Beside an element of unknown form nothing tells errors of parts apart: they are held.
                    out.append(np.zeros_like(here))
                    continue
                x = free.x.copy()
                x[k] += SETTINGS.projection_step
                moved = free.variant.at(self.lines(x)[i], free.shape).shown(functions)
                out.append((moved - here) * gain / SETTINGS.projection_step)
            out += self._by_calibration(i, here)
            if free.variant.starts:
                moved = free.variant.at(self.lines(free.x)[i], free.shape + unit * SETTINGS.projection_step).shown(
                    functions
                )
                out.append((moved - here) * gain / SETTINGS.projection_step)
        return out

    def _by_calibration(self, i: int, shown: ComplexArray) -> list[ComplexArray]:
        """Derivatives to each channel's calibration; zeros where a group lacks the channel."""
        out = []
        for name in self.problem.channels:
            for part in (1.0, 1j):
                for shape in self.problem.shapes[i]:
                    column = np.zeros_like(shown)
                    if name in self.rows[i].group.channels:
                        c = self.rows[i].group.channels.index(name)
                        column[:, c] = part * self.problem.calibration * shape * shown[:, c]
                    out.append(column)
        return out


def _residual_rows(
    rows: Rows, outer: Sequence[ComplexArray], inner: ComplexArray, left: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Normal matrix and gradient of the outer unknowns, the inner ones projected out line by line and set by set."""
    scale = np.sqrt(rows.weight)
    stack = np.nan_to_num(np.array([*outer, left]) * scale)
    own = np.nan_to_num(inner * scale)
    total = np.zeros((len(stack), len(stack)))
    sizes = np.bincount(rows.sets)
    # Sets of as many rows are treated together: (set and line, response, column).
    for size in np.unique(sizes):
        mine = np.array([np.flatnonzero(rows.sets == k) for k in np.flatnonzero(sizes == size)])
        a, b = (_by_line(part[:, mine]) for part in (stack, own))
        q, _ = np.linalg.qr(b)
        flat = (a - q @ (q.conj().swapaxes(1, 2) @ a)).reshape(-1, len(stack))
        total += 2.0 * (flat.conj().T @ flat).real
    return total[:-1, :-1], total[:-1, -1]


def _by_line(columns: ComplexArray) -> ComplexArray:
    """Columns of (column, set, row, channel, line) as a matrix for each set and line."""
    count, sets, rows, channels, lines = columns.shape
    return columns.transpose(1, 4, 2, 3, 0).reshape(sets * lines, rows * channels, count)
