"""A recorded travel of the head from CSV: the columns ``time [s]`` and ``position [y/L]``, others aside."""

from __future__ import annotations

import csv
import os
from pathlib import Path

import numpy as np

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import readable
from cutvib_ss.response.travel import Travel, recorded

COLUMNS = ("time [s]", "position [y/L]")
"""Columns of the file, as `write_time_response` names them."""


def read_travel(path: str | os.PathLike[str]) -> Travel:
    """
    A travel through every row of a file.

    Parameters
    ----------
    path : path-like
        CSV with the columns ``time [s]`` and ``position [y/L]``; a file of `write_time_response` is one.

    Returns
    -------
    Travel
        A spline through the record. Noise in it shakes the machine: smooth it before.

    Raises
    ------
    DataFormatError
        If there is no such file, a column or a number is missing, or the record is no travel.
    """
    file = Path(path)
    try:
        with readable(file), file.open(encoding="utf-8-sig", newline="") as stream:
            header, *rows = list(csv.reader(stream)) or [[]]
    except UnicodeDecodeError as error:
        raise DataFormatError(f"{file}: cannot be read: {error}") from error
    names = [name.strip() for name in header]
    missing = [c for c in COLUMNS if c not in names]
    if missing:
        raise DataFormatError(
            f"{file}: has no column {' and '.join(missing)}; its columns are {', '.join(names) or 'none'}"
        )
    at = [names.index(c) for c in COLUMNS]
    try:
        values = np.array([[float(row[k]) for k in at] for row in rows if row], dtype=np.float64).reshape(-1, 2)
    except (ValueError, IndexError) as error:
        raise DataFormatError(f"{file}: a row holds no number: {error}") from error
    try:
        return recorded(values[:, 0], values[:, 1])
    except ParameterError as error:
        raise DataFormatError(f"{file}: {error}") from error
