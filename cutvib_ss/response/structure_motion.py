"""
Motion of a structure of many degrees of freedom for forces at its ports.

Over its undamped modes most of a structure is diagonal: E = D + s C_off + ..., where only some coordinates are coupled, by damping
that is not modal or by tuned parts. Those are solved together, line by line, the others one by one. Elements z at rows P change it
by low rank (Sherman-Morrison-Woodbury): X = X₀ - X₀P (1 + Z PᵀX₀P)⁻¹ Z PᵀX₀.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.response.batched import inverse, mixed
from cutvib_ss.results import ComplexArray, FloatArray


class StructureMotion:
    """
    Motions for unit forces at rows, which are solved for together where they are named beforehand.

    ``at`` are the rows of the elements and ``stiffness`` their dynamic stiffness, shape (element, frequency).
    """

    def __init__(
        self,
        core: SecondOrder,
        s: ComplexArray,
        at: Sequence[FloatArray],
        stiffness: Sequence[ComplexArray],
        rows: Sequence[FloatArray],
    ) -> None:
        self._powers = np.array([np.ones_like(s), s, s * s])
        self._polynomial = np.stack([core.stiffness, core.damping, core.mass], axis=-1)
        self._together, self._alone = np.flatnonzero(core.coupled), np.flatnonzero(~core.coupled)
        by_row: dict[bytes, ComplexArray] = {}
        for row, z in zip(at, stiffness, strict=True):
            by_row[row.tobytes()] = by_row.get(row.tobytes(), 0.0) + z
        feet = {row.tobytes(): row for row in at}
        self._feet = np.array([feet[key] for key in by_row]).reshape(len(by_row), len(core.dofs))
        free = self._free(np.array([*self._feet, *rows]).reshape(-1, len(core.dofs)).T[:, :, None])
        self._by_elements = free[:, : len(by_row)]
        if by_row:
            z = np.array(list(by_row.values()))
            seen = np.einsum("en,nkf->ekf", self._feet, self._by_elements)
            self._resists = np.einsum("ekf,kf->ekf", inverse(z[:, None] * seen + np.eye(len(z))[:, :, None]), z)
        self._known = {row.tobytes(): self._held(free[:, [len(by_row) + k]])[:, 0] for k, row in enumerate(rows)}

    def of(self, row: FloatArray | ComplexArray) -> ComplexArray:
        """Motion for a unit force at a row, which may depend on frequency, shape (n, frequency)."""
        key = row.tobytes()
        if key not in self._known:
            self._known[key] = self._held(self._free(row.reshape(len(row), 1, -1)))[:, 0]
        return self._known[key]

    @cached_property
    def _own(self) -> ComplexArray:
        """Receptance of the coordinates that are coupled to none, shape (alone, frequency)."""
        diagonal: FloatArray = self._polynomial[self._alone, self._alone]
        own: ComplexArray = 1.0 / (diagonal @ self._powers)
        return own

    @cached_property
    def _coupled(self) -> ComplexArray:
        """Dynamic stiffness of the others, shape (frequency, together, together)."""
        both = self._polynomial[np.ix_(self._together, self._together)]
        return np.moveaxis(mixed(both, self._powers), -1, 0)

    def _free(self, loads: FloatArray | ComplexArray) -> ComplexArray:
        """Motion without the elements for loads (n, load, frequency or one), shape (n, load, frequency)."""
        out = np.empty((*loads.shape[:2], self._powers.shape[1]), dtype=np.complex128)
        out[self._alone] = self._own[:, None] * loads[self._alone]
        if self._together.size:
            motion = np.linalg.solve(self._coupled, np.moveaxis(loads[self._together], -1, 0))
            out[self._together] = np.moveaxis(motion, 0, -1)
        return out

    def _held(self, free: ComplexArray) -> ComplexArray:
        """Motion with the elements of that without them."""
        if not len(self._feet):
            return free
        force = np.einsum("ekf,kif->eif", self._resists, np.einsum("kn,nif->kif", self._feet, free))
        held: ComplexArray = free - np.einsum("nef,eif->nif", self._by_elements, force)
        return held
