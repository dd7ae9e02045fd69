"""
What the campaign's estimator would show of a model: the response at the window's s, less what the block cut off.

A block that ends T after the blow loses the rest of every mode that is still alive. By Cauchy's formula the transform of that
rest is, for each slow pole, the integral of H(z) e^((z-s)T) / (s - z) dz / 2πi around it, and the estimate is H(s) less
their sum. On a circle the trapezoidal rule converges geometrically, and because the circle stays where it is, the same sum over
dH(z) gives the derivative: no residue has to be differentiated. Fast modes have died out by then and are left alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cutvib_ss.diagnosis.pulses import pulses_of
from cutvib_ss.diagnosis.records import Group
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Carried, Model
from cutvib_ss.response.batched import mixed
from cutvib_ss.response.frequency import ChainedResponse
from cutvib_ss.results import ComplexArray, FloatArray


class Predicted(Protocol):
    """What a group's records should show."""

    @property
    def group(self) -> Group:
        """The records."""
        ...

    @property
    def data(self) -> ComplexArray:
        """Responses, shape (position, channel, frequency)."""
        ...


class Tail(NamedTuple):
    """What a block cuts off at one position."""

    position: int
    points: NDArray[np.intp]  # Of its circles, behind the lines
    lag: ComplexArray  # e^(zT) dz / 2πi there
    kernel: FloatArray  # By which real and imaginary parts of responses there make the tail at the lines


@dataclass(frozen=True)
class Circles:
    """Circles around the slow poles of a group's positions."""

    points: ComplexArray  # All points [rad/s]
    position: np.ndarray  # Index of the position that each belongs to
    weights: ComplexArray  # dz / 2πi
    # 1 / (s - z) between the points of each position, then their mirror images, and the line s; a circle outlives
    # many predictions, and so does this
    inverse: tuple[ComplexArray, ...]
    each: int  # Number of points on each circle
    steady: bool = True  # Whether the poles have not just left the circles before these
    # Tails by the blocks' rest and the lines: those of the last prediction that was made with these circles
    tails: dict[tuple[bytes, bytes], list[Tail]] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def centres(self) -> ComplexArray:
        """Centre of each circle."""
        return np.asarray(self.points.reshape(-1, self.each).mean(axis=1))

    def near(self, others: Circles) -> bool:
        """Whether these lie as others do, up to half a radius."""
        if self.points.size != others.points.size:
            return False
        radius = np.abs(self.points[:: self.each] - self.centres)
        return bool(np.all(np.abs(self.centres - others.centres) <= 0.5 * radius))


