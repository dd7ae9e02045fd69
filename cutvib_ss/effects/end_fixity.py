"""The ends of the rail are not free to turn: rotational springs at both."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.effects.base import Carried, Measured, Severity, parameter
from cutvib_ss.effects.machine_effect import MachineEffect, Starts
from cutvib_ss.effects.scales import TOLERATED
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import RailAttachment


@dataclass(frozen=True)
class EndFixity(MachineEffect):
    """
    Rotational springs on the slopes of the rail at its ends.

    Pinned sine modes carry an end slope as Σ rπ/L, whose compliance converges like 1/m in the number of modes m.
    """

    effect: ClassVar[str] = "end_fixity"
    home = "rail_ends"
    severity = Severity("zero", ("k_left", "k_right"))
    sentence = "the rail's ends resist turning"
    inspection = "check whether the ends of the rail are clamped over a length instead of pinned"
    example: ClassVar[Mapping[str, float]] = {"k_left": 2e5, "k_right": 5e5}

    # Stiffness against rotation at y = 0 and y = L [N m/rad]
    k_left: float = parameter("N m/rad", 1e3, 1e7, limits=True)
    k_right: float = parameter("N m/rad", 1e3, 1e7, limits=True)

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        p = machine.rail.parameters
        turn = p.bending_stiffness / p.length
        turns = (0.1, 0.4, 1.2, 4.0, 15.0)
        yield "", tuple(cls("rail_ends", a * turn, b * turn) for a in turns for b in turns)

    def tolerated(self, model: Any) -> bool:
        # The first mode, which moves most, by no more than it may by itself: by k L/(π² EI) for each end.
        rail = model.rail.parameters
        moved = (self.k_left + self.k_right) * rail.length / (np.pi**2 * rail.bending_stiffness)
        return bool(moved <= TOLERATED * model.tolerance.first_frequency)

    def changed_machine(self, machine: Machine) -> Machine:
        springs = tuple(
            RailAttachment(SpringDamperMass(stiffness=k), end, slope=True)
            for k, end in ((self.k_left, 0.0), (self.k_right, 1.0))
        )
        rail = replace(machine.rail, attachments=(*machine.rail.attachments, *springs))
        return replace(machine, rail=rail)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        last = len(applied.rail.attachments)
        return {
            "k_left": ((("rail", "attachments", last - 2, "element", "stiffness"), 1.0),),
            "k_right": ((("rail", "attachments", last - 1, "element", "stiffness"), 1.0),),
        }
