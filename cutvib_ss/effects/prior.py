"""What an effect states of its parameters: unit and prior, how it grows from nothing; and what it is told of a measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field
from typing import Any, Literal


@dataclass(frozen=True)
class Range:
    """Unit and prior of an effect's parameter."""

    unit: str  # SI unit
    low: float  # Range that an engineer would believe: the prior of the diagnosis, not a limit of `Effect.apply`
    high: float
    # Whether the prior is even in the logarithm or in the value, or normal: mean ``low``, standard deviation ``high``
    scale: Literal["log", "linear", "normal"] = "log"
    minimum: float | None = 0.0  # Smallest value that makes sense at all
    limits: bool = False  # Whether the ends stand for limits, as free and clamped do, beyond which nothing changes

    def at(self, part: float) -> float:
        """The value at a part of the range, 0 to 1, in the coordinate in which the prior is even."""
        if self.scale == "log":
            return float(self.low * (self.high / self.low) ** part)
        return self.low + part * (self.high - self.low)


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


def parameter(
    unit: str, low: float, high: float, scale: Literal["log", "linear", "normal"] = "log", **more: Any
) -> Any:
    """A dataclass field that is a fitted parameter of an effect."""
    default = more.pop("default", MISSING)
    meta = {"range": Range(unit, low, high, scale, **more)}
    return field(metadata=meta) if default is MISSING else field(default=default, metadata=meta)
