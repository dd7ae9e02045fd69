"""Clearance before a contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.restoring_forces.base import Course, Memoryless, Values, clipped, mean_size, value
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class Freeplay(Memoryless):
    """
    No force within ±gap, contact_stiffness (q ∓ gap) beyond, in place of the linear spring.

    To that spring, stiffness · q, it adds (contact - stiffness) q - contact · clip(q, ±gap). At rest at an offset from the middle
    of the gap, q + offset is clipped, and what that is at rest taken off. Contacts that close gradually have corners of hyperbolas,
    ½ √((q + gap)² + r²) - ½ √((q - gap)² + r²) in place of the clipped q, with r = rounding · gap. Contacts that lose energy resist
    with contact_stiffness · d · (1 + contact_damping · rate of d) at a depth of d beyond the gap (Hunt and Crossley, J. Appl. Mech.
    42, 1975): at the first touch they do not jump. Their corners have to be round.
    """

    name: ClassVar[str] = "freeplay"
    strength: ClassVar[tuple[str, ...]] = ("stiffness", "contact_stiffness")

    gap: float = value("rad")
    stiffness: float = value("N m/rad")
    contact_stiffness: float | None = value("N m/rad", default=None)
    """By default the spring's."""
    offset: float | None = value("rad", minimum=None, default=None)
    """By default none."""
    rounding: float | None = value("1", default=None)
    """By default sharp corners."""
    contact_damping: float | None = value("s/rad", default=None)
    """By default none."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contact_damping and not self.rounding:
            raise ParameterError(f"{self.name}: contact_damping takes round corners; give a rounding, too, such as 0.1")

    @property
    def values(self) -> Values:
        offset = self.offset or 0.0
        rounding, loss = (self.rounding or 0.0) * self.gap, self.contact_damping or 0.0
        return self.gap + offset, self.gap - offset, self.contact, self.contact - self.stiffness, rounding, loss

    @property
    def contact(self) -> float:
        """Stiffness beyond the gap."""
        return self.stiffness if self.contact_stiffness is None else self.contact_stiffness

    @property
    def odd(self) -> bool:
        return not self.offset

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        below, above, contact, more, r, loss = p[0], p[1], p[2], p[3], p[4], p[5]
        held = clipped(q, below, above, r)[0]
        f = more * q - contact * (held - clipped(0.0, below, above, r)[0])
        return f + contact * loss * abs(q - held) * v if loss > 0.0 else f

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        below, above, contact, more, r, loss = p[0], p[1], p[2], p[3], p[4], p[5]
        held, slope = clipped(q, below, above, r)
        if loss > 0.0:
            deep = q - held
            deeper = math.copysign(1.0 - slope, deep)
            return more - contact * (slope - loss * deeper * v), contact * loss * abs(deep)
        return more - contact * slope, 0.0

    @staticmethod
    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        """Two straight lines; where the lacking spring outweighs the step's compliance (a k ≥ 1), it jumps to contact."""
        below, above, contact, more, r, loss = p[0], p[1], p[2], p[3], p[4], p[5]
        rest = contact * clipped(0.0, below, above, r)[0]
        if r > 0.0:
            # By Newton's method: corners are round.
            f = 0.0
            for _ in range(50):
                x, w = q - a * f, v - b * f
                held, slope = clipped(x, below, above, r)
                deep = x - held
                lost = contact * loss * abs(deep)
                deeper = contact * loss * math.copysign(1.0 - slope, deep)
                rise = 1.0 + a * (more - contact * slope + deeper * w) + b * lost
                if rise < 1e-6:
                    return math.nan
                change = (f - more * x + contact * held - rest - lost * w) / rise
                f -= change
                if abs(change) <= 1e-12 * abs(f):
                    break
            return f
        inside = 1.0 + a * (more - contact)
        if inside > 0.0 and -below * inside <= q - a * rest <= above * inside:
            return ((more - contact) * q + rest) / inside
        held = contact * (above if q - a * rest > 0.5 * (above - below) * inside else -below) - rest
        if more == 0.0:
            return -held
        beyond = 1.0 + a * more
        return (more * q - held) / beyond if beyond > 0.0 else math.nan

    @staticmethod
    def mean(p: Values, q: Course, v: Course, f0: float, f1: float) -> float:
        """Exact for straight motion over each half of sharp corners, with what Simpson's rule adds to that for its bend."""
        below, above, contact, more, r = p[0], p[1], p[2], p[3], p[4]
        if r > 0.0:
            held = clipped(q[1], below, above, r)[0]
            middle = more * q[1] - contact * (held - clipped(0.0, below, above, r)[0])
            middle += contact * p[5] * abs(q[1] - held) * v[1]
            return (f0 + 4.0 * middle + f1) / 6.0
        bend = (2.0 * q[1] - q[0] - q[2]) / 12.0
        high = mean_size(q[0] + below, q[1] + below) + mean_size(q[1] + below, q[2] + below)
        low = mean_size(q[0] - above, q[1] - above) + mean_size(q[1] - above, q[2] - above)
        held = 0.25 * (high - low) + (bend if -below < q[1] < above else 0.0)
        held += 0.5 * (above - below) - clipped(0.0, below, above, r)[0]
        linear = more * (q[0] + 4.0 * q[1] + q[2]) / 6.0 if more != 0.0 else 0.0
        return linear - contact * held

    @staticmethod
    def steepest(p: Values, q: float, v: float) -> float:
        """The greater of the two branches: within the gap and in contact."""
        return max(abs(p[3] - p[2]), abs(p[3])) + p[2] * p[5] * abs(v)

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        if self.offset or self.rounding:
            return np.asarray(
                self.fundamental(amplitude) + 1j * np.asarray(omega) * self.fundamental_of_rate(amplitude)
            )
        ratio = np.minimum(self.gap / np.asarray(amplitude, dtype=np.float64), 1.0)
        saturation = 2.0 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2))
        return np.asarray(self.contact - self.stiffness - self.contact * saturation + 0j * np.asarray(omega))
