"""
The equations of a machine whose head travels, at given instants: what rides on the rail, and what that adds.

The base follows the rail under it, x_b(t) = φ(y_b(t))ᵀ η(t) (Eq. 6 with a position that moves). So with p(t) = φ(y_b(t)),

    ẋ_b = pᵀη̇ + ṗᵀη,                    ṗ = φ' ẏ_b
    ẍ_b = pᵀη̈ + 2ṗᵀη̇ + p̈ᵀη,            p̈ = φ'' ẏ_b² + φ' ÿ_b:

the convective terms, Coriolis' and centripetal among them. Virtual displacements are taken at a frozen instant,
δx_b = pᵀ δη. What rides has the coordinates u = T(t) q of the constraint (`cutvib_ss.model.coupling`), so that it adds
Tᵀ(M_c ü + C_c u̇ + K_c u) to the rail's equations, and

    M q̈ + (C + 2TᵀM_cṪ) q̇ + (K + TᵀC_cṪ + TᵀM_cT̈) q = Tᵀ f,     M, C, K those of the machine standing at y_b(t).

With T = T_0 + e pᵀ, e being the riding coordinate x = pᵀq, all of it is constant matrices and dyads of p, ṗ, p̈ with the constant
rows eᵀM_cT_0, eᵀC_cT_0, eᵀK_cT_0.

The new damping and stiffness are not symmetric, for energy flows: the contact force λ on the riding coordinate does work
λ (pᵀη̇ + ṗᵀη) there and takes λ pᵀη̇ from the rail. The rest, λ ṗᵀη = λ w'(y_b) ẏ_b, comes from the drive that moves the head up
and down the deflected rail. The energy stored is the work of forces and drive, less what dampers lose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from cutvib_ss.model.coupling import Coupling
from cutvib_ss.response.compiled_travel import NODES, STAGES, TWICE, WEIGHTS
from cutvib_ss.response.travel import Travel
from cutvib_ss.results import FloatArray, Quantity
from cutvib_ss.units import DERIVATIVE_ORDER

Rows: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class RidingState:
    """Motion at instants."""

    motion: tuple[FloatArray, FloatArray, FloatArray]  # q, q̇ and q̈
    rows: Rows  # p, ṗ and p̈
    forces: FloatArray  # The forces

    @property
    def ridden(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The riding coordinate x = pᵀq and its total derivatives to time, shape (instant,)."""
        (q, v, a), (p, d, dd) = self.motion, self.rows
        return _along(p, q), _along(p, v) + _along(d, q), _along(p, a) + 2 * _along(d, v) + _along(dd, q)


