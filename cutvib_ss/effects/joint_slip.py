"""Micro-slip in a joint: a spring in parallel that gives way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

from cutvib_ss.effects.base import Motion, Severity, parameter
from cutvib_ss.effects.law_element import LawElement
from cutvib_ss.effects.scales import PortScale


@dataclass(frozen=True)
class JointSlip(LawElement):
    """
    An elastic element in parallel to the joint that slides beyond a torque (Jenkins).

    Parameters
    ----------
    place : str
        ``"joint1"`` or ``"joint2"``; any port of another structure.
    stiffness : float
        Stiffness before it slides [N m/rad; N/m at a port that is a displacement].
    slip_torque : float
        Torque at which it slides [N m; N].

    Notes
    -----
    Jenkins' element; a spread of them over slip torques is Iwan's (Iwan, J. Appl. Mech. 33, 1966). The model's own stiffness is
    that of the joint when it slides: what is quiet is stiffer by ``stiffness``.
    """

    effect: ClassVar[str] = "joint_slip"
    severity = Severity("zero", ("stiffness", "slip_torque"))
    sentence = "{place} slips a little"
    inspection = "check the bolts of {place} and the faces that they clamp"

    stiffness: float = parameter("N m/rad", 30.0, 3e4)
    slip_torque: float = parameter("N m", 1e-3, 20.0)

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        k, full = scale.stiffness, scale.stiffness * scale.motion
        return {"stiffness": (3e-3 * k, 3.0 * k), "slip_torque": (2e-4 * full, 3.0 * full)}

    @classmethod
    def _start_values(cls, motion: Motion, k: float, c: float) -> Iterator[tuple[float, ...]]:
        force = k * motion.middle
        return ((r * k, q * r * force) for r in (0.05, 0.25, 1.0) for q in (0.03, 0.15, 0.6, 1.5))

    @classmethod
    def _example_values(cls, motion: float, k: float) -> tuple[float, ...]:
        return (0.3 * k, 0.1 * k * motion)
