"""
Derivatives of receptances to the model's values.

With X = b + Φ u the whole motion of the head (held, and following its base) and R the force on the rail, reciprocity gives, for a
change of rows, of the head's dynamic stiffness E, or of the rail's receptance A under the head and a at its own ports,

    dH_qp = dqᵀ X_p + X_qᵀ dp - X_qᵀ dE X_p + R_qᵀ dA R_p + da_qᵀ R_p + R_qᵀ da_p + da_qp.

b and Φ depend on frequency alone, u and R on position too. So the head's part is

    dH_qp = α_q + β_qᵀ u_p + u_qᵀ γ,   α_q = dqᵀ b_p + b_qᵀ dp - b_qᵀ dE b_p,   β_q = Φᵀ (dq - dE b_q),   γ = Φᵀ (dp - dE X_p),

with α and β over frequency, and γ the same for all outputs. Where dE = z r rᵀ alone changes it is -z (rᵀX_q)(rᵀX_p), one
product for all values of what sits at r.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import TypeAlias, cast

import numpy as np

from cutvib_ss.model.coupling import Changes
from cutvib_ss.model.elements import Element, SmoothElement, SpringDamperMass, SprungMass
from cutvib_ss.model.paths import Path, part_at
from cutvib_ss.response.batched import dot, mixed
from cutvib_ss.response.rail_derivatives import RailPair
from cutvib_ss.response.rail_receptance import RailField
from cutvib_ss.response.receptance import ModelReceptance, Row
from cutvib_ss.results import ComplexArray, FloatArray

Rows: TypeAlias = Mapping[str, FloatArray]
_FEW = 5
"""Degrees of freedom of a head up to which the products of all their motions are formed."""
# A part of dE: its factor over frequency, and a symmetric matrix or the row r of r rᵀ.
Part: TypeAlias = tuple[ComplexArray | float, FloatArray]


class ResponseDerivatives:
    """Derivatives of the responses from one input to some outputs."""

    def __init__(
        self,
        receptance: ModelReceptance,
        outputs: Sequence[str],
        input: str,
        factors: Sequence[ComplexArray] | ComplexArray | None = None,
    ) -> None:
        self.receptance, self.outputs, self.input = receptance, tuple(outputs), input
        self.model, self.s = receptance.model, receptance.s
        one = np.ones(self.s.size, dtype=np.complex128)
        self.factors: ComplexArray = np.array([one] * len(self.outputs) if factors is None else factors)
        self._at_outputs = [receptance.of_port(name) for name in self.outputs]
        self._driven = receptance.of_port(input)
        self._pairs: dict[tuple[int, int], RailPair] = {}
        self._products: dict[bytes, ComplexArray] = {}
        self._by_function: dict[Path, ComplexArray] = {}
        # Of the outputs, with their factors: axes (…, position, output, frequency).
        self._held: ComplexArray = np.stack([a.blocked for a in self._at_outputs], axis=1) * self.factors
        self._motion: ComplexArray = np.stack([a.motion for a in self._at_outputs], axis=2) * self.factors

    @cached_property
    def _force(self) -> ComplexArray:
        return np.asarray(np.stack([a.force for a in self._at_outputs], axis=2) * self.factors)

    @cached_property
    def _driven_motion(self) -> ComplexArray:
        """X of the input, shape (n, position, frequency)."""
        out = self._driven.blocked[:, None]
        for i, u in enumerate(self._driven.motion):
            out = out + self.receptance.following[:, i, None] * u
        return out

    def derivatives(self, paths: Sequence[Path]) -> ComplexArray:
        """Derivatives of the responses to some of the model's values, shape (value, position, output, frequency)."""
        out = np.empty(
            (len(paths), len(self.receptance.positions), len(self.outputs), self.s.size), dtype=np.complex128
        )
        cores = {k: changes for k, path in enumerate(paths) if (changes := self._core_alone(path)) is not None}
        if cores:
            out[list(cores)] = self._by_cores(list(cores.values()))
        smooth: dict[Path, list[int]] = {}
        for k, path in enumerate(paths):
            if len(path) > 2 and path[-2] == "coefficients":
                smooth.setdefault(path[:-1], []).append(k)
            elif k not in cores:
                out[k] = self.derivative(path)
        for at, which in smooth.items():
            # All coefficients of a smooth function move it alone.
            function: SmoothElement = part_at(self.model, at[:-1])
            shapes = function.shapes(self.s)[[int(paths[k][-1]) for k in which]]
            out[which] = self._of_value((*at, "unit")) * shapes[:, None, None]
        return out

    def _core_alone(self, path: Path) -> Changes | None:
        """How a value moves the core of a small head, or of a structure, where it moves nothing else."""
        receptance = self.receptance
        if receptance.interface:
            if len(receptance.system.dofs) > _FEW or path[0] != "head":
                return None
        elif receptance.shaken(self.input):
            return None
        changes = receptance.core_changes(path)
        if changes is None or any(a.moved(changes.rows) is not None for a in receptance.assembly.elements):
            return None
        return None if any(map(receptance.is_rail, (*self.outputs, self.input))) else changes

    def _by_cores(self, changes: Sequence[Changes]) -> ComplexArray:
        """dqᵀ X_p + X_qᵀ dp - X_qᵀ dE X_p of several values: products of two motions serve all of them, but for full matrices."""
        powers = (np.ones_like(self.s), self.s, self.s * self.s)
        n = len(self._held)
        upper = _pairs(n)
        # Of each value and power of s the symmetric matrix, over pairs of motions.
        weights = np.zeros((3, len(changes), upper[0].size))
        full: list[tuple[int, int, FloatArray]] = []
        for k, change in enumerate(changes):
            for power, part in change.stiffness:
                entries = part[upper[0]] * part[upper[1]] if part.ndim == 1 else part[upper]
                if part.ndim == 2 and n > _FEW and np.count_nonzero(entries) > n:
                    full.append((k, power, part))
                else:
                    weights[power, k] -= entries
        driven, moving = self._driven_motion[:, :, None], self._moving
        # Those of which a matrix is none need no product.
        used = np.flatnonzero(weights.any(axis=(0, 1)))
        weights = weights[:, :, used]
        pairs = np.empty((used.size, *moving.shape[1:]), dtype=np.complex128)
        for pair, a, b in zip(pairs, upper[0][used], upper[1][used], strict=True):
            np.multiply(moving[a], driven[b], out=pair)
            if a != b:
                pair += moving[b] * driven[a]
        out: ComplexArray = np.zeros((len(changes), *pairs.shape[1:]), dtype=np.complex128)
        for factor, weight in zip(powers, weights, strict=True):
            moved = np.flatnonzero(weight.any(axis=1))
            if moved.size:
                out[moved] += factor * mixed(weight[moved], pairs)
        for k, power, part in full:
            out[k] -= powers[power] * dot(mixed(part, self._driven_motion)[:, :, None], moving)
        for k, change in enumerate(changes):
            if (row := change.rows.get(self.model.port_of(self.input))) is not None:
                out[k] += _read(row, moving)
            for c, name in enumerate(self.outputs):
                if (row := change.rows.get(self.model.port_of(name))) is not None:
                    out[k][:, c] += self.factors[c] * _read(row, self._driven_motion)
        return out

    @cached_property
    def _moving(self) -> ComplexArray:
        """X of the outputs, with their factors, shape (n, position, output, frequency)."""
        out: ComplexArray = self._held[:, None]
        if len(self._motion):
            out = out + self.receptance.following[:, 0, None, None] * self._motion[0]
        for i in range(1, len(self._motion)):
            out += self.receptance.following[:, i, None, None] * self._motion[i]
        return np.asarray(out)

    def derivative(self, path: Path) -> ComplexArray:
        """Derivative of the responses to one of the model's values, shape (position, output, frequency)."""
        if len(path) < 2 or path[-2] != "coefficients":
            return self._of_value(path)
        # All coefficients of a smooth function move it alone.
        if (at := path[:-1]) not in self._by_function:
            self._by_function[at] = self._of_value((*at, "unit"))
        function: SmoothElement = part_at(self.model, path[:-2])
        return self._by_function[at] * function.derivative(str(path[-1]), self.s)

    def _of_value(self, path: Path) -> ComplexArray:
        changes = self.receptance.core_changes(path)
        d_rows = {} if changes is None else changes.rows
        moves = [
            (c, move)
            for c, name in enumerate(self.outputs)
            if (move := self._row_change(path, name, d_rows)) is not None
        ]
        driven = self._row_change(path, self.input, d_rows)
        parts = self._stiffness_parts(path, changes)
        out: ComplexArray | None = None
        if len(parts) == 1 and parts[0][1].ndim == 1 and not moves and driven is None:
            out = self._by_element(*parts[0])
        elif parts or moves or driven is not None:
            out = self._by_head(parts, moves, driven)
        if self.receptance.interface:
            out = self._with_rail(out, path)
        shape = len(self.receptance.positions), len(self.outputs), self.s.size
        if out is None:
            out = np.zeros(shape, dtype=np.complex128)
        if path == ("s",) and self.receptance.shaken(self.input):
            for c, name in enumerate(self.outputs):
                out[:, c] -= self.factors[c] * 2 * self.model.base_share(name) / self.s**3
        return out

    def _by_element(self, factor: ComplexArray | float, row: FloatArray) -> ComplexArray:
        """-z (rᵀX_q)(rᵀX_p); a new array."""
        key = row.tobytes()
        if key not in self._products:
            following, driven = self.receptance.following, _read(row, self._driven_motion)
            if self.receptance.interface:
                out = self._motion[0] * _read(row, following[:, 0])
                for i in range(1, len(self._motion)):
                    out += self._motion[i] * _read(row, following[:, i])
                out += _read(row, self._held)
                out *= -driven[:, None]
            else:
                out = -driven[:, None] * _read(row, self._held)
            self._products[key] = out
        return factor * self._products[key]

    def _by_head(self, parts: Sequence[Part], moves: Sequence[tuple[int, Row]], driven: Row | None) -> ComplexArray:
        """α + βᵀ u_p + u_qᵀ γ; a new array."""
        following, motion, blocked = self.receptance.following, self._driven.motion, self._driven.blocked
        count = len(motion)
        alpha = np.zeros((len(self.outputs), self.s.size), dtype=np.complex128)
        beta = np.zeros((count, *alpha.shape), dtype=np.complex128)
        gamma = np.zeros((count, *motion.shape[1:]), dtype=np.complex128)
        for factor, part in parts:
            matrix = np.outer(part, part) if part.ndim == 1 else part
            held, moved = -factor * mixed(matrix, self._held), -factor * mixed(matrix, self._driven_motion)
            alpha += dot(held, blocked[:, None])
            for i in range(count):
                beta[i] += dot(held, following[:, i, None])
                gamma[i] += dot(moved, following[:, i, None])
        for c, move in moves:
            alpha[c] += self.factors[c] * _read(move, blocked)
            for i in range(count):
                beta[i, c] += self.factors[c] * _read(move, following[:, i])
        if driven is not None:
            alpha += _read(driven, self._held)
            for i in range(count):
                gamma[i] += _read(driven, following[:, i])
        if not count:
            return alpha[None]
        out: ComplexArray = beta[0] * motion[0][:, None]
        out += alpha
        for i in range(1, count):
            out += beta[i] * motion[i][:, None]
        for i in range(count):
            out += self._motion[i] * gamma[i][:, None]
        return out

    # -- the head -----------------------------------------------------------------------------------------------------------

    def _row_change(self, path: Path, name: str, d_rows: Rows) -> Row | None:
        if self.receptance.shaken(name):
            return self._base_inertia_change(path)
        return None if self.receptance.is_rail(name) else d_rows.get(self.model.port_of(name))

    def _base_inertia_change(self, path: Path) -> Row | None:
        carried = self.model.influence
        assert carried is not None
        changes, assembly = self.receptance.core_changes(path), self.receptance.assembly
        if changes is not None:
            masses = [part for power, part in changes.stiffness if power == 2]
            return -(masses[0] @ carried) if masses else None
        out = np.zeros((carried.size, self.s.size), dtype=np.complex128)
        for a, at in zip(assembly.elements, assembly.paths, strict=True):
            if path == ("s",) or path[: len(at)] == at:
                p = self.receptance.foot(a)
                out -= np.multiply.outer(p * (p @ carried), _apparent_mass_change(a.element, str(path[-1]), self.s))
        return out

    def _stiffness_parts(self, path: Path, changes: Changes | None) -> list[Part]:
        """dE, how the dynamic stiffness of the head, or of a structure, moves with a value."""
        s, assembly = self.s, self.receptance.assembly
        parts: list[Part] = []
        if path == ("s",):
            parts += [(1.0, assembly.core.damping), (2 * s, assembly.core.mass)]
        d_rows: Rows = {}
        if changes is not None:
            d_rows = changes.rows
            parts += [((1.0, s, s * s)[power], part) for power, part in changes.stiffness]
        for a, at in zip(assembly.elements, assembly.paths, strict=True):
            p, dp = self.receptance.foot(a), a.moved(d_rows)
            if path == (*at[:-1], "angle"):
                dp = a.turned(self.receptance.rows)
            if path == ("s",) or path[: len(at)] == at:
                parts.append((a.element.derivative(str(path[-1]), s), p))
            if dp is not None:
                parts.append((a.element.dynamic_stiffness(s), np.outer(dp, p) + np.outer(p, dp)))
        return parts

    # -- the rail -----------------------------------------------------------------------------------------------------------

    @cached_property
    def _fields(self) -> list[RailField | None]:
        """Fields of the outputs, then of the input, then of the base."""
        return [*(a.field for a in self._at_outputs), self._driven.field, self.receptance.base_field]

    @cached_property
    def _under_head(self) -> RailPair:
        return RailPair(self.receptance.base_field, self.receptance.base_field)

    def _pair(self, left: int, right: int) -> RailPair | None:
        """Two of those fields; None where either is not of the rail."""
        a, b = self._fields[left], self._fields[right]
        if a is None or b is None:
            return None
        if (left, right) not in self._pairs:
            self._pairs[left, right] = RailPair(a, b)
        return self._pairs[left, right]

    def _with_rail(self, out: ComplexArray | None, path: Path) -> ComplexArray | None:
        """The head's part and what the rail and its twist add."""
        rail, every = self.receptance.rail.model, path == ("s",)
        d_bending: ComplexArray | None = None
        direct: list[tuple[int, ComplexArray]] = []
        if every or (path[0] == "rail" and path[1] != "torsion"):
            name = path if every else _rail_name(path)
            driven, base = len(self.outputs), len(self.outputs) + 1
            d_bending = self._under_head.derivative(name)
            # One field carries each port: what reaches it through the head's base, plus its own.
            by_input = self._derivative(base, driven, name)
            if by_input is not None:
                out = _plus(out, self._force[0] * by_input[:, None])
            for c in range(len(self.outputs)):
                by_output, both = self._derivative(c, base, name), self._derivative(c, driven, name)
                if by_output is not None:
                    direct.append((c, by_output * self._driven.force[0]))
                if both is not None:
                    direct.append((c, both))
        if d_bending is not None:
            out = _plus(out, self._force[0] * (d_bending * self._driven.force[0])[:, None])
        if rail.torsion and (every or (path[:2] == ("rail", "torsion") and path[2] != "eccentricity")):
            d_twist = self.receptance.twist.derivative(str(path[-1])) * self._driven.force[1]
            out = _plus(out, self._force[1] * d_twist[:, None])
        if path == ("rail", "parameters", "mass"):
            direct += self._normalisation(rail.parameters.mass)
        if out is not None:
            for c, change in direct:
                out[:, c] += self.factors[c] * change
        return out

    def _derivative(self, left: int, right: int, name: Path) -> ComplexArray | None:
        pair = self._pair(left, right)
        return None if pair is None else pair.derivative(name)

    def _normalisation(self, mass: float) -> list[tuple[int, ComplexArray]]:
        """A modal coordinate is normalised by the rail's mass, so its own row moves too."""
        found = []
        for c, output in enumerate(self.outputs):
            modal = sum(name.startswith("eta") for name in (output, self.input))
            if modal:
                found.append((c, modal / (2 * mass) * self.receptance.between(output, self.input)))
        return found