class Prediction:
    """A model seen through the estimator of a group of records."""

    def __init__(self, model: Model, group: Group, blow_at: float = 0.0, circles: Circles | None = None) -> None:
        self.model, self.group = model, group
        self._inputs = tuple(dict.fromkeys(group.inputs))
        # Records at one position share its response.
        self._positions, self._at = group.places
        sigma = float(group.decay_rate[0])
        self.s: ComplexArray = np.asarray(sigma + 2j * np.pi * group.freq, dtype=np.complex128)
        start = np.where(np.isnan(group.blow_at), blow_at, group.blow_at)
        self.rest = group.block - start
        self.window = np.exp(-sigma * start)[:, None, None]
        # Poles that have just left their circles are on their way, and are asked for first.
        values = self._responses(circles) if circles is not None and circles.steady else None
        if values is None or not still_inside(self.circles, values[:, :, self.s.size :]):
            drawn = slow_circles(model, group, start, self.s)
            if circles is not None:
                drawn = replace(drawn, steady=drawn.near(circles))
            values = self._responses(drawn)
        self._values = values
        self.data = self._estimate(values.copy())

    @property
    def untruncated(self) -> ComplexArray:
        """What a block without end would show, its window aside; shape (position, channel, frequency)."""
        return self._values[:, :, : self.s.size]

    @property
    def tail(self) -> ComplexArray:
        """What the blocks cut off, shape (position, channel, frequency)."""
        return np.asarray(self.untruncated * self.window - self.data)

    def _responses(self, circles: Circles) -> ComplexArray:
        """Responses on the line and on the circles, which become this prediction's; shape (position, channel, s)."""
        g, s = self.group, np.concatenate([self.s, circles.points])
        self.circles = circles
        self._response = ChainedResponse(self.model, self._positions, s, g.quantities, g.channels, self._inputs)
        return self._by_row(self._response.data())

    def _by_row(self, values: ComplexArray) -> ComplexArray:
        """Of responses to all inputs each row's own, shape (…, row, channel, s); without positions all rows show the same."""
        at = self._at if values.shape[-4] == len(self._positions) else 0 * self._at
        if len(self._inputs) == 1:
            alone: ComplexArray = values[..., 0, :]
            return alone if np.array_equal(at, np.arange(values.shape[-4])) else np.take(alone, at, axis=-3)
        own = [self._inputs.index(name) for name in self.group.inputs]
        out: ComplexArray = np.moveaxis(values, (-4, -2), (0, 1))[at, own]
        return np.moveaxis(out, 0, -3)

    @cached_property
    def _tails(self) -> list[Tail]:
        """For each position with slow poles what makes the tail of responses."""
        # Neither circles nor lines change while a model moves little.
        key = (self.rest.tobytes(), self.s.tobytes())
        if key not in self.circles.tails:
            self.circles.tails.clear()
            self.circles.tails[key] = list(self._made_tails())
        return self.circles.tails[key]

    def _made_tails(self) -> Iterator[Tail]:
        # Where there are no circles at all there are no inverses.
        for i, (inverse, rest) in enumerate(zip(self.circles.inverse, self.rest, strict=False)):
            own = np.flatnonzero(self.circles.position == i)
            if own.size:
                # e^((z-s)T) parts into a factor of each point and one of each line.
                # The tail's transform takes responses on the circles and on their mirror images: a real system mirrors each pole
                # in the real axis.
                lag = np.exp(self.circles.points[own] * rest) * self.circles.weights[own]
                upper, lower = np.stack([lag, lag.conj()])[:, :, None] * inverse.reshape(2, own.size, -1)
                # Of real and of imaginary parts, so that the products are real ones.
                kernel = np.empty((2, *upper.shape), dtype=np.complex128)
                np.add(upper, lower, out=kernel[0])
                np.multiply(1j, np.subtract(upper, lower, out=lower), out=kernel[1])
                kernel *= np.exp(-self.s * rest)
                yield Tail(i, self.s.size + own, lag, kernel.reshape(2 * own.size, -1).view(np.float64))

    def _estimate(self, values: ComplexArray) -> ComplexArray:
        """The estimator's view of responses on line and circles, shape (…, row, channel, s), which are given away."""
        out = values[..., : self.s.size]
        for i, own, _, kernel in self._tails:
            around = values[..., i, :, own[0] : own[-1] + 1]
            parts = np.concatenate([around.real, around.imag], axis=-1)
            tail = (parts.reshape(-1, parts.shape[-1]) @ kernel).view(np.complex128)
            out[..., i, :, :] -= tail.reshape(*parts.shape[:-1], -1)
        if self.s[0].real:
            out *= self.window
        return out

    def gained(self, gain: Callable[[FloatArray], ComplexArray]) -> ComplexArray:
        """The prediction of channels with a gain over frequency, shape (channel, frequency), which comes before the block's end."""
        at_lines = gain(self.group.freq)
        if self.group.widened or not self.circles.points.size:
            return self.data * at_lines
        # What is cut off of a mode has the gain at the mode's own frequency; outside of the band that at its end.
        own = np.abs(self.circles.centres.imag) / (2 * np.pi)
        around = gain(np.clip(own, self.group.freq[0], self.group.freq[-1]))
        every = np.concatenate([at_lines, np.repeat(around, self.circles.each, axis=1)], axis=1)
        return self._estimate(self._values * every)

    def derivative(self, carried: Carried) -> ComplexArray:
        """Derivative of the prediction along some of the model's values."""
        return np.asarray(self.derivatives([carried])[0])

    def derivatives(self, each: Sequence[Carried]) -> ComplexArray:
        """Derivatives of the prediction along several moves of the model's values, shape (move, row, channel, frequency)."""
        paths = list(dict.fromkeys(path for carried in each for path, _ in carried))
        if not paths:
            return np.zeros((len(each), *self.group.data.shape), dtype=np.complex128)
        changes = self._response.derivatives(paths)
        if all(len(carried) == 1 and carried[0][1] == 1.0 for carried in each) and len(paths) == len(each):
            return self._estimate(self._by_row(changes))
        weights = np.zeros((len(each), len(paths)))
        for row, carried in zip(weights, each, strict=True):
            for path, weight in carried:
                row[paths.index(path)] += weight
        return self._estimate(self._by_row(mixed(weights, changes)))

    def by_blow_at(self) -> ComplexArray:
        """Derivative to the instant of the blow, where the records do not say."""
        unknown = np.isnan(self.group.blow_at)[:, None, None]
        change = -self.group.decay_rate[:, None, None] * self.data
        for i, own, lag, _ in self._tails:
            ends = 2 * (self._values[i][:, own] @ lag).real
            change[i] -= ends[:, None] * np.exp(-self.s * self.rest[i]) * self.window[i]
        return np.where(unknown, change, 0.0)


