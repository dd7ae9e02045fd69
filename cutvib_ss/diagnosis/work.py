"""How much a diagnosis has computed: counted where models are evaluated, so that it is the same on every machine."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from typing import Any, TypeVar

ResultT = TypeVar("ResultT")

# One count for each thread, and for each process.
_DONE: ContextVar[float] = ContextVar("work", default=0.0)


def count(derivatives: float) -> None:
    """Add to what has been done, in derivatives of values of a response, or in what takes as long."""
    _DONE.set(_DONE.get() + derivatives)


def done() -> float:
    """All that has been done in this thread."""
    return _DONE.get()


def counted(work: Callable[..., ResultT], *arguments: Any) -> tuple[ResultT, float]:
    """A result, and how much it took."""
    before = done()
    return work(*arguments), done() - before
