"""From what a file calls its channels to the model's names: the ``[channels]`` and ``[dofs]`` tables applied."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.dofs import ColumnT, by_node, check_one_each, driven, parse_dof
from cutvib_ss.measurement.formats.names import FORCE_NAME
from cutvib_ss.measurement.formats.raw import Contents, Layout, RawFrf, RawHistory, RawResponse, Signal
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.measurement.schema import ChannelTable
from cutvib_ss.results import FloatArray
from cutvib_ss.units import SI_UNIT

_AS_IS = ChannelTable()
_PLAIN = re.compile(r"[^a-z0-9]+")


def assign(contents: Contents, layout: Layout, channels: Mapping[str, ChannelTable], where: str) -> Contents:
    """Contents under the model's channel names; gain, sign, phase and unit as ``[channels]`` states them."""
    for name in channels:
        if name not in layout.quantities:
            raise DataFormatError(
                f"{where}: [channels] names {name!r}, which the model does not have; "
                f"it has {', '.join(layout.quantities)}"
            )
    warnings = list(contents.warnings)
    histories = tuple(
        _history(h, layout, channels, where, warnings, contents.si) for h in _grouped(contents.histories, channels)
    )
    check_one_each(histories, where)
    frf = None if contents.frf is None else _frf(contents.frf, layout, channels, where, warnings, contents.si)
    return Contents(histories, frf, tuple(dict.fromkeys(warnings)))


def mapping_line(channel: str, there: Sequence[str], wanted: str = "", others: Sequence[str] = ()) -> str:
    """
    The ``[channels]`` line that would map a channel, with the likeliest of the names that are there.

    That is the one closest to the name ``wanted``, where one is given, or to the channel's; a force goes by other names, too.
    Names of ``others``, the model's channels, are passed over.
    """
    free = [name for name in there if name not in others or name == channel]
    named = [name for name in free if FORCE_NAME.search(name)] if channel == FORCE else []
    by_fold = {name.casefold(): name for name in named or free}
    likely = difflib.get_close_matches((wanted or channel).casefold(), by_fold, n=1, cutoff=0.0)
    return f'{channel} = {{ name = "{by_fold[likely[0]] if likely else "…"}" }}'


def listed(there: Sequence[str]) -> str:
    """Names with their numbers from 1."""
    return ", ".join(f"{k}: {name!r}" for k, name in enumerate(there, start=1))


def left_out(warnings: Sequence[str]) -> str:
    """In parentheses, what the reader of the file left out, which may be what is missed."""
    notes = [warning.partition(": ")[2] for warning in warnings if warning.endswith("left out")]
    return f" ({'; '.join(notes)})" if notes else ""


def turned(values: FloatArray, phase: float) -> FloatArray:
    """A signal whose spectrum is turned by a constant phase at every line but zero (and the last of an even count)."""
    spectrum = np.fft.rfft(values)
    last = -1 if values.size % 2 == 0 else spectrum.size
    spectrum[1:last] *= np.exp(1j * phase)
    return np.asarray(np.fft.irfft(spectrum, values.size), dtype=np.float64)


def _grouped(histories: Sequence[RawHistory], channels: Mapping[str, ChannelTable]) -> Sequence[RawHistory]:
    """Groups put together to one record where ``[channels]`` names channels of several groups as group/name."""
    groups = [h.name for h in histories]
    wanted = {
        group
        for spec in channels.values()
        for group in groups
        if isinstance(spec.name, str) and group and spec.name.startswith(f"{group}/")
    }
    if not wanted:
        return histories
    if len(wanted) == 1:  # one group among others: it is the record, under its channels' own names as well
        return [h for h in histories if h.name in wanted]
    used = [h for h in histories if h.name in wanted]
    fs = used[0].fs
    signals = tuple(
        replace(s, group=h.name, fs=s.fs or (None if h.fs == fs else h.fs)) for h in used for s in h.signals
    )
    return [RawHistory("", fs, signals)]


