"""
The base-force constraint (Eqs. 5, 6 and 10): the one definition of how the head sits on the rail.

The head, with everything that is attached to it, has its own coordinates p and those of the point of the rail under it, x (its
displacement, and with torsion its twist), by Eqs. 1-3 over both. The rail has the coordinates η (Eq. 9). Eq. 6 is x = φ(y)ᵀ η, and
by Eq. 5 the force with which the head acts on x acts on the rail. With q = (η, p) and T(y) q = (p, x) that is

    M(y) = M_rail + T(y)ᵀ M_head T(y),   and C, K likewise,

each affine in the functions φ_r(y) and the products φ_r(y) φ_s(y), with constant matrices. On the bare machine, p = (θ1, θ2),

    M = [ I + (m1 + m2) φ φᵀ    φ m_bθ ]     C = [ diag(2ζω_r)   0  ]     K = [ diag(ω_r²)   0  ]
        [    m_θb φᵀ            M_θθ   ],        [     0        C_θ ],        [     0       K_θ ].

A guide that gives adds the coordinate of its stretch, p = (θ1, θ2, g) with x_head = x + g, and is an element at g: everything
else stays, and a stiff one loses no digits. Supports, shear and torsion are the rail's (`cutvib_ss.model.rail`). A structure
without a rail has no x.

The plant closes the same two systems as python-control objects: the head driven by the motion of x, the rail by the reaction
there. Both have direct feedthrough, so their loop is algebraic, yet well posed: its return difference is 1 + φᵀφ m_eff > 0,
m_eff ≥ 0 being what the head's masses leave of x once its joints are free to accelerate. The linear fractional transformation
leaves exactly the physical states, with no constraint-drift poles at zero. The closed form (`cutvib_ss.response.receptance`) takes
core, elements and rail from here. Position is y / L throughout, and derivatives are to that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import comb
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import Attachment, Guide, viscous_attachments
from cutvib_ss.model.head import HEAD_DOFS, head_changes, head_matrices, head_rows
from cutvib_ss.model.paths import Path
from cutvib_ss.model.rail import Rail, rail, rail_rows, rail_rows_bound, viscous_rail
from cutvib_ss.model.second_order import MatrixStack, SecondOrder
from cutvib_ss.parameters import MATRICES, HeadParameters, check_position, control_name
from cutvib_ss.results import FloatArray, Quantity

if TYPE_CHECKING:
    import control

Matrices: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Assembly:
    """
    A system, the elements at its ports, and which of its coordinates follow a rail.

    ``paths`` are those of the elements in the model, for derivatives; ``base`` the coordinates x, none without a rail.
    """

    core: SecondOrder
    elements: tuple[Attachment, ...] = ()
    paths: tuple[Path, ...] = ()
    base: tuple[str, ...] = ()
    rail: Rail | None = None

    def system(self, viscous_at: float | None = None) -> SecondOrder:
        """The system with its elements; the k-th one's own coordinates are named ``attached<k>_…``."""
        system = self.core
        for k, a in enumerate(viscous_attachments(self.elements, viscous_at)):
            system = system.attach([a.row(system.ports)], a.element.second_order(), ["end"], prefix=f"attached{k + 1}_")
        return system

    @cached_property
    def coupling(self) -> Coupling:
        """The constraint without more ports, kept: most of what is asked of a position begins with it."""
        assert self.rail is not None
        return Coupling(self.system(), rail(self.rail, {}), self.base, self.rail)


