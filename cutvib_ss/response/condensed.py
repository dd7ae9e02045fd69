"""
Frequency responses in closed form: the head condensed to its base, the rail condensed to its receptance there.

Let u be the motion where head and rail meet (one displacement; with twist also a rotation) and R the force on the rail. The head
alone, its base held, answers a force at port p with T_p (force on the base) and H0_qp (motion); its dynamic stiffness at the base
is Z. The rail's receptance there is A, with the guide's compliance in series; a_p is its motion there for a force at one of its
own ports. Then

    R_p = (1 + Z A)^-1 (T_p - Z a_p),   u_p = A R_p + a_p,   H_qp = H0_qp + a_qp + T_qᵀ u_p + a_qᵀ R_p.

T, Z and H0 depend on frequency alone, A and a on position too: one scalar carries the position. By reciprocity a change of any
part moves the response by

    dH_qp = dH0_qp + da_qp + dT_qᵀ u_p + u_qᵀ dT_p + da_qᵀ R_p + R_qᵀ da_p - u_qᵀ dZ u_p + R_qᵀ dA R_p,

so all derivatives are analytic. A structure without a rail has no u: H0 is all.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, cast

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.machine import CUTTING_SIGNALS, Machine
from cutvib_ss.parameters import check_number, check_position
from cutvib_ss.response.rail_receptance import RailField, RailPort, RailReceptance, torsion_receptance
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.slots import Path, value_at
from cutvib_ss.structure import Structure
from cutvib_ss.subsystems.elements import Attachment, SprungMass
from cutvib_ss.subsystems.head import head, head_row_derivatives

Rows: TypeAlias = dict[str, FloatArray]
Row: TypeAlias = FloatArray | ComplexArray


@dataclass(frozen=True)
class _HeadPart:
    """A port as the head sees it, its base held: blocked motion, and force on the base."""

    blocked: ComplexArray  # (frequency, n), the base's entries zero
    to_base: ComplexArray  # (ni, 1, frequency)


@dataclass(frozen=True)
class _RailPart:
    """A port of the rail: its motion where the head is, per unit force."""

    port: RailPort | None  # None for a port of the head
    field: RailField | None
    at_head: ComplexArray  # (ni, position or 1, frequency)


class CondensedModel:
    """
    A model at given positions and frequencies.

    Parameters
    ----------
    model : Machine or Structure
        The model; its measurement chain is not applied here.
    positions : array_like, shape (position,)
        y_b / L; one NaN for a structure.
    s : ndarray of complex, shape (frequency,)
        Laplace variable [rad/s].
    """

    def __init__(self, model: Machine | Structure, positions: FloatArray, s: ComplexArray) -> None:
        self.model, self.positions, self.s = model, np.atleast_1d(positions), s
        self._head_cache: dict[str, _HeadPart] = {}
        self._rail_cache: dict[str, _RailPart] = {}
        self._motion_cache: dict[str, tuple[list[ComplexArray], list[ComplexArray]]] = {}
        self._change_cache: dict[Path, tuple[Rows, ComplexArray | None, ComplexArray | None]] = {}
        self._rail_change_cache: dict[Path, ComplexArray] = {}
        if isinstance(model, Machine):
            torsion = model.rail.torsion
            system = head(model.head, torsion is not None, torsion.eccentricity if torsion else 0.0)
            self.interface = [2, 3] if torsion else [2]
        else:
            system = model.scaled
            self.interface = []
        self.rows: Rows = {name: np.asarray(row) for name, row in system.ports.items()}
        self._system = system
        self._free = [i for i in range(len(system.dofs)) if i not in self.interface]
        e = np.asarray(system.dynamic_stiffness(s))
        for a in model.attachments:
            p = self._row(a.port)
            e = e + a.element.dynamic_stiffness(s)[:, None, None] * np.outer(p, p)
        f, u = self._free, self.interface
        self._inverse = _inverse(e[:, f][:, :, f])
        self._phi = np.zeros((s.size, len(system.dofs), len(u)), dtype=np.complex128)
        if u:
            self._phi[:, f] = -self._inverse @ e[:, f][:, :, u]
            self._phi[:, u] = np.eye(len(u))
            z = e[:, u][:, :, u] + e[:, u][:, :, f] @ self._phi[:, f]
            self.z = z.transpose(1, 2, 0)[:, :, None, :]
            self._join_rail()

    # -- the two sides ------------------------------------------------------------------------------------------------------

    def _row(self, port: str) -> FloatArray:
        if port not in self.rows:
            raise ParameterError(f"no port {port!r}; there are {', '.join(self.rows)}")
        return self.rows[port]

    def _join_rail(self) -> None:
        model = self.model
        assert isinstance(model, Machine)
        self.rail = RailReceptance(model.rail, self.s)
        at = self.rail.point(self.positions)
        ni = len(self.interface)
        own = np.zeros((ni, ni, self.positions.size, self.s.size), dtype=np.complex128)
        own[0, 0] = self.rail.direct(at, at)
        if model.rail.torsion:
            own[1, 1] = torsion_receptance(model.rail, self.positions, self.positions, self.s)
        self.own = own
        total = own
        if model.guide is not None:
            total = own.copy()
            total[0, 0] += model.guide.compliance(self.s)
        self.total = total
        # (1 + Z A)^-1, one or two unknowns.
        one = [[float(i == j) + _dot(self.z[i], total[:, j]) for j in range(ni)] for i in range(ni)]
        if ni == 1:
            self._solver = [[1.0 / one[0][0]]]
        else:
            determinant = one[0][0] * one[1][1] - one[0][1] * one[1][0]
            self._solver = [
                [one[1][1] / determinant, -one[0][1] / determinant],
                [-one[1][0] / determinant, one[0][0] / determinant],
            ]
        self._at = at
        self._base_field: RailField | None = None

    @property
    def base_field(self) -> RailField:
        """The rail's motion for a unit force under the head."""
        if self._base_field is None:
            self._base_field = self.rail.field(self._at)
        return self._base_field

    def _head_part(self, name: str) -> _HeadPart:
        if name not in self._head_cache:
            row = self.head_row(name)
            f, u = self._free, self.interface
            blocked = np.zeros((self.s.size, row.shape[-1]), dtype=np.complex128)
            to_base = np.zeros((len(u), 1, self.s.size), dtype=np.complex128)
            if row.any():
                blocked[:, f] = (self._inverse @ row[..., f, None])[..., 0]
                if u:
                    to_base = np.einsum("...i,fij->jf", row, self._phi)[:, None, :]
            self._head_cache[name] = _HeadPart(blocked, to_base)
        return self._head_cache[name]

    def head_row(self, name: str) -> Row:
        """
        A signal's row over the head's degrees of freedom; zeros for signals of the rail.

        Parameters
        ----------
        name : str
            Signal or port.

        Returns
        -------
        ndarray, shape (n,) or (frequency, n)
            The row; it depends on frequency for a base acceleration that also shakes sprung masses.
        """
        if self._is_rail(name):
            return np.zeros(len(self._system.dofs))
        if isinstance(self.model, Structure) and name == "force":
            if self.model.input_quantity == "acceleration":
                return self._base_inertia()
            return self._row(self.model.input_port)
        if isinstance(self.model, Structure) and name in self.model.channels:
            return self._row(self.model.channels[name].port)
        return self._row(CUTTING_SIGNALS.get(name, name) if isinstance(self.model, Machine) else name)

    def _base_inertia(self) -> ComplexArray:
        """Force of a unit base acceleration, -M p, with what the attachments' masses add."""
        assert isinstance(self.model, Structure)
        carried = self._row(self.model.input_port)
        load = cast(ComplexArray, -(self._system.mass @ carried) + np.zeros((self.s.size, 1), dtype=np.complex128))
        for a in self.model.attachments:
            p = self._row(a.port)
            load -= _apparent_mass(a, self.s)[:, None] * p * (p @ carried)
        return load

    def _is_rail(self, name: str) -> bool:
        if not isinstance(self.model, Machine):
            return False
        if name in ("rail_left", "rail_right") or re.fullmatch(r"eta\d+|rail\(.*\)", name):
            return True
        return self.model.guide is not None and CUTTING_SIGNALS.get(name, name) == "base"

    def _rail_part(self, name: str) -> _RailPart:
        if name not in self._rail_cache:
            self._rail_cache[name] = self._make_rail_part(name)
        return self._rail_cache[name]

    def _make_rail_part(self, name: str) -> _RailPart:
        ni = len(self.interface)
        if not self._is_rail(name):
            return _RailPart(None, None, np.zeros((ni, 1, self.s.size), dtype=np.complex128))
        assert isinstance(self.model, Machine)
        if CUTTING_SIGNALS.get(name, name) == "base":
            return _RailPart(self._at, self.base_field, self.own[:, 0])
        if name.startswith("eta"):
            r = int(name[3:])
            if not 1 <= r <= self.model.rail.parameters.n_modes:
                raise ParameterError(f"no mode {r}: the rail has {self.model.rail.parameters.n_modes} modes")
            port = self.rail.mode(r)
        elif name in ("rail_left", "rail_right"):
            port = self.rail.point([0.0 if name == "rail_left" else 1.0])
        else:
            try:
                y = float(name[5:-1])
            except ValueError:
                raise ParameterError(f"signal {name!r}: write rail(0.25) for the rail at a quarter") from None
            port = self.rail.point([check_position(y)])
        at_head = np.zeros((ni, self.positions.size, self.s.size), dtype=np.complex128)
        at_head[0] = self.rail.product(port, self.base_field)
        return _RailPart(port, self.rail.field(port), at_head)

    def _motion(self, name: str) -> tuple[list[ComplexArray], list[ComplexArray]]:
        """Force on the rail and motion where head and rail meet, per unit force at a port."""
        if name not in self._motion_cache:
            ni = len(self.interface)
            t, a = self._head_part(name).to_base, self._rail_part(name).at_head
            load = [t[i] - _dot(self.z[i], a) for i in range(ni)]
            force = [_dot(self._solver[i], load) for i in range(ni)]
            motion = [_dot(self.total[i], force) + a[i] for i in range(ni)]
            self._motion_cache[name] = (force, motion)
        return self._motion_cache[name]

    # -- the response and its derivatives -----------------------------------------------------------------------------------

    def receptance(self, output: str, input: str) -> ComplexArray:
        """
        Displacement of one signal per unit force at another.

        Parameters
        ----------
        output, input : str
            Signals or ports.

        Returns
        -------
        ndarray, shape (position, frequency)
            The receptance [m/N].
        """
        held = np.einsum("...i,fi->f", self.head_row(output), self._head_part(input).blocked)
        if not self.interface:
            return cast(ComplexArray, held[None, :])
        q, p = self._rail_part(output), self._rail_part(input)
        force, motion = self._motion(input)
        total = held + _dot(self._head_part(output).to_base, motion)
        if q.port is not None:
            total = total + _dot(q.at_head, force)
            if p.field is not None:
                total = total + self.rail.product(q.port, p.field)
        return cast(ComplexArray, total)

    def derivative(self, path: Path, output: str, input: str) -> ComplexArray:
        """
        Derivative of a receptance to one of the model's values.

        Parameters
        ----------
        path : tuple of str and int
            The value's path, as `slots.value_at` takes it, or ``("s",)`` for the Laplace variable itself.
        output, input : str
            Signals or ports.

        Returns
        -------
        ndarray, shape (position, frequency)
            The derivative.

        Raises
        ------
        ParameterError
            If the response has no derivative to that value.
        """
        d_rows, d_e, dz = self._changes(path)
        q_part, p_part = self._head_part(output), self._head_part(input)
        dq, dp = self._row_change(path, output, d_rows), self._row_change(path, input, d_rows)
        held = np.sum(dq * p_part.blocked, axis=1) + np.sum(dp * q_part.blocked, axis=1)
        if d_e is not None:
            pushed = (d_e @ p_part.blocked[:, :, None])[..., 0]
            held = held - np.sum(q_part.blocked * pushed, axis=1)
        if not self.interface:
            return cast(ComplexArray, held[None, :])
        (force_q, motion_q), (force_p, motion_p) = self._motion(output), self._motion(input)
        out = held + _dot(self._base_change(q_part, dq, d_e), motion_p)
        out = out + _dot(motion_q, self._base_change(p_part, dp, d_e))
        if dz is not None:
            out = out - sum(dz[i, j] * motion_q[i] * motion_p[j] for i in range(len(dz)) for j in range(len(dz)))
        out = out + self._rail_change(path, output, input, force_q, force_p)
        if path == ("rail", "parameters", "mass"):
            # A modal coordinate is normalised by the mass, so its own row moves too.
            normalised = sum(_is_modal(name) for name in (output, input))
            out = out + normalised / (2 * value_at(self.model, path)) * self.receptance(output, input)
        return cast(ComplexArray, out)

    def _changes(self, path: Path) -> tuple[Rows, ComplexArray | None, ComplexArray | None]:
        """How the head's rows, dynamic stiffness and stiffness at the base move with a value."""
        if path not in self._change_cache:
            d_rows = self._row_changes(path)
            d_e = self._stiffness_change(path, d_rows)
            dz = None
            if d_e is not None and self.interface:
                dz = np.swapaxes(self._phi, 1, 2) @ (d_e @ self._phi)
                dz = dz.transpose(1, 2, 0)
            self._change_cache[path] = (d_rows, d_e, dz)
        return self._change_cache[path]

    def _base_to_base(self, name: Path) -> ComplexArray:
        """Derivative of the rail's receptance under the head."""
        if name not in self._rail_change_cache:
            plain = self.rail.pinned_derivative(name, self._at, self._at)
            if plain is None:
                plain = self.rail.derivative(name, self.base_field, self.base_field)
            self._rail_change_cache[name] = plain
        return self._rail_change_cache[name]

    def _base_change(self, part: _HeadPart, d_row: Row, d_e: ComplexArray | None) -> ComplexArray:
        change = np.einsum("...i,fij->jf", d_row, self._phi)
        if d_e is not None:
            change = change - ((part.blocked[:, None, :] @ d_e) @ self._phi)[:, 0].T
        return cast(ComplexArray, change[:, None, :])

    def _row_changes(self, path: Path) -> Rows:
        """How the head's rows move with a value."""
        model = self.model
        if not isinstance(model, Machine):
            return {}
        torsion = model.rail.torsion
        twist, e = torsion is not None, torsion.eccentricity if torsion else 0.0
        if path[0] == "head":
            return head_row_derivatives(model.head, str(path[1]), twist, e)
        if path == ("rail", "torsion", "eccentricity"):
            return {
                name: np.array([0.0, 0.0, 0.0, row[2]]) for name, row in self.rows.items() if row[2] and name != "base"
            }
        return {}

    def _row_change(self, path: Path, name: str, d_rows: Rows) -> Row:
        n = len(self._system.dofs)
        if isinstance(self.model, Structure) and name == "force" and self.model.input_quantity == "acceleration":
            return self._base_inertia_change(path)
        if self._is_rail(name):
            return np.zeros(n)
        return d_rows.get(CUTTING_SIGNALS.get(name, name), np.zeros(n))

    def _base_inertia_change(self, path: Path) -> Row:
        assert isinstance(self.model, Structure)
        carried = self._row(self.model.input_port)
        if path == ("scales", 0):
            return -(self.model.system.mass @ carried)
        if path[0] == "attachments" or path == ("s",):
            out = np.zeros((self.s.size, carried.size), dtype=np.complex128)
            for k, a in enumerate(self.model.attachments):
                if path == ("s",) or path[1] == k:
                    p, name = self._row(a.port), "s" if path == ("s",) else str(path[-1])
                    out -= _apparent_mass_change(a, name, self.s)[:, None] * p * (p @ carried)
            return out
        return np.zeros(carried.size)

    def _stiffness_change(self, path: Path, d_rows: Rows) -> ComplexArray | None:
        """dE: how the head's dynamic stiffness moves with a value; None where it does not."""
        model, s = self.model, self.s[:, None, None]
        out: ComplexArray | None = None
        if path == ("s",):
            out = self._system.damping + 2 * s * self._system.mass
        elif path[0] == "scales" and isinstance(model, Structure):
            power = (s**2, s, s**0)[int(path[1])]
            matrix = (model.system.mass, model.system.damping, model.system.stiffness)[int(path[1])]
            out = power * matrix
        elif path[0] == "head" and isinstance(model, Machine):
            out = self._head_change(model, str(path[1]), d_rows)
        elif path == ("rail", "torsion", "eccentricity"):
            out = s**2 * self._mass_change(d_rows)
        for k, a in enumerate(model.attachments):
            p, dp = self._row(a.port), d_rows.get(a.port)
            if path == ("s",) or path[:2] == ("attachments", k):
                dz = a.element.derivative("s" if path == ("s",) else str(path[-1]), self.s)
                out = _plus(out, dz[:, None, None] * np.outer(p, p))
            if dp is not None:
                z = a.element.dynamic_stiffness(self.s)[:, None, None]
                out = _plus(out, z * (np.outer(dp, p) + np.outer(p, dp)))
        return out

    def _head_change(self, model: Machine, name: str, d_rows: Rows) -> ComplexArray:
        n = len(self._system.dofs)
        s = self.s[:, None, None]
        if name in ("k1", "k2", "c1", "c2"):
            j = int(name[1]) - 1
            unit = np.zeros((n, n))
            unit[j, j] = 1.0
            return (s if name[0] == "c" else s**0) * unit
        if name in ("m1", "m2"):
            x, z = ("head_x", "head_z") if name == "m1" else ("tool_x", "tool_z")
            change = np.outer(self.rows[x], self.rows[x]) + np.outer(self.rows[z], self.rows[z])
            return s**2 * change
        return s**2 * self._mass_change(d_rows)

    def _mass_change(self, d_rows: Rows) -> FloatArray:
        assert isinstance(self.model, Machine)
        h = self.model.head
        total = np.zeros((len(self._system.dofs),) * 2)
        for mass, port in ((h.m1, "head_x"), (h.m1, "head_z"), (h.m2, "tool_x"), (h.m2, "tool_z")):
            if port in d_rows:
                total += mass * (np.outer(d_rows[port], self.rows[port]) + np.outer(self.rows[port], d_rows[port]))
        return total

    def _rail_change(
        self, path: Path, output: str, input: str, force_q: list[ComplexArray], force_p: list[ComplexArray]
    ) -> ComplexArray | float:
        model = self.model
        assert isinstance(model, Machine)
        out: ComplexArray | float = 0.0
        if path[0] == "guide" or (path == ("s",) and model.guide is not None):
            assert model.guide is not None
            out = out + model.guide.derivative(str(path[-1]), self.s) * force_q[0] * force_p[0]
        if (path[0] == "rail" and path[1] == "torsion") or (path == ("s",) and model.rail.torsion):
            out = out + self._torsion_change(path, force_q, force_p)
        if (path[0] == "rail" and path[1] != "torsion") or path == ("s",):
            name = path if path == ("s",) else _rail_name(path)
            # One field carries each port: what reaches it through the head's base, plus its own.
            q, p = self._rail_part(output), self._rail_part(input)
            out = out + self._base_to_base(name) * force_q[0] * force_p[0]
            if q.field is not None:
                out = out + self.rail.derivative(name, q.field, self.base_field) * force_p[0]
            if p.field is not None:
                out = out + self.rail.derivative(name, self.base_field, p.field) * force_q[0]
            if q.field is not None and p.field is not None:
                out = out + self.rail.derivative(name, q.field, p.field)
        return out

    def _torsion_change(
        self, path: Path, force_q: list[ComplexArray], force_p: list[ComplexArray]
    ) -> ComplexArray | float:
        """Twist of the rail under the torques of both ports."""
        model = self.model
        assert isinstance(model, Machine)
        if path[-1] == "eccentricity":
            return 0.0
        change = torsion_receptance(model.rail, self.positions, self.positions, self.s, str(path[-1]))
        return change * force_q[1] * force_p[1]


