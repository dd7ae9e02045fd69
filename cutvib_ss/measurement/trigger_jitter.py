"""
Trigger jitter: force and responses recorded by devices that start together only about.

The responses of blow b are late by a τ_b of its own, so that A_b = H F_b e^(-iωτ_b) + noise. To first order a blow is off H1 by
-iωτ_b H1: unlike a gain, it turns the phase, at all lines in proportion to frequency. Aligned, the blows of a record scatter as
their sensors do; how late all of them are together stays unknown, with the standard deviation of one over the root of their number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from cutvib_ss.measurement.blow_noise import deviations
from cutvib_ss.measurement.records import History, Record
from cutvib_ss.results import FloatArray

JITTER = "trigger jitter"
"""What is said of it begins so."""

_CHANCE = 1e-4  # that blows that are not late differ as much
_PASSES = 2  # beyond first order: a delay of a radian is followed to a hundredth
_SHARE = 0.5  # of the scatter over the sensors' noise that delays explain at least: a hand, or drift, does not


@dataclass(frozen=True)
class TriggerJitter:
    """How late the responses of the blows of some records are."""

    std: float  # Standard deviation of a blow's delay [s]
    delays: tuple[FloatArray, ...]  # Of each record's blows, about their mean [s]; empty of other records

    @property
    def words(self) -> str:
        """What is said of it."""
        return (
            f"{JITTER}: the responses are late by {1e6 * self.std:.3g} us more or less from blow to blow; blows are aligned, "
            "and the mean delay of a record counts as unknown; record force and responses on one device"
        )

    def of_mean(self, record: int) -> float:
        """Standard deviation of the mean delay of a record [s]."""
        count = self.delays[record].size
        return self.std / count**0.5 if count else 0.0


def trigger_jitter(records: Sequence[Record]) -> TriggerJitter | None:
    """Jitter that all records of blows show together; None where they show none."""
    delays = [_Delays(r) if r.kind == "impact" else None for r in records]
    told = [d for d in delays if d is not None and d.freedom > 0 and np.isfinite(d.variance)]
    # What goes with the peak force is a structure's that is not linear; of two blows everything does.
    freedom = sum(d.freedom - 1 for d in told)
    if not freedom or stats.chi2.sf(sum(d.explained for d in told), freedom) > _CHANCE:
        return None
    # A window may leave less than the sensors' noise before the blow: then nothing scatters over it.
    excess = sum(d.excess for d in told)
    if excess <= 0.0 or sum(d.explained for d in told) < _SHARE * excess:
        return None
    # Blows of equal spread, whose delays are told unequally well.
    weight = np.array([d.freedom / d.variance**2 for d in told])
    spread = np.array([float(np.sum(d.each**2)) / d.freedom - d.variance for d in told])
    std = float(np.sqrt(max(weight @ spread / weight.sum(), 0.0)))
    followed = [np.zeros(0) if d is None else _followed(r, d.each) for r, d in zip(records, delays, strict=True)]
    return TriggerJitter(std, tuple(followed)) if std > 0.0 else None


def _followed(record: Record, delays: FloatArray) -> FloatArray:
    """Delays beyond first order: again where the blows have been aligned."""
    for _ in range(_PASSES):
        delays = delays + _Delays(aligned(record, delays)).each
    return delays


def aligned(record: Record, delays: FloatArray) -> Record:
    """A record of blows with their responses early by as much as they were late."""
    if not delays.size:
        return record
    shifted = [_early(h, float(late)) for h, late in zip(record.histories, delays, strict=True)]
    return replace(record, histories=tuple(shifted))


class _Delays:
    """Delays of a record's blows about their mean, by least squares over the sensors' noise."""

    def __init__(self, record: Record) -> None:
        freq, h, off, single, heard, peaks = deviations(record)
        self.freedom = len(off) - 1 if heard.any() else 0
        self.each, self.variance, self.explained, self.excess = np.zeros(len(off)), np.inf, 0.0, 0.0
        if not self.freedom:
            return
        off, weight = off[..., heard], 1.0 / single[:, heard]
        late = -2j * np.pi * freq[heard] * h[:, heard]
        told = float(np.sum(weight * np.abs(late) ** 2))
        self.each = np.sum(weight * (late.conj() * off).real, axis=(1, 2)) / told
        self.each -= self.each.mean()
        self.variance = 0.5 / told
        order = peaks - peaks.mean()
        order /= max(float(np.linalg.norm(order)), 1e-300)
        beside = self.each - order * float(order @ self.each)
        off = off - np.multiply.outer(order, np.tensordot(order, off, 1))
        self.explained = float(np.sum(beside**2)) * 2.0 * told
        self.excess = 2.0 * (float(np.sum(weight * np.abs(off) ** 2)) - (self.freedom - 1) * off[0].size)


def _early(history: History, delay: float) -> History:
    """A blow whose responses come earlier by a delay [s]."""
    count, more = history.force.size, history.force.size // 2
    # Carried on at either end as a trend that turns about it: the transform wraps around.
    wide = np.pad(history.responses, ((0, 0), (more, more)), mode="reflect", reflect_type="odd")
    freq = np.fft.rfftfreq(wide.shape[1], 1 / history.fs)
    shifted = np.fft.irfft(np.fft.rfft(wide) * np.exp(2j * np.pi * freq * delay), wide.shape[1])
    return replace(history, responses=shifted[:, more : more + count])
