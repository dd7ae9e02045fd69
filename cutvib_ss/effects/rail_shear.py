"""The rail shears as well as bends, and its cross-sections have inertia of their own (Timoshenko)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Measured, Severity, parameter
from cutvib_ss.effects.machine_effect import MachineEffect, Starts
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import Shear


@dataclass(frozen=True)
class RailShear(MachineEffect):
    """
    Shear deformation and rotary inertia of the rail.

    Timoshenko's beam (Phil. Mag. 41, 1921), derived in `cutvib_ss.model.pinned_modes`; every term is kept. The radius of
    gyration is no parameter of its own: κG/E = 0.33 ties it to the shear ratio, ρ² = 0.33 L²/(π² shear_ratio). The rail's
    ``first_frequency`` stays that of EI alone, so all frequencies fall, that of mode r by about 0.67 r²/shear_ratio; that r² is
    what tells shear from a softer rail. Modal damping ratios stay as they are. Shear deflects a rail in a kink under its load,
    which n_modes sines show but for about 1/(π² n_modes y (1 - y)) of that share.
    """

    effect: ClassVar[str] = "rail_shear"
    severity = Severity("infinity", ("shear_ratio",))
    sentence = "the rail gives in shear"
    inspection = "check the rail's cross-section: how thin its webs are, and its joints"
    example: ClassVar[Mapping[str, float]] = {"shear_ratio": 20.0}

    # κGA L²/(π² EI): stiffness of the first mode against shear over that against bending; infinite is no effect
    shear_ratio: float = parameter("1", 4.0, 1000.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        Shear(self.shear_ratio)

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        # Shear is told from a softer rail by the square of a mode's number: with one mode in the band the two are the same.
        p = machine.rail.parameters
        if p.n_modes > 1 and 4 * p.first_frequency < measured.band[1]:
            yield "", tuple(cls("rail", ratio) for ratio in (15.0, 80.0, 300.0))

    def changed_machine(self, machine: Machine) -> Machine:
        return replace(machine, rail=replace(machine.rail, shear=Shear(self.shear_ratio)))

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"shear_ratio": ((("rail", "shear", "ratio"), 1.0),)}
