"""What an effect states of its parameters: unit and prior, how it grows from nothing; and what it is told of a measurement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field
from typing import Any, Literal


@dataclass(frozen=True)
class Range:
    """
    Unit and prior of an effect's parameter.

    Parameters
    ----------
    unit : str
        SI unit.
    low, high : float
        Range that an engineer would believe; the prior of the diagnosis, not a limit of `Effect.apply`.
    scale : {"log", "linear"}
        Whether the prior is even in the logarithm or in the value.
    minimum : float, optional
        Smallest value that makes sense at all.
    limits : bool
        Whether the ends stand for limits, as free and clamped do, beyond which nothing changes.
    """

    unit: str
    low: float
    high: float
    scale: Literal["log", "linear"] = "log"
    minimum: float | None = 0.0
    limits: bool = False

    def at(self, part: float) -> float:
        """The value at a part of the range, 0 to 1, in the coordinate in which the prior is even."""
        if self.scale == "log":
            return float(self.low * (self.high / self.low) ** part)
        return self.low + part * (self.high - self.low)


@dataclass(frozen=True)
class Severity:
    """
    How an effect grows from nothing.

    Parameters
    ----------
    end : {"zero", "one", "infinity", "whole"}
        Value of the parameters at which it is nothing; ``"whole"`` for an effect that is there or not.
    carried_by : tuple of str
        Parameters that move with the severity; the first one states it.
    reference : mapping of str to float
        Values at severity one, for starts of a fit that are no effect at all.
    """

    end: Literal["zero", "one", "infinity", "whole"]
    carried_by: tuple[str, ...]
    reference: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Motion:
    """
    Motion of a place in the records.

    Parameters
    ----------
    low, high : float
        Peak in the quietest and in the loudest record [m or rad].
    rate : float
        Peak rate at a level between [m/s or rad/s].
    force : float
        Peak force that would hold the place still, zero where it is not known [N or N m].
    """

    low: float
    high: float
    rate: float
    force: float = 0.0

    @property
    def middle(self) -> float:
        """Geometric mean of the peaks [m or rad]."""
        return math.sqrt(self.low * self.high)


@dataclass(frozen=True)
class Measured:
    """
    What is known of a measurement before any cause is fitted.

    Parameters
    ----------
    band : (float, float)
        Ends of the band [Hz].
    channels : tuple of str
        Measured channels.
    motions : mapping of str to Motion
        Motion of each port, where it is known.
    """

    band: tuple[float, float] = (1.0, 1000.0)
    channels: tuple[str, ...] = ()
    motions: Mapping[str, Motion] = field(default_factory=dict)


def parameter(unit: str, low: float, high: float, scale: Literal["log", "linear"] = "log", **more: Any) -> Any:
    """
    A dataclass field that is a fitted parameter of an effect.

    Parameters
    ----------
    unit : str
        SI unit.
    low, high : float
        Range that an engineer would believe.
    scale : {"log", "linear"}
        Whether the prior is even in the logarithm or in the value.
    **more : object
        ``minimum`` of `Range`, or ``default`` of the field.

    Returns
    -------
    dataclasses.Field
        The field.
    """
    default = more.pop("default", MISSING)
    meta = {"range": Range(unit, low, high, scale, **more)}
    return field(metadata=meta) if default is MISSING else field(default=default, metadata=meta)
