"""The ball bearings of the guide give between rail and head."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, machine_only, parameter
from cutvib_ss.model.elements import Guide
from cutvib_ss.model.machine import Machine


@dataclass(frozen=True)
class GuideCompliance(Effect):
    """
    A spring and damper in series between rail and head.

    Parameters
    ----------
    place : str
        ``"head_base"``.
    stiffness : float
        Stiffness [N/m]; infinite stiffness is no effect.
    damping : float
        Damping [N s/m].
    """

    effect: ClassVar[str] = "guide_compliance"

    stiffness: float = parameter("N/m", 1e6, 1e9, limits=True)
    damping: float = parameter("N s/m", 0.0, 2e4, "linear", default=0.0, limits=True)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("head_base",) if isinstance(model, Machine) else ()

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        machine = machine_only(self.effect, model)
        return applied(machine, replace(machine, guide=Guide(self.stiffness, self.damping)), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"stiffness": ((("guide", "stiffness"), 1.0),), "damping": ((("guide", "damping"), 1.0),)}