@lru_cache(maxsize=32)
def head_assembly(p: HeadParameters, rail_: Rail, attachments: tuple[Attachment, ...], guide: Guide | None) -> Assembly:
    """The head over its own coordinates and those of the rail under it, with its attachments and its guide."""
    torsion = rail_.torsion
    rows = head_rows(p, torsion is not None, torsion.eccentricity if torsion else 0.0)
    matrices, base = head_matrices(p, rows), HEAD_DOFS[2 : rows["base"].size]
    rows = {**rows, "head_base": rows["base"], "at_head": rows["base"]}
    if torsion:
        rows["at_head_twist"] = rows["twist"]
    paths: tuple[Path, ...] = tuple(("attachments", k, "element") for k in range(len(attachments)))
    if guide is None:
        return Assembly(SecondOrder(*matrices, (*HEAD_DOFS[:2], *base), rows), attachments, paths, base, rail_)
    spread = _spread(torsion is not None, guide)
    rows = {name: row @ spread for name, row in rows.items()}
    rows["at_head"] = np.eye(spread.shape[1])[3]
    rows["guide"] = rows["head_base"] - rows["at_head"]
    if guide.sensor_side == "rail":
        rows["base"] = rows["at_head"]
    mass, damping, stiffness = (spread.T @ x @ spread for x in matrices)
    core = SecondOrder(mass, damping, stiffness, (*HEAD_DOFS[:2], "guide", *base), rows)
    return Assembly(core, (*attachments, Attachment("guide", guide.element)), (*paths, ("guide",)), base, rail_)


@dataclass(frozen=True)
class Changes:
    """How a core moves with a value: rows of its ports, and its dynamic stiffness as (power of s, matrix or row r of r rᵀ)."""

    rows: Mapping[str, FloatArray]
    stiffness: Sequence[tuple[int, FloatArray]]


def _spread(twist: bool, guide: Guide | None) -> FloatArray:
    """The head's coordinates from the core's: with a guide the base is the rail's motion and the stretch."""
    still = np.eye(4 if twist else 3)
    if guide is None:
        return still
    out = np.insert(still, 3, 0.0, axis=1)
    out[2, 3] = 1.0
    return out


def head_core_changes(p: HeadParameters, rail_: Rail, guide: Guide | None, name: str) -> Changes:
    """How the core of a head moves with one of its parameters, or with ``"eccentricity"``."""
    torsion = rail_.torsion
    rows, parts = head_changes(p, name, torsion is not None, torsion.eccentricity if torsion else 0.0)
    if guide is None:
        return Changes(rows, parts)
    spread = _spread(torsion is not None, guide)
    return Changes(
        {port: row @ spread for port, row in rows.items()},
        [(order, x @ spread if x.ndim == 1 else spread.T @ x @ spread) for order, x in parts],
    )


