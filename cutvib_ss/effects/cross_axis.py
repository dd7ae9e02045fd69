"""Transverse sensitivity or tilt of the accelerometer: X leaks into Z."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, parameter
from cutvib_ss.model.machine import Machine


@dataclass(frozen=True)
class CrossAxis(Effect):
    """
    A fraction of ``tool_x`` in ``tool_z``.

    Parameters
    ----------
    place : str
        ``"measurement"``.
    fraction : float
        How much leaks.
    """

    effect: ClassVar[str] = "cross_axis"

    fraction: float = parameter("1", -1.0, 1.0, "linear", minimum=None)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("measurement",) if isinstance(model, Machine) else ()

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        chain = replace(model.chain, cross_axis=model.chain.cross_axis + self.fraction)
        return applied(model, replace(model, chain=chain), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"fraction": ((("chain", "cross_axis"), 1.0),)}
