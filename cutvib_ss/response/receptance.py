"""
Frequency responses in closed form: the head condensed to its base, the rail condensed to its receptance there.

Let u be the motion where head and rail meet (one displacement; with twist also a rotation) and R the force on the rail. The head
alone, guide and attachments included, x held, answers a force at port p with T_p (force on x) and H0_qp (motion); its dynamic
stiffness at x is Z. The rail's receptance there is A; a_p is its motion there for a force at one of its own ports. Then

    R_p = (1 + Z A)^-1 (T_p - Z a_p),   u_p = A R_p + a_p,   H_qp = H0_qp + a_qp + T_qᵀ u_p + a_qᵀ R_p.

T, Z and H0 depend on frequency alone, A and a on position too: one scalar carries the position. A structure without a rail has
no u: H0 is all. Derivatives are in `cutvib_ss.response.derivatives`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.coupling import Changes
from cutvib_ss.model.elements import Attachment, Element, SpringDamperMass, SprungMass
from cutvib_ss.model.paths import Path
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.rail import rail_point
from cutvib_ss.response.batched import CLOSED_FORM, dot, inverse, mixed
from cutvib_ss.response.rail_receptance import RailField, RailReceptance
from cutvib_ss.response.structure_motion import StructureMotion
from cutvib_ss.response.twist_receptance import TwistReceptance
from cutvib_ss.results import ComplexArray, FloatArray

Row: TypeAlias = FloatArray | ComplexArray


class ModelReceptance:
    """
    The receptances of a model, head and rail together, at given positions and frequencies.

    Ports that are named beforehand are solved for together, which a structure of many degrees of freedom is glad of.
    """

    def __init__(self, model: Model, positions: FloatArray, s: ComplexArray, ports: Sequence[str] = ()) -> None:
        model = model.in_modes
        self.model, self.positions, self.s = model, np.atleast_1d(positions), s
        self._ports: dict[str, PortReceptance] = {}
        self._core_changes: dict[Path, Changes | None] = {}
        self.assembly = model.assembly
        self.system = system = self.assembly.core
        self.interface = interface = [system.dofs.index(d) for d in self.assembly.base]
        self.rows: dict[str, FloatArray] = dict(system.ports)
        n = len(system.dofs)
        self._free = [i for i in range(n) if i not in interface]
        self._named = tuple(dict.fromkeys(ports))
        # Motion of the head that follows its base.
        self.following: ComplexArray = np.zeros((n, len(interface), s.size), dtype=np.complex128)
        self._is_large = not interface and n > CLOSED_FORM
        if self._is_large:
            # Solved by `_large`, for the ports that are asked for.
            return
        polynomial = np.stack([system.stiffness, system.damping, system.mass], axis=-1)
        e = mixed(polynomial, np.array([np.ones_like(s), s, s * s]))
        for a in self.assembly.elements:
            p = self.foot(a)
            own = np.ix_(np.flatnonzero(p), np.flatnonzero(p))
            e[own] += a.element.dynamic_stiffness(s) * np.multiply.outer(p, p)[own][:, :, None]
        f, u = self._free, interface
        self._held_stiffness = e[np.ix_(f, f)] if u else e
        if u:
            self.following[f] = -np.einsum("abf,buf->auf", self._inverse, e[np.ix_(f, u)])
            self.following[u] = np.eye(len(u))[:, :, None]
            self._stiffness = e[np.ix_(u, u)] + np.einsum("uaf,avf->uvf", e[np.ix_(u, f)], self.following[f])

    @cached_property
    def _inverse(self) -> ComplexArray:
        return inverse(self._held_stiffness)

    @cached_property
    def _large(self) -> StructureMotion:
        """Motions of a structure of many degrees of freedom."""
        wanted = (p if self.shaken(p) else self.model.port_of(p) for p in self._named)
        rows = {self.rows[p].tobytes(): self.rows[p] for p in wanted if p in self.rows}
        feet = [self.foot(a) for a in self.assembly.elements]
        stiffness = [a.element.dynamic_stiffness(self.s) for a in self.assembly.elements]
        return StructureMotion(self.system, self.s, feet, stiffness, list(rows.values()))

    # -- the two sides ------------------------------------------------------------------------------------------------------

    def row(self, port: str) -> FloatArray:
        """A port's row over the head's degrees of freedom, shape (n,)."""
        if port not in self.rows:
            known = dict.fromkeys([*self.model.channels, *self.rows])
            along = "" if self.assembly.rail is None else ", eta1 ..., rail_left, rail_right, rail@0.25 ..."
            raise ParameterError(f"no port {port!r}; there are {', '.join(known)}{along}")
        return self.rows[port]

    def foot(self, attachment: Attachment) -> FloatArray:
        """The row of an element's foot over the head's degrees of freedom, shape (n,)."""
        self.row(attachment.port)
        return attachment.row(self.rows)

    def core_changes(self, path: Path) -> Changes | None:
        """How the core moves with one of the model's values."""
        if path not in self._core_changes:
            self._core_changes[path] = self.model.core_changes(path)
        return self._core_changes[path]

    @cached_property
    def rail(self) -> RailReceptance:
        """The rail without the head."""
        assert self.assembly.rail is not None
        return RailReceptance(self.assembly.rail, self.s)

    @cached_property
    def base_field(self) -> RailField:
        """The rail's motion for a unit force under the head."""
        return self.rail.field(self.rail.point(self.positions))

    @cached_property
    def twist(self) -> TwistReceptance:
        """The rail's twist where the head is."""
        torsion = self.rail.model.torsion
        assert torsion is not None
        return TwistReceptance(torsion, self.positions, self.s)

    @cached_property
    def _own(self) -> ComplexArray:
        """The rail's receptance under the head, shape (position, frequency)."""
        return self.rail.product(self.base_field, self.base_field)

    @cached_property
    def _receptances(self) -> list[ComplexArray]:
        """A of each interface motion, which bending and twist keep apart; shape (position, frequency) each."""
        return [self._own, self.twist.value] if len(self.interface) == 2 else [self._own]

    @cached_property
    def _solver(self) -> ComplexArray:
        """(1 + Z A)^-1, shape (interface, interface, position, frequency)."""
        z, a = self._stiffness, self._receptances
        if len(a) == 1:
            one: ComplexArray = (1.0 / (1.0 + z[0, 0] * a[0]))[None, None]
            return one
        b, c = z[0, 1] * a[1], z[1, 0] * a[0]
        d, e = 1.0 + z[0, 0] * a[0], 1.0 + z[1, 1] * a[1]
        two: ComplexArray = np.array([[e, -b], [-c, d]]) * (1.0 / (d * e - b * c))
        return two

    def is_rail(self, name: str) -> bool:
        """Whether a signal is one of the rail: its modal coordinates, ends and points."""
        if self.assembly.rail is None or not name.startswith(("rail", "eta")):
            return False
        return name in ("rail_left", "rail_right") or re.fullmatch(r"eta\d+|rail\(.*\)|rail@.*", name) is not None

    def shaken(self, name: str) -> bool:
        """Whether a signal is the acceleration of a shaker under the structure."""
        return name == "force" and self.model.influence is not None

    def of_port(self, name: str) -> PortReceptance:
        """What a unit force at a signal's port does; its parts are computed when they are asked for."""
        port = name if self.shaken(name) else self.model.port_of(name)
        if port not in self._ports:
            on_rail = self.is_rail(port)
            row = np.zeros(len(self.system.dofs)) if on_rail else self._head_row(port)
            self._ports[port] = PortReceptance(self, row, self._rail_field(port) if on_rail else None)
        return self._ports[port]

    def held(self, row: Row) -> ComplexArray:
        """Motion of the head for a unit force, its base held, shape (n, frequency)."""
        if self._is_large:
            return self._large.of(row)
        out = np.zeros((len(self.system.dofs), self.s.size), dtype=np.complex128)
        if row.any():
            out[self._free] = dot(np.moveaxis(self._inverse, 1, 0), _over_frequency(row)[self._free][:, None])
        return out

    def joined(self, to_base: ComplexArray, at_head: ComplexArray | None) -> tuple[ComplexArray, ComplexArray]:
        """Force and motion where head and rail meet, shape (interface, position, frequency)."""
        load = to_base if at_head is None else to_base - self._stiffness[:, :1] * at_head
        force = np.array([dot(solve, load) for solve in self._solver])
        motion = np.array([a * r for a, r in zip(self._receptances, force, strict=True)])
        if at_head is not None:
            motion[0] += at_head
        return force, motion

    def rail_motion(self, field: RailField) -> ComplexArray:
        """Motion of the rail where the head is, without the head, shape (position, frequency)."""
        return self._own if field is self.base_field else self.rail.product(field, self.base_field)

    def _rail_field(self, name: str) -> RailField:
        """The rail's motion for a unit force at one of its own ports, without the head."""
        if name.startswith("eta"):
            r, modes = int(name[3:]), self.rail.model.parameters.n_modes
            if not 1 <= r <= modes:
                raise ParameterError(f"no mode {r}: the rail has {modes} modes")
            return self.rail.field(self.rail.mode(r))
        if name in ("rail_left", "rail_right"):
            return self.rail.field(self.rail.point([0.0 if name == "rail_left" else 1.0]))
        y = rail_point(name)
        assert y is not None
        return self.rail.field(self.rail.point([y]))

    def _head_row(self, port: str) -> Row:
        """A port's row; of a shaker -M r, with what the masses of the elements add: it depends on frequency."""
        if not self.shaken(port):
            return self.row(port)
        carried = self.model.influence
        assert carried is not None
        load: ComplexArray = -(self.system.mass @ carried)[:, None] + 0 * self.s
        for a in self.assembly.elements:
            p = self.foot(a)
            load -= np.multiply.outer(p * (p @ carried), apparent_mass(a.element, self.s))
        return load

    # -- the response -------------------------------------------------------------------------------------------------------

    def between(self, output: str, input: str) -> ComplexArray:
        """Displacement of one signal per unit force at another, shape (position, frequency)."""
        q, p = self.of_port(output), self.of_port(input)
        total: ComplexArray = dot(_over_frequency(q.row), p.blocked)[None]
        if not self.interface:
            share = self.model.base_share(output) if self.shaken(input) else 0.0
            return total + share / self.s**2 if share else total
        total = total + dot(q.to_base, p.motion)
        if q.field is not None and q.at_head is not None:
            total = total + q.at_head * p.force[0]
            if p.field is not None:
                total = total + self.rail.product(q.field, p.field)
        return total


