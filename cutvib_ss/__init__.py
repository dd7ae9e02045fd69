"""
Vibration of a Cartesian cutting machine: state-space models, and a diagnosis of the sim-to-real gap.

The public names are loaded when first used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cutvib_ss.effects.catalogue import register_effect
    from cutvib_ss.gap.diagnosis import diagnose
    from cutvib_ss.lpv import schedule
    from cutvib_ss.measurement.campaign import read_campaign, write_campaign
    from cutvib_ss.measurement.estimation import estimate
    from cutvib_ss.model.machine import Machine, cutting_machine, published_machine
    from cutvib_ss.model.structure import Structure
    from cutvib_ss.model_files import read_machine, write_machine
    from cutvib_ss.response.frequency import frequency_response
    from cutvib_ss.response.modes import modes, track_modes
    from cutvib_ss.response.pulses import pulse_train
    from cutvib_ss.response.time_response import time_response

__version__ = "0.1.0"

_HOMES = {
    "Machine": "model.machine",
    "Structure": "model.structure",
    "cutting_machine": "model.machine",
    "published_machine": "model.machine",
    "read_machine": "model_files",
    "write_machine": "model_files",
    "modes": "response.modes",
    "track_modes": "response.modes",
    "schedule": "lpv",
    "frequency_response": "response.frequency",
    "time_response": "response.time_response",
    "pulse_train": "response.pulses",
    "read_campaign": "measurement.campaign",
    "write_campaign": "measurement.campaign",
    "estimate": "measurement.estimation",
    "diagnose": "gap.diagnosis",
    "register_effect": "effects.catalogue",
}

__all__ = [
    "Machine",
    "Structure",
    "cutting_machine",
    "diagnose",
    "estimate",
    "frequency_response",
    "modes",
    "published_machine",
    "pulse_train",
    "read_campaign",
    "read_machine",
    "register_effect",
    "schedule",
    "time_response",
    "track_modes",
    "write_campaign",
    "write_machine",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
