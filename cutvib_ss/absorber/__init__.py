"""The tuned vibration absorber (Section 7): Sherman-Morrison on responses, subsystem, parametric study, optimal design."""

from cutvib_ss.absorber.coupling import (
    MountedAbsorber,
    absorbed_response,
    absorber_of,
    attach_absorber,
    attach_absorbers,
    dynamic_stiffness,
    misprinted_absorber,
    printed_absorber,
    sherman_morrison,
)
from cutvib_ss.absorber.design import AbsorberDesign, design_absorbers, mass_front
from cutvib_ss.absorber.force import WORKING_FREQUENCY, HarmonicForce
from cutvib_ss.absorber.study import AbsorberStudy, check_absorber, parametric_study
from cutvib_ss.absorber.tolerance import EXACT, AbsorberTolerance
from cutvib_ss.absorber.workspace import WorkspaceCheck, workspace_check

__all__ = [
    "EXACT",
    "WORKING_FREQUENCY",
    "AbsorberDesign",
    "AbsorberStudy",
    "AbsorberTolerance",
    "HarmonicForce",
    "MountedAbsorber",
    "WorkspaceCheck",
    "absorbed_response",
    "absorber_of",
    "attach_absorber",
    "attach_absorbers",
    "check_absorber",
    "design_absorbers",
    "dynamic_stiffness",
    "mass_front",
    "misprinted_absorber",
    "parametric_study",
    "printed_absorber",
    "sherman_morrison",
    "workspace_check",
]
