"""Clearance in a joint: no torque within a gap."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Motion, Severity, parameter
from cutvib_ss.effects.law_element import LawElement
from cutvib_ss.effects.scales import PortScale


@dataclass(frozen=True)
class Freeplay(LawElement):
    """
    No torque within ±gap, k (θ ∓ gap) beyond; the joint's damper acts in the gap, too.

    Parameters
    ----------
    place : str
        ``"joint1"`` or ``"joint2"``; a port of another structure that spans a spring.
    gap : float
        Half of the clearance [rad; m at a port that is a displacement].

    Notes
    -----
    To the linear spring it adds -k clip(θ, -gap, gap), k being that of the spring that the port spans. The linear model is the
    joint without clearance, which it nears as the motion grows.
    """

    effect: ClassVar[str] = "freeplay"
    severity = Severity("zero", ("gap",))
    sentence = "{place} has play"
    inspection = "move {place} by hand to feel for clearance; check its bearing and its bolts"

    gap: float = parameter("rad", 1e-7, 1e-3)

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        return {"gap": (1e-3 * scale.motion, 3.0 * scale.motion)}

    @classmethod
    def _start_values(cls, motion: Motion, k: float, c: float) -> Iterator[tuple[float, ...]]:
        return ((r * motion.middle,) for r in np.geomspace(0.005, 1.5, 9).tolist())

    @classmethod
    def _example_values(cls, motion: float, k: float) -> tuple[float, ...]:
        return (0.1 * motion,)
