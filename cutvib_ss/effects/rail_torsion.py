"""The cutting force is eccentric to the shear centre of the rail and twists it, head and all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, parameter, parameter_fields
from cutvib_ss.effects.machine_effect import MachineEffect, Starts
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import Torsion


@dataclass(frozen=True)
class RailTorsion(MachineEffect):
    """
    Twist of the rail under the head's eccentric load (the paper's own outlook, end of Section 3.3).

    The head's first joint moves with w + e ψ, and both links turn with ψ (`cutvib_ss.model.head`). The
    accelerometer ``base_x`` lies on the shear centre and shows w alone.
    """

    effect: ClassVar[str] = "rail_torsion"
    severity = Severity("infinity", ("inertia",))
    sentence = "the rail twists, its shear centre being away from the head"
    inspection = "measure with two accelerometers, at the top and the bottom of the rail, whether it twists"
    example: ClassVar[Mapping[str, float]] = {
        "eccentricity": 0.05,
        "inertia": 0.8,
        "torsion_frequency": 180.0,
        "damping_ratio": 0.02,
    }

    retired: ClassVar[Mapping[str, tuple[float | None, str]]] = {
        "elements": (None, "the rail twists as a continuous shaft")
    }

    # Distance in Z from the rail's shear centre to the head's first joint [m]
    eccentricity: float = parameter("m", -0.2, 0.2, "linear", minimum=None)
    inertia: float = parameter("kg m^2", 0.02, 10.0)  # Polar moment of inertia of the whole rail [kg m²]
    torsion_frequency: float = parameter("Hz", 30.0, 800.0)  # First natural frequency of torsion, without the head [Hz]
    # Damping ratio of the first torsion mode; of the others in proportion to their frequencies
    damping_ratio: float = parameter("1", 0.001, 0.1)
    # Stiffness with which each end is held against twist over that of the whole rail, GJ/L. Infinite by default: held. Ends far
    # softer than the rail let it rock as one.
    fixing: float = parameter("1", 0.02, 50.0, default=math.inf, limits=True)

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        first = machine.rail.parameters.first_frequency
        twists = [(e, f) for f in (3.0, 4.5, 6.5, 9.0, 12.0) for e in (0.03, -0.03, 0.09, -0.09)]
        yield "", tuple(cls("rail", e, 0.5, f * first, 0.02) for e, f in twists)
        yield "on soft ends", tuple(cls("rail", e, 0.5, f * first, 0.02, 0.5) for e, f in twists)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        return (
            (what, cls(place, **cls.example, **more).at) for what, more in (("", {}), ("soft ends", {"fixing": 0.5}))
        )

    def changed_machine(self, machine: Machine) -> Machine:
        torsion = Torsion(self.eccentricity, self.inertia, self.torsion_frequency, self.damping_ratio, self.fixing)
        return replace(machine, rail=replace(machine.rail, torsion=torsion))

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {f.name: ((("rail", "torsion", f.name), 1.0),) for f in parameter_fields(type(self))}
