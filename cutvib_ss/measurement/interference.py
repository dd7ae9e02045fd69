"""
Interference: tones of the mains or of a fan, which a structure does not make, and what of the records they leave.

A tone that goes on through a blow has no phase in common with it. Its transform is a peak as wide as the lines are apart, with
skirts that fall with the square of the distance: of a peak of power P over the noise P/(2π²n²) is left n lines beside it, without
a window. The variance of a response, smooth as its noise is taken to be, holds neither peak nor skirts, and causes would be fitted
to them. A tone is told by what scatters from blow to blow: where that peaks and the response, beyond what so much scatter does to
it, does not. Of a recording that is cut into blocks what leaks from these scatters at a resonance, too, where the response itself
stands out. Without scatter a tone is told at the mains alone, by peaks at several multiples of 50 or 60 Hz.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import stats

from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse

TONES = "interference"
"""What is said of it begins so."""

_APART = np.array([1.0, 0.0, -4.0, 0.0, 6.0, 0.0, -4.0, 0.0, 1.0])
"""A fourth difference over every second line: a resonance is smooth for it, a tone under a Hann window is not."""
_OF_TONE = float(np.max(_APART) ** 2 / np.sum(_APART**2))
_MAINS = 50.0, 60.0  # Hz
_LINES = 1.5  # that a tone's peak may lie off its frequency
_WANDERS = 2e-3  # of their frequency, by which the mains do: interconnected grids hold 50 ± 0.1 Hz nearly always
_STANDS_OUT = 5.0  # times the noise power: a tone does, and has fallen from it so far where it has ended
_BESIDE = 3, 6  # lines to either side of a tone's peak where it has fallen to a 25th and less
_CHANCE = 1e-3  # that noise stands out as much: anywhere, or at one multiple
_OF_SCATTER = 8.0  # of a peak's power over what scatters there: a tone's is one, a resonance's tens and more
_AT_RESONANCE = 1.5  # times the power of what leaks there is that of the response; a tone makes it once, on average
_SOFT = 0.25  # of the records, that show a tone least
_MULTIPLES = 3  # of the mains that have to stand out: a resonance may lie on one by chance
_SKIRTS = 0.25  # of the noise power, to which a tone's skirts are left out
_WIDEST = 12.0  # Hz that skirts are followed to


@dataclass(frozen=True)
class Interference:
    """Tones in a campaign's records."""

    widths: dict[float, float]  # Of each tone's frequency [Hz] half the width of the lines that it spoils [Hz]
    excess: float  # What they add to the mean square of a right model's residual, over the noise
    mains: float | None = None  # Whose multiples they are [Hz]

    def spoils(self, freq: FloatArray) -> np.ndarray:
        """Lines that they spoil."""
        return np.asarray(np.any([np.abs(freq - f) <= width for f, width in self.widths.items()], axis=0))

    @property
    def words(self) -> str:
        """What is said of them."""
        kind = TONES if self.mains is None else f"{TONES} of the mains of {self.mains:g} Hz"
        tones = ", ".join(f"{f:.4g}" for f in sorted(self.widths))
        return (
            f"{kind}: tones that have no phase in common with the force at {tones} Hz; lines within "
            f"{max(self.widths.values()):.2g} Hz of them at most are left out of comparisons; "
            "look for what makes them: the mains, a motor, a fan"
        )


def interference(
    of_blows: Sequence[MeasuredFrequencyResponse], of_blocks: Sequence[MeasuredFrequencyResponse] = ()
) -> Interference | None:
    """
    Tones in responses of one position and input each, not to a sine; None where there are none.

    What leaks from the blocks of a recording scatters at a sharp resonance, too: beside blows they only show how far a tone goes.
    Responses that were estimated elsewhere go with those of blows.
    """
    widths: dict[float, float] = {}
    excess, mains = 0.0, None
    for step, own, struck in [
        *((step, own, True) for step, own in _by_step(of_blows).items()),
        *((step, own, False) for step, own in _by_step(of_blocks).items()),
    ]:
        lines = _Lines(step, own)
        tones = lines.tones()
        if not struck:
            tones = {f: p for f, p in tones.items() if not lines.resonates(f)}
        if of_blows and not struck:
            tones = {f: p for f, p in tones.items() if _near(f, widths, step)}
        multiples = {f: lines.at_multiples(f, tones) for f in _MAINS}
        likeliest = max(multiples, key=lambda f: len(multiples[f]))
        found: dict[float, float] = {}
        if multiples[likeliest]:
            mains, found = likeliest, multiples[likeliest]
            tones = {**{f: p for f, p in tones.items() if not _near(f, found, step)}, **found}
        for f, power in tones.items():
            skirts = step * float(np.sqrt(power / (2.0 * _SKIRTS))) / np.pi
            seen = _reach(f, step) if f in found else _LINES * step
            widths[f] = max(widths.get(f, 0.0), seen, min(skirts, _WIDEST))
        excess = max(excess, sum(tones.values()) / lines.freq.size)
    return Interference(widths, excess, mains) if widths else None


