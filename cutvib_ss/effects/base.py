"""What every effect has: id, place, parameters with prior, `apply`; starts, severity and words that it may state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, fields, replace
from itertools import product
from math import inf
from typing import Any, ClassVar, TypeAlias, TypeVar

from cutvib_ss.effects.prior import Measured as Measured
from cutvib_ss.effects.prior import Motion as Motion
from cutvib_ss.effects.prior import Range as Range
from cutvib_ss.effects.prior import Severity as Severity
from cutvib_ss.effects.prior import parameter as parameter
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import Attachment, Element
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import Path, moved_values
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import check_number

Model: TypeAlias = Machine | Structure
ModelT = TypeVar("ModelT", Machine, Structure)
# Paths of an applied model that move with a value, each with its weight.
Carried: TypeAlias = tuple[tuple[Path, float], ...]

WEAK = 1e-12
"""Severity that stands for none where none itself is a limit, an infinite stiffness or inertia."""


@dataclass(frozen=True)
class Effect(ABC):
    """
    An unmodelled effect at a place.

    A subclass is a frozen dataclass with an id (`effect`), fields made by `parameter`, `places` and `apply`. All else has
    defaults, which a subclass overrides where it knows better.
    """

    effect: ClassVar[str]
    """Id: its name in machine.toml and in every JSON."""
    linear: ClassVar[bool] = True
    """Whether the frequency response alone carries it."""
    measurement: ClassVar[bool] = False
    """Whether it belongs to the measurement chain, which no law of mechanics holds for."""
    scale_free: ClassVar[bool] = True
    """Whether it does the same at every level of force; of laws those that tell only the sign of the motion."""
    touches: ClassVar[bool] = False
    """Whether something touches at instants between samples, which simulation rounds."""
    severity: ClassVar[Severity | None] = None
    """How it grows from nothing; by default in proportion to its first parameter."""
    sentence: ClassVar[str] = ""
    """What it means, for the report; ``{place}`` and ``{what}`` (its parameters that are names) are filled in."""
    inspection: ClassVar[str] = ""
    """What to look at on the machine, for the report; filled in likewise."""
    less: ClassVar[str] = ""
    """The sentence where the parameter that states the severity is negative; the same by default."""
    less_inspection: ClassVar[str] = ""
    """What to look at then; the same by default."""
    example: ClassVar[Mapping[str, float]] = {}
    """Values of a strong effect on the published machine, for the conformance suite; by default of its first start."""

    retired: ClassVar[Mapping[str, tuple[float | None, str]]] = {}
    """Keys that older files may carry: the one value that means what the effect is now (None: any), and what that is."""

    place: str  # Where it sits, one of `places`

    def __post_init__(self) -> None:
        for f in parameter_fields(type(self)):
            # An infinite default stands for a part that does not give.
            if getattr(self, f.name) != f.default or f.default != inf:
                check_number(f"{self.effect}: {f.name}", getattr(self, f.name), f.metadata["range"].minimum)

    @classmethod
    @abstractmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        """Places at which the effect can sit on a model."""

    @abstractmethod
    def apply(self, model: Any) -> Any:
        """The model with the effect."""

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        """Ranges of the fitted parameters on a model: those of the fields, or in proportion to what the place carries."""
        return {f.name: f.metadata["range"] for f in parameter_fields(cls)}

    def ranges_here(self, model: Model, motion: float | None = None) -> Mapping[str, Range]:
        """Ranges at its own place, in the form that it has."""
        return self.ranges(model, self.place, motion)

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterable[tuple[str, tuple[Effect, ...]]]:
        """Values from which the effect is fitted."""
        for place in cls.places(model):
            motion = measured.motions.get(place)
            if cls.linear or (motion is not None and motion.high > 0.0):
                ranges = cls.ranges(model, place, None if motion is None else motion.high)
                parts = [(0.5, 0.15, 0.85) if i < 3 else (0.5,) for i in range(len(ranges))]
                values = ({n: r.at(u) for (n, r), u in zip(ranges.items(), us, strict=True)} for us in product(*parts))
                yield place, tuple(cls(place, **v) for v in values)

    def moves(self, applied: Any) -> Mapping[str, Carried] | None:
        """Values of the applied model that move with each fitted parameter."""
        return None

    def moved_by(self, under: Any, applied: Any) -> Mapping[str, Carried]:
        """`moves`, or where the effect does not say, found by applying it again with each parameter moved a little."""
        stated = self.moves(applied)
        if stated is not None:
            return stated
        found = {}
        for f in parameter_fields(type(self)):
            value, r = float(getattr(self, f.name)), f.metadata["range"]
            # Close to the value, and not below a minimum of zero.
            ends = (value * (1 - 1e-6), value * (1 + 1e-6)) if value else (0.0, 1e-6 * (r.high - r.low))
            found[f.name] = moved_values(*((v, self.changed({f.name: v}).apply(under)) for v in ends))
        return found

    def carries(self, path: Path, applied: Any) -> Carried:
        """Values of the applied model that move with a value of the model underneath."""
        return ((path, 1.0),)

    @classmethod
    def grows(cls) -> Severity:
        """How it grows from nothing: `severity`, or by default in proportion to its first parameter."""
        if cls.severity is not None:
            return cls.severity
        names = [f.name for f in parameter_fields(cls)]
        return Severity("zero", (names[0],)) if names else Severity("whole", ("place",))

    @property
    def grown_by(self) -> Severity:
        """How it grows in its own form: as its class says by default."""
        return self.grows()

    @property
    def size_name(self) -> str:
        """Name of what its size is of, for tables: its leading parameter by default."""
        return self.grown_by.carried_by[0]

    def changed(self, values: Mapping[str, Any]) -> Effect:
        """The effect with some of its values replaced."""
        return replace(self, **values)

    def at(self, severity: float) -> Effect:
        """The effect at a severity: 0 is none, 1 the effect itself."""
        grows = self.grown_by
        if grows.end == "whole":
            return self
        values = {name: float(getattr(self, name)) for name in grows.carried_by}
        if grows.end == "one":
            return self.changed({name: 1.0 + (value - 1.0) * severity for name, value in values.items()})
        if grows.end == "infinity":
            return self.changed({name: value / max(severity, WEAK) for name, value in values.items()})
        return self.changed({name: value * severity for name, value in values.items()})

    @property
    def strength(self) -> tuple[str, ...]:
        """Parameters to which, taken together, a restoring force is in proportion; none of a linear effect, and where it is not."""
        return ()

    def tolerated(self, model: Any) -> bool:
        """Whether the part or channel it sits on may differ from the model as much by itself, within the tolerance."""
        return False

    @classmethod
    def forms(cls, model: Model, place: str) -> int:
        """In how many forms a restoring force may sit at a place."""
        return 1

    def by_size(self) -> dict[str, float]:
        """Derivative of each fitted parameter that carries the severity to the logarithm of the effect's size."""
        grows, own = self.grown_by, {f.name for f in parameter_fields(type(self))}
        sign = -1.0 if grows.end == "infinity" else 1.0
        middle = 1.0 if grows.end == "one" else 0.0
        return {name: sign * (float(getattr(self, name)) - middle) for name in grows.carried_by if name in own}

    @property
    def vanishes(self) -> bool:
        """Whether it is nothing at the weak end of its severity."""
        return True

    def alias(self, model: Model, stds: Mapping[str, float]) -> Effect:
        """The effect by the name it goes by on a model, where its parameters were fitted with such standard deviations."""
        return self

    def kindred(self, stds: Mapping[str, float]) -> Effect | None:
        """What is nearly the same in another cause's form; none where deviations of its parameters leave no form of its own."""
        return None

    def further(self, motion: float) -> Effect | None:
        """A more general form of the cause, for a place of that largest motion; None where there is none."""
        return None

    def odds_to_kindred(self, motion: float) -> float:
        """Odds of this cause to its kindred one where no form tells them apart, of a place that moves by so much."""
        return 1.0

    def units(self, model: Model) -> Mapping[str, str]:
        """SI unit of each parameter on a model."""
        return {f.name: f.metadata["range"].unit for f in parameter_fields(type(self))}

    @classmethod
    def is_alias(cls, values: Mapping[str, object], beside_linear: bool = False) -> bool:
        """Whether causes that nobody catalogued appear as the effect with these discrete values, or a linear cause's form does."""
        return False

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        """What is discrete about the effect at a place, and the effect as its severity runs, for the conformance suite."""
        if cls.example:
            yield "", cls(place, **cls.example).at
            return
        for what, starts in cls.starts(model, Measured(motions={place: Motion(1e-4, 1e-4, 0.1)})):
            if starts[0].place == place:
                yield ("" if what == place else what), starts[0].at


