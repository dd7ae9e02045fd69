"""Damping that grows with the rate."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Memoryless, Values, value
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class QuadraticDamping(Memoryless):
    """f = coefficient v abs(v)."""

    name: ClassVar[str] = "quadratic_damping"
    moved_by: ClassVar[Literal["displacement", "velocity"]] = "velocity"
    strength: ClassVar[tuple[str, ...]] = ("coefficient",)

    coefficient: float = value("N m s^2/rad^2")

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        return p[0] * v * abs(v)

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        return 0.0, 2.0 * p[0] * abs(v)

    @staticmethod
    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        """The root of a quadratic equation for abs(v)."""
        size = 2.0 * abs(v) / (1.0 + math.sqrt(1.0 + 4.0 * b * p[0] * abs(v)))
        return p[0] * size * size * math.copysign(1.0, v)

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        return np.asarray(8j / (3.0 * np.pi) * self.coefficient * np.square(omega) * np.asarray(amplitude))
