"""A panel, hose or cover that resonates on the tool or the head."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect, Measured, Model, Range, Severity, parameter, ports_of
from cutvib_ss.effects.port_element import OBLIQUE, ObliqueElement
from cutvib_ss.effects.scales import port_scale, resonances_at
from cutvib_ss.model.elements import SprungMass


@dataclass(frozen=True)
class LocalResonator(ObliqueElement):
    """A sprung mass, in X or at an angle to it (Eq. 24 with the signs of an element in parallel)."""

    effect: ClassVar[str] = "local_resonator"
    severity = Severity("zero", ("mass",))
    sentence = "something on {place} resonates on its own"
    inspection = "look for a panel, hose, cover or cable on {place} that can swing; hold it by hand and measure again"
    example: ClassVar[Mapping[str, float]] = {"mass": 0.1, "frequency": 150.0, "damping_ratio": 0.03}

    mass: float = parameter("kg", 0.002, 5.0)  # Mass [kg]
    frequency: float = parameter("Hz", 10.0, 600.0)  # Natural frequency of the mass on its spring [Hz]
    damping_ratio: float = parameter("1", 0.002, 0.2)  # Damping ratio
    # Direction from X toward Z on the cutting machine [rad]
    angle: float = parameter("rad", 0.0, OBLIQUE, "normal", default=0.0, minimum=None)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ports_of(model, ("tool", "head"))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given = super().ranges(model, place, motion)
        if model.head is not None:
            # Up to what it sits on: a panel of a fifth of the head's mass is no rarity.
            own = model.head.m2 if place == "tool" else model.head.m1
            return {**given, "mass": replace(given["mass"], high=max(given["mass"].high, own))}
        scale = port_scale(model, place)
        mass = replace(given["mass"], low=1e-3 * scale.mass, high=scale.mass)
        return {**given, "mass": mass, "frequency": resonances_at(model, place, given["frequency"])}

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        low, high = measured.band
        grid = np.geomspace(max(low, 1e-3) * 1.2, high, 46)[:-1]
        for place in cls.places(model):
            own = model.carried_at(place)[0]
            masses = (own * 0.01, own * 0.06)
            yield place, tuple(cls(place, mass, float(f), 0.03) for f in grid for mass in masses)

    def alias(self, model: Model, stds: Mapping[str, float]) -> Effect:
        """On a structure it goes by `added_mass` where 1/frequency² is zero within its standard deviation."""
        rigid = model.head is None and 2.0 * stds.get("frequency", 0.0) >= self.frequency
        return AddedMass(self.place, self.mass) if rigid else self

    def element(self) -> SprungMass:
        return SprungMass(self.mass, self.frequency, self.damping_ratio)
