"""A spring that acts about one displacement, to one side."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Memoryless, Values, around, value
from cutvib_ss.results import ComplexArray

_PHASES = (np.arange(64) + 0.5) * np.pi / 128
"""Of the quarter of a period in which motion comes back from one side."""


@dataclass(frozen=True)
class LocalStiffness(Memoryless):
    """
    f = stiffness q exp(-ln²(q/displacement)/2) where q has the sign of ``side``, else nothing.

    One of the shapes that an error of a force is made of, where it is smooth over the logarithm of displacement.
    """

    name: ClassVar[str] = "local_stiffness"
    strength: ClassVar[tuple[str, ...]] = ("stiffness",)

    stiffness: float = value("N m/rad", minimum=None)
    displacement: float = value("rad")
    side: float = value("1", minimum=-1.0, maximum=1.0)

    @property
    def odd(self) -> bool:
        return False

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        return p[0] * q * around(q * p[2], p[1])[0]

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        weight, u = around(q * p[2], p[1])
        return p[0] * weight * (1.0 - u), 0.0

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        a, cos = np.asarray(amplitude, dtype=np.float64)[..., None], np.cos(_PHASES)
        weight = np.exp(-0.5 * np.log(a * cos / self.displacement) ** 2)
        return np.asarray(self.stiffness * np.mean(weight * cos**2, axis=-1) + 0j * np.asarray(omega))
