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
        inner = (short @ self.tables.reshape(-1, size).T).reshape(z.size, blows, rows)
        return np.asarray(np.exp(-np.outer(z, self.begins)) * (inner @ far[:, :, None])[..., 0])


def pulses_of(forces: Sequence[FloatArray], fs: float, start: float) -> Pulses:
    """The pulses of some blows at an instant, cut out."""
    cut, begins = [], []
    for force in forces:
        at = np.flatnonzero(np.abs(force) > SETTINGS.tail_force * np.abs(force).max())
        near = slice(max(int(at[0]) - 1, 0), int(at[-1]) + 2)
        begins.append(near.start / fs - start)
        cut.append(force[near])
    size = int(np.ceil(np.sqrt(max(x.size for x in cut))))
    tables = np.stack([np.pad(x, (0, size * size - x.size)).reshape(size, size) for x in cut])
    return Pulses(fs, np.array(begins), tables)
