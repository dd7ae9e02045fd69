"""A panel, hose or cover that resonates on the tool or the head."""

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
from cutvib_ss.model.elements import SprungMass
from cutvib_ss.model.machine import Machine


@dataclass(frozen=True)
class LocalResonator(Effect):
    """
    A sprung mass in X (Eq. 24 with the signs of an element in parallel).

    Parameters
    ----------
    place : str
        ``"tool"`` or ``"head"``; any port of another structure.
    mass : float
        Mass [kg].
    frequency : float
        Natural frequency of the mass on its spring [Hz].
    damping_ratio : float
        Damping ratio.
    """

    effect: ClassVar[str] = "local_resonator"

    mass: float = parameter("kg", 0.002, 5.0)
    frequency: float = parameter("Hz", 10.0, 600.0)
    damping_ratio: float = parameter("1", 0.002, 0.2)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ports_of(model, ("tool", "head"))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given = super().ranges(model, place, motion)
        if isinstance(model, Machine):
            # Up to what it sits on: a panel of a fifth of the head's mass is no rarity.
            own = model.head.m2 if place == "tool" else model.head.m1
            return {**given, "mass": replace(given["mass"], high=max(given["mass"].high, own))}
        scale = port_scale(model, place)
        return {
            "mass": replace(given["mass"], low=1e-3 * scale.mass, high=scale.mass),
            "frequency": replace(given["frequency"], low=0.1 * scale.natural_freq, high=10.0 * scale.natural_freq),
            "damping_ratio": given["damping_ratio"],
        }

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        element = SprungMass(self.mass, self.frequency, self.damping_ratio)
        return applied(model, attached_to(model, port_of(self.place, model), element), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("attachments", len(applied.attachments) - 1, "element")
        return {name: (((*at, name), 1.0),) for name in ("mass", "frequency", "damping_ratio")}
