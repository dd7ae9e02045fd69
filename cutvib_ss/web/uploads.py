"""Uploaded files as a campaign's folder: a zip, a folder, or its files without their folders."""

from __future__ import annotations

import shutil
import tomllib
import zipfile
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO

from cutvib_ss.errors import DataFormatError

CAMPAIGN_FILE = "campaign.toml"
MOST_BYTES = 2 * 1024**3
"""Largest upload, and largest content of a zip."""
MOST_FILES = 5000
_COPY = 1 << 20


def store(files: Iterable[tuple[str, BinaryIO]], folder: Path) -> Path:
    """
    Uploaded files, written below a folder; the folder of their campaign.toml.

    Names are relative paths as a browser gives them for a dropped folder. Files that came without their folders are put where
    campaign.toml looks for them.
    """
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    written = 0
    for number, (name, stream) in enumerate(files, start=1):
        if number > MOST_FILES:
            raise DataFormatError(f"more than {MOST_FILES} files were uploaded; upload the campaign's folder alone")
        if name.lower().endswith(".zip"):
            written += _unpack(name, stream, folder, MOST_BYTES - written)
        else:
            written += _copy(stream, _inside(folder, name), MOST_BYTES - written, name)
    found = _campaign_folder(folder)
    _gather(found)
    return found


def message_of(error: BaseException, folder: Path) -> str:
    """An error in one line, files named as the user knows them and not by where the server keeps them."""
    text = " ".join(str(error).split())
    for path in (folder, folder.resolve()):
        text = text.replace(f"{path.as_posix()}/", "").replace(str(path), "the upload")
    return text


def _inside(folder: Path, name: str) -> Path:
    """Where a file of the upload goes; outside of the folder is refused."""
    parts = PurePosixPath(name.replace("\\", "/")).parts
    if not parts or parts[0] == "/" or ".." in parts or ":" in parts[0] or "\0" in name:
        raise DataFormatError(f"{name!r}: not a path inside the campaign's folder; upload the folder or a zip of it")
    return folder.joinpath(*parts)


def _copy(stream: BinaryIO, target: Path, room: int, name: str) -> int:
    """A stream as a file; its size."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        size = 0
        with target.open("wb") as out:
            while block := stream.read(_COPY):
                size += len(block)
                if size > room:
                    raise DataFormatError(
                        f"{name}: the upload is larger than {MOST_BYTES >> 30} GB; upload fewer records"
                    )
                out.write(block)
    except OSError as error:
        raise DataFormatError(f"{name}: cannot be stored ({error.strerror}); rename the file") from error
    return size


def _unpack(name: str, stream: BinaryIO, folder: Path, room: int) -> int:
    """The files of a zip; their size together."""
    try:
        with zipfile.ZipFile(stream) as archive:
            members = [m for m in archive.infolist() if not m.is_dir() and not m.filename.startswith("__MACOSX/")]
            if len(members) > MOST_FILES:
                raise DataFormatError(f"{name}: holds {len(members)} files; zip the campaign's folder alone")
            size = 0
            for member in members:
                with archive.open(member) as content:
                    size += _copy(content, _inside(folder, member.filename), room - size, member.filename)  # type: ignore[arg-type]
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, zipfile.zlib.error) as error:  # type: ignore[attr-defined]
        raise DataFormatError(f"{name}: cannot be unpacked ({error}); zip the campaign's folder again") from error
    return size


def _campaign_folder(folder: Path) -> Path:
    """The one folder that holds a campaign.toml."""
    found = sorted(folder.rglob(CAMPAIGN_FILE), key=lambda p: (len(p.parts), str(p)))
    if not found:
        raise DataFormatError(
            "no campaign.toml among the uploaded files; `cutvib campaign init FOLDER` writes one beside your records"
        )
    if len(found) > 1 and len(found[1].parts) == len(found[0].parts):
        names = ", ".join(p.relative_to(folder).as_posix() for p in found[:4])
        raise DataFormatError(f"{len(found)} campaigns were uploaded ({names}); upload one at a time")
    return found[0].parent


def _gather(folder: Path) -> None:
    """Put files that lost their folders where campaign.toml looks for them; refuse references out of the upload."""
    for name in _references(folder / CAMPAIGN_FILE):
        target = _inside(folder, name)
        if target.exists():
            continue
        loose = folder / target.name
        if loose.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(loose, target)


def _references(file: Path) -> list[str]:
    """Files that a campaign.toml names; nothing where it cannot be read, which the reader of campaigns then says."""
    try:
        tables: dict[str, Any] = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return []
    head, records = tables.get("campaign", {}), tables.get("record", [])
    named: list[Any] = [head.get("machine")] if isinstance(head, dict) else []
    for record in records if isinstance(records, list) else []:
        files = record.get("file") if isinstance(record, dict) else None
        named += files if isinstance(files, list) else [files]
    return [name for name in named if isinstance(name, str) and name]
