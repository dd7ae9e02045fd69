"""
Second-order mechanical systems with named ports, and the rule that joins two of them.

M q̈ + C q̇ + K q = Σ p_in f_in, y = p_out q. A *port* is a row over the degrees of freedom: where a force acts, where motion
is read, and where another system may be attached. Both uses share one row, so force and motion of a port are work-conjugate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.parts import Part, modal_parts, undamped_modes
from cutvib_ss.parameters import control_name
from cutvib_ss.results import ComplexArray, FloatArray, Quantity, read_only
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    import control


_ROUNDED = 1e-8
"""Part of the modes' own damping below which what couples two of them is rounding error of written matrices."""


@dataclass(frozen=True)
class Channel:
    """
    What a response channel reads.

    Parameters
    ----------
    port : str
        Name of the port whose motion is read.
    quantity : {"displacement", "velocity", "acceleration"}
        Which motion.
    absolute : bool, optional
        On a shaker: whether it reads absolute motion, or that relative to the base. Left out: absolute for accelerations.
    """

    port: str
    quantity: Quantity
    absolute: bool | None = None

    def __post_init__(self) -> None:
        if self.absolute is None:
            object.__setattr__(self, "absolute", self.quantity == "acceleration")


class MatrixStack(NamedTuple):
    """Mass, damping and stiffness at several positions."""

    mass: FloatArray  # Each of shape (position, n, n), symmetric [SI]
    damping: FloatArray
    stiffness: FloatArray
    dofs: tuple[str, ...]  # Names of the degrees of freedom, n


