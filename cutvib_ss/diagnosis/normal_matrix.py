"""
Normal matrix of the directions: products are summed over rows and channels line by line first, and over the lines then.

Every column is an atom, which is a row of the Jacobian, the prediction in one channel or what a residual mode or a hit adds, times
a real function of frequency, one or smooth, or i times that. Few atoms make many columns, so none of these is written down: with
the atoms' products at each line T(f) = Σ conj(a) b and S = Σ_f g h T,

    <g a, h b> = Re S,   <i g a, h b> = Im S,   <g a, i h b> = Re iS,   <i g a, i h b> = Im iS.

Columns of the function one belong to a record, its session or all records; those of smooth functions to all.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis import work
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray

_AT_ONCE = 60_000
"""Numbers of some rows' atoms that are treated together: they stay in the processor's cache."""


@dataclass(frozen=True)
class Alike:
    """Weighted records on the same lines and channels, and the smooth functions there."""

    shared: ComplexArray  # Rows of the unknowns that move every channel, shape (unknown, row, channel, line)
    residual: ComplexArray  # Shape (row, channel, line)
    cause: ComplexArray | None  # Derivative to the cause's size
    plain: ComplexArray  # The prediction
    added: Sequence[Sequence[ComplexArray]]  # By residual modes and hits to each row, shape (channel, line) each
    calibration: FloatArray  # Shapes of a calibration error in their size, shape (shape, line)
    smooth: FloatArray  # Shapes of a nominal element's discrepancy
    of_cause: FloatArray  # Those of the cause's, shape (row, shape, line), or one row for all
    nominal: Sequence[tuple[int, float]]  # Unknowns with a discrepancy, and their weights in it


@dataclass(frozen=True)
class Columns:
    """Where the products go."""

    # Of each row the columns of function one, the atom of each and its weight. Atoms are the shared unknowns, the residual, the
    # cause, what is added, the prediction in each channel, and i times that.
    of_one: Sequence[tuple[np.ndarray, np.ndarray, FloatArray]]
    # Of each channel's calibration, each nominal element and the cause: real shapes, then imaginary ones
    smooth: np.ndarray


def add_products(matrix: FloatArray, records: Alike, columns: Columns) -> None:
    """Add the products of all columns over some records to the normal matrix."""
    work.count(SETTINGS.search_products * records.shared.size)
    count, z = len(records.plain), columns.smooth
    atoms = len(records.shared) + records.plain.shape[1] + 2
    some = max(1, _AT_ONCE // (atoms * records.plain[0].size))
    smooth: list[ComplexArray] = []
    crossed = np.zeros_like(matrix)
    for first in range(0, count, some):
        rows = slice(first, min(first + some, count))
        products = _Products(records, rows)
        ones, mixed = products.of_one, products.mixed
        for k, (index, of, weight) in enumerate(columns.of_one[rows]):
            at = index[:, None]
            matrix[at, index] += ones[k][of[:, None], of] * (weight * weight[:, None])
            crossed[at, z] += mixed[k].T[of] * weight[:, None]
        smooth.append(products.of_smooth)
    crossed[z[:, None], z] += 0.5 * _of_smooth(records, np.concatenate(smooth))
    matrix += crossed
    matrix += crossed.T


class _Products:
    """Products of the columns of some rows."""

    def __init__(self, records: Alike, rows: slice) -> None:
        self.records, self.n_nominal = records, len(records.nominal)
        plain, added = records.plain[rows], records.added[rows]
        n, channels = len(records.shared), plain.shape[1]
        self.cause = n + 1
        first_added = n + 1 + (records.cause is not None)
        self.first_plain = first_added + max(map(len, records.added))
        self.atoms = np.zeros((len(plain), self.first_plain + channels, *plain.shape[1:]), dtype=np.complex128)
        self.atoms[:, :n] = records.shared[:, rows].swapaxes(0, 1)
        self.atoms[:, n] = records.residual[rows]
        if records.cause is not None:
            self.atoms[:, self.cause] = records.cause[rows]
        for k, own in enumerate(added):
            for j, shown in enumerate(own):
                self.atoms[k, first_added + j] = shown
        for c in range(channels):
            self.atoms[:, self.first_plain + c, c] = plain[:, c]
        # With the prediction, shape (row, channel, atom, line), and with what has a discrepancy, (row, element, atom, line).
        self.by_plain = np.zeros((*plain.shape[:2], self.atoms.shape[1], plain.shape[2]), dtype=np.complex128)
        first, turned = self.first_plain, plain.conj()
        np.multiply(turned[:, :, None], self.atoms[:, :first].swapaxes(1, 2), out=self.by_plain[:, :, :first])
        for c in range(channels):
            # Channels have nothing in common.
            self.by_plain[:, c, first + c] = turned[:, c] * plain[:, c]
        self.elements = [i for i, _ in records.nominal] + ([] if records.cause is None else [self.cause])
        self.weight = np.array([*(w for _, w in records.nominal), 1.0])[: len(self.elements)]
        weighted = self.atoms[:, self.elements].conj() * self.weight[:, None, None]
        self.by_element = weighted[:, :, None, 0] * self.atoms[:, None, :, 0]
        for c in range(1, channels):
            self.by_element += weighted[:, :, None, c] * self.atoms[:, None, :, c]
        self.of_cause = records.of_cause if len(records.of_cause) == 1 else records.of_cause[rows]
        self.functions = np.vstack([np.ones(plain.shape[-1]), records.calibration])
        self.with_plain = _over(self.by_plain, self.functions)

    @property
    def of_one(self) -> FloatArray:
        """Of columns of function one, shape (row, atom, atom)."""
        real = self.atoms.reshape(*self.atoms.shape[:2], -1).view(np.float64)
        same = real @ real.swapaxes(1, 2)
        turned, last = self.with_plain[..., 0].imag, same[:, self.first_plain :, self.first_plain :]
        above = np.concatenate([same, turned.swapaxes(1, 2)], axis=2)
        return np.concatenate([above, np.concatenate([turned, last], axis=2)], axis=1)

    @property
    def mixed(self) -> FloatArray:
        """Of smooth columns with those of function one, shape (row, column, atom)."""
        found = [self.with_plain[:, c, :, 1:] for c in range(self.with_plain.shape[1])]
        if self.n_nominal:
            found += list(_over(self.by_element[:, : self.n_nominal], self.records.smooth).swapaxes(0, 1))
        if len(self.elements) > self.n_nominal:
            found.append(_over(self.by_element[:, -1], self.of_cause))
        turned = [np.concatenate([s, 1j * s[:, self.first_plain :]], axis=1) for s in found]
        return np.concatenate([part for s in turned for part in (s.real, s.imag)], axis=2).swapaxes(1, 2)

    @property
    def of_smooth(self) -> ComplexArray:
        """Products of what smooth functions multiply, shape (row, atom, atom, line); summed where all rows share these."""
        channels = self.by_plain.shape[1]
        other = [*range(self.first_plain, self.first_plain + channels), *self.elements]
        with_all = np.concatenate([self.by_plain[:, :, other], self.by_element[:, :, other]], axis=1)
        with_all[:, :, channels:] *= self.weight[:, None]
        return with_all.sum(axis=0, keepdims=True) if len(self.records.of_cause) == 1 else with_all


def _of_smooth(records: Alike, products: ComplexArray) -> FloatArray:
    """Products of smooth columns with each other."""
    channels, nominal = records.plain.shape[1], records.plain.shape[1] + len(records.nominal)
    # Channels, nominal elements and the cause: which of the products are theirs, with their functions.
    kinds = [
        (slice(channels), records.calibration[None]),
        (slice(channels, nominal), records.smooth[None]),
        (slice(nominal, None), records.of_cause),
    ]
    edges = np.cumsum([0, *(2 * products[0, a].shape[0] * f.shape[1] for a, f in kinds)])
    own = [slice(a, b) for a, b in itertools.pairwise(edges.tolist())]
    out = np.zeros((edges[-1], edges[-1]))
    for i, j in itertools.combinations_with_replacement(range(len(kinds)), 2):
        (a, f), (b, g) = kinds[i], kinds[j]
        out[own[i], own[j]] = _between(f, products[:, a, b], g)
        out[own[j], own[i]] = out[own[i], own[j]].T
    return out


def _over(products: ComplexArray, functions: FloatArray) -> ComplexArray:
    """Sums over the lines with each function, shape (…, function)."""
    parts = np.stack([products.real, products.imag])
    if functions.ndim == 2:
        sums = (parts.reshape(-1, parts.shape[-1]) @ functions.T).reshape(*parts.shape[:-1], -1)
    else:
        sums = parts @ functions.swapaxes(1, 2)
    out: ComplexArray = sums[0] + 1j * sums[1]
    return out


def _between(left: FloatArray, products: ComplexArray, right: FloatArray) -> FloatArray:
    """Products of columns of two kinds by those of their atoms, shape (row, atom, atom, line)."""
    if len(left) == len(right) == 1:
        products = products.sum(axis=0, keepdims=True)
    shape = (products.shape[1], left.shape[1], products.shape[2], right.shape[1])
    real, imaginary = (
        ((part[:, :, :, None] * left[:, None, None]) @ right[:, None, None].swapaxes(-1, -2)).sum(axis=0).swapaxes(1, 2)
        for part in (products.real, products.imag)
    )
    out = np.empty((shape[0], 2, shape[1], shape[2], 2, shape[3]))
    out[:, 0, :, :, 0] = out[:, 1, :, :, 1] = real
    out[:, 0, :, :, 1], out[:, 1, :, :, 0] = -imaginary, imaginary
    return out.reshape(2 * shape[0] * shape[1], 2 * shape[2] * shape[3])
