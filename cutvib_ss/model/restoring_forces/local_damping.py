"""A damper that acts about one rate, in one direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Memoryless, Values, around, value
from cutvib_ss.model.restoring_forces.local_stiffness import LocalStiffness
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class LocalDamping(Memoryless):
    """f = damping v exp(-ln²(v/rate)/2) where v has the sign of ``side``, else nothing: `LocalStiffness` over the rate."""

    name: ClassVar[str] = "local_damping"
    moved_by: ClassVar[Literal["displacement", "velocity"]] = "velocity"
    strength: ClassVar[tuple[str, ...]] = ("damping",)

    damping: float = value("N m s/rad", minimum=None)
    rate: float = value("rad/s")
    side: float = value("1", minimum=-1.0, maximum=1.0)

    @property
    def odd(self) -> bool:
        return False

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        return p[0] * v * around(v * p[2], p[1])[0]

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        weight, u = around(v * p[2], p[1])
        return 0.0, p[0] * weight * (1.0 - u)

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        rate = np.asarray(amplitude, dtype=np.float64) * np.asarray(omega, dtype=np.float64)
        spring = LocalStiffness(self.damping, self.rate, self.side)
        return np.asarray(1j * np.asarray(omega) * spring.describing_function(rate, omega))
