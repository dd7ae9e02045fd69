"""Prototypes of controllers, and one check for all of them over positions and machines."""

from cutvib_ss.control_design.active_absorber import active_absorber
from cutvib_ss.control_design.amplitudes import (
    AmplitudeMargins,
    LimitCycle,
    amplitude_margins,
    quasi_linear,
    working_amplitudes,
)
from cutvib_ss.control_design.check import check_controller, check_positions, full_order
from cutvib_ss.control_design.files import controller_data, read_controller
from cutvib_ss.control_design.h2 import h2
from cutvib_ss.control_design.hardware import (
    ForceActuator,
    Hardware,
    InertialActuator,
    Sampling,
    Sensor,
    control_plant,
)
from cutvib_ss.control_design.hinf import hinf
from cutvib_ss.control_design.loop import Loop, discretised, sampled
from cutvib_ss.control_design.lqg import lqg
from cutvib_ss.control_design.margins import Margins, disk_margin, margins
from cutvib_ss.control_design.ppf import positive_position_feedback
from cutvib_ss.control_design.prototypes import PROTOTYPES, Prototype, prototype
from cutvib_ss.control_design.reduction import reduced, smallest_controller
from cutvib_ss.control_design.resonant import resonant
from cutvib_ss.control_design.result import ControllerCheck, WorstCase
from cutvib_ss.control_design.scheduling import ScheduledController, in_common_coordinates, schedule
from cutvib_ss.control_design.synthesis import closed_norm, h2_synthesis, hinf_controller, hinf_synthesis

__all__ = [
    "PROTOTYPES",
    "AmplitudeMargins",
    "ControllerCheck",
    "ForceActuator",
    "Hardware",
    "InertialActuator",
    "LimitCycle",
    "Loop",
    "Margins",
    "Prototype",
    "Sampling",
    "ScheduledController",
    "Sensor",
    "WorstCase",
    "active_absorber",
    "amplitude_margins",
    "check_controller",
    "check_positions",
    "closed_norm",
    "control_plant",
    "controller_data",
    "discretised",
    "disk_margin",
    "full_order",
    "h2",
    "h2_synthesis",
    "hinf",
    "hinf_controller",
    "hinf_synthesis",
    "in_common_coordinates",
    "lqg",
    "margins",
    "positive_position_feedback",
    "prototype",
    "quasi_linear",
    "read_controller",
    "reduced",
    "resonant",
    "sampled",
    "schedule",
    "smallest_controller",
    "working_amplitudes",
]
