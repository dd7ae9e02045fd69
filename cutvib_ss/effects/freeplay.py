"""Clearance in a joint: no torque within a gap."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from cutvib_ss.effects.base import parameter
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

    gap: float = parameter("rad", 1e-7, 1e-3)

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        return {"gap": (1e-3 * scale.motion, 3.0 * scale.motion)}
