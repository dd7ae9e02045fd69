"""What the page draws: measured responses, and the model's at the head's position, with an absorber and a controller."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from cutvib_ss.absorber.coupling import attach_absorber
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.inputs import response_to
from cutvib_ss.measurement.records import Campaign
from cutvib_ss.measurement.summary import RecordSummary
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import AbsorberParameters, table_7
from cutvib_ss.report.frame import lines_to_draw
from cutvib_ss.response.frequency import frequency_response, output_quantities
from cutvib_ss.response.modes import modes
from cutvib_ss.results import ComplexArray, FloatArray, MeasuredFrequencyResponse
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    import control

    from cutvib_ss.control_design.loop import Loop

WORKING_FREQUENCY = 217.0
"""Frequency of the tool's force on a cutting machine [Hz]."""
_HIGHEST = 500.0
MOST_LINES = 1200
"""Drawn of a measured response."""
_EVEN_LINES = 420
_NEAR_A_MODE = np.array([-8.0, -4.0, -2.0, -1.2, -0.7, -0.35, 0.0, 0.35, 0.7, 1.2, 2.0, 4.0, 8.0])
"""Lines about each natural frequency, in its half-power half widths."""
_ALONG = np.linspace(0.02, 0.98, 97)
_CONTROLLED = np.linspace(0.02, 0.98, 33)
"""Positions over the rail at which a closed loop is evaluated: each takes some milliseconds."""


@dataclass(frozen=True)
class Curve:
    """One response over frequency."""

    name: str
    freq: FloatArray
    data: ComplexArray
    kind: str
    unit: str = ""
    colour: int | None = None


@dataclass(frozen=True)
class Controller:
    """A controller prototype: its name, the gain on its design, and the position at which it was designed."""

    name: str
    gain: float = 1.0
    designed_at: float = 0.5


@dataclass(frozen=True)
class Change:
    """What is added to the machine: an absorber at a port, a controller, both or nothing."""

    absorber: AbsorberParameters | None = None
    port: str = "tool_x"
    controller: Controller | None = None


@dataclass(frozen=True)
class Modified:
    """The model as it is and with what is added, at one position."""

    curves: tuple[Curve, ...]
    stable: bool | None
    growth: float = 0.0
    growth_freq: float = 0.0


def band_of(model: Model, records: Sequence[RecordSummary]) -> tuple[float, float]:
    """The band of all records [Hz]; of a cutting machine not far beyond the second harmonic of the tool's force."""
    low = min((r.band_hz[0] for r in records), default=5.0)
    high = max((r.band_hz[1] for r in records), default=_HIGHEST)
    return low, min(high, max(_HIGHEST, 2 * low)) if model.has_position else high


def measured_curves(
    frfs: Sequence[MeasuredFrequencyResponse], records: Sequence[RecordSummary], chosen: Sequence[int], output: str
) -> list[Curve]:
    """Chosen records' responses of one channel, in their bands."""
    curves = []
    for name, colour, part, inside in _in_bands(frfs, records, chosen, output):
        at = np.flatnonzero(inside)
        keep = at[lines_to_draw(np.abs(part.data[0, 0, 0, at]), MOST_LINES)]
        curves.append(Curve(name, part.freq[keep], part.data[0, 0, 0, keep], "measured", part.units[0], colour))
    return curves


