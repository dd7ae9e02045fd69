"""Friction that sticks, gives a little, and slides."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import ClassVar, Self

import numpy as np
from scipy import special

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


CONTACTS = 64
"""Jenkins elements that stand for contacts that slide one after the other. Their number costs hardly any time."""


@dataclass(frozen=True)
class DryFriction(Hysteretic):
    """
    A spring while it sticks, sliding at the torque. Infinitely stiff by default: Coulomb's law.

    It yields at once (Jenkins), or over a ``knee``: pushed from rest its stiffness falls as 1 - (f/torque)^(1/knee), as that of
    Bouc and Wen with exponent 1/knee, and of Dahl with a knee of 1. Turned round it follows Masing's rules, which those do not.
    """

    name: ClassVar[str] = "dry_friction"
    strength: ClassVar[tuple[str, ...]] = ("torque", "sticking_stiffness")

    torque: float = value("N m")
    sticking_stiffness: float = value("N m/rad", maximum=math.inf, default=math.inf)
    knee: float | None = value("1", maximum=1.0, default=None)

    def sliders(self) -> FloatArray:
        if not self.knee or math.isinf(self.sticking_stiffness):
            return np.array([[self.sticking_stiffness, self.torque]])
        return np.column_stack(
            [np.full(CONTACTS, self.sticking_stiffness / CONTACTS), self.torque / CONTACTS * _over_a_knee(self.knee)]
        )

    def regularised(self, stiffness: float, motion: float) -> Self:
        rigid = STICKING * max(stiffness, self.torque / motion)
        return replace(self, sticking_stiffness=min(rigid, self.sticking_stiffness))

    def at_step(self, compliance: float) -> Self:
        return replace(self, sticking_stiffness=math.inf) if self.sticking_stiffness * compliance > RIGID else self


@lru_cache(maxsize=64)
def _over_a_knee(knee: float) -> FloatArray:
    """Slip forces of contacts of one stiffness, in order, over their mean."""
    # At a force y the part u = y^(1/knee) of them slides; the displacement there is the integral of 1/(1 - y^(1/knee)).
    u = np.arange(CONTACTS) / CONTACTS
    y = u**knee
    at = y * special.hyp2f1(1.0, knee, 1.0 + knee, u)
    # What those that slide have in all, by parts.
    return np.diff(np.append(y - at * (1.0 - u), 1.0)) * CONTACTS
