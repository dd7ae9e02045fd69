"""Transverse sensitivity or tilt of the accelerometer: X leaks into Z."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, parameter
from cutvib_ss.effects.chain_effect import ChainEffect
from cutvib_ss.model.measurement_chain import MeasurementChain


@dataclass(frozen=True)
class CrossAxis(ChainEffect):
    """A fraction of ``tool_x`` in ``tool_z``."""

    effect: ClassVar[str] = "cross_axis"
    severity = Severity("zero", ("fraction",), {"fraction": 0.05})
    sentence = "X leaks into Z"
    inspection = "check how the accelerometer on the tool is mounted and aligned, and its transverse sensitivity"
    example: ClassVar[Mapping[str, float]] = {"fraction": 0.1}

    fraction: float = parameter("1", -1.0, 1.0, "asinh", minimum=None)  # How much leaks

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return super().places(model) if model.head is not None else ()

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        if cls.places(model) and "tool_z" in measured.channels:
            yield "", (cls("measurement", 0.0),)

    def changed_chain(self, model: Model) -> MeasurementChain:
        return replace(model.chain, cross_axis=model.chain.cross_axis + self.fraction)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {"fraction": ((("chain", "cross_axis"), 1.0),)}
