"""Effects that are a linear element at a port."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

from cutvib_ss.effects.base import Carried, Effect, Model, Range, applied, attached_to, check_place, parameter_fields
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import Element

OBLIQUE = 0.35
"""Standard deviation of the direction in which something touches the tool, or swings on it: twenty degrees [rad]."""


class PortElement(Effect):
    """An element in parallel at the effect's place, whose values have the names of the effect's parameters."""

    @abstractmethod
    def element(self) -> Element:
        """The element."""

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        return applied(model, attached_to(model, model.port_at(self.place), self.element()), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        at = ("attachments", len(applied.attachments) - 1, "element")
        return {f.name: (((*at, f.name), 1.0),) for f in parameter_fields(type(self))}


class ObliqueElement(PortElement):
    """
    On the machine it lies along a direction between X and Z, its `angle` from X; a port of another structure has one direction.
    """

    angle: float

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given = super().ranges(model, place, motion)
        return given if model.head is not None else {name: r for name, r in given.items() if name != "angle"}

    def apply(self, model: Any) -> Any:
        if model.head is None:
            if self.angle:
                raise ParameterError(f"{self.effect}: angle = {self.angle}: a port of this structure has one direction")
            return super().apply(model)
        check_place(self, model)
        x = model.port_at(self.place)
        return applied(model, attached_to(model, x, self.element(), f"{self.place}_z", self.angle), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        found = dict(super().moves(applied))
        found["angle"] = ((("attachments", len(applied.attachments) - 1, "angle"), 1.0),)
        return found