class _Lines:
    """Responses on lines that are as far apart: mean powers over their noise, of all channels."""

    def __init__(self, step: float, responses: Sequence[MeasuredFrequencyResponse]) -> None:
        first = min(float(r.freq[0]) for r in responses)
        index = [np.round((r.freq - first) / step).astype(np.intp) for r in responses]
        self.step, self.freq = step, first + step * np.arange(max(int(i[-1]) for i in index) + 1)
        scatter, spike, seen, self.shown, self.freedom, self.power, self.response = np.zeros((7, self.freq.size))
        # By record, of the channel that shows it most
        self.each = np.full((len(responses), self.freq.size), -np.inf)
        for own, r, i in zip(self.each, responses, index, strict=True):
            rough, scattered = _roughness(r), _scatter(r)
            known = np.isfinite(scattered)
            own[i] = np.where(known, scattered, -np.inf).max(axis=0)
            scatter[i] += np.where(known, scattered, 0.0).sum(axis=0)
            # Over what each channel's noise is on average: a zero of the response has less, but no tone.
            mean = np.mean(r.variance[0, :, 0], axis=-1, keepdims=True)
            self.power[i] += np.where(known, scattered * r.variance[0, :, 0] / mean, 0.0).sum(axis=0)
            self.response[i] += np.where(known, np.abs(r.data[0, :, 0]) ** 2 / mean, 0.0).sum(axis=0)
            seen[i] += known.sum(axis=0)
            self.freedom[i] += 2.0 * (r.averages - 1) * known.sum(axis=0)
            spike[i] += np.where(np.isfinite(rough), rough, 0.0).sum(axis=0)
            self.shown[i] += np.isfinite(rough).sum(axis=0)
        self.scatter = np.divide(scatter, seen, out=np.full(seen.shape, np.nan), where=seen > 0)
        self.spike = np.divide(spike, self.shown, out=np.full(spike.shape, np.nan), where=self.shown > 0)

    def tones(self) -> dict[float, float]:
        """Peaks of what scatters that are no wider than a tone's, and no more in the response: their powers by frequency."""
        out: dict[float, float] = {}
        least = _CHANCE / self.freq.size
        for k in np.flatnonzero(self.scatter > _STANDS_OUT).tolist():
            around = self._around(k, *_BESIDE)
            if not around.size or stats.chi2.sf(self.scatter[k] * self.freedom[k], self.freedom[k]) > least:
                continue
            near = slice(max(k - _BESIDE[0], 0), k + _BESIDE[0] + 1)
            highest = self.scatter[k] >= np.nanmax(self.scatter[near])
            sharp = np.nanmean(self.scatter[around]) < self.scatter[k] / _STANDS_OUT
            alike = self.spike[k] < _OF_SCATTER * self.scatter[k]
            # What a restoring force scatters stands out where blows are hard, a tone in soft ones, too.
            throughout = float(np.quantile(self.each[np.isfinite(self.each[:, k]), k], _SOFT)) > 0.5 * _STANDS_OUT
            louder = np.mean(self.power[around]) < self.power[k] / _STANDS_OUT
            if highest and sharp and louder and alike and throughout:
                out[float(self.freq[k])] = float(self.scatter[k])
        return out

    def resonates(self, tone: float) -> bool:
        """Whether the response stands out at a line, by more than what scatters there does to it."""
        k = int(np.argmin(np.abs(self.freq - tone)))
        beside = float(np.mean(self.response[self._around(k, *_BESIDE)]))
        return bool(self.response[k] > max(_STANDS_OUT * beside, _AT_RESONANCE * self.power[k]))

    def at_multiples(self, mains: float, tones: Mapping[float, float]) -> dict[float, float]:
        """Multiples of the mains and their powers, where several are tones or peaks between smooth neighbours; none elsewhere."""
        # A resonance is none: its flank goes on beside it, and what has a phase in common with the force does not scatter.
        out: dict[float, float] = {}
        certain = 0
        if self.step * _APART.size > mains / 2:
            return out
        for k in range(max(int(np.ceil(self.freq[0] / mains)), 1), int(self.freq[-1] / mains) + 1):
            first, last = np.searchsorted(self.freq, ((k - 0.5) * mains, (k + 0.5) * mains))
            off, spike = np.abs(self.freq[first:last] - k * mains), self.spike[first:last]
            reach = _reach(k * mains, self.step)
            if reach > mains / 8:
                break
            near = off <= reach
            beside = spike[~near & (off > _APART.size // 2 * self.step)]
            if np.count_nonzero(beside > 0.0) < _APART.size or not np.any(spike[near] > 0.0):
                continue
            told = [power for f, power in tones.items() if _near(f, [k * mains], self.step)]
            peak = max([float(np.nanmax(spike[near])), *told])
            flank = (off > reach + _APART.size // 2 * self.step) & (off <= reach + _APART.size * self.step)
            goes_on = float(np.nanmax(spike[flank], initial=0.0)) > peak / _STANDS_OUT
            scatters = not self.freedom[first:last][near].any() or (
                float(np.nanmax(self.scatter[first:last][near])) > peak / _OF_SCATTER
            )
            sure = bool(told) or (scatters and not goes_on)
            by_chance = _by_chance(max(int(self.shown[first:last][near].max()), 1), int(np.count_nonzero(near)))
            if told or peak > max(_STANDS_OUT, by_chance) * float(np.nanmedian(beside)) / np.log(2):
                out[k * mains], certain = peak, certain + sure
        # Where the mains are, they may lie on a flank, too.
        return out if certain >= _MULTIPLES else {}

    def _around(self, k: int, low: int, high: int) -> np.ndarray:
        """Lines at some distance from one, to either side, of which the scatter is known."""
        around = np.array([k + side * n for side in (-1, 1) for n in range(low, high + 1)])
        around = around[(around >= 0) & (around < self.freq.size)]
        return np.asarray(around[np.isfinite(self.scatter[around])])


@cache
def _by_chance(data: int, lines: int) -> float:
    """What the mean of so many exponential variables exceeds by chance, the largest of some lines: noise over its mean."""
    return float(stats.gamma.isf(_CHANCE / lines, data)) / data


def _by_step(responses: Sequence[MeasuredFrequencyResponse]) -> dict[float, list[MeasuredFrequencyResponse]]:
    """Responses on even lines, by how far these are apart."""
    out: dict[float, list[MeasuredFrequencyResponse]] = {}
    for r in responses:
        apart = np.diff(r.freq)
        if r.freq.size >= _APART.size and np.ptp(apart) < 0.01 * np.mean(apart):
            out.setdefault(float(f"{np.mean(apart):.4g}"), []).append(r)
    return out


def _reach(frequency: float, step: float) -> float:
    """How far from its frequency a tone may be seen [Hz]."""
    return max(_LINES * step, _WANDERS * frequency)


def _near(frequency: float, others: Iterable[float], step: float) -> bool:
    return any(abs(frequency - f) <= _reach(f, step) + step for f in others)


def _scatter(response: MeasuredFrequencyResponse) -> FloatArray:
    """What scatters at each line by itself over the noise, shape (channel, frequency); NaN where nobody saw it."""
    data, coherence, variance = (a[0, :, 0] for a in (response.data, response.coherence, response.variance))
    if response.averages < 2:
        return np.full(data.shape, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        power = np.abs(data) ** 2 * (1.0 - coherence) / coherence / (response.averages - 1)
        return np.asarray(power / variance)


def _roughness(response: MeasuredFrequencyResponse) -> FloatArray:
    """Squares of a response's differences over the noise, as powers of a tone; shape (channel, frequency), NaN at its ends."""
    out = np.full((len(response.outputs), response.freq.size), np.nan)
    inner = slice(_APART.size // 2, -(_APART.size // 2))
    for rough, data, variance in zip(out, response.data[0, :, 0], response.variance[0, :, 0], strict=True):
        difference = np.convolve(data, _APART, mode="valid")
        rough[inner] = np.abs(difference) ** 2 / np.convolve(variance, _APART**2, mode="valid") / _OF_TONE
    return out
