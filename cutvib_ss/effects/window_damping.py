"""An exponential window whose damping was never taken out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, parameter


@dataclass(frozen=True)
class WindowDamping(Effect):
    """
    The frequency response at s = σ + jω in place of jω.

    Parameters
    ----------
    place : str
        ``"measurement"``.
    decay_rate : float
        σ of the window on force and response [1/s].
    """

    effect: ClassVar[str] = "window_damping"

    decay_rate: float = parameter("1/s", 0.0, 100.0, "linear")

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("measurement",)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        chain = replace(model.chain, decay_rate=model.chain.decay_rate + self.decay_rate)
        return applied(model, replace(model, chain=chain), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"decay_rate": ((("chain", "decay_rate"), 1.0),)}
