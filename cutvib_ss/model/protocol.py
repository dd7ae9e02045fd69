"""
The slots that every kind of model has: attachments, measurement chain, nonlinear elements; all empty by default.

A model is frozen data with named slots; what is absent is an empty slot, never a branch elsewhere. Effects return a new model
with a slot filled. A value in a slot is named by its path, so that fits can move it and responses differentiate by it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from types import MappingProxyType
from typing import Literal, Protocol, runtime_checkable

from cutvib_ss.errors import ParameterError
from cutvib_ss.laws import LAWS
from cutvib_ss.model.elements import Attachment, viscous_equivalent
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.parameters import check_number


@dataclass(frozen=True)
class NonlinearElement:
    """
    A nonlinear law between a port's motion and the force there, which linear analyses ignore.

    Parameters
    ----------
    port : str
        Name of the port.
    law : str
        Name of the law, one of `cutvib_ss.laws.LAWS`.
    parameters : mapping of str to float
        The law's parameters [SI].

    Raises
    ------
    ParameterError
        If there is no such law, or its parameters are not those given.
    """

    port: str
    law: str
    parameters: Mapping[str, float]

    def __post_init__(self) -> None:
        if self.law not in LAWS:
            raise ParameterError(f"no law {self.law!r}; there are {', '.join(LAWS)}")
        names = LAWS[self.law].units
        if set(self.parameters) != set(names):
            raise ParameterError(
                f"{self.law} has the parameters {', '.join(names)}; {', '.join(self.parameters)} given"
            )
        for name in names:
            check_number(f"{self.law}: {name}", self.parameters[name])
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters in the order in which the law takes them."""
        return tuple(self.parameters[name] for name in LAWS[self.law].units)


@runtime_checkable
class Model(Protocol):
    """What the response code, the measurement and the diagnosis need of a model, whichever its kind."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Response channels of a campaign on this model."""
        ...

    @property
    def input_port(self) -> str:
        """Port at which a campaign's force acts."""
        ...

    @property
    def input_quantity(self) -> Literal["force", "acceleration"]:
        """What a campaign's ``force`` channel holds."""
        ...

    @property
    def has_position(self) -> bool:
        """Whether the model depends on a position."""
        ...

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Elements in parallel at ports."""
        ...

    @property
    def chain(self) -> MeasurementChain:
        """The measurement chain."""
        ...

    @property
    def nonlinear(self) -> tuple[NonlinearElement, ...]:
        """Nonlinear elements."""
        ...

    def second_order(self, position: float | None = None, viscous_at: float | None = None) -> SecondOrder:
        """
        The exact second-order form at a position.

        Parameters
        ----------
        position : float, optional
            y_b / L, where the model has one.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        SecondOrder
            The joined system.
        """
        ...


def viscous_attachments(attachments: Iterable[Attachment], viscous_at: float | None) -> tuple[Attachment, ...]:
    """
    The attachments with hysteretic damping replaced by what dissipates as much at one frequency.

    Parameters
    ----------
    attachments : iterable of Attachment
        Any attachments.
    viscous_at : float or None
        Frequency [Hz]; None leaves them as they are.

    Returns
    -------
    tuple of Attachment
        With c = kη/ω in place of the loss; where there is no finite form at all, a spring and damper.
    """
    if viscous_at is None:
        return tuple(attachments)
    s = 2j * pi * check_number("viscous_at", viscous_at, 0.0, strict=True)
    return tuple(replace(a, element=viscous_equivalent(a.element, s)) for a in attachments)


def attach_all(system: SecondOrder, attachments: Sequence[Attachment]) -> SecondOrder:
    """
    A system with elements attached at its ports.

    Parameters
    ----------
    system : SecondOrder
        The system.
    attachments : sequence of Attachment
        What to attach, and where.

    Returns
    -------
    SecondOrder
        The joined system; the k-th element's own coordinates are named ``attached<k>_…``.
    """
    for k, a in enumerate(attachments):
        system = system.attach([a.port], a.element.second_order(), ["end"], prefix=f"attached{k + 1}_")
    return system
