"""
Every campaign below a folder diagnosed, in one table.

Each diagnosis runs in a process of its own and is kept the moment it is done, under a hash of the files that it rests on: a
second call passes over what is done, and a campaign whose files have changed is diagnosed anew.
"""

from __future__ import annotations

import json
import os
import platform
import re
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import cutvib_ss
from cutvib_ss.errors import CutvibError, DataFormatError, ParameterError
from cutvib_ss.measurement.schema import read_campaign_file
from cutvib_ss.model_files import read_machine
from cutvib_ss.validation.files import canonical, digest, packed_files, unpack, write_bytes
from cutvib_ss.validation.workers import alone, spread

SCHEMA = "cutvib-fleet/1"
KEPT = ".cutvib-fleet"
"""Folder of what is kept, unless another is named; below the fleet's own."""

_OWN = re.compile(r"[0-9a-f]{64}\.(?:json|html)")


@dataclass(frozen=True)
class FleetRow:
    """One campaign of the table; what does not exist is None, and ``error`` says why there is no diagnosis."""

    campaign: str  # Folder, relative to the fleet's
    verdict: str | None = None
    effect: str | None = None  # What is most probable, and where
    place: str | None = None
    place_set: tuple[str, ...] = ()
    probability: float | None = None
    unit: str | None = None  # Of the errors before and after
    before: float | None = None
    after: float | None = None
    shrinkage: float | None = None
    shrinkage_interval: tuple[float | None, float | None] | None = None
    warnings: tuple[str, ...] = ()
    diagnosis: str | None = None  # Files that are kept
    report: str | None = None
    resumed: bool = False  # Whether an earlier call had diagnosed it
    error: str | None = None


@dataclass(frozen=True)
class Task:
    """A campaign as a worker gets it."""

    name: str  # Folder of the campaign, relative to that of the fleet
    root: str  # Folder of the fleet: where it lies here, or within the archive
    archive: bytes | None  # The files, for a worker on another machine
    report: bool  # Whether its report is wanted
    machine: bytes | None = None  # machine.toml of the nominal model, if not the campaign's own


@dataclass(frozen=True)
class Diagnosed:
    """What a worker gives back."""

    diagnosis: bytes | None
    report: bytes | None
    error: str


Worker = Callable[[Task], Diagnosed]
Progress = Callable[[str, int, int], None]
"""Told the campaign that is done, how many are, and how many there are."""


def diagnose_fleet(
    folder: str | os.PathLike[str],
    *,
    out: str | os.PathLike[str] | None = None,
    reports: bool = False,
    jobs: int = 1,
    scheduler: str | None = None,
    machine: str | os.PathLike[str] | None = None,
    progress: Progress = lambda name, done, total: None,
    worker: Worker | None = None,
) -> tuple[FleetRow, ...]:
    """
    Diagnose every campaign below a folder, or those that an earlier call left; one row each, in the order of their paths.

    With `machine`, a machine.toml, against that nominal model; each against its own by default.
    """
    root = Path(folder)
    nominal = None if machine is None else _machine_file(Path(machine))
    if jobs < 1:
        raise ParameterError(f"jobs = {jobs} must be at least 1")
    if not root.is_dir():
        raise ParameterError(f"{root}: is not a folder; give one that holds campaigns")
    kept = root / KEPT if out is None else Path(out)
    names = _campaigns(root, kept)
    if not names:
        raise DataFormatError(f"{root}: no campaign.toml in it or below it")
    rows: dict[str, FleetRow] = {}
    left: dict[str, tuple[str, list[Path]]] = {}
    for name in names:
        try:
            files = _files(root / name)
            key = _key(root / name, files, nominal)
        except (CutvibError, OSError) as fault:
            rows[name] = FleetRow(name, error=str(fault))
            continue
        done = _kept_row(name, kept / name / key, reports)
        if done is None:
            left[name] = (key, files)
        else:
            rows[name] = replace(done, resumed=True)
    if left:
        _prepare(kept, left)
    progress("", len(rows), len(names))
    away = scheduler is not None
    tasks = ((name, partial(_task, root, name, left[name][1], reports, away, nominal)) for name in left)
    for name, found in spread(worker or diagnose_one, tasks, jobs, scheduler):
        rows[name] = _keep(name, kept / name / left[name][0], found)
        progress(name, len(rows), len(names))
    own = root.resolve().name
    return tuple(replace(rows[name], campaign=own) if name == "." else rows[name] for name in names)


def diagnose_one(task: Task) -> Diagnosed:
    """Diagnose a campaign in a process of its own: what crashes takes nothing else along."""
    with tempfile.TemporaryDirectory(prefix="cutvib-") as temporary:
        here = Path(temporary)
        root = Path(task.root)
        if task.archive is not None:
            unpack(task.archive, here / "files")
            root = here / "files" / task.root
        diagnosis, report = here / "diagnosis.json", here / "report.html"
        command = [sys.executable, "-m", "cutvib_ss", "diagnose", task.name, "--json", str(diagnosis)]
        if task.machine is not None:
            (here / "nominal.toml").write_bytes(task.machine)
            command += ["--machine", str(here / "nominal.toml")]
        status, words = alone([*command, "--report", str(report)] if task.report else command, root, here)
        if status or not diagnosis.is_file():
            said = words.splitlines()
            last = said[-1].removeprefix("cutvib: ") if said else "it said nothing"
            if status == 2:  # a refusal is one line
                return Diagnosed(None, None, last)
            # Of a fault of the program the line before names the exception.
            last = last if len(said) < 2 else f"{said[-2].strip()} ({last})"
            return Diagnosed(None, None, f"{platform.node()}: status {status}: {last}")
        return Diagnosed(diagnosis.read_bytes(), report.read_bytes() if task.report else None, "")