@dataclass(frozen=True)
class Coupling:
    """
    A machine as constant matrices and the rows φ(y) that carry the position.

    Parameters
    ----------
    head : SecondOrder
        The head over (p, x), with everything attached to it.
    beam : SecondOrder
        The rail over η; its ports do not depend on where the head is.
    base : tuple of str
        The coordinates x of ``head``.
    rail : Rail
        The rail.
    """

    head: SecondOrder
    beam: SecondOrder
    base: tuple[str, ...]
    rail: Rail

    @cached_property
    def own(self) -> tuple[str, ...]:
        """Names of the head's own coordinates p."""
        return tuple(d for d in self.head.dofs if d not in self.base)

    @property
    def dofs(self) -> tuple[str, ...]:
        """Names of the coordinates q: the rail's, then the head's own."""
        return self.beam.dofs + self.own

    @cached_property
    def constant(self) -> FloatArray:
        """The constant part of T, shape (p and x, q)."""
        out = np.zeros((len(self.head.dofs), len(self.dofs)))
        for k, dof in enumerate(self.own, start=len(self.beam.dofs)):
            out[self.head.dofs.index(dof), k] = 1.0
        return out

    @cached_property
    def _riding(self) -> list[tuple[int, bool]]:
        """Index of each coordinate x, and whether it is the twist."""
        return [(self.head.dofs.index(d), d == "twist") for d in self.base]

    # -- at a position ----------------------------------------------------------------------------------------------------------

    def rows(self, positions: ArrayLike, order: int = 0, twist: bool = False) -> FloatArray:
        """φ(y), or of the twist, over q, or a derivative of it; shape (position, q)."""
        rows = rail_rows(self.rail, positions, order, twist)
        return np.hstack([rows, np.zeros((len(rows), len(self.own)))])

    def rows_bound(self, order: int) -> FloatArray:
        """Largest moduli over the whole rail of the entries of `rows`, for the deflection."""
        row = rail_rows_bound(self.rail, order)
        return np.pad(row, (0, len(self.dofs) - row.size))

    def transforms(self, positions: ArrayLike, order: int = 0) -> FloatArray:
        """T(y), or a derivative of it, at several positions; shape (position, p and x, q)."""
        at = np.atleast_1d(np.asarray(positions, dtype=float))
        out: FloatArray = np.zeros((at.size, *self.constant.shape)) + (0.0 if order else self.constant)
        for dof, twist in self._riding:
            out[:, dof] += self.rows(at, order, twist)
        return out

    def transform(self, position: float, order: int = 0) -> FloatArray:
        """T(y), or a derivative of it."""
        one: FloatArray = self.transforms(position, order)[0]
        return one

    def transform_bound(self, order: int) -> FloatArray:
        """Largest moduli over the whole rail of the entries of T, or of a derivative of it."""
        out: FloatArray = np.zeros_like(self.constant) if order else self.constant.copy()
        for dof, twist in self._riding:
            if twist:
                raise CouplingError(
                    "one coordinate of the rail's twist belongs to the place of the head: it has no bounds"
                )
            out[dof] += self.rows_bound(order)
        return out

    def stack(self, positions: ArrayLike, order: int = 0) -> MatrixStack:
        """M, C and K at several positions, or derivatives of them: (TᵀXT)⁽ᵈ⁾ = Σ_k (d over k) T⁽ᵏ⁾ᵀ X T⁽ᵈ⁻ᵏ⁾ (Leibniz)."""
        t, n = [self.transforms(positions, k) for k in range(order + 1)], len(self.beam.dofs)
        out = []
        for name in MATRICES:
            x = getattr(self.head, name)
            total = sum(comb(order, k) * (t[k].swapaxes(1, 2) @ x @ t[order - k]) for k in range(order + 1))
            if not order:
                total[:, :n, :n] += getattr(self.beam, name)
            out.append(total)
        return MatrixStack(out[0], out[1], out[2], self.dofs)

    def matrices(self, position: float, order: int = 0) -> Matrices:
        """M, C and K at a position, or derivatives of them."""
        mass, damping, stiffness, _ = self.stack(position, order)
        return mass[0], damping[0], stiffness[0]

    def matrices_bound(self, order: int) -> Matrices:
        """Bounds over the whole rail on the moduli of a derivative's entries, order 1 or more; not the smallest there are."""
        t, d = [self.transform_bound(k) for k in range(order + 1)], order
        carried = (np.abs(x) for x in (self.head.mass, self.head.damping, self.head.stiffness))
        m, c, k = (np.sum([comb(d, i) * (t[i].T @ x @ t[d - i]) for i in range(d + 1)], axis=0) for x in carried)
        return m, c, k

    def on_rail(self, port: str) -> bool:
        """Whether a port is the rail's, wherever the head is."""
        self._check((port,), "port")
        return port in self.beam.ports

    def port(self, name: str, position: float, order: int = 0) -> FloatArray:
        """The row of a port at a position over q, or a derivative of it."""
        if self.on_rail(name):
            return np.zeros(len(self.dofs)) if order else np.pad(self.beam.port(name), (0, len(self.own)))
        row: FloatArray = self.head.port(name) @ self.transform(position, order)
        return row

    def second_order(self, position: float) -> SecondOrder:
        """The machine at a position over q, with the ports of both parts."""
        t = self.transform(check_position(position))
        moved, beam = np.array(list(self.head.ports.values())) @ t, np.zeros((len(self.beam.ports), len(self.dofs)))
        beam[:, : len(self.beam.dofs)] = list(self.beam.ports.values())
        ports = {**dict(zip(self.head.ports, moved, strict=True)), **dict(zip(self.beam.ports, beam, strict=True))}
        return SecondOrder(*self.matrices(position), self.dofs, ports)

    # -- as state-space objects -------------------------------------------------------------------------------------------------

    def parts(
        self, position: float, inputs: Mapping[str, str], outputs: Mapping[str, tuple[str, Quantity]]
    ) -> tuple[control.StateSpace, control.StateSpace]:
        """
        Head and rail as python-control objects.

        The head's last inputs are the motions of x, its last outputs the reactions there; the rail's first inputs are those
        forces, its first outputs those motions. Signals go to the part that has their port.
        """
        self._check(inputs.values(), "input")
        self._check([port for port, _ in outputs.values()], "output")
        place = check_position(position)
        joints = {d: rail_rows(self.rail, [place], twist=d == "twist")[0] for d in self.base}
        beam = replace(self.beam, ports={**self.beam.ports, **joints})
        quantities: tuple[Quantity, ...] = ("displacement", "velocity", "acceleration")
        meets = {f"{d}_{q}": (d, q) for d in joints for q in quantities}
        head_in = {s: p for s, p in inputs.items() if p not in self.beam.ports}
        head_out = {s: r for s, r in outputs.items() if r[0] not in self.beam.ports}
        rail_in = {f"{d}_force": d for d in joints} | {s: p for s, p in inputs.items() if s not in head_in}
        rail_out = meets | {s: r for s, r in outputs.items() if s not in head_out}
        return self.head.state_space(head_in, head_out, "head", self.base), beam.state_space(rail_in, rail_out, "rail")

    def plant(
        self, position: float, inputs: Mapping[str, str], outputs: Mapping[str, tuple[str, Quantity]]
    ) -> control.StateSpace:
        """The two `parts` closed; states in the order of `state_scales`."""
        import control  # late: it takes long to load

        upper, lower = self.parts(position, inputs, outputs)
        meets = len(self.base)
        # Motions are exchanged in units of acceleration: a stiff guide's force per displacement would hide the loop's rank.
        dof = self.own[0]
        unit = np.tile((self.state_scales[dof] / self.state_scales[f"d_{dof}"]) ** np.array([2.0, 1.0, 0.0]), meets)
        before = np.ones(upper.ninputs)
        before[upper.ninputs - unit.size :] = 1.0 / unit
        after = np.ones(lower.noutputs)
        after[: unit.size] = unit
        scaled = control.ss(upper.A, upper.B * before, upper.C, upper.D * before)
        closed = scaled.lft(
            control.ss(lower.A, lower.B, after[:, None] * lower.C, after[:, None] * lower.D), nu=unit.size, ny=meets
        )
        ins = [*upper.input_labels[: len(upper.input_labels) - 3 * meets], *lower.input_labels[meets:]]
        outs = [*upper.output_labels[: len(upper.output_labels) - meets], *lower.output_labels[3 * meets :]]
        states = [*upper.state_labels, *lower.state_labels]
        x = [states.index(name) for name in self.state_scales]
        drives, reads = [*map(control_name, inputs)], [*map(control_name, outputs)]
        i, o = [ins.index(name) for name in drives], [outs.index(name) for name in reads]
        return control.ss(
            closed.A[np.ix_(x, x)], closed.B[np.ix_(x, i)], closed.C[np.ix_(o, x)], closed.D[np.ix_(o, i)],
            inputs=drives, outputs=reads, states=list(self.state_scales), name="machine",
        )  # fmt: skip

    @cached_property
    def state_scales(self) -> dict[str, float]:
        """The plant's states in their order, and what each is multiplied by: head and rail, then what is attached."""
        scales = self.head.state_scales(self.base) | self.beam.state_scales()
        attached = [d for d in self.own if d.startswith("attached")]
        mechanical = [d for d in self.own if d not in attached] + list(self.beam.dofs)
        order = [d for group in (mechanical, attached) for d in (*group, *(f"d_{d}" for d in group))]
        return {name: scales[name] for name in order}

    def _check(self, ports: Iterable[str], what: str) -> None:
        for port in ports:
            if port not in self.beam.ports and port not in self.head.ports:
                known = ", ".join(dict.fromkeys([*self.head.ports, *self.beam.ports]))
                raise ParameterError(f"no port {port!r} for an {what}; there are {known}".replace("an port", "a port"))


def coupling(
    assembly: Assembly, viscous_at: float | None = None, points: Mapping[str, float] | None = None
) -> Coupling:
    """The constraint of a machine, hysteresis made viscous at a frequency [Hz] if one is given, with more ports along the rail."""
    if viscous_at is None and not points:
        return assembly.coupling
    assert assembly.rail is not None
    beam = viscous_rail(assembly.rail, viscous_at)
    return Coupling(assembly.system(viscous_at), rail(beam, points or {}), assembly.base, beam)
