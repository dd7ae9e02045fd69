"""Friction in a joint: gross slip."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Severity, parameter
from cutvib_ss.effects.law_element import StartScale
from cutvib_ss.effects.scales import PortScale
from cutvib_ss.effects.sticking import Sticking

KNEE_OF_A_SPREAD = 0.4
"""Knee over the spread of slip torques where the displacements at which contacts slide deviate as much: spread 1 by 0.58."""


@dataclass(frozen=True)
class DryFriction(Sticking):
    """
    Elastic up to the torque, then sliding against it, of one size whatever the rate (Jenkins).

    The describing function of Coulomb's law is the damper 4 torque/(π ω A): weaker as the motion grows. A motion below
    torque/sticking_stiffness does not slide, and sees a joint that is stiffer. Faces that have settled do not yield at once, but
    over a knee (Dahl; Bouc and Wen).
    """

    effect: ClassVar[str] = "dry_friction"
    sticks_with: ClassVar[str] = "sticking_stiffness"
    severity = Severity("zero", ("torque",))
    sentence = "{place} has dry friction"
    inspection = "look at {place} for rubbing faces, seals or a lack of grease"

    torque: float = parameter("N m", 1e-3, 20.0)  # Friction [N m; N at a port that is a displacement]
    # Stiffness beside k while it sticks [N m/rad; N/m]. Infinite by default: Coulomb's law; soft it is no friction
    sticking_stiffness: float = parameter("N m/rad", 1e2, 1e8, default=math.inf, limits=True)
    # How gradually it yields: None at once, 1 as Dahl's friction, between them Bouc's and Wen's with exponent 1/knee
    knee: float | None = parameter("1", 0.0, 1.0, "linear", default=None, limits=True)

    def kindred(self, stds: Mapping[str, float]) -> Sticking | None:
        """Joint slip that yields as gradually; none of friction that yields at once, which is slip without a spread."""
        from cutvib_ss.effects.joint_slip import JointSlip  # it goes by this name without a spread

        if self.knee is None or self.knee <= stds.get("knee", 0.0) or not math.isfinite(self.sticking_stiffness):
            return None
        spread = min(self.knee / KNEE_OF_A_SPREAD, 1.0)
        return JointSlip(self.place, self.sticking_stiffness, self.torque, spread, within=self.within)

    def odds_to_kindred(self, motion: float) -> float:
        """Friction is gross slip: the farther beyond where its contacts slide a motion goes, the less it is slip within a joint."""
        return self._far_beyond(motion)

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        ideal = [{"torque": float(r) * s.force} for r in np.geomspace(0.003, 1.5, 8)]
        elastic = ((r, k) for k in (0.01, 1.0, 10.0) for r in (0.01, 0.05, 0.25, 1.0))
        return ideal + [
            {"torque": r * min(k, 1.0) * s.force, "sticking_stiffness": k * s.stiffness, "knee": 0.3}
            for r, k in elastic
        ]

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        full = scale.stiffness * scale.motion
        return {
            "torque": (1e-6 * full, 3.0 * full),
            "sticking_stiffness": (1e-4 * scale.stiffness, 1e4 * scale.stiffness),
            "knee": (0.0, 1.0),
        }

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"torque": 0.1 * k * motion}
        yield {"torque": 0.1 * k * motion, "sticking_stiffness": 2.0 * k}
        yield {"torque": 0.1 * k * motion, "sticking_stiffness": 2.0 * k, "knee": 0.5}
