"""
Drift within sessions that goes with the level: of a machine that warms while each session is measured from soft to hard.

Drift of single records is drawn by itself, and pays for each. If sessions were all measured in one order of their levels, a machine
that warms moves every tuned value in proportion to the logarithm of the level, as a restoring force may. That is part of what is
meant by drift: each hypothesis counts with it, with the probability that sessions are so measured.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np

from cutvib_ss.diagnosis.likelihood import Factored, solved
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.records import Records, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import FloatArray


def about_sessions(values: FloatArray, names: Sequence[Hashable]) -> FloatArray:
    """Values of records about the mean of their session, along the first axis."""
    out = np.array(values, dtype=np.float64)
    for name in set(names):
        same = np.array([n == name for n in names])
        out[same] -= out[same].mean(axis=0)
    return out


def evidence_of_trend(spread: Spread, records: Records) -> float:
    """
    Log evidence that a fit gains once drift from record to record may go with the level.

    One slope a tuned value over the logarithm of the level, sessions apart, with a prior of the size of the drift itself. To first
    order about the fit: at its posterior mean the gradient of the likelihood to each drift is what its prior of unit size pulls.
    """
    lay = spread.layout
    by_record = {e.record: e for e in records.entries}
    of = [by_record[r] for r in lay.records]
    driven = [e.driven for e in of]
    if not of or any(level is None for level in driven):
        return 0.0
    level = about_sessions(np.log(np.array(driven, dtype=np.float64)), [session_of(e) for e in of])
    if np.sum(level**2) < np.log(SETTINGS.level_apart) ** 2 / 2:
        return 0.0
    level /= np.sqrt(np.mean(level**2))
    within = np.arange(lay.first_within, lay.first_nominal).reshape(len(of), lay.per_session)
    moved = np.zeros((lay.size, lay.per_session))
    moved[within, np.arange(lay.per_session)] = level[:, None]
    of_data = spread.precision @ moved - moved
    inner = moved.T @ of_data + np.eye(lay.per_session) - of_data.T @ solved(spread.precision, of_data)
    slopes = Factored(inner)
    gain = 0.5 * (slopes.gain(moved.T @ spread.offsets) - slopes.log_determinant)
    return float(np.logaddexp(np.log1p(-SETTINGS.level_trend), np.log(SETTINGS.level_trend) + gain))
