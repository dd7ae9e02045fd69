"""
How the machine depends on the head's position, exactly.

The rail's coordinates and the head's own stay what they are wherever the head stands; only the row changes by which the
rail moves the head's base, x_b = φ(y)ᵀ η (Eq. 6). So let q be all of them, and let what rides on the rail (head, attachments,
guide) have the coordinates T(y) q, in which T is affine in φ(y): a constant part, and φ(y) in the base's row. Then

    M(y) = M_rail + T(y)ᵀ M_head T(y),   and C, K likewise:

each is affine in the functions φ_r(y) and the products φ_r(y) φ_s(y), with constant matrices. On the bare machine

    M = [ I + (m1 + m2) φ φᵀ    φ m_bθ ]     C = [ diag(2ζω_r)   0  ]     K = [ diag(ω_r²)   0  ]
        [    m_θb φᵀ            M_θθ   ],        [     0        C_θ ],        [     0       K_θ ].

Nothing is interpolated or fitted. Derivatives to position follow from those of T; a head that travels needs them, and so
does the error of a table over positions. Position is y / L throughout, and derivatives are to that.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import Rail, rail
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.parameters import check_position
from cutvib_ss.results import FloatArray, read_only


@dataclass(frozen=True)
class Rider:
    """
    A coordinate of what rides that follows the rail.

    Parameters
    ----------
    dof : int
        Which of the riding coordinates.
    sign : float
        1, or -1 where the coordinate is the head's motion less the rail's.
    twist : bool
        Whether it follows the rail's twist instead of its deflection.
    """

    dof: int
    sign: float
    twist: bool


@dataclass(frozen=True)
class AffineMachine:
    """
    A machine as constant matrices and the rows that carry the position.

    Parameters
    ----------
    fixed : SecondOrder
        What does not ride, over all coordinates q; its ports do not depend on position.
    carried : SecondOrder
        What rides on the rail, over its own coordinates T q.
    still : array_like, shape (riding, n)
        The constant part of T.
    riders : tuple of Rider
        Which rows of T follow the rail.
    rail : Rail
        The rail.
    """

    fixed: SecondOrder
    carried: SecondOrder
    still: FloatArray
    riders: tuple[Rider, ...]
    rail: Rail

    @property
    def dofs(self) -> tuple[str, ...]:
        """Names of the coordinates q: the rail's, then the head's, as `Machine.second_order` has them."""
        return self.fixed.dofs

    def rail_rows(self, positions: ArrayLike, twist: bool = False, order: int = 0) -> FloatArray:
        """
        How the rail moves at points, over all coordinates, or a derivative of that to position.

        Parameters
        ----------
        positions : array_like, shape (position,)
            y / L.
        twist : bool
            The twist there instead of the deflection.
        order : int
            Order of the derivative to y / L.

        Returns
        -------
        ndarray, shape (position, n)
            The rows.

        Raises
        ------
        CouplingError
            If a derivative of the twist is asked for, of which one coordinate belongs to the place of the head.

        Notes
        -----
        dᵏ/dyᵏ sin(rπy) = (rπ)ᵏ sin(rπy + kπ/2); ends that give add 1 - y and y.
        """
        y = np.atleast_1d(np.asarray(positions, dtype=float))
        rows = np.zeros((y.size, len(self.dofs)))
        if twist:
            if order:
                raise CouplingError(
                    "one coordinate of the rail's twist belongs to the place of the head and has no derivatives along the rail"
                )
            shapes = np.array([rail(self.rail, {"here": place}).port("here_twist") for place in y])
            rows[:, : shapes.shape[1]] = shapes
            return rows
        modes, scale = self.rail.modes, np.sqrt(2.0 / self.rail.parameters.mass)
        turn = np.pi * modes.number
        m = turn.size
        rows[:, :m] = scale * modes.deflection * turn**order * np.sin(np.outer(y, turn) + order * np.pi / 2)
        if self.rail.supports is not None and order < 2:
            rows[:, m], rows[:, m + 1] = (1.0 - y, y) if order == 0 else (-1.0, 1.0)
        return rows

    def rail_row(self, position: float, twist: bool = False, order: int = 0) -> FloatArray:
        """
        How the rail moves at one point.

        Parameters
        ----------
        position : float
            y / L.
        twist : bool
            As for `rail_rows`.
        order : int
            As for `rail_rows`.

        Returns
        -------
        ndarray, shape (n,)
            The row.
        """
        return np.array(self.rail_rows([position], twist, order)[0])

    def rail_row_bound(self, order: int) -> FloatArray:
        """
        Largest modulus over the whole rail of each entry of `rail_row`, for the deflection.

        Parameters
        ----------
        order : int
            Order of the derivative to y / L.

        Returns
        -------
        ndarray, shape (n,)
            The bounds.
        """
        row = np.zeros(len(self.dofs))
        modes, scale = self.rail.modes, np.sqrt(2.0 / self.rail.parameters.mass)
        m = modes.number.size
        row[:m] = scale * np.abs(modes.deflection) * (np.pi * modes.number) ** order
        if self.rail.supports is not None:
            row[m : m + 2] = float(order < 2)
        return row

    def transform(self, position: float, order: int = 0) -> FloatArray:
        """
        T(y), or a derivative of it to position.

        Parameters
        ----------
        position : float
            y / L.
        order : int
            Order of the derivative.

        Returns
        -------
        ndarray, shape (riding, n)
            The matrix.
        """
        out: FloatArray = np.zeros_like(self.still) if order else self.still.copy()
        for r in self.riders:
            out[r.dof] += r.sign * self.rail_row(position, r.twist, order)
        return out

    def transform_bound(self, order: int) -> FloatArray:
        """
        Largest modulus over the whole rail of each entry of T or its derivative.

        Parameters
        ----------
        order : int
            Order of the derivative.

        Returns
        -------
        ndarray, shape (riding, n)
            The bounds.

        Raises
        ------
        CouplingError
            If the rail twists.
        """
        out: FloatArray = np.zeros_like(self.still) if order else np.abs(self.still)
        for r in self.riders:
            if r.twist:
                raise CouplingError(
                    "one coordinate of the rail's twist belongs to the place of the head; it has no bounds"
                )
            out[r.dof] += self.rail_row_bound(order)
        return out

    def matrices(self, position: float, order: int = 0) -> tuple[FloatArray, FloatArray, FloatArray]:
        """
        M, C and K at a position, or their derivatives to it.

        Parameters
        ----------
        position : float
            y / L.
        order : int
            Order of the derivative.

        Returns
        -------
        mass, damping, stiffness : ndarray, shape (n, n)
            The matrices.

        Notes
        -----
        By Leibniz' rule, (TᵀXT)⁽ᵈ⁾ = Σ_k (d over k) T⁽ᵏ⁾ᵀ X T⁽ᵈ⁻ᵏ⁾.
        """
        t = [self.transform(position, k) for k in range(order + 1)]
        out = []
        for name in ("mass", "damping", "stiffness"):
            x = getattr(self.carried, name)
            total = sum(comb(order, k) * (t[k].T @ x @ t[order - k]) for k in range(order + 1))
            out.append(total if order else total + getattr(self.fixed, name))
        return out[0], out[1], out[2]

    def matrices_bound(self, order: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """
        Largest moduli over the whole rail of the entries of a derivative of M, C and K.

        Parameters
        ----------
        order : int
            Order of the derivative, at least 1.

        Returns
        -------
        mass, damping, stiffness : ndarray, shape (n, n)
            Bounds; not the smallest there are.
        """
        t, d = [self.transform_bound(k) for k in range(order + 1)], order
        riding = (np.abs(x) for x in (self.carried.mass, self.carried.damping, self.carried.stiffness))
        m, c, k = (np.sum([comb(d, i) * (t[i].T @ x @ t[d - i]) for i in range(d + 1)], axis=0) for x in riding)
        return m, c, k

    def port(self, name: str, position: float, order: int = 0) -> FloatArray:
        """
        The row of a port at a position, or its derivative to it.

        Parameters
        ----------
        name : str
            Name of the port.
        position : float
            y / L.
        order : int
            Order of the derivative.

        Returns
        -------
        ndarray, shape (n,)
            The row.

        Raises
        ------
        ParameterError
            If there is no such port.
        """
        if name in ("base", "at_head"):
            return self.rail_row(position, order=order)
        if name == "at_head_twist":
            return self.rail_row(position, twist=True, order=order)
        if name in self.fixed.ports:
            return np.zeros(len(self.dofs)) if order else np.array(self.fixed.port(name))
        row: FloatArray = self.carried.port(name) @ self.transform(position, order)
        return row

    def second_order(self, position: float) -> SecondOrder:
        """
        The machine at a position, as `Machine.second_order` gives it.

        Parameters
        ----------
        position : float
            y_b / L of the head, strictly inside (0, 1).

        Returns
        -------
        SecondOrder
            The same matrices and ports.
        """
        place = check_position(position)
        twist = ["at_head_twist"] if any(r.twist for r in self.riders) else []
        names = [*self.fixed.ports, "base", "at_head", *twist, *self.carried.ports]
        return SecondOrder(*self.matrices(place), self.dofs, {name: self.port(name, place) for name in names})


def affine_machine(
    machine: Machine, viscous_at: float | None = None, points: Mapping[str, float] | None = None
) -> AffineMachine:
    """
    A machine's dependence on position, exactly.

    Parameters
    ----------
    machine : Machine
        The machine; nonlinear elements and the measurement chain are left aside.
    viscous_at : float, optional
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.
    points : mapping of str to float, optional
        More ports along the rail: name to y / L.

    Returns
    -------
    AffineMachine
        Constant matrices, and the rows that carry the position.

    Raises
    ------
    CouplingError
        If damping is hysteretic and no ``viscous_at`` is given.

    Notes
    -----
    The bare head rides with its base on the rail. With a guide that gives, the base keeps a coordinate of its own and the
    guide's stretch, base less rail, rides instead.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> exact = affine_machine(published_machine())
    >>> [round(float(value), 3) for value in exact.rail_row(0.5)]
    [0.162, 0.0, -0.162, 0.0, 0.0, 0.0]
    """
    beam, head = machine.rail_system(0.5, points), machine.head_system(viscous_at)
    n_rail = len(beam.dofs)
    base = head.dofs.index("base")
    twist = [head.dofs.index("twist")] if machine.rail.torsion else []
    riders = [Rider(i, 1.0, True) for i in twist]
    if machine.guide is None:
        carried = head
        kept = [i for i in range(len(head.dofs)) if i not in (base, *twist)]
        riders.append(Rider(base, 1.0, False))
        dofs = (*beam.dofs, *(head.dofs[i] for i in kept))
    else:
        carried = _with_guide(head, machine.guide.stiffness, machine.guide.damping)
        kept = [i for i in range(len(head.dofs)) if i not in twist]
        riders.append(Rider(len(head.dofs), -1.0, False))
        dofs = (*beam.dofs, *(f"head_{d}" if d == "base" else d for d in (head.dofs[i] for i in kept)))
    still = np.zeros((len(carried.dofs), len(dofs)))
    still[kept, n_rail + np.arange(len(kept))] = 1.0
    if machine.guide is not None:
        still[-1] = still[base]
    moving = ("base", "at_head", "at_head_twist")
    padded = {name: np.pad(row, (0, len(kept))) for name, row in beam.ports.items() if name not in moving}
    mass, damping, stiffness = (np.pad(m, (0, len(kept))) for m in (beam.mass, beam.damping, beam.stiffness))
    fixed = SecondOrder(mass, damping, stiffness, dofs, padded)
    return AffineMachine(fixed, carried, read_only(still), tuple(riders), machine.rail)


def _with_guide(head: SecondOrder, stiffness: float, damping: float) -> SecondOrder:
    """The head and, as one coordinate more, the guide's stretch."""
    n = len(head.dofs)

    def grown(matrix: FloatArray, corner: float) -> FloatArray:
        out = np.zeros((n + 1, n + 1))
        out[:n, :n], out[n, n] = matrix, corner
        return out

    ports = {("head_base" if name == "base" else name): np.append(row, 0.0) for name, row in head.ports.items()}
    return SecondOrder(
        grown(head.mass, 0.0),
        grown(head.damping, damping),
        grown(head.stiffness, stiffness),
        (*head.dofs, "guide"),
        ports,
    )
