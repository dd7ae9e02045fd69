"""
What the campaign's estimator would show of a model: the response at the window's s, less what the block cut off.

A block that ends T after the blow loses the rest of every mode that is still alive. By Cauchy's formula the transform of that
rest is, for each slow pole, the integral of H(z) e^((z-s)T) / (s - z) dz / 2πi around it, and the estimate is H(s) less
their sum. On a circle the trapezoidal rule converges geometrically, and because the circle stays where it is, the same sum over
dH(z) gives the derivative: no residue has to be differentiated. Fast modes have died out by then and are left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cutvib_ss.effects.base import Carried, Model
from cutvib_ss.gap.observations import Group
from cutvib_ss.response.frequency import ChainedResponse
from cutvib_ss.results import ComplexArray, FloatArray

DIED_OUT = -10.0
"""Modes whose real part times T lies below this have left less than 5e-5 of themselves at the end of the block."""
POINTS = 16
"""Points on each circle; with the radius below the rule's error is 0.4^16 = 4e-7 of the tail."""
RADIUS = 0.4
"""Radius of each circle, as a fraction of its pole's distance from the line s = σ + jω."""


@dataclass(frozen=True)
class Circles:
    """
    Circles around the slow poles of a group's positions.

    Parameters
    ----------
    points : ndarray of complex, shape (point,)
        All points [rad/s].
    position : ndarray of int, shape (point,)
        Index of the position that each belongs to.
    weights : ndarray of complex, shape (point,)
        dz / 2πi.
    """

    points: ComplexArray
    position: np.ndarray
    weights: ComplexArray


class Prediction:
    """
    A model seen through the estimator of a group of records.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    group : Group
        The records; all under one window.
    blow_at : float
        Instant of the blow [s] where the records do not say.
    """

    def __init__(self, model: Model, group: Group, blow_at: float = 0.0) -> None:
        self.model, self.group = model, group
        sigma = float(group.decay_rate[0])
        self.s = sigma + 2j * np.pi * group.freq
        self.response = self._responses(self.s)
        start = np.where(np.isnan(group.blow_at), blow_at, group.blow_at)
        self.rest = group.block - start
        self.window = np.exp(-sigma * start)[:, None, None]
        self.circles = slow_circles(model, group.positions, self.rest, sigma)
        self.around = self._responses(self.circles.points) if self.circles.points.size else None
        self.data = self._estimate(self.response.data(), None if self.around is None else self.around.data())

    def _responses(self, s: ComplexArray) -> ChainedResponse:
        g = self.group
        return ChainedResponse(self.model, g.positions, s, g.quantities, g.channels, ("force",))

    def _estimate(self, on_line: ComplexArray, on_circles: ComplexArray | None) -> ComplexArray:
        out: ComplexArray = on_line[:, :, 0]
        if on_circles is not None:
            out = out - self._rest(on_circles, 1)
        return out * self.window

    def _rest(self, on_circles: ComplexArray, order: int) -> ComplexArray:
        """Transform of what the blocks cut off (order 1), or minus its derivative to their length (order 0)."""
        out = np.zeros(self.group.data.shape, dtype=np.complex128)
        for i, rest in enumerate(self.rest):
            own = self.circles.position == i
            if not own.any():
                continue
            z, w = self.circles.points[own], self.circles.weights[own]
            values = on_circles[i, :, 0][:, own]
            # A real system mirrors each pole in the real axis.
            for points, samples in ((z, values * w), (z.conj(), (values * w).conj())):
                kernel = np.exp((points[:, None] - self.s) * rest) / (self.s - points[:, None]) ** order
                out[i] += samples @ kernel
        return out

    def derivative(self, carried: Carried) -> ComplexArray:
        """
        Derivative of the prediction along some of the model's values.

        Parameters
        ----------
        carried : tuple of (path, weight)
            Paths and weights.

        Returns
        -------
        ndarray, shape (position, channel, frequency)
            The derivative.
        """
        total: ComplexArray = np.zeros(self.group.data.shape, dtype=np.complex128)
        for path, weight in carried:
            around = None if self.around is None else self.around.derivative(path)
            total = total + weight * self._estimate(self.response.derivative(path), around)
        return total

    def by_blow_at(self) -> ComplexArray:
        """
        Derivative to the instant of the blow, where the records do not say.

        Returns
        -------
        ndarray, shape (position, channel, frequency)
            The derivative.
        """
        unknown = np.isnan(self.group.blow_at)[:, None, None]
        change = -self.group.decay_rate[:, None, None] * self.data
        if self.around is not None:
            change = change - self._rest(self.around.data(), 0) * self.window
        return np.where(unknown, change, 0.0)


def slow_circles(model: Model, positions: FloatArray, rest: FloatArray, sigma: float) -> Circles:
    """
    Circles around the poles that are still alive when the blocks end.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    positions : ndarray, shape (position,)
        y_b / L.
    rest : ndarray, shape (position,)
        Time from blow to end of the block [s]; infinite where nothing is cut off.
    sigma : float
        Rate of the window on the response [1/s].

    Returns
    -------
    Circles
        Empty where nothing is left.
    """
    points, owner, weights = [], [], []
    turn = np.exp(2j * np.pi * (np.arange(POINTS) + 0.5) / POINTS)
    for i, (position, time) in enumerate(zip(positions, rest, strict=True)):
        if not np.isfinite(time):
            continue
        # A window that was never taken out shifts the poles of what is measured.
        poles = light_poles(model, float(position)) - model.chain.decay_rate
        for pole in poles[(poles.real - sigma) * time > DIED_OUT]:
            radius = RADIUS * (sigma - pole.real)
            points.append(pole + radius * turn)
            weights.append(radius * turn / POINTS)
            owner.append(np.full(POINTS, i))
    if not points:
        return Circles(np.zeros(0, dtype=np.complex128), np.zeros(0, dtype=int), np.zeros(0, dtype=np.complex128))
    return Circles(np.concatenate(points), np.concatenate(owner), np.concatenate(weights))


def light_poles(model: Model, position: float) -> ComplexArray:
    """
    Poles of the upper half plane, to first order in the damping: enough to draw a circle around them.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    position : float
        y_b / L; NaN for a structure.

    Returns
    -------
    ndarray of complex
        Poles of damped modes [rad/s].
    """
    # Hysteretic damping is made viscous at a low frequency, where slow modes are.
    system = model.second_order(None if np.isnan(position) else position, viscous_at=30.0)
    squares, shapes = linalg.eigh(system.stiffness, system.mass)
    decay = np.einsum("im,ij,jm->m", shapes, system.damping, shapes) / 2
    alive = (squares > decay**2) & (decay > 0)
    poles: ComplexArray = -decay[alive] + 1j * np.sqrt(squares[alive] - decay[alive] ** 2)
    return poles


def ports_of_channels(model: Model, channels: Sequence[str]) -> tuple[str, ...]:
    """
    Ports that channels read.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    channels : sequence of str
        Channels.

    Returns
    -------
    tuple of str
        Names of the ports.
    """
    return tuple(model.channels[c].port for c in channels)
