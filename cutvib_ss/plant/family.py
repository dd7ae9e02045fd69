"""
The family of plants over the rail: one linear parameter-varying model, exact at every position and as a table over a grid.

All plants share their states: the coordinates q of `cutvib_ss.model.coupling`, which mean the same wherever the head
stands, and their rates, scaled by constants. In descriptor form the family is affine in functions of position, exactly:

    M(y) q̈ + C(y) q̇ + K(y) q = B(y) f,    z = P(y) q,    M(y) = Σ_k ρ_k(y) M_k ...

The table (`cutvib_ss.plant.table`) interpolates these matrices. Straight between grid points they stay symmetric and definite, as
means of such: every interpolated plant is stable and passive, as plants of interpolated state matrices need not be.

What that does to a response H = P Z⁻¹ B, Z = K + sC + s²M: with x̂ = Ẑ⁻¹B̂ and entrywise bounds E on |Ẑ - Z|, β on |B̂ - B| and
γ on |P̂ - P|, the error e = |x̂ - x| satisfies (I - GE) e ≤ G (β + E|x̂|), G = |Ẑ⁻¹|. While the spectral radius of GE is below one,

    |Ĥ - H| ≤ |P̂Ẑ⁻¹| (β + E(|x̂| + e)) + γ (|x̂| + e),    e ≤ (I - GE)⁻¹ G (β + E|x̂|),

all of it known from the table. Where it is not, a resonance may lie on the other side of the frequency: the bound is infinite,
and the grid too coarse to tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import PLANT_OUTPUTS, Machine
from cutvib_ss.parameters import check_choice, check_position, names_of
from cutvib_ss.plant.table import ERROR_ORDER, Interpolation, PlantMatrices, PlantTable
from cutvib_ss.response.axes import as_laplace, as_positions
from cutvib_ss.results import ComplexArray, FloatArray, FrequencyResponse, Quantity
from cutvib_ss.results.arrays import label_indices, position_indices
from cutvib_ss.results.display import Displayed, Table, span
from cutvib_ss.units import DERIVATIVE_ORDER

if TYPE_CHECKING:
    import control


@dataclass(frozen=True, eq=False, repr=False)
class PlantSchedule(Displayed):
    """
    The plants of a machine over positions, in common states.

    Parameters
    ----------
    machine : Machine
        The machine.
    table : PlantTable
        Its matrices over positions, exact and interpolated; its outputs are those and what leaks into them.
    outputs : tuple of str
        Names of the outputs.
    quantity : {"displacement", "velocity", "acceleration"}
        Which motion the outputs give.
    pade_order : int, optional
        Order of the Padé approximation of channel delays.
    scaled_at : float, optional
        Position y_b / L whose matrices scale the states of all plants; by default the middle one of the grid.
    """

    machine: Machine
    table: PlantTable
    outputs: tuple[str, ...]
    quantity: Quantity
    pade_order: int | None = None
    scaled_at: float | None = None

    def __post_init__(self) -> None:
        if self.scaled_at is None:
            object.__setattr__(self, "scaled_at", float(self.positions[self.positions.size // 2]))

    def _table(self) -> Table:
        title = f"Plants at {self.positions.size} positions ({span(self.positions)}), {len(self.states)} states, {self.quantity}"
        rows = [("inputs", ", ".join(self.inputs)), ("outputs", ", ".join(self.outputs))]
        return Table(title, ("", ""), rows)

    @property
    def positions(self) -> FloatArray:
        """Grid points y_b / L."""
        return self.table.positions

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return self.table.inputs

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states: coordinates, then their rates."""
        return (*self.table.coupling.dofs, *(f"d_{d}" for d in self.table.coupling.dofs))

    def sel(
        self,
        *,
        position: float | Sequence[float] | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> PlantSchedule:
        """
        The family on some of its grid points, with some of its signals, in the same states.

        Parameters
        ----------
        position : float or sequence of float, optional
            Grid points y_b / L to keep (to 1e-9), two or more; the table is interpolated between those that are left.
        output, input : str or sequence of str, optional
            Names to keep, in this order.

        Returns
        -------
        PlantSchedule
            The part.

        Raises
        ------
        ParameterError
            If a label is not there (the message lists those that are), or fewer than two grid points are left.
        """
        grid = _grid(self.positions[position_indices(self.positions, position)])
        outputs = tuple(self.outputs[k] for k in label_indices(self.outputs, output, "output"))
        inputs = tuple(self.inputs[k] for k in label_indices(self.inputs, input, "input"))
        table = replace(self.table, positions=grid, inputs=inputs, outputs=_reads(self.machine, outputs))
        return replace(self, table=table, outputs=outputs)

    def exact(self, position: float) -> control.StateSpace:
        """
        The plant at any position, without interpolation, in the common states.

        Parameters
        ----------
        position : float
            y_b / L, strictly inside (0, 1).

        Returns
        -------
        control.StateSpace
            As `Machine.plant`, but for the choice of states.
        """
        return self._plant(self.table.exact(check_position(position)))

    def interpolated(self, position: float) -> control.StateSpace:
        """
        The plant at a position as the table gives it.

        Parameters
        ----------
        position : float
            y_b / L, within the grid.

        Returns
        -------
        control.StateSpace
            Equal to `exact` at grid points.

        Raises
        ------
        ParameterError
            If the position lies outside the grid.
        """
        return self._plant(self.table.between(position))

    def state_matrices(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """
        The table as arrays, for other programs: A, B, C and D at the grid points.

        Returns
        -------
        a, b, c, d : ndarray, shape (grid, row, column)
            In the common states; at grid points nothing is interpolated.
        """
        plants = [self.exact(float(y)) for y in self.positions]
        return tuple(np.array([getattr(p, name) for p in plants]) for name in "ABCD")  # type: ignore[return-value]

    def frequency_response(
        self, positions: ArrayLike, freq: ArrayLike, interpolated: bool = False
    ) -> FrequencyResponse:
        """
        Frequency responses of the family, before the measurement chain.

        Parameters
        ----------
        positions : array_like, shape (position,)
            y_b / L.
        freq : array_like, shape (frequency,)
            Frequencies [Hz].
        interpolated : bool
            Read from the table instead of exact.

        Returns
        -------
        FrequencyResponse
            ``data`` of shape (position, output, input, frequency).
        """
        places = as_positions(self.machine, positions)
        lines, s = as_laplace(freq, 0.0)
        matrices = [self.table.between(y) if interpolated else self.table.exact(y) for y in places]
        data = (
            np.array([m.outputs[: len(self.outputs)] @ _solve(m, s) for m in matrices])
            * (s**self._order)[:, None, None]
        )
        quantities = (self.quantity,) * len(self.outputs)
        return FrequencyResponse(np.moveaxis(data, 1, -1), lines, places, self.outputs, self.inputs, quantities)

    def error(self, positions: ArrayLike, freq: ArrayLike) -> FloatArray:
        """
        What interpolation does to the responses, computed with the exact ones beside.

        Parameters
        ----------
        positions : array_like, shape (position,)
            y_b / L, within the grid.
        freq : array_like, shape (frequency,)
            Frequencies [Hz].

        Returns
        -------
        ndarray, shape (position, output, input, frequency)
            |Ĥ - H|.
        """
        table, exact = (self.frequency_response(positions, freq, which).data for which in (True, False))
        out: FloatArray = np.abs(table - exact)
        return out

    def error_bound(self, positions: ArrayLike, freq: ArrayLike) -> FloatArray:
        """
        What interpolation can do to the responses at most, known from the table alone.

        Parameters
        ----------
        positions : array_like, shape (position,)
            y_b / L, within the grid.
        freq : array_like, shape (frequency,)
            Frequencies [Hz].

        Returns
        -------
        ndarray, shape (position, output, input, frequency)
            Never below `error`; infinite where the grid is too coarse.

        Raises
        ------
        CouplingError
            If the rail twists: one of its coordinates belongs to the place of the head.
        """
        places = as_positions(self.machine, positions)
        _, s = as_laplace(freq, 0.0)
        out = [self._bound_at(float(y), s) for y in places]
        bound: FloatArray = np.moveaxis(np.array(out), 1, -1)
        return bound

    @property
    def _order(self) -> int:
        return DERIVATIVE_ORDER[self.quantity]

    @cached_property
    def _scale(self) -> tuple[FloatArray, float]:
        """Scales of the coordinates and of time, the same for all plants: those at `scaled_at`."""
        assert self.scaled_at is not None
        mass, _, stiffness = self.table.coupling.matrices(self.scaled_at)
        squares = linalg.eigvalsh(stiffness, mass)
        positive = squares[squares > 1e-12 * squares[-1]]
        return np.sqrt(np.diag(mass)), float((positive[0] * positive[-1]) ** 0.25)

    def _plant(self, m: PlantMatrices) -> control.StateSpace:
        scale, w0 = self._scale
        n = scale.size
        factor = linalg.cho_factor(m.mass)
        inner = scale[:, None] * linalg.cho_solve(factor, np.hstack([m.stiffness, m.damping, m.inputs]))
        stiff, damped, driven = inner[:, :n] / scale, inner[:, n : 2 * n] / scale, inner[:, 2 * n :]

        a = np.block([[np.zeros((n, n)), w0 * np.eye(n)], [-stiff / w0, -damped]])
        b = np.vstack([np.zeros_like(driven), driven / w0])
        c, d = np.hstack([m.outputs / scale, np.zeros_like(m.outputs)]), np.zeros((len(m.outputs), len(self.inputs)))
        for _ in range(self._order):
            c, d = c @ a, c @ b

        import control  # late: it takes long, and few commands need it

        def build(signals: Sequence[str]) -> control.StateSpace:
            # The table holds what the chain's outputs need.
            return control.ss(
                a, b, c, d, inputs=list(self.inputs), outputs=list(signals), states=list(self.states), name="machine"
            )

        return self.machine.chain.plant(build, self.outputs, self.pade_order)

    def _bound_at(self, position: float, s: ComplexArray) -> FloatArray:
        m, off = self.table.between(position), self.table.bound(position)
        reads, missed = m.outputs[: len(self.outputs)], off.outputs[: len(self.outputs)]
        size = np.abs(s)[:, None, None]
        inverse = np.linalg.inv(_dynamic(m, s))
        felt = np.abs(inverse)
        wrong = off.stiffness + size * off.damping + size**2 * off.mass
        motion = np.abs(inverse @ m.inputs)
        loop = felt @ wrong
        safe = np.abs(np.linalg.eigvals(loop)).max(axis=-1) < 1.0
        with np.errstate(all="ignore"):
            first = felt @ (off.inputs + wrong @ motion)
            identity = np.eye(m.mass.shape[0])
            extra = np.linalg.solve(np.where(safe[:, None, None], identity - loop, identity), first)
        moved = motion + extra
        bound = np.abs(reads @ inverse) @ (off.inputs + wrong @ moved) + missed @ moved
        out: FloatArray = np.where(safe[:, None, None], bound, np.inf) * size**self._order
        return out


def schedule(
    machine: Machine,
    positions: ArrayLike,
    *,
    inputs: str | Sequence[str] = ("force",),
    outputs: str | Sequence[str] = PLANT_OUTPUTS,
    quantity: Quantity = "displacement",
    interpolation: Interpolation = "linear",
    pade_order: int | None = None,
    viscous_at: float | None = None,
) -> PlantSchedule:
    """
    The family of plants over positions: exact anywhere, and as a table over a grid, in common states.

    Parameters
    ----------
    machine : Machine
        The machine.
    positions : array_like, shape (grid,)
        Grid points y_b / L, two or more.
    inputs, outputs : str or sequence of str
        Signals, as `Machine.plant` takes them.
    quantity : {"displacement", "velocity", "acceleration"}
        Which motion the outputs give.
    interpolation : {"linear", "cubic"}
        How the table is read between grid points.
    pade_order : int, optional
        Order of the Padé approximation of channel delays.
    viscous_at : float, optional
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.

    Returns
    -------
    PlantSchedule
        The family.

    Raises
    ------
    ParameterError
        If there are fewer than two different positions, or the interpolation is unknown.
    CouplingError
        If damping is hysteretic and no ``viscous_at`` is given.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> family = schedule(published_machine(), [0.1, 0.3, 0.5, 0.7, 0.9], outputs=["tool_x"])
    >>> family.exact(0.4).nstates, family.interpolated(0.4).nstates
    (12, 12)
    >>> bool(family.error(0.4, 217.0).item() < family.error_bound(0.4, 217.0).item())
    True
    """
    grid = _grid(as_positions(machine, positions))
    check_choice("interpolation", interpolation, tuple(ERROR_ORDER))
    check_choice("quantity", quantity, tuple(DERIVATIVE_ORDER))
    drives, signals = names_of(inputs), names_of(outputs)
    table = PlantTable(machine.coupling(viscous_at), grid, drives, _reads(machine, signals), interpolation)
    return PlantSchedule(machine, table, signals, quantity, pade_order)


def _grid(positions: FloatArray) -> FloatArray:
    """The different ones of some positions, ascending; two at least."""
    grid = np.unique(positions)
    if grid.size < 2:
        raise ParameterError("a table over positions needs two of them at least; `exact` gives the plant at one")
    return grid


def _reads(machine: Machine, signals: Sequence[str]) -> tuple[str, ...]:
    """The outputs that a table needs: those asked for, then what leaks into them."""
    return tuple(dict.fromkeys(machine.chain.signals(signals)))


def _dynamic(m: PlantMatrices, s: ComplexArray) -> ComplexArray:
    z = s[:, None, None]
    out: ComplexArray = m.stiffness + z * m.damping + z**2 * m.mass
    return out


def _solve(m: PlantMatrices, s: ComplexArray) -> ComplexArray:
    driven = np.broadcast_to(m.inputs, (s.size, *m.inputs.shape)).astype(np.complex128)
    return np.asarray(np.linalg.solve(_dynamic(m, s), driven), dtype=np.complex128)
