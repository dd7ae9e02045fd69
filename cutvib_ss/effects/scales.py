"""What a port carries: the mass, spring and damper there, in proportion to which an effect at it is weak or strong."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.effects.base import Model, Range
from cutvib_ss.model.machine import Machine

TOLERATED = 1.96
"""Standard deviations of a matrix' factor, or of calibration, by which a part or a channel may differ from the model by itself."""

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
    if model.head is None:
        (mass, stiffness, _), force = model.carried_at(place), 1.0
    else:
        port, spring = model.port_at(place), model.spring_at(place)
        system, force = model.second_order(0.5, viscous_at=100.0), TYPICAL_FORCE
        if port.startswith("joint"):
            force *= model.head.l1 if port == "joint1" else model.head.l2
        mass, stiffness = system.at_port(port)
        stiffness = stiffness if spring is None else spring[0]
    # A body that nothing holds has no motion of its own under a slow force: a millimetre stands for it.
    return PortScale(mass, stiffness, motion or (force / stiffness if stiffness > 0.0 else 1e-3))


def resonances_at(model: Model, place: str, frequency: Range) -> Range:
    """The range of a resonance's frequency; on a structure widened to a decade on either side of what the place does by itself."""
    own = port_scale(model, place).natural_freq if model.head is None else 0.0
    if own <= 0.0:
        return frequency
    return replace(frequency, low=min(frequency.low, 0.1 * own), high=max(frequency.high, 10.0 * own))


def rail_stiffness(model: Machine) -> float:
    """Stiffness of the rail's first mode [N/m], on which effects of the rail are scaled."""
    p = model.rail.parameters
    return float(p.mass / 2 * (2 * np.pi * p.first_frequency) ** 2)
