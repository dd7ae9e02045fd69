"""Coulomb friction in a joint."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Motion, Severity, parameter
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
    severity = Severity("zero", ("torque",))
    sentence = "{place} has dry friction"
    inspection = "look at {place} for rubbing faces, seals or a lack of grease"

    torque: float = parameter("N m", 1e-3, 20.0)

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        full = scale.stiffness * scale.motion
        return {"torque": (2e-4 * full, 3.0 * full)}

    @classmethod
    def _start_values(cls, motion: Motion, k: float, c: float) -> Iterator[tuple[float, ...]]:
        return ((r * (k * motion.middle),) for r in np.geomspace(0.003, 1.5, 8).tolist())

    @classmethod
    def _example_values(cls, motion: float, k: float) -> tuple[float, ...]:
        return (0.1 * k * motion,)
