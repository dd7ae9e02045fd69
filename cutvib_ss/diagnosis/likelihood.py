"""
Repeatability and discrepancy: the residual of a right model beyond sensor noise, as low-rank Gaussian directions.

    measured = H(x)·(1 + ε) + D_s z_s + Q v + noise,    z_s, v ~ N(0, 1) times their sizes

`D_s` moves the stiffnesses, dampings and gains of session s (repeatability). `Q` multiplies the dynamic stiffness of an element by
1 + δ(ω), with δ a smooth complex Gaussian process over log frequency that all sessions share (discrepancy): of the nominal
model's elements, and of the cause itself. Both are linear, so they are integrated out: with U = [D, Q] in whitened data the
covariance is 1 + U Uᵀ. Sizes are hyperparameters with priors; the evidence decides, and they are summed over in every hypothesis.
References: Kennedy and O'Hagan (2001) for the discrepancy; Rasmussen and Williams (2006), section 8.1, for the process.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.records import session_of
from cutvib_ss.diagnosis.unknowns import from_unknown
from cutvib_ss.results import ComplexArray, FloatArray

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.prediction import Predicted
    from cutvib_ss.diagnosis.problem import Problem
    from cutvib_ss.diagnosis.records import Group

GRID: dict[str, tuple[tuple[float, float], ...]] = {
    "drift": ((3e-5, 0.10), (1e-4, 0.10), (3e-4, 0.15), (1e-3, 0.25), (3e-3, 0.25), (1e-2, 0.12), (3e-2, 0.03)),
    "nominal": ((3e-5, 0.15), (1e-4, 0.15), (3e-4, 0.20), (1e-3, 0.25), (3e-3, 0.15), (1e-2, 0.08), (3e-2, 0.02)),
    "cause": ((1e-3, 0.10), (3e-3, 0.15), (1e-2, 0.25), (3e-2, 0.30), (1e-1, 0.15), (3e-1, 0.05)),
    "noise": ((1.0, 0.70), (1.3, 0.20), (2.0, 0.08), (4.0, 0.015), (10.0, 0.004), (100.0, 0.001)),
}
NOISE_UNKNOWN = tuple((float(v), 1.0 / 13.0) for v in np.geomspace(1.0, 1e6, 13))
"""Factors on the variance of responses that came without any scatter of repetitions: their noise is a guess."""
"""
Sizes with their prior probabilities, relative standard deviations. Drift: machines repeat to 0.1-2 %, rarely worse. Nominal: finite
elements and modal models of machined parts err by some tenths of a percent in dynamic stiffness once tuned. Cause: the constitutive
models of joints, contacts and losses hold to some percent, seldom to a tenth of that.
"""
LENGTH = 0.6
"""Correlation length of a discrepancy over the natural logarithm of frequency: it may change within most of an octave."""
KEPT = 1e-3
"""Relative variance below which a shape of the reduced-rank process is dropped."""
AMPLITUDE_LENGTH = 1.0
"""Correlation length of a restoring force's discrepancy over the natural logarithm of the amplitude of its motion."""
SAMPLED, LEFT, MOST_PIVOTS = 25, 0.02, 40
"""Points of a record, variance left and number of pivots for the process behind a cause's discrepancy."""
SMALL, ITERATIONS = 1e-4, 6
"""Drift that moves a response in proportion, and iterations in which a larger one of a held-out session is found."""
MOST_LAGS, CORRELATED = 60, 0.1
"""Lags over which residuals are correlated at most, and the correlation that stands out."""
FARTHEST = 6.0
"""Standard deviations that a session may drift."""
MARGIN = 1e-9
"""Precision that keeps a normal matrix regular."""


@dataclass(frozen=True)
class Sizes:
    """
    Relative standard deviations of drift between sessions, and of the discrepancy of nominal elements and of the cause.

    `noise` is a factor on the variance of the noise.
    """

    drift: float = 1e-3
    nominal: float = 3e-4
    cause: float = 1e-2
    noise: float = 1.0


