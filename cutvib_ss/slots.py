"""
The slots that every kind of model has: attachments, measurement chain, nonlinear elements; all empty by default.

A model is frozen data with named slots; what is absent is an empty slot, never a branch elsewhere. Effects return a new model
with a slot filled. A value in a slot is named by its path, so that fits can move it and responses differentiate by it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from types import MappingProxyType
from typing import Literal, Protocol, runtime_checkable

import control
import numpy as np

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.mechanical import Channel, SecondOrder
from cutvib_ss.model.restoring_forces import RestoringForce, law
from cutvib_ss.parameters import check_number
from cutvib_ss.subsystems.elements import Attachment, SpringDamperMass


@dataclass(frozen=True)
class ChannelChain:
    """
    What a measurement chain does to one response channel: gain · e^(-s delay).

    Parameters
    ----------
    gain : float
        Factor on the sensitivity.
    delay : float
        How late the channel is against the force [s].
    """

    gain: float = 1.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        check_number("gain", self.gain)
        check_number("delay", self.delay)


@dataclass(frozen=True)
class MeasurementChain:
    """
    The measurement chain; ideal by default.

    Parameters
    ----------
    channels : mapping of str to ChannelChain
        Chains of the response channels; those left out are ideal.
    cross_axis : float
        Fraction of ``tool_x`` that leaks into ``tool_z``.
    decay_rate : float
        Rate of an exponential window on force and response whose damping was never taken out [1/s].
    """

    channels: Mapping[str, ChannelChain] = field(default_factory=dict)
    cross_axis: float = 0.0
    decay_rate: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        check_number("cross_axis", self.cross_axis)
        check_number("decay_rate", self.decay_rate, 0.0)

    def channel(self, name: str) -> ChannelChain:
        """
        Chain of one channel.

        Parameters
        ----------
        name : str
            Name of the channel.

        Returns
        -------
        ChannelChain
            Its chain; ideal where nothing is known.
        """
        return self.channels.get(name, ChannelChain())

    def with_channel(self, name: str, chain: ChannelChain) -> MeasurementChain:
        """
        The chain with one channel replaced.

        Parameters
        ----------
        name : str
            Name of the channel.
        chain : ChannelChain
            Its new chain.

        Returns
        -------
        MeasurementChain
            The new chain.
        """
        return replace(self, channels={**self.channels, name: chain})


@dataclass(frozen=True)
class NonlinearElement:
    """
    A nonlinear law between a port's motion and the force there, which linear analyses ignore.

    Parameters
    ----------
    port : str
        Name of the port.
    law : str
        Name of the law, one of `cutvib_ss.model.restoring_forces`.
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
        kind = law(self.law)
        needed = {f.name for f in fields(kind) if f.default is MISSING}
        if not needed <= set(self.parameters) <= set(kind.units()):
            raise ParameterError(
                f"{self.law} has the parameters {', '.join(kind.units())}; {', '.join(self.parameters)} given"
            )
        object.__setattr__(self, "parameters", MappingProxyType(dict(self.parameters)))
        object.__setattr__(self, "restoring_force", kind(**self.parameters))

    restoring_force: RestoringForce = field(init=False, repr=False, compare=False)
    """The law with its parameters."""


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
        With c = kη/ω in place of the loss.
    """
    if viscous_at is None:
        return tuple(attachments)
    omega = 2 * np.pi * check_number("viscous_at", viscous_at, 0.0, strict=True)
    out = []
    for a in attachments:
        e = a.element
        if isinstance(e, SpringDamperMass) and e.loss_stiffness:
            e = replace(e, damping=e.damping + e.loss_stiffness / omega, loss_stiffness=0.0)
        out.append(replace(a, element=e))
    return tuple(out)


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


def through_chain(chain: MeasurementChain, plant: control.StateSpace, pade_order: int | None) -> control.StateSpace:
    """
    A plant's outputs as the measurement chain shows them.

    Parameters
    ----------
    chain : MeasurementChain
        The chain.
    plant : control.StateSpace
        Displacement outputs.
    pade_order : int or None
        Order of the Padé approximation of delays.

    Returns
    -------
    control.StateSpace
        With gains, leakage across axes and delays applied.

    Raises
    ------
    CouplingError
        If a channel is late and no ``pade_order`` is given, or an exponential window was never taken out.
    """
    names = list(plant.output_labels)
    if chain.decay_rate:
        raise CouplingError("an exponential window in the chain shifts every pole; it is no property of a plant")
    if chain.cross_axis == 0.0 and not any(n in chain.channels for n in names):
        return plant
    mix = np.eye(len(names))
    if chain.cross_axis and "tool_z" in names:
        if "tool_x" not in names:
            raise CouplingError("tool_x leaks into tool_z (cross_axis): ask for both outputs")
        mix[names.index("tool_z"), names.index("tool_x")] = chain.cross_axis
    static = np.diag([chain.channel(n).gain for n in names]) @ mix
    out = control.ss([], [], [], static) * plant
    late = [chain.channel(n).delay for n in names]
    if any(late):
        if pade_order is None:
            raise CouplingError("a delayed channel has no finite plant; ask for an approximation with pade_order")
        delays = [
            control.ss(control.tf(*control.pade(t, pade_order))) if t else control.ss([], [], [], [[1.0]]) for t in late
        ]
        out = control.append(*delays) * out
    return control.ss(out.A, out.B, out.C, out.D, inputs=plant.input_labels, outputs=names)
