"""Micro-slip in a joint: contacts in parallel that give way one after the other."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

from cutvib_ss.effects.base import Model, Severity, parameter
from cutvib_ss.effects.dry_friction import KNEE_OF_A_SPREAD, DryFriction
from cutvib_ss.effects.law_element import LawElement, StartScale
from cutvib_ss.effects.scales import PortScale
from cutvib_ss.effects.sticking import Sticking


@dataclass(frozen=True)
class JointSlip(Sticking):
    """
    Elastic contacts in parallel to the joint, each sliding beyond a torque of its own (Iwan).

    Iwan, J. Appl. Mech. 33, 1966. With spread 0, the default, it is one Jenkins element, the same as `dry_friction` with that
    sticking stiffness. The model's own stiffness is that of the joint when all slides, what is quiet is stiffer by
    ``stiffness``; ``within`` the model's spring it is that of the joint at rest.
    """

    effect: ClassVar[str] = "joint_slip"
    sticks_with: ClassVar[str] = "stiffness"
    severity = Severity("zero", ("stiffness", "slip_torque"))
    sentence = "{place} slips a little"
    inspection = "check the bolts of {place} and the faces that they clamp"

    # Stiffness before it slides [N m/rad; N/m at a port that is a displacement]
    stiffness: float = parameter("N m/rad", 30.0, 3e4)
    slip_torque: float = parameter("N m", 1e-3, 20.0)  # Torque at which all of it slides in the mean [N m; N]
    # Slip torques lie evenly between (1 - spread) and (1 + spread) times that, 0 to 1
    spread: float = parameter("1", 0.0, 1.0, "linear", default=0.0)
    # Or their density goes with this power of how far they are above the lowest; of bolted joints -1 to 0 (Segalman 2005)
    exponent: float = parameter("1", -0.9, 0.9, "linear", minimum=-0.95, default=0.0)

    def alias(self, model: Model, stds: Mapping[str, float]) -> LawElement:
        """The effect by the name it goes by: `dry_friction` where the spread is zero within its standard deviation."""
        if self.spread > stds.get("spread", 0.0):
            return self
        return DryFriction(self.place, self.slip_torque, self.stiffness, within=self.within)

    def kindred(self, stds: Mapping[str, float]) -> DryFriction | None:
        """Friction that yields as gradually; without a spread slip goes by that name anyway."""
        if self.spread <= stds.get("spread", 0.0):
            return None
        return DryFriction(
            self.place, self.slip_torque, self.stiffness, KNEE_OF_A_SPREAD * self.spread, within=self.within
        )

    def odds_to_kindred(self, motion: float) -> float:
        """Slip within a joint: odds as one over those of friction."""
        return 1.0 / self._far_beyond(motion)

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        # A slip that a lightly damped resonance shows may be as weak as its loss factor beside the spring.
        sizes = ((r, q) for r in (0.003, 0.012, 0.05, 0.25, 1.0) for q in (0.03, 0.15, 0.6, 1.5))
        return ({"stiffness": r * s.stiffness, "slip_torque": q * r * s.force, "spread": 0.5} for r, q in sizes)

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        k, full = scale.stiffness, scale.stiffness * scale.motion
        return {
            "stiffness": (1e-4 * k, 3.0 * k),
            "slip_torque": (1e-6 * full, 3.0 * full),
            "spread": (0.0, 1.0),
            "exponent": (-0.9, 0.9),
        }

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"stiffness": 0.3 * k, "slip_torque": 0.1 * k * motion}
        yield {"stiffness": 0.3 * k, "slip_torque": 0.1 * k * motion, "spread": 0.6}
