"""A spring that is stiffer to one side."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Course, Memoryless, Values, mean_size, value
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class BilinearStiffness(Memoryless):
    """stiffness (1 ± asymmetry) to either side in place of the linear spring: to that it adds stiffness asymmetry abs(q)."""

    name: ClassVar[str] = "bilinear_stiffness"
    scale_free: ClassVar[bool] = True
    strength: ClassVar[tuple[str, ...]] = ("asymmetry",)

    asymmetry: float = value("1", minimum=None)
    stiffness: float = value("N m/rad")

    @property
    def odd(self) -> bool:
        return False

    @property
    def values(self) -> Values:
        return (self.asymmetry * self.stiffness,)

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        return p[0] * abs(q)

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        return p[0] * math.copysign(1.0, q), 0.0

    @staticmethod
    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        """f = k s (q - a f), s the sign of q, which is that of q - a f too where a abs(k) < 1."""
        return p[0] * abs(q) / (1.0 + a * p[0] * math.copysign(1.0, q))

    @staticmethod
    def mean(p: Values, q: Course, v: Course, f0: float, f1: float) -> float:
        """Exact for straight motion over each half, with what Simpson's rule adds to that for its bend."""
        bend = (2.0 * q[1] - q[0] - q[2]) / 12.0
        return p[0] * (0.5 * (mean_size(q[0], q[1]) + mean_size(q[1], q[2])) + bend * math.copysign(1.0, q[1]))

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        """Nothing: abs(cos) has a mean and even harmonics, and no fundamental."""
        return np.asarray(0j * np.asarray(amplitude) * np.asarray(omega))
