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
from scipy import ndimage

from cutvib_ss.model.restoring_forces import RestoringForce, packed
from cutvib_ss.results import ComplexArray, FloatArray

# Poles (mode,); participation of the force and of the ports (mode, 1 + port); displacement of the ports (port, mode).
System: TypeAlias = tuple[ComplexArray, ComplexArray, ComplexArray]
# Harmonic numbers, a zero for the mean; T and T' (unknown, sample); T half a sample later over a whole period, and at rest
# (sample, unknown); P (unknown, sample).
Tables: TypeAlias = tuple[np.ndarray, FloatArray, FloatArray, FloatArray, FloatArray]

_REACH = 5.0
"""Lines that an arc of the continuation may span."""
_SMOOTHED = 2.0
"""Lines over which the force is smoothed where a curve is followed."""
_SHORTEST_RAMP = 1e-4
"""Shortest part of the force by which the first line's motion is ramped up."""
_ANOTHER = 0.2
"""Difference of two motions at a line, over one of them, from which they are two: a force that is smoothed moves one by less."""
_RAMP = tuple(np.geomspace(0.02, 1.0, 18).tolist())
"""Parts of a held amplitude by which it is come to, where nothing else leads there."""
_HELD_STEPS, _HELD, _HELD_DAMPED = 40, 1e-9, 1e-3
"""Steps of Newton's method under a held response at most, its relative residual, and the damping at which it is given up."""
_STEP = 1e-6
"""Relative step of the forces' derivatives to the laws' parameters."""


