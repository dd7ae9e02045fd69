"""
Controllers scheduled over the position of the head: a family in common coordinates, its matrices interpolated.

Stability is that of every frozen position; a head that travels fast against the closed loop's slowest pole is another matter.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, optimize

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import check_position
from cutvib_ss.results import ComplexArray, FloatArray, read_only


@dataclass(frozen=True)
class ScheduledController:
    """
    A family of controllers over positions.

    Parameters
    ----------
    positions : array_like, shape (position,)
        y_b / L, ascending.
    controllers : tuple of control.StateSpace
        One a position, of one order and in common coordinates and signals.

    Raises
    ------
    ParameterError
        If positions do not ascend, or controllers differ in signals, period or order.
    """

    positions: FloatArray
    controllers: tuple[control.StateSpace, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "positions", read_only(self.positions, np.float64))
        object.__setattr__(self, "controllers", tuple(self.controllers))
        if self.positions.size != len(self.controllers) or not self.controllers:
            raise ParameterError(
                f"{self.positions.size} positions need as many controllers, not {len(self.controllers)}"
            )
        if np.any(np.diff(self.positions) <= 0):
            raise ParameterError("positions of a scheduled controller must ascend")
        kinds = {(tuple(c.input_labels), tuple(c.output_labels), c.nstates, c.dt or 0.0) for c in self.controllers}
        if len(kinds) > 1:
            raise ParameterError("controllers of a family must share signals, period and order")

    def at(self, position: float) -> control.StateSpace:
        """
        The controller at a position.

        Parameters
        ----------
        position : float
            y_b / L.

        Returns
        -------
        control.StateSpace
            Matrices interpolated linearly; those of the last one beyond the ends of the family.
        """
        x = float(np.clip(check_position(position), self.positions[0], self.positions[-1]))
        above = int(np.clip(np.searchsorted(self.positions, x), 1, max(len(self.controllers) - 1, 1)))
        low, high = self.controllers[above - 1], self.controllers[min(above, len(self.controllers) - 1)]
        if low is high:
            return low
        share = (x - self.positions[above - 1]) / (self.positions[above] - self.positions[above - 1])
        matrices = [(1 - share) * getattr(low, m) + share * getattr(high, m) for m in "ABCD"]
        return control.ss(*matrices, low.dt, inputs=low.input_labels, outputs=low.output_labels, name=low.name)


def schedule(
    design: Callable[[float], control.StateSpace], positions: ArrayLike, align: bool = False
) -> ScheduledController:
    """
    A controller for each position.

    Parameters
    ----------
    design : callable
        ``design(position)`` gives the controller there.
    positions : array_like, shape (position,)
        y_b / L, ascending.
    align : bool
        Whether to bring the family into common coordinates first. Controllers in the plant's own coordinates, such as LQG,
        H2, H∞ and resonant control, have them by design; reduced ones do not.

    Returns
    -------
    ScheduledController
        The family.
    """
    places = np.atleast_1d(np.asarray(positions, dtype=float))
    family: Sequence[control.StateSpace] = [design(float(y)) for y in places]
    return ScheduledController(places, tuple(in_common_coordinates(family) if align else family))


def in_common_coordinates(controllers: Iterable[control.StateSpace]) -> tuple[control.StateSpace, ...]:
    """
    A family of controllers in modal coordinates that follow one another.

    Parameters
    ----------
    controllers : iterable of control.StateSpace
        Of one order, in any coordinates, poles distinct.

    Returns
    -------
    tuple of control.StateSpace
        The same controllers, a block for each real pole and each pair, in the order of the first one's.

    Raises
    ------
    ParameterError
        If poles cannot be followed: their number changes, or a pair turns into two real ones.

    Notes
    -----
    Interpolated between two neighbours, poles and residues then move on straight lines. In other common coordinates a
    resonator's frequency strays by the square of the change, which is more than its damping ratio.
    """
    out: list[control.StateSpace] = []
    last: ComplexArray | None = None
    for system in controllers:
        poles, drives, reads = _modes(system)
        if last is not None:
            order = _followers(last, poles)
            poles, drives, reads = poles[order], drives[order], reads[:, order]
        last = poles
        blocks = [_block(*mode) for mode in zip(poles, drives, reads.T, strict=True)]
        a, b, c = zip(*blocks, strict=True)
        out.append(
            control.ss(
                linalg.block_diag(*a), np.vstack(b), np.hstack(c), system.D, system.dt,
                inputs=system.input_labels, outputs=system.output_labels, name=system.name,
            )
        )  # fmt: skip
    return tuple(out)


def _followers(last: ComplexArray, poles: ComplexArray) -> NDArray[np.intp]:
    """Which pole continues each of the last ones; a pair stays a pair."""
    if last.size == poles.size:
        distance = np.abs(last[:, None] - poles)
        apart = (last.imag == 0.0)[:, None] != (poles.imag == 0.0)
        order: NDArray[np.intp] = optimize.linear_sum_assignment(distance + 1e12 * apart)[1]
        if not apart[np.arange(order.size), order].any():
            return order
    raise ParameterError(
        "poles of the family cannot be followed from one position to the next; take more positions, or another order"
    )


def _block(pole: complex, drive: ComplexArray, read: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Real A, B and C of a real pole or of a pair."""
    if pole.imag == 0.0:
        return np.array([[pole.real]]), drive.real[None], read.real[:, None]
    a = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    return a, np.stack([drive.real, -drive.imag]), 2 * np.stack([read.real, read.imag], axis=1)


def _modes(system: control.StateSpace) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Poles of the upper half plane, and how each is driven (a row each) and read (a column each)."""
    poles, vectors = linalg.eig(system.A)
    drives, reads = linalg.solve(vectors, system.B), system.C @ vectors
    upper = np.flatnonzero(poles.imag >= 0.0)
    poles, drives, reads = poles[upper], drives[upper], reads[:, upper]
    # An eigenvector's size and phase are free: drive and read as large as each other, the strongest drive real.
    for k in range(poles.size):
        strongest = drives[k, np.argmax(np.abs(drives[k]))]
        size = np.sqrt(np.linalg.norm(reads[:, k]) / np.linalg.norm(drives[k])) * np.abs(strongest) / strongest
        drives[k], reads[:, k] = drives[k] * size, reads[:, k] / size
    return poles, drives, reads
