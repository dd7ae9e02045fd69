"""
Repeatability and discrepancy: the residual of a right model beyond sensor noise, as low-rank Gaussian directions.

    measured = H(x)·(1 + ε) + D_s z_s + Q v + B_r h_r + noise,    z_s, v ~ N(0, 1) times their sizes, h_r ~ N(0, 1)

`D_s` moves the stiffnesses, dampings and gains of session s, and the size of the cause (repeatability); where records of one
session differ, those of each record beside them. `Q` multiplies the dynamic stiffness of an element by
1 + δ(ω), with δ a smooth complex Gaussian process over log frequency that all sessions share (discrepancy): of the nominal
model's elements, and of the cause itself, of a restoring force with errors of its form besides (`form_errors`); and it adds to the
receptance between two ports of a structure what modes do that its model leaves out (`residual_modes`). `B_r` is what the hits of
record r do that a hand places (`blow_noise.hit_directions`).
All are linear, so they are integrated out: with U = [D, Q] in whitened data the
covariance is 1 + U Uᵀ. Sizes are hyperparameters with priors; the evidence decides, and they are summed over in every hypothesis.
References: Kennedy and O'Hagan (2001) for the discrepancy; Rasmussen and Williams (2006), section 8.1, for the process.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, stats
from scipy.linalg import lapack

from cutvib_ss.diagnosis.hit_errors import SET_UPS
from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import FloatArray

EVEN = float(1.0 / stats.uniform.var())
"""Precision of an even prior over a unit range."""
NONE: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
"""No unknowns."""


@dataclass(frozen=True)
class Quadratic:
    """The log posterior about a point, to second order, for any sizes of the directions."""

    layout: Layout  # Columns
    matrix: FloatArray  # Of the data at unit sizes
    gradient: FloatArray
    squares: float  # Sum of the squared weighted residuals
    x: FloatArray  # Unknowns of the problem at the point
    precision: FloatArray  # Of their priors
    free: np.ndarray  # Unknowns that no bound holds
    even: np.ndarray  # Unknowns whose priors are even over a unit range
    # Where the directions stand at the point, at unit sizes: sessions' drift is not small beside a sharp resonance
    offsets: FloatArray
    count: int  # Real data

    def system(self, sizes: Sizes) -> tuple[FloatArray, FloatArray]:
        """Posterior precision and gradient of all columns for given sizes, priors included."""
        scale = self.layout.scale(sizes)
        n = self.layout.unknowns
        matrix = self.matrix * (scale * scale[:, None] / sizes.noise)
        gradient = self.gradient * (scale / sizes.noise)
        prior = np.ones(self.layout.size)
        prior[:n] = self.precision + SETTINGS.likelihood_precision_floor
        matrix[np.diag_indices_from(matrix)] += prior
        gradient[:n] -= self.precision * self.x / scale[:n]
        gradient[n:] -= self.offsets[n:] / scale[n:]
        return matrix, gradient

    def at(self, sizes: Sizes) -> float:
        """Squares of the residuals and of the priors at the point."""
        n, scale = self.layout.unknowns, self.layout.scale(sizes)
        drifted = self.offsets[n:] / scale[n:]
        own = self.x / scale[:n]
        return self.squares / sizes.noise + float(self.precision @ own**2) + float(drifted @ drifted)

    def log_evidence(self, sizes: Sizes) -> float:
        """Laplace's evidence for given sizes, up to a constant of the data."""
        matrix, gradient = self.system(sizes)
        index = np.flatnonzero(self.even)
        e = index.size
        matrix[index, index] += EVEN
        # An unknown at its bound keeps its share of the determinant, but does not move.
        whole = Factored(matrix)
        gain = whole.gain(gradient, np.flatnonzero(~self.free))
        noise = self.count * float(np.log(sizes.noise))
        return -0.5 * (self.at(sizes) - gain + whole.log_determinant + noise) + 0.5 * e * float(np.log(2 * np.pi))

    @cached_property
    def _found(self) -> dict[Sizes, float]:
        return {}

    def posterior(self, sizes: Sizes, known: Known) -> float:
        """Evidence for given sizes times their prior, as a logarithm."""
        if sizes not in self._found:
            prior = sum(np.log(dict(grid)[getattr(sizes, name)]) for name, grid in grids(self.layout, known).items())
            self._found[sizes] = self.log_evidence(sizes) + float(prior)
        return self._found[sizes]

    def climbed(self, sizes: Sizes, known: Known) -> Sizes:
        """Sizes of most posterior, from a start by steps along each grid."""
        found = grids(self.layout, known)
        sizes = _on_grid(sizes, found)
        moved = True
        while moved:
            moved = False
            for name, grid in found.items():
                values = [v for v, _ in grid]
                at = values.index(getattr(sizes, name))
                near = [replace(sizes, **{name: values[k]}) for k in (at - 1, at + 1) if 0 <= k < len(values)]
                best = max(near, key=lambda s: self.posterior(s, known), default=sizes)
                if self.posterior(best, known) > self.posterior(sizes, known):
                    sizes, moved = best, True
        return sizes

    def summed(self, sizes: Sizes, known: Known) -> float:
        """Log evidence with the sizes summed over: along each grid through the mode, as if they were independent."""
        top = self.posterior(sizes, known)
        total = top
        for name, grid in grids(self.layout, known).items():
            line = [self.posterior(replace(sizes, **{name: v}), known) - top for v, _ in grid]
            total += float(np.logaddexp.reduce(np.array(line)))
        return total


