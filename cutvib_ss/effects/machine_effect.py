"""Effects of the rail and of what joins the head to it, which cutting machines alone have."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Iterator
from typing import Any, ClassVar

from cutvib_ss.effects.base import Effect, Measured, Model, applied, check_place
from cutvib_ss.model.machine import Machine

Starts = Iterator[tuple[str, tuple[Effect, ...]]]


class MachineEffect(Effect):
    """An effect at the one place `home` of a cutting machine."""

    home: ClassVar[str] = "rail"

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return (cls.home,) if model.rail is not None else ()

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterable[tuple[str, tuple[Effect, ...]]]:
        if model.rail is not None:
            yield from cls.starts_on(model, measured)

    @classmethod
    @abstractmethod
    def starts_on(cls, machine: Machine, measured: Measured) -> Starts:
        """Values from which it is fitted."""

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        return applied(model, self.changed_machine(model), self)

    @abstractmethod
    def changed_machine(self, machine: Machine) -> Machine:
        """The machine with the effect."""
