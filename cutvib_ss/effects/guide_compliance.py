"""The ball bearings of the guide give between rail and head."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Literal

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, parameter
from cutvib_ss.effects.machine_effect import MachineEffect, Starts
from cutvib_ss.effects.scales import rail_stiffness
from cutvib_ss.model.elements import Guide
from cutvib_ss.model.machine import Machine

SIDES: tuple[Literal["head", "rail"], ...] = ("head", "rail")
"""Sides of the guide on which the sensor of the base may sit."""


@dataclass(frozen=True)
class GuideCompliance(MachineEffect):
    """A spring and damper in series between rail and head."""

    effect: ClassVar[str] = "guide_compliance"
    home = "head_base"
    severity = Severity("infinity", ("stiffness", "damping"))
    sentence = "the guide between rail and head gives"
    inspection = "check the preload and the bolts of the guide carriages between rail and head"

    stiffness: float = parameter("N/m", 1e6, 1e9, limits=True)  # Stiffness [N/m]; infinite stiffness is no effect
    damping: float = parameter("N s/m", 0.0, 2e4, "linear", default=0.0, limits=True)  # Damping [N s/m]
    # Where the sensor ``base_x`` sits: on the head's base, or on the rail
    sensor_side: Literal["head", "rail"] = "head"

    def __post_init__(self) -> None:
        super().__post_init__()
        Guide(1.0, sensor_side=self.sensor_side)

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        k = rail_stiffness(machine)
        # Which side the sensor sits on shows in base_x alone.
        sides = SIDES if "base_x" in measured.channels else SIDES[:1]
        yield "", tuple(cls("head_base", f * k, 500.0, side) for side in sides for f in (5.0, 20.0, 60.0, 200.0))

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        return ((side, cls(place, 5e7, 500.0, side).at) for side in SIDES)

    def changed_machine(self, machine: Machine) -> Machine:
        return replace(machine, guide=Guide(self.stiffness, self.damping, self.sensor_side))

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"stiffness": ((("guide", "stiffness"), 1.0),), "damping": ((("guide", "damping"), 1.0),)}