def parameter_fields(effect: type[Effect]) -> tuple[Field[Any], ...]:
    """Fields of an effect's class that are fitted: those with a `Range` in their metadata."""
    return tuple(f for f in fields(effect) if "range" in f.metadata)


def discrete_values(effect: Effect) -> dict[str, Any]:
    """What is discrete about an effect beside its place: the value that is shifted, the channel that is late."""
    return {f.name: getattr(effect, f.name) for f in fields(effect) if f.name != "place" and "range" not in f.metadata}


def identifying_names(kind: type[Effect]) -> tuple[str, ...]:
    """Discrete fields that tell one cause from another at a place: those that have no default, as a form has."""
    return tuple(
        f.name for f in fields(kind) if f.name != "place" and "range" not in f.metadata and f.default is MISSING
    )


def identifying_values(effect: Effect) -> tuple[str, ...]:
    """The names in those fields."""
    values = (getattr(effect, name) for name in identifying_names(type(effect)))
    return tuple(v for v in values if isinstance(v, str))


def check_place(effect: Effect, model: Model) -> None:
    """Refuse a place at which the effect cannot sit: ParameterError, which lists the places that it has."""
    places = effect.places(model)
    if effect.place not in places and model.place_of(effect.place) not in places:
        known = ", ".join(places) or "none on this model"
        raise ParameterError(f"{effect.effect} cannot sit at {effect.place!r}; its places are: {known}")


