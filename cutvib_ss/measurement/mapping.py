"""From what a file calls its channels to the model's names: the ``[channels]`` table applied."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import Contents, Layout, RawFrf, RawHistory, RawResponse, Signal
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.measurement.schema import ChannelTable
from cutvib_ss.results import FloatArray

_Column = TypeVar("_Column", Signal, RawResponse)
_AS_IS = ChannelTable()


def assign(contents: Contents, layout: Layout, channels: Mapping[str, ChannelTable], where: str) -> Contents:
    """Contents under the model's channel names; gain, sign, phase and unit as ``[channels]`` states them."""
    for name in channels:
        if name not in layout.quantities:
            raise DataFormatError(
                f"{where}: [channels] names {name!r}, which the model does not have; it has {', '.join(layout.quantities)}"
            )
    if not channels:
        return contents
    warnings = list(contents.warnings)
    histories = tuple(_history(h, layout, channels, where, warnings) for h in contents.histories)
    frf = None if contents.frf is None else _frf(contents.frf, layout, channels, where, warnings)
    return Contents(histories, frf, tuple(dict.fromkeys(warnings)))


def mapping_line(channel: str, there: Sequence[str]) -> str:
    """The ``[channels]`` line that would map a channel, with the likeliest of the names that are there."""
    likely = difflib.get_close_matches(channel, there, n=1, cutoff=0.0)
    return f'{channel} = {{ name = "{likely[0] if likely else "…"}" }}'


def _history(
    raw: RawHistory, layout: Layout, channels: Mapping[str, ChannelTable], where: str, warnings: list[str]
) -> RawHistory:
    signals = []
    for channel, signal in _chosen(raw.signals, layout, channels, where, warnings):
        spec = channels.get(channel, _AS_IS)
        values = signal.values * (spec.sign or 1) * (spec.gain or 1.0)
        if spec.phase_deg:
            values = turned(values, np.radians(spec.phase_deg))
        signals.append(Signal(channel, spec.unit or signal.unit, values))
    return replace(raw, signals=tuple(signals))


def _frf(raw: RawFrf, layout: Layout, channels: Mapping[str, ChannelTable], where: str, warnings: list[str]) -> RawFrf:
    """A response over a force: the force's gain, sign and phase divide."""
    force = channels.get(FORCE, _AS_IS)
    responses = []
    for channel, response in _chosen(raw.responses, layout, channels, where, warnings):
        if channel == FORCE:
            continue
        spec = channels.get(channel, _AS_IS)
        factor = _factor(spec) / _factor(force)
        values = response.values * factor
        unit = _ratio_unit(response.unit, spec.unit, force.unit)
        responses.append(RawResponse(channel, unit, values, response.coherence))
    amplitude = raw.force_amplitude
    if amplitude is not None and force.gain is not None:
        amplitude = replace(amplitude, values=amplitude.values * force.gain)
    if amplitude is not None and force.unit is not None:
        amplitude = replace(amplitude, unit=force.unit)
    return replace(raw, responses=tuple(responses), force_amplitude=amplitude)


def _factor(spec: ChannelTable) -> complex:
    return complex((spec.sign or 1) * (spec.gain or 1.0) * np.exp(1j * np.radians(spec.phase_deg or 0.0)))


def _ratio_unit(stated: str | None, response: str | None, force: str | None) -> str | None:
    """Unit of a response per force, either part overridden."""
    if response is not None and "/" in response.replace("m/s", ""):
        return response
    if response is None and force is None:
        return stated
    numerator, _, denominator = (stated or "").rpartition("/")
    return f"{response or numerator}/{force or denominator or 'N'}"


def turned(values: FloatArray, phase: float) -> FloatArray:
    """A signal whose spectrum is turned by a constant phase at every line but the first (and the last of an even count)."""
    spectrum = np.fft.rfft(values)
    last = -1 if values.size % 2 == 0 else spectrum.size
    spectrum[1:last] *= np.exp(1j * phase)
    return np.asarray(np.fft.irfft(spectrum, values.size), dtype=np.float64)


def _chosen(
    columns: Sequence[_Column], layout: Layout, channels: Mapping[str, ChannelTable], where: str, warnings: list[str]
) -> list[tuple[str, _Column]]:
    """Columns that carry a channel of the model, in the model's order; the others are named in a warning."""
    there = [column.name for column in columns]
    chosen: list[tuple[str, _Column]] = []
    taken: dict[int, str] = {}
    for channel in layout.quantities:
        spec = channels.get(channel, _AS_IS)
        wanted = channel if spec.name is None else spec.name
        index = _index(wanted, there)
        if index is None:
            # a channel under [channels] that only changes unit or gain may be absent, one with a name may not
            if spec.name is not None and not (channel == FORCE and isinstance(columns[0], RawResponse)):
                raise DataFormatError(
                    f"{where}: channel {channel!r} is to be {wanted!r} by [channels], but the file has "
                    f"{_listed(there)}; correct the line, for instance: {mapping_line(channel, there)}"
                )
            continue
        if index in taken:
            raise DataFormatError(
                f"{where}: {there[index]!r} is mapped to both {taken[index]} and {channel}; give each its own column"
            )
        taken[index] = channel
        chosen.append((channel, columns[index]))
    left = [name for k, name in enumerate(there) if k not in taken]
    if left:
        warnings.append(f"{where}: not used, since [channels] maps no channel to it: {', '.join(left)}")
    return chosen


def _index(wanted: str | int, there: Sequence[str]) -> int | None:
    if isinstance(wanted, int):
        return wanted - 1 if wanted <= len(there) else None
    if wanted in there:
        return there.index(wanted)
    alike = [k for k, name in enumerate(there) if name.strip().casefold() == wanted.strip().casefold()]
    return alike[0] if len(alike) == 1 else None


def _listed(there: Sequence[str]) -> str:
    return ", ".join(f"{k}: {name!r}" for k, name in enumerate(there, start=1))
