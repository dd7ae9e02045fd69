"""Weights by which derivatives become drift and discrepancy, and smooth shapes of Gaussian processes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknowns import from_unknown
from cutvib_ss.results import FloatArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.problem import Problem
    from cutvib_ss.diagnosis.records import Group


ALONG_THE_RAIL = ("rail", "rail_ends")
"""Places of causes that shape the rail's motion."""


def smooth_shapes(freq: FloatArray, band: tuple[float, float]) -> FloatArray:
    """Reduced-rank squared-exponential process over log frequency, shape (shape, frequency): coefficients are N(0, 1)."""
    return _smooth_shapes(np.asarray(freq, dtype=np.float64).tobytes(), band)


@lru_cache(maxsize=64)
def _smooth_shapes(lines: bytes, band: tuple[float, float]) -> FloatArray:
    freq = np.frombuffer(lines)
    low, high = (float(np.log(max(f, 1e-9))) for f in band)
    at = np.linspace(low, high, 1 + int(np.ceil((high - low) / (0.6 * SETTINGS.discrepancy_length))))
    inside = np.exp(-0.5 * ((at[:, None] - at) / SETTINGS.discrepancy_length) ** 2)
    variance, vectors = np.linalg.eigh(inside)
    keep = variance > SETTINGS.discrepancy_least_variance * variance[-1]
    across = np.exp(-0.5 * ((np.log(freq)[None] - at[:, None]) / SETTINGS.discrepancy_length) ** 2)
    shapes = np.asarray((vectors[:, keep] / np.sqrt(variance[keep])).T @ across)
    shapes.flags.writeable = False
    return shapes


def weights(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """
    By how much each tuned value's row of the Jacobian is a relative drift, and a relative error of dynamic stiffness.

    A row is the derivative to one tolerance. A frequency moves by half of what its stiffness moves. A damping drifts by as many
    tolerances as the stiffness beside it.
    """
    alone = set(problem.parts.all)
    tolerance = {path[-1]: t for i, (path, t) in enumerate(problem.tuning) if i not in alone}
    parts = problem.nominal.matrix_parts
    beside = {"c1": "k1", "c2": "k2", "damping_ratio": "first_frequency", 1: 2}
    stiff = {"k1": 1.0, "k2": 1.0, "first_frequency": 0.5, 2: 1.0}
    drift, nominal = np.zeros(len(problem.tuning)), np.zeros(len(problem.tuning))
    for i, (path, own) in enumerate(problem.tuning):
        name = path[-1]
        if path[0] == "parts":
            # Modes drift one by one beside what moves all of them, and springs that do turn modes into each other.
            part, size = parts[int(name)], SETTINGS.discrepancy_modes_drift / tolerance.get(2, own)
            if part.power < 2 and part.modes[0] == part.modes[1]:
                drift[i] = size
            elif part.power == 0:
                # Half of its change stands on either side of the diagonal.
                drift[i] = 2.0 * size
        elif path == ("rail", "frequencies", 0):
            # The lowest mode beside all of them; of the others, which move less, each by itself tells little more.
            drift[i] = SETTINGS.discrepancy_modes_drift * 0.5 / own
        elif i in alone:
            # A damping drifts with what all of them do.
            continue
        elif name in stiff:
            drift[i] = nominal[i] = stiff[name] / own
        elif name in beside:
            other = beside[name]
            drift[i] = stiff[other] / tolerance[other] if other in tolerance else 10.0 / own
    if not nominal.any():
        # A free body has no stiffness to err: its mass does.
        masses = (("scales", 0), ("head", "m1"), ("head", "m2"))
        nominal = np.array([1.0 / t if path in masses else 0.0 for path, t in problem.tuning])
    return drift, nominal


def cause_weights(problem: Problem, x: FloatArray) -> FloatArray:
    """
    By how much each row of the effects' parameters is a relative error of the cause's dynamic stiffness.

    Beside a linear cause along the rail, whose error varies over the head's position, others have none: of a joint's damper, which
    drifts between sessions, it would make another one at each position.
    """
    effects, along = problem.effects(x), _along_the_rail(problem)
    out = np.zeros(len(problem.parameters))
    for i, (which, name, r) in enumerate(problem.parameters):
        if not along or effects[which].place in ALONG_THE_RAIL:
            slope = from_unknown(float(x[problem.first_effect + i]), r)[1]
            out[i] = effects[which].by_size().get(name, 0.0) / slope
    return out


def _along_the_rail(problem: Problem) -> bool:
    """Whether the error of what is linear varies over the head's position."""
    h = problem.hypothesis
    return h.linear and any(e.place in ALONG_THE_RAIL for e in h.effects)


def features(g: Group, row: int, problem: Problem) -> tuple[FloatArray, FloatArray]:
    """
    Over what a cause's discrepancy is smooth, in correlation lengths: log frequency, and what else its form depends on.

    That is the log amplitude of a restoring force, and the head's position for causes along the rail: how supports, torsion or
    shear shape the rail's motion is part of their form.
    """
    u = np.log(g.freq) / SETTINGS.discrepancy_length
    if problem.hypothesis.linear:
        at = float(g.positions[row]) / SETTINGS.discrepancy_position_length if _along_the_rail(problem) else 0.0
        return u, np.full(u.size, np.nan_to_num(at))
    return u, level_of(g, row) / SETTINGS.discrepancy_amplitude_length


def level_of(g: Group, row: int) -> FloatArray:
    """Logarithm of the level of a record's motion by line: of a sine its amplitude there, else the peak force."""
    entry = g.entries[row][0]
    if entry.sine is not None:
        amplitude = entry.sine.force * np.sqrt(np.mean(np.abs(g.data[row]) ** 2, axis=0))
        return np.asarray(np.log(np.maximum(amplitude, 1e-300)))
    return np.full(g.freq.size, 0.0 if entry.level is None else float(np.log(entry.level)))


def shapes_over(pivots: tuple[tuple[float, float], ...], u: FloatArray, w: FloatArray) -> FloatArray:
    """Shapes with independent N(0, 1) coefficients at some points, shape (pivot, point)."""
    return _shapes_over(pivots, np.stack([u, w], axis=-1).tobytes())


@lru_cache(maxsize=256)
def _shapes_over(pivots: tuple[tuple[float, float], ...], points: bytes) -> FloatArray:
    at = np.array(pivots)

    def kernel(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-0.5 * np.sum((a[:, None] - b[None]) ** 2, axis=-1)))

    lower = np.linalg.cholesky(kernel(at, at) + 1e-8 * np.eye(len(at)))
    shapes = linalg.solve_triangular(lower, kernel(at, np.frombuffer(points).reshape(-1, 2)), lower=True)
    shapes.flags.writeable = False
    return np.asarray(shapes)


