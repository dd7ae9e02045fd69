"""What the conformance suite knows of each effect: its line of the contract, and the models on which it is tried."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.paths import with_value
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure

CONTRACT: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "rail_torsion": (("rail",), ("eccentricity", "inertia", "torsion_frequency", "damping_ratio", "fixing")),
    "support_compliance": (("rail_ends",), ("k_left", "k_right", "c_left", "c_right")),
    "end_fixity": (("rail_ends",), ("k_left", "k_right")),
    "rail_added_mass": (("rail",), ("position", "mass", "damping")),
    "rail_shear": (("rail",), ("shear_ratio",)),
    "modal_truncation": (("rail",), ("n_modes",)),
    "guide_compliance": (("head_base",), ("stiffness", "damping", "sensor_side")),
    "local_resonator": (("tool", "head"), ("mass", "frequency", "damping_ratio", "angle")),
    "added_mass": (("tool", "head"), ("mass",)),
    "tool_contact": (("tool",), ("stiffness", "damping", "angle")),
    "parameter_shift": (("joint1", "joint2", "head", "tool", "rail"), ("parameter", "factor")),
    "structural_damping": (("joint1", "joint2"), ("loss_factor", "form", "reference_frequency")),
    "cubic_stiffness": (("joint1", "joint2"), ("stiffness3", "offset", "bend", "exponent")),
    "freeplay": (
        ("joint1", "joint2"),
        ("gap", "contact_stiffness", "offset", "rounding", "contact_damping", "within", "beside"),
    ),
    "dry_friction": (("joint1", "joint2"), ("torque", "sticking_stiffness", "knee", "within")),
    "joint_slip": (("joint1", "joint2"), ("stiffness", "slip_torque", "spread", "exponent", "within")),
    "bilinear_stiffness": (("joint1", "joint2"), ("asymmetry",)),
    "quadratic_damping": (("joint1", "joint2"), ("coefficient",)),
    "channel_delay": (("measurement",), ("channel", "delay")),
    "calibration_error": (("measurement",), ("channel", "gain", "phase")),
    "cross_axis": (("measurement",), ("fraction",)),
    "window_damping": (("measurement",), ("decay_rate", "ahead")),
}
"""Places on the cutting machine and parameters of every effect that the catalogue may hold: names that files rely on."""

AT_PORTS = (
    "local_resonator", "added_mass", "tool_contact", "cubic_stiffness", "freeplay", "dry_friction", "joint_slip",
    "quadratic_damping",
)  # fmt: skip
"""Effects that sit at every port of any other structure."""
AT_SPRINGS = ("bilinear_stiffness", "structural_damping")
"""Effects that sit at every port of it that spans a spring."""
ANYWHERE = ("parameter_shift", "channel_delay", "calibration_error", "window_damping")
"""Effects that need no port."""

MACHINE_SHIFTS = {
    ("joint1", "k1"), ("joint1", "c1"), ("joint2", "k2"), ("joint2", "c2"), ("head", "l1"), ("tool", "l2"),
    ("rail", "mass"), ("rail", "first_frequency"), ("rail", "damping_ratio"),
}  # fmt: skip
"""Parameters of the cutting machine that may be off, each at its place."""


@dataclass(frozen=True)
class Case:
    """
    An effect at one place of one model, with what is discrete about it chosen.

    Parameters
    ----------
    name : str
        For the test's id.
    model : Machine or Structure
        The model without it.
    build : callable
        Severity to effect: 0 is none, 1 strong; change is about proportional to it where it is small.
    """

    name: str
    model: Model
    build: Callable[[float], Effect]

    @property
    def id(self) -> str:
        """Id of the effect in the catalogue."""
        return type(self.build(1.0)).effect

    @property
    def none(self) -> Effect:
        """The effect at zero severity, or as near to it as finite numbers go."""
        return self.build(0.0)

    @property
    def reference(self) -> Any:
        """The model that zero severity is the same as."""
        if self.id == "structural_damping":
            # It stands in place of the viscous damper, which is therefore gone.
            place = self.build(1.0).place
            if self.model.head is not None:
                return with_value(self.model, ("head", "c" + place[-1]), 0.0)
            system = self.model.system
            row = system.ports[place]
            return replace(
                self.model, system=replace(system, damping=system.damping - LINK_DAMPER * np.outer(row, row))
            )
        return self.model


LINK_DAMPER = 8.0
"""Of each link of the structure [N s/m]."""


def three_masses() -> Structure:
    """
    A chain of three masses on a wall.

    Returns
    -------
    Structure
        With a port at each end and one across the last spring.
    """
    k, c = 2.5e5, LINK_DAMPER
    link = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    ports = {
        "drive": np.array([1.0, 0.0, 0.0]),
        "tip": np.array([0.0, 0.0, 1.0]),
        "spring23": np.array([0.0, -1.0, 1.0]),
    }
    system = SecondOrder(np.diag([2.0, 1.5, 0.8]), c * link, k * link, ("x1", "x2", "x3"), ports)
    channels = {"drive_a": Channel("drive", "acceleration"), "tip_y": Channel("tip", "displacement")}
    return Structure(system, channels, input_port="drive")


def loaded(model: Model) -> Any:
    """
    A model that has effects already, so that the next one is not the first in any slot.

    Parameters
    ----------
    model : Machine or Structure
        The model.

    Returns
    -------
    Machine or Structure
        The model with four effects at least.
    """
    port = "tool" if isinstance(model, Machine) else "tip"
    first = next(iter(model.channels))
    under: list[Effect] = [
        ToolContact(port, 8e3, 4.0), CalibrationError("measurement", first, 1.1), ChannelDelay("measurement", first, 5e-5),
        LocalResonator(port, 0.05, 90.0, 0.02),
    ]  # fmt: skip
    if isinstance(model, Machine):
        under += [
            RailAddedMass("rail", 0.7, 2.0, 10.0), EndFixity("rail_ends", 1e5, 2e5), ParameterShift("joint2", "k2", 0.9),
            StructuralDamping("joint2", 0.03),
        ]  # fmt: skip
    for effect in under:
        model = effect.apply(model)
    return model


MODELS: Mapping[str, Model] = {"machine": published_machine(), "structure": three_masses()}


def cases() -> list[Case]:
    """
    Every effect of the catalogue, at every place of both models, with every discrete choice.

    Returns
    -------
    list of Case
        The cases.
    """
    found = []
    for effect, kind in EFFECTS.items():
        for name, model in MODELS.items():
            for place in kind.places(model):
                for what, build in kind.examples(model, place):
                    found.append(Case("-".join(filter(None, (effect, name, place, what))), model, build))
    return found


def with_parameter(effect: Effect, name: str, value: float) -> Effect:
    """
    An effect with one value replaced.

    Parameters
    ----------
    effect : Effect
        The effect.
    name : str
        Its parameter.
    value : float
        The value.

    Returns
    -------
    Effect
        The new effect.
    """
    return replace(effect, **{name: value})
