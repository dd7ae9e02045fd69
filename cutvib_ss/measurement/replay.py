"""
A record's estimator kept for later: the measured force is run through a model, and what comes out is estimated as it was.

H1 is linear in the responses, so that a simulated history passes through the very weights, blocks and windows of the measured
one; leakage, truncation and uneven blows are then part of the prediction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy import fft, signal

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.blocks import welch_blocks
from cutvib_ss.measurement.estimation import without_offset
from cutvib_ss.measurement.force_window import windowed
from cutvib_ss.measurement.records import Record
from cutvib_ss.results import ComplexArray, FloatArray

ROOM = 3.5
"""Samples that the shortest period kept has on a slower clock."""
PULSE_SAMPLES = 12
"""Samples that a blow made up for an estimated frequency response is long, at least."""


@dataclass(frozen=True)
class Replay:
    """H1 of one record as the functional of its responses that it is."""

    forces: tuple[FloatArray, ...]  # Force of each blow or recording, its offset removed [N]
    fs: float  # Sampling frequency [Hz]
    lines: np.ndarray  # Lines of the estimator's transform that are kept
    block: int = 0  # Samples of a Welch block and of its overlap; a block of 0 takes each blow as one
    overlap: int = 0
    # The measured responses to each force; empty where only estimates were recorded
    measured: tuple[FloatArray, ...] = ()
    sampled: float = 0.0  # Sampling frequency of the record itself, where the histories here are on a slower clock [Hz]
    begin: int = 0  # Samples of a continuous recording that are run through a model before the first block
    assumed: bool = False  # Whether the force is made up (a half sine), since only estimated responses were recorded
    # Whether the force of a blow goes on acting after it: an AC-coupled one swings back for seconds
    lasting: bool = False

    def ratio(self, under: Sequence[FloatArray], over: Sequence[FloatArray]) -> ComplexArray:
        """H1 of some histories over others."""
        return self._ratio([self.transformed(x) for x in under], over)

    def _ratio(self, under: Sequence[ComplexArray], over: Sequence[FloatArray]) -> ComplexArray:
        crossed, power = np.zeros(0, dtype=np.complex128), np.zeros(0)
        for x, y in zip(under, over, strict=True):
            c = np.einsum("bl,...bl->...l", x.conj(), self.transformed(y))
            p = np.sum(np.abs(x) ** 2, axis=0)
            crossed, power = (c, p) if not power.size else (crossed + c, power + p)
        floor = 1e-28 * float(np.max(power, initial=0.0))
        return np.asarray(
            np.where(power > floor, crossed / np.maximum(power, floor + 1e-300), 0.0), dtype=np.complex128
        )

    def transformed(self, x: FloatArray) -> ComplexArray:
        """Transforms of the blocks of some histories on the kept lines, shape (..., block, line)."""
        if not self.block:
            return np.asarray(fft.rfft(x)[..., None, self.lines])
        blocks = sliding_window_view(x[..., self.begin :], self.block, axis=-1)[..., :: self.block - self.overlap, :]
        # A simulation that ran away has none.
        with np.errstate(invalid="ignore"):
            windowed = (blocks - blocks.mean(axis=-1, keepdims=True)) * signal.get_window("hann", self.block)
        return np.asarray(fft.rfft(windowed)[..., self.lines])

    @cached_property
    def spectra(self) -> list[ComplexArray]:
        """Transforms of the forces."""
        return [self.transformed(f) for f in self.forces]

    @property
    def shared(self) -> float:
        """Part of the blocks that share the force at a line, in the median: all if periodic, half of noise, few of a sweep."""
        power = np.abs(np.concatenate(self.spectra)) ** 2
        each = np.sum(power, axis=0) ** 2 / np.maximum(np.sum(power**2, axis=0), 1e-300)
        return float(np.median(each)) / len(power)

    def data(self, responses: Sequence[FloatArray]) -> ComplexArray:
        """Frequency responses as the record's estimator would show them."""
        return self._ratio(self.spectra, responses)

    @property
    def clock(self) -> float:
        """Sampling frequency of the record itself [Hz]."""
        return self.sampled or self.fs

    def simulated(self, responses: Sequence[FloatArray]) -> ComplexArray:
        """
        The same of responses that were simulated on the slower clock, which lack what lies beyond its Nyquist frequency.

        A sum of samples is the integral less half a step of the last value (Euler-Maclaurin), on either clock.
        """
        if self.block or self.clock == self.fs:
            return self.data(responses)
        less = 0.5 * (1.0 - self.fs / self.clock)
        ended = [np.array(y, dtype=np.float64) for y in responses]
        for y in ended:
            # At the lines of a block its end is in phase with its beginning.
            y[..., 0] += less * (2.0 * y[..., -1] - y[..., -2])
        return self.data(ended)

    @cached_property
    def first(self) -> Replay:
        """The first blow alone."""
        return replace(self, forces=self.forces[:1], measured=self.measured[:1])

    @cached_property
    def middle(self) -> int:
        """Index of the blow of middle size."""
        energy = [float(f @ f) for f in self.forces]
        return int(np.argsort(energy, kind="stable")[len(energy) // 2])

    @cached_property
    def typical(self) -> Replay:
        """The blow of middle size alone."""
        own = slice(self.middle, self.middle + 1)
        return replace(self, forces=self.forces[own], measured=self.measured[own])

    @cached_property
    def power(self) -> FloatArray:
        """Power of the forces at each line, of all blows or blocks together."""
        return np.asarray(sum(np.sum(np.abs(f) ** 2, axis=0) for f in self.spectra), dtype=np.float64)

    def short(self, blocks: int) -> Replay:
        """The first blow alone, or the loudest blocks in succession of the first recording."""
        if not self.block:
            return self.first
        loud = np.sum(np.abs(self.spectra[0]) ** 2, axis=-1)
        blocks, hop = min(blocks, loud.size), self.block - self.overlap
        loudest = int(np.argmax(np.convolve(loud, np.ones(blocks), "valid"))) * hop
        own = slice(loudest, loudest + self.begin + self.block + (blocks - 1) * hop)
        return replace(self, forces=(self.forces[0][own],), measured=tuple(a[:, own] for a in self.measured[:1]))

    def at(self, keep: np.ndarray | slice) -> Replay:
        """Some of the lines."""
        return replace(self, lines=self.lines[keep])

    def longer(self, factor: float) -> Replay:
        """The same blows drawn out about their peaks, their impulse kept."""
        t = np.arange(self.forces[0].size)
        drawn = []
        for force in self.forces:
            peak = float(np.argmax(np.abs(force)))
            drawn.append(np.interp(peak + (t - peak) / factor, t, force, left=0.0, right=0.0) / factor)
        return replace(self, forces=tuple(drawn))

    def slower(self) -> Replay:
        """The same blows on a slower clock that still holds the kept lines and most of an octave above them."""
        size = self.forces[0].size
        if self.block or not self.lines.size:
            return self
        least = int(ROOM * self.lines[-1])
        factor = max((k for k in range(1, size // max(least, 1) + 1) if size % (2 * k) == 0), default=1)
        if factor == 1:
            return self
        count = size // factor

        def resampled(x: FloatArray) -> FloatArray:
            return np.asarray(signal.resample(x, count, axis=-1), dtype=np.float64)

        return replace(
            self,
            forces=tuple(resampled(f) for f in self.forces),
            measured=tuple(resampled(a) for a in self.measured),
            fs=self.fs / factor,
            sampled=self.clock,
        )


def replay_of(record: Record) -> Replay:
    """The estimator of a record with histories, on all its lines."""
    if record.kind == "frf":
        raise ParameterError(f"record {record.name!r} holds no histories; use `assumed_blow`")
    fs = record.histories[0].fs
    if record.kind == "timeseries":
        size, overlap = welch_blocks(record)
        # Recordings of unlike length are cut to the shortest, as blows are.
        length = min(h.force.size for h in record.histories)
        forces = tuple(h.force[:length] for h in record.histories)
        measured = tuple(h.responses[:, :length] for h in record.histories)
        return Replay(forces, fs, np.arange(size // 2 + 1), size, overlap, measured)
    samples = min(h.force.size for h in record.histories)
    cut = [without_offset(h, samples) for h in record.histories]
    # What the force's sensor reads while none acts shook no structure.
    acting = tuple(windowed(f, fs, h.start) for (f, _), h in zip(cut, record.histories, strict=True))
    return Replay(acting, fs, np.arange(samples // 2 + 1), measured=tuple(a for _, a in cut))


def assumed_blow(
    freq: FloatArray, block: float, blow_at: float, peak_force: float, variance: FloatArray | None = None
) -> Replay:
    """A blow that may have been behind an estimated frequency response."""
    length = 1.0 / float(freq[-1])
    if variance is not None:
        lengths = np.geomspace(0.15, 1.4, 60) / float(freq[-1])
        shape = -0.5 * np.log(variance)
        left = []
        for d in lengths:
            model = np.log(np.abs(_half_sine(freq, d)) / d + 1e-3)
            left.append(np.var(shape - model))
        length = float(lengths[int(np.argmin(left))])
    fs = max(2.5 * float(freq[-1]), PULSE_SAMPLES / length)
    samples = 2 * int(np.ceil(block * fs / 2))
    fs = samples / block
    t = np.arange(samples) / fs - blow_at
    force = np.where((t >= 0) & (t <= length), np.sin(np.pi * np.clip(t / length, 0.0, 1.0)), 0.0) * peak_force
    return Replay((force,), fs, np.round(freq * block).astype(int), assumed=True)


def _half_sine(freq: FloatArray, length: float) -> FloatArray:
    """Modulus of the transform of a half sine of unit peak."""
    x = 2.0 * freq * length
    near = np.abs(1.0 - x**2) < 1e-6
    value = np.where(near, np.pi / 4, np.cos(np.pi * x / 2) / np.where(near, 1.0, 1.0 - x**2))
    return np.asarray(2.0 * length / np.pi * np.abs(value), dtype=np.float64)
