"""The catalogue: every effect by its id, our own, those of installed packages, and those registered by call."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from importlib import metadata
from inspect import getdoc, isabstract, isclass
from typing import Any, TypeVar

import numpy as np

from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect, parameter_fields
from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.effects.guide_compliance import GuideCompliance
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.modal_truncation import ModalTruncation
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.rail_shear import RailShear
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.effects.window_damping import WindowDamping
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure

EffectT = TypeVar("EffectT", bound=type[Effect])

GROUP = "cutvib_ss.effects"
"""Entry point group under which other packages offer effects."""

OWN: tuple[type[Effect], ...] = (
    LocalResonator,
    AddedMass,
    ToolContact,
    ParameterShift,
    ChannelDelay,
    CalibrationError,
    CrossAxis,
    WindowDamping,
    SupportCompliance,
    EndFixity,
    GuideCompliance,
    RailAddedMass,
    RailShear,
    RailTorsion,
    StructuralDamping,
    ModalTruncation,
    CubicStiffness,
    Freeplay,
    DryFriction,
    JointSlip,
    BilinearStiffness,
    QuadraticDamping,
)
"""The effects of this package, in the order in which a search takes them."""


class Catalogue(Mapping[str, type[Effect]]):
    """
    Effects by id; those of other packages are loaded when the catalogue is first asked.

    Order: this package's own, then entry points by name, then those registered by call.
    """

    def __init__(self, own: tuple[type[Effect], ...]) -> None:
        self._found: dict[str, type[Effect]] = {kind.effect: kind for kind in own}
        self._by_call: dict[str, type[Effect]] = {}
        self._own, self._loaded = frozenset(self._found), False

    def __getitem__(self, name: str) -> type[Effect]:
        return self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    @property
    def registered(self) -> tuple[type[Effect], ...]:
        """Effects that were registered by call, which another process has to be told of."""
        return tuple(self._by_call.values())

    def is_own(self, name: str) -> bool:
        """Whether an effect is this package's own."""
        return name in self._own

    def register(self, kind: type[Effect]) -> None:
        """Add an effect, or replace one of the same module and name, which a notebook may have run again."""
        check_effect(kind)
        other = self._all().get(kind.effect)
        if other is not None and (other.__module__, other.__qualname__) != (kind.__module__, kind.__qualname__):
            raise ParameterError(
                f"the effect id {kind.effect!r} is taken by {other.__module__}.{other.__qualname__}; choose another"
            )
        self._by_call[kind.effect] = kind

    def remove(self, name: str) -> None:
        """Take out an effect that was registered by call."""
        if name not in self._by_call:
            raise ParameterError(f"{name!r} was not registered by call; there are {', '.join(self._by_call) or 'none'}")
        del self._by_call[name]

    def reload(self) -> None:
        """Forget the effects of other packages, so that they are looked for again."""
        self._found, self._loaded = {n: k for n, k in self._found.items() if n in self._own}, False

    def _all(self) -> dict[str, type[Effect]]:
        if not self._loaded:
            self._loaded = True
            for point in sorted(metadata.entry_points(group=GROUP), key=lambda p: p.name):
                self._add(point)
        return {**self._found, **self._by_call}

    def _add(self, point: metadata.EntryPoint) -> None:
        where = f"entry point {point.name} = {point.value} of the group {GROUP}"
        try:
            kind = point.load()
            check_effect(kind)
        except ParameterError as error:
            raise ParameterError(f"{where}: {error}") from error
        except (ImportError, AttributeError) as error:
            raise ParameterError(f"{where} cannot be loaded ({error}); correct or uninstall the package") from error
        if kind.effect in self._found:
            raise ParameterError(f"{where}: the effect id {kind.effect!r} is taken; rename the effect")
        self._found[kind.effect] = kind


EFFECTS = Catalogue(OWN)
"""Effect ids and their classes."""


def register_effect(kind: EffectT) -> EffectT:
    """
    Make an effect known: to machine.toml, the diagnosis, planning and reports.

    Parameters
    ----------
    kind : type of Effect
        A frozen dataclass that inherits from `cutvib_ss.effects.base.Effect`.

    Returns
    -------
    type of Effect
        The same, so that the function can be used as a decorator.

    Raises
    ------
    ParameterError
        If it is no such class, its id is taken or impossible, it lacks `places` or `apply`, or a parameter has no range.

    Notes
    -----
    For the present process and the worker processes that it starts. A package offers its effects for good by entry points of the
    group ``cutvib_ss.effects``.
    """
    EFFECTS.register(kind)
    return kind


