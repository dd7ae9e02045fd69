"""An exponential window whose damping was never taken out."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, parameter
from cutvib_ss.effects.chain_effect import ChainEffect
from cutvib_ss.model.measurement_chain import MeasurementChain


@dataclass(frozen=True)
class WindowDamping(ChainEffect):
    """The frequency response at s = σ + jω in place of jω."""

    effect: ClassVar[str] = "window_damping"
    severity = Severity("zero", ("decay_rate",))
    sentence = "the damping of an exponential window was not corrected for"
    inspection = "look in the analyser's settings for an exponential window on force and response"
    example: ClassVar[Mapping[str, float]] = {"decay_rate": 5.0}

    decay_rate: float = parameter("1/s", 0.0, 100.0, "asinh")  # σ of the window on force and response [1/s]

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        yield "", (cls("measurement", 1.0),)

    def changed_chain(self, model: Model) -> MeasurementChain:
        return replace(model.chain, decay_rate=model.chain.decay_rate + self.decay_rate)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"decay_rate": ((("chain", "decay_rate"), 1.0),)}
