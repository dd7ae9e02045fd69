"""Hysteretic damping in a joint in place of the viscous damper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, attached_to, check_place, machine_only, parameter
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import Path, value_at, with_value


@dataclass(frozen=True)
class StructuralDamping(Effect):
    """
    k (1 + iη) in place of k + iωc in one joint.

    Parameters
    ----------
    place : str
        ``"joint1"`` or ``"joint2"``.
    loss_factor : float
        η.

    Notes
    -----
    Exact in the frequency response; a plant takes the viscous damping that dissipates as much at one frequency.
    """

    effect: ClassVar[str] = "structural_damping"

    loss_factor: float = parameter("1", 0.001, 0.5)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("joint1", "joint2") if isinstance(model, Machine) else ()

    def _paths(self) -> tuple[Path, Path]:
        joint = self.place[-1]
        return ("head", "k" + joint), ("head", "c" + joint)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        machine = machine_only(self.effect, model)
        k, c = self._paths()
        loss = SpringDamperMass(loss_stiffness=self.loss_factor * value_at(machine, k))
        return applied(machine, attached_to(with_value(machine, c, 0.0), self.place, loss), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("attachments", len(applied.attachments) - 1, "element", "loss_stiffness")
        return {"loss_factor": ((at, value_at(applied, self._paths()[0])),)}

    def carries(self, path: Path, applied: Any) -> Carried:
        # The loss moves with the stiffness; the viscous damper is gone.
        k, c = self._paths()
        if path == k:
            at = ("attachments", len(applied.attachments) - 1, "element", "loss_stiffness")
            return ((path, 1.0), (at, self.loss_factor))
        return () if path == c else ((path, 1.0),)
