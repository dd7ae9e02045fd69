"""Damping in a joint that grows with the rate."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Severity, parameter
from cutvib_ss.effects.law_element import LawElement, StartScale
from cutvib_ss.effects.scales import PortScale


@dataclass(frozen=True)
class QuadraticDamping(LawElement):
    """
    Torque coefficient · rate · abs(rate).

    Drag of a fluid that is pressed out. Its describing function is the damper 8/(3π) coefficient ω A.
    """

    effect: ClassVar[str] = "quadratic_damping"
    severity = Severity("zero", ("coefficient",))
    sentence = "{place} has damping that grows with speed"
    inspection = "look at {place} for oil, grease or air that is pressed through a gap"

    # Coefficient [N m s^2/rad^2; N s^2/m^2 at a port that is a displacement]
    coefficient: float = parameter("N m s^2/rad^2", 0.01, 100.0)

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        return ({"coefficient": float(r) * s.damping / s.rate} for r in np.geomspace(0.1, 20.0, 6))

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        unit = scale.mass / scale.motion
        return {"coefficient": (3e-4 * unit, 3.0 * unit)}

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"coefficient": 0.1 * k / (1000.0**2 * motion)}
