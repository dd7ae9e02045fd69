"""
Pictures of results: each function takes a result, draws it and computes nothing else.

Functions take a result and ``ax``, the axes to draw on, an array of them for several panels, and return it. Without it they
make a figure: functions of one axes return the axes, those of several panels the figure. No window is opened and pyplot is
never imported; `save` and `png` turn what was drawn into a file or into bytes.
"""

from functools import singledispatch
from typing import Any

from cutvib_ss.absorber import AbsorberDesign, AbsorberStudy, WorkspaceCheck
from cutvib_ss.diagnosis.result import Diagnosis
from cutvib_ss.errors import ParameterError
from cutvib_ss.identification import IdentificationResult, Stabilisation
from cutvib_ss.plot.absorber import absorber_front, absorber_study, absorbers_over_the_rail
from cutvib_ss.plot.blind import confusion_map, reliability_diagram, risk_curve, severity_curve, shrinkage_scatter
from cutvib_ss.plot.control import controller_overview, controller_responses
from cutvib_ss.plot.diagnosis import cause_bars, comparison_grid, error_map
from cutvib_ss.plot.moving import travel_histories
from cutvib_ss.plot.poles import poles_over_position, s_plane
from cutvib_ss.plot.response import absorber_effect, bode, fitted_response, magnitude, nyquist
from cutvib_ss.plot.schedule import bode_map, interpolation_error, pole_map, schedule
from cutvib_ss.plot.shapes import animate_mode, mode_shapes
from cutvib_ss.plot.stabilisation import stabilisation_diagram
from cutvib_ss.plot.stiffness import stiffness_grid
from cutvib_ss.plot.style import png, save
from cutvib_ss.plot.time import time_histories
from cutvib_ss.results import AbsorberCheck, FrequencyResponse, Modes, MovingResponse, TimeResponse, TrackedModes

__all__ = [
    "absorber_effect",
    "absorber_front",
    "absorber_study",
    "absorbers_over_the_rail",
    "animate_mode",
    "bode",
    "bode_map",
    "cause_bars",
    "comparison_grid",
    "confusion_map",
    "controller_overview",
    "controller_responses",
    "draw",
    "error_map",
    "fitted_response",
    "interpolation_error",
    "magnitude",
    "mode_shapes",
    "nyquist",
    "pole_map",
    "poles_over_position",
    "png",
    "reliability_diagram",
    "risk_curve",
    "s_plane",
    "save",
    "schedule",
    "severity_curve",
    "shrinkage_scatter",
    "stabilisation_diagram",
    "stiffness_grid",
    "time_histories",
    "travel_histories",
]


@singledispatch
def draw(result: Any, **options: Any) -> Any:
    """
    Draw a result with the function for its type; what a result's ``plot`` method calls.

    Parameters
    ----------
    result : object
        A result of the package.
    **options : object
        For that function.

    Returns
    -------
    Figure, Axes or array of Axes
        What was drawn.

    Raises
    ------
    ParameterError
        If there is no picture of such a result.
    """
    raise ParameterError(f"there is no picture of a {type(result).__name__}")


draw.register(FrequencyResponse, bode)
draw.register(Modes, s_plane)
draw.register(TrackedModes, schedule)
draw.register(TimeResponse, time_histories)
draw.register(MovingResponse, travel_histories)
draw.register(AbsorberCheck, absorber_effect)
draw.register(AbsorberStudy, absorber_study)
draw.register(IdentificationResult, fitted_response)
draw.register(Stabilisation, stabilisation_diagram)


@draw.register
def _workspace(result: WorkspaceCheck, **options: Any) -> Any:
    return absorbers_over_the_rail({"with absorbers": result}, **options)


@draw.register
def _design(result: AbsorberDesign, **options: Any) -> Any:
    return absorbers_over_the_rail({"optimum": result.check}, **options)


@draw.register
def _diagnosis(result: Diagnosis, **options: Any) -> Any:
    return comparison_grid(result.comparisons, **options)