def applied(model: ModelT, changed: ModelT, effect: Effect) -> ModelT:
    """A changed model that remembers the effect (``effects``), and what it was before any (``bare``)."""
    bare = model if model.bare is None else model.bare
    return replace(changed, effects=(*model.effects, effect), bare=bare)


def machine_only(effect: str, model: Model) -> Machine:
    """A cutting machine; ParameterError for another structure, which has no rail and no joints."""
    if model.rail is None:
        raise ParameterError(f"{effect} needs a cutting machine; this model has no rail and no joints")
    return model


def ports_of(model: Model, machine_places: tuple[str, ...]) -> tuple[str, ...]:
    """Places of an effect that is an element at a port: those of the cutting machine, or all of another structure."""
    return machine_places if model.head is not None else model.places


def port_of(place: str, model: Model) -> str:
    """The port at a place."""
    return model.port_at(place)


def attached_to(model: ModelT, port: str, element: Element, toward: str = "", angle: float = 0.0) -> ModelT:
    """A model with one more element in parallel at a port, or turned toward another one by an angle [rad]."""
    return replace(model, attachments=(*model.attachments, Attachment(port, element, toward, angle)))


def channels_of(effect: str, channel: str, model: Model) -> tuple[str, ...]:
    """Channels that a name stands for, all of them for ``"all"``; ParameterError if there is no such channel."""
    if channel == "all":
        return tuple(model.channels)
    if channel not in model.channels:
        raise ParameterError(f"{effect}: no channel {channel!r}; there are all, {', '.join(model.channels)}")
    return (channel,)


def channel_choices(channels: tuple[str, ...]) -> tuple[str, ...]:
    """Channels, alone and together, at which a chain may be wrong: what is wrong with all alike is wrong with the force."""
    return ("all", *channels) if len(channels) > 1 else channels