def _is_modal(name: str) -> bool:
    """Whether a signal is a mass-normalised modal coordinate of the rail."""
    return re.fullmatch(r"eta\d+", name) is not None


def _rail_name(path: Path) -> Path:
    """A rail path as `RailReceptance.derivative` takes it."""
    if path[1] == "parameters":
        return path[2:]
    if path[1] == "attachments":
        return ("attachments", path[2], path[-1])
    return path[1:]


def _apparent_mass(a: Attachment, s: ComplexArray) -> ComplexArray:
    """What of an attachment's mass resists an acceleration of its foot."""
    if isinstance(a.element, SprungMass):
        return a.element.dynamic_stiffness(s) / s**2
    return a.element.mass + 0 * s


def _apparent_mass_change(a: Attachment, name: str, s: ComplexArray) -> ComplexArray:
    if isinstance(a.element, SprungMass):
        change = a.element.derivative(name, s) / s**2
        return change - 2 * a.element.dynamic_stiffness(s) / s**3 if name == "s" else change
    return (1.0 if name == "mass" else 0.0) + 0 * s


def _inverse(matrix: ComplexArray) -> ComplexArray:
    """Inverses of a stack of matrices; two by two in closed form."""
    if matrix.shape[1:] != (2, 2):
        return cast(ComplexArray, np.linalg.inv(matrix))
    (a, b), (c, d) = matrix[:, 0].T, matrix[:, 1].T
    return cast(ComplexArray, np.array([[d, -b], [-c, a]]).transpose(2, 0, 1) / (a * d - b * c)[:, None, None])


