"""
An exponential window whose damping was never taken out.

On force and response alike it shows the response at s + σ. On the responses alone, from a time t₀ before the blow on, it does so
too, and makes them smaller by e^(-σt₀) besides, for the force of a blow is over before it fades.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, parameter
from cutvib_ss.effects.chain_effect import ChainEffect
from cutvib_ss.model.measurement_chain import MeasurementChain


@dataclass(frozen=True)
class WindowDamping(ChainEffect):
    """The frequency response at s = σ + jω in place of jω, and smaller where the window lay on the responses alone."""

    effect: ClassVar[str] = "window_damping"
    severity = Severity("zero", ("decay_rate",))
    sentence = "the damping of an exponential window was not corrected for"
    inspection = "look in the analyser's settings for an exponential window on force and response"
    example: ClassVar[Mapping[str, float]] = {"decay_rate": 5.0}

    decay_rate: float = parameter("1/s", 0.0, 100.0, "asinh")  # σ of the window [1/s]
    # Of a window on the responses alone how long before the blow it begins, or after it below zero; 0 of one on both [s]
    ahead: float = parameter("s", -0.05, 0.2, "linear", minimum=None, default=0.0)

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        yield "", (cls("measurement", 1.0),)

    def changed_chain(self, model: Model) -> MeasurementChain:
        chain = replace(model.chain, decay_rate=model.chain.decay_rate + self.decay_rate)
        left = float(np.exp(-self.decay_rate * self.ahead))
        for name in model.channels:
            old = chain.channel(name)
            chain = chain.with_channel(name, replace(old, gain=old.gain * left))
        return chain

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        gains = [(("chain", "channels", name, "gain"), applied.chain.channel(name).gain) for name in applied.channels]
        return {
            "decay_rate": ((("chain", "decay_rate"), 1.0), *((path, -self.ahead * gain) for path, gain in gains)),
            "ahead": tuple((path, -self.decay_rate * gain) for path, gain in gains),
        }
