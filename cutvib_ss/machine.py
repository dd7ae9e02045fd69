"""
The machine: head and rail joined by the base-force constraint (Eqs. 5, 6, 10), at any position of the head on the rail.

A model is frozen data with named slots; what is absent is an empty slot, never a branch elsewhere. Effects return a new model
with a slot filled. The response code reads the slots; the second-order form and the python-control plant are built here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal, Protocol, runtime_checkable

import control
import numpy as np

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.interconnection import close_base_loop, with_quantity
from cutvib_ss.mechanical import Channel, SecondOrder
from cutvib_ss.parameters import (
    HeadParameters,
    RailParameters,
    StructureTolerances,
    Tolerances,
    check_number,
    check_position,
    recovered_rail,
    table_3,
)
from cutvib_ss.results import FloatArray, Quantity
from cutvib_ss.subsystems.elements import Attachment, Guide, SpringDamperMass
from cutvib_ss.subsystems.head import head
from cutvib_ss.subsystems.rail import Rail, rail

CUTTING_CHANNELS: Mapping[str, Channel] = MappingProxyType(
    {
        "tool_x": Channel("tool_x", "acceleration"),
        "tool_z": Channel("tool_z", "acceleration"),
        "base_x": Channel("base", "acceleration"),
    }
)
"""Accelerometers of a campaign on the cutting machine."""

CUTTING_SIGNALS: Mapping[str, str] = MappingProxyType({"force": "tool_x", "base_x": "base"})
"""Signal names of the cutting machine that are not the names of their ports."""


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
        Effect id of the law in the catalogue.
    parameters : mapping of str to float
        The law's parameters [SI].
    """

    port: str
    law: str
    parameters: Mapping[str, float]


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


