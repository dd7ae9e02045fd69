"""Micro-slip: contacts in parallel that slide one after the other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from cutvib_ss.model.restoring_forces.base import Hysteretic, RestoringForce, value
from cutvib_ss.model.restoring_forces.dry_friction import CONTACTS, RIGID, STICKING, DryFriction
from cutvib_ss.results import FloatArray

_LAST = 16
"""The last one of so many parts of the contacts decides whether they stick ideally."""


@dataclass(frozen=True)
class JointSlip(Hysteretic):
    """
    Iwan's model with slip torques about their mean, slip_torque, from (1 - spread) times that upwards.

    With ``stiffness`` while all stick. The backbone of the even spread is f(u) = u - (u - T(1-s))²/(4 s T) for abs(u - T) ≤ s T, u
    being stiffness · q; that of `CONTACTS` elements is a polygon, off by s T/(4 CONTACTS²) at most. Their density goes with a
    power, ``exponent``, of how far they are above the lowest; 0 spreads them evenly, up to (1 + spread) times the mean. Spread 0 is
    one Jenkins element. With spread 1 small motions lose energy with the power 3 + exponent of their amplitude: in bolted joints 2
    to 3 (Segalman, J. Appl. Mech. 72 (2005) 752). See Iwan, J. Appl. Mech. 33 (1966) 893.
    """

    name: ClassVar[str] = "joint_slip"
    strength: ClassVar[tuple[str, ...]] = ("stiffness", "slip_torque")

    stiffness: float = value("N m/rad")
    slip_torque: float = value("N m")
    spread: float = value("1", maximum=1.0, default=0.0)
    exponent: float = value("1", minimum=-0.95, maximum=2.0, default=0.0)

    def regularised(self, stiffness: float, motion: float) -> Self:
        rigid = STICKING * max(stiffness, self.slip_torque / motion)
        return replace(self, stiffness=min(rigid, self.stiffness))

    def at_step(self, compliance: float) -> RestoringForce:
        contacts = 1 if self.spread == 0.0 else _LAST
        return DryFriction(self.slip_torque) if self.stiffness / contacts * compliance > RIGID else self

    def sliders(self) -> FloatArray:
        if self.spread == 0.0:
            return np.array([[self.stiffness, self.slip_torque]])
        order = 1.0 / (1.0 + self.exponent)
        # Of the power law's quantiles, the mean.
        mean = 1.0 / (1.0 + order)
        beyond = ((np.arange(CONTACTS) + 0.5) / CONTACTS) ** order
        torques = self.slip_torque / CONTACTS * (1.0 + self.spread * (beyond / mean - 1.0))
        return np.column_stack([np.full(CONTACTS, self.stiffness / CONTACTS), torques])