def gained(p: Predicted, gain: Callable[[FloatArray], ComplexArray]) -> ComplexArray:
    """A prediction whose channels have a gain over frequency; of a simulated one that is not taken before the block's end."""
    return p.gained(gain) if isinstance(p, Prediction) else p.data * gain(p.group.freq)


def slow_frequencies(predictions: Sequence[Predicted]) -> list[float]:
    """Frequencies of the modes that have not died out when the blocks of some predictions end [Hz]."""
    circles = [p.circles for p in predictions if isinstance(p, Prediction)]
    points = [c.centres for c in circles if c.points.size]
    # What moves as a rigid body has no period.
    return [float(z.imag) / (2 * np.pi) for z in np.concatenate(points) if z.imag > abs(z) / 2] if points else []


def still_inside(circles: Circles, values: ComplexArray) -> bool:
    """Whether every circle still holds its pole well inside."""
    points = circles.points.reshape(-1, circles.each)
    weights, centre, count = circles.weights.reshape(points.shape), circles.centres, np.arange(len(points))
    own = values.reshape(*values.shape[:2], *points.shape)[circles.position[:: circles.each], :, count]
    best = own[count, np.abs(own).sum(axis=2).argmax(axis=1)] * weights
    total, radius = best.sum(axis=1), np.abs(points[:, 0] - centre)
    left = np.abs((best * points).sum(axis=1) - total * centre) > 0.5 * radius * np.abs(total)
    # Rigid motion stays where it is.
    rigid = np.abs(centre.imag) < 1e-9 * radius
    return not np.any((left | (total == 0)) & ~rigid)


def slow_circles(model: Model, group: Group, start: FloatArray, s: ComplexArray) -> Circles:
    """Circles around the poles that are still alive when the blocks end, of blows at the instants ``start``."""
    points, owner, weights = [], [], []
    positions, rest = group.positions, group.block - start
    sigma = float(s[0].real)
    died_out = SETTINGS.tail_widened if group.widened else SETTINGS.tail_died_out
    each = SETTINGS.tail_points_widened if group.widened else SETTINGS.tail_points
    turn = np.exp(2j * np.pi * (np.arange(each) + 0.5) / each)
    ending = np.flatnonzero(np.isfinite(rest))
    alive = light_poles(model, positions[ending]) if ending.size else []
    # A response without a block that ends, as a sine's, loses nothing; its element may differ from line to line.
    free = bool(ending.size) and any(q != "acceleration" for q in group.quantities) and moves_as_one(model)
    for i, light in zip(ending, alive, strict=True):
        # A window that was never taken out shifts the poles of what is measured.
        poles, time = light - model.chain.decay_rate, rest[i]
        for pole in poles[(poles.real - sigma) * time > died_out]:
            # No circle may hold another pole, which has its own.
            others = np.abs(poles - pole)
            nearest = float(np.min(others[others > 0], initial=np.inf))
            radius = SETTINGS.tail_radius * min(sigma - pole.real, nearest)
            points.append(pole + radius * turn)
            weights.append(radius * turn / each)
            owner.append(np.full(each, i))
        if free:
            # It is its own mirror image. On a wide circle e^(zT) would need more points.
            nearest = float(np.min(np.abs(light), initial=abs(s[0])))
            radius = min(SETTINGS.tail_radius * nearest, 1.0 / time)
            points.append(radius * turn - model.chain.decay_rate)
            weights.append(0.5 * radius * turn / each)
            owner.append(np.full(each, i))
    if not points:
        nothing = np.zeros(0, dtype=np.complex128)
        return Circles(nothing, np.zeros(0, dtype=int), nothing, (), each)
    z, own = np.concatenate(points), np.concatenate(owner)
    inverse = []
    for place in range(positions.size):
        mine = z[own == place]
        both = np.concatenate([mine, mine.conj()])
        replay = group.entries[place][0].replay if group.entries else None
        step = 0.0 if replay is None or replay.assumed or replay.block else 1.0 / replay.clock
        # The estimator sums samples: Σ e^((z-s)n Δt) Δt from the end of the block on; without samples the integral.
        kernel = step / (1.0 - np.exp(both * step)[:, None] * np.exp(-s * step)) if step else 1.0 / (s - both[:, None])
        if both.size:
            kernel = kernel * _blow_between(group, place, float(start[place]), mine, s)
        inverse.append(np.asarray(kernel, dtype=np.complex128))
    return Circles(z, own, np.concatenate(weights), tuple(inverse), each)