@dataclass(frozen=True)
class Layout:
    """Which columns the directions take behind the unknowns of a problem, and the smooth shapes they are made of."""

    unknowns: int
    sessions: tuple[tuple[float | str, ...], ...]
    channels: tuple[str, ...]
    drifting: tuple[int, ...]
    nominal: tuple[int, ...]
    pivots: tuple[tuple[float, float], ...]
    shapes: int

    @property
    def per_session(self) -> int:
        """Directions of one session: tuned values, then real and imaginary gain of each channel."""
        return len(self.drifting) + 2 * len(self.channels)

    @property
    def first_nominal(self) -> int:
        """First column of the nominal elements' discrepancy."""
        return self.unknowns + self.per_session * len(self.sessions)

    @property
    def first_cause(self) -> int:
        """First column of the causes' discrepancy."""
        return self.first_nominal + 2 * self.shapes * len(self.nominal)

    @property
    def size(self) -> int:
        """All columns."""
        return self.first_cause + 2 * len(self.pivots)

    def scale(self, sizes: Sizes) -> FloatArray:
        """Factor on each column."""
        out = np.ones(self.size)
        out[self.unknowns : self.first_nominal] = sizes.drift
        out[self.first_nominal : self.first_cause] = sizes.nominal
        out[self.first_cause :] = sizes.cause
        return out


def smooth_shapes(freq: FloatArray, band: tuple[float, float]) -> FloatArray:
    """Reduced-rank squared-exponential process over log frequency, shape (shape, frequency): coefficients are N(0, 1)."""
    low, high = (float(np.log(max(f, 1e-9))) for f in band)
    at = np.linspace(low, high, 1 + int(np.ceil((high - low) / (0.6 * LENGTH))))
    inside = np.exp(-0.5 * ((at[:, None] - at) / LENGTH) ** 2)
    variance, vectors = np.linalg.eigh(inside)
    keep = variance > KEPT * variance[-1]
    across = np.exp(-0.5 * ((np.log(freq)[None] - at[:, None]) / LENGTH) ** 2)
    return np.asarray((vectors[:, keep] / np.sqrt(variance[keep])).T @ across)


