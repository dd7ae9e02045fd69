"""A spring whose force has a cubic part."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Memoryless, Values, value
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class CubicStiffness(Memoryless):
    """f = stiffness3 q³ (Duffing): hardening, or softening where negative."""

    name: ClassVar[str] = "cubic_stiffness"
    degree: ClassVar[int | None] = 3
    strength: ClassVar[tuple[str, ...]] = ("stiffness3",)

    stiffness3: float = value("N m/rad^3", minimum=None)

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        return p[0] * q * q * q

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        return 3.0 * p[0] * q * q, 0.0

    @staticmethod
    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        """x + a k3 x³ = q by Newton's method, monotone from x = q; a softening one has no root beyond its peak: NaN."""
        g = a * p[0]
        x = q
        for _ in range(50):
            slope = 1.0 + 3.0 * g * x * x
            if slope < 1e-6:
                return math.nan
            change = (x + g * x * x * x - q) / slope
            x -= change
            # The next one would be about the square of this.
            if abs(change) <= 1e-9 * abs(x):
                break
        return p[0] * x * x * x

    def holds_below(self, compliance: float) -> float:
        softening = -self.stiffness3 * compliance
        return 1.0 / math.sqrt(softening) if softening > 0.0 else math.inf

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        return np.asarray(0.75 * self.stiffness3 * np.square(amplitude) + 0j * np.asarray(omega))
