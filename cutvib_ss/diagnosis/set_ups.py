"""
Set-up errors: the head is not exactly at its stated position, and the force is tilted and offset from its point.

A set-up is one position in one session, and its records share its errors. To first order these change a response by the derivative
to the position, by the response to a force at right angles to the nominal one, and by that to a moment on the tool's link, all of
the nominal model, or of the best linear cause's once its fit has found where the heads are. Their sizes are inferred like the drift
between sessions (`cutvib_ss.diagnosis.likelihood`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from cutvib_ss.diagnosis.hit_errors import Placed
from cutvib_ss.diagnosis.records import Entry, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.fit import Fit


MISAIMED = (
    "the force is off alike in all set-ups: tilted by about {:+.2g} rad from X towards Z, and {:+.1e} m off its point (a moment on "
    "the tool's link, hard to tell from a tilt): strike, or drive, along the axis and measure again"
)
"""What is said of it."""


def with_set_ups(nominal: Model, entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """The records with the directions of their set-up errors; a structure has no positions, and no port at right angles."""
    if nominal.rail is None:
        return tuple(entries)
    where = [(e.position, e.input, session_of(e)) for e in entries]
    number = {key: k for k, key in enumerate(dict.fromkeys(where))}
    return tuple(_directed(nominal, e, number[key]) for e, key in zip(entries, where, strict=True))


def placed_by(made: Fit, entries: Sequence[Entry]) -> tuple[Entry, ...] | None:
    """The same about where a fit found each head, and by its model; None where it found no set-up errors."""
    lay, sizes = made.spread.layout, made.spread.sizes
    least = SETTINGS.likelihood_set_up_sizes[0][0]
    rail = made.model.rail
    if rail is None or max(sizes.aim, sizes.placing) <= least:
        return None
    unit = SETTINGS.set_up_position / rail.parameters.length
    out = []
    for e in entries:
        key = next((hit for hit in e.hits if hit[0] == "placing" and hit in lay.hits), None)
        if key is not None and e.position is not None:
            error = sizes.placing * float(made.spread.offsets[lay.first_hit + lay.hits.index(key)])
            low, high = _beside(e.position, unit * abs(error))
            position = high if error > 0.0 else low
            placed = Placed(position, (position - e.position) / unit)
            e = _directed(made.corrected.model, replace(e, placed=placed), key[1])
        out.append(e)
    return tuple(out)


def misaimed(made: Fit) -> tuple[float, float] | None:
    """
    Tilt [rad] and offset [m] of the force that all set-ups share; None where chance makes them, or a hand aims as badly.

    Set-up errors are drawn for each by itself: their mean over n of them is normal with variance 1/n. What all share is an error of
    the test, such as a shaker that stands askew.
    """
    lay = made.spread.layout
    shared = []
    for change in (0, 1):
        own = [made.spread.offsets[lay.first_hit + k] for k, hit in enumerate(lay.hits) if hit[::2] == ("aim", change)]
        mean, z = (float(np.mean(own)), abs(float(np.sum(own))) / np.sqrt(len(own))) if own else (0.0, 0.0)
        shared.append(made.spread.sizes.aim * mean if z > SETTINGS.set_up_shared else 0.0)
    if max(map(abs, shared)) <= SETTINGS.sizes["aim"][-1][0]:
        return None
    return SETTINGS.set_up_angle * shared[0], SETTINGS.set_up_point * shared[1]


def words_on_aim(made: Fit) -> tuple[str, ...]:
    """What is said of a force that is off alike in all set-ups."""
    shared = misaimed(made)
    return () if shared is None else (MISAIMED.format(*shared),)


def _beside(position: float, step: float) -> tuple[float, float]:
    """Positions a step below and above one, on the rail."""
    return max(position - step, position / 2), min(position + step, (1.0 + position) / 2)


def _directed(model: Model, e: Entry, number: int) -> Entry:
    """A record with what unit errors of its set-up, which has a number, do; nothing where the model has no such response."""
    if e.head_at is None or model.rail is None:
        return e
    step = SETTINGS.set_up_position / model.rail.parameters.length
    low, high = _beside(e.head_at, step)
    h = _responses(model, e, [low, high], (e.input,))
    if h is None:
        return e
    placing = (h[1, :, 0] - h[0, :, 0]) * (step / (high - low))
    aim = {("aim", number, k): shown for k, shown in enumerate(of_force(model, e))}
    return replace(e, hits={**e.hits, ("placing", number, 0): placing, **aim})


def of_force(model: Model, e: Entry) -> ComplexArray:
    """Changes of a record's response by a force of unit tilt, and of unit offset; shape (change, channel, frequency)."""
    none = np.zeros((0, len(e.channels), e.freq.size), dtype=np.complex128)
    if model.rail is None or e.head_at is None or e.input not in (FORCE, model.input_port):
        return none
    h = _responses(model, e, [e.head_at], ("tool_z", "joint1", "joint2"))
    if h is None:
        return none
    # An offset force is a moment on the tool's link, whose angle is the sum of both joints'.
    return np.stack([SETTINGS.set_up_angle * h[0, :, 0], SETTINGS.set_up_point * (h[0, :, 1] + h[0, :, 2])])


def _responses(model: Model, e: Entry, positions: Sequence[float], inputs: tuple[str, ...]) -> ComplexArray | None:
    """Responses of a record's channels to some inputs, shape (position, channel, input, frequency); None where it has none."""
    decay = float(e.estimator.exponential_decay)
    try:
        shown = frequency_response(model, positions, e.freq, inputs=inputs, outputs=e.channels, decay_rate=decay)
    except CutvibError:
        return None
    order = [DERIVATIVE_ORDER[q] - DERIVATIVE_ORDER[own] for q, own in zip(e.quantities, shown.quantities, strict=True)]
    s = 2j * np.pi * e.freq + decay
    return np.asarray(shown.data * s ** np.array(order)[:, None, None])
