"""
Receptance of the rail between points, for all positions and frequencies at once.

In the pinned modes' amplitudes a (modal mass μL/2) the dynamic stiffness is diagonal, apart from a few extra unknowns x: the ends'
motions u (released supports) and the force λ of each attachment. Eliminating the diagonal part leaves a system of that small
size at each frequency, the same for all ports. With g the diagonal's inverse, C the columns by which x acts on the modes, and a
port's row (e, h) over modes and rigid motions,

    w = (h, 0) - Cᵀ g e,   x = S⁻¹ z w,   a = g (e - C x),   H_lr = e_lᵀ g e_r + w_lᵀ x_r,

S being the Schur complement; z, one for the ends and its dynamic stiffness for an attachment, multiplies the attachments'
equations, so that one of no stiffness is none. Derivatives are in `cutvib_ss.response.rail_derivatives`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cutvib_ss.model.rail import Rail
from cutvib_ss.response.batched import dot, inverse, mixed
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class RailPort:
    """A port of the rail."""

    elastic: FloatArray  # Row over the modes' amplitudes
    rigid: FloatArray  # Row over the ends' motions
    position: FloatArray | None = None  # y / L, where the port is the displacement of points


class RailReceptance:
    """The rail at given frequencies."""

    def __init__(self, model: Rail, s: ComplexArray) -> None:
        p = model.parameters
        self.model, self.s, self.modes = model, s, model.modes
        self.half = p.mass / 2
        self.w: FloatArray = 2 * np.pi * p.first_frequency * self.modes.frequency
        self.damped_w: FloatArray = model.damping_weight * self.w
        self.strained: ComplexArray = 1.0 + p.strain_damping * s  # stiffness, with what the rate of strain adds
        below = np.multiply.outer(2 * self.half * p.damping_ratio * self.damped_w, s)
        below += self.half * s * s
        below += np.multiply.outer(self.half * self.w**2, self.strained)
        self.flexibility: ComplexArray = np.reciprocal(below)
        self.released = 2 if model.supports is not None else 0
        self.attached = tuple(self._attachment_port(k) for k in range(len(model.attachments)))
        self.pinned = not self.released and not self.attached

    @cached_property
    def flexibility_squared(self) -> ComplexArray:
        """Squares of the modes' flexibilities, shape (mode, frequency)."""
        return self.flexibility * self.flexibility

    # -- ports --------------------------------------------------------------------------------------------------------------

    def point(self, position: Sequence[float] | FloatArray) -> RailPort:
        """Port of the displacement at points of the rail."""
        y = np.atleast_1d(np.asarray(position, dtype=float))
        return RailPort(self.modes.deflections(y), np.column_stack([1.0 - y, y]), y)

    def mode(self, r: int) -> RailPort:
        """Port of the mass-normalised modal coordinate η_r = √(μL/2) a_r."""
        row = np.zeros((1, self.w.size))
        row[0, r - 1] = np.sqrt(self.half)
        return RailPort(row, np.zeros((1, 2)))

    def _attachment_port(self, k: int) -> RailPort:
        a = self.model.attachments[k]
        if not a.slope:
            return self.point([a.position])
        length = self.model.parameters.length
        return RailPort(self.modes.rotations(a.position)[None] / length, np.array([[-1.0, 1.0]]) / length)

    # -- the small unknowns -------------------------------------------------------------------------------------------------

    @cached_property
    def _columns(self) -> tuple[FloatArray, ComplexArray, tuple[int, ...]]:
        """C as Σ vector · factor(s): vectors (term, mode), factors (term, frequency), and the unknown of each term."""
        s, supports = self.s, self.model.supports
        vectors, factors, unknowns = [], [], []
        if supports is not None:
            # The rigid motions' part of each mode's shape is 2 c u: inertia resists it.
            for j in range(2):
                vectors.append(2 * self.modes.coupling[:, j])
                factors.append(self.half * s * s)
                unknowns.append(j)
        for k, at in enumerate(self.attached):
            vectors.append(at.elastic[0])
            factors.append(np.ones(s.size, dtype=np.complex128))
            unknowns.append(self.released + k)
        return np.array(vectors), np.array(factors), tuple(unknowns)

    @cached_property
    def _core(self) -> tuple[ComplexArray, ComplexArray]:
        """S⁻¹, shape (unknown, unknown, frequency), and z, shape (unknown, frequency)."""
        s, supports, p = self.s, self.model.supports, self.model.parameters
        size = self.released + len(self.attached)
        schur = np.zeros((size, size, s.size), dtype=np.complex128)
        z = np.ones((size, s.size), dtype=np.complex128)
        if supports is not None:
            schur[:2, :2] = p.mass * self.modes.rigid_inertia[:, :, None] * (s * s)
            for i, end in enumerate(supports.elements):
                schur[i, i] += end.dynamic_stiffness(s)
        for k, (at, attachment) in enumerate(zip(self.attached, self.model.attachments, strict=True)):
            i = self.released + k
            z[i] = attachment.element.dynamic_stiffness(s)
            if supports is not None:
                schur[:2, i] = schur[i, :2] = at.rigid[0][:, None]
        vectors, factors, unknowns = self._columns
        through = mixed(vectors[:, None, :] * vectors, self.flexibility)
        for a, i in enumerate(unknowns):
            for b, j in enumerate(unknowns):
                schur[i, j] -= factors[a] * factors[b] * through[a, b]
        schur *= z[:, None]
        attached = np.arange(self.released, size)
        schur[attached, attached] -= 1.0
        return inverse(schur), z

    # -- motion -------------------------------------------------------------------------------------------------------------

    def field(self, port: RailPort) -> RailField:
        """The rail's motion for a unit force at a port."""
        return RailField(self, port)

    def product(self, left: RailField, right: RailField) -> ComplexArray:
        """Receptance between two ports, shape (position, frequency)."""
        direct = mixed(left.port.elastic * right.port.elastic, self.flexibility)
        return direct if self.pinned else direct + dot(left.load, right.unknowns)

    def load(self, port: RailPort) -> ComplexArray:
        """The load w that a unit force at a port puts on the small unknowns, shape (unknown, position or 1, frequency)."""
        vectors, factors, unknowns = self._columns
        size = self.released + len(self.attached)
        load = np.zeros((size, port.elastic.shape[0], self.s.size), dtype=np.complex128)
        if self.released:
            load[:2] = port.rigid.T[:, :, None]
        through = mixed(vectors[:, None, :] * port.elastic, self.flexibility)
        for factor, j, passed in zip(factors, unknowns, through, strict=True):
            load[j] -= factor * passed
        return load

    def answered(self, load: ComplexArray) -> ComplexArray:
        """The small unknowns x = S⁻¹ z w, shape (unknown, position or 1, frequency)."""
        core, z = self._core
        scaled = z[:, None] * load
        return np.array([dot(row[:, None], scaled) for row in core])

    def spread(self, unknowns: ComplexArray) -> ComplexArray:
        """How the small unknowns act on the modes, C x, shape (mode, position or 1, frequency)."""
        vectors, factors, of = self._columns
        return mixed(vectors.T, factors[:, None] * unknowns[list(of)])


class RailField:
    """The rail's motion for a unit force at a port; each part is computed once, when it is asked for."""

    def __init__(self, rail: RailReceptance, port: RailPort) -> None:
        self.rail, self.port = rail, port

    @cached_property
    def load(self) -> ComplexArray:
        """The load on the small unknowns, shape (unknown, position or 1, frequency)."""
        return self.rail.load(self.port)

    @cached_property
    def unknowns(self) -> ComplexArray:
        """The small unknowns, shape (unknown, position or 1, frequency): the ends' motions, the attachments' forces."""
        return self.rail.answered(self.load)

    @cached_property
    def elastic(self) -> ComplexArray:
        """The modes' amplitudes [m/N], shape (mode, position or 1, frequency)."""
        through = self.port.elastic.T[:, :, None]
        if self.rail.pinned:
            pinned: ComplexArray = self.rail.flexibility[:, None] * through
            return pinned
        out: ComplexArray = self.rail.flexibility[:, None] * (through - self.rail.spread(self.unknowns))
        return out

    @property
    def rigid(self) -> ComplexArray:
        """The ends' motions [m/N], shape (2, position or 1, frequency); only where they give."""
        return self.unknowns[:2]
