"""The catalogue: every effect by its id."""

from collections.abc import Mapping
from types import MappingProxyType

from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect
from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.effects.guide_compliance import GuideCompliance
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.modal_truncation import ModalTruncation
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.rail_shear import RailShear
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.effects.window_damping import WindowDamping

EFFECTS: Mapping[str, type[Effect]] = MappingProxyType(
    {
        cls.effect: cls
        for cls in (
            AddedMass,
            BilinearStiffness,
            CalibrationError,
            ChannelDelay,
            CrossAxis,
            CubicStiffness,
            DryFriction,
            EndFixity,
            Freeplay,
            GuideCompliance,
            JointSlip,
            LocalResonator,
            ModalTruncation,
            ParameterShift,
            QuadraticDamping,
            RailAddedMass,
            RailShear,
            RailTorsion,
            StructuralDamping,
            SupportCompliance,
            ToolContact,
            WindowDamping,
        )
    }
)
"""Effect ids and their classes; an effect exists by standing in this list."""
