"""How the head travels along the rail: position as a function of time, piecewise polynomial, at rest before and after."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy import interpolate

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import check_number, check_position
from cutvib_ss.results import FloatArray


@dataclass(frozen=True, eq=False)
class Travel:
    """Position y_b / L as a function of time."""

    curve: interpolate.PPoly  # Pieces; before the first and after the last the head stands

    def __post_init__(self) -> None:
        # Extremes lie at the ends of pieces and where the rate vanishes.
        turns = self.curve.derivative().roots(extrapolate=False)
        instants = np.concatenate([self.curve.x, turns[np.isfinite(turns)]])
        for y in self.curve(instants):
            check_position(float(y))

    @property
    def duration(self) -> float:
        """Instant at which the last piece ends [s]."""
        return float(self.curve.x[-1])

    def at(self, time: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position, and its first and second derivative to time."""
        t = np.asarray(time, dtype=float)
        held = np.clip(t, self.curve.x[0], self.curve.x[-1])
        moving = (t >= self.curve.x[0]) & (t < self.curve.x[-1])
        return self.curve(held), np.where(moving, self.curve(held, 1), 0.0), np.where(moving, self.curve(held, 2), 0.0)


def standing(position: float) -> Travel:
    """A head that stands."""
    return Travel(interpolate.PPoly(np.array([[check_position(position)]]), np.array([0.0, 1.0])))


def trapezoid(start: float, end: float, speed: float, acceleration: float, length: float, begin: float = 0.0) -> Travel:
    """
    Even acceleration, even speed, even deceleration.

    >>> round(trapezoid(0.2, 0.8, 1.0, 5.0, 2.5).duration, 6)
    1.7
    """
    way = _way(start, end, length, speed=speed, acceleration=acceleration)
    fastest = min(speed, sqrt(way * acceleration))
    ramp = fastest / acceleration
    durations = [ramp, way / fastest - ramp, ramp]
    return _from_jerks(start, end, length, begin, durations, [0.0] * 3, [acceleration, 0.0, -acceleration])


def s_curve(
    start: float, end: float, speed: float, acceleration: float, jerk: float, length: float, begin: float = 0.0
) -> Travel:
    """
    A travel whose acceleration is continuous: seven pieces of even jerk.

    From rest to speed v takes v/a + a/j, or 2√(v/j) where the acceleration a is not reached; on the way of length D the
    speed is the largest for which v times that is at most D.

    >>> round(s_curve(0.2, 0.8, 1.0, 5.0, 50.0, 2.5).duration, 6)
    1.8
    """
    way = _way(start, end, length, speed=speed, acceleration=acceleration, jerk=jerk)
    # v (v/a + a/j) = D, or where a is not reached 2 v √(v/j) = D.
    fastest = (way**2 * jerk / 4) ** (1 / 3)
    if fastest > acceleration**2 / jerk:
        half = acceleration**2 / (2 * jerk)
        fastest = sqrt(half**2 + way * acceleration) - half
    fastest = min(fastest, speed)
    swing = min(acceleration / jerk, sqrt(fastest / jerk))
    even = fastest / (jerk * swing) - swing
    cruise = way / fastest - (2 * swing + even)
    durations = [swing, even, swing, cruise, swing, even, swing]
    top = jerk * swing
    return _from_jerks(
        start, end, length, begin, durations,
        [jerk, 0.0, -jerk, 0.0, -jerk, 0.0, jerk], [0.0, top, top, 0.0, 0.0, -top, -top],
    )  # fmt: skip


def recorded(time: ArrayLike, position: ArrayLike, smoothness: int = 5) -> Travel:
    """A recorded travel: a spline through the record."""
    t, y = np.asarray(time, dtype=float), np.asarray(position, dtype=float)
    if t.ndim != 1 or t.shape != y.shape or t.size <= smoothness:
        raise ParameterError(f"a recorded travel needs more than {smoothness} instants and as many positions")
    if not (np.diff(t) > 0).all() or not np.isfinite(y).all():
        raise ParameterError("a recorded travel needs ascending instants and positions that are finite")
    return Travel(interpolate.PPoly.from_spline(interpolate.make_interp_spline(t, y, k=smoothness).tck))


def _way(start: float, end: float, length: float, **limits: float) -> float:
    for name, value in (("length", length), *limits.items()):
        check_number(f"travel {name}", value, 0.0, strict=True)
    way = abs(check_position(end) - check_position(start)) * length
    if way == 0.0:
        raise ParameterError("a travel from a position to itself; take `standing`")
    return way


def _from_jerks(
    start: float, end: float, length: float, begin: float,
    durations: Sequence[float], jerks: Sequence[float], accelerations: Sequence[float],
) -> Travel:  # fmt: skip
    """Pieces of even jerk, each from its acceleration on; position and speed continue."""
    scale = np.sign(end - start) / length
    y, v, t = start, 0.0, begin
    knots, pieces = [begin], []
    for span, jerk, acceleration in zip(durations, jerks, accelerations, strict=True):
        if span <= 1e-12:
            continue
        j, a = scale * jerk, scale * acceleration
        pieces.append([j / 6, a / 2, v, y])
        y += span * (v + span * (a / 2 + span * j / 6))
        v += span * (a + span * j / 2)
        t += span
        knots.append(t)
    return Travel(interpolate.PPoly(np.array(pieces).T, np.array(knots)))
