"""
Vibration of a Cartesian cutting machine: state-space models, and a diagnosis of the sim-to-real gap.

The public names are loaded when first used, so that importing the package costs nothing. `__init__.pyi` tells type checkers
where they come from; a test holds the two lists together.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_NAMES_OF = {
    "model.machine": ("Machine", "cutting_machine", "published_machine"),
    "model.structure": ("Structure",),
    "parameters": ("AbsorberParameters", "HeadParameters", "RailParameters", "Tolerances"),
    "model_files": ("read_machine", "write_machine"),
    "response.modes": ("modes", "track_modes"),
    "response.frequency": ("frequency_response",),
    "response.harmonic_balance": ("sine_response",),
    "response.time_response": ("time_response",),
    "response.moving": ("moving_response",),
    "response.pulses": ("pulse_train",),
    "plant": ("schedule", "PlantSchedule"),
    "absorber": (
        "check_absorber",
        "design_absorbers",
        "mass_front",
        "workspace_check",
        "attach_absorber",
        "parametric_study",
        "AbsorberDesign",
        "AbsorberStudy",
        "AbsorberTolerance",
        "HarmonicForce",
        "MountedAbsorber",
        "WorkspaceCheck",
    ),
    "measurement": ("read_campaign", "write_campaign", "estimate", "Campaign", "Record"),
    "identification": ("identify", "stabilisation", "IdentificationResult", "Stabilisation"),
    "effects.catalogue": ("register_effect",),
    "diagnosis.diagnose": ("diagnose",),
    "diagnosis.result": ("Diagnosis",),
    "diagnosis.plan": ("plan", "Plan", "PlannedCampaign"),
    "interchange": ("read_frf", "write_frf", "write_plant"),
    "paper": ("paper_tables",),
    "results": (
        "AbsorberCheck",
        "FrequencyResponse",
        "MeasuredFrequencyResponse",
        "Modes",
        "MovingResponse",
        "TimeResponse",
        "TrackedModes",
    ),
    "errors": (
        "ConvergenceError",
        "CouplingError",
        "CutvibError",
        "DataFormatError",
        "DesignError",
        "DiagnosisError",
        "IdentificationError",
        "ParameterError",
    ),
}
_HOMES = {name: home for home, names in _NAMES_OF.items() for name in names}

__all__ = sorted([*_HOMES, "plot"])


def __getattr__(name: str) -> Any:
    if name == "plot":
        return import_module(f"{__name__}.plot")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return list(__all__)