class PortReceptance:
    """What a unit force at a signal's port does; each part is computed once, when it is asked for."""

    def __init__(self, receptance: ModelReceptance, row: Row, field: RailField | None) -> None:
        self.receptance, self.row, self.field = receptance, row, field

    @cached_property
    def blocked(self) -> ComplexArray:
        """Motion of the head with its base held, shape (n, frequency)."""
        return self.receptance.held(self.row)

    @cached_property
    def to_base(self) -> ComplexArray:
        """Force on the held base, shape (interface, 1, frequency)."""
        return dot(_over_frequency(self.row)[:, None], self.receptance.following)[:, None]

    @cached_property
    def at_head(self) -> ComplexArray | None:
        """Motion of the rail where the head is, without the head, shape (position, frequency); None for a port of the head."""
        return None if self.field is None else self.receptance.rail_motion(self.field)

    @cached_property
    def _joined(self) -> tuple[ComplexArray, ComplexArray]:
        if not self.receptance.interface:
            return self.to_base, self.to_base
        return self.receptance.joined(self.to_base, self.at_head)

    @property
    def force(self) -> ComplexArray:
        """Force on the rail where the head is, shape (interface, position, frequency)."""
        return self._joined[0]

    @property
    def motion(self) -> ComplexArray:
        """Motion of the head's base, shape (interface, position, frequency)."""
        return self._joined[1]


def _over_frequency(row: Row) -> Row:
    return row[:, None] if row.ndim == 1 else row


def apparent_mass(element: Element, s: ComplexArray) -> ComplexArray:
    """What of an element's mass resists an acceleration of its foot, shape (frequency,)."""
    if isinstance(element, SprungMass):
        return element.dynamic_stiffness(s) / s**2
    return (element.mass if isinstance(element, SpringDamperMass) else 0.0) + 0 * s