@dataclass(frozen=True)
class SecondOrder:
    """
    M q̈ + C q̇ + K q = f with named degrees of freedom and ports.

    Parameters
    ----------
    mass, damping, stiffness : array_like, shape (n, n)
        Symmetric matrices [SI]; the mass may be singular until the system is joined to another.
    dofs : sequence of str
        Names of the degrees of freedom.
    ports : mapping of str to array_like, shape (n,)
        Rows over the degrees of freedom.

    Raises
    ------
    ParameterError
        If shapes do not fit, a value is not finite, or a matrix is not symmetric.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    dofs: tuple[str, ...]
    ports: Mapping[str, FloatArray]

    def __post_init__(self) -> None:
        n = len(self.dofs)
        object.__setattr__(self, "dofs", tuple(self.dofs))
        for name in ("mass", "damping", "stiffness"):
            matrix = read_only(getattr(self, name), np.float64)
            if matrix.shape != (n, n):
                raise ParameterError(f"{name} has shape {matrix.shape}; {n} degrees of freedom need ({n}, {n})")
            if not np.isfinite(matrix).all():
                raise ParameterError(f"{name} holds a value that is not finite")
            if float(np.abs(matrix - matrix.T).max(initial=0.0)) > 1e-9 * float(np.abs(matrix).max(initial=0.0)):
                raise ParameterError(f"{name} is not symmetric")
            object.__setattr__(self, name, matrix)
        rows = {port: np.asarray(given, dtype=np.float64) for port, given in self.ports.items()}
        for port, row in rows.items():
            if row.shape != (n,):
                raise ParameterError(f"port {port!r} has {row.size} entries; there are {n} degrees of freedom")
        # One table for all: systems are built by the thousand, and checks row by row would be most of the work.
        table = read_only(np.array(list(rows.values())).reshape(len(rows), n))
        for port, finite in zip(rows, np.isfinite(table).all(axis=1), strict=True):
            if not finite:
                raise ParameterError(f"port {port!r} holds a value that is not finite")
        object.__setattr__(self, "ports", MappingProxyType(dict(zip(rows, table, strict=True))))

    def port(self, name: str) -> FloatArray:
        """The row of a port, shape (n,)."""
        if name not in self.ports:
            raise ParameterError(f"no port {name!r}; there are {', '.join(self.ports)}")
        return self.ports[name]

    def at_port(self, name: str) -> tuple[float, float]:
        """Mass that a force at a port moves at once, and stiffness against a slow one; its stiffest mode's where it floats."""
        row = self.port(name)
        mass = 1.0 / float(row @ np.linalg.solve(self.mass, row))
        squares, shapes = self.undamped
        moved = (shapes.T @ row) ** 2
        held = squares > 1e-9 * squares[-1]
        floats = float(moved[~held].sum()) > 1e-9 * float(moved.sum())
        return mass, mass * float(squares[-1]) if floats else 1.0 / float(np.sum(moved[held] / squares[held]))

    @cached_property
    def undamped(self) -> tuple[FloatArray, FloatArray]:
        """Squared frequencies of its undamped modes [rad²/s²], and their mass-normalised shapes (n, mode)."""
        return undamped_modes(self.mass, self.stiffness)

    @cached_property
    def highest_mode(self) -> tuple[float, float] | None:
        """Natural frequency [Hz] and damping ratio of the highest mode; None where nothing is held by a spring."""
        squares, shapes = self.undamped
        if not squares[-1] > 0.0:
            return None
        speed = float(np.sqrt(squares[-1]))
        return speed / (2.0 * np.pi), float(shapes[:, -1] @ self.damping @ shapes[:, -1]) / (2.0 * speed)

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """By what its parts may differ from the matrices."""
        return modal_parts(self.mass, self.damping, self.stiffness)

    @cached_property
    def least_mass(self) -> float:
        """Smallest eigenvalue of the mass matrix."""
        return float(np.linalg.eigvalsh(self.mass).min())

    @cached_property
    def coupled(self) -> np.ndarray:
        """Which of its coordinates some matrix couples to another, shape (n,)."""
        entries = np.any([m != 0.0 for m in (self.mass, self.damping, self.stiffness)], axis=0)
        among: np.ndarray = (entries & ~np.eye(len(self.dofs), dtype=bool)).any(axis=0)
        return among

    @cached_property
    def in_modes(self) -> SecondOrder:
        """The same system over the amplitudes of its undamped modes, mass-normalised, the same ports."""
        squares, shapes = self.undamped
        damping = shapes.T @ self.damping @ shapes
        own = np.sqrt(np.abs(np.diag(damping)))
        damping = np.where(np.abs(damping) > _ROUNDED * np.outer(own, own), damping, 0.0)
        modes = tuple(f"mode{r + 1}" for r in range(len(squares)))
        rows = {port: row @ shapes for port, row in self.ports.items()}
        return SecondOrder(np.eye(len(squares)), (damping + damping.T) / 2, np.diag(squares), modes, rows)

    def dynamic_stiffness(self, s: ArrayLike) -> ComplexArray:
        """
        K + s C + s² M, by definition: the slow, dense route that the closed forms are checked against, shape (frequency, n, n).
        """
        s_ = np.asarray(s, dtype=np.complex128)[:, None, None]
        dense: ComplexArray = self.stiffness + s_ * self.damping + s_**2 * self.mass
        return dense

    def state_space(
        self,
        inputs: Mapping[str, str],
        outputs: Mapping[str, tuple[str, Quantity]],
        name: str = "system",
        driven: Sequence[str] = (),
    ) -> control.StateSpace:
        """
        The system as a python-control object, forces in and motion out, some degrees of freedom perhaps driven.

        Parameters
        ----------
        inputs : mapping of str to str
            Signal name to the port on which that force acts [N or N m].
        outputs : mapping of str to (str, str)
            Signal name to port and motion quantity.
        name : str
            Name of the system.
        driven : sequence of str
            Degrees of freedom u whose motion is prescribed. Each adds the inputs ``<dof>_displacement``, ``<dof>_velocity`` and
            ``<dof>_acceleration``, and the output ``<dof>_reaction``: the force with which the system acts on what drives it.

        Returns
        -------
        control.StateSpace
            Two states for each free degree of freedom: ``x`` is √M_xx times the displacement x, then ``d_x`` √M_xx/ω₀ times its
            velocity (`state_scales`).

        Raises
        ------
        CouplingError
            If the mass matrix of the free degrees of freedom is not positive definite.

        Notes
        -----
        M_ff q̈ + C_ff q̇ + K_ff q = b_f F - M_fu ü - C_fu u̇ - K_fu u, and the reaction is
        b_u F - (M_uf q̈ + C_uf q̇ + K_uf q) - (M_uu ü + C_uu u̇ + K_uu u). ω₀ is the geometric mean of the largest and
        smallest non-zero natural frequency. Without that scaling python-control loses seven digits on lightly damped plants.
        """
        u = [self.dofs.index(d) for d in driven]
        f = [i for i in range(len(self.dofs)) if i not in u]
        n, forces = len(f), len(inputs)
        scale, w0, inner = self._scaled(f)
        matrices = (self.stiffness, self.damping, self.mass)
        drives = np.array([self.port(p) for p in inputs.values()]).reshape(forces, len(self.dofs)).T
        moved = np.stack([m[:, u] for m in matrices], axis=-1).reshape(len(self.dofs), 3 * len(u))
        pushes = np.hstack([drives, -moved])
        solved = linalg.cho_solve(inner[0], pushes[f] / scale[:, None]) / w0
        a = np.block([[np.zeros((n, n)), w0 * np.eye(n)], [-inner[1] / w0, -inner[2]]])
        b = np.vstack([np.zeros_like(solved), solved])

        def motion(row: FloatArray, order: int) -> tuple[FloatArray, FloatArray]:
            c, d = np.concatenate([row / scale, np.zeros(n)]), np.zeros(b.shape[1])
            for _ in range(order):
                c, d = c @ a, c @ b
            return c, d

        found = []
        for port, quantity in outputs.values():
            order = DERIVATIVE_ORDER[quantity]
            c, d = motion(self.port(port)[f], order)
            d[forces + 3 * np.arange(len(u)) + order] += self.port(port)[u]
            found.append((c, d))
        for i in u:
            parts = [motion(m[i, f], order) for order, m in enumerate(matrices)]
            found.append((-np.sum([c for c, _ in parts], axis=0), pushes[i] - np.sum([d for _, d in parts], axis=0)))
        names = [self.dofs[i] for i in f]
        c, d = (np.reshape(x, (len(found), -1)) for x in zip(*found, strict=True)) if found else (a[:0], b[:0])
        import control  # late: it takes long to load

        return control.ss(
            a, b, c, d,
            inputs=[*map(control_name, inputs), *(f"{d}_{q}" for d in driven for q in DERIVATIVE_ORDER)],
            outputs=[*map(control_name, outputs), *(f"{d}_reaction" for d in driven)], name=name,
            states=names + [f"d_{d}" for d in names],
        )  # fmt: skip

    def state_scales(self, driven: Sequence[str] = ()) -> dict[str, float]:
        """What each state of `state_space` is multiplied by: √M_xx of a displacement, √M_xx/ω₀ of a velocity."""
        f = [i for i, d in enumerate(self.dofs) if d not in driven]
        scale, w0, _ = self._scaled(f)
        scales = dict(zip((self.dofs[i] for i in f), scale.tolist(), strict=True))
        return scales | {f"d_{dof}": value / w0 for dof, value in scales.items()}

    def _scaled(self, f: list[int]) -> tuple[FloatArray, float, tuple[Any, FloatArray, FloatArray]]:
        """√M_ii, ω₀, and in coordinates of that scale M's factor, M⁻¹K and M⁻¹C."""
        among = np.ix_(f, f)
        with np.errstate(invalid="ignore"):
            scale = np.sqrt(np.diag(self.mass)[f])
        both = np.outer(scale, scale)
        try:
            factor = linalg.cho_factor(self.mass[among] / np.where(both > 0.0, both, 1.0), lower=True)
        except linalg.LinAlgError as error:
            raise CouplingError("the mass matrix is not positive definite: there is no state-space model") from error
        k, c = (m[among] / both for m in (self.stiffness, self.damping))
        squares = linalg.eigvalsh(k, self.mass[among] / both)
        positive = squares[squares > 1e-12 * max(float(np.abs(squares).max()), 1e-300)]
        w0 = float((positive[0] * positive[-1]) ** 0.25) if positive.size else 1.0
        return scale, w0, (factor, linalg.cho_solve(factor, k), linalg.cho_solve(factor, c))

    def attach(
        self, ports: Sequence[str | FloatArray], other: SecondOrder, other_ports: Sequence[str], prefix: str = ""
    ) -> SecondOrder:
        """
        Join another system rigidly: each of its ports moves with one of this system's, or a row, forces opposite and equal.

        With u the eliminated coordinates, u = P q, so that q_other = T (q, i) and M = M_self + Tᵀ M_other T: the primal
        assembly of dynamic substructuring, which leaves no constraint and no spurious pole.
        """
        transform, kept = self._transform(ports, other, other_ports)
        n, extra = len(self.dofs), len(kept)
        wider = np.zeros((len(self.ports), n + extra))
        wider[:, :n] = list(self.ports.values())
        mine = dict(zip(self.ports, wider, strict=True))
        carried = np.array(list(other.ports.values())) @ transform
        theirs = {
            prefix + name: row for name, row in zip(other.ports, carried, strict=True) if prefix + name not in mine
        }
        mass, damping, stiffness = self._joined(other, transform)
        return SecondOrder(
            mass, damping, stiffness, self.dofs + tuple(prefix + other.dofs[i] for i in kept), mine | theirs
        )

    def _transform(
        self, ports: Sequence[str | FloatArray], other: SecondOrder, other_ports: Sequence[str]
    ) -> tuple[FloatArray, list[int]]:
        """T, from the joined coordinates to the other system's, and which of those remain."""
        gone = []
        for name in other_ports:
            hits = np.flatnonzero(other.port(name))
            if hits.size != 1 or other.port(name)[hits[0]] != 1.0:
                raise CouplingError(f"port {name!r} is not a single degree of freedom; it cannot be joined rigidly")
            gone.append(int(hits[0]))
        kept = [i for i in range(len(other.dofs)) if i not in gone]
        n, extra = len(self.dofs), len(kept)
        transform = np.zeros((len(other.dofs), n + extra))
        for index, port in zip(gone, ports, strict=True):
            transform[index, :n] = self.port(port) if isinstance(port, str) else port
        transform[kept, n + np.arange(extra)] = 1.0
        return transform, kept

    def _joined(self, other: SecondOrder, transform: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        n = len(self.dofs)

        def joined(mine: FloatArray, theirs: FloatArray) -> FloatArray:
            out: FloatArray = transform.T @ theirs @ transform
            out[:n, :n] += mine
            return (out + out.T) / 2

        return (
            joined(self.mass, other.mass),
            joined(self.damping, other.damping),
            joined(self.stiffness, other.stiffness),
        )
