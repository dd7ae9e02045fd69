"""Pulses of recorded blows, and their transform at any complex frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray


class Pulses(NamedTuple):
    """The pulses of some blows, each folded to rows of equal length, shape (blow, row, sample)."""

    fs: float
    begins: FloatArray  # Of each, after the instant of the blow [s]
    tables: FloatArray

    def transform(self, z: ComplexArray) -> ComplexArray:
        """Σ f_n e^(-z t_n), shape (z, blow): the powers of e^(-z/fs) as products of short and long ones."""
        blows, rows, size = self.tables.shape
        short = np.exp(-np.outer(z, np.arange(size) / self.fs))
        far = np.exp(-np.outer(z, np.arange(rows) * (size / self.fs)))
        # Forces are real: as one product of real matrices.
        parts = np.concatenate([short.real, short.imag]) @ self.tables.reshape(-1, size).T
        inner = (parts[: z.size] + 1j * parts[z.size :]).reshape(z.size, blows, rows)
        return np.asarray(np.exp(-np.outer(z, self.begins)) * (inner @ far[:, :, None])[..., 0])


def pulses_of(forces: Sequence[FloatArray], fs: float, start: float) -> Pulses:
    """The pulses of some blows at an instant, cut out."""
    cut, begins = [], []
    for force in forces:
        at = np.flatnonzero(np.abs(force) > _noise(force))
        near = slice(max(int(at[0]) - 1, 0), int(at[-1]) + 2)
        begins.append(near.start / fs - start)
        cut.append(force[near])
    side = int(np.ceil(np.sqrt(max(x.size for x in cut))))
    tables = np.stack([np.pad(x, (0, side * side - x.size)).reshape(side, side) for x in cut])
    return Pulses(fs, np.array(begins), tables)


def _noise(force: FloatArray) -> float:
    """Size below which samples of a force are noise, or a converter's last step."""
    size, steps = np.abs(force), np.abs(np.diff(force))
    # A force is noise but for its hits; of N samples of noise one exceeds √(4 ln N) deviations in one of N blows.
    scatter = 1.48 * float(np.median(size)) * float(np.sqrt(4.0 * np.log(size.size)))
    # Between levels of a converter a signal cannot rest: it flickers by one.
    last = 1.5 * float(np.min(steps[steps > 0.0], initial=np.inf))
    peak = float(size.max())
    most = SETTINGS.tail_force_noise * peak
    return max(SETTINGS.tail_force * peak, *(x for x in (scatter, last) if x <= most), 0.0)
