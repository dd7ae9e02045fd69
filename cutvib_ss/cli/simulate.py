"""The command that runs a force through a model in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import (
    JsonOption,
    MachineOption,
    PositionOption,
    above_zero,
    check_places,
    check_position_given,
    existing_input,
    load_model,
    picture,
)
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show, working, write_all
from cutvib_ss.errors import ParameterError

if TYPE_CHECKING:
    from cutvib_ss.model.machine import Machine
    from cutvib_ss.model.structure import Structure
    from cutvib_ss.response.travel import Travel
    from cutvib_ss.results import FloatArray, Quantity, TimeResponse

_PULSES, _HARMONICS, _RECORD, _TRAVEL, _FILES = "Pulses", "Harmonics", "Recorded force", "Travelling head", "Output"


class QuantityName(StrEnum):
    """Motion quantities."""

    DISPLACEMENT = "displacement"
    VELOCITY = "velocity"
    ACCELERATION = "acceleration"


@dataclass(frozen=True)
class _Force:
    values: FloatArray
    fs: float
    said: str


def simulate_command(
    position: PositionOption = None,
    duration: Annotated[
        float, typer.Option("--duration", callback=above_zero, help="Length of the simulation \\[s].")
    ] = 1.0,
    fs: Annotated[float, typer.Option("--fs", callback=above_zero, help="Sampling frequency [Hz].")] = 20_000.0,
    steady: Annotated[
        bool,
        typer.Option("--steady", help="One period of the steady state in place of a run from rest."),
    ] = False,
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output", metavar="NAME",
            help="Channel, port, rail_left_force or rail_right_force; may be given several times. By default all channels.",
        ),
    ] = None,
    quantity: Annotated[
        QuantityName | None, typer.Option("--quantity", help="Motion of the outputs; by default a channel's own.")
    ] = None,
    rate: Annotated[
        float, typer.Option("--rate", callback=above_zero, help="Pulses a second [Hz].", rich_help_panel=_PULSES)
    ] = 217.0,
    duty: Annotated[
        float, typer.Option("--duty", help="Part of the period above half the peak.", rich_help_panel=_PULSES)
    ] = 0.3,
    rise: Annotated[
        float, typer.Option("--rise", callback=above_zero, help="Rise, foot to top \\[s].", rich_help_panel=_PULSES)
    ] = 5e-4,
    fall: Annotated[
        float, typer.Option("--fall", callback=above_zero, help="Fall, top to foot \\[s].", rich_help_panel=_PULSES)
    ] = 5e-4,
    amplitude: Annotated[float, typer.Option("--amplitude", help="Peak [N].", rich_help_panel=_PULSES)] = 50.0,
    jitter: Annotated[
        float,
        typer.Option("--jitter", help="Spread of the pulses' instants, as a part of the period.", rich_help_panel=_PULSES),
    ] = 0.0,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the jitter.", rich_help_panel=_PULSES)] = 0,
    harmonic: Annotated[
        list[str] | None,
        typer.Option(
            "--harmonic", metavar="HZ:N", rich_help_panel=_HARMONICS,
            help="A cosine in place of the pulses; may be given several times.",
        ),
    ] = None,
    force: Annotated[
        Path | None,
        typer.Option(
            "--force", metavar="FILE", rich_help_panel=_RECORD, callback=existing_input,
            help="A record with a channel `force`, in any format of a campaign; for instance CSV with `time \\[s],force [N]`.",
        ),
    ] = None,
    to: Annotated[
        float | None,
        typer.Option("--to", metavar="Y", rich_help_panel=_TRAVEL, help="Travel from --position to here."),
    ] = None,
    speed: Annotated[
        float, typer.Option("--speed", callback=above_zero, help="Largest speed \\[m/s].", rich_help_panel=_TRAVEL)
    ] = 0.5,
    acceleration: Annotated[
        float, typer.Option("--acceleration", callback=above_zero, help="Acceleration \\[m/s^2].", rich_help_panel=_TRAVEL)
    ] = 2.0,
    jerk: Annotated[
        float | None,
        typer.Option(
            "--jerk", callback=above_zero, rich_help_panel=_TRAVEL,
            help="Jerk of an S-curve \\[m/s^3]; by default the speed is a trapezoid.",
        ),
    ] = None,
    travel: Annotated[
        Path | None,
        typer.Option(
            "--travel", metavar="FILE", rich_help_panel=_TRAVEL, callback=existing_input,
            help="A recorded travel in place of --position and --to: CSV with `time \\[s],position \\[y/L]`.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", rich_help_panel=_FILES, help="Histories: .csv or .npz.")
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot", metavar="FILE", rich_help_panel=_FILES, help="Picture: .png, .svg or .pdf.", callback=picture
        ),
    ] = None,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:  # fmt: skip
    """Time response to the tool's pulses, to harmonics or a recorded force; with the machine's nonlinear elements."""
    check_outputs(out, plot, json)
    if travel is None:
        check_position_given(machine, position)
    from cutvib_ss.interchange.time_files import check_time_file, write_time_response
    from cutvib_ss.plot.style import save
    from cutvib_ss.plot.time import time_histories
    from cutvib_ss.response.pulses import pulse_train

    if out is not None:
        check_time_file(out)
    model = load_model(machine)
    way = None
    if travel is not None or to is not None:
        way = _way(model, position, to, travel, (speed, acceleration, jerk), steady)
        position = float(way.at(0.0)[0])
    places = check_places(model, None if position is None else [position])
    place = None if places is None else places[0]
    if force is not None:
        given = _recorded(force, model)
    elif harmonic:
        given = _harmonics(harmonic, fs, duration, steady)
    else:
        train = partial(pulse_train, rate=rate, duty=duty, rise=rise, fall=fall, amplitude=amplitude)
        given = _pulses(train, rate, fs, duration, steady, jitter, seed)
        unit = "N" if model.input_quantity == "force" else "m/s^2"
        given = replace(given, said=f"pulses of {amplitude:g} {unit} at {rate:g} Hz")
    with working("running the force through the model"):
        found = _respond(model, place, given, output, quantity, steady, way)
    writers: dict[str | Path, Any] = {}
    if out is not None:
        writers[out] = lambda draft: write_time_response(found, draft)
    if plot is not None:
        where = "" if place is None else f", head at y/L = {place:g}"
        if way is not None:
            where = f", head from {place:g} to {float(way.at(given.values.size / given.fs)[0]):.3g}"
        title = f"{given.said[:1].upper()}{given.said[1:]}{where}"
        writers[plot] = lambda draft: save(time_histories(found, title=title), draft)
    write_all(writers)
    if give_json(_figures(found, given, steady), json):
        return
    _show(found, given, steady)
    for path in (out, plot):
        if path is not None:
            say(results(), f"written: {path}")


def _respond(
    model: Machine | Structure,
    place: float | None,
    given: _Force,
    output: list[str] | None,
    quantity: QuantityName | None,
    steady: bool,
    way: Travel | None,
) -> TimeResponse:
    from cutvib_ss.response.time_response import time_response

    wanted: Quantity | None = None if quantity is None else quantity.value
    if way is None:
        return time_response(
            model,
            place,
            given.values,
            given.fs,
            outputs=output,
            quantity=wanted,
            start="periodic" if steady else "rest",
            viscous_at=217.0,
        )
    from cutvib_ss.response.moving import moving_response

    assert model.rail is not None
    return moving_response(model, way, given.values, given.fs, outputs=output, quantity=wanted, viscous_at=217.0)


def _way(
    model: Machine | Structure,
    position: float | None,
    to: float | None,
    file: Path | None,
    limits: tuple[float, float, float | None],
    steady: bool,
) -> Travel:
    """How the head travels."""
    from cutvib_ss.response.travel import s_curve, trapezoid

    option = "--to" if file is None else "--travel"
    if model.rail is None:
        raise ParameterError(f"{option}: this model has no position; leave the option out")
    if steady:
        raise ParameterError(f"{option} with --steady: a head that travels has no steady state; leave one of them out")
    if file is not None:
        from cutvib_ss.interchange.travel_files import read_travel

        if to is not None or position is not None:
            raise ParameterError("--travel tells where the head is; leave --position and --to out")
        return read_travel(file)
    if position is None or to is None:
        raise ParameterError("--to: say with --position where the head starts")
    speed, acceleration, jerk = limits
    length = model.rail.parameters.length
    if jerk is None:
        return trapezoid(position, to, speed, acceleration, length)
    return s_curve(position, to, speed, acceleration, jerk, length)


def _pulses(
    train: Callable[..., FloatArray], rate: float, fs: float, duration: float, steady: bool, jitter: float, seed: int
) -> _Force:
    from math import ceil

    if not steady:
        return _Force(train(fs, duration, jitter=jitter, seed=seed), fs, "")
    if jitter:
        raise ParameterError("--jitter with --steady: uneven pulses have no period; leave one of them out")
    if not (rate > 0.0 and fs > 0.0):
        raise ParameterError(f"--rate {rate:g} and --fs {fs:g} must be positive")
    even = rate * ceil(fs / rate)  # a whole number of samples in a period
    return _Force(train(even, 1.0 / rate), even, "")


def _harmonics(asked: list[str], fs: float, duration: float, steady: bool) -> _Force:
    from math import ceil

    from cutvib_ss.response.pulses import harmonic_force

    lines = []
    for text in asked:
        try:
            freq, amplitude = (float(part) for part in text.split(":"))
        except ValueError:
            raise ParameterError(f"--harmonic {text}: give frequency and amplitude, for instance 217:30") from None
        lines.append((freq, amplitude))
    freqs, amplitudes = zip(*lines, strict=True)
    said = "harmonics at " + ", ".join(f"{f:g} Hz" for f in freqs)
    if not steady:
        return _Force(harmonic_force(fs, duration, freqs, amplitudes), fs, said)
    base = min(freqs)
    if base <= 0.0 or any(abs(f / base - round(f / base)) > 1e-9 for f in freqs):
        raise ParameterError("--harmonic with --steady: the frequencies must be multiples of the lowest")
    even = base * ceil(fs / base)
    return _Force(harmonic_force(even, 1.0 / base, freqs, amplitudes), even, said)


def _recorded(file: Path, model: Machine | Structure) -> _Force:
    """The force of a record's first blow; other channels do not matter."""
    import numpy as np

    from cutvib_ss.errors import DataFormatError
    from cutvib_ss.measurement.layout import layout_of
    from cutvib_ss.measurement.reading import read_file
    from cutvib_ss.units import to_si

    histories = read_file(file, False, layout_of(model)).histories
    signal = next((s for h in histories[:1] for s in h.signals if s.name == "force"), None)
    if signal is None:
        raise DataFormatError(f"{file}: has no channel `force`; name it so")
    factor = 1.0 if signal.unit is None else to_si(signal.unit, model.input_quantity, f"{file}: force")
    values = factor * np.asarray(signal.values, dtype=float)
    if not np.isfinite(values).all():
        raise DataFormatError(f"{file}: force holds a value that is not finite; correct the record")
    return _Force(values, histories[0].fs, file.name)


