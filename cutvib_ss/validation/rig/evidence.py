"""
Marginal likelihoods of responses whose calibration and movement between sessions are linear and Gaussian.

Residuals r = J v + noise over all unknowns v ~ N(0, 1): coordinates of a cause, tolerances, a trend with the temperature and
calibration errors, common to all sessions; and in each session its own movement. The latter are eliminated session by session.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import toeplitz

from cutvib_ss.validation.rig.structure import TOLERANCE

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TUNED = tuple(name for name in TOLERANCE if name != "calibration")
"""Values that a builder knows within a tolerance, in the order of their columns."""

MOVING = ("k1", "k2", "first_frequency", "c1", "c2", "damping_ratio")
"""Values that move between sessions, in the order of their columns: each by its tolerance times the drift over 0.01."""

WARMING = ("k1", "k2", "first_frequency")
"""Those that the temperature moves."""

_MOVING = [TUNED.index(name) for name in MOVING]
_WARMING = [TUNED.index(name) for name in WARMING]

_TREND = (1.22, 0.37)
"""Standard deviations of the change over the campaign and of its bow, over the movement between sessions."""

_BLOW = 0.052
"""When a blow falls, on average [s]."""

_CORNERS = np.exp(np.linspace(np.log(30.0), np.log(1000.0), 7))
_SHARES = np.array([0.7, 0.5, 0.35, 0.25, 0.15])


def calibration(freq: Array) -> tuple[Array, Array]:
    """Smooth errors of gain and of phase: columns (line, shape) of unit variance, averaged over where the axis bends."""
    share = TOLERANCE["calibration"] * _SHARES / np.linalg.norm(_SHARES)
    amplitude = share * np.sqrt([1.0, 2.0, 2.0, 2.0, 2.0])
    shapes = []
    for corner in _CORNERS:
        x = np.log1p(freq / corner) / np.log1p(2000.0 / corner)
        shapes.append(amplitude[:, None] * np.cos(np.pi * np.arange(5)[:, None] * x) / np.sqrt(_CORNERS.size))
    u, size, _ = np.linalg.svd(np.concatenate(shapes).T, full_matrices=False)
    kept = size > 1e-3 * size[0]
    gain = u[:, kept] * size[kept]
    return gain, gain * (freq / np.hypot(freq, 20.0))[:, None]


_BANDS = 4


@cache
def whitening(lines: int, step: float, rate: float) -> Complex:
    """
    What takes the correlation out of neighbouring lines: (band, line), of this line and those below it.

    White noise under the window exp(-rate t) has at lines a distance D apart the covariance of exp(-2 rate t) transformed
    at D, time counted from the blow. The inverse of its Cholesky factor falls off within few lines.
    """
    time = np.arange(0.0, 2.0, 5e-4)
    energy = np.exp(-2 * rate * time)
    apart = np.exp(-2j * np.pi * step * np.arange(lines)[:, None] * (time - _BLOW)) @ energy / energy.sum()
    covariance = toeplitz(apart)
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))
    bands = np.zeros((_BANDS, lines), dtype=np.complex128)
    for j in range(_BANDS):
        bands[j, j:] = np.diagonal(inverse, -j)
    return bands


def warming(sessions: int) -> Array:
    """What a trend of the temperature and its bow add to the logarithms of values in each session: (2, session)."""
    place = np.linspace(0.0, 1.0, sessions) if sessions > 1 else np.zeros(1)
    return np.array([_TREND[0] * place, _TREND[1] * place * (1 - place)])


@dataclass(frozen=True)
class Parts:
    """Normal matrices of a linearised model, by session: of what is common, across, of what is the session's own."""

    common: Array  # (n, n), summed over sessions
    across: Array  # (session, n, m)
    own: Array  # (session, m, m)
    right: Array  # (n)
    right_own: Array  # (session, m)
    square: float
    tuned: int  # Columns at the front that a fit follows: coordinates, tolerances, trend and its bow

    def after(self, step: Array, moved: Array) -> Parts:
        """The same linear model seen from a point that is a step away."""
        at, inner = np.zeros(self.right.size), np.zeros_like(self.right_own)
        at[: self.tuned], inner[:, : moved.shape[1]] = step, moved
        crossed = np.einsum("knm,km->n", self.across, inner)
        change = self.common @ at + crossed
        own = np.einsum("knm,n->km", self.across, at) + np.einsum("kij,kj->ki", self.own, inner)
        square = self.square - 2 * float(self.right @ at) - 2 * float(np.sum(self.right_own * inner))
        square += float(at @ change) + float(np.sum(inner * own))
        return replace(self, right=self.right - change, right_own=self.right_own - own, square=square)


