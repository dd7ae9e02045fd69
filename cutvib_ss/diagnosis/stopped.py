"""
Estimated responses that stop ringing since a converter's steps hide the rest of the decay.

What they lack is what a block would cut off that ends at the instant of the stop. It is alike in all blows, so that no coherence
tells it, and only its size is known: a signal near half a step is as wrong as it is large. So it counts as noise that the steps
make, and lines where it is more than some percent of the response are left out, as in records of time histories.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.observations import Observations, less_spoilt
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.dead_zone import stops
from cutvib_ss.results import FloatArray

STOPS = (
    "responses stop ringing {:.2g} s after the blow (in {} records of {}), as where a converter's steps hide the rest of the "
    "decay: near lightly damped modes they count less, or are left out; lower the range, or take more bits"
)
"""What a warning says of responses that stop."""
_ROUNDED = 16.0 / 12.0 * np.log(6.0)
"""
Power by which rounding distorts a decay on its way from three steps to half of one, anywhere in frequency, over that of the rest.

With step q and decay rate σ that is q²/12 for ln 6 / σ, over (q/2)²/2 for 1/2σ.
"""


def with_what_stops(nominal: Model, observed: Observations) -> Observations:
    """The observations, the variance of responses that stop ringing being wider by what they lack."""
    # Time histories tell their steps themselves.
    found = [(e, np.full(len(e.channels), np.inf) if e.estimator.kind else stops(e.response)) for e in observed.entries]
    ends = np.concatenate([end[np.isfinite(end)] for _, end in found])
    # A window ends all responses at one instant.
    if np.unique(ends).size < 2:
        return observed
    entries = tuple(_widened(nominal, e, end) for e, end in found)
    count = sum(bool(np.isfinite(end).any()) for _, end in found)
    word = STOPS.format(float(np.median(ends)), count, len(entries))
    return replace(observed, entries=entries, warnings=(*observed.warnings, word))


def _widened(nominal: Model, e: Entry, ends: FloatArray) -> Entry:
    """A record whose noise is wider by what its channels lack."""
    lacking = np.zeros(e.data.shape)
    for end in np.unique(ends[np.isfinite(ends)]):
        at = SETTINGS.record_blow_at
        cut = replace(e.response, estimator=replace(e.estimator, block=at + end, blow_at=at))
        shown = Prediction(nominal, replace(e, response=cut).group, at)
        tail = np.abs(shown.tail[0, ends == end]) ** 2
        lacking[ends == end] = _nearby(e.freq, tail) + _ROUNDED * tail.mean(axis=-1, keepdims=True)
    if not lacking.any():
        return e
    return less_spoilt(e.showing(e.data, e.variance + lacking), lacking)


def _nearby(freq: FloatArray, squares: FloatArray) -> FloatArray:
    """The largest of some squares over frequency within what tolerances move a resonance by, shape (channel, line)."""
    moved = 1.0 + SETTINGS.record_stop_moves * np.linspace(-1.0, 1.0, 9)
    return np.asarray(np.max([[np.interp(freq * m, freq, row) for row in squares] for m in moved], axis=0))