def _figures(found: TimeResponse, given: _Force, steady: bool) -> dict[str, Any]:
    import numpy as np

    freq, amplitude = found.spectrum()
    strongest = [np.argsort(-row[1:])[:5] + 1 for row in amplitude]
    in_g = found.in_g()
    is_g = [u == "g" for u in in_g.units]
    return {
        "schema": "cutvib-simulate/1",
        "force": given.said,
        "position": found.position,
        "fs_hz": found.fs,
        "duration_s": found.force.size / found.fs,
        "steady": steady,
        "outputs": list(found.outputs),
        "units": list(found.units),
        "rms": found.rms(),
        "peak": found.peak(),
        "rms_g": [float(v) if g else None for v, g in zip(in_g.rms(), is_g, strict=True)],
        "peak_g": [float(v) if g else None for v, g in zip(in_g.peak(), is_g, strict=True)],
        "lines": [
            [{"freq_hz": freq[k], "amplitude": row[k]} for k in sorted(own)]
            for row, own in zip(amplitude, strongest, strict=True)
        ],
    }


def _show(found: TimeResponse, given: _Force, steady: bool) -> None:
    freq, amplitude = found.in_g().spectrum()
    shown = found.in_g()
    rows = []
    for name, unit, rms, peak, row in zip(
        shown.outputs, shown.units, shown.rms(), shown.peak(), amplitude, strict=True
    ):
        k = int(row[1:].argmax()) + 1
        rows.append([name, f"{rms:.4g}", f"{peak:.4g}", unit, f"{freq[k]:.1f}", f"{row[k]:.4g}"])
    kind = "one period of the steady state" if steady else f"{found.force.size / found.fs:g} s from rest"
    title = f"Response to {given.said}, {kind}"
    show(results(), title, ["output", "RMS", "peak", "unit", "strongest line [Hz]", "amplitude"], rows, "lrrlrr")
