"""What the nonlinear effects share: a law at a port, in the slot that linear analyses ignore."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, Range, applied, check_place, parameter_fields, ports_of
from cutvib_ss.effects.scales import PortScale, port_scale, spring_at
from cutvib_ss.errors import ParameterError
from cutvib_ss.laws import LAWS
from cutvib_ss.model.paths import Path
from cutvib_ss.model.protocol import NonlinearElement


@dataclass(frozen=True)
class LawElement(Effect):
    """
    A nonlinear law in a joint, or at any port of another structure.

    Parameters
    ----------
    place : str
        ``"joint1"`` or ``"joint2"``; any port of another structure.

    Notes
    -----
    The linear model stays as it is: poles, plants and frequency responses ignore the law. `cutvib_ss.laws` gives its describing
    function, the linear element that it is at an amplitude.
    """

    linear: ClassVar[bool] = False
    scale_free: ClassVar[bool] = False

    @classmethod
    def _needs_spring(cls) -> bool:
        return "stiffness" in LAWS[cls.effect].units and "stiffness" not in {f.name for f in parameter_fields(cls)}

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        found = ports_of(model, ("joint1", "joint2"))
        return tuple(p for p in found if spring_at(model, p) is not None) if cls._needs_spring() else found

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        bounds = cls._bounds(port_scale(model, place, motion))
        given = super().ranges(model, place, motion)
        return {name: replace(r, low=bounds[name][0], high=bounds[name][1]) for name, r in given.items()}

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        """Sensible range of each parameter at a port."""
        raise NotImplementedError

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        values = {f.name: float(getattr(self, f.name)) for f in parameter_fields(type(self))}
        if self._needs_spring():
            spring = spring_at(model, self.place)
            if spring is None:
                raise ParameterError(f"{self.effect} needs a spring at {self.place!r}")
            values["stiffness"] = spring[0]
        element = NonlinearElement(self.place, self.effect, values)
        return applied(model, replace(model, nonlinear=(*model.nonlinear, element)), self)

    def _at(self, model: Any) -> Path:
        return ("nonlinear", len(model.nonlinear) - 1, "parameters")

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {f.name: (((*self._at(applied), f.name), 1.0),) for f in parameter_fields(type(self))}

    def carries(self, path: Path, applied: Any) -> Carried:
        spring = spring_at(applied, self.place) if self._needs_spring() else None
        for moved, weight in spring[1] if spring else ():
            if moved == path:
                return ((path, 1.0), ((*self._at(applied), "stiffness"), weight))
        return ((path, 1.0),)
