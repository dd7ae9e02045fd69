"""In which direction a sweep goes: a machine whose response depends on its history answers otherwise on the way back."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal, stats

from cutvib_ss.measurement.records import Record, Sweep
from cutvib_ss.results import FloatArray

_PIECES = 64
"""Of a recording, in each of which a sweep has one frequency."""

_IN_ORDER = 0.9
"""Rank correlation of frequency and time, in modulus, from which a force sweeps: of noise in 64 pieces it is ±0.13."""

_QUIET = 1e-3
"""Of the loudest piece's peak power, below which a piece holds no force."""


def sweep_direction(record: Record) -> Sweep | None:
    """Direction of a sine record as stated, of a recording as its force shows; None where there is no sweep, or both."""
    if record.kind == "timeseries":
        return direction_of([h.force for h in record.histories])
    return record.sweep


def direction_of(forces: Sequence[FloatArray]) -> Sweep | None:
    """Direction in which forces sweep; None where one of them does not, or goes the other way."""
    found = {_direction(np.asarray(force, dtype=np.float64)) for force in forces}
    return found.pop() if len(found) == 1 else None


def opposed(a: Sweep | None, b: Sweep | None) -> bool:
    """Whether two sweeps are known to go in opposite directions."""
    return {a, b} == {"up", "down"}


def _direction(force: FloatArray) -> Sweep | None:
    length = force.size // _PIECES
    if length < 8:
        return None
    *_, power = signal.spectrogram(force, nperseg=length, noverlap=0, scaling="spectrum")
    peak = power.max(axis=0)
    loud = peak > _QUIET * peak.max()
    if np.count_nonzero(loud) < _PIECES // 4:
        return None
    frequency = power.argmax(axis=0)[loud]
    order = float(stats.spearmanr(np.arange(frequency.size), frequency)[0]) if np.ptp(frequency) else 0.0
    if abs(order) < _IN_ORDER:
        return None
    return "up" if order > 0.0 else "down"
