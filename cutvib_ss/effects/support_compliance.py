"""The fixed rails and pillars give: springs and dampers under the ends of the rail."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, machine_only, parameter
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import EndSupports


@dataclass(frozen=True)
class SupportCompliance(Effect):
    """
    End springs in place of rigid pins, left (y = 0) and right apart.

    Parameters
    ----------
    place : str
        ``"rail_ends"``.
    k_left, k_right : float
        Stiffness under the ends [N/m]; infinite stiffness is no effect.
    c_left, c_right : float
        Damping under the ends [N s/m].
    rigid_damping : float
        Share of the rail's modal damping that resists rigid motion too, 0 (rate of strain, Eq. 4) to 1 (cables, air); not fitted.

    Notes
    -----
    The pin is released and the rail's two rigid motions are added to its sine modes (`cutvib_ss.model.rail`). Where
    ``rigid_damping`` is not 0, ``c_left`` and ``c_right`` also hold what the modes above n_modes would damp at the ends.
    """

    effect: ClassVar[str] = "support_compliance"

    k_left: float = parameter("N/m", 1e6, 1e9, limits=True)
    k_right: float = parameter("N/m", 1e6, 1e9, limits=True)
    c_left: float = parameter("N s/m", 0.0, 2e4, "linear", default=0.0, limits=True)
    c_right: float = parameter("N s/m", 0.0, 2e4, "linear", default=0.0, limits=True)
    rigid_damping: float = 0.0

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("rail_ends",) if isinstance(model, Machine) else ()

    @property
    def conventions(self) -> tuple[SupportCompliance, ...]:
        return (replace(self, rigid_damping=1.0),)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        machine = machine_only(self.effect, model)
        ends = EndSupports(self.k_left, self.k_right, self.c_left, self.c_right, self.rigid_damping)
        return applied(machine, replace(machine, rail=replace(machine.rail, supports=ends)), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        names = ("k_left", "k_right", "c_left", "c_right")
        return {name: ((("rail", "supports", name), 1.0),) for name in names}
