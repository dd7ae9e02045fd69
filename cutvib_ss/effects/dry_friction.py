"""Coulomb friction in a joint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from cutvib_ss.effects.base import parameter
from cutvib_ss.effects.law_element import LawElement
from cutvib_ss.effects.scales import PortScale


@dataclass(frozen=True)
class DryFriction(LawElement):
    """
    Torque against the rate, of one size whatever the rate.

    Parameters
    ----------
    place : str
        ``"joint1"`` or ``"joint2"``; any port of another structure.
    torque : float
        Friction [N m; N at a port that is a displacement].

    Notes
    -----
    Coulomb's law, sticking included. Its describing function is the damper 4 torque/(π ω A): weaker as the motion grows.
    """

    effect: ClassVar[str] = "dry_friction"

    torque: float = parameter("N m", 1e-3, 20.0)

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        full = scale.stiffness * scale.motion
        return {"torque": (2e-4 * full, 3.0 * full)}
