"""
Steady motion of a model's ports under a sine and nonlinear laws there, as harmonics: one position, any number of ports.

Unknowns are real: of each port the mean, where it has one, then a cosine and a sine of each harmonic. The loops over them are
compiled (`cutvib_ss.response.compiled_balance`); here are their start, and what follows from their result.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from cutvib_ss.model.restoring_forces import RestoringForce, packed
from cutvib_ss.results import ComplexArray, FloatArray

System: TypeAlias = tuple[ComplexArray, ComplexArray, ComplexArray]
Tables: TypeAlias = tuple[np.ndarray, FloatArray, FloatArray, FloatArray, FloatArray]

_REACH = 5.0
"""Lines that an arc of the continuation may span."""
_SHORTEST_RAMP = 1e-4
"""Shortest part of the force by which the first line's motion is ramped up."""
_STEP = 1e-6
"""Relative step of the forces' derivatives to the laws' parameters."""


class PortMotion:
    """The harmonic balance of a model at a position."""

    def __init__(self, system: System, laws: Sequence[RestoringForce], tables: Tables) -> None:
        from cutvib_ss.response import compiled_balance  # numba takes half a second to import

        self._compiled = compiled_balance
        self._system, self._forces, self._tables = system, tuple(laws), tables
        self._laws = packed(laws)
        self.ports, self.width = len(laws), tables[1].shape[1]
        self.first = int(tables[0][0] == 0)
        self.size = self.ports * self.width

    def _ramped(self, omega: float, force: float, by_law: bool) -> FloatArray | None:
        """The motion at a frequency as the force grows out of rest, or the laws out of nothing; None where that folds."""
        x, share, step = np.zeros(self.size), 0.0, 1.0
        while share < 1.0:
            level = min(share + step, 1.0)
            laws = packed([f.scaled(level) for f in self._forces]) if by_law else self._laws
            # Newton's first step from rest is the linear response.
            trial = x.copy() if by_law or not share else x * (level / share)
            if self._compiled.newton(
                trial, omega, force if by_law else level * force, self._system, laws, self._tables
            ):
                x, share, step = trial, level, 2.0 * step
            elif (step := 0.5 * step) < _SHORTEST_RAMP:
                return None
        return x

    def sweep(self, omegas: FloatArray, force: float) -> FloatArray:
        """Motion along a sweep, a line each; fewer lines than asked for where the curve is lost, or a softening spring lets go."""
        start = self._ramped(omegas[0], force, by_law=False)
        if start is None:
            # Growing out of rest it comes to a fold; what lies beyond is sought from the linear model.
            start = self._ramped(omegas[0], force, by_law=True)
        if start is None:
            return np.zeros((0, self.size))
        spacing = float(np.abs(np.diff(omegas)).mean()) if omegas.size > 1 else 1.0
        done, motions = self._compiled.sweep(
            start, omegas, force, self._system, self._laws, self._tables, _REACH * spacing
        )
        found = np.asarray(motions[:done])
        return found[: self._held(found)]

    def _held(self, motions: FloatArray) -> int:
        """Lines before the first whose motion passes the top of a softening spring's potential, beyond which nothing holds it."""
        passed = np.zeros(len(motions), dtype=bool)
        poles, drives, shapes = self._system
        for j, force in enumerate(self._forces):
            static = float(-(shapes[j] * drives[:, 1 + j] / poles).sum().real)
            if np.isfinite(far := force.holds_below(static)):
                own = motions[:, j * self.width : (j + 1) * self.width] @ self._tables[1].T
                passed |= np.abs(own).max(axis=1) > far
        return int(np.argmax(passed)) if passed.any() else len(motions)

    def fundamentals(self, omegas: FloatArray, motions: FloatArray) -> ComplexArray:
        """Fundamentals of the laws' forces, shape (frequency, port), under motions of shape (frequency, port · unknown)."""
        forces = self._compiled.balances(motions, omegas, self._system, self._laws, self._tables)[2]
        own = forces.reshape(omegas.size, self.ports, self.width)[:, :, self.first : self.first + 2]
        return np.asarray(own[:, :, 0] - 1j * own[:, :, 1])

    def slopes(
        self, omegas: FloatArray, motions: FloatArray
    ) -> tuple[FloatArray, Mapping[tuple[int, str], FloatArray]]:
        """
        Small changes of the forces' fundamentals, the other harmonics following.

        By the motion's fundamentals, cosine and sine of each port, shape (frequency, 2 port, 2 port); and, these held, by each
        parameter of the laws: (port, name) to an array of shape (frequency, 2 port).
        """
        own = (self.width * np.arange(self.ports)[:, None] + self.first + np.arange(2)).ravel()
        rest = np.setdiff1d(np.arange(self.size), own)
        r, j, f, blocks = self._compiled.balances(motions, omegas, self._system, self._laws, self._tables)
        direct = np.zeros_like(j)
        for i in range(self.ports):
            at = slice(i * self.width, (i + 1) * self.width)
            direct[:, at, at] = blocks[:, i]
        inner, to_rest = j[:, rest][:, :, rest], direct[:, own][:, :, rest]
        by_motion = direct[:, own][:, :, own] - to_rest @ np.linalg.solve(inner, j[:, rest][:, :, own])
        by_parameter = {}
        for i, force in enumerate(self._forces):
            for name, value in force.parameters.items():
                h = _STEP * abs(value) or _STEP
                if value + h > force.highest(name):
                    h = -h
                moved = packed(
                    [replace(force, **{name: value + h}) if k == i else g for k, g in enumerate(self._forces)]
                )
                r2, _, f2, _ = self._compiled.balances(motions, omegas, self._system, moved, self._tables)
                pushed = np.linalg.solve(inner, (r2 - r)[:, rest, None])
                by_parameter[i, name] = ((f2 - f)[:, own] - (to_rest @ pushed)[..., 0]) / h
        return by_motion, by_parameter


def harmonic_tables(numbers: np.ndarray, samples: int) -> Tables:
    """What takes harmonics to samples of a period and back."""
    turn = 2 * np.pi * np.arange(samples) / samples
    later = turn + np.pi / samples

    def columns(phase: FloatArray, rate: bool = False) -> FloatArray:
        parts = []
        for k in numbers:
            cos, sin = np.cos(k * phase), np.sin(k * phase)
            parts += [-k * sin, k * cos] if rate else [cos, sin]
        # Of the mean the sine is nothing.
        return np.ascontiguousarray(np.delete(parts, 1, axis=0).T if numbers[0] == 0 else np.array(parts).T)

    table = columns(turn)
    weights = 2.0 / samples * np.where((numbers[0] == 0) & (np.arange(table.shape[1]) == 0), 0.5, 1.0)
    return (
        numbers.astype(np.int64),
        table,
        columns(turn, rate=True),
        columns(later),
        np.ascontiguousarray((table * weights).T),
    )
