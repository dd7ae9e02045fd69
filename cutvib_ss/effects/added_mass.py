"""A mass that the model lacks on the tool or the head."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import (
    Carried,
    Effect,
    Measured,
    Model,
    Range,
    Severity,
    applied,
    check_place,
    parameter,
    ports_of,
)
from cutvib_ss.effects.port_element import PortElement
from cutvib_ss.effects.scales import TOLERATED, port_scale
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.paths import Path, value_at, with_value


@dataclass(frozen=True)
class AddedMass(PortElement):
    """A rigid mass; on the machine it moves in X and Z, which is the same as an m2 or m1 that is off."""

    effect: ClassVar[str] = "added_mass"
    severity = Severity("zero", ("mass",))
    sentence = "{place} carries a mass that the model lacks"
    inspection = "weigh {place} with what is mounted on it: cables, sensors, brackets, tools"
    less = "{place} weighs less than the model has it"
    example: ClassVar[Mapping[str, float]] = {"mass": 0.3}

    mass: float = parameter("kg", -0.3, 8.0, "asinh", minimum=None)  # Mass [kg]; negative where the model has too much

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ports_of(model, ("tool", "head"))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given = super().ranges(model, place, motion)
        if model.head is not None:
            own = float(value_at(model, _path(place)))
            return {"mass": replace(given["mass"], low=-0.5 * own, high=max(8.0, own))}
        scale = port_scale(model, place)
        return {"mass": replace(given["mass"], low=-0.5 * scale.mass, high=3.0 * scale.mass)}

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for place in cls.places(model):
            mass = model.carried_at(place)[0] * 0.02
            yield place, tuple(cls(place, f * mass) for f in (1.0, 4.0, 16.0))

    def tolerated(self, model: Any) -> bool:
        return (
            model.head is None and abs(self.mass) <= TOLERATED * model.tolerance.mass * model.carried_at(self.place)[0]
        )

    def element(self) -> SpringDamperMass:
        return SpringDamperMass(mass=self.mass)

    def apply(self, model: Any) -> Any:
        if model.head is None:
            return super().apply(model)
        check_place(self, model)
        path = _path(self.place)
        return applied(model, with_value(model, path, value_at(model, path) + self.mass), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return super().moves(applied) if applied.head is None else {"mass": ((_path(self.place), 1.0),)}


def _path(place: str) -> Path:
    return ("head", "m2" if place == "tool" else "m1")
