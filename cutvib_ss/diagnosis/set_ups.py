"""
Set-up errors: the head is not exactly at its stated position, and the force is tilted and offset from its point.

A set-up is one position in one session, and its records share its errors. To first order these change a response by the derivative
to the position, by the response to a force at right angles to the nominal one, and by that to a moment on the tool's link, all of
the nominal model. Their sizes are inferred like the drift between sessions (`cutvib_ss.diagnosis.likelihood`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.records import Entry, Hit, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.model.machine import Machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray
from cutvib_ss.units import DERIVATIVE_ORDER


def with_set_ups(nominal: Model, entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """The records with the directions of their set-up errors; a structure has no positions, and no port at right angles."""
    if nominal.rail is None:
        return tuple(entries)
    where = [(e.position, e.input, session_of(e)) for e in entries]
    number = {key: k for k, key in enumerate(dict.fromkeys(where))}
    return tuple(
        replace(e, hits={**e.hits, **_of_set_up(nominal, e, number[key])})
        for e, key in zip(entries, where, strict=True)
    )


def _of_set_up(nominal: Machine, e: Entry, number: int) -> Mapping[Hit, ComplexArray]:
    """Changes of a record's responses by unit set-up errors; none where the model has no such response."""
    if e.position is None:
        return {}
    struck = e.input in (FORCE, nominal.input_port)
    step = SETTINGS.set_up_position / nominal.rail.parameters.length
    low, high = max(e.position - step, e.position / 2), min(e.position + step, (1.0 + e.position) / 2)
    inputs = (e.input, *(("tool_z", "joint1", "joint2") if struck else ()))
    decay = float(e.estimator.exponential_decay)
    try:
        shown = frequency_response(
            nominal, [low, e.position, high], e.freq, inputs=inputs, outputs=e.channels, decay_rate=decay
        )
    except CutvibError:
        return {}
    order = [DERIVATIVE_ORDER[q] - DERIVATIVE_ORDER[own] for q, own in zip(e.quantities, shown.quantities, strict=True)]
    s = 2j * np.pi * e.freq + decay
    h = shown.data * s ** np.array(order)[:, None, None]
    out: dict[Hit, ComplexArray] = {("placing", number, 0): (h[2, :, 0] - h[0, :, 0]) * (step / (high - low))}
    if struck:
        out["aim", number, 0] = SETTINGS.set_up_angle * h[1, :, 1]
        # An offset force is a moment on the tool's link, whose angle is the sum of both joints'.
        out["aim", number, 1] = SETTINGS.set_up_point * (h[1, :, 2] + h[1, :, 3])
    return out
