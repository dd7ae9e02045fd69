"""
Responses in time as files: CSV, whose columns are those of a campaign's records, and NPZ; both read back.

CSV has the columns ``time [s],force [N],<output> [unit],…``, and a column ``position [y/L]`` of a head that travels.
"""

from __future__ import annotations

import csv
import os
import re
from pathlib import Path

import numpy as np

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import readable, staged
from cutvib_ss.results import MovingResponse, TimeResponse

TIME_SUFFIXES = (".csv", ".npz")
"""Suffixes of files that hold a response in time."""
_COLUMN = re.compile(r"^(?P<name>.+) \[(?P<unit>[^\]]+)\]$")
_PATH = ("position", "y/L")


def check_time_file(path: str | os.PathLike[str]) -> Path:
    """The name of a file for a response in time, refused where its suffix is not one that is written."""
    file = Path(path)
    if file.suffix.lower() not in TIME_SUFFIXES:
        raise ParameterError(f"{file}: suffix {file.suffix!r} is not written; give one of {', '.join(TIME_SUFFIXES)}")
    return file


def write_time_response(response: TimeResponse, path: str | os.PathLike[str]) -> None:
    """
    Write a response in time; the suffix tells the format.

    Parameters
    ----------
    response : TimeResponse
        The response; of a head that travels with its path.
    path : path-like
        File that ends in ``.csv`` or ``.npz``; replaced once the new is complete.

    Raises
    ------
    ParameterError
        If the suffix is not one of these.
    DataFormatError
        If the file cannot be written.
    """
    suffix = check_time_file(path).suffix.lower()
    names, units = ["force", *response.outputs], [response.force_unit, *response.units]
    columns = [response.force, *response.data]
    if isinstance(response, MovingResponse):
        names, units, columns = [*names, _PATH[0]], [*units, _PATH[1]], [*columns, response.path]
    with staged(path) as draft:
        if suffix == ".npz":
            np.savez_compressed(
                draft, data=np.array(columns), names=np.array(names), units=np.array(units), fs=response.fs,
                position=response.position, periodic=response.periodic,
            )  # fmt: skip
            return
        with draft.open("w", encoding="utf-8", newline="") as file:
            header = ["time [s]", *(f"{n} [{u}]" for n, u in zip(names, units, strict=True))]
            csv.writer(file, lineterminator="\n").writerow(header)
            np.savetxt(file, np.column_stack([response.time, *columns]), fmt="%.17g", delimiter=",")


def read_time_response(path: str | os.PathLike[str]) -> TimeResponse:
    """
    Read a response that `write_time_response` wrote.

    Parameters
    ----------
    path : path-like
        File that ends in ``.csv`` or ``.npz``. CSV does not hold the position of a standing head, nor whether the response is a
        period of a steady state.

    Returns
    -------
    TimeResponse
        The response; a `MovingResponse` where it has a path.

    Raises
    ------
    DataFormatError
        If the file is missing, of another format, or not labelled as expected.
    """
    file = Path(path)
    position, periodic = float("nan"), False
    try:
        with readable(file):
            if file.suffix.lower() == ".npz":
                with np.load(file, allow_pickle=False) as held:
                    columns, names, units = held["data"], held["names"].tolist(), held["units"].tolist()
                    fs, position, periodic = float(held["fs"]), float(held["position"]), bool(held["periodic"])
            else:
                names, units, fs, columns = _read_csv(file)
    except (KeyError, ValueError) as error:
        if isinstance(error, DataFormatError):
            raise
        raise DataFormatError(f"{file}: is not a response in time ({error}); write it again") from error
    if names[:1] != ["force"]:
        raise DataFormatError(f"{file}: its first history is {names[:1]}, not the force; write it again")
    moving = names[-1] == _PATH[0] and units[-1] == _PATH[1]
    last = len(names) - moving
    made = (columns[1:last], columns[0], fs, tuple(names[1:last]), tuple(units[1:last]))
    if moving:
        return MovingResponse(*made, float(columns[-1, 0]), periodic, units[0], path=columns[-1])
    return TimeResponse(*made, position, periodic, units[0])


def _read_csv(file: Path) -> tuple[list[str], list[str], float, np.ndarray]:
    with file.open(encoding="utf-8", newline="") as stream:
        found = [_COLUMN.match(cell) for cell in next(csv.reader(stream), [])]
        values = np.loadtxt(stream, delimiter=",", ndmin=2)
    header = [(m["name"], m["unit"]) for m in found if m]
    if len(header) < max(2, len(found)) or header[0] != ("time", "s") or values.shape[0] < 2:
        raise DataFormatError(
            f"{file}: the first line is not `time [s],force [N],<output> [unit],…` with rows under it"
        )
    if values.shape[1] != len(header):
        raise DataFormatError(f"{file}: rows have {values.shape[1]} columns, the first line names {len(header)}")
    fs = (len(values) - 1) / float(values[-1, 0] - values[0, 0])
    return [n for n, _ in header[1:]], [u for _, u in header[1:]], fs, np.ascontiguousarray(values[:, 1:].T)
