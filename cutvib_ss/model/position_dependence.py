"""The affine form written out: constant matrices, and the functions of position that weigh them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cutvib_ss.model.coupling import AffineMachine
from cutvib_ss.results import FloatArray, read_only


@dataclass(frozen=True)
class AffineTerms:
    """
    A machine as M(y) = Σ_k ρ_k(y) M_k, and C and K likewise.

    Parameters
    ----------
    exact : AffineMachine
        The machine.
    names : tuple of str
        The functions ρ_k: ``1``, ``phi[eta1]``, ``phi[eta1]*phi[eta2]`` ...
    mass, damping, stiffness : array_like, shape (term, n, n)
        The constant matrices.
    """

    exact: AffineMachine
    names: tuple[str, ...]
    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray

    def __post_init__(self) -> None:
        for name in ("mass", "damping", "stiffness"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    def functions(self, position: float) -> FloatArray:
        """
        Values of the functions of position.

        Parameters
        ----------
        position : float
            y / L.

        Returns
        -------
        ndarray, shape (term,)
            ρ(y).
        """
        rows = {twist: self.exact.rail_row(position, twist) for twist in {r.twist for r in self.exact.riders}}
        values = {a.name: float(rows[a.twist][a.column]) for a in _active(self.exact)} | {"1": 1.0}
        return np.array([np.prod([values[part] for part in name.split("*")]) for name in self.names])


def affine_terms(exact: AffineMachine) -> AffineTerms:
    """
    The affine form written out.

    Parameters
    ----------
    exact : AffineMachine
        The machine.

    Returns
    -------
    AffineTerms
        Only terms that are not zero.

    Notes
    -----
    T = T_0 + Σ_a ρ_a σ_a e_c(a) e_i(a)ᵀ, so that TᵀXT has the constant T_0ᵀXT_0; for each ρ_a the row σ_a X_c(a) T_0 at i(a),
    and its transpose; and for each product ρ_a ρ_b the entries σ_a σ_b X_c(a)c(b) at i(a), i(b).

    Examples
    --------
    >>> from cutvib_ss.model.coupling import affine_machine
    >>> from cutvib_ss.model.machine import published_machine
    >>> affine_terms(affine_machine(published_machine())).names[:6]
    ('1', 'phi[eta1]', 'phi[eta2]', 'phi[eta3]', 'phi[eta4]', 'phi[eta1]*phi[eta1]')
    """
    n, still = len(exact.dofs), exact.still
    fixed = (exact.fixed.mass, exact.fixed.damping, exact.fixed.stiffness)
    riding = (exact.carried.mass, exact.carried.damping, exact.carried.stiffness)
    found = {"1": np.array([f + still.T @ x @ still for f, x in zip(fixed, riding, strict=True)])}
    active = _active(exact)
    for a in active:
        linear = np.zeros((3, n, n))
        linear[:, a.column] = [a.sign * (x[a.dof] @ still) for x in riding]
        found[a.name] = linear + np.swapaxes(linear, 1, 2)
    for k, a in enumerate(active):
        for b in active[k:]:
            square = np.zeros((3, n, n))
            square[:, a.column, b.column] = [a.sign * b.sign * x[a.dof, b.dof] for x in riding]
            square[:, b.column, a.column] = square[:, a.column, b.column]
            found[f"{a.name}*{b.name}"] = square
    found = {name: matrices for name, matrices in found.items() if matrices.any()}
    mass, damping, stiffness = np.stack(list(found.values()), axis=1)
    return AffineTerms(exact, tuple(found), mass, damping, stiffness)


@dataclass(frozen=True)
class _Entry:
    """An entry of T that depends on position."""

    name: str
    dof: int
    column: int
    sign: float
    twist: bool


def _active(exact: AffineMachine) -> list[_Entry]:
    out = []
    for r in exact.riders:
        moves = [d.startswith("twist") for d in exact.dofs] if r.twist else exact.rail_row_bound(0)
        letter = "psi" if r.twist else "phi"
        out += [_Entry(f"{letter}[{exact.dofs[i]}]", r.dof, int(i), r.sign, r.twist) for i in np.flatnonzero(moves)]
    return out
