"""Nonlinear restoring forces at ports, a file each; another is registered by being defined."""

from cutvib_ss.model.restoring_forces.base import Hysteretic, Memoryless, RestoringForce, law, registered, value
from cutvib_ss.model.restoring_forces.bilinear_stiffness import BilinearStiffness
from cutvib_ss.model.restoring_forces.cubic_stiffness import CubicStiffness
from cutvib_ss.model.restoring_forces.dry_friction import DryFriction
from cutvib_ss.model.restoring_forces.freeplay import Freeplay
from cutvib_ss.model.restoring_forces.joint_slip import JointSlip
from cutvib_ss.model.restoring_forces.local_damping import LocalDamping
from cutvib_ss.model.restoring_forces.local_stiffness import LocalStiffness
from cutvib_ss.model.restoring_forces.packed import JUMPS, SLIDES, Packed, packed
from cutvib_ss.model.restoring_forces.quadratic_damping import QuadraticDamping

__all__ = [
    "RestoringForce", "Memoryless", "Hysteretic", "value", "law", "registered", "packed", "Packed", "JUMPS", "SLIDES",
    "BilinearStiffness", "CubicStiffness", "DryFriction", "Freeplay", "JointSlip", "LocalDamping", "LocalStiffness",
    "QuadraticDamping",
]  # fmt: skip