def _history(
    raw: RawHistory,
    layout: Layout,
    channels: Mapping[str, ChannelTable],
    where: str,
    warnings: list[str],
    si: bool,
) -> RawHistory:
    where = f"{where}: {raw.name}" if raw.name not in ("", "1") and channels else where
    signals, rates = [], {}
    for channel, signal in _chosen(raw.signals, layout, channels, where, warnings, raw.name):
        spec = channels.get(channel, _AS_IS)
        values = signal.values * ((spec.sign or 1) * (spec.gain or 1.0))
        if spec.phase_deg and np.all(np.isfinite(values)):
            values = turned(values, np.radians(spec.phase_deg))
        unit = spec.unit or signal.unit
        if unit is None and si and channel in layout.quantities:
            unit = SI_UNIT[layout.quantities[channel]]
        signals.append(Signal(channel, unit, values))
        rates[channel] = signal.fs or raw.fs
    if any(abs(rate / raw.fs - 1) > 1e-9 for rate in rates.values() if raw.fs > 0):
        first = next(iter(rates.values()))
        if any(abs(rate / first - 1) > 1e-9 for rate in rates.values()):
            raise DataFormatError(
                f"{where}: channels have different sampling frequencies {rates} (time steps); record them on one clock"
            )
        return replace(raw, fs=first, signals=tuple(signals))
    return replace(raw, signals=tuple(signals))


def _frf(
    raw: RawFrf, layout: Layout, channels: Mapping[str, ChannelTable], where: str, warnings: list[str], si: bool
) -> RawFrf:
    """A response over a force: the force's gain, sign and phase divide."""
    force = channels.get(FORCE, _AS_IS)
    columns = driven(raw.responses, layout, channels, where, warnings)
    responses = []
    axis = None
    for channel, response in _chosen(columns, layout, channels, where, warnings, ""):
        spec = channels.get(channel, _AS_IS)
        unit = _ratio_unit(response.unit, spec.unit, force.unit, SI_UNIT[layout.quantities[FORCE]])
        if unit is None and si and channel in layout.quantities:
            unit = f"{SI_UNIT[layout.quantities[channel]]}/{SI_UNIT[layout.quantities[FORCE]]}"
        own = raw.freq if response.freq is None else response.freq
        if axis is None:
            axis = own
        elif own.shape != axis.shape or not np.allclose(own, axis, rtol=1e-6):
            raise DataFormatError(f"{where}: its FRFs have different frequency axes; export all channels with one")
        responses.append(
            RawResponse(channel, unit, response.values * (_factor(spec) / _factor(force)), response.coherence)
        )
    amplitude = raw.force_amplitude
    if amplitude is not None:
        unit = force.unit or amplitude.unit or (SI_UNIT[layout.quantities[FORCE]] if si else None)
        amplitude = replace(amplitude, values=amplitude.values * (force.gain or 1.0), unit=unit)
    return RawFrf(raw.freq if axis is None else axis, tuple(responses), amplitude)


def _factor(spec: ChannelTable) -> complex:
    return complex((spec.sign or 1) * (spec.gain or 1.0) * np.exp(1j * np.radians(spec.phase_deg or 0.0)))


def _ratio_unit(stated: str | None, response: str | None, force: str | None, default: str) -> str | None:
    """Unit of a response per force, either part overridden; a unit without a denominator is the response's."""
    if response is not None and "/" in response.replace("m/s", ""):
        return response
    if response is None and force is None:
        return stated
    numerator, denominator = stated, None
    if stated is not None and "/" in stated.replace("m/s", "").strip("/"):
        numerator, _, denominator = stated.rpartition("/")
        if stated.replace("(", "").replace(")", "").endswith("m/s^2"):  # per base acceleration
            numerator, denominator = stated[: stated.rindex("m/s^2")].rstrip("/("), "m/s^2"
    if response is None and numerator is None:
        return stated
    return f"{response or numerator}/{force or denominator or default}"


