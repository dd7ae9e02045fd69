"""What an effect states of its parameters: unit and prior, how it grows from nothing; and what it is told of a measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field
from typing import Any, Literal, TypeAlias

import numpy as np
from scipy import special

from cutvib_ss.results import FloatArray

Scale: TypeAlias = Literal["log", "linear", "asinh", "ratio", "normal"]
"""
In what a prior is even.

``"log"``: the logarithm; ``"linear"``: the value; ``"asinh"``: asinh(value/width), the logarithm on either side of zero;
``"ratio"``: the same of the value's logarithm, on either side of one. The width is `SMALLEST` of the larger end. ``"normal"``: not
even, but normal with mean `Range.low` and standard deviation `Range.high`.
"""

SMALLEST = 1e-3
"""Of the largest size, below which one of either sign is as good as none: three decades, as ranges of logarithms have at least."""

_CELLS = 400
"""Of a range in the coordinate in which its prior is even, over which a mean density is summed."""


@dataclass(frozen=True)
class Range:
    """Unit and prior of an effect's parameter."""

    unit: str  # SI unit
    low: float  # Range that an engineer would believe: the prior of the diagnosis, not a limit of `Effect.apply`
    high: float
    scale: Scale = "log"
    minimum: float | None = 0.0  # Smallest value that makes sense at all
    limits: bool = False  # Whether the ends stand for limits, as free and clamped do, beyond which nothing changes

    def at(self, part: float) -> float:
        """The value at a part of the range, 0 to 1, in the coordinate in which the prior is even."""
        return float(self._at(np.array(part)))

    def _at(self, part: FloatArray) -> FloatArray:
        if self.scale == "log":
            return np.asarray(self.low * (self.high / self.low) ** part)
        if self.scale == "asinh":
            return _on_either_side(self.low, self.high, part)
        if self.scale == "ratio":
            return np.exp(_on_either_side(math.log(self.low), math.log(self.high), part))
        return np.asarray(self.low + part * (self.high - self.low))

    def density(self, mean: float, std: float) -> float:
        """Prior density of the value [1/unit], in the mean over a normal distribution: what a measurement of it knows."""
        if self.scale == "normal":
            spread = math.hypot(self.high, std)
            return math.exp(-0.5 * ((mean - self.low) / spread) ** 2) / (math.sqrt(2.0 * math.pi) * spread)
        ends = self._at(np.linspace(0.0, 1.0, _CELLS + 1))
        inside = np.diff(special.ndtr((ends - mean) / std))
        return float(np.sum(inside / (_CELLS * np.diff(ends))))


def density_on_either_side(low: float, high: float, value: float) -> float:
    """Density of a prior that is even in the logarithm on either side of zero, at a value; its range continued."""
    width = SMALLEST * max(abs(low), abs(high))
    return 1.0 / ((math.asinh(high / width) - math.asinh(low / width)) * math.hypot(value, width))


def _on_either_side(low: float, high: float, part: FloatArray) -> FloatArray:
    width = SMALLEST * max(abs(low), abs(high))
    ends = np.arcsinh(low / width), np.arcsinh(high / width)
    return np.asarray(width * np.sinh(ends[0] + part * (ends[1] - ends[0])))


@dataclass(frozen=True)
class Severity:
    """How an effect grows from nothing."""

    # Value of the parameters at which it is nothing; ``"whole"`` for an effect that is there or not
    end: Literal["zero", "one", "infinity", "whole"]
    carried_by: tuple[str, ...]  # Parameters that move with the severity; the first one states it
    # Values at severity one, for starts of a fit that are no effect at all
    reference: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Motion:
    """Motion of a place in the records."""

    low: float  # Peak in the quietest and in the loudest record [m or rad]
    high: float
    rate: float  # Peak rate at a level between [m/s or rad/s]
    force: float = 0.0  # Peak force that would hold the place still, zero where it is not known [N or N m]

    @property
    def middle(self) -> float:
        """Geometric mean of the peaks [m or rad]."""
        return math.sqrt(self.low * self.high)


@dataclass(frozen=True)
class Measured:
    """What is known of a measurement before any cause is fitted."""

    band: tuple[float, float] = (1.0, 1000.0)  # Ends of the band [Hz]
    channels: tuple[str, ...] = ()  # Measured channels
    motions: Mapping[str, Motion] = field(default_factory=dict)  # Motion of each port, where it is known


def parameter(unit: str, low: float, high: float, scale: Scale = "log", **more: Any) -> Any:
    """A dataclass field that is a fitted parameter of an effect."""
    default = more.pop("default", MISSING)
    meta = {"range": Range(unit, low, high, scale, **more)}
    return field(metadata=meta) if default is MISSING else field(default=default, metadata=meta)