@dataclass(frozen=True)
class Machine:
    """
    The cutting machine: equivalent robot on a flexible rail.

    Parameters
    ----------
    head : HeadParameters
        The cutting head.
    rail : Rail
        The moving rail.
    tolerance : Tolerances
        How well each value is known.
    attachments : tuple of Attachment
        Elements in parallel at the head's ports; none by default.
    guide : Guide, optional
        Give between rail and head; rigid by default.
    chain : MeasurementChain
        The measurement chain; ideal by default.
    nonlinear : tuple of NonlinearElement
        Nonlinear elements; none by default.
    effects : tuple of object
        The effects behind the filled slots, for the record and for writing machine.toml.

    Examples
    --------
    >>> published_machine().plant(0.5).nstates
    12
    """

    head: HeadParameters
    rail: Rail
    tolerance: Tolerances = field(default_factory=Tolerances)
    attachments: tuple[Attachment, ...] = ()
    guide: Guide | None = None
    chain: MeasurementChain = field(default_factory=MeasurementChain)
    nonlinear: tuple[NonlinearElement, ...] = ()
    effects: tuple[object, ...] = ()

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Accelerometers ``tool_x``, ``tool_z`` and ``base_x``."""
        return CUTTING_CHANNELS

    @property
    def input_port(self) -> str:
        """The cutting force, and the hammer, act on the tool in X."""
        return "tool_x"

    @property
    def input_quantity(self) -> Literal["force", "acceleration"]:
        """A force."""
        return "force"

    @property
    def has_position(self) -> bool:
        """The head travels along the rail."""
        return True

    def head_system(self, viscous_at: float | None = None) -> SecondOrder:
        """
        The head with what is attached to it, its base free.

        Parameters
        ----------
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is made viscous.

        Returns
        -------
        SecondOrder
            Over θ1, θ2, the base's motion, the twist where there is one, and the attachments' own coordinates.
        """
        torsion = self.rail.torsion
        bare = head(self.head, torsion is not None, torsion.eccentricity if torsion else 0.0)
        return attach_all(bare, viscous_attachments(self.attachments, viscous_at))

    def rail_system(self, position: float, points: Mapping[str, float] | None = None) -> SecondOrder:
        """
        The rail with ports ``base`` (under the head) and ``at_head``, ``at_head_twist`` (where the head is joined).

        Parameters
        ----------
        position : float
            y_b / L.
        points : mapping of str to float, optional
            More ports along the rail.

        Returns
        -------
        SecondOrder
            In modal coordinates.
        """
        system = rail(self.rail, {"at_head": check_position(position), **(points or {})})
        under = np.array(system.port("at_head"))
        if self.rail.torsion:
            under = under + self.rail.torsion.eccentricity * system.port("at_head_twist")
        return replace(system, ports={**system.ports, "base": under})

    @property
    def interface(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Ports of the rail and of the head that the base constraint joins."""
        if self.rail.torsion:
            return ("at_head", "at_head_twist"), ("shear_centre", "twist")
        return ("at_head",), ("base",)

    def second_order(
        self, position: float | None = None, viscous_at: float | None = None, points: Mapping[str, float] | None = None
    ) -> SecondOrder:
        """
        The exact second-order form at a position: 2 + m degrees of freedom (Section 3.3).

        Parameters
        ----------
        position : float
            y_b / L of the head, strictly inside (0, 1).
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.
        points : mapping of str to float, optional
            More ports along the rail: name to y / L.

        Returns
        -------
        SecondOrder
            Modal coordinates of the rail, then the head's rotations, then what is attached.

        Raises
        ------
        CouplingError
            If damping is hysteretic and no ``viscous_at`` is given.
        """
        rail_ = self.rail_system(check_position(position), points)
        head_ = self.head_system(viscous_at)
        ours, theirs = self.interface
        if self.guide is None:
            return rail_.attach(ours, head_, theirs)
        n, k = len(rail_.dofs), len(head_.dofs)
        gap = np.concatenate([-rail_.port(ours[0]), head_.port(theirs[0])])
        block = np.outer(gap, gap)

        def joined(name: str, along: float) -> FloatArray:
            out = np.zeros((n + k, n + k))
            out[:n, :n], out[n:, n:] = getattr(rail_, name), getattr(head_, name)
            return out + along * block

        ports = {p: np.concatenate([np.zeros(n), r]) for p, r in head_.ports.items() if p not in rail_.ports}
        ports |= {p: np.concatenate([r, np.zeros(k)]) for p, r in rail_.ports.items()}
        ports["head_base"] = np.concatenate([np.zeros(n), head_.port("base")])
        both = SecondOrder(
            joined("mass", 0.0), joined("damping", self.guide.damping), joined("stiffness", self.guide.stiffness),
            rail_.dofs + tuple(f"head_{d}" if d in ("base", "twist") else d for d in head_.dofs), ports,
        )  # fmt: skip
        return both if len(ours) == 1 else _tie(both, ours[1], "twist")

    def plant(
        self,
        position: float,
        inputs: Sequence[str] = ("force",),
        outputs: Sequence[str] = ("tool_x", "tool_z", "base_x", "head_x", "head_z"),
        quantity: Quantity = "displacement",
        pade_order: int | None = None,
        viscous_at: float | None = None,
    ) -> control.StateSpace:
        """
        The head and the rail as state-space objects, interconnected through the base-force constraint.

        Parameters
        ----------
        position : float
            y_b / L of the head, strictly inside (0, 1).
        inputs : sequence of str
            ``force`` (tool, X), or any port of the head or rail: ``head_x``, ``base``, ``rail_left`` ...
        outputs : sequence of str
            ``tool_x``, ``tool_z``, ``base_x``, ``head_x``, ``head_z``, or any other port.
        quantity : {"displacement", "velocity", "acceleration"}
            Which motion the outputs give.
        pade_order : int, optional
            Order of the Padé approximation of channel delays.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        control.StateSpace
            2(2+m) states for the bare machine, signals named, balanced.

        Raises
        ------
        CouplingError
            If a delay or hysteretic damping has no finite plant and no approximation is asked for.

        Notes
        -----
        Both parts have direct feedthrough from force to acceleration, so their loop is algebraic, yet well posed: its
        return difference is 1 + φᵀφ m_eff > 0, m_eff ≥ 0 being what the head's masses leave the base once its joints are
        free to accelerate. Closing it with `StateSpace.feedback` leaves exactly the physical states, with no constraint-drift
        poles at zero.
        """
        ports_in = {name: CUTTING_SIGNALS.get(name, name) for name in inputs}
        ports_out = {name: CUTTING_SIGNALS.get(name, name) for name in outputs}
        closed = close_base_loop(
            self.head_system(viscous_at), self.rail_system(position), self.interface, self.guide, ports_in, ports_out
        )
        return with_quantity(through_chain(self.chain, closed, pade_order), quantity, "machine")


def _tie(system: SecondOrder, port: str, dof: str) -> SecondOrder:
    """Eliminate a degree of freedom that moves with a port (the twist, where the guide gives only in X)."""
    index = next(i for i, d in enumerate(system.dofs) if d in (dof, f"head_{dof}"))
    keep = [i for i in range(len(system.dofs)) if i != index]
    transform = np.zeros((len(system.dofs), len(keep)))
    transform[keep, np.arange(len(keep))] = 1.0
    transform[index] = system.port(port)[keep]
    return SecondOrder(
        transform.T @ system.mass @ transform,
        transform.T @ system.damping @ transform,
        transform.T @ system.stiffness @ transform,
        tuple(system.dofs[i] for i in keep),
        {p: r @ transform for p, r in system.ports.items()},
    )


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
    out = control.ss(static) * plant
    late = [chain.channel(n).delay for n in names]
    if any(late):
        if pade_order is None:
            raise CouplingError("a delayed channel has no finite plant; ask for an approximation with pade_order")
        delays = [
            control.ss(control.tf(*control.pade(t, pade_order))) if t else control.ss([], [], [], [[1.0]]) for t in late
        ]
        out = control.append(*delays) * out
    return control.ss(out.A, out.B, out.C, out.D, inputs=plant.input_labels, outputs=names)