def coherence_curves(
    frfs: Sequence[MeasuredFrequencyResponse], records: Sequence[RecordSummary], chosen: Sequence[int], output: str
) -> list[Curve]:
    """Chosen records' coherence of one channel, where it is known."""
    curves = []
    for name, colour, part, inside in _in_bands(frfs, records, chosen, output):
        row = part.coherence[0, 0, 0]
        at = np.flatnonzero(np.isfinite(row) & inside)
        if at.size:
            keep = at[lines_to_draw(row[at], MOST_LINES // 2)]
            curves.append(Curve(name, part.freq[keep], row[keep].astype(complex), "coherence", "", colour))
    return curves


def _in_bands(
    frfs: Sequence[MeasuredFrequencyResponse], records: Sequence[RecordSummary], chosen: Sequence[int], output: str
) -> Iterator[tuple[str, int, MeasuredFrequencyResponse, np.ndarray]]:
    """Of chosen records that have a channel their name, colour, response and lines in the band."""
    names = labels_of(records, frfs[0].input_unit)
    for colour, k in enumerate(chosen):
        if output in frfs[k].outputs:
            part, (low, high) = frfs[k].sel(output=output), records[k].band_hz
            yield names[k], colour, part, (part.freq >= low) & (part.freq <= high) & (part.freq > 0)


def model_curves(
    model: Model, campaign: Campaign, records: Sequence[RecordSummary], chosen: Sequence[int], output: str, kind: str
) -> list[Curve]:
    """The model's responses where chosen records were taken, one for each position and input."""
    curves: dict[tuple[float | None, str | None], Curve] = {}
    for colour, k in enumerate(chosen):
        record = records[k]
        place = (record.position, record.input)
        if place in curves or output not in {c.name for c in record.channels}:
            continue
        freq = lines_of(model, record.position, *record.band_hz)
        found = response_to(record.input, model, record.position, freq, output)
        name = kind if record.position is None else f"{kind}, y/L = {record.position:.3g}"
        curves[place] = Curve(name, freq, found.data[0, 0, 0], kind, found.units[0], colour)
    return list(curves.values())


def labels_of(records: Sequence[RecordSummary], unit: str) -> list[str]:
    """Records as the legend names them: by position, input and level, and by file where these are alike."""
    short = [_label(r, unit) for r in records]
    return [
        text if text and short.count(text) == 1 else f"{text}{', ' if text else ''}{r.name}"
        for text, r in zip(short, records, strict=True)
    ]


def _label(record: RecordSummary, unit: str) -> str:
    place = "" if record.position is None else f"y/L = {record.position:.3g}"
    struck = f"struck at {record.input}" if record.input else ""
    level = "" if record.level is None else f"{record.level:.3g} {unit}"
    return ", ".join(p for p in (place, struck, level) if p)


def lines_of(model: Model, position: float | None, low: float, high: float) -> FloatArray:
    """Frequencies to draw a model at: evenly over the band, and closely about its natural frequencies [Hz]."""
    found = modes(model, position)
    within = (found.natural_freq > low) & (found.natural_freq < high)
    centre, width = found.natural_freq[within], (found.natural_freq * found.damping_ratio)[within]
    near = (centre[:, None] + np.clip(width, 1e-3, None)[:, None] * _NEAR_A_MODE).ravel()
    lines = np.concatenate([np.linspace(low, high, _EVEN_LINES), near])
    chosen: FloatArray = np.unique(lines[(lines >= low) & (lines <= high)])
    return chosen


def modified(model: Model, position: float | None, output: str, change: Change, band: tuple[float, float]) -> Modified:
    """The model's response to its force at a position, as it is and with what is added to it."""
    freq = lines_of(model, position, *band)
    bare = frequency_response(model, _at(position), freq, outputs=output)
    curves = [Curve("the model", freq, bare.data[0, 0, 0], "nominal", bare.units[0])]
    damped = model
    if change.absorber is not None:
        damped = attach_absorber(model, change.absorber, change.port)
        freq = np.union1d(freq, lines_of(damped, position, *band))
        found = frequency_response(damped, _at(position), freq, outputs=output)
        curves.append(Curve("with the absorber", freq, found.data[0, 0, 0], "absorber", found.units[0]))
    if change.controller is None or damped.rail is None or position is None:
        return Modified(tuple(curves), None)
    return _controlled(model, damped, position, output, change.controller, curves)


def _controlled(
    model: Model, damped: Machine, position: float, output: str, wanted: Controller, curves: list[Curve]
) -> Modified:
    """The closed loop beside the other curves; only where it is stable does it have a response."""
    from cutvib_ss.control_design.hardware import MOTIONS

    loop = _closed(model, damped, position, wanted)
    fastest = loop.poles[np.argmax(loop.poles.real)]
    stable = bool(fastest.real < 0.0)
    if stable and output in MOTIONS:
        freq = curves[-1].freq
        data = _closed_response(loop, model, output, freq)
        curves.append(Curve("with the controller", freq, data, "controller", curves[0].unit))
    return Modified(tuple(curves), stable, float(fastest.real), float(abs(fastest.imag)) / (2 * np.pi))


def _closed(model: Model, damped: Machine, position: float, wanted: Controller) -> Loop:
    """The loop of a controller, designed for the model, around the machine at a position."""
    from cutvib_ss.control_design.hardware import Sampling, control_plant
    from cutvib_ss.control_design.loop import Loop
    from cutvib_ss.control_design.prototypes import prototype

    kind, sampling = prototype(wanted.name), Sampling()
    hardware = kind.hardware(kind.port, sampling)
    assert model.rail is not None
    controller = _scaled(designed(model, wanted.name, wanted.designed_at), wanted.gain)
    return Loop(control_plant(damped, position, hardware, delayed=False), controller, sampling)


def _closed_response(loop: Loop, model: Model, output: str, freq: FloatArray) -> ComplexArray:
    """Response of a channel in a closed loop: its plant gives accelerations, the channel reads what it reads."""
    from cutvib_ss.control_design.hardware import MOTIONS

    _, closed, _ = loop.response(freq)
    order = DERIVATIVE_ORDER[output_quantities(model, (output,), None)[0]] - 2
    data: ComplexArray = closed[MOTIONS.index(output)] * (2j * np.pi * freq) ** order
    return data


def controlled_along_the_rail(model: Model, output: str, change: Change, freq: float) -> Curve | None:
    """The controlled machine at one frequency over the positions of the head; not a number where its loop is unstable."""
    from cutvib_ss.control_design.hardware import MOTIONS

    damped = model if change.absorber is None else attach_absorber(model, change.absorber, change.port)
    if change.controller is None or output not in MOTIONS or damped.rail is None:
        return None
    values = np.full(_CONTROLLED.size, np.nan, dtype=np.complex128)
    for k, position in enumerate(_CONTROLLED):
        loop = _closed(model, damped, float(position), change.controller)
        if np.all(loop.poles.real < 0.0):
            values[k] = _closed_response(loop, model, output, np.array([freq]))[0]
    return Curve("with the controller", _CONTROLLED, values, "controller")


@dataclass(frozen=True, eq=False)
class _Held:
    """A machine by its identity, so that designs for it can be kept."""

    machine: Machine

    def __hash__(self) -> int:
        return id(self.machine)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Held) and other.machine is self.machine


@lru_cache(maxsize=32)
def _designed(held: _Held, name: str, position: float) -> control.StateSpace:
    from cutvib_ss.control_design.hardware import Sampling
    from cutvib_ss.control_design.prototypes import prototype

    kind = prototype(name)
    return kind.design(held.machine, position, kind.hardware(kind.port, Sampling()))


def designed(model: Machine, name: str, position: float) -> control.StateSpace:
    """A prototype designed for a machine at a position; the last ones are kept."""
    return _designed(_Held(model), name, position)


def _scaled(controller: control.StateSpace, gain: float) -> control.StateSpace:
    import control as ct

    return ct.ss(
        controller.A, controller.B, gain * controller.C, gain * controller.D, controller.dt,
        inputs=controller.input_labels, outputs=controller.output_labels, name=controller.name,
    )  # fmt: skip


def along_the_rail(model: Model, output: str, change: Change, freq: float) -> list[Curve]:
    """Modulus at one frequency over all positions of the head, as it is and with the absorber; positions for frequencies."""
    found = frequency_response(model, _ALONG, [freq], outputs=output)
    curves = [Curve("the model", _ALONG, found.data[:, 0, 0, 0], "nominal", found.units[0])]
    if change.absorber is not None:
        with_it = attach_absorber(model, change.absorber, change.port)
        data = frequency_response(with_it, _ALONG, [freq], outputs=output).data[:, 0, 0, 0]
        curves.append(Curve("with the absorber", _ALONG, data, "absorber", found.units[0]))
    return curves


def at_frequency(curve: Curve, freq: float) -> float | None:
    """Modulus of a curve at a frequency inside of it."""
    if not curve.freq.size or not curve.freq[0] <= freq <= curve.freq[-1]:
        return None
    return float(np.interp(freq, curve.freq, np.abs(curve.data)))


def default_absorber(model: Model) -> AbsorberParameters:
    """Where the absorber's sliders start: Table 7's of a cutting machine, else a fiftieth of the mass at the first mode."""
    if model.head is not None:
        return replace(table_7(), source="", caveat="")
    first = float(modes(model, None).natural_freq[0])
    return AbsorberParameters(max(first, 0.1), 0.05, 0.02 * float(np.mean(np.diag(model.system.mass))))


def _at(position: float | None) -> list[float] | None:
    return None if position is None else [position]
