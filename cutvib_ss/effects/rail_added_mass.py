"""A cable carrier or another mass at a point of the rail."""

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
class RailAddedMass(MachineEffect):
    """A mass at a point of the rail, with a damper to ground."""

    effect: ClassVar[str] = "rail_added_mass"
    severity = Severity("zero", ("mass", "damping"))
    sentence = "a mass rides on the rail"
    inspection = "look for a cable carrier, motor or bracket on the rail that the model lacks, and weigh it"
    example: ClassVar[Mapping[str, float]] = {"position": 0.31, "mass": 4.0, "damping": 30.0}

    position: float = parameter("1", 0.02, 0.98, "linear")  # y / L of the mass
    mass: float = parameter("kg", 0.1, 60.0)  # Mass [kg]
    damping: float = parameter("N s/m", 0.0, 500.0, "linear", default=0.0)  # Damping to ground [N s/m]

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        spots = (0.12, 0.25, 0.38, 0.5, 0.62, 0.75, 0.88)
        mass = machine.rail.parameters.mass
        yield "", tuple(cls("rail", y, mass * f, 1.0) for y in spots for f in (0.01, 0.06))

    def tolerated(self, model: Any) -> bool:
        # No mode moves, or dies out, by more than it may by itself: a mass at its antinode by m/μL and c/(μL ω).
        rail, own = model.rail.parameters, model.tolerance
        lost = self.damping / (rail.mass * 2 * np.pi * rail.first_frequency)
        return bool(
            self.mass <= TOLERATED * own.first_frequency * rail.mass
            and lost <= TOLERATED * own.damping_ratio * rail.damping_ratio
        )

    def changed_machine(self, machine: Machine) -> Machine:
        lump = RailAttachment(SpringDamperMass(mass=self.mass, damping=self.damping), self.position)
        rail = replace(machine.rail, attachments=(*machine.rail.attachments, lump))
        return replace(machine, rail=rail)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("rail", "attachments", len(applied.rail.attachments) - 1)
        return {
            "position": (((*at, "position"), 1.0),),
            "mass": (((*at, "element", "mass"), 1.0),),
            "damping": (((*at, "element", "damping"), 1.0),),
        }
