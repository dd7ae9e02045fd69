"""What a port carries: the mass, spring and damper there, in proportion to which an effect at it is weak or strong."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cutvib_ss.effects.base import PLACE_PORTS, Carried, Model
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import value_at
from cutvib_ss.results import FloatArray

FREE_FREQUENCY = 77.0
"""Where nothing holds a body, springs are sized by the mass and this frequency [Hz], the middle of those of resonators."""
TYPICAL_FORCE = 50.0
"""Force on the tool that moves a joint, where nothing is known of the records [N]; on another structure it is 1 N."""


@dataclass(frozen=True)
class PortScale:
    """What a port carries."""

    mass: float  # Mass that a force at the port moves at once, 1/(p M⁻¹ pᵀ) [kg, or kg m^2 at a joint]
    # Stiffness against a slow force there, or where the structure is free that of its stiffest mode [N/m, or N m/rad]
    stiffness: float
    motion: float  # Displacement under a typical force [m or rad]

    @property
    def holding(self) -> float:
        """The stiffness, or of a body that nothing holds that of a spring that would matter to it [N/m, or N m/rad]."""
        return self.stiffness or self.mass * (2 * math.pi * FREE_FREQUENCY) ** 2

    @property
    def natural_freq(self) -> float:
        """Natural frequency of that mass on that spring [Hz]; zero of a body that nothing holds."""
        return math.sqrt(self.stiffness / self.mass) / (2 * math.pi)


def port_scale(model: Model, place: str, motion: float | None = None) -> PortScale:
    """What the port at a place carries."""
    if isinstance(model, Machine):
        system, force = model.second_order(0.5, viscous_at=100.0), TYPICAL_FORCE
        port = PLACE_PORTS.get(place, place)
        if port.startswith("joint"):
            force *= model.head.l1 if port == "joint1" else model.head.l2
    else:
        system, force, port = model.second_order(None, viscous_at=1.0), 1.0, place
    row = system.port(port)
    mass = 1.0 / float(row @ np.linalg.solve(system.mass, row))
    spring = spring_at(model, place)
    if spring is not None:
        stiffness = spring[0]
    else:
        squares, shapes = linalg.eigh(system.stiffness, system.mass)
        moved = (shapes.T @ row) ** 2
        held = squares > 1e-9 * squares[-1]
        free = float(moved[~held].sum()) > 1e-9 * float(moved.sum())
        stiffness = mass * float(squares[-1]) if free else 1.0 / float(np.sum(moved[held] / squares[held]))
    # A body that nothing holds has no motion of its own under a slow force: a millimetre stands for it.
    return PortScale(mass, stiffness, motion or (force / stiffness if stiffness > 0.0 else 1e-3))


def spring_at(model: Model, place: str) -> tuple[float, Carried] | None:
    """
    The linear spring that a port spans.

    None where there is none. A port between two degrees of freedom, e_i - e_j, spans -K_ij, a port that is one degree of
    freedom its spring to ground, the sum of that row of K.
    """
    if isinstance(model, Machine):
        if place not in ("joint1", "joint2"):
            return None
        path = ("head", "k" + place[-1])
        return value_at(model, path), ((path, 1.0),)
    row, stiffness = model.system.port(place), model.system.stiffness
    spring = _spanned(row, stiffness)
    if spring <= 0.0:
        return None
    return model.scales[2] * spring, ((("scales", 2), spring),)


def _spanned(row: FloatArray, stiffness: FloatArray) -> float:
    held = np.flatnonzero(row)
    if held.size == 1:
        return float(stiffness[held[0]].sum() / row[held[0]] ** 2)
    if held.size == 2 and row[held[0]] == -row[held[1]]:
        return float(-stiffness[held[0], held[1]] / row[held[0]] ** 2)
    return 0.0


def carried_at(model: Model, place: str) -> tuple[float, float, float]:
    """Mass, stiffness and damping that a place carries, for starts in proportion."""
    if isinstance(model, Machine):
        h = model.head
        return {
            "head": (h.m1, h.k1 / h.l1**2, h.c1 / h.l1**2),
            "tool": (h.m2, h.k2 / h.l2**2, h.c2 / h.l2**2),
            "joint1": (h.m1 * h.l1**2, h.k1, h.c1),
            "joint2": (h.m2 * h.l2**2, h.k2, h.c2),
        }[place]
    row, system = model.system.port(place), model.system
    own = max(float(row @ row), 1e-30)
    mass, stiffness, damping = (
        float(abs(row @ m @ row)) / own**2 for m in (system.mass, system.stiffness, system.damping)
    )
    return mass, stiffness, damping


def rail_stiffness(model: Machine) -> float:
    """Stiffness of the rail's first mode [N/m], on which effects of the rail are scaled."""
    p = model.rail.parameters
    return float(p.mass / 2 * (2 * np.pi * p.first_frequency) ** 2)
