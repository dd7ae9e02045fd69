"""How far records of the same thing differ beyond their noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from cutvib_ss.diagnosis.comparison import compared
from cutvib_ss.diagnosis.records import Entry, measured_at
from cutvib_ss.diagnosis.settings import SETTINGS


def repeatability(entries: Sequence[Entry]) -> float:
    """rms(H_a - H_b) beyond noise over √2 rms(H), of all pairs of one position, input and level; NaN where none repeat."""
    beyond, size = 0.0, 0.0
    for a, b in combinations(entries, 2):
        if measured_at(a) != measured_at(b):
            continue
        levels = [e.level for e in (a, b) if e.level is not None]
        if len(levels) == 1 or (levels and max(levels) > SETTINGS.record_same_level * min(levels)):
            continue
        if (pair := compared(a, b)) is None:
            continue
        (one, other), variance = pair.data, pair.variance
        beyond += float(np.mean(np.abs(one - other) ** 2 - variance[0] - variance[1]))
        size += float(np.mean(np.abs(one) ** 2 + np.abs(other) ** 2))
    # rms(H) is of either record: √2 rms(H) squared is the sum of both mean squares.
    return float(np.sqrt(max(beyond, 0.0) / size)) if size else float("nan")
