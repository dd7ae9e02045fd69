"""The ends of the rail are not free to turn: rotational springs at both."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import (
    Carried,
    Effect,
    Measured,
    Model,
    Severity,
    applied,
    check_place,
    machine_only,
    parameter,
)
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.rail import RailAttachment


@dataclass(frozen=True)
class EndFixity(Effect):
    """
    Rotational springs on the slopes of the rail at its ends.

    Pinned sine modes carry an end slope as Σ rπ/L, whose compliance converges like 1/m in the number of modes m.
    """

    effect: ClassVar[str] = "end_fixity"
    severity = Severity("zero", ("k_left", "k_right"))
    sentence = "the rail's ends resist turning"
    inspection = "check whether the ends of the rail are clamped over a length instead of pinned"
    example: ClassVar[Mapping[str, float]] = {"k_left": 2e5, "k_right": 5e5}

    # Stiffness against rotation at y = 0 and y = L [N m/rad]
    k_left: float = parameter("N m/rad", 1e3, 1e7, limits=True)
    # Stiffness against rotation at y = 0 and y = L [N m/rad]
    k_right: float = parameter("N m/rad", 1e3, 1e7, limits=True)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("rail_ends",) if model.rail is not None else ()

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        if model.rail is not None:
            p = model.rail.parameters
            turn = p.bending_stiffness / p.length
            turns = (0.1, 0.4, 1.2, 4.0, 15.0)
            yield "", tuple(cls("rail_ends", a * turn, b * turn) for a in turns for b in turns)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        machine = machine_only(self.effect, model)
        springs = tuple(
            RailAttachment(SpringDamperMass(stiffness=k), end, slope=True)
            for k, end in ((self.k_left, 0.0), (self.k_right, 1.0))
        )
        rail = replace(machine.rail, attachments=(*machine.rail.attachments, *springs))
        return applied(machine, replace(machine, rail=rail), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        last = len(applied.rail.attachments)
        return {
            "k_left": ((("rail", "attachments", last - 2, "element", "stiffness"), 1.0),),
            "k_right": ((("rail", "attachments", last - 1, "element", "stiffness"), 1.0),),
        }
