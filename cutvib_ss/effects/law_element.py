"""What the nonlinear effects share: a restoring force at a port, in the slot that linear analyses ignore."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np

from cutvib_ss.effects.base import Carried, Effect, Model, Range, applied, check_place, parameter_fields, ports_of
from cutvib_ss.effects.scales import TYPICAL_FORCE, PortScale, port_scale, spring_at
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.restoring_forces import RestoringForce, law
from cutvib_ss.paths import Path
from cutvib_ss.slots import NonlinearElement


class PortMotion(Protocol):
    """How a port moves in the records: peak of the quietest and the loudest, peak rate, peak force that would hold it still."""

    @property
    def low(self) -> float: ...
    @property
    def high(self) -> float: ...
    @property
    def rate(self) -> float: ...
    @property
    def force(self) -> float: ...


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

    Parameters
    ----------
    place : str
        ``"joint1"`` or ``"joint2"``; any port of another structure.

    Notes
    -----
    The linear model stays as it is: poles, plants and frequency responses ignore the force. Its describing function is the linear
    element that it is at an amplitude. The law in `cutvib_ss.model.restoring_forces` has the effect's name.
    """

    linear: ClassVar[bool] = False
    scale_free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        for f in parameter_fields(type(self)):
            self.restoring_force().check(f.name, getattr(self, f.name))

    @classmethod
    def restoring_force(cls) -> type[RestoringForce]:
        """The law's class."""
        return law(cls.effect)

    @classmethod
    def _needs_spring(cls) -> bool:
        """Whether the law changes a spring that has to be there."""
        return "stiffness" in cls.restoring_force().units() and "stiffness" not in {f.name for f in fields(cls)}

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        found = ports_of(model, ("joint1", "joint2"))
        return tuple(p for p in found if spring_at(model, p) is not None) if cls._needs_spring() else found

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
    def starts(cls, place: str, motion: PortMotion, k: float, c: float) -> tuple[Self, ...]:
        """
        Starting values from hardly visible to strong, in proportion to the motion and the force at the place.

        Parameters
        ----------
        place : str
            One of `places`.
        motion : PortMotion
            How it moves in the records.
        k, c : float
            Linear stiffness and damping at the place. Where k is zero, the force that would hold the place still stands for k
            times the motion.

        Returns
        -------
        tuple of LawElement
            The effect at each start.
        """
        middle = float(np.sqrt(motion.low * motion.high))
        force = k * middle or motion.force
        if not (middle > 0.0 and force > 0.0):
            return ()
        # On a spring a damper is seen at its resonance; on a free body it has to bear a part of the force.
        least = (1e-3 if k > 0.0 else 0.05) * force / motion.rate
        scale = StartScale(middle, motion.rate, force, k or force / middle, max(c, least), k > 0.0)
        return tuple(cls(place, **values) for values in cls._starts(scale))

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
        if self._needs_spring() and self.place in ports_of(model, ()) and spring_at(model, self.place) is None:
            raise ParameterError(
                f"{self.effect} changes the spring that a port spans, and there is none at {self.place!r}; "
                f"places with a spring: {', '.join(self.places(model)) or 'none on this model'}"
            )
        check_place(self, model)
        values = self._parameters()
        if self._needs_spring() and (spring := spring_at(model, self.place)) is not None:
            values["stiffness"] = spring[0]
        element = NonlinearElement(self.place, self.effect, values)
        return applied(model, replace(model, nonlinear=(*model.nonlinear, element)), self)

    def _at(self, model: Any) -> Path:
        return ("nonlinear", len(model.nonlinear) - 1, "parameters")

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {name: (((*self._at(applied), name), 1.0),) for name in self._parameters()}

    def carries(self, path: Path, applied: Any) -> Carried:
        spring = spring_at(applied, self.place) if self._needs_spring() else None
        for moved, weight in spring[1] if spring else ():
            if moved == path:
                return ((path, 1.0), ((*self._at(applied), "stiffness"), weight))
        return ((path, 1.0),)
