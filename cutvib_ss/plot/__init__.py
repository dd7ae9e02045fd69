"""
Pictures of results: each function takes a result and returns a `matplotlib.figure.Figure`, and computes nothing else.

No window is opened and pyplot is never imported; `save` and `png` turn a figure into a file or into bytes.
"""

from cutvib_ss.plot.absorber import absorber_front, absorber_study, absorbers_over_the_rail
from cutvib_ss.plot.control import controller_overview, controller_responses
from cutvib_ss.plot.diagnosis import cause_bars, comparison_grid, error_map
from cutvib_ss.plot.moving import travel_histories
from cutvib_ss.plot.response import absorber_effect, bode
from cutvib_ss.plot.schedule import bode_map, interpolation_error, pole_map, schedule
from cutvib_ss.plot.style import png, save
from cutvib_ss.plot.time import time_histories

__all__ = [
    "absorber_effect",
    "absorber_front",
    "absorber_study",
    "absorbers_over_the_rail",
    "bode",
    "bode_map",
    "cause_bars",
    "comparison_grid",
    "controller_overview",
    "controller_responses",
    "error_map",
    "interpolation_error",
    "pole_map",
    "png",
    "save",
    "schedule",
    "time_histories",
    "travel_histories",
]
