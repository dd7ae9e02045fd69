"""
Estimated responses of blows at an unknown instant, brought to one that is known.

A block of length T that begins t₀ before the blow holds the impulse response up to T - t₀. The inverse transform of its lines shows
that: a response that has not died out ends there. Trigger and hand set t₀ anew in every record, and of the blows behind one
estimate each has its own; what is cut off of a slow mode changes with all of these. Cut once more, all at one instant
before the first of them ends, the impulse responses are what a block with a known t₀ shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.results import ComplexArray, FloatArray, MeasuredFrequencyResponse

ALIVE = 10.0
"""Power before the end of an impulse response over that after it, from which the end is seen."""
_LATE = 0.8  # of the block: an end is looked for after it
_SMEARED = 5  # samples of the inverse transform over which the end of the band smears what is sharp in time
_FINER = 16  # samples for each of those where responses are cut: an end between two samples would come back as an alias
_MOST_SAMPLES = 2**22  # of that finer grid
_FEWEST_LINES = 64


def with_one_instant(responses: Sequence[MeasuredFrequencyResponse]) -> list[MeasuredFrequencyResponse]:
    """The responses, those of blows at an unknown instant cut at one where their ends are seen; others as they are."""
    ends = [_end(r) for r in responses]
    instants = [r.estimator.block - end for r, end in zip(responses, ends, strict=True) if end is not None]
    return [r if end is None else _cut(r, end, max(instants)) for r, end in zip(responses, ends, strict=True)]


def _impulse(r: MeasuredFrequencyResponse, finer: int = 1) -> tuple[FloatArray, np.ndarray] | None:
    """Impulse responses on a circle as long as the block, shape (channel, sample), and the lines; None where lines are left out."""
    count = r.freq.size
    if (
        r.estimator.blow_at is not None
        or not np.isfinite(r.estimator.block)
        or r.estimator.exponential_decay
        or count < _FEWEST_LINES
    ):
        return None
    lines = np.round(r.freq * r.estimator.block).astype(int)
    whole = np.abs(r.freq * r.estimator.block - lines).max() < 1e-3
    if not whole or lines[0] > 1 or np.any(np.diff(lines) != 1):
        return None
    # Of a band that ends at once the blow would ring all round the circle.
    spectrum: ComplexArray = np.zeros((len(r.outputs), lines[-1] + 1), dtype=np.complex128)
    spectrum[:, lines] = r.data[0, :, 0] * _tapered(int(lines[-1]))[lines]
    return finer * np.fft.irfft(spectrum, 2 * finer * int(lines[-1])), lines


def _end(r: MeasuredFrequencyResponse) -> float | None:
    """Where the impulse responses end [s]; None where no end is seen."""
    found = _impulse(r)
    if found is None:
        return None
    impulse, _ = found
    late = impulse[:, int(_LATE * impulse.shape[1]) : -_SMEARED]
    size = late.shape[1]
    before, after = np.cumsum(late**2, axis=1), np.cumsum(late[:, ::-1] ** 2, axis=1)[:, ::-1]
    # A line at zero that is missing, or an input coupled to AC, moves the whole circle.
    moved = np.cumsum(late[:, ::-1], axis=1)[:, ::-1]
    left = np.arange(size, 0, -1)
    after = np.maximum(after - moved**2 / left, 1e-300)
    at = np.arange(2 * _SMEARED, size - 2 * _SMEARED)
    one, two = before[:, at - 1] / at, after[:, at] / left[at]
    cost = np.sum(at * np.log(one) + left[at] * np.log(two), axis=0)
    k = int(np.argmin(cost))
    # What dies out by itself has no end: just before it there is as much as ever.
    last = np.mean(late[:, at[k] - 2 * _SMEARED : at[k] - _SMEARED // 2] ** 2)
    if k == 0 or last < ALIVE * np.mean(two[:, k]):
        return None
    return float((impulse.shape[1] - _SMEARED - size + at[k]) / impulse.shape[1] * r.estimator.block)


def _tapered(last: int) -> FloatArray:
    """Weight of lines up to the last that falls off over the upper half of the band."""
    return np.cos(0.5 * np.pi * np.clip(2.0 * np.arange(last + 1) / last - 1.0, 0.0, 1.0)) ** 2


def _cut(r: MeasuredFrequencyResponse, end: float, blow_at: float) -> MeasuredFrequencyResponse:
    """The response as a block shows it whose blow is at an instant, or by what an end is smeared later."""
    finer = max(min(_FINER, _MOST_SAMPLES // (2 * r.freq.size)), 1)
    found = _impulse(r, finer)
    assert found is not None
    impulse, lines = found
    count, block, smeared = impulse.shape[1], r.estimator.block, finer * _SMEARED
    first, last = int((1.0 - blow_at / block) * count) - 2 * smeared, count - smeared
    silent = impulse[:, int(end / block * count) + smeared : last]
    lost = np.zeros_like(impulse)
    lost[:, first:last] = impulse[:, first:last] - silent.mean(axis=1, keepdims=True)
    data = r.data.copy()
    data[0, :, 0] -= np.fft.rfft(lost)[:, lines] / finer
    # A sample stands for the time around it.
    at = block * (1.0 - (first - 0.5) / count)
    return replace(r, data=data, estimator=replace(r.estimator, blow_at=at))
