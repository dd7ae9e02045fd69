"""Fits that do not depend on each other, in several processes."""

from __future__ import annotations

import copyreg
import math
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context, parent_process
from threading import Thread, current_thread, main_thread
from types import MappingProxyType, TracebackType
from typing import Any, TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from cutvib_ss.diagnosis.work import count, counted, done
from cutvib_ss.effects.base import Effect
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.errors import ParameterError

ResultT = TypeVar("ResultT")


def _read_only(table: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(table)


def _reduced(table: MappingProxyType[Any, Any]) -> tuple[Callable[..., Any], tuple[dict[Any, Any]]]:
    # The type itself has no name by which another process could find it.
    return _read_only, (dict(table),)


# Models keep their tables read-only, which pickle does not know by itself.
copyreg.pickle(MappingProxyType, _reduced)


_KEPT = 31 * 2**20
"""Bytes of a block from which the C library learns to keep what is freed; it learns from none above 32 MiB."""


def _keep_memory() -> None:
    """Have freed memory kept: the system would clear every page of it anew, which takes as long as the sums in it."""
    # glibc gives back blocks larger than the largest that it has seen freed, which is 128 KiB before.
    np.empty(_KEPT, dtype=np.uint8)


def _start(registered: tuple[type[Effect], ...]) -> None:
    threadpool_limits(1)
    _keep_memory()
    for kind in registered:
        EFFECTS.register(kind)
    Thread(target=_end_with_parent, daemon=True).start()


def _registered() -> tuple[type[Effect], ...]:
    """Effects registered by call, which other processes must be able to import."""
    for kind in EFFECTS.registered:
        interactive = kind.__module__ == "__main__" and not hasattr(sys.modules["__main__"], "__file__")
        if interactive or "<locals>" in kind.__qualname__:
            raise ParameterError(
                f"the effect {kind.effect!r} cannot be found by other processes: put its class at the top of a module, "
                "or ask for one process (jobs = 1)"
            )
    return EFFECTS.registered


def _end_with_parent() -> None:
    # A parent that is killed tells nobody, and its workers would wait for more to do for ever.
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _not_interrupted() -> Iterator[None]:
    """Processes started here inherit that they ignore Ctrl-C: the parent ends them, without a traceback of each."""
    if current_thread() is not main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


class Workers:
    """
    A pool of processes that starts when it is first needed; with one job the work is done here.

    Processes are spawned, not forked: threads of the numerical libraries would be copied in the middle of their work. A script
    that asks for more than one therefore needs its ``if __name__ == "__main__":``. Results do not depend on their number.

    Steps that can be done without are left out once as much has been computed as the limit says.
    """

    def __init__(self, jobs: int = 1, progress: Callable[[str], None] | None = None, limit: float = math.inf) -> None:
        self.jobs = jobs
        self.left_out: dict[str, None] = {}  # Steps, in order
        self._begun, self._limit = done(), limit
        self._progress = progress
        self._step = ""
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> Workers:
        _keep_memory()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is None:
            return
        if error is not None and not isinstance(error, Exception):
            # Stopped from the keyboard: what still runs is wanted by nobody.
            for process in list((getattr(self._pool, "_processes", None) or {}).values()):
                process.terminate()
        self._pool.shutdown(cancel_futures=True)

    def say(self, step: str) -> None:
        """Tell what is being done from here on."""
        self._step = step
        if self._progress is not None:
            self._progress(step)

    def begin(self, step: str, of_limit: float = 1.0) -> bool:
        """
        Begin a step that can be done without, and tell of it.

        False, and noted as left out, once this part of the limit is done.
        """
        if done() - self._begun > of_limit * self._limit:
            self.left_out[step] = None
            return False
        self.say(step)
        return True

    def _counted(self, results: Iterable[ResultT], total: int) -> list[ResultT]:
        """Results as they come, each told."""
        out = []
        for result in results:
            out.append(result)
            if self._progress is not None:
                self._progress(f"{self._step}: {len(out)} of {total}")
        return out

    def map(self, work: Callable[..., ResultT], *columns: Iterable[Any]) -> list[ResultT]:
        """Results of some work in order, as of `map`; the first error is raised."""
        rows = list(zip(*columns, strict=True))
        if self.jobs == 1 or len(rows) < 2:
            return self._counted((work(*row) for row in rows), len(rows))
        if self._pool is None:
            self._pool = ProcessPoolExecutor(
                self.jobs, mp_context=get_context("spawn"), initializer=_start, initargs=(_registered(),)
            )
        # What the work shares goes along with every chunk: few chunks, yet some to even out.
        with _not_interrupted():
            chunk = max(1, len(rows) // (3 * self.jobs))
            found = self._pool.map(partial(counted, work), *zip(*rows, strict=True), chunksize=chunk)
        out = self._counted(found, len(rows))
        count(sum(values for _, values in out))
        return [result for result, _ in out]
