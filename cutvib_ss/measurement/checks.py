"""What goes wrong in a measurement: double hits, overloads, dead and loose channels; signs and units have modules of their own."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import signal

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.blow_noise import gains_of_blows
from cutvib_ss.measurement.estimation import measured_response
from cutvib_ss.measurement.interference import interference
from cutvib_ss.measurement.plausibility import unit_hints, without_drift
from cutvib_ss.measurement.records import FORCE, History, MachineLike, Record
from cutvib_ss.measurement.signs import turned_signs
from cutvib_ss.results import FloatArray

DOUBLE_HIT = 0.1
"""A second peak of the force above this fraction of the first is a second hit."""

LOOSE = 0.05
"""Standard deviation of a channel's gain from blow to blow from which its cable is looked at; no sensor is so far off."""
LOOSE_OTHERS = 0.2
"""Part of that which the other channels may show, and of what differs that may be no gain: a structure changes its form, too."""

_COMMENTED = re.compile(r"#\s*\w+ =")
_OVERLOAD_RUN = 3  # consecutive samples at the extreme value
_FEWEST_STEPS = 100  # of the digitiser, within the extreme: fewer, and equal samples are no sign of clipping


class EmptyRecordError(DataFormatError):
    """A record holds nothing: all of its responses are constant."""


def check_record(record: Record, machine: MachineLike, where: str) -> tuple[Record, tuple[str, ...]]:
    """
    A record without what cannot be used, and a warning for everything that was noticed.

    A double hit is kept: the force's spectrum is as it was measured, and H1 holds for any force. An overloaded blow is
    dropped where another is left, since its histories are not what happened; a channel that is overloaded in all of them is
    left out where there are others.
    """
    warnings: list[str] = []
    if record.kind != "frf":
        record = _drop_dead_channels(_drop_dead_forces(record, where, warnings), where, warnings)
    else:
        record = _drop_dead_responses(record, where, warnings)
    if record.kind == "impact":
        record = _drop_overloads(record, where, warnings)
        record = _drop_loose_channels(record, where, warnings)
        for history in record.histories:
            second = second_hit(history.force)
            if second is not None:
                warnings.append(
                    f"{where}: {history.name}: double hit, a second peak of {100 * second[1]:.0f} % of the first "
                    f"{1e3 * second[0] / history.fs:.1f} ms after it; kept, since H1 holds for it"
                )
    elif record.kind == "timeseries":
        for history in record.histories:
            for name in _overloaded(history):
                warnings.append(
                    f"{where}: {history.name}: {name} is overloaded (clipped); lower the gain and record again"
                )
    record, drifts = without_drift(record, where)
    frf = measured_response(record)
    tones = None if record.excitation == "sine" else interference([frf])
    if tones is not None:
        frf = frf.at_lines(~tones.spoils(frf.freq))
    warnings += [*drifts, *turned_signs(record, machine, where, frf), *unit_hints(record, machine, where, frf)]
    return record, tuple(warnings)


def second_hit(force: FloatArray, fraction: float = DOUBLE_HIT) -> tuple[int, float] | None:
    """
    The largest second hit within a blow.

    >>> import numpy as np
    >>> hit = np.hanning(20)
    >>> second_hit(np.concatenate([np.zeros(50), hit, np.zeros(30), 0.5 * hit, np.zeros(50)]))
    (50, 0.5)
    """
    centred = force - np.median(force)
    largest = int(np.argmax(np.abs(centred)))
    upright = centred * np.sign(centred[largest])
    peak = float(upright[largest])
    noise = 1.48 * float(np.median(np.abs(centred)))  # a force is noise but for its hits
    height = max(fraction * peak, 8 * noise)
    # between two hits the hammer lifts off: the force falls by most of the smaller one
    peaks, properties = signal.find_peaks(upright, height=height, prominence=0.8 * height)
    others = [
        (int(p - largest), float(upright[p] / peak))
        for p, prominence in zip(peaks, properties["prominences"], strict=True)
        if p != largest and prominence > 0.7 * upright[p]
    ]
    return max(others, key=lambda other: other[1], default=None)


def overloaded(values: FloatArray) -> bool:
    """
    Whether a signal is clipped: several consecutive samples at its extreme value.

    >>> import numpy as np
    >>> sine = np.sin(np.linspace(0, 20, 2000))
    >>> overloaded(sine), overloaded(np.clip(sine, -0.9, 0.9))
    (False, True)
    """
    for side in (values, -values):
        extreme = float(np.max(side))
        if extreme <= 0 or extreme < 0.5 * float(np.max(np.abs(values))):
            continue
        at = side >= extreme - 1e-9 * extreme
        run = np.convolve(at, np.ones(_OVERLOAD_RUN, dtype=int), mode="valid")
        if np.max(run) < _OVERLOAD_RUN:
            continue
        levels = np.unique(side[side > 0])
        if levels.size > 1 and extreme / float(np.min(np.diff(levels))) > _FEWEST_STEPS:
            return True
    return False


