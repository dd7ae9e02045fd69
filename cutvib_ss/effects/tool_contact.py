"""Belt, cloth or a stop holds the tool: a spring and damper to ground in X."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Effect, Measured, Model, Range, Severity, parameter, ports_of
from cutvib_ss.effects.port_element import OBLIQUE, ObliqueElement
from cutvib_ss.effects.scales import TOLERATED, port_scale
from cutvib_ss.model.elements import SpringDamperMass

STIFFEST = 100.0
"""Of the stiffness against a slow force there: a contact that leaves one percent of the motion is as good as a pin."""
SOFTEST = -0.95
"""Of the spring that a port spans: cracked or loose, it is hardly there any more."""


@dataclass(frozen=True)
class ToolContact(ObliqueElement):
    """
    A spring and damper from the tool to ground, in X or at an angle to it.

    At a port of another structure it lies beside the spring that the port spans; its stiffness is negative where that spring is
    softer than the model has it.
    """

    effect: ClassVar[str] = "tool_contact"
    severity = Severity("zero", ("stiffness", "damping"))
    sentence = "something touches {place} and holds it like a spring and damper to ground"
    inspection = "look for what touches {place}: belt, cloth, cable, stop; take it away and measure again"
    less = "{place} is softer than the model has it"
    less_inspection = "look at {place} for a crack, a loose bolt or a changed part"
    example: ClassVar[Mapping[str, float]] = {"stiffness": 2e4, "damping": 10.0}

    # Stiffness [N/m]; negative where the model has too much
    stiffness: float = parameter("N/m", 0.0, 1e6, "asinh", minimum=None)
    damping: float = parameter("N s/m", 0.0, 300.0, "linear", default=0.0)  # Damping [N s/m]
    # Direction from X toward Z on the cutting machine [rad]
    angle: float = parameter("rad", 0.0, OBLIQUE, "normal", default=0.0, minimum=None)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ports_of(model, ("tool",))

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        given = super().ranges(model, place, motion)
        if model.head is not None:
            return given
        scale = port_scale(model, place)
        # A stop holds the point of a frame many times stiffer than the whole frame does.
        stiffness, spring = STIFFEST * scale.holding, model.spring_at(place)
        return {
            "stiffness": replace(
                given["stiffness"], low=0.0 if spring is None else SOFTEST * spring[0], high=stiffness
            ),
            "damping": replace(given["damping"], high=(stiffness * scale.mass) ** 0.5),
        }

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for place in cls.places(model):
            m, k, c = model.carried_at(place)
            if k == 0.0:
                # Of a body that nothing holds, a spring that puts it into the band, and one percent of critical damping.
                k = m * (2 * math.pi) ** 2 * measured.band[0] * measured.band[1]
                c = c or 0.02 * math.sqrt(k * m)
            stiffness, damping = k * 0.02, c * 0.02
            factors = (0.3, 2.0, 12.0, 60.0) if model.head is not None else (0.3, 2.0, 12.0, 60.0, 400.0)
            grid = [(f, g) for f in factors for g in (0.3, 10.0)]
            if model.head is None and model.spring_at(place) is not None:
                grid += [(-5.0, 0.3), (-25.0, 0.3)]
            yield place, tuple(cls(place, f * stiffness, g * damping) for f, g in grid)

    def tolerated(self, model: Any) -> bool:
        spring = model.spring_at(self.place) if model.head is None else None
        if spring is None:
            return False
        stiffness, damping = (TOLERATED * t for t in (model.tolerance.stiffness, model.tolerance.damping))
        loss = model.carried_at(self.place)[2]
        return bool(abs(self.stiffness) <= stiffness * spring[0] and abs(self.damping) <= damping * loss)

    def element(self) -> SpringDamperMass:
        return SpringDamperMass(stiffness=self.stiffness, damping=self.damping)
