"""
Receptance of the rail between points, for all positions and frequencies at once, with derivatives.

In sine coordinates a (modal mass μL/2) the dynamic stiffness is diagonal, apart from a few extra unknowns: the ends' motions u
(released supports) and the force λ of each attachment. Eliminating the diagonal part leaves a system of that small size at
each frequency, the same for all positions. Derivatives follow from D v = p: d(qᵀ v) = dqᵀ v_p + v_qᵀ dp - v_qᵀ dD v_p.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.subsystems.rail import RIGID_INERTIA, Rail, rigid_coupling, sine_shapes, slope_shapes
from cutvib_ss.subsystems.twist import TWIST_ELEMENTS, twist_modes, twist_shapes


@dataclass(frozen=True)
class RailPort:
    """
    A port of the rail in sine coordinates.

    Parameters
    ----------
    elastic : ndarray, shape (position or 1, mode)
        Row over the sine amplitudes.
    rigid : ndarray, shape (position or 1, 2)
        Row over the ends' motions.
    """

    elastic: FloatArray
    rigid: FloatArray


@dataclass(frozen=True)
class RailField:
    """
    The rail's motion for a unit force at a port.

    Parameters
    ----------
    elastic : ndarray, shape (mode, position or 1, frequency)
        Sine amplitudes [m/N].
    rigid : ndarray, shape (2, position or 1, frequency)
        Motions of the ends [m/N]; zeros on rigid supports.
    """

    elastic: ComplexArray
    rigid: ComplexArray


class RailReceptance:
    """
    The rail at given frequencies.

    Parameters
    ----------
    model : Rail
        The rail.
    s : ndarray of complex, shape (frequency,)
        Laplace variable [rad/s].
    """

    def __init__(self, model: Rail, s: ComplexArray) -> None:
        p = model.parameters
        self.model, self.s = model, s
        self.n = p.n_modes
        self._w = (2 * np.pi * p.first_frequency * np.arange(1.0, self.n + 1) ** 2)[:, None]
        self._half = p.mass / 2
        self._damping = self._half * 2 * p.damping_ratio * self._w * s
        self._diagonal = self._half * (self._w**2 + s * s) + self._damping
        # The rigid motions' part of each mode's shape: its damping resists a_r + shared_r u.
        self._shared = 2 * rigid_coupling(self.n)
        self._damped = self._shared * (model.supports.rigid_damping if model.supports else 0.0)
        self._flexibility = 1.0 / self._diagonal
        self._attached = [self._attachment_port(k) for k in range(len(model.attachments))]

    def point(self, position: Sequence[float] | FloatArray) -> RailPort:
        """
        Port of the displacement at points of the rail.

        Parameters
        ----------
        position : array_like, shape (position,)
            y / L.

        Returns
        -------
        RailPort
            The port, one row a point.
        """
        y = np.atleast_1d(np.asarray(position, dtype=float))
        return RailPort(sine_shapes(y, self.n), np.column_stack([1.0 - y, y]))

    def mode(self, r: int) -> RailPort:
        """
        Port of the mass-normalised modal coordinate η_r = √(μL/2) a_r.

        Parameters
        ----------
        r : int
            Number of the mode, from 1.

        Returns
        -------
        RailPort
            The port.
        """
        row = np.zeros((1, self.n))
        row[0, r - 1] = np.sqrt(self._half)
        return RailPort(row, np.zeros((1, 2)))

    def _attachment_port(self, k: int) -> RailPort:
        a = self.model.attachments[k]
        if not a.slope:
            return self.point([a.position])
        length = self.model.parameters.length
        row = slope_shapes(a.position, length, self.n)[None]
        return RailPort(row, np.array([[-1.0, 1.0]]) / length)

    def direct(self, left: RailPort, right: RailPort) -> ComplexArray:
        """
        Receptance between two ports.

        Parameters
        ----------
        left, right : RailPort
            Where motion is read, and where the force acts.

        Returns
        -------
        ndarray, shape (position, frequency)
            Motion per force.
        """
        if self.model.supports is None and not self._attached:
            shapes = left.elastic * right.elastic
            # Two real products are twice as quick as numpy's promotion of the shapes to complex.
            value: ComplexArray = shapes @ self._flexibility.real + 1j * (shapes @ self._flexibility.imag)
            return value
        return self.product(left, self.field(right))

    def product(self, port: RailPort, field: RailField) -> ComplexArray:
        """
        Motion of a port in a field.

        Parameters
        ----------
        port : RailPort
            Where motion is read.
        field : RailField
            The rail's motion.

        Returns
        -------
        ndarray, shape (position, frequency)
            Its motion.
        """
        out: ComplexArray = np.einsum("pm,mpf->pf", *_fit(port.elastic, field.elastic))
        if self.model.supports is not None:
            out = out + np.einsum("pm,mpf->pf", *_fit(port.rigid, field.rigid))
        return out

    def field(self, port: RailPort) -> RailField:
        """
        The rail's motion for a unit force at a port.

        Parameters
        ----------
        port : RailPort
            Where the force acts; one row a position.

        Returns
        -------
        RailField
            The solution of D v = p.
        """
        s, g = self.s, self._flexibility
        positions = port.elastic.shape[0]
        supports, count = self.model.supports, len(self._attached)
        free = g[:, None, :] * port.elastic.T[:, :, None]
        released = 2 if supports is not None else 0
        size = released + count
        if size == 0:
            return RailField(free, np.zeros((2, positions, s.size), dtype=np.complex128))
        # Columns: how the small unknowns act on the modes. Rows: how the modes enter the small equations.
        columns = np.zeros((self.n, size, s.size), dtype=np.complex128)
        small = np.zeros((size, size, s.size), dtype=np.complex128)
        load = np.zeros((size, positions, s.size), dtype=np.complex128)
        rows = columns.copy()
        if supports is not None:
            mass = self.model.parameters.mass
            columns[:, :2] = (
                self._shared[:, :, None] * self._half * s**2 + self._damped[:, :, None] * self._damping[:, None]
            )
            rows[:, :2] = columns[:, :2]
            small[:2, :2] = mass * RIGID_INERTIA[:, :, None] * s**2
            small[:2, :2] += np.einsum("ru,rf,rv->uvf", self._damped, self._damping, self._damped)
            small[0, 0] += supports.k_left + s * supports.c_left
            small[1, 1] += supports.k_right + s * supports.c_right
            load[:2] = port.rigid.T[:, :, None]
        for k, (at, attachment) in enumerate(zip(self._attached, self.model.attachments, strict=True)):
            # λ_k = z_k pᵀ q: finite for z = 0, unlike λ_k / z_k = pᵀ q.
            i, z = released + k, attachment.element.dynamic_stiffness(s)
            columns[:, i] = at.elastic[0][:, None]
            rows[:, i] = at.elastic[0][:, None] * z
            small[i, i] = -1.0
            if released:
                small[:2, i] = at.rigid[0][:, None]
                small[i, :2] = at.rigid[0][:, None] * z
        schur = small - np.einsum("rif,rf,rjf->ijf", rows, g, columns)
        right = load - np.einsum("rif,rpf->ipf", rows, free)
        unknowns = np.linalg.solve(schur.transpose(2, 0, 1), right.transpose(2, 0, 1)).transpose(1, 2, 0)
        elastic = free - g[:, None, :] * np.einsum("rif,ipf->rpf", columns, unknowns)
        rigid = unknowns[:2] if released else np.zeros((2, positions, s.size), dtype=np.complex128)
        return RailField(elastic, rigid)

    def derivative(self, name: tuple[str | int, ...], left: RailField, right: RailField) -> ComplexArray:
        """
        -v_leftᵀ (dD/dparameter) v_right: how the receptance between two (unmoved) ports changes with a parameter.

        Parameters
        ----------
        name : tuple
            ``("mass",)``, ``("first_frequency",)``, ``("damping_ratio",)``, ``("length",)``, ``("s",)``, ``("supports",
            "k_left")`` …, or ``("attachments", k, "position")`` and the like.
        left, right : RailField
            Fields of the two ports.

        Returns
        -------
        ndarray, shape (position, frequency)
            The derivative of the receptance.
        """
        s, modal = self.s, self._modal_change(name)
        out: ComplexArray = np.zeros((max(left.elastic.shape[1], right.elastic.shape[1]), s.size), dtype=np.complex128)
        if modal is not None:
            out = out - np.einsum("mpf,mf,mpf->pf", *_same(left.elastic, modal, right.elastic))
        if self.model.supports is not None:
            out = out - self._supports_derivative(name, left, right)
        for k, at in enumerate(self._attached):
            out = out - self._attachment_derivative(name, k, at, left, right)
        return out

    def pinned_derivative(self, name: tuple[str | int, ...], left: RailPort, right: RailPort) -> ComplexArray | None:
        """
        The same on a bare pinned rail, where it is one product of matrices; None on any other.

        Parameters
        ----------
        name : tuple
            As in `derivative`.
        left, right : RailPort
            The two ports.

        Returns
        -------
        ndarray or None, shape (position, frequency)
            The derivative of the receptance.
        """
        if self.model.supports is not None or self._attached:
            return None
        shapes, modal = left.elastic * right.elastic, self._modal_change(name)
        if modal is None:
            return np.zeros((shapes.shape[0], self.s.size), dtype=np.complex128)
        change = modal * self._flexibility**2
        out: ComplexArray = -(shapes @ change.real + 1j * (shapes @ change.imag))
        return out

    def _modal_change(self, name: tuple[str | int, ...]) -> ComplexArray | None:
        """Derivative of the diagonal of D, shape (mode, frequency); None where it does not move."""
        p, s, w = self.model.parameters, self.s, self._w
        if name[0] == "mass":
            return self._diagonal / p.mass
        if name[0] == "first_frequency":
            return np.asarray(self._half * (2 * w + 2 * p.damping_ratio * s) * w / p.first_frequency)
        if name[0] == "damping_ratio":
            return self._half * 2 * w * s
        if name[0] == "s":
            return self._half * (2 * p.damping_ratio * w + 2 * s)
        return None

    def _supports_derivative(self, name: tuple[str | int, ...], left: RailField, right: RailField) -> ComplexArray:
        supports, p, s = self.model.supports, self.model.parameters, self.s
        assert supports is not None
        out: ComplexArray = np.zeros((1, s.size), dtype=np.complex128)
        if name[0] in ("mass", "first_frequency", "damping_ratio", "s"):
            change = self._half * 2 * self._w * s
            if name[0] != "damping_ratio":
                change = self._damping / (s if name[0] == "s" else getattr(p, str(name[0])))
            shared_left = np.einsum("mu,upf->mpf", self._damped, left.rigid)
            shared_right = np.einsum("mu,upf->mpf", self._damped, right.rigid)
            out = np.einsum("mpf,mf,mpf->pf", *_same(shared_left, change, right.elastic + shared_right))
            out = out + np.einsum("mpf,mf,mpf->pf", *_same(left.elastic, change, shared_right))
        if name[0] in ("mass", "s"):
            scale = s**2 if name[0] == "mass" else 2 * s * p.mass
            c = rigid_coupling(self.n)
            cross = np.einsum("mpf,mu,upf->pf", left.elastic, c, right.rigid)
            cross = cross + np.einsum("mpf,mu,upf->pf", right.elastic, c, left.rigid)
            out = out + scale * (cross + np.einsum("upf,uv,vpf->pf", left.rigid, RIGID_INERTIA, right.rigid))
        if name[0] == "s":
            for i, c_end in enumerate((supports.c_left, supports.c_right)):
                out = out + c_end * left.rigid[i] * right.rigid[i]
        elif name == ("supports", "rigid_damping"):
            moved_left = np.einsum("mu,upf->mpf", self._shared, left.rigid)
            moved_right = np.einsum("mu,upf->mpf", self._shared, right.rigid)
            both = left.elastic + supports.rigid_damping * moved_left
            out = np.einsum("mpf,mf,mpf->pf", *_same(both, self._damping, moved_right))
            both = right.elastic + supports.rigid_damping * moved_right
            out = out + np.einsum("mpf,mf,mpf->pf", *_same(moved_left, self._damping, both))
        elif name[0] == "supports":
            what, side = str(name[1]).split("_")
            i = ("left", "right").index(side)
            out = left.rigid[i] * right.rigid[i] * (s if what == "c" else 1.0)
        return out

    def _attachment_derivative(
        self, name: tuple[str | int, ...], k: int, at: RailPort, left: RailField, right: RailField
    ) -> ComplexArray:
        a, s = self.model.attachments[k], self.s
        zero: ComplexArray = np.zeros((1, s.size), dtype=np.complex128)
        if name[0] == "s" or name[:2] == ("attachments", k):
            what = "s" if name[0] == "s" else str(name[2])
            moved_left, moved_right = self.product(at, left), self.product(at, right)
            if what != "position":
                return a.element.derivative(what, s) * moved_left * moved_right
            if a.slope:
                turn = (np.pi * np.arange(1, self.n + 1)) ** 2 / self.model.parameters.length
                step = RailPort(-turn * sine_shapes(a.position, self.n), np.zeros((1, 2)))
            else:
                step = RailPort(slope_shapes(a.position, 1.0, self.n)[None], np.array([[-1.0, 1.0]]))
            product: ComplexArray = a.element.dynamic_stiffness(s) * (
                self.product(step, left) * moved_right + moved_left * self.product(step, right)
            )
            return product
        if name[0] == "length" and a.slope:
            # Slope rows go with 1/L.
            moved: ComplexArray = (
                -2 / self.model.parameters.length
                * a.element.dynamic_stiffness(s) * self.product(at, left) * self.product(at, right)
            )  # fmt: skip
            return moved
        return zero


def _fit(rows: FloatArray, field: ComplexArray) -> tuple[FloatArray, ComplexArray]:
    """Rows (position or 1, m) and a field (m, position or 1, frequency) with one number of positions."""
    positions = max(rows.shape[0], field.shape[1])
    return (
        np.broadcast_to(rows, (positions, rows.shape[1])),
        np.broadcast_to(field, (field.shape[0], positions, field.shape[2])),
    )


def _same(
    left: ComplexArray, modal: ComplexArray, right: ComplexArray
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    positions = max(left.shape[1], right.shape[1])
    shape = (left.shape[0], positions, left.shape[2])
    return np.broadcast_to(left, shape), modal, np.broadcast_to(right, shape)


def torsion_receptance(
    model: Rail, left: FloatArray, right: FloatArray, s: ComplexArray, derivative: str | None = None
) -> ComplexArray:
    """
    Twist per torque between points of the rail, or its derivative.

    Parameters
    ----------
    model : Rail
        A rail that twists.
    left, right : ndarray, shape (position,)
        y / L of twist and torque.
    s : ndarray of complex, shape (frequency,)
        Laplace variable [rad/s].
    derivative : str, optional
        ``"inertia"``, ``"torsion_frequency"``, ``"damping_ratio"`` or ``"s"``.

    Returns
    -------
    ndarray, shape (position, frequency)
        Σ ψ_s ψ_s / (J/2 (m_s s² + g_s (2ζω_1 s + ω_1²))) [rad/(N m)], as in `cutvib_ss.subsystems.twist`.
    """
    t = model.torsion
    assert t is not None
    shapes = twist_shapes(left, TWIST_ELEMENTS) * twist_shapes(right, TWIST_ELEMENTS)
    stiffness, inertia = (row[:, None] for row in twist_modes(TWIST_ELEMENTS))
    w = 2 * np.pi * t.torsion_frequency
    below = t.inertia / 2 * (stiffness * (w * w + 2 * t.damping_ratio * w * s) + inertia * s * s)
    if derivative is None:
        value: ComplexArray = shapes @ (1.0 / below)
        return value
    change = {
        "inertia": below / t.inertia,
        "torsion_frequency": t.inertia * stiffness * (w + t.damping_ratio * s) * w / t.torsion_frequency,
        "damping_ratio": t.inertia * stiffness * w * s,
        "s": t.inertia * (stiffness * t.damping_ratio * w + inertia * s),
    }[derivative]
    slope: ComplexArray = -shapes @ (change / below**2)
    return slope
