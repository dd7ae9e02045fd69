"""The tuned vibration absorber (Section 7): Sherman-Morrison on responses, subsystem, parametric study, optimal design."""

from cutvib_ss.absorber.coupling import (
    MountedAbsorber,
    absorbed_response,
    absorber_of,
    attach_absorber,
    attach_absorbers,
    dynamic_stiffness,
    printed_absorber,
    sherman_morrison,
)
from cutvib_ss.absorber.study import WORKING_FREQUENCY, AbsorberStudy, check_absorber, parametric_study

__all__ = [
    "WORKING_FREQUENCY",
    "AbsorberStudy",
    "MountedAbsorber",
    "absorbed_response",
    "absorber_of",
    "attach_absorber",
    "attach_absorbers",
    "check_absorber",
    "dynamic_stiffness",
    "parametric_study",
    "printed_absorber",
    "sherman_morrison",
]