def pivots_of(problem: Problem) -> tuple[tuple[float, float], ...]:
    """Points that carry the process over all data, by pivoted Cholesky: the variance that they leave is small everywhere."""
    return _pivots((), [_points(g, row, problem) for g in problem.groups for row in range(len(g.data))])


def pivots_beside(
    pivots: tuple[tuple[float, float], ...], g: Group, problem: Problem
) -> tuple[tuple[float, float], ...]:
    """Points that carry the process over one more record, behind those that carry it over others: their shapes stay as they are."""
    return _pivots(pivots, [_points(g, row, problem) for row in range(len(g.data))]) if pivots else ()


def _points(g: Group, row: int, problem: Problem) -> FloatArray:
    """Points of a record that stand for all of its lines, shape (point, 2)."""
    u, w = features(g, row, problem)
    keep = np.unique(np.linspace(0, u.size - 1, min(u.size, SETTINGS.discrepancy_points)).round().astype(int))
    return np.stack([u[keep], w[keep]], axis=-1)


def _pivots(first: tuple[tuple[float, float], ...], points: Sequence[FloatArray]) -> tuple[tuple[float, float], ...]:
    """Pivots among points, behind the first ones."""
    every = np.unique(np.concatenate(points).round(6), axis=0)
    rows = list(shapes_over(first, *every.T)) if first else []
    left = np.maximum(1.0 - sum((r**2 for r in rows), np.zeros(len(every))), 0.0)
    chosen: list[tuple[float, float]] = []
    while left.max() > SETTINGS.discrepancy_variance_left and len(chosen) < SETTINGS.discrepancy_most_pivots:
        k = int(np.argmax(left))
        column = np.exp(-0.5 * np.sum((every - every[k]) ** 2, axis=-1))
        column = (column - sum((r[k] * r for r in rows), np.zeros(len(every)))) / np.sqrt(left[k])
        rows.append(column)
        left = np.maximum(left - column**2, 0.0)
        left[k] = 0.0
        chosen.append((float(every[k, 0]), float(every[k, 1])))
    return (*first, *chosen)
