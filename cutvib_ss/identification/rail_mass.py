"""The rail's mass, which the paper does not print, from the natural frequencies of Table 6."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import optimize

from cutvib_ss.errors import IdentificationError
from cutvib_ss.model.machine import cutting_machine
from cutvib_ss.parameters import HeadParameters, RailParameters, recovered_rail, table_3, table_6
from cutvib_ss.response.modes import modes
from cutvib_ss.results import FloatArray, read_only


@dataclass(frozen=True)
class RailMass:
    """
    A rail's mass recovered from natural frequencies with the head on it.

    Parameters
    ----------
    mass : float
        Mass of the whole rail μL [kg].
    std : float
        One standard deviation, from the scatter of the frequencies about the fit [kg].
    positions : array_like, shape (position,)
        Positions y_b / L.
    given : array_like, shape (position, mode)
        The frequencies that were fitted [Hz].
    computed : array_like, shape (position, mode)
        Those of the machine with this mass [Hz].
    """

    mass: float
    std: float
    positions: FloatArray
    given: FloatArray
    computed: FloatArray

    def __post_init__(self) -> None:
        for name in ("positions", "given", "computed"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def worst_error(self) -> float:
        """Largest relative difference between computed and given frequencies."""
        return float(np.abs(self.computed / self.given - 1.0).max())


def recover_rail_mass(
    frequencies: Mapping[float, Sequence[float]] | None = None,
    head: HeadParameters | None = None,
    rail: RailParameters | None = None,
    n_modes: int = 4,
) -> RailMass:
    """
    Least-squares mass of the rail from natural frequencies at one or more positions.

    Parameters
    ----------
    frequencies : mapping of float to sequence of float, optional
        Position y_b / L to natural frequencies [Hz], ascending from the first; Table 6 by default.
    head : HeadParameters, optional
        The head; Table 3 by default.
    rail : RailParameters, optional
        The rail's other values; those behind Table 5 by default.
    n_modes : int
        Number of rail modes.

    Returns
    -------
    RailMass
        The mass, its scatter, and the frequencies it gives.

    Raises
    ------
    IdentificationError
        If more frequencies are given than the machine has, or they do not determine a mass.

    Notes
    -----
    Minimises the sum of squared relative differences. Table 5 alone fixes only the rail's own frequencies; the mass
    shows once the head loads it.

    Examples
    --------
    >>> round(recover_rail_mass().mass, 1)
    76.5
    """
    table = dict(table_6() if frequencies is None else frequencies)
    base = replace(recovered_rail() if rail is None else rail, n_modes=n_modes)
    parameters = table_3() if head is None else head
    given = [np.asarray(values, dtype=float) for values in table.values()]
    if not given or any(g.size != given[0].size or not 1 <= g.size <= n_modes + 2 for g in given):
        raise IdentificationError(
            f"give the same number of frequencies at each position, at most the {n_modes + 2} that the machine has"
        )
    count = given[0].size

    def computed(log_mass: float) -> FloatArray:
        machine = cutting_machine(parameters, replace(base, mass=float(np.exp(log_mass))))
        rows: FloatArray = np.array([modes(machine, position).natural_freq[:count] for position in table])
        return rows

    def residual(log_mass: FloatArray) -> FloatArray:
        error: FloatArray = computed(float(log_mass[0])) / np.array(given) - 1.0
        return error.ravel()

    start = np.log(base.mass)
    fit = optimize.least_squares(residual, [start], bounds=([start - 3.0], [start + 3.0]), xtol=1e-12, ftol=1e-12)
    slope = float(np.linalg.norm(np.asarray(fit.jac)))
    if not fit.success or slope == 0.0 or abs(fit.x[0] - start) > 2.99:
        raise IdentificationError(
            "these frequencies do not determine the rail's mass; check the head and the positions"
        )
    mass = float(np.exp(fit.x[0]))
    scatter = np.sqrt(2.0 * fit.cost / max(fit.fun.size - 1, 1))
    return RailMass(
        mass, float(mass * scatter / slope), np.array(list(table)), np.array(given), computed(float(fit.x[0]))
    )
