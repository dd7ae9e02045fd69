"""A spring whose force has a cubic part."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Memoryless, Values, bent_cubic, value
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class CubicStiffness(Memoryless):
    """
    f = stiffness3 q³ (Duffing): hardening, or softening where negative.

    Far beyond the bend it goes with another power of q: F(q) = stiffness3 q³ (1 + (q/bend)²)^((exponent - 3)/2). At rest at an
    offset c from its middle it is F(q + c) - F(c) - F'(c) q, for the linear spring there is that at rest.
    """

    name: ClassVar[str] = "cubic_stiffness"
    strength: ClassVar[tuple[str, ...]] = ("stiffness3",)

    stiffness3: float = value("N m/rad^3", minimum=None)
    offset: float | None = value("rad", minimum=None, default=None)
    """By default none."""
    bend: float | None = value("rad", default=None)
    """By default infinite."""
    exponent: float | None = value("1", default=None)
    """By default 3."""

    @property
    def values(self) -> Values:
        offset, more = self.offset or 0.0, 0.5 * ((3.0 if self.exponent is None else self.exponent) - 3.0)
        if not self.bend or more == 0.0:
            return self.stiffness3, offset, 0.0, 0.0, 0.0, 0.0
        bent = self.bend**-2
        return self.stiffness3, offset, bent, more, *bent_cubic(self.stiffness3, offset, bent, more)

    @property
    def degree(self) -> int | None:
        return None if self.values[2] else 3

    @property
    def odd(self) -> bool:
        return not self.offset

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        if p[2] == 0.0:
            return p[0] * q * q * (q + 3.0 * p[1])
        return bent_cubic(p[0], q + p[1], p[2], p[3])[0] - p[4] - p[5] * q

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        if p[2] == 0.0:
            return 3.0 * p[0] * q * (q + 2.0 * p[1]), 0.0
        return bent_cubic(p[0], q + p[1], p[2], p[3])[1] - p[5], 0.0

    @staticmethod
    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        """x + a f(x) = q by Newton's method from x = q; one that softens has no root beyond its peak: NaN."""
        x = q
        f = 0.0
        for _ in range(50):
            if p[2] == 0.0:
                f = p[0] * x * x * (x + 3.0 * p[1])
                by_x = 3.0 * p[0] * x * (x + 2.0 * p[1])
            else:
                f, by_x = bent_cubic(p[0], x + p[1], p[2], p[3])
                f -= p[4] + p[5] * x
                by_x -= p[5]
            slope = 1.0 + a * by_x
            if slope < 1e-6:
                return math.nan
            change = (x + a * f - q) / slope
            x -= change
            f -= by_x * change
            # The next one would be about the square of this.
            if abs(change) <= 1e-9 * abs(x):
                break
        return f

    def holds_below(self, compliance: float) -> float:
        """Where the secant stiffness, that of the linear spring with it, falls to zero."""
        if self.degree is None:
            q = np.outer(np.geomspace(1e-3, 1e3, 300) * (self.bend or 1.0), [1.0, -1.0])
            out = np.any(1.0 + compliance * self.force(q, 0.0 * q) / q <= 0.0, axis=1)
            return float(q[np.argmax(out), 0]) if out.any() else math.inf
        shift = 1.5 * (self.offset or 0.0)
        reach = shift**2 - 1.0 / (self.stiffness3 * compliance) if self.stiffness3 and compliance else -1.0
        return abs(math.sqrt(reach) - abs(shift)) if reach >= 0.0 else math.inf

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        plain = 0.75 * self.stiffness3 * np.square(np.asarray(amplitude, dtype=np.float64))
        return np.asarray((plain if self.degree is not None else self.fundamental(amplitude)) + 0j * np.asarray(omega))
