"""Clearance in a joint: no torque within a gap."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.effects.base import Carried, Effect, Severity, applied, parameter
from cutvib_ss.effects.law_element import StartScale
from cutvib_ss.effects.scales import PortScale
from cutvib_ss.effects.within_spring import WithinSpring
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.protocol import NonlinearElement


@dataclass(frozen=True)
class Freeplay(WithinSpring):
    """
    No torque within ±gap, contact_stiffness (θ ∓ gap) beyond; the joint's damper acts in the gap, too.

    The linear model is the joint without clearance, which this nears as the motion grows where the contact is as stiff. ``within``
    the joint's spring only a part of it, contact_stiffness, acts beyond the gap: one of several bolts is loose.
    """

    effect: ClassVar[str] = "freeplay"
    touches = True
    severity = Severity("zero", ("gap",))
    sentence = "{place} has play"
    inspection = "move {place} by hand to feel for clearance; check its bearing and its bolts"

    gap: float = parameter("rad", 1e-7, 1e-3)  # Half of the clearance [rad; m at a port that is a displacement]
    # Stiffness beyond the gap [N m/rad; N/m]; by default the k of the spring that the port spans
    contact_stiffness: float | None = parameter("N m/rad", 30.0, 3e5, default=None)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.within and self.contact_stiffness is None:
            raise ParameterError(f"{self.effect}: within the spring it takes a contact_stiffness")

    @classmethod
    def _parts(cls, starts: Sequence[Effect], spring: float) -> Iterable[Effect]:
        alone = [e for e in starts if isinstance(e, Freeplay) and e.contact_stiffness is None]
        return (replace(e, contact_stiffness=r * spring, within=True) for e in alone[::2] for r in (0.1, 0.4))

    def apply(self, model: Any) -> Any:
        changed = super().apply(model)
        if not self.within or self.contact_stiffness is None:
            return changed
        # What the law adds to a spring as stiff as the contact is what it takes from a stiffer one.
        values = {"gap": self.gap, "stiffness": self.contact_stiffness}
        element = NonlinearElement(self.place, self.effect, values)
        return applied(model, replace(model, nonlinear=(*model.nonlinear, element)), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        found = super().moves(applied)
        if not self.within:
            return found
        return {"gap": found["gap"], "contact_stiffness": (((*self._at(applied), "stiffness"), 1.0),)}

    def carries(self, path: Any, applied: Any) -> Carried:
        return ((path, 1.0),) if self.within else super().carries(path, applied)

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        gaps = [{"gap": float(r) * s.motion} for r in np.geomspace(0.005, 1.5, 9)]
        return gaps + [
            {"gap": g * s.motion, "contact_stiffness": r * s.stiffness} for g in (0.1, 0.6) for r in (0.5, 2.0)
        ]

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        k = scale.stiffness
        return {"gap": (1e-3 * scale.motion, 3.0 * scale.motion), "contact_stiffness": (0.01 * k, 10.0 * k)}

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"gap": 0.1 * motion}

    @property
    def vanishes(self) -> bool:
        # Without a gap a contact of its own stiffness is another spring, not nothing; one within the spring is the spring.
        return self.contact_stiffness is None or self.within
