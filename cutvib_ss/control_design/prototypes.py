"""The prototypes by name: each with the hardware that it takes by default, and its design at a position."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import control

from cutvib_ss.control_design.active_absorber import active_absorber
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
from cutvib_ss.control_design.lqg import lqg
from cutvib_ss.control_design.ppf import positive_position_feedback
from cutvib_ss.control_design.resonant import resonant
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import table_7


@dataclass(frozen=True)
class Prototype:
    """
    A kind of controller.

    Parameters
    ----------
    name : str
        How it is called.
    about : str
        What it is, in a line.
    port : str
        Where its actuator sits by default.
    hardware : callable
        ``hardware(port, sampling)``: the hardware with the actuator at a port.
    design : callable
        ``design(machine, position, hardware)``: the controller.
    """

    name: str
    about: str
    port: str
    hardware: Callable[[str, Sampling | None], Hardware]
    design: Callable[[Machine, float, Hardware], control.StateSpace]


def actuator_at(port: str) -> ForceActuator:
    """A plausible actuator for a place."""
    if port.startswith("tool_"):
        return InertialActuator(port, mass=table_7().mass)
    return InertialActuator(port) if port.startswith("head_") else ForceActuator(port)


def _reading_the_tool(port: str, sampling: Sampling | None) -> Hardware:
    return Hardware((actuator_at(port),), (Sensor("tool_x"),), sampling)


def _collocated(port: str, sampling: Sampling | None) -> Hardware:
    return Hardware((actuator_at(port),), (Sensor(port),), sampling)


def _absorber_with_coil(port: str, sampling: Sampling | None) -> Hardware:
    own = table_7()
    coil = InertialActuator(port, mass=own.mass, frequency=own.frequency, damping_ratio=own.damping_ratio)
    return Hardware((coil,), (Sensor(coil.stroke, "displacement"),), sampling)


def _on_plant(
    rule: Callable[[control.StateSpace], control.StateSpace],
) -> Callable[[Machine, float, Hardware], control.StateSpace]:
    return lambda machine, position, hardware: rule(control_plant(machine, position, hardware))


PROTOTYPES: Mapping[str, Prototype] = MappingProxyType(
    {
        p.name: p
        for p in (
            Prototype("lqg", "LQG for a force of coloured noise", "head_x", _reading_the_tool, _on_plant(lqg)),
            Prototype("h2", "H2, weighed at the tool's frequency", "head_x", _reading_the_tool, _on_plant(h2)),
            Prototype("hinf", "H∞ mixed sensitivity, norm verified", "head_x", _reading_the_tool, _on_plant(hinf)),
            Prototype("resonant", "resonators at 217 Hz and two harmonics", "head_x", _reading_the_tool, _on_plant(resonant)),
            Prototype(
                "ppf", "positive position feedback at the actuator", "tool_x", _collocated,
                _on_plant(positive_position_feedback),
            ),
            Prototype(
                "active-absorber", "Table 7's absorber, tuned by a coil", "tool_x", _absorber_with_coil,
                lambda machine, position, hardware: active_absorber(hardware),
            ),
        )
    }
)  # fmt: skip
"""All prototypes by name."""


def prototype(name: str) -> Prototype:
    """
    A prototype by name.

    Parameters
    ----------
    name : str
        Name.

    Returns
    -------
    Prototype
        The prototype.

    Raises
    ------
    ParameterError
        If there is none of that name; the message lists those that are.
    """
    if name not in PROTOTYPES:
        raise ParameterError(f"no controller {name!r}; there are {', '.join(PROTOTYPES)}")
    return PROTOTYPES[name]
