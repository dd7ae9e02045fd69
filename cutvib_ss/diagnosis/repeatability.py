"""How far records of the same thing differ beyond their noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from cutvib_ss.diagnosis.comparison import compared
from cutvib_ss.diagnosis.records import Entry, measured_at
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.measurement.levels import SAME_LEVEL


def repeatability(entries: Sequence[Entry]) -> float:
    """rms(H_a - H_b) beyond noise over √2 rms(H), of pairs of one position, input, level and kind of force; NaN without any."""
    beyond, size = 0.0, 0.0
    for a, b in combinations(entries, 2):
        if measured_at(a) != measured_at(b):
            continue
        if not _same(a.level, b.level, SETTINGS.record_same_level) or not _same(_mean(a), _mean(b), 1.0 + SAME_LEVEL):
            continue
        if (pair := compared(a, b)) is None:
            continue
        (one, other), variance = pair.data, pair.variance
        beyond += float(np.mean(np.abs(one - other) ** 2 - variance[0] - variance[1]))
        size += float(np.mean(np.abs(one) ** 2 + np.abs(other) ** 2))
    # rms(H) is of either record: √2 rms(H) squared is the sum of both mean squares.
    return float(np.sqrt(max(beyond, 0.0) / size)) if size else float("nan")


def _same(a: float | None, b: float | None, ratio: float) -> bool:
    """Whether two levels are one, up to a ratio."""
    return a is b if a is None or b is None else max(a, b) <= ratio * min(a, b)


def _mean(e: Entry) -> float | None:
    """Standard deviation of the force of a recording [N]; None of blows and of what was estimated elsewhere."""
    recorded = e.replay is not None and e.replay.block and not e.replay.assumed
    return float(np.std(np.concatenate(e.replay.forces))) if e.replay is not None and recorded else None
