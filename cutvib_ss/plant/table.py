"""
A table over positions: M, C, K, B and P at grid points, read between them, and how far the reading can err.

Between grid points a and b entries are interpolated straight, or by Hermite's cubics through values and slopes. An entry g then
errs by no more than

    |ĝ - g| ≤ (y - a)(b - y)/2 · max|g''|    or    ((y - a)(b - y))²/24 · max|g⁗|,    maxima over [a, b].

The derivatives are those of the affine form, exact at any point; between the points at which they are computed the next
derivative, bounded over the whole rail, limits their growth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.coupling import Coupling
from cutvib_ss.model.machine import CUTTING_SIGNALS
from cutvib_ss.results import FloatArray, read_only

Interpolation: TypeAlias = Literal["linear", "cubic"]

ERROR_ORDER = {"linear": 2, "cubic": 4}
"""Order of the derivative in the error of each interpolation."""
_SAMPLES = 9
"""Points in an interval at which derivatives are computed."""


@dataclass(frozen=True)
class PlantMatrices:
    """
    M, C, K, B and P at a position, or a derivative, an error or a bound of theirs.

    Parameters
    ----------
    mass, damping, stiffness : ndarray, shape (..., n, n)
        Second-order matrices.
    inputs : ndarray, shape (..., n, input)
        Where forces act.
    outputs : ndarray, shape (..., output, n)
        Where motion is read.
    """

    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    inputs: FloatArray
    outputs: FloatArray

    def parts(self) -> tuple[FloatArray, ...]:
        """
        The five of them.

        Returns
        -------
        tuple of ndarray
            In the order of the parameters.
        """
        return self.mass, self.damping, self.stiffness, self.inputs, self.outputs


@dataclass(frozen=True, eq=False)
class PlantTable:
    """
    Matrices over a grid of positions.

    Parameters
    ----------
    coupling : Coupling
        Their exact dependence on position.
    positions : array_like, shape (grid,)
        Grid points y_b / L, ascending.
    inputs, outputs : tuple of str
        Signals, as `Machine.plant` takes them.
    interpolation : {"linear", "cubic"}
        How the table is read between grid points.
    """

    coupling: Coupling
    positions: FloatArray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    interpolation: Interpolation

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", read_only(self.positions, np.float64))

    def exact(self, position: float, order: int = 0) -> PlantMatrices:
        """
        The matrices at any position, without interpolation, or their derivatives.

        Parameters
        ----------
        position : float
            y / L.
        order : int
            Order of the derivative to y / L.

        Returns
        -------
        PlantMatrices
            Exact.
        """

        def rows(signals: Sequence[str]) -> FloatArray:
            ports = [CUTTING_SIGNALS.get(name, name) for name in signals]
            return np.reshape([self.coupling.port(p, position, order) for p in ports], (-1, len(self.coupling.dofs)))

        return PlantMatrices(*self.coupling.matrices(position, order), rows(self.inputs).T, rows(self.outputs))

    def between(self, position: float) -> PlantMatrices:
        """
        The matrices as the table gives them.

        Parameters
        ----------
        position : float
            y / L, within the grid.

        Returns
        -------
        PlantMatrices
            Exact at grid points.

        Raises
        ------
        ParameterError
            If the position lies outside the grid.
        """
        k, t, h = self._place(position)
        values, slopes = self._nodes
        if slopes is None:
            return PlantMatrices(*((1 - t) * x[k] + t * x[k + 1] for x in values.parts()))
        left, right = (1 + 2 * t) * (1 - t) ** 2, t * t * (3 - 2 * t)
        rise, fall = h * t * (1 - t) ** 2, h * t * t * (t - 1)
        return PlantMatrices(
            *(
                left * x[k] + right * x[k + 1] + rise * d[k] + fall * d[k + 1]
                for x, d in zip(values.parts(), slopes.parts(), strict=True)
            )
        )

    def bound(self, position: float) -> PlantMatrices:
        """
        Bounds on the moduli of the table's errors at a position.

        Parameters
        ----------
        position : float
            y / L, within the grid.

        Returns
        -------
        PlantMatrices
            Entry by entry.

        Raises
        ------
        CouplingError
            If the rail twists: one of its coordinates belongs to the place of the head.
        """
        k, t, h = self._place(position)
        inside = h * h * t * (1 - t)
        factor = inside / 2 if self.interpolation == "linear" else inside**2 / 24
        return PlantMatrices(*(factor * part[k] for part in self._largest.parts()))

    @cached_property
    def _nodes(self) -> tuple[PlantMatrices, PlantMatrices | None]:
        """Values at the grid points, and slopes where cubics need them."""
        values = _stack([self.exact(float(y)) for y in self.positions])
        if self.interpolation == "linear":
            return values, None
        return values, _stack([self.exact(float(y), 1) for y in self.positions])

    @cached_property
    def _largest(self) -> PlantMatrices:
        """Largest moduli of the derivative in the interpolation's error, in each interval."""
        order, out = ERROR_ORDER[self.interpolation], []
        growth_matrices = self.coupling.matrices_bound(order + 1)
        riding = self.coupling.transform_bound(order + 1)

        def growth_rows(signals: Sequence[str]) -> FloatArray:
            found = []
            for name in signals:
                port = CUTTING_SIGNALS.get(name, name)
                still = np.zeros(len(self.coupling.dofs))
                found.append(still if self.coupling.on_rail(port) else np.abs(self.coupling.head.port(port)) @ riding)
            return np.reshape(found, (-1, len(self.coupling.dofs)))

        growth = (*growth_matrices, growth_rows(self.inputs).T, growth_rows(self.outputs))
        for a, b in zip(self.positions[:-1], self.positions[1:], strict=True):
            samples = [self.exact(float(y), order).parts() for y in np.linspace(a, b, _SAMPLES)]
            reach = (b - a) / (2 * (_SAMPLES - 1))
            out.append(
                PlantMatrices(
                    *(np.max(np.abs(x), axis=0) + reach * g for x, g in zip(zip(*samples), growth, strict=True))
                )
            )
        return _stack(out)

    def _place(self, position: float) -> tuple[int, float, float]:
        """Interval, part of the way through it, and its length."""
        grid = self.positions
        if not grid[0] <= position <= grid[-1]:
            raise ParameterError(
                f"position = {position:g} lies outside the grid, {grid[0]:g} to {grid[-1]:g}; take `exact` or a wider grid"
            )
        k = min(int(np.searchsorted(grid, position, side="right")) - 1, grid.size - 2)
        h = float(grid[k + 1] - grid[k])
        return k, (position - float(grid[k])) / h, h


def _stack(found: Sequence[PlantMatrices]) -> PlantMatrices:
    return PlantMatrices(*(np.array(x) for x in zip(*(m.parts() for m in found), strict=True)))