@dataclass(frozen=True)
class RidingCourse:
    """Constant matrices of a machine whose head travels."""

    exact: Coupling  # The machine
    fixed: FloatArray  # Constant parts of M, C and K
    rows: FloatArray  # What couples the riding coordinate to the others, in M, C and K
    own: FloatArray  # M, C and K of the riding coordinate itself
    pushes: FloatArray  # Constant part of where forces act
    own_pushes: FloatArray  # Force on the riding coordinate per unit of each input

    @classmethod
    def of(cls, exact: Coupling, ports: Sequence[str]) -> RidingCourse:
        """The constants of a machine under forces at ports."""
        t, e = exact.constant, exact.head.dofs.index("base")
        names = ("mass", "damping", "stiffness")
        riding = [getattr(exact.head, name) for name in names]
        fixed = np.array([t.T @ x @ t for x in riding])
        n = len(exact.beam.dofs)
        fixed[:, :n, :n] += [getattr(exact.beam, name) for name in names]
        rows, own = np.array([x[e] @ t for x in riding]), np.array([x[e, e] for x in riding])
        reads = [_reading(exact, port) for port in ports]
        pushes = np.ascontiguousarray(np.reshape([row for row, _ in reads], (len(ports), -1)).T)
        return cls(exact, fixed, rows, own, pushes, np.array([part for _, part in reads]))

    def rows_at(self, travel: Travel, time: FloatArray) -> Rows:
        """The riding row and its first and second derivative to time, shape (instant, n)."""
        y, rate, acceleration = travel.at(time)
        p, first, second = (self.exact.rows(y, order) for order in range(3))
        return p, first * rate[:, None], second * rate[:, None] ** 2 + first * acceleration[:, None]

    def state(self, travel: Travel, time: FloatArray, motion: FloatArray, forces: FloatArray) -> RidingState:
        """Motion at instants, its acceleration from the equations."""
        rows = self.rows_at(travel, time)
        p, (mr, mo) = rows[0], (self.rows[0], self.own[0])
        q, v = motion[:, 0], motion[:, 1]
        lacking = self.residual(RidingState((q, v, np.zeros_like(q)), rows, forces))
        mass = self.fixed[0] + p[:, :, None] * mr + mr[:, None] * p[:, None, :] + mo * p[:, :, None] * p[:, None, :]
        a = np.linalg.solve(mass, lacking[:, :, None])[:, :, 0]
        return RidingState((q, v, a), rows, forces)

    def residual(self, state: RidingState) -> FloatArray:
        """What the equations of motion lack: forces less those of inertia, dampers and springs, shape (instant, n)."""
        (x, u, w), (q, v, a) = state.ridden, state.motion
        mr, cr, kr = self.rows
        m, c, k = self.fixed
        others = np.outer(w, mr) + np.outer(u, cr) + np.outer(x, kr) + a @ m + v @ c + q @ k
        lacking: FloatArray = state.forces @ self.pushes.T - others - self._contact(state)[:, None] * state.rows[0]
        return lacking

    def read(self, port: str, state: RidingState, quantity: Quantity) -> FloatArray:
        """Motion of a port, total derivatives to time, shape (instant,)."""
        row, part = _reading(self.exact, port)
        order = DERIVATIVE_ORDER[quantity]
        shown: FloatArray = state.motion[order] @ row + part * state.ridden[order]
        return shown

    def stored(self, state: RidingState) -> FloatArray:
        """Kinetic and elastic energy, shape (instant,)."""
        total = np.zeros(len(state.forces))
        for order, k in ((1, 0), (0, 2)):
            y, x = state.motion[order], state.ridden[order]
            total += _along(y @ self.fixed[k], y) / 2 + x * (y @ self.rows[k]) + self.own[k] * x**2 / 2
        return total

    def work(
        self, motion: FloatArray, stages: FloatArray, carried: FloatArray, forces: FloatArray, h: float
    ) -> FloatArray:
        """Work in each step, by the steps' own quadrature, shape (step, 3)."""
        q, v = motion[:-1, None, 0], motion[:-1, None, 1]
        x = q + h * NODES[:, None] * v + h * h * np.einsum("st,ktn->ksn", TWICE, stages)
        u = v + h * np.einsum("st,ktn->ksn", STAGES, stages)
        force = forces[:-1, None] + NODES[:, None] * np.diff(forces, axis=0)[:, None]
        x, u, a, force, p, d, dd = (np.reshape(y, (-1, y.shape[-1])) for y in (x, u, stages, force, *carried))
        state = RidingState((x, u, a), (p, d, dd), force)
        rate = state.ridden[1]
        pushed = _along(u, force @ self.pushes.T) + rate * (force @ self.own_pushes)
        lost = _along(u @ self.fixed[1], u) + rate * (2 * u @ self.rows[1] + self.own[1] * rate)
        powers = (pushed, self._contact(state) * _along(d, x), lost)
        return h * np.stack([np.reshape(power, (-1, 3)) @ WEIGHTS for power in powers], axis=1)

    def at_rest(self, p: FloatArray, forces: FloatArray) -> FloatArray:
        """Coordinates at rest under constant forces, shape (n,)."""
        kr, ko = self.rows[2], self.own[2]
        stiffness = self.fixed[2] + np.outer(p, kr) + np.outer(kr, p) + ko * np.outer(p, p)
        out: FloatArray = np.linalg.solve(stiffness, self.pushes @ forces + (self.own_pushes @ forces) * p)
        return out

    def _contact(self, state: RidingState) -> FloatArray:
        """Force λ of the rail on the riding coordinate."""
        felt: FloatArray = -state.forces @ self.own_pushes
        for k, order in enumerate((2, 1, 0)):
            felt = felt + state.motion[order] @ self.rows[k] + self.own[k] * state.ridden[order]
        return felt


def _reading(exact: Coupling, port: str) -> tuple[FloatArray, float]:
    """A port's motion: a constant row over q, and its part in the riding coordinate."""
    if exact.on_rail(port):
        return np.pad(exact.beam.port(port), (0, len(exact.own))), 0.0
    row = exact.head.port(port)
    return row @ exact.constant, float(row[exact.head.dofs.index("base")])


def _along(rows: FloatArray, motion: FloatArray) -> FloatArray:
    out: FloatArray = np.einsum("ti,ti->t", rows, motion)
    return out
