"""How hard each record was driven."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence

import numpy as np

from cutvib_ss.measurement.records import Record

SAME_LEVEL = 0.15
"""Of the larger of two levels, within which they are meant to be one: a hand's blows differ by as much."""

LEVELS_APART = 1.5
"""Ratio of two levels from which a response that depends on the level would show."""


def same_level(a: float | None, b: float | None) -> bool:
    """Whether two levels are meant to be one."""
    if a is None or b is None:
        return a is b
    return abs(a - b) <= SAME_LEVEL * max(a, b)


def sessions_of_one_level(each: Iterable[tuple[Hashable, float | None]]) -> bool:
    """Whether each session, of (session, level), has one level, and they differ: drift then does what the level does."""
    levels: dict[Hashable, list[float]] = {}
    for session, level in each:
        if level is not None:
            levels.setdefault(session, []).append(level)
    every = [level for own in levels.values() for level in own]
    apart = len(levels) > 1 and max(every) > LEVELS_APART * min(every)
    return apart and all(max(own) <= LEVELS_APART * min(own) for own in levels.values())


def peaks(record: Record) -> list[float]:
    """Largest force of each blow [N], about what it is at rest; none of other records."""
    if record.kind != "impact":
        return []
    return [float(np.max(np.abs(h.force - np.median(h.force)))) for h in record.histories]


def own_level(record: Record) -> float | None:
    """Level of a record [N]: as stated, else of blows the median of their peaks, and of a recording what all but 0.1 % keeps to."""
    if record.peak_force is not None or not record.histories:
        return record.peak_force
    if blows := peaks(record):
        return float(np.median(blows))
    return float(np.quantile(np.abs(np.concatenate([h.force - np.median(h.force) for h in record.histories])), 0.999))


def mean_level(record: Record) -> float | None:
    """Standard deviation of a recording's force [N], which tells a sweep from noise of the same peak; None of other records."""
    if record.kind != "timeseries" or not record.histories:
        return None
    return float(np.std(np.concatenate([h.force - np.median(h.force) for h in record.histories])))


def levels_of(records: Sequence[Record]) -> list[float | None]:
    """
    Levels of a campaign's records as a diagnosis compares them [N]: as stated, else those of blows; None where neither tells.

    No two blows of a hand are alike: medians within `SAME_LEVEL` of the next lower one are one level, up to `LEVELS_APART` times
    the lowest: that which is stated there, or else the median of all.
    """
    out = [r.peak_force for r in records]
    stated = [level for level in out if level is not None]
    struck = {i: own_level(r) for i, r in enumerate(records) if out[i] is None and r.kind == "impact"}
    rows = sorted((level, i) for i, level in struck.items() if level)
    while rows:
        alike = [rows.pop(0)]
        while rows and same_level(alike[-1][0], rows[0][0]) and rows[0][0] < LEVELS_APART * alike[0][0]:
            alike.append(rows.pop(0))
        typical = float(np.median([level for level, _ in alike]))
        near = [x for x in stated if same_level(x, typical)]
        for _, i in alike:
            out[i] = min(near, key=lambda x: abs(x - typical), default=typical)
    return out