def _chosen(
    columns: Sequence[ColumnT],
    layout: Layout,
    channels: Mapping[str, ChannelTable],
    where: str,
    warnings: list[str],
    group: str,
) -> list[tuple[str, ColumnT]]:
    """Columns that carry a channel of the model, in the model's order; the others are named in a warning."""
    numbered = any(column.dof is not None for column in columns)
    if not numbered and not channels:
        return [(_spelt(column.name, [c.name for c in columns], layout), column) for column in columns]
    groups = [column.group if isinstance(column, Signal) else "" for column in columns]
    there = [f"{g}/{column.name}" if g else column.name for g, column in zip(groups, columns, strict=True)]
    responses_only = bool(columns) and isinstance(columns[0], RawResponse)
    chosen: list[tuple[str, ColumnT]] = []
    taken: dict[int, str] = {}
    named = any(spec.name is not None for name, spec in channels.items() if name != FORCE)
    nodes = by_node(columns, layout, where, required=not named) if numbered else {}
    for channel in layout.quantities:
        spec = channels.get(channel, _AS_IS)
        if channel == FORCE and responses_only:
            continue
        if spec.name is None:
            index = nodes.get(channel) if numbered else _index(channel, there, columns, channel, group)
        else:
            index = _index(spec.name, there, columns, channel, group)
            if index is None:
                others = {c: s.name for c, s in channels.items() if c != channel and s.name is not None}
                mapped = {_index(name, there, columns, c, group) for c, name in others.items()}
                free = [name for k, name in enumerate(there) if k not in mapped]
                line = mapping_line(
                    channel, free, spec.name if isinstance(spec.name, str) else "", [*layout.quantities]
                )
                raise DataFormatError(
                    f"{where}: channel {channel!r} is {spec.name!r} under [channels], but the file has "
                    f"{listed(there)}{left_out(warnings)}; correct that line, for instance: {line}"
                )
        if index is None:
            continue
        if index in taken:
            if spec.name is None:  # found by its node, and mapped to another channel by name
                continue
            raise DataFormatError(
                f"{where}: {there[index]!r} is mapped to both {taken[index]} and {channel}; give each its own column"
            )
        taken[index] = channel
        chosen.append((channel, columns[index]))
    left = [column for k, column in enumerate(columns) if k not in taken]
    if left and numbered:
        dofs = sorted({column.dof for column in left if column.dof is not None})
        what = "functions" if responses_only else "time records"
        warnings.append(f"{where}: {what} at (node, direction) {dofs} belong to no channel and are left out")
    elif left:
        warnings.append(f"{where}: not used, since [channels] maps no channel to it: {', '.join(c.name for c in left)}")
    return chosen


def _spelt(name: str, there: Sequence[str], layout: Layout) -> str:
    """The model's spelling of a column that differs from a channel by case, blanks or signs alone."""
    plain = _PLAIN.sub("", name.casefold())
    alike = [channel for channel in layout.quantities if _PLAIN.sub("", channel.casefold()) == plain]
    return alike[0] if len(alike) == 1 and alike[0] not in there else name


def _index(wanted: str | int, there: Sequence[str], columns: Sequence[ColumnT], channel: str, group: str) -> int | None:
    """Place of a column: by number, by its full name, by group/name, by node and direction, at last by letters alone."""
    if isinstance(wanted, int):
        return wanted - 1 if wanted <= len(there) else None
    if wanted in there:
        return there.index(wanted)
    if group and wanted.startswith(f"{group}/") and wanted.removeprefix(f"{group}/") in there:
        return there.index(wanted.removeprefix(f"{group}/"))
    dof = parse_dof(wanted)
    if dof is not None:
        at = [
            k
            for k, c in enumerate(columns)
            if c.dof is not None and (c.dof[0], abs(c.dof[1])) == dof and (c.quantity == "force") == (channel == FORCE)
        ]
        if at:
            return at[0]
    alike = [k for k, name in enumerate(there) if _PLAIN.sub("", name.casefold()) == _PLAIN.sub("", wanted.casefold())]
    return alike[0] if len(alike) == 1 and _PLAIN.sub("", wanted.casefold()) else None
