"""Too few modes of the rail in the model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, machine_only
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine


@dataclass(frozen=True)
class ModalTruncation(Effect):
    """
    The rail has more modes than the model; nothing to fit but their number.

    Parameters
    ----------
    place : str
        ``"rail"``.
    n_modes : int
        Number of modes that the response needs.
    """

    effect: ClassVar[str] = "modal_truncation"

    n_modes: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.n_modes, bool) or not isinstance(self.n_modes, int) or self.n_modes < 1:
            raise ParameterError(f"modal_truncation: n_modes = {self.n_modes!r} must be a whole number, at least 1")

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("rail",) if isinstance(model, Machine) else ()

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        machine = machine_only(self.effect, model)
        parameters = replace(machine.rail.parameters, n_modes=self.n_modes)
        return applied(machine, replace(machine, rail=replace(machine.rail, parameters=parameters)), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {}
