"""
Derivatives of the rail's receptance to its values.

From D v = p, with v the motion for a unit force at p: d(v_lᵀ p_r) = dp_lᵀ v_r + v_lᵀ dp_r - v_lᵀ dD v_r. Each value moves one
kind of D's energy, stored, dissipated or kinetic, so that a few sums over the modes serve all of them.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.model.paths import Path
from cutvib_ss.model.pinned_modes import PinnedModes
from cutvib_ss.response.batched import dot, mixed
from cutvib_ss.response.rail_receptance import RailField, RailPort
from cutvib_ss.results import ComplexArray, FloatArray


class RailPair:
    """The derivatives of the receptance between two ports."""

    def __init__(self, left: RailField, right: RailField) -> None:
        self.rail, self.left, self.right = left.rail, left, right

    def derivative(self, name: Path) -> ComplexArray:
        """Derivative of the receptance to one of the rail's values, shape (position, frequency)."""
        out = -self._beam(name)
        if self.rail.released:
            out = out - self._supports(name)
        for k in range(len(self.rail.attached)):
            out = out - self._attachment(k, name)
        if name[0] == "shear":
            out = out + self._ports_under_shear()
        return out

    # -- the beam itself ----------------------------------------------------------------------------------------------------

    @cached_property
    def _by_shear(self) -> PinnedModes:
        return self.rail.model.modes_by_shear

    @cached_property
    def _sums(self) -> tuple[ComplexArray, ComplexArray]:
        """Σ (1, w², w w') a_l a_r and Σ (w, w') ζ_r/ζ a_l a_r over the modes, w' being the derivative to the shear ratio."""
        rail, w = self.rail, self.rail.w
        undamped, damped = [np.ones(w.size), w**2], [rail.damped_w]
        if rail.model.shear is not None:
            moved = 2 * np.pi * rail.model.parameters.first_frequency * self._by_shear.frequency
            undamped.append(w * moved)
            damped.append(rail.model.damping_weight * moved)
        n, weights = len(undamped), np.array(undamped + damped)
        if rail.pinned:
            shapes = self.left.port.elastic * self.right.port.elastic
            sums = mixed(weights[:, None] * shapes, rail.flexibility_squared)
            return sums[:n], sums[n:]
        elastic = self.left.elastic * self.right.elastic
        sums = mixed(weights, elastic)
        return sums[:n], sums[n:]

    @cached_property
    def _kinetic(self) -> ComplexArray:
        """v_lᵀ M v_r of the beam."""
        out: ComplexArray = self.rail.half * self._sums[0][0]
        return out + self._carried(self.rail.modes) if self.rail.released else out

    def _carried(self, modes: PinnedModes) -> ComplexArray:
        """What rigid motion and the modes carry of each other, and of themselves."""
        u, v = self.left.rigid, self.right.rigid
        total = dot(mixed(modes.coupling.T, self.left.elastic), v) + dot(mixed(modes.coupling.T, self.right.elastic), u)
        out: ComplexArray = self.rail.model.parameters.mass * (total + dot(u, mixed(modes.rigid_inertia, v)))
        return out

    def _beam(self, name: Path) -> ComplexArray:
        """v_lᵀ dD v_r of the beam without ends and attachments."""
        p, s, half = self.rail.model.parameters, self.rail.s, self.rail.half
        undamped, damped = self._sums
        strained = self.rail.strained
        if name[0] == "first_frequency":
            value: ComplexArray = (2 * half / p.first_frequency) * (
                undamped[1] * strained + (p.damping_ratio * s) * damped[0]
            )
        elif name[0] == "damping_ratio":
            value = (2 * half * s) * damped[0]
        elif name[0] == "mass":
            dissipated = (2 * half * p.damping_ratio / p.mass * s) * damped[0]
            value = half / p.mass * undamped[1] * strained + dissipated + (s * s / p.mass) * self._kinetic
        elif name[0] == "s":
            value = 2 * half * p.damping_ratio * damped[0] + 2 * s * self._kinetic
            value = value + half * p.strain_damping * undamped[1]
        elif name[0] in ("losses", "frequencies"):
            value = self._of_mode(str(name[0]), int(name[1]))
        elif name[0] == "strain_damping":
            value = half * s * undamped[1]
        elif name[0] == "shear":
            value = 2 * half * (undamped[2] * strained + (p.damping_ratio * s) * damped[1])
            if self.rail.released:
                value = value + s * s * self._carried(self._by_shear)
        else:
            value = np.zeros((1, s.size), dtype=np.complex128)
        return value

    def _of_mode(self, name: str, k: int) -> ComplexArray:
        """v_lᵀ dD v_r of the factor on the damping, or the natural frequency, of one mode."""
        rail, p = self.rail, self.rail.model.parameters
        of_one = 2 * rail.half / getattr(rail.model, name)[k]
        # A uniform rotation, of number 0, has the damping of the first.
        own = np.flatnonzero(np.maximum(rail.modes.number - 1, 0) == k) if name == "losses" else np.array([k])
        value: ComplexArray = rail.s * self._over(own, of_one * p.damping_ratio * rail.damped_w[own])
        if name == "frequencies":
            value = value + rail.strained * self._over(own, of_one * rail.w[own] ** 2)
        return value

    def _over(self, own: NDArray[np.intp], weights: FloatArray) -> ComplexArray:
        """Σ of some modes' weights over a_l a_r."""
        if self.rail.pinned:
            shapes = self.left.port.elastic[:, own] * self.right.port.elastic[:, own]
            return np.asarray(mixed(weights * shapes, self.rail.flexibility_squared[own]))
        return np.asarray(mixed(weights, self.left.elastic[own] * self.right.elastic[own]))

    def _ports_under_shear(self) -> ComplexArray:
        out: ComplexArray = np.zeros((1, self.rail.s.size), dtype=np.complex128)
        for moving, other in ((self.left, self.right), (self.right, self.left)):
            if moving.port.position is not None:
                row = self._by_shear.deflections(moving.port.position)
                out = out + self.rail.product(self._step(row), other)
        return out

    def _step(self, elastic: FloatArray, rigid: FloatArray | None = None) -> RailField:
        """The field of a row's change."""
        still = np.zeros((elastic.shape[0], 2))
        return self.rail.field(RailPort(elastic, still if rigid is None else rigid))

    # -- what is added to it ------------------------------------------------------------------------------------------------

    def _supports(self, name: Path) -> ComplexArray | float:
        supports, s = self.rail.model.supports, self.rail.s
        assert supports is not None
        ends = self.left.rigid * self.right.rigid
        left, right = supports.elements
        if name[0] == "s" or name[:2] == ("supports", "give"):
            both: ComplexArray = (
                left.derivative(str(name[-1]), s) * ends[0] + right.derivative(str(name[-1]), s) * ends[1]
            )
            return both
        if name[0] != "supports":
            return 0.0
        what, side = str(name[1]).split("_")
        i = ("left", "right").index(side)
        return np.asarray((left, right)[i].derivative({"k": "stiffness", "c": "damping"}[what], s) * ends[i])

    def _attachment(self, k: int, name: Path) -> ComplexArray | float:
        a, s, rail = self.rail.model.attachments[k], self.rail.s, self.rail
        own = name[:2] == ("attachments", k)
        step = self._attachment_step(k, name)
        if step is None and not own and name[0] != "s":
            return 0.0
        left, right = self._at_attachments[k]
        if step is None:
            return a.element.derivative(str(name[-1]), s) * (left * right)
        both = rail.product(step, self.left) * right + left * rail.product(step, self.right)
        return a.element.dynamic_stiffness(s) * both

    @cached_property
    def _at_attachments(self) -> list[tuple[ComplexArray, ComplexArray]]:
        """Motion of each attachment's port in both fields."""
        fields = [self.rail.field(port) for port in self.rail.attached]
        return [(self.rail.product(at, self.left), self.rail.product(at, self.right)) for at in fields]

    def _attachment_step(self, k: int, name: Path) -> RailField | None:
        """How an attachment's row moves; None where it does not."""
        rail, a, at = self.rail, self.rail.model.attachments[k], self.rail.attached[k]
        length, modes = rail.model.parameters.length, rail.modes
        turn = np.pi * modes.number
        if name == ("attachments", k, "position"):
            if a.slope:
                return self._step((-turn * modes.rotation * np.sin(turn * a.position))[None] / length)
            return self._step((turn * modes.deflection * np.cos(turn * a.position))[None], np.array([[-1.0, 1.0]]))
        if name[0] == "length" and a.slope:
            # Slope rows go with 1/L.
            return self._step(-at.elastic / length, -at.rigid / length)
        if name[0] == "shear":
            moved = self._by_shear
            row = moved.rotations(a.position) / length if a.slope else moved.deflections(a.position)[0]
            return self._step(row[None])
        return None
