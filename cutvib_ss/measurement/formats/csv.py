"""CSV and other text tables: time records (``time [s],force [N],…``, blows by a ``blow`` column) and frequency responses."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.names import (
    BLOW_NAMES,
    FREQ_NAMES,
    TIME_NAMES,
    is_named,
    scale_of,
    split_heading,
)
from cutvib_ss.measurement.formats.raw import (
    SEVERAL_POSITIONS,
    Contents,
    Layout,
    RawFrf,
    RawHistory,
    RawResponse,
    Signal,
    TextOptions,
    even_sampling,
)
from cutvib_ss.measurement.formats.table import TextTable, read_table
from cutvib_ss.results import FloatArray

_EXPECTED = {
    True: "`freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N],tool_x coherence,…`",
    False: "`time [s],force [N],tool_x [m/s^2],…`",
}
_RATE = re.compile(
    r"(?:sampl\w*|abtast\w*|acquisition)[\s_-]*(?:rate|freq\w*|frequenz)?[^0-9]*?([0-9]+(?:[.,][0-9]+)?(?:[eE][+-]?\d+)?)\s*(k?hz)?",
    re.IGNORECASE,
)
_STEP = re.compile(
    r"(?:delta[_ ]?[xt]|dt|time step|increment)[^0-9]*([0-9]*[.,]?[0-9]+(?:[eE][+-]?\d+)?)", re.IGNORECASE
)
_PARTS = {
    "re": re.compile(r"^(?:(?P<a>.+?)[\s_]+(?:re|real)|(?:re|real)\s*\((?P<b>.+)\))$", re.IGNORECASE),
    "im": re.compile(r"^(?:(?P<a>.+?)[\s_]+(?:im|imag|imaginary)|(?:im|imag)\s*\((?P<b>.+)\))$", re.IGNORECASE),
    "mag": re.compile(
        r"^(?:(?P<a>.+?)[\s_]+(?:mag|magnitude|abs|amplitude)|(?:mag|abs)\s*\((?P<b>.+)\))$", re.IGNORECASE
    ),
    "phase": re.compile(r"^(?:(?P<a>.+?)[\s_]+(?:phase|phi|ph)|(?:phase|phi|arg)\s*\((?P<b>.+)\))$", re.IGNORECASE),
    "coherence": re.compile(
        r"^(?:(?P<a>.+?)[\s_]+(?:coherence|coh)|(?:coherence|coh)\s*\((?P<b>.+)\))$", re.IGNORECASE
    ),
}


@dataclass(frozen=True)
class _Column:
    name: str
    unit: str | None
    values: FloatArray


def read(path: Path, frf: bool, options: TextOptions) -> Contents:
    """Contents of a text table: histories, one per blow, or frequency responses; columns by their own names."""
    table = read_table(path, options)
    columns = _columns(table)
    if frf:
        return Contents(frf=_frf(path, columns))
    return _histories(path, columns, table, options)


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """Write contents as CSV, 17 digits, so that they read back the same; a ``blow`` column where there are several."""
    if contents.frf is not None:
        header, blocks = ["freq [Hz]"], [_frf_columns(contents.frf)]
        if contents.frf.force_amplitude is not None:
            header.append(f"force amplitude [{contents.frf.force_amplitude.unit}]")
        for response in contents.frf.responses:
            header += [f"{response.name} re [{response.unit}]", f"{response.name} im [{response.unit}]"]
            header += [f"{response.name} coherence"] * (response.coherence is not None)
    else:
        several = len(contents.histories) > 1
        header = ["blow"] * several + ["time [s]"]
        header += [f"{signal.name} [{signal.unit}]" for signal in contents.histories[0].signals]
        blocks = [_history_columns(h, k + 1 if several else None) for k, h in enumerate(contents.histories)]
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(header)
        for block in blocks:
            np.savetxt(file, block, fmt="%.17g", delimiter=",")


def _columns(table: TextTable) -> list[_Column]:
    """Named columns; unnamed ones that are empty throughout are left out."""
    columns = []
    for k, (heading, below) in enumerate(zip(table.headings, table.units, strict=True)):
        name, unit = split_heading(heading)
        values = np.ascontiguousarray(table.values[:, k])
        if not name and np.all(np.isnan(values)):
            continue
        columns.append(_Column(name or str(k + 1), unit or below, values))
    return columns


def _axis(path: Path, columns: list[_Column], frf: bool, options: TextOptions) -> int | None:
    """Index of the time or frequency column."""
    names = FREQ_NAMES if frf else TIME_NAMES
    if not frf and options.time is not None:
        if isinstance(options.time, int):
            found = [options.time - 1] if options.time <= len(columns) else []
        else:
            found = [k for k, c in enumerate(columns) if c.name.casefold() == options.time.strip().casefold()]
        if not found:
            raise DataFormatError(
                f"{path}: no column {options.time!r} (csv.time); it has {', '.join(repr(c.name) for c in columns)}"
            )
        return found[0]
    found = [k for k, c in enumerate(columns) if is_named(c.name, names)]
    if not frf and not found and all(c.name.isdecimal() for c in columns):  # no headings at all
        found = [k for k, c in enumerate(columns) if c.values.size > 2 and np.all(np.diff(c.values) > 0)]
    return found[0] if found else None


def _histories(path: Path, columns: list[_Column], table: TextTable, options: TextOptions) -> Contents:
    at = _axis(path, columns, False, options)
    warnings = []
    stated = None
    if at is None:
        stated = _stated_rate(table.preamble)
        if stated is None:
            raise DataFormatError(
                f"{path}: no column `time [s]` among {', '.join(repr(c.name) for c in columns)}; a time record's first "
                f'line is {_EXPECTED[False]}; name the column as time = "…" under [csv]'
            )
        warnings.append(f"{path}: has no time column; its sampling frequency is read from its head: {stated:g} Hz")
    time = None if at is None else columns[at]
    scale = 1.0 if time is None else scale_of(time.unit)
    if time is not None and scale is None:
        raise DataFormatError(f"{path}: unit {time.unit!r} of {time.name!r} is no time; give it as `time [s]`")
    blow = next((k for k, c in enumerate(columns) if c.unit is None and is_named(c.name, BLOW_NAMES)), None)
    if blow is not None and not np.all(np.isfinite(columns[blow].values)):
        raise DataFormatError(f"{path}: the `blow` column holds NaN or Inf; number the blows 1, 2, …")
    rest = []
    for k, column in enumerate(columns):
        if k in (at, blow):
            continue
        if time is not None and is_named(column.name, TIME_NAMES) and np.array_equal(column.values, time.values):
            continue  # a time column before each channel
        if column.values.size and np.all(np.isnan(column.values)):
            warnings.append(f"{path}: column {column.name!r} is empty, or holds no numbers: left out")
            continue
        rest.append(column)
    _check_unique(path, rest)
    numbers = np.zeros(table.values.shape[0]) if blow is None else columns[blow].values
    labels, starts = np.unique(numbers, return_index=True)
    histories = []
    for label in labels[np.argsort(starts)]:
        rows = numbers == label if labels.size > 1 else slice(None)
        name = "1" if blow is None else f"blow {label:g}"
        where = str(path) if blow is None else f"{path}: {name}"
        fs = stated or 1.0
        if time is not None:
            fs = even_sampling((scale or 1.0) * time.values[rows], where)
        signals = tuple(Signal(c.name, c.unit, np.ascontiguousarray(c.values[rows])) for c in rest)
        histories.append(RawHistory(name, fs, signals))
    return Contents(histories=tuple(histories), warnings=tuple(warnings))


def _stated_rate(preamble: tuple[str, ...]) -> float | None:
    """Sampling frequency from the lines above the headings."""
    for line in preamble:
        match = _RATE.search(line)
        if match is not None:
            return float(match[1].replace(",", ".")) * (1e3 if (match[2] or "").lower() == "khz" else 1.0)
        match = _STEP.search(line)
        if match is not None and float(match[1].replace(",", ".")) > 0:
            return 1 / float(match[1].replace(",", "."))
    return None


def _check_unique(path: Path, columns: list[_Column]) -> None:
    names = [column.name for column in columns]
    for name in names:
        if names.count(name) > 1:
            raise DataFormatError(f"{path}: column {name!r} comes {names.count(name)} times; keep one")


def _frf(path: Path, columns: list[_Column]) -> RawFrf:
    at = _axis(path, columns, True, TextOptions())
    if at is None:
        raise DataFormatError(f"{path}: no column `freq [Hz]` in its first line; an frf record's is {_EXPECTED[True]}")
    axis = columns[at]
    scale = scale_of(axis.unit)
    if scale is None or (axis.unit or "hz").strip().lower() in ("s", "ms"):
        raise DataFormatError(f"{path}: unit {axis.unit!r} of {axis.name!r} is no frequency; give it as `freq [Hz]`")
    amplitude = None
    parts: dict[str, dict[str, _Column]] = {}
    rest = [c for k, c in enumerate(columns) if k != at]
    _check_unique(path, rest)
    for column in rest:
        if column.name.casefold().replace("_", " ") == "force amplitude":
            amplitude = Signal("force amplitude", column.unit, column.values)
            continue
        if column.name.casefold() == "position" and column.unit is None:  # as responses of a model are exported
            if not np.all(column.values == column.values[0]) and not np.all(np.isnan(column.values)):
                raise DataFormatError(f"{path}: {SEVERAL_POSITIONS}")
            continue
        kind, match = next(((k, m) for k, p in _PARTS.items() if (m := p.match(column.name))), (None, None))
        if kind is None or match is None:
            if np.all(np.isnan(column.values)):
                continue
            raise DataFormatError(f"{path}: column {column.name!r} is not known; the first line is {_EXPECTED[True]}")
        parts.setdefault(match["a"] or match["b"], {})[kind] = column
    responses = tuple(_response(path, channel, found) for channel, found in parts.items())
    return RawFrf(scale * axis.values, responses, amplitude)


def _response(path: Path, channel: str, found: dict[str, _Column]) -> RawResponse:
    if "phase" in found and {"re", "im"} & set(found):
        raise DataFormatError(f"{path}: column {found['phase'].name!r} is not known beside `{channel} re` and `im`")
    if "re" in found and "im" in found:
        first, second = found["re"], found["im"]
        values = first.values + 1j * second.values
        if first.unit != second.unit:
            raise DataFormatError(
                f"{path}: {channel!r} has unit {first.unit!r} for re and {second.unit!r} for im; give one unit"
            )
    elif "mag" in found and "phase" in found:
        first, second = found["mag"], found["phase"]
        if (first.unit or "").lower().startswith("db"):
            raise DataFormatError(f"{path}: {channel!r} is in dB; export it as linear magnitude, or as re and im")
        degrees = (second.unit or "deg").lower() not in ("rad", "radian", "radians")
        values = first.values * np.exp(1j * (np.radians(second.values) if degrees else second.values))
    else:
        raise DataFormatError(
            f"{path}: channel {channel!r} needs columns `{channel} re [unit]` and `{channel} im [unit]`, or "
            f"`{channel} mag [unit]` and `{channel} phase [deg]`"
        )
    coherence = found.get("coherence")
    return RawResponse(channel, first.unit, values, None if coherence is None else coherence.values)


def _frf_columns(frf: RawFrf) -> FloatArray:
    columns = [frf.freq] if frf.force_amplitude is None else [frf.freq, frf.force_amplitude.values]
    for response in frf.responses:
        columns += [response.values.real, response.values.imag]
        columns += [response.coherence] if response.coherence is not None else []
    return np.column_stack(columns)


def _history_columns(history: RawHistory, blow: int | None) -> FloatArray:
    count = history.signals[0].values.size
    columns = [] if blow is None else [np.full(count, float(blow))]
    columns.append(np.arange(count) / history.fs)
    return np.column_stack(columns + [signal.values for signal in history.signals])
