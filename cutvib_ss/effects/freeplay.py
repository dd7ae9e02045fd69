"""Clearance in a joint: no torque within a gap."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Severity, parameter
from cutvib_ss.effects.law_element import LawElement, StartScale
from cutvib_ss.effects.scales import PortScale


@dataclass(frozen=True)
class Freeplay(LawElement):
    """
    No torque within ±gap, contact_stiffness (θ ∓ gap) beyond; the joint's damper acts in the gap, too.

    The linear model is the joint without clearance, which this nears as the motion grows where the contact is as stiff.
    """

    effect: ClassVar[str] = "freeplay"
    touches = True
    severity = Severity("zero", ("gap",))
    sentence = "{place} has play"
    inspection = "move {place} by hand to feel for clearance; check its bearing and its bolts"

    gap: float = parameter("rad", 1e-7, 1e-3)  # Half of the clearance [rad; m at a port that is a displacement]
    # Stiffness beyond the gap [N m/rad; N/m]; by default the k of the spring that the port spans
    contact_stiffness: float | None = parameter("N m/rad", 30.0, 3e5, default=None)

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        gaps = [{"gap": float(r) * s.motion} for r in np.geomspace(0.005, 1.5, 9)]
        return gaps + [
            {"gap": g * s.motion, "contact_stiffness": r * s.stiffness} for g in (0.1, 0.6) for r in (0.5, 2.0)
        ]

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        k = scale.stiffness
        return {"gap": (1e-3 * scale.motion, 3.0 * scale.motion), "contact_stiffness": (0.1 * k, 10.0 * k)}

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"gap": 0.1 * motion}

    @property
    def vanishes(self) -> bool:
        # Without a gap a contact of its own stiffness is another spring, not nothing.
        return self.contact_stiffness is None
