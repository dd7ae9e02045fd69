"""
One case at a time, in a process, a folder and an environment of its own.

Tasks take and give plain values and bytes, so that a thread here or a worker of a cluster can run them alike; only the trial's
own process touches the trial's folder.
"""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

from cutvib_ss.errors import CutvibError, ParameterError
from cutvib_ss.validation.files import PACKAGE, now, packed, unpack
from cutvib_ss.validation.plan import Request

TaskT = TypeVar("TaskT")
ResultT = TypeVar("ResultT")

LABEL, CAMPAIGN, FRESH = "label.json", "campaign", "fresh"
DIAGNOSIS, MACHINE, USAGE = "diagnosis.json", "corrected.toml", "usage.json"
_TOLD = 2000
"""Characters of a failed process's last words that are kept."""


class RigError(CutvibError):
    """The rig could not make a case."""


@dataclass(frozen=True)
class Made:
    """A case as the rig made it."""

    label: dict[str, Any]  # What is wrong with the machine
    campaign: bytes  # Archive of the campaign's folder
    fresh: bytes | None = None  # Archive of records for the score alone


@dataclass(frozen=True)
class Outcome:
    """What became of a diagnosis."""

    status: Literal["done", "failed", "timeout"]  # Whether there is a diagnosis
    exit_status: int | None  # Of the process; None where it was stopped
    started: str  # ISO 8601, UTC
    finished: str
    seconds: float  # Wall clock, and time on one core, start-up included
    cpu_seconds: float | None
    code_sha256: str | None  # Hash of the code that diagnosed
    host: str  # Machine that diagnosed
    message: str  # Last words on standard error
    diagnosis: bytes | None  # The JSON
    machine: bytes | None = None  # The corrected model as a machine.toml

    def record(self) -> dict[str, Any]:
        """All but diagnosis and model themselves."""
        return {name: value for name, value in asdict(self).items() if name not in ("diagnosis", "machine")}


Rig: TypeAlias = Callable[[Request], Made]
Diagnoser: TypeAlias = Callable[[bytes], Outcome]


def rig_case(request: Request) -> Made:
    """Make a case with the package's rig, in a process of its own: a solver that crashes takes nothing else along."""
    with tempfile.TemporaryDirectory(prefix="cutvib-") as name:
        folder = Path(name)
        ended = subprocess.run(
            [sys.executable, "-m", "cutvib_ss.validation.draw", json.dumps(asdict(request))],
            cwd=folder, env=clean_environment(folder), capture_output=True, text=True, errors="replace", check=False,
        )  # fmt: skip
        if ended.returncode:
            raise RigError(f"the rig failed on {request}: {ended.stderr[-_TOLD:].strip()}")
        fresh = packed(folder / FRESH) if (folder / FRESH).is_dir() else None
        return Made(json.loads((folder / LABEL).read_text()), packed(folder / CAMPAIGN), fresh)


def diagnosed(archive: bytes, forbidden: Sequence[str] = (), timeout: float | None = None) -> Outcome:
    """Diagnose a campaign in a process of its own that knows nothing of the trial."""
    with tempfile.TemporaryDirectory(prefix="cutvib-") as name:
        folder = Path(name)
        unpack(archive, folder / CAMPAIGN)
        command = [
            sys.executable, "-m", "cutvib_ss.validation.confined", USAGE, *forbidden, "--",
            "diagnose", CAMPAIGN, "--json", DIAGNOSIS, "--save-machine", MACHINE,
        ]  # fmt: skip
        started, clock = now(), time.perf_counter()
        exit_status, said = alone(command, folder, folder, timeout)
        seconds = time.perf_counter() - clock
        done = exit_status == 0 and (folder / DIAGNOSIS).is_file()
        usage = json.loads((folder / USAGE).read_text()) if (folder / USAGE).is_file() else {}
        return Outcome(
            status="done" if done else "timeout" if exit_status is None else "failed",
            exit_status=exit_status,
            started=started,
            finished=now(),
            seconds=seconds,
            cpu_seconds=usage.get("cpu_seconds"),
            code_sha256=usage.get("code_sha256"),
            host=platform.node(),
            message=said,
            diagnosis=(folder / DIAGNOSIS).read_bytes() if done else None,
            machine=(folder / MACHINE).read_bytes() if done else None,
        )