class Directions:
    """
    Unit directions of drift and discrepancy of a problem's records, at one set of unknowns.

    Every direction is a row of the problem's Jacobian, or the prediction itself, times a smooth real function.
    """

    def __init__(
        self,
        problem: Problem,
        x: FloatArray | Sequence[FloatArray],
        predictions: Sequence[Predicted],
        spread: bool = True,
        like: Layout | None = None,
    ) -> None:
        self.problem = problem
        self.groups = [p.group for p in predictions]
        band = problem.band
        self.smooth = [smooth_shapes(g.freq, band) for g in self.groups]
        drift, nominal = weights(problem)
        each = [x] * len(predictions) if isinstance(x, np.ndarray) else list(x)
        self.cause = _cause_weights(problem, each[0])
        self.drift, self.nominal = drift, nominal
        self.layout = like or Layout(
            problem.size,
            problem.sessions if spread else (),
            problem.channels,
            tuple(np.flatnonzero(drift).tolist()),
            tuple(np.flatnonzero(nominal).tolist()) if spread else (),
            _pivots(problem) if spread and np.any(self.cause) else (),
            self.smooth[0].shape[0],
        )
        self._shapes: dict[tuple[int, int], FloatArray] = {}
        self.rows = [problem.jacobian(own, p) for own, p in zip(each, predictions, strict=True)]
        self.plain = [p.data * np.sqrt(2.0 / g.variance) for p, g in zip(predictions, self.groups, strict=True)]

    def chunks(self) -> Iterator[tuple[int, np.ndarray, int, np.ndarray, ComplexArray]]:
        """Group, its rows of one session, channel, columns, and the weighted directions there (column, row, frequency)."""
        lay, problem = self.layout, self.problem
        shapes = lay.shapes
        own_nominal = lay.first_nominal + np.arange(2 * shapes * len(lay.nominal))
        for i, (g, (shared, own)) in enumerate(zip(self.groups, self.rows, strict=True)):
            names = [session_of(same[0]) for same in g.entries]
            count = len(own[0]) // 2 if own else 0
            cause = np.tensordot(self.cause, shared[len(shared) - len(self.cause) :], 1) if lay.pivots else None
            for name in dict.fromkeys(names):
                rows = np.array([k for k, other in enumerate(names) if other == name])
                for c, channel in enumerate(g.channels):
                    index, parts = [problem.shared], [shared[:, rows, c]]
                    if channel in problem.channels and count:
                        index.append(problem.own(channel, count))
                        parts.append(own[c].reshape(2 * count, len(g.data), -1)[:, rows])
                    if name in lay.sessions:
                        first = lay.unknowns + lay.per_session * lay.sessions.index(name)
                        moved = np.array(lay.drifting, dtype=int)
                        index.append(first + np.arange(moved.size))
                        parts.append(self.drift[moved, None, None] * shared[moved][:, rows, c])
                        if channel in lay.channels:
                            gain = first + moved.size + 2 * lay.channels.index(channel)
                            index.append(np.array([gain, gain + 1]))
                            parts.append(np.array([1.0, 1j])[:, None, None] * self.plain[i][rows, c])
                    if lay.nominal:
                        moved = np.array(lay.nominal)
                        index.append(own_nominal)
                        parts.append(self._smoothed(self.nominal[moved, None, None] * shared[moved][:, rows, c], i))
                    if cause is not None:
                        own_shapes = self._of_cause(i, rows)
                        real = own_shapes.swapaxes(0, 1) * cause[rows, c]
                        index.append(lay.first_cause + np.arange(2 * len(lay.pivots)))
                        parts.append(np.concatenate([real, 1j * real]))
                    yield i, rows, c, np.concatenate(index), np.concatenate(parts)

    def _of_cause(self, group: int, rows: np.ndarray) -> FloatArray:
        """Shapes of the cause's discrepancy at some rows of a group, shape (row, shape, frequency)."""
        found = []
        for k in rows.tolist():
            if (group, k) not in self._shapes:
                self._shapes[group, k] = _over(self.layout.pivots, *_features(self.groups[group], k, self.problem))
            found.append(self._shapes[group, k])
        return np.array(found)

    def _smoothed(self, rows: ComplexArray, group: int) -> ComplexArray:
        """Rows times each smooth shape, real and imaginary, shape (row · 2 shape, position, frequency)."""
        real = rows[:, None] * self.smooth[group][:, None, :]
        return np.stack([real, 1j * real], axis=1).reshape(-1, *rows.shape[1:])

    def normal(self, residuals: Sequence[ComplexArray]) -> tuple[FloatArray, FloatArray]:
        """Normal matrix and gradient of the data in all columns, at unit sizes."""
        matrix, gradient = np.zeros((self.layout.size,) * 2), np.zeros(self.layout.size)
        for i, rows, c, index, part in self.chunks():
            flat = _real(part)
            matrix[np.ix_(index, index)] += flat @ flat.T
            gradient[index] += flat @ _real(residuals[i][None, rows, c])[0]
        return matrix, gradient

    def correlation(self, residuals: Sequence[ComplexArray], coefficients: FloatArray) -> float:
        """
        Integrated correlation of the residuals along frequency, 1 + 2 Σ ρ, the directions taken out with their coefficients.

        The sum ends at the first lag whose correlation does not stand out (Sokal 1997, on autocorrelation times).
        """
        sums: dict[int, float] = {}
        for i, rows, c, index, part in self.chunks():
            r = residuals[i][rows, c] - np.tensordot(coefficients[index], part, 1)
            for lag in range(min(MOST_LAGS, r.shape[-1] // 3)):
                power = float(np.sum((r[:, lag:] * r[:, : r.shape[-1] - lag].conj()).real))
                sums[lag] = sums.get(lag, 0.0) + power * r.shape[-1] / (r.shape[-1] - lag)
        count = sum(g.data.size for g in self.groups)
        total = 1.0
        for lag in range(1, len(sums)):
            rho = sums[lag] / max(sums[0], 1e-300)
            if rho < max(CORRELATED, 2.0 / np.sqrt(count)):
                break
            total += 2.0 * rho
        return total

    def flat(self) -> FloatArray:
        """All columns over all data, shape (column, datum): of each group the real parts, then the imaginary ones."""
        size = sum(g.data.size for g in self.groups)
        out = np.zeros((self.layout.size, 2 * size))
        offset = 0
        starts = []
        for g in self.groups:
            starts.append(offset)
            offset += 2 * g.data.size
        for i, rows, c, index, part in self.chunks():
            g = self.groups[i]
            at = np.arange(g.data.size).reshape(g.data.shape)[rows, c].ravel() + starts[i]
            values = part.reshape(len(part), -1)
            out[np.ix_(index, at)] = values.real
            out[np.ix_(index, at + g.data.size)] = values.imag
        return out


@dataclass(frozen=True)
class Spread:
    """Drift and discrepancy of a fit."""

    layout: Layout  # Columns: the unknowns, then the directions
    sizes: Sizes  # Sizes of the directions
    offsets: FloatArray  # Coefficients of the directions, in their sizes; zero for the unknowns
    precision: FloatArray  # Posterior precision of all columns

    def drifts(self, sessions: Sequence[tuple[float | str, ...]], count: int) -> FloatArray:
        """Drift of the tuned values of some sessions, zero of those that were not fitted; shape (session, value)."""
        lay = self.layout
        out = np.zeros((len(sessions), count))
        if len(lay.drifting) == count:
            for k, name in enumerate(sessions):
                if name in lay.sessions:
                    first = lay.unknowns + lay.per_session * lay.sessions.index(name)
                    out[k] = self.sizes.drift * self.offsets[first : first + count]
        return out

    def with_session(self, name: tuple[float | str, ...]) -> Spread:
        """The same with one more session, of which nothing is known but the size of its drift."""
        lay = self.layout
        if not lay.sessions or name in lay.sessions:
            return self
        more = replace(lay, sessions=(*lay.sessions, name))
        old = np.r_[: lay.first_nominal, more.first_nominal : more.size]
        offsets, precision = np.zeros(more.size), np.eye(more.size)
        offsets[old] = self.offsets
        precision[np.ix_(old, old)] = self.precision
        return Spread(more, self.sizes, offsets, precision)

    def left(
        self,
        problem: Problem,
        x: FloatArray,
        name: tuple[float | str, ...],
        show: Callable[[FloatArray], tuple[Predicted, ComplexArray]],
    ) -> tuple[FloatArray, float]:
        """
        χ² a datum of one record under the posterior predictive, by channel, and the mean square that drift alone leaves.

        The covariance is 1 + A C Aᵀ in whitened data, A the derivatives to all columns, C their posterior covariance. The drift of
        a session that was not fitted is taken where the record has it, and pays its prior.
        """
        own = self.with_session(name)
        lay, scale = own.layout, own.layout.scale(own.sizes)
        drift, _ = weights(problem)
        moved = np.array(lay.drifting, dtype=int)
        z = np.zeros(lay.size)
        mean = own.offsets.copy()
        at = slice(0, 0)
        if name in lay.sessions:
            first = lay.unknowns + lay.per_session * lay.sessions.index(name)
            at = slice(first, first + moved.size)
            z[at], mean[at] = mean[at], 0.0
        new = name not in self.layout.sessions and own.sizes.drift > SMALL
        for iteration in range(ITERATIONS if new else 1):
            there = x.copy()
            there[moved] += drift[moved] * own.sizes.drift * z[at] if at.stop else 0.0
            shown, residual = show(there)
            chunks = list(Directions(problem, there, [shown], like=lay).chunks())
            if iteration < ITERATIONS - 1 and new:
                matrix, pulled = own.precision.copy(), np.zeros(lay.size)
                for _, _, c, index, part in chunks:
                    flat = _real(part) * scale[index, None]
                    matrix[np.ix_(index, index)] += flat @ flat.T / own.sizes.noise
                    pulled[index] += flat @ (_real(residual[None, c])[0] - mean[index] @ flat) / own.sizes.noise
                pulled[at] -= z[at]
                z[at] += linalg.solve(matrix, pulled, assume_a="pos", check_finite=False)[at]
                z[at] = np.clip(z[at], -FARTHEST, FARTHEST)
        out = np.empty(residual.shape[0])
        known = 0.0 if not new else float(z[at] @ z[at])
        drifts = []
        for _, _, c, index, part in chunks:
            flat = _real(part) * scale[index, None]
            moving = (index >= lay.unknowns) & (index < lay.first_nominal)
            variance = shown.group.variance[0, c] / 2
            drifts.append(
                float(np.mean(np.sum(np.abs(part[moving, 0] * scale[index[moving], None]) ** 2, axis=0) * variance))
            )
            r = _real(residual[None, c])[0] - mean[index] @ flat
            inner, pulled = own.precision.copy(), np.zeros(lay.size)
            inner[np.ix_(index, index)] += flat @ flat.T / own.sizes.noise
            pulled[index] = flat @ r / own.sizes.noise
            if new:
                pulled[at] -= z[at]
            gain = pulled @ linalg.solve(inner, pulled, assume_a="pos", check_finite=False)
            out[c] = (r @ r / own.sizes.noise + known - gain) / r.size
        return out, float(np.mean(drifts))


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
        prior[:n] = self.precision + MARGIN
        matrix[np.diag_indices_from(matrix)] += prior
        gradient[:n] -= self.precision * self.x
        gradient[n:] -= self.offsets[n:] / scale[n:]
        return matrix, gradient

    def at(self, sizes: Sizes) -> float:
        """Squares of the residuals and of the priors at the point."""
        n, scale = self.layout.unknowns, self.layout.scale(sizes)
        drifted = self.offsets[n:] / scale[n:]
        return self.squares / sizes.noise + float(self.precision @ self.x**2) + float(drifted @ drifted)

    def log_evidence(self, sizes: Sizes) -> float:
        """Laplace's evidence for given sizes, up to a constant of the data."""
        matrix, gradient = self.system(sizes)
        n, index = self.layout.unknowns, np.flatnonzero(self.even)
        e = index.size
        matrix[index, index] += 12.0
        free = np.concatenate([self.free, np.ones(self.layout.size - n, dtype=bool)])
        # An unknown at its bound keeps its share of the determinant, but does not move.
        size = np.sqrt(np.diag(matrix))
        factor = linalg.cholesky(matrix / np.outer(size, size), lower=True, check_finite=False)
        log_det = 2.0 * float(np.sum(np.log(np.diag(factor))) + np.sum(np.log(size)))
        if free.all():
            pulled = linalg.solve_triangular(factor, gradient / size, lower=True, check_finite=False)
            gain = float(pulled @ pulled)
        else:
            inner = matrix[np.ix_(free, free)]
            gain = float(gradient[free] @ linalg.solve(inner, gradient[free], assume_a="pos", check_finite=False))
        noise = self.count * float(np.log(sizes.noise))
        return -0.5 * (self.at(sizes) - gain + log_det + noise) + 0.5 * e * float(np.log(2 * np.pi))

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


@dataclass(frozen=True)
class Known:
    """What is stated of the sizes: the drift, and whether the noise was seen to scatter."""

    drift: float | None = None
    noise: bool = True


def grids(layout: Layout, known: Known) -> dict[str, tuple[tuple[float, float], ...]]:
    """Sizes that are searched, with their prior; one value where there are no such directions, or the drift is stated."""
    out = {}
    for f in fields(Sizes):
        grid = GRID[f.name]
        if f.name == "noise":
            grid = grid if known.noise else NOISE_UNKNOWN
        elif f.name == "drift" and not layout.sessions:
            grid = ((Sizes().drift, 1.0),)
        elif f.name == "drift" and known.drift is not None:
            grid = ((max(known.drift, 1e-9), 1.0),)
        elif (f.name == "nominal" and not layout.nominal) or (f.name == "cause" and not layout.pivots):
            grid = ((getattr(Sizes(), f.name), 1.0),)
        out[f.name] = grid
    return out


def _on_grid(sizes: Sizes, found: dict[str, tuple[tuple[float, float], ...]]) -> Sizes:
    def nearest(name: str) -> float:
        at = np.log(getattr(sizes, name))
        return min((v for v, _ in found[name]), key=lambda v: abs(np.log(v) - at))

    return Sizes(**{name: nearest(name) for name in found})


def _real(rows: ComplexArray) -> FloatArray:
    """Complex rows as real ones: products are real parts of inner products."""
    return np.ascontiguousarray(rows.reshape(len(rows), -1)).view(np.float64)


def weights(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """
    By how much each tuned value's row of the Jacobian is a relative drift, and a relative error of dynamic stiffness.

    A row is the derivative to one tolerance. A frequency moves by half of what its stiffness moves. A damping drifts by as many
    tolerances as the stiffness beside it.
    """
    tolerance = {path[-1]: t for path, t in problem.tuning}
    beside = {"c1": "k1", "c2": "k2", "damping_ratio": "first_frequency", 1: 2}
    stiff = {"k1": 1.0, "k2": 1.0, "first_frequency": 0.5, 2: 1.0}
    drift, nominal = np.zeros(len(problem.tuning)), np.zeros(len(problem.tuning))
    for i, (path, own) in enumerate(problem.tuning):
        name = path[-1]
        if name in stiff:
            drift[i] = nominal[i] = stiff[name] / own
        elif name in beside:
            other = beside[name]
            drift[i] = stiff[other] / tolerance[other] if other in tolerance else 10.0 / own
    if not nominal.any():
        # A free body has no stiffness to err: its mass does.
        nominal = np.array([1.0 / t if path[-1] in (0, "m1", "m2") else 0.0 for path, t in problem.tuning])
    return drift, nominal


def _cause_weights(problem: Problem, x: FloatArray) -> FloatArray:
    """By how much each row of the effects' parameters is a relative error of the cause's dynamic stiffness."""
    effects = problem.effects(x)
    out = np.zeros(len(problem.parameters))
    for i, (which, name, r) in enumerate(problem.parameters):
        slope = from_unknown(float(x[problem.first_effect + i]), r)[1]
        out[i] = effects[which].by_size().get(name, 0.0) / slope
    return out


def _features(g: Group, row: int, problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Over what a cause's discrepancy is smooth, in correlation lengths: log frequency, and log amplitude if it is nonlinear."""
    u = np.log(g.freq) / LENGTH
    if problem.hypothesis.linear:
        return u, np.zeros(u.size)
    entry = g.entries[row][0]
    if np.isfinite(entry.sweep):
        amplitude = entry.sweep * np.sqrt(np.mean(np.abs(g.data[row]) ** 2, axis=0))
        return u, np.log(np.maximum(amplitude, 1e-300)) / AMPLITUDE_LENGTH
    return u, np.full(u.size, float(np.log(np.nan_to_num(entry.level, nan=1.0))) / AMPLITUDE_LENGTH)


def _over(pivots: Sequence[tuple[float, float]], u: FloatArray, w: FloatArray) -> FloatArray:
    """Shapes with independent N(0, 1) coefficients at some points, shape (pivot, point)."""
    at = np.array(pivots)

    def kernel(a: FloatArray, b: FloatArray) -> FloatArray:
        return np.asarray(np.exp(-0.5 * np.sum((a[:, None] - b[None]) ** 2, axis=-1)))

    lower = np.linalg.cholesky(kernel(at, at) + 1e-8 * np.eye(len(at)))
    return linalg.solve_triangular(lower, kernel(at, np.stack([u, w], axis=-1)), lower=True)


def _pivots(problem: Problem) -> tuple[tuple[float, float], ...]:
    """Points that carry the process over all data, by pivoted Cholesky: the variance that they leave is small everywhere."""
    points = []
    for g in problem.groups:
        for row in range(len(g.data)):
            u, w = _features(g, row, problem)
            keep = np.unique(np.linspace(0, u.size - 1, min(u.size, SAMPLED)).round().astype(int))
            points.append(np.stack([u[keep], w[keep]], axis=-1))
    every = np.unique(np.concatenate(points).round(6), axis=0)
    left = np.ones(len(every))
    rows: list[FloatArray] = []
    chosen: list[tuple[float, float]] = []
    while left.max() > LEFT and len(chosen) < MOST_PIVOTS:
        k = int(np.argmax(left))
        column = np.exp(-0.5 * np.sum((every - every[k]) ** 2, axis=-1))
        column = (column - sum((r[k] * r for r in rows), np.zeros(len(every)))) / np.sqrt(left[k])
        rows.append(column)
        left = np.maximum(left - column**2, 0.0)
        left[k] = 0.0
        chosen.append((float(every[k, 0]), float(every[k, 1])))
    return tuple(chosen)