@lru_cache(maxsize=8)
def _pairs(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the upper triangle of a matrix."""
    return np.triu_indices(n)


def _plus(total: ComplexArray | None, more: ComplexArray) -> ComplexArray:
    return more if total is None else total + more


def _read(row: Row, motion: ComplexArray) -> ComplexArray:
    """A row applied to motions, shape (n, …, frequency)."""
    if row.ndim == 2:
        return dot(row.reshape(len(row), *[1] * (motion.ndim - 2), -1), motion)
    used = np.flatnonzero(row)
    if used.size == 0:
        return np.zeros(motion.shape[1:], dtype=np.complex128)
    if used.size == 1 and row[used[0]] == 1.0:
        return cast(ComplexArray, motion[used[0]])
    return dot(row[used], motion[used])


def _rail_name(path: Path) -> Path:
    """A rail path as `RailPair.derivative` takes it."""
    if path[1] == "parameters":
        return path[2:]
    if path[1] == "attachments":
        return ("attachments", path[2], path[-1])
    return path[1:]


def _apparent_mass_change(element: Element, name: str, s: ComplexArray) -> ComplexArray:
    """Derivative of `receptance.apparent_mass`."""
    if isinstance(element, SprungMass):
        change = element.derivative(name, s) / s**2
        return change - 2 * element.dynamic_stiffness(s) / s**3 if name == "s" else change
    return (1.0 if name == "mass" and isinstance(element, SpringDamperMass) else 0.0) + 0 * s
