"""Clearance in a joint: no torque within a gap."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Range, Severity, parameter, ports_of
from cutvib_ss.effects.law_element import StartScale
from cutvib_ss.effects.scales import PortScale
from cutvib_ss.effects.within_spring import WithinSpring
from cutvib_ss.errors import ParameterError


@dataclass(frozen=True)
class Freeplay(WithinSpring):
    """
    No torque within ±gap, contact_stiffness (θ ∓ gap) beyond; the joint's damper acts in the gap, too.

    The linear model is the joint without clearance, which this nears as the motion grows where the contact is as stiff. ``within``
    the joint's spring only a part of it, contact_stiffness, acts beyond the gap: one of several bolts is loose. Rest may be at an
    ``offset`` from the middle of the gap, and contacts may close gradually, over a length that is ``rounding`` times the gap.
    Round contacts may lose energy: their force goes with 1 + ``contact_damping`` · the rate of closing (Hunt and Crossley 1975).
    ``beside`` a spring that stays as it is, contacts are stops on both sides of it, with play.
    """

    effect: ClassVar[str] = "freeplay"
    touches = True
    severity = Severity("zero", ("gap",))
    sentence = "{place} has play"
    _without_spring = "; stops with play need none: beside = true, and a contact_stiffness"
    inspection = "move {place} by hand to feel for clearance; check its bearing and its bolts"

    gap: float = parameter("rad", 1e-7, 1e-3)  # Half of the clearance [rad; m at a port that is a displacement]
    # Stiffness beyond the gap [N m/rad; N/m]; by default the k of the spring that the port spans
    contact_stiffness: float | None = parameter("N m/rad", 30.0, 3e5, default=None)
    # How far rest is from the middle of the gap [rad; m]; by default not at all
    offset: float | None = parameter("rad", -1e-3, 1e-3, "asinh", default=None, minimum=None)
    # Radius of the corners of its characteristic over the gap; by default sharp
    rounding: float | None = parameter("1", 0.01, 3.0, default=None, limits=True)

    # Force in contact goes with 1 + contact_damping · rate [s/rad; s/m]; by default it loses nothing
    contact_damping: float | None = parameter("s/rad", 0.0, 100.0, "linear", default=None)

    beside: bool = field(default=False, kw_only=True)  # Whether it acts beside the model's spring, not in place of it

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.within and self.beside:
            raise ParameterError(f"{self.effect}: it is within the spring or beside it, not both")
        if (self.within or self.beside) and self.contact_stiffness is None:
            side = "within" if self.within else "beside"
            raise ParameterError(f"{self.effect}: {side} the spring it takes a contact_stiffness")

    def further(self, motion: float) -> Freeplay | None:
        """With round corners that lose energy, and a static offset; stops get none: one-sided ones are not in the catalogue."""
        if self.rounding is not None:
            return None
        return replace(self, offset=None if self.beside else 0.0, rounding=0.2, contact_damping=0.0)

    @property
    def _contact(self) -> float:
        assert self.contact_stiffness is not None
        return self.contact_stiffness

    @property
    def grown_by(self) -> Severity:
        # The smaller the gap of stops, the more they do: none are there where they hold nothing.
        return Severity("zero", ("contact_stiffness",)) if self.beside else self.severity

    @property
    def _changes_spring(self) -> bool:
        return not self.beside

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        # Stops need no spring.
        return ports_of(model, ("joint1", "joint2"))

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for name, starts in super().starts(model, measured):
            alone = [e for e in starts if isinstance(e, Freeplay) and not e.within and e.contact_stiffness is None]
            motion = cls._motion(model, measured, alone[0].place) if alone else None
            if motion is None:
                yield name, starts
                continue
            # Stops are further starts, not a form: each form is fitted by itself, which took twice the time.
            spring = model.spring_at(alone[0].place)
            k = spring[0] if spring else model.carried_at(alone[0].place)[1] or motion.force / motion.middle
            stiff = (0.3, 3.0) if spring else (0.3, 3.0, 30.0)
            stops = [replace(e, contact_stiffness=r * k, beside=True) for e in alone[2::2] for r in stiff]
            yield name, (*starts, *stops) if spring else tuple(stops)

    @classmethod
    def _parts(cls, starts: Sequence[Effect], spring: float) -> Iterable[Effect]:
        alone = [e for e in starts if isinstance(e, Freeplay) and e.contact_stiffness is None]
        return (replace(e, contact_stiffness=r * spring, within=True) for e in alone[::2] for r in (0.1, 0.4))

    def ranges_here(self, model: Model, motion: float | None = None) -> Mapping[str, Range]:
        given = dict(super().ranges_here(model, motion))
        contact = given["contact_stiffness"]
        if self.within and (spring := model.spring_at(self.place)) is not None:
            given["contact_stiffness"] = replace(contact, high=spring[0])
        if self.beside:
            # What stops a structure may be far stiffer than it is there.
            given["contact_stiffness"] = replace(contact, high=100.0 * contact.high)
        return given

    def _values(self, model: Any) -> dict[str, float]:
        values = super()._values(model)
        if self.beside:
            # There is no spring that it takes away.
            return {**values, "stiffness": 0.0}
        if not self.within:
            return values
        if self._contact > values["stiffness"]:
            raise ParameterError(
                f"{self.effect} at {self.place!r}: contact_stiffness = {self._contact:g} is more than the spring of "
                f"{values['stiffness']:g} that it is a part of: nothing would hold the place within the gap; give at most that"
            )
        # What the law adds to a spring as stiff as the contact is what it takes from a stiffer one.
        return {**{name: v for name, v in values.items() if name != "contact_stiffness"}, "stiffness": self._contact}

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        found = super().moves(applied)
        if not self.within:
            return found
        return {**found, "contact_stiffness": (((*self._at(applied), "stiffness"), 1.0),)}

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
        return {
            "gap": (1e-3 * scale.motion, 3.0 * scale.motion),
            "contact_stiffness": (0.01 * k, 10.0 * k),
            "offset": (-scale.motion, scale.motion),
            "rounding": (0.01, 3.0),
            "contact_damping": (0.0, 10.0 / (scale.motion * math.sqrt(k / scale.mass))),
        }

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        if model.spring_at(place) is not None:
            yield from super().examples(model, place)
        else:
            # Without a spring there is none to take away.
            yield "stops", cls(place, 1e-5, model.carried_at(place)[1] or 2.5e5, beside=True).at

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"gap": 0.1 * motion}

    @property
    def vanishes(self) -> bool:
        # Without a gap a contact of its own stiffness is another spring, not nothing; one within the spring is the spring.
        return self.contact_stiffness is None or self.within or self.beside
