"""What every effect of the catalogue has: an id, a place, parameters with unit and range, and `apply`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, TypeAlias, TypeVar

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import Attachment, SpringDamperMass, SprungMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import Path
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import check_number

Model: TypeAlias = Machine | Structure
ModelT = TypeVar("ModelT", Machine, Structure)
# Paths of an applied model that move with a value, each with its weight.
Carried: TypeAlias = tuple[tuple[Path, float], ...]


@dataclass(frozen=True)
class Range:
    """
    Unit and sensible range of an effect's parameter.

    Parameters
    ----------
    unit : str
        SI unit.
    low, high : float
        Range that an engineer would believe; the prior of the diagnosis, not a limit of `apply`.
    scale : {"log", "linear"}
        Whether the prior is even in the logarithm or in the value.
    minimum : float, optional
        Smallest value that makes sense at all.
    limits : bool
        Whether the ends stand for limits, as free and clamped do, beyond which nothing changes.
    """

    unit: str
    low: float
    high: float
    scale: Literal["log", "linear"] = "log"
    minimum: float | None = 0.0
    limits: bool = False


def parameter(unit: str, low: float, high: float, scale: Literal["log", "linear"] = "log", **more: Any) -> Any:
    """
    A dataclass field that is a fitted parameter of an effect.

    Parameters
    ----------
    unit : str
        SI unit.
    low, high : float
        Range that an engineer would believe.
    scale : {"log", "linear"}
        Whether the prior is even in the logarithm or in the value.
    **more : object
        ``minimum`` of `Range`, or ``default`` of the field.

    Returns
    -------
    dataclasses.Field
        The field.
    """
    default = more.pop("default", MISSING)
    meta = {"range": Range(unit, low, high, scale, **more)}
    return field(metadata=meta) if default is MISSING else field(default=default, metadata=meta)


@dataclass(frozen=True)
class Effect(ABC):
    """
    An unmodelled effect at a place.

    Parameters
    ----------
    place : str
        Where it sits, one of the catalogue's places.
    """

    effect: ClassVar[str]
    """Id in the catalogue."""
    linear: ClassVar[bool] = True
    """Whether the frequency response alone carries it."""
    scale_free: ClassVar[bool] = True
    """Whether it does the same at every level of force; of laws those that tell only the sign of the motion."""
    proportional: ClassVar[bool] = False
    """Whether it is a law whose force is in proportion to its one parameter."""

    place: str

    def __post_init__(self) -> None:
        for f in parameter_fields(type(self)):
            check_number(f"{self.effect}: {f.name}", getattr(self, f.name), f.metadata["range"].minimum)

    @classmethod
    @abstractmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        """
        Places at which the effect can sit on a model.

        Parameters
        ----------
        model : Machine or Structure
            The model.

        Returns
        -------
        tuple of str
            The places; none where the effect makes no sense.
        """

    @classmethod
    def ranges(cls, model: Model, place: str, motion: float | None = None) -> Mapping[str, Range]:
        """
        Ranges of the fitted parameters on a model: those of the fields, or in proportion to what the place carries.

        Parameters
        ----------
        model : Machine or Structure
            The nominal model.
        place : str
            One of `places`.
        motion : float, optional
            Peak displacement at the place in the records, where it is known [m or rad].

        Returns
        -------
        mapping of str to Range
            Parameter name to range.
        """
        return {f.name: f.metadata["range"] for f in parameter_fields(cls)}

    @abstractmethod
    def apply(self, model: Any) -> Any:
        """
        The model with the effect.

        Parameters
        ----------
        model : Machine or Structure
            The model without it.

        Returns
        -------
        Machine or Structure
            A new model; the given one is untouched.
        """

    @property
    def conventions(self) -> tuple[Effect, ...]:
        """The same cause as others would model it, where that is a matter of convention: a diagnosis tries them all."""
        return ()

    @abstractmethod
    def moves(self, applied: Any) -> Mapping[str, Carried]:
        """
        Values of the applied model that move with each fitted parameter.

        Parameters
        ----------
        applied : Machine or Structure
            The model with the effect.

        Returns
        -------
        mapping of str to tuple of (path, weight)
            Parameter name to the paths whose values change, and by how much per unit.
        """

    def carries(self, path: Path, applied: Any) -> Carried:
        """
        Values of the applied model that move with a value of the model underneath.

        Parameters
        ----------
        path : tuple of str and int
            The value's path.
        applied : Machine or Structure
            The model with the effect.

        Returns
        -------
        tuple of (path, weight)
            By default the value itself, one to one.
        """
        return ((path, 1.0),)


def parameter_fields(effect: type[Effect]) -> tuple[Field[Any], ...]:
    """
    The fitted parameters of an effect's class.

    Parameters
    ----------
    effect : type of Effect
        The class.

    Returns
    -------
    tuple of dataclasses.Field
        Fields with a `Range` in their metadata.
    """
    return tuple(f for f in fields(effect) if "range" in f.metadata)


def check_place(effect: Effect, model: Model) -> None:
    """
    Refuse a place at which the effect cannot sit.

    Parameters
    ----------
    effect : Effect
        The effect.
    model : Machine or Structure
        The model.

    Raises
    ------
    ParameterError
        If the model has no such place for it.
    """
    places = effect.places(model)
    if effect.place not in places:
        known = ", ".join(places) or "none on this model"
        raise ParameterError(f"{effect.effect} cannot sit at {effect.place!r}; its places are: {known}")


def applied(model: ModelT, changed: ModelT, effect: Effect) -> ModelT:
    """
    A changed model that remembers the effect, and what it was before any.

    Parameters
    ----------
    model : Machine or Structure
        The model underneath.
    changed : Machine or Structure
        The model with the effect's slots filled.
    effect : Effect
        The effect.

    Returns
    -------
    Machine or Structure
        ``changed``, with ``effects`` and ``bare`` set.
    """
    bare = model if model.bare is None else model.bare
    return replace(changed, effects=(*model.effects, effect), bare=bare)


def machine_only(effect: str, model: Model) -> Machine:
    """
    A cutting machine, or a refusal.

    Parameters
    ----------
    effect : str
        Id of the effect that needs a rail or a joint.
    model : Machine or Structure
        The model.

    Returns
    -------
    Machine
        The model.

    Raises
    ------
    ParameterError
        If it is another structure.
    """
    if not isinstance(model, Machine):
        raise ParameterError(f"{effect} needs a cutting machine; this model has no rail and no joints")
    return model


PLACE_PORTS: Mapping[str, str] = {"tool": "tool_x", "head": "head_x"}
"""Port at which an element at a place of the cutting machine acts, in X."""


def ports_of(model: Model, machine_places: tuple[str, ...]) -> tuple[str, ...]:
    """
    Places of an effect that is an element at a port.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    machine_places : tuple of str
        Its places on the cutting machine.

    Returns
    -------
    tuple of str
        Those, or every port of another structure.
    """
    return machine_places if isinstance(model, Machine) else tuple(model.system.ports)


def port_of(place: str, model: Model) -> str:
    """
    The port at a place.

    Parameters
    ----------
    place : str
        The place.
    model : Machine or Structure
        The model.

    Returns
    -------
    str
        Name of the port.
    """
    return PLACE_PORTS[place] if isinstance(model, Machine) else place


def attached_to(model: ModelT, port: str, element: SpringDamperMass | SprungMass) -> ModelT:
    """
    A model with one more element in parallel at a port.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    port : str
        Name of the port.
    element : SpringDamperMass or SprungMass
        The element.

    Returns
    -------
    Machine or Structure
        The new model.
    """
    return replace(model, attachments=(*model.attachments, Attachment(port, element)))


def channels_of(effect: str, channel: str, model: Model) -> tuple[str, ...]:
    """
    Channels that a name stands for.

    Parameters
    ----------
    effect : str
        Id of the effect, for the message.
    channel : str
        Name of a channel, or ``"all"``.
    model : Machine or Structure
        The model.

    Returns
    -------
    tuple of str
        The channels.

    Raises
    ------
    ParameterError
        If there is no such channel; the message lists those that are.
    """
    if channel == "all":
        return tuple(model.channels)
    if channel not in model.channels:
        raise ParameterError(f"{effect}: no channel {channel!r}; there are all, {', '.join(model.channels)}")
    return (channel,)
