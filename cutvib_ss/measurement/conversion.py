"""From a file's named columns to checked histories and frequency responses in SI units."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import Contents, Layout, RawFrf, RawHistory, RawResponse, Signal
from cutvib_ss.measurement.mapping import left_out, mapping_line
from cutvib_ss.measurement.records import FORCE, History
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.units import SI_UNIT, to_si

FEWEST_SAMPLES = 16
"""A time record with fewer samples than this cannot hold a blow and what it excites."""

FEWEST_LINES = 4
"""Frequency responses with fewer lines than this carry no noise estimate."""

ABSURD = {"force": 1e8, "acceleration": 1e6, "velocity": 1e5, "displacement": 1e3}
"""Magnitudes (SI) beyond which a value is a wrong unit or a fault, not a measurement."""

_ELECTRICAL = ("V", "mV", "uV", "µV", "Volt", "Volts", "volt", "volts")

_PER = re.compile(r"^(?P<numerator>.+?)/(?P<denominator>N|newtons?|g|m/s\^?2|m/s²|m/s\*\*2|m/sec\^2)$", re.IGNORECASE)


def histories_of(contents: Contents, layout: Layout, where: str) -> tuple[History, ...]:
    """Time records of a file in SI units."""
    if not contents.histories:
        raise DataFormatError(f"{where}: holds no time record; record at least one blow")
    return tuple(_history(history, layout, where, left_out(contents.warnings)) for history in contents.histories)


def frf_of(contents: Contents, layout: Layout, where: str) -> RawFrf:
    """Frequency responses of a file in SI units."""
    frf = contents.frf
    if frf is None or not frf.responses:
        raise DataFormatError(f"{where}: holds no frequency response of a channel; export at least one")
    freq = frf.freq
    if freq.size < FEWEST_LINES:
        raise DataFormatError(f"{where}: {freq.size} frequency lines are too few; give at least {FEWEST_LINES}")
    _check_lines(freq, where)
    _check_names([r.name for r in frf.responses], layout, where)
    frf = _ascending(frf, where)
    ordered = sorted(frf.responses, key=lambda r: list(layout.quantities).index(r.name))
    amplitude = None if frf.force_amplitude is None else _amplitude(frf.force_amplitude, freq.size, layout, where)
    return RawFrf(frf.freq, tuple(_response(r, layout, where) for r in ordered), amplitude)


def motion_factor(frf: RawFrf, channel: str, layout: Layout, where: str) -> float:
    """SI value of one unit of a channel's motion, as the file (or ``[channels]``) names it."""
    unit = next((response.unit for response in frf.responses if response.name == channel), None)
    quantity = layout.quantities[channel]
    if unit is None:
        return 1.0
    numerator, _ = _split_unit(unit, f"{where}: channel {channel!r}", f"{SI_UNIT[quantity]}/N")
    return to_si(numerator, quantity, f"{where}: channel {channel!r}")


def _check_lines(freq: FloatArray, where: str) -> None:
    """Refuse lines without a frequency, below 0 Hz or given twice, by their numbers in the file."""
    wrong = np.flatnonzero(~np.isfinite(freq) | (freq < 0))
    if wrong.size:
        raise DataFormatError(
            f"{where}: the frequency of line {wrong[0] + 1} is {freq[wrong[0]]:.9g}; frequencies must be finite, from 0 Hz up"
        )
    values, counts = np.unique(freq, return_counts=True)
    if np.any(counts > 1):
        twice = values[counts > 1][0]
        first, second = np.flatnonzero(freq == twice)[:2] + 1
        raise DataFormatError(
            f"{where}: lines {first} and {second} are both of {twice:.9g} Hz; leave one out, or write more digits"
        )


def _ascending(frf: RawFrf, where: str) -> RawFrf:
    """Lines in ascending order: a sweep may have been listed from the top down, or at random."""
    freq = frf.freq
    if np.all(np.diff(freq) > 0):
        return frf
    for r in frf.responses:
        if r.values.size != freq.size:
            raise DataFormatError(
                f"{where}: {r.name!r} has {r.values.size} values for {freq.size} lines; give one a line"
            )
    order = np.argsort(freq)
    responses = tuple(
        replace(r, values=r.values[order], coherence=None if r.coherence is None else r.coherence[order])
        for r in frf.responses
    )
    amplitude = frf.force_amplitude
    if amplitude is not None and amplitude.values.size == freq.size:
        amplitude = replace(amplitude, values=amplitude.values[order])
    return RawFrf(freq[order], responses, amplitude)


def to_contents(histories: Sequence[History], layout: Layout) -> Contents:
    """Histories as a writer takes them, in SI units."""
    raw = []
    names = [history.name for history in histories]
    for k, history in enumerate(histories):
        columns = [(FORCE, history.force), *zip(history.channels, history.responses, strict=True)]
        signals = tuple(Signal(name, SI_UNIT[layout.quantities[name]], values) for name, values in columns)
        name = history.name if history.name and names.count(history.name) == 1 else f"blow_{k + 1}"
        raw.append(RawHistory(name, history.fs, signals))
    return Contents(histories=tuple(raw))