def table_data(rows: Sequence[FleetRow]) -> dict[str, Any]:
    """The table as plain data of the schema ``cutvib-fleet/1``."""
    return {"schema": SCHEMA, "campaigns": [asdict(row) for row in rows]}


HEAD = ("campaign", "verdict", "cause", "place", "probability", "before", "after", "shrinkage", "warnings")
"""Columns of `cells`."""


def cells(row: FleetRow) -> Iterator[str]:
    """A row as the cells of a printed table."""
    unit = f" {row.unit}" if row.unit else ""
    yield row.campaign
    yield row.verdict or "failed"
    yield row.effect or ""
    yield row.place or ""
    yield "" if row.probability is None else f"{row.probability:.3f}"
    yield "" if row.before is None else f"{row.before:.3g}{unit}"
    yield "" if row.after is None else f"{row.after:.3g}{unit}"
    yield "" if row.shrinkage is None else f"{100 * row.shrinkage:.0f} %"
    yield "" if row.error is not None else str(len(row.warnings))


def _campaigns(root: Path, kept: Path) -> list[str]:
    """Folders with a campaign.toml; hidden ones, and what an earlier call kept, hold none."""
    own = kept.resolve()
    found = []
    for file in root.rglob("campaign.toml"):
        inside = file.parent.relative_to(root)
        if any(part.startswith(".") for part in inside.parts):
            continue
        if kept.is_dir() and own != root.resolve() and file.resolve().is_relative_to(own):
            continue
        found.append(inside.as_posix())
    return sorted(found)


def _files(folder: Path) -> list[Path]:
    """The files that a diagnosis rests on: campaign.toml, and those that it names."""
    file = folder / "campaign.toml"
    tables = read_campaign_file(file)
    named = [file] if tables.campaign.machine is None else [file, folder / tables.campaign.machine]
    named += [folder / name for table in tables.record for name in table.files]
    return list(dict.fromkeys(named))


def _machine_file(file: Path) -> bytes:
    """The machine.toml of a nominal model, which must be one."""
    read_machine(file)
    return file.read_bytes()


def _key(folder: Path, files: Sequence[Path], machine: bytes | None = None) -> str:
    """A hash of the files by name and content, and of the version that diagnoses; the folder's own name is not in it."""
    content = {os.path.relpath(p, folder): digest(p.read_bytes()) if p.is_file() else None for p in files}
    own = {} if machine is None else {"machine": digest(machine)}
    return digest(canonical({"files": content, "version": cutvib_ss.__version__, **own}))


def _prepare(kept: Path, names: dict[str, Any]) -> None:
    """The folders of what will be kept, before the work begins."""
    try:
        for name in names:
            (kept / name).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=kept):
            pass
    except OSError as error:
        raise ParameterError(f"{kept}: cannot be written to ({error.strerror}); choose another with --out") from error


def _task(root: Path, name: str, files: Sequence[Path], report: bool, away: bool, machine: bytes | None = None) -> Task:
    """A campaign for a worker here, which reads it where it lies, or elsewhere, which gets the files."""
    top = root.resolve()
    if not away:
        return Task(name, str(top), None, report, machine)
    # Links are left as they are named: the campaign looks for its files under these names.
    real = [Path(os.path.normpath(top / p.relative_to(root))) for p in files if p.is_relative_to(root)]
    base = Path(os.path.commonpath([top, *(p.parent for p in real)]))
    found = {p.relative_to(base).as_posix(): p for p in real if p.is_file()}
    return Task(name, top.relative_to(base).as_posix(), packed_files(found), report, machine)


def _kept_row(name: str, stem: Path, reports: bool) -> FleetRow | None:
    """The row of a diagnosis that is there, with its report where that is asked for."""
    file, report = (stem.with_name(f"{stem.name}{suffix}") for suffix in (".json", ".html"))
    if reports and not report.is_file():
        return None
    try:
        row = _row(name, json.loads(file.read_bytes()))
    except (OSError, ValueError, KeyError, TypeError, IndexError):
        return None  # none, or one that was spoilt: diagnose
    return replace(row, diagnosis=str(file), report=str(report) if report.is_file() else None)


def _keep(name: str, stem: Path, found: Diagnosed) -> FleetRow:
    """Keep a diagnosis, drop those of earlier states of the files, and tell it as a row."""
    if found.diagnosis is None:
        return FleetRow(name, error=found.error)
    # The diagnosis comes last: it says that the campaign is done.
    if found.report is not None:
        write_bytes(stem.with_name(f"{stem.name}.html"), found.report)
    write_bytes(stem.with_name(f"{stem.name}.json"), found.diagnosis)
    for old in stem.parent.iterdir():
        if _OWN.fullmatch(old.name) and old.stem != stem.name:
            old.unlink()
    row = _kept_row(name, stem, found.report is not None)
    return FleetRow(name, error="its diagnosis cannot be read back") if row is None else row


def _row(name: str, found: dict[str, Any]) -> FleetRow:
    """What a diagnosis says, in a row."""
    gap, first = found["gap"], found["causes"][0]
    low, high = gap["shrinkage_interval"]
    return FleetRow(
        campaign=name,
        verdict=found["verdict"],
        effect=first["effect"],
        place=first["place"],
        place_set=tuple(found["where"]["place_set"]),
        probability=first["probability"],
        unit=gap["unit"],
        before=gap["before"],
        after=gap["after"],
        shrinkage=gap["shrinkage"],
        shrinkage_interval=(low, high),
        warnings=tuple(found["warnings"]),
    )
