"""
The cutting machine: head and rail joined by the base-force constraint (Eqs. 5, 6, 10), at any position of the head on the rail.

The response code reads the slots; the second-order form and the python-control plant are built here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import control
import numpy as np

from cutvib_ss.interconnection import close_base_loop, with_quantity
from cutvib_ss.mechanical import Channel, SecondOrder
from cutvib_ss.parameters import (
    HeadParameters,
    RailParameters,
    Tolerances,
    check_position,
    recovered_rail,
    table_3,
)
from cutvib_ss.results import Displayed, FloatArray, Quantity, Table, as_names
from cutvib_ss.slots import MeasurementChain, NonlinearElement, attach_all, through_chain, viscous_attachments
from cutvib_ss.subsystems.elements import Attachment, Guide
from cutvib_ss.subsystems.head import HEAD_PARAMETERS, HEAD_UNITS, head
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
class Machine(Displayed):
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
    bare : Machine, optional
        The model before the first effect.

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
    bare: Machine | None = field(default=None, compare=False, repr=False)

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

    def _table(self) -> Table:
        h, r = self.head, self.rail.parameters
        rows = [(n, f"{getattr(h, n):.6g}", u) for n, u in zip(HEAD_PARAMETERS, HEAD_UNITS, strict=True)]
        head_rows = [(f"{a[0]}, {b[0]}", f"{a[1]}, {b[1]}", a[2]) for a, b in zip(rows[::2], rows[1::2], strict=True)]
        rail_rows = [
            ("rail length, mass", f"{r.length:g} m, {r.mass:g} kg", ""),
            ("rail first frequency", f"{r.first_frequency:g}", "Hz"),
            ("rail damping ratio, modes", f"{r.damping_ratio}, {r.n_modes}", ""),
        ]
        effects = [(type(e).__name__, str(getattr(e, "place", "")), "effect") for e in self.effects]
        return Table("Cutting machine: head on a flexible rail", ("value", "", "unit"), head_rows + rail_rows + effects)

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
        The rail with ports ``base`` and ``at_head`` (its shear centre under the head) and perhaps ``at_head_twist``.

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
        return replace(system, ports={**system.ports, "base": system.port("at_head")})

    @property
    def interface(self) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Ports of the rail and of the head that the base constraint joins."""
        if self.rail.torsion:
            return ("at_head", "at_head_twist"), ("base", "twist")
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

    def matrices(
        self, positions: Sequence[float], viscous_at: float | None = None
    ) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        """
        Mass, damping and stiffness at several positions: the matrices of `second_order`, at less cost.

        Parameters
        ----------
        positions : sequence of float
            y_b / L of the head, each strictly inside (0, 1).
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        list of (ndarray, ndarray, ndarray)
            One a position.
        """
        if self.guide is not None or not positions:
            systems = [self.second_order(y, viscous_at) for y in positions]
            return [(s.mass, s.damping, s.stiffness) for s in systems]
        rail_ = self.rail_system(positions[0], {f"at{i}": check_position(y) for i, y in enumerate(positions)})
        head_, theirs = self.head_system(viscous_at), self.interface[1]
        ends = ("", "_twist")[: len(theirs)]
        return [rail_.joined([f"at{i}{end}" for end in ends], head_, theirs) for i in range(len(positions))]

    def plant(
        self,
        position: float,
        *,
        inputs: str | Sequence[str] = ("force",),
        outputs: str | Sequence[str] = ("tool_x", "tool_z", "base_x", "head_x", "head_z"),
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
        inputs : str or sequence of str
            ``force`` (tool, X), or any port of the head or rail: ``head_x``, ``base``, ``rail_left`` ...
        outputs : str or sequence of str
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
        ports_in = {name: CUTTING_SIGNALS.get(name, name) for name in as_names(inputs)}
        ports_out = {name: CUTTING_SIGNALS.get(name, name) for name in as_names(outputs)}
        closed = close_base_loop(
            self.head_system(viscous_at), self.rail_system(position), self.interface, self.guide, ports_in, ports_out
        )
        return with_quantity(through_chain(self.chain, closed, pade_order), quantity, "machine")

    def plants(
        self,
        positions: Iterable[float],
        *,
        inputs: str | Sequence[str] = ("force",),
        outputs: str | Sequence[str] = ("tool_x", "tool_z", "base_x", "head_x", "head_z"),
        quantity: Quantity = "displacement",
        pade_order: int | None = None,
        viscous_at: float | None = None,
    ) -> tuple[control.StateSpace, ...]:
        """
        The family of plants over positions, in common signals.

        Parameters
        ----------
        positions : iterable of float
            y_b / L of the head, each strictly inside (0, 1).
        inputs, outputs : str or sequence of str
            Signals, as `plant` takes them.
        quantity : {"displacement", "velocity", "acceleration"}
            Which motion the outputs give.
        pade_order : int, optional
            Order of the Padé approximation of channel delays.
        viscous_at : float, optional
            Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

        Returns
        -------
        tuple of control.StateSpace
            One a position, in the order given.

        Examples
        --------
        >>> [plant.nstates for plant in published_machine().plants([0.25, 0.5])]
        [12, 12]
        """
        return tuple(
            self.plant(
                y, inputs=inputs, outputs=outputs, quantity=quantity, pade_order=pade_order, viscous_at=viscous_at
            )
            for y in positions
        )


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
