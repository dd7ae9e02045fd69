"""One nominal parameter is off by more than its tolerance: a worn bearing, a loose slot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, applied, check_place
from cutvib_ss.effects.base import parameter as fitted
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.paths import Path, value_at, with_value
from cutvib_ss.parameters import MATRICES

MACHINE_PARAMETERS: Mapping[str, tuple[str, ...]] = {
    "joint1": ("k1", "c1"),
    "joint2": ("k2", "c2"),
    "head": ("l1",),
    "tool": ("l2",),
    "rail": ("mass", "first_frequency", "damping_ratio"),
}
"""
Place of each parameter of the cutting machine; m1 and m2 go by `added_mass`.

Of any other structure they are its matrices where they are not zero, and their place is ``"structure"``.
"""

DAMPINGS = frozenset({"c1", "c2", "damping", "damping_ratio"})
ALIASES = frozenset({"l1", "l2"}) | DAMPINGS
"""
Parameters as which causes that nobody catalogued appear: a spring beside the tool acts as a shorter lever, another law of friction
as another coefficient of damping.
"""


@dataclass(frozen=True)
class ParameterShift(Effect):
    """One parameter times a factor."""

    effect: ClassVar[str] = "parameter_shift"
    severity = Severity("one", ("factor",), {"factor": 1.05})
    sentence = "{what} is off by more than its tolerance, at {place}"
    inspection = "measure {what} by itself; look for wear, a loose bolt or a changed part at {place}"

    parameter: str  # Name of the parameter, as in machine.toml
    factor: float = fitted("1", 0.05, 20.0, "ratio")  # Actual over nominal value

    @property
    def size_name(self) -> str:
        return self.parameter

    @classmethod
    def choices(cls, model: Model) -> tuple[tuple[str, str], ...]:
        """Every (place, parameter) that can be off on a model."""
        if model.rail is not None:
            return tuple((place, name) for place, names in MACHINE_PARAMETERS.items() for name in names)
        return tuple(("structure", name) for name in MATRICES if getattr(model.system, name).any())

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return tuple(dict.fromkeys(place for place, _ in cls.choices(model)))

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        # Of one degree of freedom a mass or stiffness that is off goes by `added_mass` or `tool_contact`.
        one = model.head is None and len(model.system.dofs) == 1
        for place, name in [c for c in cls.choices(model) if not one or c[1] == "damping"]:
            yield f"{place}.{name}", tuple(cls(place, name, f) for f in (1.0, 0.6, 0.8, 1.25, 1.7))

    @classmethod
    def is_alias(cls, values: Mapping[str, object], beside_linear: bool = False) -> bool:
        return values.get("parameter") in (ALIASES - DAMPINGS if beside_linear else ALIASES)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        return ((name, cls(place, name, 1.3).at) for at, name in cls.choices(model) if at == place)

    def _path(self, model: Model) -> Path:
        if (self.place, self.parameter) not in self.choices(model):
            known = ", ".join(f"{p}: {n}" for p, n in self.choices(model))
            raise ParameterError(
                f"parameter_shift: no parameter {self.parameter!r} at {self.place!r}; there are {known}"
            )
        if model.rail is None:
            return ("scales", MATRICES.index(self.parameter))
        return ("rail", "parameters", self.parameter) if self.place == "rail" else ("head", self.parameter)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        path = self._path(model)
        return applied(model, with_value(model, path, value_at(model, path) * self.factor), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        path = self._path(applied)
        return {"factor": ((path, value_at(applied, path) / self.factor),)}

    def carries(self, path: Path, applied: Any) -> Carried:
        # The shifted value moves by the factor with the one underneath.
        return ((path, self.factor if path == self._path(applied) else 1.0),)
