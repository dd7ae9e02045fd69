"""
By what parts of a structure may differ from its matrices, beside one factor on each: relative errors in modal coordinates.

With mass-normalised modes φ_r of frequency ω_r an error ε_rs of the stiffness is δK = ε_rs ω_r ω_s (M φ_r φ_sᵀ M + transpose)/2,
so that every positive matrix near K can be made of them, each in proportion to what it errs from (Soize 2000, Probabilistic
Engineering Mechanics 15, 277-294: the same basis, with random ε_rs). Pairs of unlike modes change their shapes. Of the damping
matrix each mode's own value may differ. Modes without a spring have masses instead.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg

from cutvib_ss.results import FloatArray

MOST_MODES = 6
"""Modes of which parts are made, the lowest ones: pairs grow by the square of them."""


class Part(NamedTuple):
    """A relative error of a matrix: the power of s that the matrix stands at, the modes, and its symmetric change, shape (n, n)."""

    power: int
    modes: tuple[int, int]
    change: FloatArray


def modal_parts(mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> tuple[Part, ...]:
    """Parts of a structure, none where one factor on a matrix is all that there is; modes are those without damping."""
    squares, shapes = undamped_modes(mass, stiffness)
    springs = squares > 1e-9 * max(float(squares[-1]), 0.0)
    rigid, held = np.flatnonzero(~springs)[:MOST_MODES].tolist(), np.flatnonzero(springs)[:MOST_MODES].tolist()
    if len(squares) < 2:
        return ()
    rows = (mass @ shapes).T
    omega = np.sqrt(np.maximum(squares, 0.0))
    out = []
    if len(held) > 1:
        out += [Part(0, (r, s), omega[r] * omega[s] * _both(rows[r], rows[s])) for r in held for s in held if s >= r]
        losses = np.sqrt(np.maximum(np.einsum("ri,ij,rj->r", shapes.T, damping, shapes.T), 0.0))
        lossy = [r for r in held if losses[r] > 0.0]
        out += [
            Part(1, (r, s), losses[r] * losses[s] * _both(rows[r], rows[s])) for r in lossy for s in lossy if s >= r
        ]
    modes = (*rigid, *held)
    out += [Part(2, (r, s), _both(rows[r], rows[s])) for r in modes for s in modes if s >= r]
    return tuple(out)


def undamped_modes(mass: FloatArray, stiffness: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Squared frequencies and mass-normalised shapes (n, mode), the largest entry of each over √M positive."""
    squares, shapes = linalg.eigh(stiffness, mass)
    scaled = shapes * np.sqrt(np.diag(mass))[:, None]
    largest = np.take_along_axis(scaled, np.abs(scaled).argmax(axis=0)[None], axis=0)
    return squares, shapes * np.where(largest < 0.0, -1.0, 1.0)


def _both(a: FloatArray, b: FloatArray) -> FloatArray:
    return 0.5 * (np.outer(a, b) + np.outer(b, a))
