"""Units of a model's signals: points move in m, joints and twist in rad, modal coordinates in kg^0.5 m."""

from __future__ import annotations

import re

from cutvib_ss.model.protocol import Model
from cutvib_ss.units import FORCE_OF

_MODAL = re.compile(r"(eta|shear|twist)\d+")


def displacement_unit(machine: Model, name: str) -> str:
    """Unit of a signal's displacement; of another structure, whose degrees of freedom are not described, m."""
    if machine.has_position and _MODAL.fullmatch(name):
        return "kg^0.5 m"
    return "rad" if machine.rotates(name) else "m"


def input_unit(machine: Model, name: str) -> str:
    """Unit of what acts at an input: force, torque or modal force; m/s^2 where the base is shaken."""
    if name == "force":
        return "m/s^2" if machine.input_quantity == "acceleration" else "N"
    return FORCE_OF[displacement_unit(machine, name)]
