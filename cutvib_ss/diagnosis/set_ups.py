"""
What a set-up does to a response: the head is put down beside its position, the force acts beside its point and direction.

A set-up is one position in one session. To first order its records are all off along a few directions that follow from the nominal
model: the derivative to the position, the response to a force across the tool's, and that to a moment on the tool's link. How far
set-ups are off is told by the evidence, as the drift between sessions is (`cutvib_ss.diagnosis.likelihood`).
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
    """The records with the directions of their set-ups; a structure has no position, and its ports no other direction."""
    if nominal.rail is None:
        return tuple(entries)
    where = [(e.position, e.input, session_of(e)) for e in entries]
    number = {key: k for k, key in enumerate(dict.fromkeys(where))}
    return tuple(
        replace(e, hits={**e.hits, **_of_set_up(nominal, e, number[key])})
        for e, key in zip(entries, where, strict=True)
    )


def _of_set_up(nominal: Machine, e: Entry, number: int) -> Mapping[Hit, ComplexArray]:
    """Directions of a record's set-up, each at the unit of its size; none where the model has no such response."""
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
        # A force beside its point is a moment on the tool's link, whose angle is that of both joints.
        out["aim", number, 1] = SETTINGS.set_up_point * (h[1, :, 2] + h[1, :, 3])
    return out
