"""What one visitor of the page works on: a campaign, its responses, a diagnosis."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import cutvib_ss
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError, DataFormatError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.measurement.records import Campaign
from cutvib_ss.measurement.summary import Summary, summarise
from cutvib_ss.model_files import read_machine
from cutvib_ss.web.job import Job
from cutvib_ss.web.uploads import message_of, store
from cutvib_ss.web.worker import MACHINE

PREFIX = "cutvib-page-"
"""How folders of uploads and results begin, in the system's folder for temporary files."""
DEMO = Path(cutvib_ss.__file__).parent / "data" / "demo"


@dataclass(frozen=True)
class Opened:
    """A campaign that was read, with the figures of its records."""

    folder: Path
    campaign: Campaign
    summary: Summary
    demo: bool = False

    @property
    def channels(self) -> list[str]:
        """Names of the channels that any record holds."""
        return list(dict.fromkeys(name for record in self.campaign.records for name in record.channels))


class Refused(Exception):
    """An upload that cannot be used, in one line; what was there before stays."""


@dataclass
class Session:
    """State of one visitor; its files lie in a folder, below the server's, that is removed with it."""

    name: str
    root: Path | None = None
    open_pages: int = 0
    left: float = field(default_factory=time.monotonic)
    opened: Opened | None = None
    job: Job | None = None
    corrected: Model | None = None
    _count: int = 0

    def __post_init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="visitor-" if self.root else PREFIX, dir=self.root))

    def entered(self) -> None:
        """A page of this visitor is open."""
        self.open_pages += 1

    def gone(self) -> None:
        """A page of this visitor was closed, or has lost its connection."""
        self.open_pages = max(self.open_pages - 1, 0)
        self.left = time.monotonic()

    def is_abandoned(self, seconds: float) -> bool:
        """Whether nobody has looked for so long, and nothing is running."""
        running = self.job is not None and self.job.state == "running"
        return self.open_pages == 0 and not running and time.monotonic() - self.left > seconds

    def open_demo(self) -> None:
        """Take the campaign that ships with the package."""
        self._take(_opened(DEMO, demo=True))

    def open_folder(self, folder: Path) -> None:
        """Take a campaign where it lies."""
        try:
            self._take(_opened(folder))
        except CutvibError as error:
            raise Refused(" ".join(str(error).split())) from error

    def open_upload(self, files: Iterable[tuple[str, BinaryIO]]) -> None:
        """Take uploaded files; a campaign that cannot be read is refused, and the one that was open stays."""
        folder = self._new_folder("upload")
        try:
            self._take(_opened(store(files, folder)))
        except CutvibError as error:
            shutil.rmtree(folder, ignore_errors=True)
            raise Refused(message_of(error, folder)) from error
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise

    def diagnose(self, seed: int = 0, jobs: int = 1) -> Job:
        """Start the diagnosis of the open campaign; one that still runs is ended."""
        if self.opened is None:
            raise Refused("no campaign is open; upload one or take the demonstration")
        self._end_job()
        self.job = Job(self.opened.folder, self._new_folder("diagnosis"), seed, jobs)
        return self.job

    def result(self, name: str) -> Path | None:
        """A file of the diagnosis that is done."""
        if self.job is None or self.job.state != "done":
            return None
        return self.job.out / name

    def corrected_machine(self) -> Model | None:
        """The corrected model of the diagnosis that is done."""
        path = self.result(MACHINE)
        if path is not None and self.corrected is None:
            self.corrected = read_machine(path)
        return self.corrected

    def close(self) -> None:
        """End what runs and remove the files."""
        self._end_job()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _take(self, opened: Opened) -> None:
        self._end_job()
        before, self.opened = self.opened, opened
        if before is not None and self.folder in before.folder.parents:
            top = self.folder / before.folder.relative_to(self.folder).parts[0]
            shutil.rmtree(top, ignore_errors=True)

    def _end_job(self) -> None:
        if self.job is not None:
            self.job.cancel()
            shutil.rmtree(self.job.out, ignore_errors=True)
        self.job, self.corrected = None, None

    def _new_folder(self, what: str) -> Path:
        self._count += 1
        folder = self.folder / f"{what}-{self._count}"
        folder.mkdir()
        return folder


def server_folder() -> Path:
    """A folder for the visitors of this server, named after its process; those of servers that were killed are removed."""
    for old in Path(tempfile.gettempdir()).glob(f"{PREFIX}[0-9]*-*"):
        owner = old.name.removeprefix(PREFIX).partition("-")[0]
        if owner.isdigit() and not _is_alive(int(owner)):
            shutil.rmtree(old, ignore_errors=True)
    return Path(tempfile.mkdtemp(prefix=f"{PREFIX}{os.getpid()}-"))


def _is_alive(process: int) -> bool:
    if sys.platform == "win32":
        return True  # os.kill would end it
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _opened(folder: Path, demo: bool = False) -> Opened:
    campaign = read_campaign(folder)
    if not campaign.records:
        raise DataFormatError(f"{folder / 'campaign.toml'}: holds no records; add a [[record]] table for each")
    return Opened(folder, campaign, summarise(campaign), demo)
