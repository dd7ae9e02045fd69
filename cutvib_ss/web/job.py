"""A diagnosis that runs beside the page: started, asked how far it is, cancelled."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, TypeAlias

from cutvib_ss.web.uploads import message_of
from cutvib_ss.web.worker import MACHINE, REPORT, RESULT

State: TypeAlias = Literal["running", "done", "failed", "cancelled"]


@dataclass(frozen=True)
class Progress:
    """One line of progress: seconds since the start, and what is being done."""

    seconds: float
    text: str


@dataclass
class Job:
    """A diagnosis in a process of its own; its results lie in a folder once it is done."""

    campaign: Path
    out: Path
    seed: int = 0
    jobs: int = 1
    lines: list[Progress] = field(default_factory=list)
    outcome: dict[str, Any] = field(default_factory=dict)
    error: str = ""
    _cancelled: bool = False
    _ended: float | None = None

    def __post_init__(self) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        self._started = time.monotonic()
        command = [sys.executable, "-m", "cutvib_ss.web.worker", str(self.campaign), str(self.out)]
        # The package as it is imported here, wherever the server was started.
        paths = [str(Path(__file__).resolve().parents[2]), os.environ.get("PYTHONPATH", "")]
        self._process = subprocess.Popen(
            [*command, str(self.seed), str(self.jobs)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
            env={**os.environ, "PYTHONPATH": os.pathsep.join(p for p in paths if p)},
            start_new_session=True,
        )  # fmt: skip
        self._readers = [threading.Thread(target=read, daemon=True) for read in (self._read, self._read_faults)]
        self._faults: list[str] = []
        for reader in self._readers:
            reader.start()

    @property
    def state(self) -> State:
        """Where it stands."""
        status = self._process.poll()
        if status is None:
            return "running"
        if self._ended is None:
            self._ended = time.monotonic()
            self._close()
        if self._cancelled:
            return "cancelled"
        if status == 0 and self.outcome and all((self.out / n).is_file() for n in (REPORT, RESULT, MACHINE)):
            return "done"
        if not self.error:
            last = self._faults[-1] if self._faults else f"its process ended with status {status}"
            self.error = f"a fault of the program, not of the input: {last}"
        return "failed"

    @property
    def seconds(self) -> float:
        """Time since the start, or that it took."""
        return (self._ended if self._ended is not None else time.monotonic()) - self._started

    @property
    def process_id(self) -> int:
        """Of the process, for whoever wants to see that it is gone."""
        return self._process.pid

    def cancel(self) -> None:
        """End the process and those that it started; a diagnosis that is done stays done."""
        if self._process.poll() is None:
            self._cancelled = True
            self._kill()
        _ = self.state  # which closes its pipes

    def _kill(self) -> None:
        if hasattr(os, "killpg"):
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        else:  # its own processes end with their parent's pipe
            self._process.kill()
        self._process.wait(10.0)

    def _close(self) -> None:
        for reader in self._readers:
            reader.join(5.0)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            try:
                told = json.loads(line)
            except json.JSONDecodeError:
                continue
            if "verdict" in told:
                self.outcome = told
            elif "error" in told:
                self.error = message_of(ValueError(told["error"]), self.campaign)
            elif "fault" in told:
                self.error = f"a fault of the program, not of the input: {told['fault']}"
            else:
                self._told(told["step"])

    def _told(self, said: str) -> None:
        """Note a step as it begins; what follows a colon is how far it has come, and takes the place of what was said before."""
        last = self.lines[-1] if self.lines else None
        if last is not None and last.text.partition(":")[0] == said.partition(":")[0]:
            self.lines[-1] = Progress(last.seconds, said)
        else:
            self.lines.append(Progress(time.monotonic() - self._started, said))

    def _read_faults(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            if line.strip():
                self._faults = [*self._faults[-19:], line.strip()]
