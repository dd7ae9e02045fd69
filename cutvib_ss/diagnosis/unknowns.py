"""What may move in a fit: tuned values, smooth calibration errors, and effects' parameters over their ranges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre

from cutvib_ss.effects.base import Model, Range
from cutvib_ss.model.paths import Path, value_at
from cutvib_ss.parameters import Tolerances
from cutvib_ss.results import FloatArray


def tuning_paths(model: Model) -> tuple[tuple[Path, float], ...]:
    """Values that tuning may move, with their tolerances."""
    found: list[tuple[Path, float]] = []
    for f in fields(model.tolerance):
        tolerance = getattr(model.tolerance, f.name)
        if f.name in ("calibration", "drift") or tolerance == 0.0:
            continue
        path: Path
        if isinstance(model.tolerance, Tolerances):
            path = ("head", f.name) if hasattr(getattr(model, "head", None), f.name) else ("rail", "parameters", f.name)
        else:
            path = ("scales", ("mass", "damping", "stiffness").index(f.name))
        if value_at(model, path) != 0.0:
            found.append((path, float(tolerance)))
    for k, part in enumerate(model.matrix_parts):
        # A part is known as well as its matrix is.
        tolerance = float(getattr(model.tolerance, ("stiffness", "damping", "mass")[part.power]))
        if tolerance > 0.0:
            found.append((("parts", k), tolerance))
    if model.rail is not None and (scatter := float(model.tolerance.damping_ratio)) > 0.0:
        # About what all of them are off by the dampings of modes scatter one by one.
        found += [(("rail", "losses", k), scatter) for k in range(len(model.rail.losses))]
    if model.rail is not None and (scatter := float(model.tolerance.first_frequency)) > 0.0:
        # So do their frequencies about those of a uniform beam.
        found += [(("rail", "frequencies", k), scatter) for k in range(len(model.rail.frequencies))]
    return tuple(found)


class Parts(NamedTuple):
    """Tuned values that are errors of single parts of a model, by their number."""

    matrices: tuple[int, ...] = ()  # Of a structure's stiffness or mass
    losses: tuple[int, ...] = ()  # Of the losses of single modes

    @property
    def all(self) -> tuple[int, ...]:
        """Of either kind."""
        return (*self.matrices, *self.losses)


NO_PARTS = Parts()
"""Of a machine, or of a structure without tolerance."""


def parts_among(model: Model, tuning: Sequence[tuple[Path, float]]) -> Parts:
    """Which of the tuned values are errors of parts."""
    parts = model.matrix_parts
    power = {k: parts[int(path[1])].power for k, (path, _) in enumerate(tuning) if path[0] == "parts"}

    def of_rail(name: str) -> tuple[int, ...]:
        return tuple(k for k, (path, _) in enumerate(tuning) if path[:2] == ("rail", name))

    lossy, others = (tuple(k for k, p in power.items() if (p == 1) == damps) for damps in (True, False))
    return Parts((*others, *of_rail("frequencies")), (*lossy, *of_rail("losses")))


def to_unknown(value: float, r: Range) -> float:
    """A parameter in the coordinate in which it is fitted, 0 to 1 over its range: its value or its logarithm."""
    if r.scale == "normal":
        return (value - r.low) / r.high
    if r.scale in ("log", "ratio"):
        # What is nothing is below the range, and no logarithm.
        return float(np.log(max(value, 1e-30 * r.low) / r.low) / np.log(r.high / r.low))
    # A size of either sign could not get past zero in the coordinate in which its prior is even.
    return (value - r.low) / (r.high - r.low)


def from_unknown(x: float, r: Range) -> tuple[float, float]:
    """A parameter from its coordinate, and its derivative."""
    if r.scale == "normal":
        return r.low + x * r.high, r.high
    if r.scale in ("log", "ratio"):
        value = float(r.low * (r.high / r.low) ** x)
        return value, value * float(np.log(r.high / r.low))
    return r.low + x * (r.high - r.low), r.high - r.low


def calibration_shapes(freq: FloatArray, band: tuple[float, float], count: int) -> FloatArray:
    """
    Smooth shapes over the band whose sum with unit normal coefficients has unit variance, shape (shape, frequency).

    Legendre polynomials over an axis half-way between frequency and its logarithm, of standard deviation 1/(1 + k) at order k: a
    sensor errs by its amplifier's corner below the band and by its resonance above it, and what has its poles outside of the band
    is met geometrically (Trefethen 2019, Approximation Theory and Approximation Practice, chapter 8). On frequency alone a phase
    that bends in the lowest octaves passes for a delay; with cosines, which are level at both ends, what bends there does.
    Deviations fall slowly: with 1/(1 + k²) an amplifier's ripple of the stated size is an event of one in a thousand.
    """
    return _calibration_shapes(np.asarray(freq, dtype=np.float64).tobytes(), band, count)


@lru_cache(maxsize=64)
def _calibration_shapes(lines: bytes, band: tuple[float, float], count: int) -> FloatArray:
    freq = np.frombuffer(lines)
    if count == 0:
        return np.zeros((0, freq.size))
    low, high = band
    corner = max(low, 0.02 * (high - low))
    logarithmic = np.log1p((freq - low) / corner) / np.log1p((high - low) / corner)
    order = np.arange(count)
    weight = np.sqrt(2.0 * order + 1.0) / (1.0 + order)
    shapes = legendre.legvander((freq - low) / (high - low) + logarithmic - 1.0, count - 1).T * weight[:, None]
    shapes /= np.sqrt(np.mean(np.sum(shapes**2, axis=0)))
    shapes.flags.writeable = False
    return np.asarray(shapes)
