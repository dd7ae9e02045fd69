"""
Files that are written: complete or not there at all, and refused before the work where they cannot be; TOML that is read.

Imports nothing slow, so that the command line can refuse a wrong name at once.
"""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cutvib_ss.errors import DataFormatError, ParameterError

PICTURES = (".png", ".svg", ".pdf")
"""Suffixes of pictures."""


@contextmanager
def staged(path: str | os.PathLike[str]) -> Iterator[Path]:
    """
    A temporary file beside a target, which replaces it once the block ends without an error.

    Parameters
    ----------
    path : path-like
        The target; an old file of that name stays until the new one is complete.

    Yields
    ------
    Path
        Where to write; it has the target's suffix.

    Raises
    ------
    DataFormatError
        If the target cannot be written; the message says why.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with staged(folder / "figures.json") as draft:
    ...     _ = draft.write_text("{}")
    >>> [file.name for file in folder.iterdir()]
    ['figures.json']
    """
    target = check_target(path)
    draft = target.with_name(f".{target.stem}.{os.getpid()}.part{target.suffix}")
    try:
        yield draft
        draft.replace(target)
    except OSError as error:
        raise DataFormatError(f"{target}: cannot be written ({error.strerror}); choose another path") from error
    finally:
        draft.unlink(missing_ok=True)


def read_toml(file: Path, wanted: str) -> dict[str, Any]:
    """Content of a TOML file; where there is none, the message says what is wanted."""
    try:
        with readable(file, wanted), file.open("rb") as stream:
            return tomllib.load(stream)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise DataFormatError(f"{file}: not valid TOML ({error}); correct that line") from error


@contextmanager
def readable(file: Path, wanted: str = "correct the path") -> Iterator[None]:
    """Around what reads a file: one that is missing, or cannot be opened, is a `DataFormatError` that says what is wanted."""
    try:
        yield
    except FileNotFoundError:
        raise DataFormatError(f"{file}: there is no such file; {wanted}") from None
    except OSError as error:
        raise DataFormatError(
            f"{file}: cannot be read ({error.strerror}); check the path and its permissions"
        ) from error


def check_target(path: str | os.PathLike[str]) -> Path:
    """A path that a file can be written to, before the work that fills it begins."""
    target = Path(path)
    if target.is_dir():
        raise DataFormatError(f"{target}: is a folder; give the name of a file")
    if not target.parent.is_dir():
        raise DataFormatError(f"{target}: there is no folder {target.parent}; make it first")
    if not os.access(target.parent, os.W_OK):
        raise DataFormatError(f"{target}: the folder {target.parent} cannot be written to; choose another path")
    return target


def made_folder(path: str | os.PathLike[str]) -> Path:
    """A folder to write to, made where it is not there."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DataFormatError(
            f"{folder}: cannot be made a folder ({error.strerror}); choose another with --out"
        ) from error
    return folder


def check_picture(path: str | os.PathLike[str]) -> Path:
    """The name of a picture, refused where its suffix is not one that can be drawn."""
    file = Path(path)
    if file.is_dir():
        raise ParameterError(f"{file}: is a folder; give the name of a file, ending in one of {', '.join(PICTURES)}")
    if file.suffix.lower() not in PICTURES:
        raise ParameterError(f"{file}: suffix {file.suffix!r} is no picture; give one of {', '.join(PICTURES)}")
    return file
