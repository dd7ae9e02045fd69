"""CSV: time records (``time [s],force [N],…``, blows told apart by a ``blow`` column) and frequency responses."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import (
    Contents,
    Layout,
    RawFrf,
    RawHistory,
    RawResponse,
    Signal,
    even_sampling,
)
from cutvib_ss.results import FloatArray

_COLUMN = re.compile(r"^(?P<name>[^\[\]]*?)\s*(?:\[(?P<unit>[^\]]*)\])?$")
_EXPECTED = {
    True: "`freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N],tool_x coherence,…`",
    False: "`time [s],force [N],tool_x [m/s^2],…`",
}


def read(path: Path, frf: bool, layout: Layout) -> Contents:
    """
    Contents of a CSV file, by the names and units of its first line.

    Parameters
    ----------
    path : Path
        File.
    frf : bool
        Whether frequency responses are wanted.
    layout : Layout
        Not used; columns bear their names.

    Returns
    -------
    Contents
        Histories, one per blow, or frequency responses.

    Raises
    ------
    DataFormatError
        If the first line is not as described, a row is cut short or holds no number.
    """
    columns = _header(path, frf)
    values = _numbers(path, len(columns))
    return Contents(frf=_frf(path, columns, values)) if frf else Contents(histories=_histories(path, columns, values))


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """
    Write contents as CSV; 17 digits, so that they read back the same.

    Parameters
    ----------
    path : Path
        File to write.
    contents : Contents
        Histories (a ``blow`` column where there are several) or frequency responses.
    layout : Layout
        Not used.
    """
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


def _header(path: Path, frf: bool) -> list[tuple[str, str | None]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            first = next(csv.reader(file), [])
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataFormatError(f"{path}: not a CSV text file ({error}); its first line is {_EXPECTED[frf]}") from error
    columns = []
    for cell in first:
        match = _COLUMN.match(cell.strip())
        if match is None:
            raise DataFormatError(f"{path}: column {cell!r} is not `name [unit]`; the first line is {_EXPECTED[frf]}")
        columns.append((match["name"], match["unit"]))
    axis = ("freq", "Hz") if frf else ("time", "s")
    if axis not in columns:
        raise DataFormatError(
            f"{path}: no column `{axis[0]} [{axis[1]}]` in its first line; "
            f"{'an frf' if frf else 'a time'} record's is {_EXPECTED[frf]}"
        )
    names = [name for name, _ in columns]
    for name in names:
        if names.count(name) > 1:
            raise DataFormatError(f"{path}: column {name!r} comes {names.count(name)} times; keep one")
    return columns


def _numbers(path: Path, width: int) -> FloatArray:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            next(csv.reader(file))
            if not any(not line.isspace() for line in file):
                raise DataFormatError(f"{path}: there are no rows under its first line; export the record again")
        values = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2, comments=None, encoding="utf-8-sig")
    except ValueError as error:
        if isinstance(error, DataFormatError):
            raise
        raise DataFormatError(f"{path}: truncated or not numeric ({error}); export the file again") from error
    if values.shape[1] != width:
        raise DataFormatError(
            f"{path}: rows have {values.shape[1]} columns, the first line names {width}; export it again"
        )
    return values


def _histories(path: Path, columns: list[tuple[str, str | None]], values: FloatArray) -> tuple[RawHistory, ...]:
    names = [name for name, _ in columns]
    time = values[:, names.index("time")]
    blow = values[:, names.index("blow")] if "blow" in names else np.zeros(len(values))
    if not np.all(np.isfinite(blow)):
        raise DataFormatError(f"{path}: the `blow` column holds NaN or Inf; number the blows 1, 2, …")
    labels, starts = np.unique(blow, return_index=True)
    histories = []
    for label in labels[np.argsort(starts)]:
        rows = blow == label if labels.size > 1 else slice(None)
        name = f"blow {label:g}" if "blow" in names else "1"
        fs = even_sampling(time[rows], f"{path}: {name}" if "blow" in names else str(path))
        signals = tuple(
            Signal(channel, unit, np.ascontiguousarray(values[rows, k]))
            for k, (channel, unit) in enumerate(columns)
            if channel not in ("time", "blow")
        )
        histories.append(RawHistory(name, fs, signals))
    return tuple(histories)


def _frf(path: Path, columns: list[tuple[str, str | None]], values: FloatArray) -> RawFrf:
    data = {name: (unit, values[:, k]) for k, (name, unit) in enumerate(columns)}
    _, freq = data.pop("freq")
    amplitude = data.pop("force amplitude", data.pop("force_amplitude", None))
    channels = list(dict.fromkeys(name.rsplit(" ", 1)[0] for name in data))
    responses = []
    for channel in channels:
        real, imag = (data.pop(f"{channel} {part}", None) for part in ("re", "im"))
        coherence = data.pop(f"{channel} coherence", None)
        if real is None or imag is None:
            raise DataFormatError(
                f"{path}: channel {channel!r} needs columns `{channel} re [unit]` and `{channel} im [unit]`"
            )
        if real[0] != imag[0]:
            raise DataFormatError(
                f"{path}: {channel!r} has unit {real[0]!r} for re and {imag[0]!r} for im; give one unit"
            )
        responses.append(
            RawResponse(channel, real[0], real[1] + 1j * imag[1], None if coherence is None else coherence[1])
        )
    if data:
        raise DataFormatError(f"{path}: column {next(iter(data))!r} is not known; the first line is {_EXPECTED[True]}")
    stated = None if amplitude is None else Signal("force amplitude", amplitude[0], amplitude[1])
    return RawFrf(freq, tuple(responses), stated)


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
