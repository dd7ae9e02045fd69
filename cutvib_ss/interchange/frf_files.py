"""
Frequency responses as files, each of which reads back: CSV, UFF data set 58, MAT, NetCDF and NPZ.

CSV has the columns ``position,freq [Hz],<channel> re [unit],<channel> im [unit],…``, one row for each position and
frequency; the position is empty for a model that has none. CSV holds one input. CSV, UFF and MAT hold no variance, coherence
or decay rate; NPZ and NetCDF hold everything.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import readable, staged
from cutvib_ss.interchange.frf_formats import (
    UNITS,
    read_mat,
    read_netcdf,
    read_uff,
    write_mat,
    write_netcdf,
    write_uff,
)
from cutvib_ss.results import ComplexArray, FrequencyResponse, MeasuredFrequencyResponse, Quantity

_COLUMN = re.compile(r"^(?P<name>.+) (?P<part>re|im) \[(?P<unit>[^\]]+)\]$")
_FIRST_LINE = "`position,freq [Hz],<channel> re [unit],<channel> im [unit],…`"


def write_frf(frf: FrequencyResponse, path: str | os.PathLike[str]) -> None:
    """
    Write a frequency response; the suffix tells the format.

    Parameters
    ----------
    frf : FrequencyResponse
        Computed or measured response.
    path : path-like
        File that ends in ``.csv``, ``.uff``, ``.unv``, ``.mat``, ``.nc`` or ``.npz``; replaced once the new is complete.

    Raises
    ------
    ParameterError
        If the suffix is not one of these, or the format cannot hold the response.
    DataFormatError
        If the file cannot be written.
    """
    writer = frf_writer(path)
    if writer not in (_write_npz, write_netcdf) and frf.decay_rate:
        raise ParameterError(f"{Path(path).suffix} has no place for a decay rate ({frf.decay_rate} 1/s); write .npz")
    with staged(path) as draft:
        writer(frf, draft)


def frf_writer(path: str | os.PathLike[str]) -> Callable[[FrequencyResponse, Path], None]:
    """What writes a frequency response to a file of this name."""
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise ParameterError(f"{path}: suffix {suffix!r} is not written; give one of {', '.join(_WRITERS)}")
    return _WRITERS[suffix]


def read_frf(path: str | os.PathLike[str]) -> FrequencyResponse:
    """
    Read a frequency response that `write_frf` wrote.

    Parameters
    ----------
    path : path-like
        File that ends in ``.csv``, ``.uff``, ``.unv``, ``.mat``, ``.nc`` or ``.npz``.

    Returns
    -------
    FrequencyResponse
        The response; of NPZ and NetCDF a `MeasuredFrequencyResponse` where it was one.

    Raises
    ------
    DataFormatError
        If the file is missing, of another format, cut short, or not labelled as expected.
    """
    file = Path(path)
    readers = {
        ".csv": _read_csv, ".npz": _read_npz, ".uff": read_uff, ".unv": read_uff, ".mat": read_mat, ".nc": read_netcdf
    }  # fmt: skip
    if file.suffix.lower() not in readers:
        raise DataFormatError(f"{file}: suffix {file.suffix!r} does not read back; give one of {', '.join(readers)}")
    with readable(file):
        return readers[file.suffix.lower()](file)


def frf_csv(frf: FrequencyResponse) -> str:
    """
    A frequency response as CSV text, every digit kept.

    Parameters
    ----------
    frf : FrequencyResponse
        One input, no decay rate.

    Returns
    -------
    str
        Header and rows.

    Raises
    ------
    ParameterError
        If there are several inputs or a decay rate, for which CSV has no place.

    Examples
    --------
    >>> frf = FrequencyResponse([[[[1 + 2j]]]], [10.0], [0.5], ["tool_x"], ["force"], ["acceleration"])
    >>> print(frf_csv(frf), end="")
    position,freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N]
    0.5,10.0,1.0,2.0
    """
    if len(frf.inputs) != 1:
        raise ParameterError(f".csv holds one input, not {', '.join(frf.inputs)}; write .npz or pick one with sel")
    if frf.decay_rate:
        raise ParameterError(f".csv has no place for a decay rate ({frf.decay_rate} 1/s); write .npz")
    header = ["position", "freq [Hz]"]
    for output, unit in zip(frf.outputs, frf.units, strict=True):
        header += [f"{output} re [{unit}]", f"{output} im [{unit}]"]
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    freq = frf.freq.tolist()
    for position, block in zip(frf.positions.tolist(), frf.data[:, :, 0], strict=True):
        place = "" if np.isnan(position) else position
        # re and im of each output side by side; tolist gives floats that print with all their digits
        columns = np.stack([block.real, block.imag], axis=1).reshape(-1, frf.freq.size).T.tolist()
        writer.writerows([place, f, *row] for f, row in zip(freq, columns, strict=True))
    return text.getvalue()


def _write_csv(frf: FrequencyResponse, path: Path) -> None:
    path.write_text(frf_csv(frf), encoding="utf-8", newline="")


def _write_npz(frf: FrequencyResponse, path: Path) -> None:
    arrays: dict[str, Any] = {
        "data": frf.data,
        "freq_hz": frf.freq,
        "positions": frf.positions,
        "outputs": np.array(frf.outputs),
        "inputs": np.array(frf.inputs),
        "quantities": np.array(frf.quantities),
        "input_unit": np.array(frf.input_unit),
        "decay_rate": np.array(frf.decay_rate),
        "displacement_units": np.array(frf.displacement_units),
        "input_units": np.array(frf.input_units),
    }
    if isinstance(frf, MeasuredFrequencyResponse):
        arrays |= {"variance": frf.variance, "coherence": frf.coherence, "averages": np.array(frf.averages)}
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)


_WRITERS: dict[str, Callable[[FrequencyResponse, Path], None]] = {
    ".csv": _write_csv,
    ".uff": write_uff,
    ".unv": write_uff,
    ".mat": write_mat,
    ".nc": write_netcdf,
    ".npz": _write_npz,
}


def _read_csv(path: Path) -> FrequencyResponse:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = [row for row in csv.reader(file) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataFormatError(f"{path}: not a CSV text file ({error}); export it again") from error
    if len(rows) < 2:
        raise DataFormatError(f"{path}: no rows under a first line {_FIRST_LINE}; export it again")
    outputs, quantities, displacement_units, input_unit = _labels(path, rows[0])
    width = len(rows[0])
    for number, row in enumerate(rows[1:], start=2):
        if len(row) != width:
            raise DataFormatError(
                f"{path}: row {number} has {len(row)} values, the first line {width}; truncated, export it again"
            )
    try:
        table = np.array([[float(cell or "nan") for cell in row] for row in rows[1:]])
    except ValueError as error:
        raise DataFormatError(f"{path}: not numeric ({error}); export it again") from error
    starts = np.flatnonzero(np.append(True, np.diff(np.nan_to_num(table[:, 0], nan=-1.0)) != 0))
    blocks = np.split(table, starts[1:])
    freq = blocks[0][:, 1]
    if any(block.shape != blocks[0].shape or not np.array_equal(block[:, 1], freq) for block in blocks):
        raise DataFormatError(f"{path}: its positions have different frequencies; export all with one frequency axis")
    data: ComplexArray = np.array([(block[:, 2::2] + 1j * block[:, 3::2]).T for block in blocks])
    return FrequencyResponse(
        data[:, :, np.newaxis], freq, table[starts, 0], outputs, ("force",), quantities, input_unit=input_unit,
        displacement_units=displacement_units,
    )  # fmt: skip


def _labels(path: Path, header: list[str]) -> tuple[tuple[str, ...], tuple[Quantity, ...], tuple[str, ...], str]:
    if header[:2] != ["position", "freq [Hz]"] or len(header) < 4 or len(header) % 2:
        raise DataFormatError(f"{path}: the first line is not {_FIRST_LINE}; export it again")
    outputs, quantities, above, below = [], [], [], set()
    for real, imag in zip(header[2::2], header[3::2], strict=True):
        match = _COLUMN.match(real)
        if match is None or match["part"] != "re" or imag != f"{match['name']} im [{match['unit']}]":
            raise DataFormatError(f"{path}: columns {real!r} and {imag!r} are not `<channel> re [unit]` and im")
        if match["unit"] not in UNITS:
            raise DataFormatError(f"{path}: unit {match['unit']!r} is not read; it is one of {', '.join(UNITS)}")
        displacement, quantity, input_unit = UNITS[match["unit"]]
        above.append(displacement)
        outputs.append(match["name"])
        quantities.append(quantity)
        below.add(input_unit)
    if len(below) > 1:
        raise DataFormatError(f"{path}: channels refer to inputs in {' and '.join(sorted(below))}; give one input")
    return tuple(outputs), tuple(quantities), tuple(above), below.pop()


def _read_npz(path: Path) -> FrequencyResponse:
    try:
        # Opened here: np.load leaves the file open where it is damaged.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except FileNotFoundError:
        raise
    except Exception as error:  # numpy and zipfile raise many kinds on damaged files
        raise DataFormatError(f"{path}: not a readable NPZ file ({error}); export it again") from error
    try:
        common: dict[str, Any] = {
            "data": arrays["data"],
            "freq": arrays["freq_hz"],
            "positions": arrays["positions"],
            "outputs": tuple(arrays["outputs"].tolist()),
            "inputs": tuple(arrays["inputs"].tolist()),
            "quantities": tuple(arrays["quantities"].tolist()),
            "input_unit": str(arrays["input_unit"]),
            "decay_rate": float(arrays["decay_rate"]),
        } | {n: tuple(arrays[n].tolist()) for n in ("displacement_units", "input_units") if n in arrays}
    except KeyError as error:
        raise DataFormatError(f"{path}: holds no {error}; it is not an exported frequency response") from None
    try:
        if "variance" in arrays:
            averages = int(arrays["averages"])
            return MeasuredFrequencyResponse(
                **common, variance=arrays["variance"], coherence=arrays["coherence"], averages=averages
            )
        return FrequencyResponse(**common)
    except (KeyError, ParameterError) as error:
        raise DataFormatError(f"{path}: its arrays do not fit each other ({error}); export it again") from error
