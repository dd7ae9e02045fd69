"""Effects that are a linear element at a port."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

from cutvib_ss.effects.base import Carried, Effect, applied, attached_to, check_place, parameter_fields
from cutvib_ss.model.elements import Element


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
