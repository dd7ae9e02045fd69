"""The constraint written out: constant matrices, and the functions of position that weigh them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.model.coupling import Coupling
from cutvib_ss.results import FloatArray, read_only


@dataclass(frozen=True)
class PositionDependence:
    """A machine as M(y) = Σ_k ρ_k(y) M_k, and C and K likewise."""

    exact: Coupling  # The machine
    names: tuple[str, ...]  # The functions ρ_k: ``1``, ``phi[eta1]``, ``phi[eta1]*phi[eta2]`` ..
    mass: FloatArray  # The constant matrices
    damping: FloatArray
    stiffness: FloatArray

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    def functions(self, position: float) -> FloatArray:
        """Values of the functions of position, ρ(y), shape (term,)."""
        rows = {d: self.exact.rows([position], twist=d == "twist")[0] for d in self.exact.base}
        values = {a.name: float(rows[a.base][a.column]) for a in _active(self.exact)} | {"1": 1.0}
        return np.array([np.prod([values[part] for part in name.split("*")]) for name in self.names])


def position_dependence(exact: Coupling) -> PositionDependence:
    """
    The constraint written out as constant matrices; only terms that are not zero.

    T = T_0 + Σ_a ρ_a e_c(a) e_i(a)ᵀ, so that TᵀXT has the constant T_0ᵀXT_0; for each ρ_a the row X_c(a) T_0 at i(a), and its
    transpose; and for each product ρ_a ρ_b the entries X_c(a)c(b) at i(a), i(b).

    >>> from cutvib_ss.model.machine import published_machine
    >>> position_dependence(published_machine().coupling()).names[:6]
    ('1', 'phi[eta1]', 'phi[eta2]', 'phi[eta3]', 'phi[eta4]', 'phi[eta1]*phi[eta1]')
    """
    n, still = len(exact.dofs), exact.constant
    beam = (np.pad(x, (0, len(exact.own))) for x in (exact.beam.mass, exact.beam.damping, exact.beam.stiffness))
    carried = (exact.head.mass, exact.head.damping, exact.head.stiffness)
    found = {"1": np.array([f + still.T @ x @ still for f, x in zip(beam, carried, strict=True)])}
    active = _active(exact)
    for a in active:
        linear = np.zeros((3, n, n))
        linear[:, a.column] = [x[a.dof] @ still for x in carried]
        found[a.name] = linear + np.swapaxes(linear, 1, 2)
    for k, a in enumerate(active):
        for b in active[k:]:
            square = np.zeros((3, n, n))
            square[:, a.column, b.column] = [x[a.dof, b.dof] for x in carried]
            square[:, b.column, a.column] = square[:, a.column, b.column]
            found[f"{a.name}*{b.name}"] = square
    found = {name: matrices for name, matrices in found.items() if matrices.any()}
    mass, damping, stiffness = np.stack(list(found.values()), axis=1)
    return PositionDependence(exact, tuple(found), mass, damping, stiffness)


@dataclass(frozen=True)
class _Entry:
    """An entry of T that depends on position."""

    name: str
    dof: int
    column: int
    base: str


def _active(exact: Coupling) -> list[_Entry]:
    out = []
    for dof in exact.base:
        twist = dof == "twist"
        moves = [d.startswith("twist") for d in exact.dofs] if twist else exact.rows_bound(0)
        letter, row = ("psi" if twist else "phi"), exact.head.dofs.index(dof)
        out += [_Entry(f"{letter}[{exact.dofs[i]}]", row, int(i), dof) for i in np.flatnonzero(moves)]
    return out