class Factored:
    """A normal matrix, scaled to a unit diagonal and factored."""

    def __init__(self, matrix: FloatArray) -> None:
        self.size = np.sqrt(np.diag(matrix))
        scaled = matrix / np.outer(self.size, self.size)
        # It is symmetric: its transpose lies in memory as LAPACK wants it. The other triangle is never read.
        self.factor, failed = lapack.dpotrf(scaled.T, lower=1, clean=0)
        if failed:
            # Directions that are nearly the same leave rounding errors for eigenvalues.
            scaled[np.diag_indices_from(scaled)] += SETTINGS.likelihood_precision_floor
            self.factor = linalg.cholesky(scaled, lower=True, check_finite=False)

    @property
    def log_determinant(self) -> float:
        """Logarithm of its determinant."""
        return 2.0 * float(np.sum(np.log(np.diag(self.factor))) + np.sum(np.log(self.size)))

    def gain(self, right: FloatArray, held: NDArray[np.intp] = NONE) -> float:
        """By what the squares fall at the solution, some unknowns held at zero."""
        columns = np.zeros((self.size.size, 1 + held.size))
        columns[:, 0] = right / self.size
        columns[held, 0] = 0.0
        columns[held, 1 + np.arange(held.size)] = 1.0
        pulled, _ = lapack.dtrtrs(self.factor, columns, lower=1)
        # What those that are held would take of it, were they free: their part of the inverse is that of the columns behind.
        left, theirs = pulled[:, 0], pulled[:, 1:]
        gain = float(left @ left)
        if held.size:
            across = theirs.T @ left
            gain -= float(across @ np.linalg.solve(theirs.T @ theirs, across))
        return gain

    def solved(self, right: FloatArray) -> FloatArray:
        """Solution for a right-hand side, or for several in columns."""
        size = self.size if right.ndim == 1 else self.size[:, None]
        return np.asarray(linalg.cho_solve((self.factor, True), right / size, check_finite=False) / size)


def log_determinant(matrix: FloatArray) -> float:
    """Logarithm of the determinant of a precision."""
    return Factored(matrix).log_determinant


def solved(matrix: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a normal equation."""
    return Factored(matrix).solved(right)


@dataclass(frozen=True)
class Known:
    """What is stated of the sizes: the drift, and whether the noise was seen to scatter."""

    drift: float | None = None
    noise: bool = True
    # Drift of records beside their sessions, where sessions of one record tell nothing of it
    within: float | None = None


def grids(layout: Layout, known: Known) -> dict[str, tuple[tuple[float, float], ...]]:
    """Sizes that are searched, with their prior; one value where there are no such directions, or the drift is stated."""
    parts, losses = layout.parts
    of = {"nominal": layout.nominal, "cause": layout.pivots, "parts": parts, "losses": losses}
    of["flexibility"] = layout.residual_modes
    of |= {kind: tuple(hit for hit in layout.hits if hit[0] == kind) for kind in SET_UPS}
    out, absent = {}, [name for name, columns in of.items() if not columns]
    for f in fields(Sizes):
        grid = SETTINGS.sizes[f.name]
        if f.name == "noise":
            grid = grid if known.noise else SETTINGS.likelihood_noise_unknown
        elif f.name == "drift" and not layout.sessions:
            grid = ((Sizes().drift, 1.0),)
        elif f.name == "drift" and known.drift is not None:
            grid = ((max(known.drift, 1e-9), 1.0),)
        elif f.name == "within" and not layout.records:
            grid = ((Sizes().within, 1.0),)
        elif f.name == "within" and known.within is not None:
            grid = ((known.within, 1.0),)
        elif f.name in absent:
            grid = ((getattr(Sizes(), f.name), 1.0),)
        out[f.name] = grid
    return out


def _on_grid(sizes: Sizes, found: dict[str, tuple[tuple[float, float], ...]]) -> Sizes:
    def nearest(name: str) -> float:
        at = np.log(getattr(sizes, name))
        return min((v for v, _ in found[name]), key=lambda v: abs(np.log(v) - at))

    return Sizes(**{name: nearest(name) for name in found})