def _drop_dead_forces(record: Record, where: str, warnings: list[str]) -> Record:
    alive = [history for history in record.histories if np.ptp(history.force) > 0]
    if not alive:
        raise DataFormatError(f"{where}: the {FORCE} is constant (zero); check its sensor, cable and channel")
    for history in record.histories:
        if not any(history is other for other in alive):
            warnings.append(f"{where}: {history.name} dropped: its {FORCE} is constant (zero)")
    return _with(record, tuple(alive))


def _drop_dead_channels(record: Record, where: str, warnings: list[str]) -> Record:
    dead = [
        name
        for k, name in enumerate(record.channels)
        if any(np.ptp(history.responses[k]) == 0 for history in record.histories)
    ]
    return _without(record, dead, where, warnings, "constant")


def _drop_dead_responses(record: Record, where: str, warnings: list[str]) -> Record:
    assert record.frf is not None
    flat = [name for k, name in enumerate(record.channels) if not np.any(record.frf.data[0, k])]
    return _without(record, flat, where, warnings, "zero throughout")


def _without(record: Record, dead: list[str], where: str, warnings: list[str], why: str) -> Record:
    if not dead:
        return record
    if len(dead) == len(record.channels):
        raise EmptyRecordError(f"{where}: every response channel is {why}; check sensors, cables, channels and ranges")
    warnings += [f"{where}: {name} is {why} (dead channel): left out" for name in dead]
    return _left(record, dead)


def _left(record: Record, out: list[str]) -> Record:
    keep = [k for k, name in enumerate(record.channels) if name not in out]
    channels = tuple(record.channels[k] for k in keep)
    return replace(
        record,
        channels=channels,
        quantities=tuple(record.quantities[k] for k in keep),
        histories=tuple(replace(h, responses=h.responses[keep], channels=channels) for h in record.histories),
        frf=None if record.frf is None else record.frf.sel(output=channels),
    )


def _drop_loose_channels(record: Record, where: str, warnings: list[str]) -> Record:
    """The record without channels whose gain differs from blow to blow while the others' does not."""
    # A cable or connector changes a channel's gain; a structure that is not linear, a hand that hits elsewhere, or noise change the
    # form of its response.
    if len(record.histories) < 2 or len(record.channels) < 2:
        return record
    spread, form = gains_of_blows(record)
    loose = [
        k
        for k, s in enumerate(spread)
        if s > LOOSE and form[k] < LOOSE_OTHERS and np.delete(spread, k).max() < LOOSE_OTHERS * s
    ]
    for k in loose:
        warnings.append(
            f"{where}: {record.channels[k]}: its gain differs by {100 * spread[k]:.0f} % from blow to blow, that of the others "
            "does not: left out; look for a loose cable or connector, and measure again"
        )
    return _left(record, [record.channels[k] for k in loose]) if loose else record


def _drop_overloads(record: Record, where: str, warnings: list[str]) -> Record:
    record = _drop_overloaded_channels(record, where, warnings)
    found = {id(history): _overloaded(history) for history in record.histories}
    good = tuple(history for history in record.histories if not found[id(history)])
    for history in record.histories:
        if found[id(history)]:
            names = ", ".join(found[id(history)])
            fate = "dropped" if good else "kept for want of another; record again"
            warnings.append(f"{where}: {history.name}: {names} overloaded (clipped): {fate}")
    return _with(record, good or record.histories)


def _drop_overloaded_channels(record: Record, where: str, warnings: list[str]) -> Record:
    """Without the channels that no blow shows as they were, where others do."""
    always = set.intersection(*(set(_overloaded(h)) for h in record.histories)) - {FORCE}
    if not always or always == set(record.channels):
        return record
    names = [name for name in record.channels if name in always]
    warnings.append(
        f"{where}: {', '.join(names)} overloaded (clipped) in every blow: left out; lower the gain and record again"
    )
    return _left(record, names)


def _with(record: Record, histories: tuple[History, ...]) -> Record:
    averages = len(histories) if record.kind == "impact" else record.averages
    return replace(record, histories=histories, averages=averages)


def _overloaded(history: History) -> list[str]:
    columns = [(FORCE, history.force), *zip(history.channels, history.responses, strict=True)]
    return [name for name, values in columns if overloaded(values)]


def guesses_left(file: Path, what: str) -> list[str]:
    """A warning where lines of a file are still marked TODO, as `campaign init` leaves them: their values are guesses."""
    lines = file.read_text(encoding="utf-8").splitlines()
    # A key that is commented out states nothing.
    found = [(n, line) for n, line in enumerate(lines, start=1) if "# TODO" in line and not _COMMENTED.match(line)]
    if not found:
        return []
    keys = dict.fromkeys(line.partition("=")[0].strip() for _, line in found if not line.startswith("#"))
    return [
        f"{file.name}, line {found[0][0]}: {', '.join(keys) or what}: marked TODO, so a guess; put in what is right and "
        "delete the mark"
    ]
