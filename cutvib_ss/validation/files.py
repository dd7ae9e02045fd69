"""Files of a trial: written whole or not at all, hashed by their content, packed for a worker on another machine."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import tarfile
import tempfile
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cutvib_ss.errors import DataFormatError

PACKAGE = Path(__file__).resolve().parents[1]
"""The package's own folder."""

_NOT_CODE = {".pyc", ".pyo", ".nbi", ".nbc"}


def now() -> str:
    """The time, to the microsecond."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def canonical(data: Any) -> bytes:
    """
    Data as JSON in the one form that is hashed.

    >>> canonical({"b": 1, "a": [0.5]})
    b'{"a":[0.5],"b":1}'
    """
    return json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def digest(content: bytes) -> str:
    """SHA-256 of some bytes."""
    return hashlib.sha256(content).hexdigest()


def folder_hash(folder: Path) -> str:
    """SHA-256 of a folder's content: the files' names and bytes, not their dates."""
    return _hash_of(folder, [p for p in folder.rglob("*") if p.is_file()])


def code_hash() -> str:
    """SHA-256 of the package as it runs: its modules and the data that ship with it."""
    files = (p for p in PACKAGE.rglob("*") if p.is_file() and p.suffix not in _NOT_CODE)
    return _hash_of(PACKAGE, [p for p in files if "__pycache__" not in p.parts and not p.name.startswith(".")])


def _hash_of(root: Path, files: list[Path]) -> str:
    total = hashlib.sha256()
    for file in sorted(files, key=lambda p: p.relative_to(root).as_posix()):
        total.update(file.relative_to(root).as_posix().encode() + b"\0")
        total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file so that a reader finds the old one or the new one, never a part."""
    descriptor, draft = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(draft).replace(path)
    except BaseException:
        Path(draft).unlink(missing_ok=True)
        raise


def write_json(path: Path, data: Any) -> None:
    """Write data as indented JSON, whole or not at all."""
    write_bytes(path, (json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode())


def read_json(path: Path) -> Any:
    """Read JSON."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise DataFormatError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise DataFormatError(f"{path}: is no JSON ({error}); it was cut short or changed by hand") from error


def packed(folder: Path) -> bytes:
    """A folder's files as one archive, without dates and owners."""
    return packed_files({p.relative_to(folder).as_posix(): p for p in sorted(folder.rglob("*")) if p.is_file()})


def packed_files(files: Mapping[str, Path]) -> bytes:
    """Files under names of their own as one archive, without dates and owners."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode="w") as archive:
        for name, file in files.items():
            entry = tarfile.TarInfo(name)
            entry.size = file.stat().st_size
            with file.open("rb") as content:
                archive.addfile(entry, content)
    return buffer.getvalue()


def unpack(archive: bytes, folder: Path) -> None:
    """Unpack an archive into a folder that appears once it is complete."""
    draft = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(draft, ignore_errors=True)
    with tarfile.open(fileobj=io.BytesIO(archive)) as content:
        # Pythons before 3.11.4 know no filter.
        content.extraction_filter = getattr(tarfile, "data_filter", None)
        content.extractall(draft)
    draft.rename(folder)
