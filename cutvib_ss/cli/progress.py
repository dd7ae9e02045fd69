"""What is being done, on standard error: one line that changes on a terminal, plain lines elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread

from rich.status import Status

from cutvib_ss.cli.output import messages

_EVERY = 10.0
"""Seconds after which a plain line repeats how far a step has come."""


class Progress:
    """Steps of a long piece of work as they begin, with the time since the start."""

    def __init__(self, status: Status | None) -> None:
        self._status = status
        self._start = self._shown = self._begun = time.monotonic()
        self._step, self._said = "", ""

    def __call__(self, said: str) -> None:
        """Say what is being done; what follows a colon is how far it has come."""
        step, _, count = said.partition(":")
        now = time.monotonic()
        if step != self._step:
            self._begun = now
        self._said = said = said + remaining(count, now - self._begun)
        if self._status is not None:
            self.tick()
        elif step != self._step or (count and now - self._shown >= _EVERY):
            sys.stderr.write(f"{self._elapsed():>6} {said if count and step == self._step else step}\n")
            sys.stderr.flush()
            self._shown = now
        self._step = step

    def tick(self) -> None:
        """Show the time that has passed."""
        if self._status is not None and self._said:
            self._status.update(f"{self._elapsed()} {self._said}".replace("[", "\\["))

    def _elapsed(self) -> str:
        return _clock(time.monotonic() - self._start)


def remaining(count: str, passed: float) -> str:
    """
    How long a step will take on, judged by its rate so far; nothing where it has no count or is over.

    >>> remaining(" 8 of 32", 20.0)
    ', about 1:00 more'
    >>> remaining("", 20.0)
    ''
    """
    done, of, total = count.strip().partition(" of ")
    if not of or not (done.isdigit() and total.isdigit()) or not 0 < int(done) < int(total):
        return ""
    return f", about {_clock(passed * (int(total) - int(done)) / int(done))} more"


def _clock(seconds: float) -> str:
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


@contextmanager
def progress() -> Iterator[Progress]:
    """A callback for `diagnose`, for as long as the block lasts."""
    console = messages()
    if not console.is_terminal:
        yield Progress(None)
        return
    done = Event()
    with console.status("") as status:
        shown = Progress(status)

        def run() -> None:
            while not done.wait(1.0):
                shown.tick()

        clock = Thread(target=run, daemon=True)
        clock.start()
        try:
            yield shown
        finally:
            done.set()
            clock.join()
