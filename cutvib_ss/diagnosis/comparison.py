"""
Records on different line grids, compared line by line.

Where the lines of two records coincide they are compared there. Else the finer record is interpolated at the coarser one's lines
(cubic splines), and what that may be off by is added to its variance: from every other line alone the spline misses the lines
between by several times as much. Blocks of unlike length lose unlike tails, and a window damps: such records are compared less
what a model shows of each.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy import interpolate, ndimage

from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Entry, Group, block_and_window, estimator_of, measured_at, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.results import ComplexArray, FloatArray


class Compared(NamedTuple):
    """Two records at the same lines and channels."""

    freq: FloatArray
    channels: tuple[str, ...]
    data: tuple[ComplexArray, ComplexArray]
    variance: tuple[FloatArray, FloatArray]

    @property
    def power(self) -> FloatArray:
        """Squared difference over its variance, one on average where both are the same, shape (channel, frequency)."""
        return np.asarray(np.abs(self.data[0] - self.data[1]) ** 2 / (self.variance[0] + self.variance[1]))


def compared(a: Entry, b: Entry, model: Model | None = None, blow_at: float = 0.0) -> Compared | None:
    """Two records where both have lines; None where they share too few, or see tails that no model tells apart."""
    first, second = (dict(zip(e.channels, e.quantities, strict=True)) for e in (a, b))
    channels = tuple(c for c in a.channels if first[c] == second.get(c))
    if not channels:
        return None
    a, b = _with(a, channels), _with(b, channels)
    if block_and_window(a) != block_and_window(b):
        if model is None:
            return None
        a, b = _less(a, model, blow_at), _less(b, model, blow_at)
    here, there = _coinciding(a.freq, b.freq)
    if here.size >= SETTINGS.comparison_common_lines:
        data = (a.data[:, here], b.data[:, there])
        return Compared(a.freq[here], channels, data, (a.variance[:, here], b.variance[:, there]))
    coarse, fine = (a, b) if _spacing(a) >= _spacing(b) else (b, a)
    inside = (coarse.freq >= fine.freq[0]) & (coarse.freq <= fine.freq[-1])
    if np.count_nonzero(inside) < SETTINGS.comparison_common_lines or fine.freq.size < SETTINGS.comparison_common_lines:
        return None
    freq = coarse.freq[inside]
    sides = [(coarse.data[:, inside], coarse.variance[:, inside]), _interpolated(fine, freq)]
    one, other = sides if coarse is a else sides[::-1]
    return Compared(freq, channels, (one[0], other[0]), (one[1], other[1]))


def across_grids(
    groups: Sequence[Group], model: Model | None = None, blow_at: float = 0.0, stated: bool = False
) -> Iterator[tuple[tuple[float | None, ...], Compared]]:
    """
    Merged records of one position, input and session on different grids or blocks, in pairs of unlike levels, with their levels.

    Sessions are those that the likelihood tells apart, or only those that are stated.
    """
    rows = [(g.entry(k), frozenset(e.level for e in same)) for g in groups for k, same in enumerate(g.entries)]
    for (a, mine), (b, theirs) in combinations(rows, 2):
        together = a.session == b.session if stated else session_of(a) == session_of(b)
        if not together or measured_at(a) != measured_at(b) or estimator_of(a) == estimator_of(b) or mine == theirs:
            continue
        if (found := compared(a, b, model, blow_at)) is not None:
            yield (*mine, *theirs), found


def _with(e: Entry, channels: tuple[str, ...]) -> Entry:
    """A record with some of its channels."""
    return replace(e, response=e.response.sel(output=channels))


def with_like_tails(same: Sequence[Entry], model: Model, blow_at: float = 0.0) -> list[Entry]:
    """Records at one place as if their blocks, whose blows have instants of their own, cut off what they do on average."""
    if any(e.leaks for e in same):
        return list(same)
    tails = np.array([Prediction(model, e.group, blow_at).tail[0] for e in same])
    tails -= tails.mean(axis=0)
    return [
        e.showing(e.data + t, e.variance + (SETTINGS.comparison_tail_error * np.abs(t)) ** 2)
        for e, t in zip(same, tails, strict=True)
    ]


def _less(e: Entry, model: Model, blow_at: float) -> Entry:
    """A record less what a model shows of it, the tail that its block cuts off being known to some part."""
    shown = Prediction(model, e.group, blow_at)
    error = SETTINGS.comparison_tail_error * np.abs(shown.tail[0])
    return e.showing(e.data - shown.data[0], e.variance + error**2)


def _spacing(e: Entry) -> float:
    return float(np.median(np.diff(e.freq)))


def _coinciding(a: FloatArray, b: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the lines that two grids share."""
    at = np.clip(np.searchsorted(b, a), 1, b.size - 1)
    nearest = np.where(np.abs(b[at - 1] - a) <= np.abs(b[at] - a), at - 1, at)
    same = np.flatnonzero(np.abs(b[nearest] - a) <= SETTINGS.comparison_same_line * float(np.median(np.diff(b))))
    return same, nearest[same]


def _interpolated(e: Entry, freq: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """A record at other lines, and its variance there with what interpolation may be off by."""
    data = interpolate.CubicSpline(e.freq, e.data, axis=1)(freq)
    rough = interpolate.CubicSpline(e.freq[::2], e.data[:, ::2], axis=1)(e.freq)
    between = np.zeros(e.freq.size, dtype=bool)
    between[1::2] = True
    # The spline's own noise is a good part of a line's.
    missed = np.maximum(np.abs(rough - e.data) ** 2 - 2.0 * e.variance, 0.0) / SETTINGS.comparison_halved**2
    missed = ndimage.maximum_filter1d(np.where(between, missed, 0.0), SETTINGS.comparison_neighbours, axis=1)
    spread = e.variance + missed
    return np.asarray(data), np.array([np.interp(freq, e.freq, row) for row in spread])