def _dot(left: Sequence[ComplexArray] | ComplexArray, right: Sequence[ComplexArray] | ComplexArray) -> ComplexArray:
    """Sum of products over one or two interface degrees of freedom, elementwise over position and frequency."""
    total = left[0] * right[0]
    for i in range(1, len(left)):
        total = total + left[i] * right[i]
    return total


def _plus(total: ComplexArray | None, more: ComplexArray) -> ComplexArray:
    return more if total is None else total + more


def as_positions(model: Machine | Structure, positions: object) -> FloatArray:
    """
    Positions as an array, checked against the kind of model.

    Parameters
    ----------
    model : Machine or Structure
        The model.
    positions : float, array_like or None
        y_b / L, strictly inside (0, 1); None or NaN for a structure.

    Returns
    -------
    ndarray, shape (position,)
        The positions; one NaN for a structure.

    Raises
    ------
    ParameterError
        If a machine has none, one lies outside the rail, or a structure is given one.
    """
    if not model.has_position:
        if positions is not None and not np.isnan(np.asarray(positions, dtype=float)).all():
            raise ParameterError("a second_order model has no position")
        return np.array([np.nan])
    if positions is None:
        raise ParameterError("the response of a cutting machine needs a position y_b / L, strictly inside (0, 1)")
    values = np.atleast_1d(np.asarray(positions, dtype=float))
    return np.array([check_position(float(y)) for y in values.ravel()])


def as_laplace(freq: object, decay_rate: float) -> tuple[FloatArray, ComplexArray]:
    """
    Frequencies [Hz] and s = σ + j2πf.

    Parameters
    ----------
    freq : array_like, shape (frequency,)
        Frequencies [Hz].
    decay_rate : float
        σ [1/s].

    Returns
    -------
    freq, s : ndarray, shape (frequency,)
        Both.

    Raises
    ------
    ParameterError
        If a frequency is negative or not finite.
    """
    f = np.atleast_1d(np.asarray(freq, dtype=float))
    if f.ndim != 1 or not np.isfinite(f).all() or (f < 0).any():
        raise ParameterError("frequencies must be finite, at least 0 Hz, in one list")
    return f, check_number("decay_rate", decay_rate) + 2j * np.pi * f