def _blow_between(group: Group, row: int, start: float, z: ComplexArray, s: ComplexArray) -> ComplexArray | float:
    """What a blow's length puts into the tail: its spectrum at z, then at their mirror images, over that at s, (point, line)."""
    # A mode at z rings with F(z), and the estimator (H1, which averages blows) divides by F(s). One for an impulse, and where no
    # force was recorded.
    entries = group.entries[row] if group.entries else ()
    replays = [e.replay for e in entries if e.replay is not None and not e.replay.assumed and not e.replay.block]
    if s[0].real or not replays or len(replays) < len(entries) or len({r.fs for r in replays}) > 1:
        return 1.0
    fs, forces = replays[0].fs, [f for r in replays for f in r.forces]
    if (row, start) not in group.blows:
        # Neither lines nor blows change while a group is fitted.
        pulses = pulses_of(forces, fs, start)
        spectra = pulses.transform(s)
        power = np.sum(np.abs(spectra) ** 2, axis=1)
        power = np.maximum(power, 1e-12 * power.max())
        group.blows[row, start] = pulses, (spectra.conj() / power[:, None]).T
    pulses, shares = group.blows[row, start]
    at_poles = pulses.transform(z)
    # A force is real: what it is at the mirror images of the poles is conjugate.
    return np.asarray(np.concatenate([at_poles, at_poles.conj()]) @ shares)


def moves_as_one(model: Model) -> bool:
    """Whether a structure has a rigid motion, up to the rounding of its matrices: it goes on moving after a blow."""
    if model.has_position:
        return False
    system = model.second_order(None, viscous_at=30.0)
    squares = linalg.eigvalsh(system.stiffness, system.mass, check_finite=False)
    return bool(squares[0] < _RIGID * squares[-1])


_RIGID = 1e-12
"""Of the largest square of a natural frequency: what twelve digits of a stiffness leave of none."""


def light_poles(model: Model, positions: FloatArray) -> list[ComplexArray]:
    """Poles of the upper half plane, to first order in the damping: enough to draw a circle around them."""
    # Hysteretic damping is made viscous at a low frequency, where slow modes are.
    stack = model.matrices(positions, viscous_at=30.0)
    # With M = L Lᵀ, all positions at once.
    below = np.linalg.inv(np.linalg.cholesky(stack.mass))
    squares, vectors = np.linalg.eigh(below @ stack.stiffness @ below.swapaxes(1, 2))
    shapes = below.swapaxes(1, 2) @ vectors
    decay = np.sum(shapes * (stack.damping @ shapes), axis=1) / 2
    found = []
    for square, own in zip(squares, decay, strict=True):
        # What rounding leaves of a rigid motion is no mode: it has a circle of its own (`moves_as_one`).
        alive = (square > own**2) & (own > 0) & (square > _RIGID * square[-1])
        found.append(-own[alive] + 1j * np.sqrt(square[alive] - own[alive] ** 2))
    return found
