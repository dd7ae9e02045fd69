"""Friction that sticks, gives a little, and slides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from cutvib_ss.model.restoring_forces.base import Hysteretic, value
from cutvib_ss.results import FloatArray

STICKING = 1000.0
"""Stiffness that stands for ideal sticking in the harmonic balance, over the model's own at the port; also the largest motion over
that at which it yields."""

RIGID = 4.0
"""
Stiffness times the displacement that a constant unit force makes over a time step, beyond which an element sticks ideally: a stuck
mass then vibrates with less than 2.2 steps in a period, and the spring gives less than a quarter of what friction moves in a step.
"""


@dataclass(frozen=True)
class DryFriction(Hysteretic):
    """One Jenkins element: a spring while it sticks, sliding at the torque. Infinitely stiff by default: Coulomb's law."""

    name: ClassVar[str] = "dry_friction"
    strength: ClassVar[tuple[str, ...]] = ("torque", "sticking_stiffness")

    torque: float = value("N m")
    sticking_stiffness: float = value("N m/rad", maximum=math.inf, default=math.inf)

    def sliders(self) -> FloatArray:
        return np.array([[self.sticking_stiffness, self.torque]])

    def regularised(self, stiffness: float, motion: float) -> Self:
        rigid = STICKING * max(stiffness, self.torque / motion)
        return replace(self, sticking_stiffness=min(rigid, self.sticking_stiffness))

    def at_step(self, compliance: float) -> Self:
        return replace(self, sticking_stiffness=math.inf) if self.sticking_stiffness * compliance > RIGID else self