def _history(raw: RawHistory, layout: Layout, where: str, missing: str) -> History:
    where = f"{where}: {raw.name}" if raw.name not in ("", "1") else where
    names = [signal.name for signal in raw.signals]
    _check_names(names, layout, where)
    if FORCE not in names:
        raise DataFormatError(
            f"{where}: no channel {FORCE!r} among {', '.join(names)}{missing}; record the force with the responses, or say under "
            f"[channels] which it is: {mapping_line(FORCE, names, others=[*layout.quantities])}"
        )
    if len(names) == 1:
        raise DataFormatError(f"{where}: no response channel{missing}; record at least one of {_responses(layout)}")
    lengths = {signal.name: signal.values.size for signal in raw.signals}
    if len(set(lengths.values())) > 1:
        raise DataFormatError(f"{where}: channels have different lengths {lengths}; record them together")
    samples = lengths[FORCE]
    if samples < FEWEST_SAMPLES:
        raise DataFormatError(f"{where}: {samples} samples are too few; give at least {FEWEST_SAMPLES}")
    if not (np.isfinite(raw.fs) and raw.fs > 0):
        raise DataFormatError(f"{where}: sampling frequency {raw.fs} Hz; it must be positive")
    columns = {signal.name: _si(signal, layout.quantities[signal.name], where) for signal in raw.signals}
    channels = tuple(name for name in layout.quantities if name in columns and name != FORCE)
    responses = np.stack([columns[name] for name in channels])
    return History(raw.fs, columns[FORCE], responses, channels, raw.name)


def _si(signal: Signal, quantity: str, where: str) -> FloatArray:
    where = f"{where}: channel {signal.name!r}"
    if signal.unit is None:
        raise DataFormatError(f"{where} names no unit; say which, for instance {SI_UNIT[quantity]}")
    if signal.unit.strip() in _ELECTRICAL:
        raise DataFormatError(
            f"{where}: unit {signal.unit!r} is not read, since it needs the sensor's sensitivity; state it under [channels]: "
            f'{signal.name} = {{ unit = "{SI_UNIT[quantity]}", gain = … }} with the gain in {SI_UNIT[quantity]} per '
            f"{signal.unit.strip()}"
        )
    values = signal.values * to_si(signal.unit, quantity, where)
    _check_finite(values, where, "sample")
    worst = float(np.max(np.abs(values)))
    if worst > ABSURD[quantity]:
        raise DataFormatError(
            f"{where}: {worst:.3g} {SI_UNIT[quantity]} is no measurement (limit {ABSURD[quantity]:g}); "
            "check scale and unit"
        )
    return values


def _amplitude(raw: Signal, lines: int, layout: Layout, where: str) -> Signal:
    """Amplitude of the force line by line, in SI units: positive throughout."""
    if raw.values.size != lines:
        raise DataFormatError(f"{where}: {raw.name!r} has {raw.values.size} values for {lines} lines; give one a line")
    values = _si(raw, layout.quantities[FORCE], where)
    if not np.all(values > 0):
        line = int(np.argmin(values > 0))
        raise DataFormatError(
            f"{where}: {raw.name!r} is {raw.values[line]:g} at line {line + 1}; an amplitude is positive: remove that line"
        )
    return Signal(raw.name, SI_UNIT[layout.quantities[FORCE]], values)


def _response(raw: RawResponse, layout: Layout, where: str) -> RawResponse:
    where = f"{where}: channel {raw.name!r}"
    quantity, driven_by = layout.quantities[raw.name], layout.quantities[FORCE]
    unit = f"{SI_UNIT[quantity]}/{SI_UNIT[driven_by]}"
    if raw.unit is None:
        raise DataFormatError(f"{where} names no unit; say which, for instance {unit}")
    numerator, denominator = _split_unit(raw.unit, where, unit)
    factor = to_si(numerator, quantity, where) / to_si(denominator, driven_by, f"{where}: input of {raw.unit!r}")
    values: ComplexArray = raw.values * factor
    _check_finite(values, where, "line")
    coherence = raw.coherence
    if coherence is not None and not np.any(values):
        # Of a channel that never moved it is 0/0; `checks` leaves such a channel out.
        coherence = np.zeros(values.shape)
    if coherence is not None:
        _check_finite(coherence, f"{where}: coherence", "line")
        low, high = float(np.min(coherence)), float(np.max(coherence))
        if low < -1e-6 or high > 1 + 1e-6:
            raise DataFormatError(
                f"{where}: coherence runs from {low:.4g} to {high:.4g}; it lies within 0 to 1 (not percent)"
            )
        coherence = np.clip(coherence, 0.0, 1.0)
    return RawResponse(raw.name, unit, values, coherence)


def _split_unit(unit: str, where: str, expected: str) -> tuple[str, str]:
    """Numerator and denominator: the last slash parts them, but for the slashes within m/s and m/s^2."""
    match = _PER.match(unit.strip().replace("(", "").replace(")", ""))
    if match is None:
        raise DataFormatError(f"{where}: unit {unit!r} is not response per input; give it as {expected}")
    return match["numerator"], match["denominator"]


def _check_names(names: Sequence[str], layout: Layout, where: str) -> None:
    for name in names:
        if name not in layout.quantities:
            raise DataFormatError(
                f"{where}: channel {name!r} is not known; the model has {FORCE} and {_responses(layout)}; the file has "
                f"{', '.join(names)}; say under [channels] which is which, for instance: {_first_line(names, layout)}"
            )
        if list(names).count(name) > 1:
            raise DataFormatError(f"{where}: channel {name!r} comes {list(names).count(name)} times; keep one")


def _first_line(names: Sequence[str], layout: Layout) -> str:
    """The line that would map the first channel that is missing to the likeliest column that is none of the model's."""
    missing = next((channel for channel in layout.quantities if channel not in names), FORCE)
    return mapping_line(missing, [name for name in names if name not in layout.quantities])


def _responses(layout: Layout) -> str:
    return ", ".join(name for name in layout.quantities if name != FORCE)


def _check_finite(values: FloatArray | ComplexArray, where: str, what: str) -> None:
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size:
        raise DataFormatError(
            f"{where}: NaN or Inf at {what} {bad[0] + 1} ({bad.size} of {values.size}); "
            "remove the record or record again"
        )
