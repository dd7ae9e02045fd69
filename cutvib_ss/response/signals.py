"""Units of a model's signals: points move in m, joints and twist in rad, modal coordinates in kg^0.5 m."""

from __future__ import annotations

import re

from cutvib_ss.machine import Machine
from cutvib_ss.structure import Structure
from cutvib_ss.units import FORCE_OF

_MODAL = re.compile(r"(eta|shear|twist)\d+")
_ROTATION = re.compile(r"(joint|theta)\d|.*twist")
_RAIL_POINT = re.compile(r"rail@(.+)")


def displacement_unit(machine: Machine | Structure, name: str) -> str:
    """Unit of a signal's displacement; of another structure, whose degrees of freedom are not described, m."""
    if not machine.has_position:
        return "m"
    if _MODAL.fullmatch(name):
        return "kg^0.5 m"
    return "rad" if _ROTATION.fullmatch(name) else "m"


def input_unit(machine: Machine | Structure, name: str) -> str:
    """Unit of what acts at an input: force, torque or modal force; m/s^2 where the base is shaken."""
    if name == "force":
        return "m/s^2" if machine.input_quantity == "acceleration" else "N"
    return FORCE_OF[displacement_unit(machine, name)]


def port_name(name: str) -> str:
    """``rail@0.25``, as a campaign writes a point of the rail, by its port's name ``rail(0.25)``."""
    found = _RAIL_POINT.fullmatch(name)
    return f"rail({found[1]})" if found else name
