"""Two effects of another package: one by an entry point, with an element of its own; one as short as an effect can be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from cutvib_ss.effects.base import Effect, applied, attached_to, check_place, parameter, port_of, ports_of
from cutvib_ss.errors import CouplingError
from cutvib_ss.model.elements import SpringDamperMass


@dataclass(frozen=True)
class SpringAndDamperInSeries:
    """z = s c k / (k + s c): no mass between spring and damper, hence no second-order form."""

    stiffness: float
    damping: float

    def dynamic_stiffness(self, s: Any) -> Any:
        return s * self.damping * self.stiffness / (self.stiffness + s * self.damping)

    def derivative(self, name: str, s: Any) -> Any:
        k, c = self.stiffness, self.damping
        over = {"stiffness": (s * c) ** 2, "damping": s * k**2, "s": c * k**2 + 0 * s}[name]
        return over / (k + s * c) ** 2

    def second_order(self) -> Any:
        raise CouplingError("a damper on a spring has no second-order form")


@dataclass(frozen=True)
class HydraulicDamper(Effect):
    """A hydraulic damper whose mount gives."""

    effect = "hydraulic_damper"
    sentence = "a damper with a soft mount holds {place}"
    inspection = "look for a shock absorber or a hose on {place}"

    stiffness: float = parameter("N/m", 1e2, 1e7)
    damping: float = parameter("N s/m", 1e-1, 1e4)

    @classmethod
    def places(cls, model: Any) -> tuple[str, ...]:
        return ports_of(model, ("tool", "head"))

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        element = SpringAndDamperInSeries(self.stiffness, self.damping)
        return applied(model, attached_to(model, port_of(self.place, model), element), self)


@dataclass(frozen=True)
class Belt(Effect):
    """A belt that pulls at a port."""

    effect = "belt"

    tension: float = parameter("N/m", 1.0, 1e6)

    @classmethod
    def places(cls, model: Any) -> tuple[str, ...]:
        return ports_of(model, ("tool",))

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        return applied(model, attached_to(model, port_of(self.place, model), SpringDamperMass(self.tension)), self)
