"""How far records of the same thing differ beyond their noise."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from cutvib_ss.diagnosis.records import Entry, measured_at

ALIKE = 1.05
"""Ratio of levels up to which two records are of the same thing."""


def repeatability(entries: Sequence[Entry]) -> float:
    """rms(H_a - H_b) beyond noise over √2 rms(H), over all pairs of one position, input, level and grid; NaN where none repeat."""
    beyond, size = 0.0, 0.0
    for a, b in combinations(entries, 2):
        same = measured_at(a) == measured_at(b) and a.channels == b.channels
        if not same or a.data.shape != b.data.shape or not np.allclose(a.freq, b.freq, rtol=1e-6):
            continue
        levels = [e.level if np.isfinite(e.level) else 1.0 for e in (a, b)]
        if max(levels) > ALIKE * min(levels) or np.isfinite(a.level) != np.isfinite(b.level):
            continue
        beyond += float(np.mean(np.abs(a.data - b.data) ** 2 - a.variance - b.variance))
        size += float(np.mean(np.abs(a.data) ** 2 + np.abs(b.data) ** 2))
    # rms(H) is of either record: √2 rms(H) squared is the sum of both mean squares.
    return float(np.sqrt(max(beyond, 0.0) / size)) if size else float("nan")