@dataclass(frozen=True)
class Structure:
    """
    Any other structure: M, C, K with ports and channels (machine.toml, ``kind = "second_order"``).

    Parameters
    ----------
    system : SecondOrder
        The matrices and ports.
    channels : mapping of str to Channel
        What each response channel reads.
    input_port : str
        Port at which the measured force acts, or which moves with the base.
    input_quantity : {"force", "acceleration"}
        ``"acceleration"``: the structure stands on a shaker, the input is the base's acceleration, motion is relative to it.
    tolerance : StructureTolerances
        How well the matrices are known.
    scales : tuple of float
        Factors on mass, damping and stiffness, which tuning moves.
    attachments : tuple of Attachment
        Elements in parallel at ports; none by default.
    chain : MeasurementChain
        The measurement chain; ideal by default.
    nonlinear : tuple of NonlinearElement
        Nonlinear elements; none by default.
    effects : tuple of object
        The effects behind the filled slots.
    """

    system: SecondOrder
    channels: Mapping[str, Channel]
    input_port: str
    input_quantity: Literal["force", "acceleration"] = "force"
    tolerance: StructureTolerances = field(default_factory=StructureTolerances)
    scales: tuple[float, float, float] = (1.0, 1.0, 1.0)
    attachments: tuple[Attachment, ...] = ()
    chain: MeasurementChain = field(default_factory=MeasurementChain)
    nonlinear: tuple[NonlinearElement, ...] = ()
    effects: tuple[object, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        if np.linalg.eigvalsh(self.system.mass).min() <= 0.0:
            raise ParameterError("the mass matrix is not positive definite; check the masses and their signs")
        self.system.port(self.input_port)
        for name, channel in self.channels.items():
            if channel.port not in self.system.ports:
                raise ParameterError(f"channel {name!r} reads port {channel.port!r}, which is not under [ports]")

    @property
    def has_position(self) -> bool:
        """A structure has no position."""
        return False

    @property
    def scaled(self) -> SecondOrder:
        """The matrices with their factors applied."""
        m, c, k = self.scales
        s = self.system
        return replace(s, mass=m * s.mass, damping=c * s.damping, stiffness=k * s.stiffness)

    def second_order(self, position: float | None = None, viscous_at: float | None = None) -> SecondOrder:
        """
        The exact second-order form.

        Parameters
        ----------
        position : None
            A structure has no position.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        SecondOrder
            The structure with what is attached to it.
        """
        if position is not None and not np.isnan(position):
            raise ParameterError(f"position = {position}: a second_order model has no position")
        return attach_all(self.scaled, viscous_attachments(self.attachments, viscous_at))

    def plant(
        self,
        position: float | None = None,
        inputs: Sequence[str] = ("force",),
        outputs: Sequence[str] | None = None,
        quantity: Quantity | None = None,
        pade_order: int | None = None,
        viscous_at: float | None = None,
    ) -> control.StateSpace:
        """
        The structure as a python-control object.

        Parameters
        ----------
        position : None
            A structure has no position.
        inputs : sequence of str
            ``force`` (the input port), or names of ports.
        outputs : sequence of str, optional
            Channels or ports; the channels by default.
        quantity : {"displacement", "velocity", "acceleration"}, optional
            Motion of the outputs; by default each channel's own, and displacement of ports.
        pade_order : int, optional
            Order of the Padé approximation of channel delays.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        control.StateSpace
            2n states, signals named.
        """
        system = self.second_order(position, viscous_at)
        ports_in = {name: self.input_port if name == "force" else name for name in inputs}
        if self.input_quantity == "acceleration" and "force" in ports_in:
            drive = -(system.mass @ system.port(self.input_port))
            system = replace(system, ports={**system.ports, "base inertia": drive})
            ports_in["force"] = "base inertia"
        reads: dict[str, tuple[str, Quantity]] = {}
        for name in tuple(self.channels) if outputs is None else outputs:
            channel = self.channels.get(name, Channel(name, "displacement"))
            reads[name] = (channel.port, quantity or channel.quantity)
        return through_chain(self.chain, system.state_space(ports_in, reads, name="structure"), pade_order)


def published_machine() -> Machine:
    """
    The paper's machine: Table 3 and the rail of Tables 5 and 6.

    Returns
    -------
    Machine
        Four rail modes, as Table 6 was computed with.
    """
    return Machine(head=table_3(), rail=Rail(recovered_rail()))


def cutting_machine(head: HeadParameters, rail: RailParameters, tolerance: Tolerances | None = None) -> Machine:
    """
    A bare cutting machine from parameter sets.

    Parameters
    ----------
    head : HeadParameters
        The cutting head.
    rail : RailParameters
        The pinned rail.
    tolerance : Tolerances, optional
        How well each value is known.

    Returns
    -------
    Machine
        With every other slot empty.
    """
    return Machine(head=head, rail=Rail(rail), tolerance=tolerance or Tolerances())
