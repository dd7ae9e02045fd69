"""How far records of the same thing differ beyond their noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from cutvib_ss.diagnosis.comparison import compared
from cutvib_ss.diagnosis.records import Entry, measured_at
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.measurement.levels import same_level
from cutvib_ss.measurement.records import Sweep
from cutvib_ss.measurement.sweep_direction import direction_of, opposed


def repeatability(entries: Sequence[Entry]) -> float:
    """
    rms(H_a - H_b) beyond noise over √2 rms(H), of pairs of one position, input, level and kind of force; NaN without any.

    Sweeps up and down are two kinds.
    """
    beyond, size = 0.0, 0.0
    for a, b in combinations(entries, 2):
        if measured_at(a) != measured_at(b):
            continue
        levels = [e.level for e in (a, b) if e.level is not None]
        if len(levels) == 1 or (levels and max(levels) > SETTINGS.record_same_level * min(levels)):
            continue
        if not same_level(_mean(a), _mean(b)) or opposed(_direction(a), _direction(b)):
            continue
        if (pair := compared(a, b)) is None:
            continue
        (one, other), variance = pair.data, pair.variance
        beyond += float(np.mean(np.abs(one - other) ** 2 - variance[0] - variance[1]))
        size += float(np.mean(np.abs(one) ** 2 + np.abs(other) ** 2))
    # rms(H) is of either record: √2 rms(H) squared is the sum of both mean squares.
    return float(np.sqrt(max(beyond, 0.0) / size)) if size else float("nan")


def _mean(e: Entry) -> float | None:
    """Standard deviation of the force of a recording [N]; None of blows and of what was estimated elsewhere."""
    recorded = e.replay is not None and e.replay.block and not e.replay.assumed
    return float(np.std(np.concatenate(e.replay.forces))) if e.replay is not None and recorded else None


def _direction(e: Entry) -> Sweep | None:
    """Direction of a sweep, as stated or as the force goes."""
    if e.sine is not None:
        return e.sine.direction
    return direction_of(e.replay.forces) if e.replay is not None and e.replay.block and not e.replay.assumed else None
