"""File formats, one module each behind one small interface; told apart by suffix."""

from __future__ import annotations

from pathlib import Path

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats import csv, lvm, mat, tdms, uff
from cutvib_ss.measurement.formats.raw import Contents, Format, TextOptions

FORMATS: dict[str, Format] = {".tdms": tdms, ".uff": uff, ".unv": uff, ".csv": csv, ".mat": mat, ".lvm": lvm}
"""Module of each suffix that records are written under."""

_READ: dict[str, Format] = {**FORMATS, ".txt": csv, ".asc": csv, ".tsv": csv, ".dat": csv}


def read_raw(path: Path, frf: bool, options: TextOptions | None = None) -> Contents:
    """All columns of a measurement file by its own names and units: frequency responses, else time records."""
    format_ = format_of(path)
    if not path.is_file():
        raise DataFormatError(f"{path}: there is no such file; correct `file` in campaign.toml")
    if path.stat().st_size == 0:
        raise DataFormatError(f"{path}: the file is empty; copy it again from the analyser")
    return format_.read(path, frf, options or TextOptions())


def format_of(path: Path) -> Format:
    """Module that reads a file, by its suffix."""
    try:
        return _READ[path.suffix.lower()]
    except KeyError:
        raise DataFormatError(f"{path}: suffix {path.suffix!r} is not read; give one of {', '.join(_READ)}") from None


def is_readable(path: Path) -> bool:
    """Whether a file's suffix is one that is read."""
    return path.suffix.lower() in _READ
