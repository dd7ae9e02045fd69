"""Blocks into which a continuous recording is cut (Welch's method)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.records import Record
from cutvib_ss.results import FloatArray


def welch_blocks(record: Record, block: float | None = None, overlap: float = 0.5) -> tuple[int, int]:
    """Blocks into which a continuous recording is cut."""
    fs = record.histories[0].fs
    shortest = min(history.force.size for history in record.histories)
    seconds = record.block if block is None else block
    size = 2 ** int(np.log2(max(shortest / 16, 16))) if seconds is None else round(seconds * fs)
    if not 4 <= size <= shortest:
        raise ParameterError(
            f"record {record.name!r}: a block of {size} samples does not fit its {shortest}; choose `block` of "
            f"{4 / fs:g} to {shortest / fs:g} s"
        )
    if not 0 <= overlap < 1:
        raise ParameterError(f"overlap {overlap} must be at least 0 and below 1")
    return size, int(overlap * size)


def without_run_in(record: Record) -> tuple[Record, int]:
    """
    A continuous recording without its first half block, and the samples left out: what moved before it is not known.

    One of less than four blocks is left as it is.
    """
    size, _ = welch_blocks(record)
    if min(h.force.size for h in record.histories) < 4 * size:
        return record, 0
    begin = size // 2
    cut = tuple(replace(h, force=h.force[begin:], responses=h.responses[:, begin:]) for h in record.histories)
    return replace(record, histories=cut, block=size / record.histories[0].fs), begin


def effective_averages(window: FloatArray, step: int, count: int) -> float:
    """Independent averages that overlapped blocks are worth."""
    energy = float(np.sum(window**2))
    shared = 0.0
    for k in range(1, min(count, -(-window.size // step))):
        together = float(np.sum(window[k * step :] * window[: window.size - k * step])) / energy
        shared += 2 * (1 - k / count) * together**2
    return count / (1 + shared)
