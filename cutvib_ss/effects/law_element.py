"""What the nonlinear effects share: a restoring force at a port, in the slot that linear analyses ignore."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np

from cutvib_ss.effects.base import (
    Carried,
    Effect,
    Measured,
    Model,
    Motion,
    Range,
    applied,
    check_place,
    parameter_fields,
    ports_of,
)
from cutvib_ss.effects.scales import TYPICAL_FORCE, PortScale, port_scale
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.paths import Path
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.restoring_forces import RestoringForce, law


class StartScale(NamedTuple):
    """Sizes that the starting values of a law are in proportion to, and whether a spring holds the port."""

    motion: float
    rate: float
    force: float
    stiffness: float
    damping: float
    held: bool


@dataclass(frozen=True)
class LawElement(Effect):
    """
    A nonlinear restoring force in a joint, or at any port of another structure.

    The linear model stays as it is: poles, plants and frequency responses ignore the force. Its describing function is the linear
    element that it is at an amplitude. The law in `cutvib_ss.model.restoring_forces` has the effect's name.
    """

    linear: ClassVar[bool] = False
    scale_free: ClassVar[bool] = False
    _without_spring: ClassVar[str] = ""
    """What to do where no spring is, for an error message."""

    def __post_init__(self) -> None:
        for f in parameter_fields(type(self)):
            self.restoring_force().check(f.name, getattr(self, f.name))

    @classmethod
    def restoring_force(cls) -> type[RestoringForce]:
        """The law's class."""
        return law(cls.effect)

    @property
    def strength(self) -> tuple[str, ...]:
        names, own = self.restoring_force().strength, {f.name for f in fields(self)}
        # A law that belongs to a spring grows with that.
        return names if own.issuperset(names) else ()

    def units(self, model: Model) -> Mapping[str, str]:
        given = super().units(model)
        if model.head is not None:
            return given
        # Joints of the machine turn, ports of another structure move in m.
        return {name: unit.replace("N m", "N").replace("rad", "m") for name, unit in given.items()}

    @classmethod
    def _needs_spring(cls) -> bool:
        """Whether the restoring force changes a spring that has to be there."""
        return "stiffness" in cls.restoring_force().units() and "stiffness" not in {f.name for f in fields(cls)}

    @property
    def _changes_spring(self) -> bool:
        """Whether it changes the spring of its place."""
        return self._needs_spring()

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        found = ports_of(model, ("joint1", "joint2"))
        return tuple(p for p in found if model.spring_at(p) is not None) if cls._needs_spring() else found

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        scale = port_scale(model, place, motion)
        free = scale.stiffness == 0.0
        if free:
            # A free body: what a typical force is over that motion, known to two decades.
            scale = replace(scale, stiffness=TYPICAL_FORCE / scale.motion)
        out = {}
        for name, r in super().ranges(model, place, motion).items():
            low, high = cls._bounds(scale)[name]
            if free and r.unit != "1":
                low, high = (low / 100.0, high * 100.0) if r.scale == "log" else (low * 10.0, high * 10.0)
            out[name] = replace(r, low=low, high=high)
        return out

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for place in cls.places(model):
            if (motion := cls._motion(model, measured, place)) is not None:
                _, k, c = model.carried_at(place)
                yield place, cls.starts_at(place, motion, k, c)

    @classmethod
    def _motion(cls, model: Model, measured: Measured, place: str) -> Motion | None:
        """How a place moves, with the force of its inertia where none is known; None where it does not."""
        motion = measured.motions.get(place)
        if motion is None or not motion.middle > 0.0:
            return None
        inertia = model.carried_at(place)[0] * motion.rate**2 / motion.middle
        return motion if motion.force != 0.0 else replace(motion, force=inertia)

    @classmethod
    def starts_at(cls, place: str, motion: Motion, k: float, c: float) -> tuple[LawElement, ...]:
        """Starts from hardly visible to strong; where k is zero, the force that would hold the place stands for k times motion."""
        force = k * motion.middle or motion.force
        # On a spring a damper is seen at its resonance; on a free body it has to bear a part of the force.
        least = (1e-3 if k > 0.0 else 0.05) * force / motion.rate
        stiffness = k or force / motion.middle
        scale = StartScale(motion.middle, motion.rate, force, stiffness, max(c, least), k > 0.0)
        return tuple(cls(place, **values) for values in cls._starts(scale))

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        # Against a motion of 0.4 mrad in joint 2, 10 µrad in joint 1, and 0.1 mm.
        motion, k = (4e-4, 1e4) if place == "joint2" else (1e-5, 5e5) if place == "joint1" else (1e-4, 2.5e5)
        for values in cls._examples(motion, k):
            yield ", ".join(list(values)[1:]), cls(place, **values).at

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        """Parameters of a strong law of each form, against a motion and a spring."""
        raise NotImplementedError

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        """Parameters of each start."""
        raise NotImplementedError

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        """Sensible range of each parameter at a port."""
        raise NotImplementedError

    def _parameters(self) -> dict[str, float]:
        """Parameters that are given and finite: those that a fit may move."""
        given = {f.name: getattr(self, f.name) for f in fields(self) if "range" in f.metadata}
        return {name: float(v) for name, v in given.items() if v is not None and np.isfinite(v)}

    def apply(self, model: Any) -> Any:
        if self._changes_spring and self.place in ports_of(model, ()) and model.spring_at(self.place) is None:
            held = [place for place in self.places(model) if model.spring_at(place) is not None]
            raise ParameterError(
                f"{self.effect} changes the spring that a port spans, and there is none at {self.place!r}; "
                f"places with a spring: {', '.join(held) or 'none on this model'}{self._without_spring}"
            )
        check_place(self, model)
        element = NonlinearElement(self.place, self.effect, self._values(model))
        return applied(model, replace(model, nonlinear=(*model.nonlinear, element)), self)

    def _values(self, model: Any) -> dict[str, float]:
        """Values of the restoring force on a model."""
        values = self._parameters()
        if self._changes_spring and (spring := model.spring_at(self.place)) is not None:
            values["stiffness"] = spring[0]
        return values

    def _at(self, model: Any) -> Path:
        return ("nonlinear", len(model.nonlinear) - 1, "parameters")

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {name: (((*self._at(applied), name), 1.0),) for name in self._parameters()}

    def carries(self, path: Path, applied: Any) -> Carried:
        spring = applied.spring_at(self.place) if self._changes_spring else None
        for moved, weight in spring[1] if spring else ():
            if moved == path:
                return ((path, 1.0), ((*self._at(applied), "stiffness"), weight))
        return ((path, 1.0),)