def alone(command: Sequence[str], cwd: Path, temporary: Path, timeout: float | None = None) -> tuple[int | None, str]:
    """Run a program by itself: its exit status, None where its time was up, and its last words on standard error."""
    try:
        ended = subprocess.run(
            command, cwd=cwd, env=clean_environment(temporary), stdin=subprocess.DEVNULL, timeout=timeout,
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        return None, _last_words(error.stderr or b"")
    if ended.returncode in (130, -2, -15):
        raise KeyboardInterrupt  # stopped from outside: as if never begun
    return ended.returncode, _last_words(ended.stderr)


def _last_words(said: bytes) -> str:
    return said.decode(errors="replace")[-_TOLD:].strip()


def clean_environment(folder: Path) -> dict[str, str]:
    """An environment that holds nothing but what a program needs to start."""
    # Windows programs do not start without SYSTEMROOT.
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "SYSTEMROOT") if name in os.environ}
    own = dict.fromkeys(("HOME", "USERPROFILE", "TMPDIR", "TEMP", "TMP", "MPLCONFIGDIR"), str(folder))
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    # The package as it runs here, wherever it was started from; its folder's parent holds nothing of the trial.
    return {**kept, **own, **threads, "PYTHONPATH": str(PACKAGE.parent), "PYTHONSAFEPATH": "1"}


def spread(
    work: Callable[[TaskT], ResultT], tasks: Iterable[tuple[str, Callable[[], TaskT]]], jobs: int, scheduler: str | None
) -> Iterator[tuple[str, ResultT]]:
    """Run tasks side by side and give their results as they come."""
    if scheduler is None:
        pool = ThreadPoolExecutor(jobs)
        try:
            yield from _in_turn(pool.submit, _wait_here, work, tasks, jobs)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
        return
    client = _client(scheduler)
    try:
        # Workers of a cluster are kept busy with one task in work and one waiting.
        ahead = max(jobs, 2 * sum(client.nthreads().values()))
        yield from _in_turn(partial(client.submit, pure=False), _wait_there, work, tasks, ahead)
    finally:
        client.close()


def _in_turn(
    submit: Callable[..., Any],
    first_done: Callable[[Iterable[Any]], Iterable[Any]],
    work: Callable[[TaskT], ResultT],
    tasks: Iterable[tuple[str, Callable[[], TaskT]]],
    ahead: int,
) -> Iterator[tuple[str, ResultT]]:
    """No more than a few archives are held at a time."""
    left = iter(tasks)
    running: dict[Any, str] = {}
    while True:
        while len(running) < ahead and (task := next(left, None)) is not None:
            running[submit(work, task[1]())] = task[0]
        if not running:
            return
        for future in first_done(list(running)):
            yield running.pop(future), future.result()


def _wait_here(futures: Iterable[Any]) -> Iterable[Any]:
    return wait(futures, return_when=FIRST_COMPLETED).done


def _wait_there(futures: Iterable[Any]) -> Iterable[Any]:
    done: Iterable[Any] = import_module("distributed").wait(list(futures), return_when="FIRST_COMPLETED").done
    return done


def _client(scheduler: str) -> Any:
    try:
        distributed = import_module("distributed")
    except ImportError:
        raise ParameterError('--scheduler needs Dask: pip install "cutvib_ss[cluster]"') from None
    try:
        return distributed.Client(scheduler, timeout=20)
    except (OSError, ValueError) as error:
        raise ParameterError(f"--scheduler {scheduler}: no Dask scheduler answers there ({error})") from error
