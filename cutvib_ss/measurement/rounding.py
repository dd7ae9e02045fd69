"""
What the steps of a converter do to the responses of blows, where noise does not dither them.

A value is rounded to steps of q. Noise of half a step and more makes that white noise of q²/12, which scatter shows. Without it,
what rings on below half a step is lost, in every blow alike: an error that follows the signal and that no scatter shows. Of a
mode that dies out as A e^(-t/τ) from many steps down, the describing function of the steps integrates to (ln 2/π) q τ that its
spectrum lacks at the peak; with several modes, or with a rest that is not in the middle of a step, it is of that order, of either
sign.

Its size is found by rounding once more. Steps of 3q on values that lie on steps of q give exactly what a converter three times as
coarse had given (the thresholds of odd multiples are thresholds of the finer one; those of 2q would fall on the values). The
error that follows the signal scales with q, for all amplitudes have the same share of a decay: err(3q) = 3 err(q), so that H(3q)
- H(q) is twice that of H(q). With noise of standard deviation s it falls by exp(-2π² s²/q²) (Widrow and Kollár 2008, Quantization
Noise, on dither), at 3q by the ninth root of that, and the quotient changes accordingly. The white part of H(3q) - H(q) has been
seen as scatter of the blows, and is taken off.

Nor does rounding once more show what never moved a step: an AC-coupled force swings back by less than that, for seconds. While a
channel without dither stays on one step for d seconds its error has the variance q²/12 and, moving slowly, jumps by q where it
leaves the step: the transform of that has the power q² d²/12 at low frequencies and (q/ω)² at high ones, together
q² d²/(12 + (ω d)²) (`hidden_power`). Stays of one sample make up the white noise of rounding, which scatter shows, and are taken
off.

The error is a variance here and not taken out: its sign hangs on where in its step a channel rests, and a mode that is still
ringing at the end of a record, or that never moved a whole step, does not scale.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import special

from cutvib_ss.measurement.records import FORCE, Record
from cutvib_ss.results import ComplexArray, FloatArray

COARSER = 3
"""Steps of a converter that are put together to one, to see what its steps do: an odd number."""
DITHERED = 0.5
"""Standard deviation of noise over a step, from which rounding is noise itself: of what follows the signal 0.7 % is left."""
RINGING = 0.2
"""The same of what still rings at the end of a record, at most: it keeps itself from being lost, but less well than noise."""
SMOOTHED = 5
"""Lines over which the error is averaged: it has the width of a resonance."""

ORDERING = 0.15
"""Share from which what blows lose goes with their force as a law would: at noise of 0.12 steps it does, at 0.3 it does not."""

_MOST_STEPS = 4096  # within the largest value: more lose 1e-4 of a response, and 1e-2 of a mode of a hundredth of it
_FEWEST_SIZES = 4  # that values take without a step left out between them: others are a made-up signal
_FEWEST_OF_FORCE = 9  # steps within the largest force: of fewer nothing is left when three are made one
_MOST_OF_FORCE = 1024  # more lose 1e-3 of what follows a blow
_SAID = 256  # steps within the largest value, below which it is worth a word
_MOST_VALUES = 9  # at rest: noise of half a step takes five
_FEWEST_REST = 32  # samples before the blow that are looked at
_SAME = 1e-5  # of the largest value: what is nearer is one value but for its digits
_NEAR = 0.1  # of a step: printed digits and single precision leave a value so near to it
_SMALL = 64  # steps: larger values are rounded by few printed digits, too
_DIGITS = 1e-3  # of a value: three printed digits


@dataclass(frozen=True)
class Steps:
    """Steps of the converter of one channel in one blow."""

    size: float  # In the channel's unit; 0 where none are seen, or where they are fine
    rest: float  # The value that the others lie whole steps from
    largest: float = 0.0  # Largest value from there, in steps
    noise: float = np.inf  # Standard deviation over a step of what keeps values moving when the blow has died out

    @property
    def coarse(self) -> bool:
        """Whether rounding follows the signal."""
        return self.size > 0.0 and self.noise < DITHERED

    def counted(self, values: FloatArray) -> FloatArray:
        """Values in steps."""
        return np.asarray(np.round((values - self.rest) / self.size), dtype=np.float64)

    def coarser(self, values: FloatArray) -> FloatArray:
        """Values as a converter with steps so many times as large had shown them."""
        if not self.coarse:
            return values
        size = COARSER * self.size
        return np.asarray(self.rest + size * np.round((values - self.rest) / size), dtype=np.float64)

    @property
    def variance(self) -> float:
        """Mean square of the error that stays with a value as long as that does not move."""
        return float(self.size**2 / 12 * np.exp(-4 * np.pi**2 * self.noise**2)) if self.coarse else 0.0

    @property
    def share(self) -> float:
        """Error of H(q) that follows the signal, over H(3q) - H(q)."""
        if not self.coarse:
            return 0.0
        left = np.exp(2 * np.pi**2 * self.noise**2 * (1 - 1 / COARSER**2))
        return float(1 / (COARSER * left - 1))


NONE = Steps(0.0, 0.0)
"""Of what is rounded finely, or not at all."""


def steps_of(values: FloatArray, before: int = 0) -> Steps:
    """
    Steps of the converter behind the values of a channel in one blow, read off their spacing.

    Where the end of the record, or the rest of so many samples before the blow, takes many values, the steps are fine beside what
    moves there, and nothing else is looked at. Else all values have to be whole steps from one another: to a tenth of a step the
    small ones, to three digits the large ones. Offsets and gains do not matter.
    """
    parts = [values[-max(values.size // 8, 2) :]] + ([values[:before]] if before >= _FEWEST_REST else [])
    if any(np.unique(part).size > _MOST_VALUES for part in parts):
        return NONE
    rest = float(np.sort(parts[0])[parts[0].size // 2])
    moved = np.sort(np.abs(values - rest))
    largest = float(moved[-1])
    gaps = np.diff(np.concatenate([[0.0], moved]))
    gaps = gaps[gaps > _SAME * largest]
    if not gaps.size or float(np.min(gaps)) * _MOST_STEPS < largest:
        return NONE
    if gaps.size < _FEWEST_SIZES and float(np.ptp(gaps)) > _NEAR * float(np.min(gaps)):
        return NONE
    size = float(np.mean(gaps[gaps < 1.5 * np.min(gaps)]))
    for limit in (4, 16, _SMALL, 512, _MOST_STEPS):
        small = moved[moved < (limit + 0.5) * size]
        count = np.round(small / size)
        if np.any(count > 0):
            size = float(np.sum(count * small) / np.sum(count**2))
    off = np.abs(moved - size * np.round(moved / size))
    if np.any(off > np.maximum(_NEAR * size, np.where(moved > _SMALL * size, _DIGITS * moved, 0.0))):
        return NONE
    noise = [_dither(np.round((part - rest) / size)) for part in parts]
    # Where it is quiet before the blow, what moves at the end is ringing.
    return Steps(size, rest, largest / size, noise[0] if len(noise) == 1 else max(min(noise[0], RINGING), noise[1]))


def _dither(counts: FloatArray) -> float:
    """Standard deviation over a step of the noise that leaves so many steps from the middle one."""
    # Of Gaussian noise the distance between the thresholds on either side is one step: 1/s = z₊ + z₋, by the shares of what lies
    # beyond them; where its middle lies between them does not matter.
    middle = np.median(counts)
    beyond = [int(np.count_nonzero(side > 0)) for side in (counts - middle, middle - counts)]
    between = -sum(float(special.ndtri((n + 0.5) / (counts.size + 1))) for n in beyond)
    if between <= 0.0:
        return np.inf
    # Where nothing lies beyond one of them this is the most that s can be, and half of it is taken; where nothing lies beyond
    # either, too little moves to tell: 0.
    return 0.5 * sum(n > 0 for n in beyond) / between


def steps_in(record: Record, starts: Sequence[int]) -> dict[str, list[Steps]]:
    """Steps of the force and of each channel of a record of blows, blow by blow; samples before each blow are given."""
    found: dict[str, list[Steps]] = {name: [] for name in (FORCE, *record.channels)}
    for h, start in zip(record.histories, starts, strict=True):
        for name, values in zip(found, (h.force, *h.responses), strict=True):
            found[name].append(steps_of(values, start))
    return found


def _that_scale(steps: Mapping[str, list[Steps]]) -> dict[str, list[Steps]]:
    """The same, of a force only those that rounding once more tells of."""
    force = [s if _FEWEST_OF_FORCE <= s.largest <= _MOST_OF_FORCE else NONE for s in steps[FORCE]]
    return {**steps, FORCE: force}


def words_on_steps(records: Sequence[Record], starts: Sequence[Sequence[int]]) -> list[str]:
    """A word on the channels whose noise does not reach the steps of their converter: one of all records together."""
    files: dict[str, None] = {}
    channels: dict[str, list[float]] = {}
    for record, own in zip(records, starts, strict=True):
        for name, steps in _that_scale(steps_in(record, own)).items():
            for s in steps:
                if s.coarse and s.largest < _SAID:
                    files[record.name] = None
                    channels.setdefault(name, []).append(s.largest)
    if not files:
        return []
    each = ", ".join(f"{name} ({min(sizes):.0f} steps in the softest blow)" for name, sizes in channels.items())
    return [
        f"{next(iter(files))}{f' and {len(files) - 1} more' if len(files) > 1 else ''}: noise does not reach half a step of the "
        f"converter in {each}: what rings on below it is lost, and counts as uncertain; lower the range, or take more bits"
    ]


@dataclass(frozen=True)
class Coarser:
    """A record as converters with steps thrice as large had shown it: in the force, or in the responses."""

    record: Record
    shares: FloatArray  # Of H(3q) - H(q) that is the error of H(q) which follows the signal, by channel


def coarser(record: Record, steps: Mapping[str, list[Steps]]) -> tuple[Coarser, ...]:
    """The record rounded once more, in those of force and responses whose steps are coarse."""
    steps = _that_scale(steps)
    out = []
    force = _share(steps[FORCE])
    if force > 0.0:
        histories = tuple(
            replace(h, force=s.coarser(h.force)) for h, s in zip(record.histories, steps[FORCE], strict=True)
        )
        out.append(Coarser(replace(record, histories=histories), np.full(len(record.channels), force)))
    shares = _shares(record, steps)
    if np.any(shares > 0.0):
        histories = tuple(
            replace(
                h, responses=np.stack([steps[n][i].coarser(a) for n, a in zip(h.channels, h.responses, strict=True)])
            )
            for i, h in enumerate(record.histories)
        )
        out.append(Coarser(replace(record, histories=histories), shares))
    return tuple(out)


def hidden_power(record: Record, steps: Mapping[str, list[Steps]], freq: FloatArray, window: FloatArray) -> FloatArray:
    """
    Power of the transforms that channels hide while they stay on one step, mean of the blows; shape (force and channel, line).

    The unit is that of the transforms in `spectra_of_blows`, squared; `window` is theirs.
    """
    out = np.zeros((len(steps), freq.size))
    for power, (name, own) in zip(out, steps.items(), strict=True):
        for h, s in zip(record.histories, own, strict=True):
            if s.coarse:
                values = h.force if name == FORCE else h.responses[h.channels.index(name)]
                power += s.variance * _stays(s.counted(values[: window.size]), 1.0 / h.fs, freq, window)
    return out / len(record.histories)


def _stays(counts: FloatArray, dt: float, freq: FloatArray, window: FloatArray) -> FloatArray:
    """The same over the variance of the error [s^2], of counted steps."""
    begun = np.flatnonzero(np.diff(counts, prepend=np.nan, append=np.nan))
    lengths, which = np.unique(np.diff(begun), return_inverse=True)
    # A window lets late stays count less.
    weights = np.bincount(which, window[(begun[1:] + begun[:-1]) // 2] ** 2)
    seconds = lengths[:, None] * dt
    power = weights @ (seconds**2 / (1.0 + (2 * np.pi * freq * seconds) ** 2 / 12))
    return np.asarray(np.maximum(power - weights @ lengths * dt**2, 0.0))


def orders_by_rounding(record: Record, starts: Sequence[int]) -> np.ndarray:
    """Of each channel of a record of blows whether what rounding loses goes with their force."""
    return np.asarray(_shares(record, steps_in(record, starts)) >= ORDERING)


def _shares(record: Record, steps: Mapping[str, list[Steps]]) -> FloatArray:
    return np.array([_share(steps[name]) for name in record.channels])


def _share(steps: list[Steps]) -> float:
    """Root mean square over the blows."""
    return float(np.sqrt(np.mean([s.share**2 for s in steps])))


def rounding_error(fine: ComplexArray, coarse: ComplexArray, seen: FloatArray | None, shares: FloatArray) -> FloatArray:
    """
    Mean square of the error of H(q) that scatter has not shown, shape (channel, frequency).

    `seen` is the variance of H(3q) - H(q) by the scatter of blows; None of a single blow, whose white part, with an eighth of the
    power of that of the difference, has shown nowhere. The largest of a line and its neighbours' mean counts: the difference
    passes through zero beside a resonance, where the error need not.
    """
    power = np.abs(coarse - fine) ** 2
    kernel = np.full(SMOOTHED, 1.0 / SMOOTHED)
    mean = np.stack([np.convolve(np.pad(p, SMOOTHED // 2, mode="edge"), kernel, mode="valid") for p in power])
    power = np.maximum(power, mean)
    following = shares[:, None] ** 2
    if seen is None:
        white = np.where(following > 0.0, 1 / (COARSER**2 - 1), 0.0)
        return np.asarray(power * (following + white), dtype=np.float64)
    return np.asarray(np.maximum(power - seen, 0.0) * following, dtype=np.float64)
