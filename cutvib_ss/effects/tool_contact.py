"""Belt, cloth or a stop holds the tool: a spring and damper to ground in X."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import (
    Carried,
    Effect,
    Model,
    Range,
    applied,
    attached_to,
    check_place,
    parameter,
    port_of,
    ports_of,
)
from cutvib_ss.effects.scales import port_scale
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.machine import Machine


@dataclass(frozen=True)
class ToolContact(Effect):
    """
    A spring and damper from the tool to ground in X.

    Parameters
    ----------
    place : str
        ``"tool"``; any port of another structure.
    stiffness : float
        Stiffness [N/m].
    damping : float
        Damping [N s/m].
    """

    effect: ClassVar[str] = "tool_contact"

    stiffness: float = parameter("N/m", 0.0, 1e6, "linear")
    damping: float = parameter("N s/m", 0.0, 300.0, "linear", default=0.0)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ports_of(model, ("tool",))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given = super().ranges(model, place, motion)
        if isinstance(model, Machine):
            return given
        scale = port_scale(model, place)
        return {
            "stiffness": replace(given["stiffness"], high=3.0 * scale.stiffness),
            "damping": replace(given["damping"], high=(scale.stiffness * scale.mass) ** 0.5),
        }

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        element = SpringDamperMass(stiffness=self.stiffness, damping=self.damping)
        return applied(model, attached_to(model, port_of(self.place, model), element), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("attachments", len(applied.attachments) - 1, "element")
        return {name: (((*at, name), 1.0),) for name in ("stiffness", "damping")}
