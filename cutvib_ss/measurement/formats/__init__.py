"""File formats, one module each behind one small interface; told apart by suffix."""

from __future__ import annotations

from pathlib import Path

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats import csv, lvm, mat, tdms, uff
from cutvib_ss.measurement.formats.raw import Contents, Format, Layout

FORMATS: dict[str, Format] = {".tdms": tdms, ".uff": uff, ".unv": uff, ".csv": csv, ".mat": mat, ".lvm": lvm}
"""Module of each suffix."""


def read_file(path: Path, frf: bool, layout: Layout) -> Contents:
    """
    Contents of a measurement file of any format.

    Parameters
    ----------
    path : Path
        File; its suffix tells the format.
    frf : bool
        Whether frequency responses are wanted, else time records.
    layout : Layout
        Quantities and nodes of the channels.

    Returns
    -------
    Contents
        Named columns in the file's own units.

    Raises
    ------
    DataFormatError
        If the file is missing, of an unknown suffix, empty, or not what its suffix says.
    """
    format_ = format_of(path)
    if not path.is_file():
        raise DataFormatError(f"{path}: there is no such file; correct `file` in campaign.toml")
    if path.stat().st_size == 0:
        raise DataFormatError(f"{path}: the file is empty; copy it again from the analyser")
    return format_.read(path, frf, layout)


def format_of(path: Path) -> Format:
    """
    Module that reads a file, by its suffix.

    Parameters
    ----------
    path : Path
        File.

    Returns
    -------
    Format
        The module.

    Raises
    ------
    DataFormatError
        If the suffix is unknown.
    """
    try:
        return FORMATS[path.suffix.lower()]
    except KeyError:
        raise DataFormatError(f"{path}: suffix {path.suffix!r} is not read; give one of {', '.join(FORMATS)}") from None