def check_effect(kind: Any) -> None:
    """Whether a class is an effect that the package can use: ParameterError with what it lacks."""
    if not isclass(kind) or not issubclass(kind, Effect):
        raise ParameterError(f"{kind!r} is not a class that inherits from cutvib_ss.effects.base.Effect")
    who = kind.__qualname__
    name = getattr(kind, "effect", None)
    if not isinstance(name, str) or not re.fullmatch(r"[a-z][a-z0-9_]*", name) or name in ("none", "unknown"):
        raise ParameterError(f"{who}.effect = {name!r} must be an id in lower case, such as 'belt_tension'")
    if isabstract(kind):
        raise ParameterError(f"{who} lacks {', '.join(sorted(kind.__abstractmethods__))}; write them")
    if not is_dataclass(kind) or "__dataclass_params__" not in vars(kind):
        raise ParameterError(f"{who} must be a dataclass; put @dataclass(frozen=True) above it")
    if not kind.__dataclass_params__.frozen:  # type: ignore[attr-defined]
        raise ParameterError(f"{who} must be frozen; write @dataclass(frozen=True)")
    for f in parameter_fields(kind):
        r = f.metadata["range"]
        if not (math.isfinite(r.low) and math.isfinite(r.high) and r.low < r.high):
            raise ParameterError(f"{who}.{f.name}: its range {r.low:g} to {r.high:g} must be finite and not empty")
        if r.scale not in ("log", "ratio", "linear", "asinh") or (r.scale in ("log", "ratio") and r.low <= 0.0):
            raise ParameterError(
                f"{who}.{f.name}: a range on a {r.scale!r} scale must be above zero; or use 'linear' or 'asinh'"
            )
    for f in fields(kind):
        if "range" not in f.metadata and f.type in (float, "float") and f.default is MISSING:
            raise ParameterError(f"{who}.{f.name} has no range; write {f.name}: float = parameter(unit, low, high)")
    for words in (kind.sentence, kind.inspection, kind.less, kind.less_inspection):
        try:
            words.format(place="", what="")
        except (KeyError, IndexError, ValueError) as error:
            raise ParameterError(f"{who}: {words!r} may hold {{place}} and {{what}} alone ({error})") from error
    missing = [n for n in kind.grows().carried_by if n not in {f.name for f in fields(kind)}]
    if missing:
        raise ParameterError(f"{who}.severity names {', '.join(missing)}, which it does not have")


def is_alias(effect: str, values: Mapping[str, object], beside_linear: bool = False) -> bool:
    """Whether causes that nobody catalogued appear as an effect with these discrete values, or a linear cause's form does."""
    kind = EFFECTS.get(effect)
    return kind is not None and kind.is_alias(values, beside_linear)


def catalogue_table() -> str:
    """The catalogue as a Markdown table: id, places on the cutting machine and on other structures, parameters, what it is."""
    machine, other = published_machine(), _two_masses()
    rows = ["| effect | places | on another structure | parameters | what it is |", "|---|---|---|---|---|"]
    for name, kind in EFFECTS.items():
        there = kind.places(other)
        elsewhere = {("end", "spring"): "each port", ("spring",): "each port that spans a spring"}.get(there)
        parameters = ", ".join(
            _parameter_text(f) for f in sorted(fields(kind), key=lambda f: f.kw_only is True) if f.name != "place"
        )
        what = (getdoc(kind) or "").partition("\n")[0].replace("|", "\\|")
        places = ", ".join(f"`{p}`" for p in kind.places(machine))
        rows.append(
            f"| `{name}` | {places} | {elsewhere or ', '.join(f'`{p}`' for p in there)} | {parameters} | {what} |"
        )
    return "\n".join(rows) + "\n"


def _two_masses() -> Structure:
    """Two masses on a spring, with a port that spans it and one that does not."""
    link = np.array([[1.0, -1.0], [-1.0, 1.0]])
    ports = {"end": np.array([1.0, 0.0]), "spring": np.array([1.0, -1.0])}
    system = SecondOrder(np.eye(2), link, link, ("x1", "x2"), ports)
    return Structure(system, {"y": Channel("end", "displacement")}, "end")


def _parameter_text(f: Field[Any]) -> str:
    unit = f.metadata["range"].unit if "range" in f.metadata else f.metadata.get("unit", "")
    return f"`{f.name}`" + ("" if unit in ("", "1") else f" {unit}")
