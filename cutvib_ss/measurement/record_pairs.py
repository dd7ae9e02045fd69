"""Two records of one position and input compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cutvib_ss.measurement.records import Sweep
from cutvib_ss.measurement.sweep_direction import opposed
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse
from cutvib_ss.units import percent

if TYPE_CHECKING:
    from cutvib_ss.measurement.summary import RecordSummary

_CLEAR = 36.0
"""Power of the sum of two responses over its variance, from which a line counts."""

_FEWEST = 8
"""Lines that two records have to share."""


@dataclass(frozen=True)
class PairSummary:
    """
    Two records of one position and input compared.

    ``difference`` is rms(H_a - H_b) beyond noise over √2 rms(H), over all channels, each over its own rms;
    ``over_noise`` is the mean of |H_a - H_b|² over its variance from noise alone.
    """

    first: str
    second: str
    position: float | None
    levels: tuple[float | None, float | None]
    difference: float
    over_noise: float
    channels: dict[str, float]
    worst: str
    sweeps: tuple[Sweep | None, Sweep | None] = (None, None)

    def row(self) -> list[str]:
        """A row of a table."""
        place = "" if self.position is None else f"{self.position:g}"
        both = ["not stated" if v is None else f"{v:.3g}" for v in self.levels]
        if opposed(*self.sweeps):
            both = [f"{level} {sweep}" for level, sweep in zip(both, self.sweeps, strict=True)]
        levels = " and ".join(both)
        size = percent(self.difference) if self.difference > 0 else "none beyond noise"
        return [self.first, self.second, place, levels, size, self.worst if self.difference > 0 else ""]


PAIR_HEADS = ("record", "and", "y/L", "levels", "difference", "most in")
"""Headings of `PairSummary.row`."""


def compare(
    a: RecordSummary, ha: MeasuredFrequencyResponse, b: RecordSummary, hb: MeasuredFrequencyResponse
) -> PairSummary | None:
    """Two records compared on the lines and channels that they share; None where they share too few."""
    shared = [name for name in ha.outputs if name in hb.outputs]
    low, high = max(a.band_hz[0], b.band_hz[0]), min(a.band_hz[1], b.band_hz[1])
    ours, theirs = _common(ha.freq, hb.freq, low, high)
    if not shared or ours.size < _FEWEST:
        return None
    parts, ratios = {}, []
    for name in shared:
        x, y = ha.sel(output=name), hb.sel(output=name)
        p, q = x.data[0, 0, 0, ours], y.data[0, 0, 0, theirs]
        v = x.variance[0, 0, 0, ours] + y.variance[0, 0, 0, theirs]
        # lines that say something: where the force has next to no power, noise alone would
        # fill the mean. The sum tells them, whose noise is independent of that of the difference
        clear = (np.abs(p + q) ** 2 > _CLEAR * v) & (v < 10 * np.median(v))
        if np.count_nonzero(clear) < _FEWEST:
            continue
        p, q, v = p[clear], q[clear], v[clear]
        size = float(np.mean(np.abs(p) ** 2 + np.abs(q) ** 2))
        beyond = float(np.mean(np.abs(p - q) ** 2)) - float(np.mean(v))
        # |ΔH|² scatters about its mean by as much, and the variance is itself an estimate
        if beyond < 4 * float(np.sqrt(np.sum(v**2))) / v.size + 0.1 * float(np.mean(v)):
            beyond = 0.0
        parts[name] = float(np.sqrt(max(beyond, 0.0) / size)) if size > 0 else 0.0
        ratios.append(float(np.mean(np.abs(p - q) ** 2 / v)))
    if not parts:
        return None
    return PairSummary(
        a.name,
        b.name,
        a.position,
        (a.level, b.level),
        float(np.sqrt(np.mean(np.square(list(parts.values()))))),
        float(np.mean(ratios)),
        parts,
        max(parts, key=lambda name: parts[name]),
        (a.sweep, b.sweep),
    )


def _common(first: FloatArray, second: FloatArray, low: float, high: float) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the lines that two axes share within a band."""
    near = np.clip(np.searchsorted(second, first), 0, second.size - 1)
    before = np.clip(near - 1, 0, second.size - 1)
    near = np.where(np.abs(second[before] - first) < np.abs(second[near] - first), before, near)
    alike = (
        (np.abs(second[near] - first) <= 1e-6 * np.maximum(first, 1e-9))
        & (first >= low)
        & (first <= high)
        & (first > 0)
    )
    return np.flatnonzero(alike), near[alike]
