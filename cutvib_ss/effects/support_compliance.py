"""The fixed rails and pillars give: springs and dampers under the ends of the rail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Measured, Severity, parameter
from cutvib_ss.effects.machine_effect import MachineEffect, Starts
from cutvib_ss.effects.scales import rail_stiffness
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import EndSupports


@dataclass(frozen=True)
class SupportCompliance(MachineEffect):
    """
    End springs in place of rigid pins, left (y = 0) and right apart.

    The pin is released and the rail's two rigid motions are added to its sine modes (`cutvib_ss.model.rail`). The rail's own
    damping goes with the rate of strain (Eq. 4): rigid motion is resisted by ``c_left`` and ``c_right`` alone.
    """

    effect: ClassVar[str] = "support_compliance"
    home = "rail_ends"
    severity = Severity("infinity", ("k_left", "k_right", "c_left", "c_right"))
    sentence = "the supports under the rail's ends give"
    inspection = "check the bolts and feet of the pillars and the fixed rails; measure how far they move under a load on the rail"
    example: ClassVar[Mapping[str, float]] = {"k_left": 3e7, "k_right": 1e8, "c_left": 400.0, "c_right": 900.0}

    retired: ClassVar[Mapping[str, tuple[float | None, str]]] = {
        "rigid_damping": (0.0, "the rail's own damping does not resist rigid motion; fit c_left and c_right again")
    }

    # Stiffness under the ends [N/m]; infinite stiffness is no effect
    k_left: float = parameter("N/m", 1e6, 1e9, limits=True)
    k_right: float = parameter("N/m", 1e6, 1e9, limits=True)
    c_left: float = parameter("N s/m", 0.0, 2e4, "linear", default=0.0, limits=True)  # Damping under the ends [N s/m]
    c_right: float = parameter("N s/m", 0.0, 2e4, "linear", default=0.0, limits=True)

    @classmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        k = rail_stiffness(machine)
        ends = [(a * k, b * k) for a in (2, 8, 30, 120) for b in (2, 8, 30, 120)]
        yield "", tuple(cls("rail_ends", a, b, 500.0, 500.0) for a, b in ends)

    def changed_machine(self, machine: Machine) -> Machine:
        ends = EndSupports(self.k_left, self.k_right, self.c_left, self.c_right)
        return replace(machine, rail=replace(machine.rail, supports=ends))

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        names = ("k_left", "k_right", "c_left", "c_right")
        return {name: ((("rail", "supports", name), 1.0),) for name in names}