@dataclass(frozen=True)
class Eliminated:
    """Normal matrix and right side of what is common, the square that is left, the log determinant; factors by session."""

    normal: Array
    full: Array
    square: float
    determinant: float
    factor: Array
    half: Array
    rest: Array
    scale: Array


def movements(stated: float | None) -> Mapping[float, float]:
    """Drifts that are tried, and their prior: what the generator does of it, given what machine.toml says."""
    if stated is not None:
        return {stated * f: w for f, w in ((0.75, 0.25), (1.0, 0.5), (1.33, 0.25))}
    return {0.0: 0.84} | dict.fromkeys((0.0013, 0.0024, 0.0042, 0.0075), 0.04)


class Marginal:
    """The likelihood of what was seen, its noise widened by an error of the model over the response."""

    def __init__(self, what: Any, error: float) -> None:
        self.what = what
        # Real and imaginary part carry half the variance each.
        self.weight = 1.0 / np.sqrt((what.noise**2 + (error * np.abs(what.data)) ** 2) / 2)
        freq = what.s.imag / (2 * np.pi)
        self.gain, self.phase = calibration(freq)
        self.bands = whitening(freq.size, round(float(freq[1] - freq[0]), 6), float(what.s[0].real))

    def _white(self, values: Complex) -> Array:
        """Weighted, real beside imaginary: (…, session, channel, 2 line)."""
        scaled = values * self.weight
        white = self.bands[0] * scaled
        for j in range(1, _BANDS):
            white[..., j:] += self.bands[j, j:] * scaled[..., :-j]
        return np.concatenate([white.real, white.imag], axis=-1)

    def parts(self, residual: Complex, fault: Complex, tuning: Complex, here: Complex) -> Parts:
        """Normal matrices about a point: residual there, and derivatives to coordinates and tolerances."""
        sessions, channels, _ = here.shape
        first = self._white(np.concatenate([fault, tuning]))
        r = self._white(residual)
        n_first = len(first)
        trend = self._white(warming(sessions)[..., None, None] * sum(tuning[k] for k in _WARMING) / 0.01)
        relative = np.concatenate([here[..., None] * self.gain, 1j * here[..., None] * self.phase], axis=-1)
        shapes = relative.shape[-1]
        cal = self._white(relative.transpose(3, 0, 1, 2))
        moved = self._white(tuning[_MOVING] / 0.01)
        gains = self._white(here)
        n, m = n_first + 2 + channels * shapes, len(_MOVING) + channels
        common, right = np.zeros((n, n)), np.zeros(n)
        across, own, right_own = np.zeros((sessions, n, m)), np.zeros((sessions, m, m)), np.zeros((sessions, m))
        for k in range(sessions):
            for c in range(channels):
                # Only this channel's calibration and gain are felt in it.
                block = np.concatenate(
                    [first[:, k, c], trend[:, k, c], cal[:, k, c], moved[:, k, c], gains[None, k, c]]
                )
                normal, with_r = block @ block.T, block @ r[k, c]
                at = np.r_[0 : n_first + 2, n_first + 2 + c * shapes : n_first + 2 + (c + 1) * shapes]
                alone = np.r_[0 : len(_MOVING), len(_MOVING) + c]
                cut = at.size
                common[np.ix_(at, at)] += normal[:cut, :cut]
                right[at] += with_r[:cut]
                across[k][np.ix_(at, alone)] += normal[:cut, cut:]
                own[k][np.ix_(alone, alone)] += normal[cut:, cut:]
                right_own[k][alone] += with_r[cut:]
        return Parts(common, across, own, right, right_own, float(np.sum(r**2)), n_first + 2)

    def _eliminated(self, parts: Parts, point: Array, moved: Array, drift: float) -> Eliminated:
        """What is common, sessions' own movements marginalised; the linear model holds about a point and about movements."""
        n = parts.right.size
        at = np.zeros(n)
        at[: parts.tuned] = point
        inner = np.zeros_like(parts.right_own)
        inner[:, : moved.shape[1]] = moved
        # The residual as it would be with all unknowns at zero: r + J v.
        crossed = np.einsum("knm,km->n", parts.across, inner)
        own = parts.right_own + np.einsum("knm,n->km", parts.across, at) + np.einsum("kij,kj->ki", parts.own, inner)
        full = parts.right + parts.common @ at + crossed
        square = parts.square + 2 * float(parts.right @ at) + float(at @ parts.common @ at) + 2 * float(at @ crossed)
        square += float(np.sum(inner * (parts.right_own + own - np.einsum("knm,n->km", parts.across, at))))
        scale = np.full(own.shape[1], self._within(drift))
        unit = self._unit(parts, drift)
        normal, full, determinant = parts.common * np.outer(unit, unit), full * unit, 0.0
        cross = parts.across * unit[:, None] * scale
        factor = np.linalg.cholesky(parts.own * np.outer(scale, scale) + np.eye(scale.size))
        determinant = 2 * float(np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2))))
        half = np.asarray(np.linalg.solve(factor, cross.transpose(0, 2, 1)), dtype=np.float64)
        rest = np.asarray(np.linalg.solve(factor, (own * scale)[..., None])[..., 0], dtype=np.float64)
        normal = normal - np.einsum("kmi,kmj->ij", half, half) + np.eye(n)
        full = full - np.einsum("kmi,km->i", half, rest)
        return Eliminated(normal, full, square - float(np.sum(rest**2)), determinant, factor, half, rest, scale)

    def _unit(self, parts: Parts, drift: float) -> Array:
        """Prior standard deviations of what is common: a trend's is the drift, the others have unit variance."""
        unit = np.ones(parts.right.size)
        if parts.tuned:
            unit[parts.tuned - 2 : parts.tuned] = drift
        return unit

    def _within(self, drift: float) -> float:
        """Movement of a session's mean: half of the machines move from record to record too."""
        return drift * float(np.sqrt(1 + 0.5 * 0.09 / max(self.what.levels, 1)))

    def misfit(self, parts: Parts, point: Array, moved: Array, drift: float) -> float:
        """Square of residual and unknowns at a point and at movements, calibration and gains at their best."""
        k, m = parts.tuned, moved.shape[1]
        linear = replace(
            parts,
            common=parts.common[k:, k:],
            across=parts.across[:, k:, m:],
            own=parts.own[:, m:, m:],
            right=parts.right[k:],
            right_own=parts.right_own[:, m:],
            tuned=0,
        )
        e = self._eliminated(linear, point[:0], moved[:, :0], drift)
        square = e.square - float(e.full @ np.linalg.solve(e.normal, e.full)) + float(point[:-2] @ point[:-2])
        if drift:
            square += float(np.sum((point[-2:] / drift) ** 2) + np.sum((moved / self._within(drift)) ** 2))
        return square

    def log_evidence(self, parts: Parts, point: Array, moved: Array, drift: float) -> float:
        """
        Log marginal likelihood of the linear model about a point; terms that are the same for all models are left out.

        By Laplace it is that of the model where the point is its best one: where `step` from it takes nothing away any more.
        """
        e = self._eliminated(parts, point, moved, drift)
        determinant = e.determinant + float(np.linalg.slogdet(e.normal)[1])
        return -0.5 * (e.square - float(e.full @ np.linalg.solve(e.normal, e.full)) + determinant)

    def step(self, parts: Parts, point: Array, moved: Array, drift: float) -> tuple[Array, Array]:
        """From the point, and from the movements, to the most probable ones of the linear model."""
        e = self._eliminated(parts, point, moved, drift)
        best = np.linalg.solve(e.normal, e.full)
        at = (best * self._unit(parts, drift))[: parts.tuned]
        own = np.linalg.solve(e.factor.transpose(0, 2, 1), (e.rest - e.half @ best)[..., None])[..., 0] * e.scale
        return at - point, own[:, : moved.shape[1]] - moved

    def alike(self, residuals: Complex, tuning: Complex, here: Complex, drift: float = 0.003) -> Array:
        """Log likelihood of many residuals, all but their cause marginalised about one point."""
        sessions, channels, _ = here.shape
        relative = np.concatenate([here[..., None] * self.gain, 1j * here[..., None] * self.phase], axis=-1)
        columns = [*tuning]
        for c in range(channels):
            only = np.zeros((relative.shape[-1], *here.shape), dtype=np.complex128)
            only[:, :, c] = relative[:, c].transpose(2, 0, 1)
            columns += [*only]
        for k in range(sessions):
            own = np.zeros((len(_MOVING), *here.shape), dtype=np.complex128)
            own[:, k] = drift / 0.01 * tuning[_MOVING, k]
            columns += [*own]
        u = self._white(np.array(columns)).reshape(len(columns), -1)
        white = self._white(residuals).reshape(len(residuals), -1)
        onto = np.linalg.solve(np.linalg.cholesky(np.eye(len(u)) + u @ u.T), u @ white.T)
        return np.asarray(-0.5 * (np.sum(white**2, axis=1) - np.sum(onto**2, axis=0)))