class PortMotion:
    """The harmonic balance of a model at a position."""

    def __init__(self, system: System, laws: Sequence[RestoringForce], tables: Tables) -> None:
        from cutvib_ss.response import compiled_balance  # numba takes half a second to import

        self._compiled = compiled_balance
        self._system, self._forces, self._tables = system, tuple(laws), tables
        self._laws = packed(laws)
        self.ports, self.width = len(laws), tables[1].shape[0]
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

    def sweep(self, omegas: FloatArray, force: FloatArray) -> tuple[FloatArray, bool]:
        """
        Motion along a sweep under a force line by line, and whether its curve folds, among the lines or beyond the last.

        Fewer lines where the curve is lost, or a softening spring lets go.
        """
        # What scatters from line to line has a corner at each, which no curve can be followed along.
        path = ndimage.gaussian_filter1d(force, _SMOOTHED, mode="nearest")
        start = self._ramped(omegas[0], float(path[0]), by_law=False)
        if start is None:
            # Growing out of rest it comes to a fold; what lies beyond is sought from the linear model.
            start = self._ramped(omegas[0], float(path[0]), by_law=True)
        if start is None:
            return np.zeros((0, self.size)), False
        spacing = float(np.abs(np.diff(omegas)).mean()) if omegas.size > 1 else 1.0
        done, motions, folds = self._compiled.sweep(
            start, omegas, np.ascontiguousarray(force), path, self._system, self._laws, self._tables, _REACH * spacing
        )
        found = np.asarray(motions[:done])
        return found[: self._held(found)], bool(folds) or self._has_another(found, omegas, path)

    def _has_another(self, motions: FloatArray, omegas: FloatArray, path: FloatArray) -> bool:
        """Whether from rest another motion is reached at the last line than along the sweep: its curve folds farther on."""
        if len(motions) < omegas.size:
            return False
        rest = self._ramped(omegas[-1], float(path[-1]), by_law=False)
        return rest is None or bool(np.linalg.norm(rest - motions[-1]) > _ANOTHER * np.linalg.norm(motions[-1]))

    def _held(self, motions: FloatArray) -> int:
        """Lines before the first whose motion passes the top of a softening spring's potential, beyond which nothing holds it."""
        passed = np.zeros(len(motions), dtype=bool)
        poles, drives, shapes = self._system
        for j, force in enumerate(self._forces):
            static = float(-(shapes[j] * drives[:, 1 + j] / poles).sum().real)
            if np.isfinite(far := force.holds_below(static)):
                own = motions[:, j * self.width : (j + 1) * self.width] @ self._tables[1]
                passed |= np.abs(own).max(axis=1) > far
        return int(np.argmax(passed)) if passed.any() else len(motions)

    def held(
        self, omegas: FloatArray, read: ComplexArray, by_laws: ComplexArray, amplitudes: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """
        Motion of the ports and amplitude of the force, line by line, at given amplitudes of a channel; NaN where none is found.

        The channel reads X = read·f - by_laws·N: receptances by the force (frequency,) and by the ports (port, frequency). Newton's
        method on the balance and |X| = A, all lines together. Under a held response there are no folds to jump at: each line has
        its own force.
        """
        lines = omegas.size
        motions, force, found = np.zeros((lines, self.size)), np.zeros(lines), np.zeros(lines, dtype=bool)
        by_force = self._by_force(omegas)
        # Small motion from rest: friction sticks there, a clearance does not hold.
        _, at_rest, _, slopes = self._compiled.balances(motions, omegas, self._system, self._laws, self._tables)
        small = _solved(at_rest, by_force)
        shown = read - np.einsum("jf,fjx,fx->f", by_laws, self._fundamental_slopes(slopes), small)
        starts = [(x, 1.0 / np.maximum(np.abs(gain), 1e-300)) for x, gain in ((by_force, read), (small, shown))]

        def try_from(some: np.ndarray, x: FloatArray, f: FloatArray, share: float = 1.0) -> np.ndarray:
            x, f, wanted = x.copy(), f.copy(), share * amplitudes[some]
            good = self._newton_held(x, f, omegas[some], by_force[some], read[some], by_laws[:, some], wanted)
            motions[some[good]], force[some[good]] = x[good], f[good]
            return np.asarray(some[good])

        def spread() -> None:
            """From lines that are found to those beside, until none is gained."""
            before = -1
            while before < np.count_nonzero(found) < lines:
                before = int(np.count_nonzero(found))
                for side in (1, -1):
                    todo = np.flatnonzero(~found)
                    todo = todo[(todo - side >= 0) & (todo - side < lines)]
                    todo = todo[found[todo - side]]
                    louder = amplitudes[todo] / amplitudes[todo - side]
                    found[try_from(todo, motions[todo - side] * louder[:, None], force[todo - side] * louder)] = True

        for x, per_unit in starts:
            todo = np.flatnonzero(~found)
            f = (amplitudes * per_unit)[todo]
            found[try_from(todo, x[todo] * f[:, None], f)] = True
        spread()
        for x, per_unit in starts if not found.all() else ():
            todo, last = np.flatnonzero(~found), _RAMP[0]
            f = (last * amplitudes * per_unit)[todo]
            todo = try_from(todo, x[todo] * f[:, None], f, last)
            for share in _RAMP[1:]:
                todo = try_from(todo, motions[todo] * (share / last), force[todo] * (share / last), share)
                last = share
            found[todo] = True
            spread()
        return motions, np.where(found, force, np.nan)

    def _newton_held(
        self,
        x: FloatArray,
        f: FloatArray,
        omegas: FloatArray,
        by_force: FloatArray,
        read: ComplexArray,
        by_laws: ComplexArray,
        amplitudes: FloatArray,
    ) -> np.ndarray:
        """Damped Newton steps in place; which lines have come to an end."""
        n, size = self.size, np.linalg.norm(x, axis=1)
        # Columns and rows of unlike units: motion, and force; residual, and amplitude.
        units = np.concatenate([np.repeat(size[:, None], n, axis=1), np.abs(f)[:, None]], axis=1)

        def at(some: np.ndarray, x: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
            r, j, forces, slopes = self._compiled.balances(x, omegas[some], self._system, self._laws, self._tables)
            laws, moved = self._fundamental(forces), self._fundamental_slopes(slopes)
            b, a, h = by_force[some], amplitudes[some], by_laws[:, some]
            shown = read[some] * f - np.einsum("jf,fj->f", h, laws)
            left = np.concatenate([(r - b * f[:, None]) / size[some, None], (np.abs(shown) / a - 1.0)[:, None]], axis=1)
            matrix = np.zeros((f.size, n + 1, n + 1))
            along = shown.conj() / np.maximum(np.abs(shown) * a, 1e-300)
            matrix[:, :n, :n], matrix[:, :n, n] = j / size[some, None, None], -b / size[some, None]
            matrix[:, n, :n] = -(along[:, None] * np.einsum("jf,fjx->fx", h, moved)).real
            matrix[:, n, n] = (along * read[some]).real
            return left, matrix * units[some, None]

        left, matrix = at(np.arange(f.size), x, f)
        merit, damping = np.linalg.norm(left, axis=1), np.ones(f.size)
        for _ in range(_HELD_STEPS):
            todo = np.flatnonzero((merit > _HELD) & (damping > _HELD_DAMPED))
            if not todo.size:
                break
            change = -damping[todo, None] * units[todo] * _solved(matrix[todo], left[todo])
            there = x[todo] + change[:, :n], f[todo] + change[:, n]
            new_left, new_matrix = at(todo, *there)
            new = np.linalg.norm(new_left, axis=1)
            better = new < merit[todo]
            damping[todo] = np.where(better, np.minimum(2.0 * damping[todo], 1.0), 0.25 * damping[todo])
            good = todo[better]
            x[good], f[good] = there[0][better], there[1][better]
            merit[good], left[good], matrix[good] = new[better], new_left[better], new_matrix[better]
        return np.asarray((merit <= _HELD) & (f > 0.0))

    def _by_force(self, omegas: FloatArray) -> FloatArray:
        """Linear motion of the ports under a unit force, as the balance's unknowns, shape (frequency, unknown)."""
        poles, drives, shapes = self._system
        residues = shapes * drives[:, 0]
        up, down = (residues @ (0.5 / (s - poles[:, None])) for s in (1j * omegas, -1j * omegas))
        h = up + down.conj()
        out = np.zeros((omegas.size, self.ports, self.width))
        out[:, :, self.first], out[:, :, self.first + 1] = h.T.real, -h.T.imag
        return out.reshape(omegas.size, -1)

    def _fundamental(self, forces: FloatArray) -> ComplexArray:
        """Fundamentals of harmonics of the laws' forces, shape (frequency, port)."""
        own = forces.reshape(len(forces), self.ports, self.width)
        return np.asarray(own[:, :, self.first] - 1j * own[:, :, self.first + 1])

    def _fundamental_slopes(self, slopes: FloatArray) -> ComplexArray:
        """Derivatives of the fundamentals to the unknowns, shape (frequency, port, unknown)."""
        out = np.zeros((len(slopes), self.ports, self.size), dtype=np.complex128)
        for i in range(self.ports):
            at = slice(i * self.width, (i + 1) * self.width)
            out[:, i, at] = slopes[:, i, self.first] - 1j * slopes[:, i, self.first + 1]
        return out

    def fundamentals(self, omegas: FloatArray, motions: FloatArray) -> ComplexArray:
        """Fundamentals of the laws' forces, shape (frequency, port), under motions of shape (frequency, port · unknown)."""
        return self._fundamental(self._compiled.balances(motions, omegas, self._system, self._laws, self._tables)[2])

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


def _solved(matrices: FloatArray, right: FloatArray) -> FloatArray:
    """Solutions of many small systems; nothing where one is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.array([np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(matrices, right, strict=True)])


def harmonic_tables(numbers: np.ndarray, samples: int) -> Tables:
    """What takes harmonics to samples of a period and back; of odd ones alone, half a period tells all."""
    turn = 2 * np.pi * np.arange(samples) / samples
    later = turn + np.pi / samples
    counted = samples // 2 if (numbers % 2).all() else samples

    def columns(phase: FloatArray, rate: bool = False) -> FloatArray:
        parts = []
        for k in numbers:
            cos, sin = np.cos(k * phase), np.sin(k * phase)
            parts += [-k * sin, k * cos] if rate else [cos, sin]
        # Of the mean the sine is nothing.
        return np.ascontiguousarray(np.delete(parts, 1, axis=0).T if numbers[0] == 0 else np.array(parts).T)

    table = columns(turn[:counted])
    weights = 2.0 / counted * np.where((numbers[0] == 0) & (np.arange(table.shape[1]) == 0), 0.5, 1.0)
    return (
        numbers.astype(np.int64),
        np.ascontiguousarray(table.T),
        np.ascontiguousarray(columns(turn[:counted], rate=True).T),
        np.vstack([columns(later), np.zeros(table.shape[1])]),
        np.ascontiguousarray((table * weights).T),
    )
