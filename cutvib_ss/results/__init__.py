"""Every result type: frozen, labelled, with unit, arrays read-only; each prints as a short table and draws itself."""

from cutvib_ss.results.absorber import AbsorberCheck
from cutvib_ss.results.arrays import (
    QUANTITY_OF_FORM,
    ComplexArray,
    FloatArray,
    Form,
    Quantity,
    read_only,
)
from cutvib_ss.results.frequency import Estimator, FrequencyResponse, MeasuredFrequencyResponse
from cutvib_ss.results.modes import Modes, TrackedModes
from cutvib_ss.results.moving import Energies, MovingResponse
from cutvib_ss.results.time import TimeResponse

__all__ = [
    "QUANTITY_OF_FORM",
    "AbsorberCheck",
    "ComplexArray",
    "Energies",
    "Estimator",
    "FloatArray",
    "Form",
    "FrequencyResponse",
    "MeasuredFrequencyResponse",
    "Modes",
    "MovingResponse",
    "Quantity",
    "TimeResponse",
    "TrackedModes",
    "read_only",
]
