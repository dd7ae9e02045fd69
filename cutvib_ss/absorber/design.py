"""
The absorbers of a given mass whose worst is the best: over the whole rail, the force's harmonics and the tolerances.

min over tunings, dampings and shares of the mass of max over positions, harmonics (or RMS), rates, and the corners of the
tolerance box. Differential evolution finds the basin on part of the positions, successive linear programs the bottom on
all of them (`cutvib_ss.absorber.minimax`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize

from cutvib_ss.absorber.coupling import MountedAbsorber
from cutvib_ss.absorber.force import HarmonicForce
from cutvib_ss.absorber.minimax import minimax
from cutvib_ss.absorber.tolerance import EXACT, AbsorberTolerance
from cutvib_ss.absorber.workspace import (
    WORKSPACE,
    Criterion,
    Workspace,
    WorkspaceCheck,
    workspace_check,
)
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import AbsorberParameters, check_number, names_of
from cutvib_ss.results import FloatArray
from cutvib_ss.results.display import Drawn, Table, data_frame

TUNING = (150.0, 500.0)
"""Tuning frequencies among which the best is sought [Hz]."""
DAMPING_RATIO = (0.01, 0.05)
"""Damping ratios of steel beams (Section 7)."""

_COARSE = 12
"""Positions for differential evolution."""
_LEAST_SHARE = 0.02
"""Of several absorbers, each has at least about this part of the mass."""


@dataclass(frozen=True, repr=False)
class AbsorberDesign(Drawn):
    """
    The best absorbers of a given mass.

    Parameters
    ----------
    mounted : tuple of MountedAbsorber
        The absorbers.
    check : WorkspaceCheck
        What they do over the rail.
    objective : float
        The largest acceleration over rail, harmonics and tolerance, which was made smallest [m/s^2].
    evaluations : int
        How often the first, global stage asked for it.
    """

    mounted: tuple[MountedAbsorber, ...]
    check: WorkspaceCheck
    objective: float
    evaluations: int

    def to_dataframe(self) -> Any:
        """
        The absorbers as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each absorber, from 1: port, tuning [Hz], damping ratio, stiffness [N/m], mass [kg].
        """
        absorbers = [m.absorber for m in self.mounted]
        columns = {
            "port": [m.port for m in self.mounted],
            "tuning [Hz]": [a.frequency for a in absorbers],
            "damping_ratio": [a.damping_ratio for a in absorbers],
            "stiffness [N/m]": [a.stiffness for a in absorbers],
            "mass [kg]": [a.mass for a in absorbers],
        }
        return data_frame(columns, "absorber", range(1, len(absorbers) + 1))

    def _table(self) -> Table:
        rows = []
        for m in self.mounted:
            a = m.absorber
            rows.append((m.port, f"{a.frequency:.2f}", f"{a.damping_ratio:.4f}", f"{a.stiffness:.6g}", f"{a.mass:.4g}"))
        before, exact, toleranced = self.check.worst
        title = (
            f"Absorber design: worst {exact:.4g} m/s^2 as designed, {toleranced:.4g} in tolerance, {before:.4g} without"
        )
        return Table(title, ("port", "tuning [Hz]", "damping", "k [N/m]", "mass [kg]"), rows)


def design_absorbers(
    machine: Machine,
    mass: float,
    *,
    ports: str | Sequence[str] = ("tool_x",),
    positions: ArrayLike = WORKSPACE,
    force: HarmonicForce | None = None,
    outputs: str | Sequence[str] = ("tool_x",),
    criterion: Criterion = "harmonic",
    tolerance: AbsorberTolerance = EXACT,
    tuning: tuple[float, float] = TUNING,
    damping_ratio: tuple[float, float] = DAMPING_RATIO,
    seed: int = 0,
) -> AbsorberDesign:
    """
    The absorbers of a given mass whose worst is the best.

    Parameters
    ----------
    machine : Machine
        The machine without them.
    mass : float
        Mass of all of them together [kg].
    ports : str or sequence of str
        Where each sits and in which direction it works; as many absorbers as names, a name may come again.
    positions : array_like, shape (position,)
        y_b / L over which the worst is taken; the whole rail by default.
    force : HarmonicForce, optional
        The force on the tool; by default 1 N at 217 Hz.
    outputs : str or sequence of str
        Ports whose acceleration counts.
    criterion : {"harmonic", "rms"}
        What counts: the amplitude of the largest harmonic, or the RMS of all.
    tolerance : AbsorberTolerance
        The box in which the design has to serve; none by default.
    tuning : tuple of float
        Lowest and highest tuning frequency [Hz].
    damping_ratio : tuple of float
        Lowest and highest damping ratio.
    seed : int
        Seed of the global stage.

    Returns
    -------
    AbsorberDesign
        The absorbers, and what they do.

    Raises
    ------
    ParameterError
        If no port is named, or a range or the mass is impossible.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> design = design_absorbers(published_machine(), 0.08, positions=[0.1, 1 / 3, 1 / 2])
    >>> [round(value, 2) for value in design.check.worst]
    [2.78, 0.23, 0.23]
    """
    check_number("mass", mass, 0.0, strict=True)
    ports, outputs = names_of(ports), names_of(outputs)
    if not ports:
        raise ParameterError("no port is named; an absorber needs a place")
    for name, (low, high) in (("tuning", tuning), ("damping_ratio", damping_ratio)):
        if not 0.0 < low <= high < np.inf:
            raise ParameterError(f"{name} from {low:g} to {high:g}: the range must be above zero, its ends in order")
    drive = HarmonicForce.tone() if force is None else force
    unlike = tuple(dict.fromkeys(ports))
    at = [unlike.index(p) for p in ports]
    where = np.atleast_1d(np.asarray(positions, dtype=float))
    # The basin is decided by tuning and rate; dampings, masses and other machines only raise its floor a little.
    rough = replace(tolerance, damping_ratio=0.0, mass=0.0, machines=0)
    (full, problem), (coarse, rough_problem) = (
        (
            Workspace(machine, unlike, places, drive, outputs, criterion, box),
            _Problem(mass, tuning, damping_ratio, len(ports), box.factors(len(ports))),
        )
        for places, box in ((where, tolerance), (where[:: max(1, where.size // _COARSE)], rough))
    )

    def worst(x: FloatArray) -> float:
        return float(coarse.values(rough_problem.cases(x)[0], at).max())

    n = problem.size
    cube = optimize.Bounds(np.zeros(n), np.ones(n))
    found = optimize.differential_evolution(
        worst, cube, popsize=max(6, 20 // n), maxiter=30 * n, tol=1e-3, polish=False, init="sobol", rng=seed
    )

    def functions(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        cases, chain = problem.cases(x)
        values, slopes = full.gradient(cases, at)
        to_x = np.einsum("cpvkj,ckjx->cpvx", slopes, chain)
        return values.ravel(), to_x.reshape(values.size, n)

    x, objective = minimax(functions, found.x)
    mounted = problem.absorbers(x, ports)
    check = workspace_check(
        machine, mounted, where, force=drive, outputs=outputs, criterion=criterion, tolerance=tolerance
    )
    return AbsorberDesign(mounted, check, objective, int(found.nfev))


def mass_front(machine: Machine, masses: Sequence[float], **options: Any) -> tuple[AbsorberDesign, ...]:
    """
    The best absorbers for each of several masses: mass against worst acceleration.

    Parameters
    ----------
    machine : Machine
        The machine without absorbers.
    masses : sequence of float
        Masses of all absorbers together [kg].
    **options : object
        As for `design_absorbers`.

    Returns
    -------
    tuple of AbsorberDesign
        One for each mass, in their order.
    """
    return tuple(design_absorbers(machine, float(m), **options) for m in masses)


@dataclass(frozen=True)
class _Problem:
    """From the unit cube to absorbers: tuning even in the logarithm, damping even, mass by shares of the whole."""

    mass: float
    tuning: tuple[float, float]
    damping_ratio: tuple[float, float]
    count: int
    factors: FloatArray

    @property
    def size(self) -> int:
        # One absorber has all the mass, and no share to choose.
        return 2 if self.count == 1 else 3 * self.count

    def nominal(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Parameters, shape (absorber, 3), and their derivatives to x, shape (absorber, 3, x)."""
        k = self.count
        (f_low, f_high), (d_low, d_high) = self.tuning, self.damping_ratio
        span = np.log(f_high / f_low)
        out, chain = np.empty((k, 3)), np.zeros((k, 3, x.size))
        own = np.arange(k)
        out[:, 0] = f_low * np.exp(span * x[:k])
        chain[own, 0, own] = span * out[:, 0]
        out[:, 1] = d_low + (d_high - d_low) * x[k : 2 * k]
        chain[own, 1, k + own] = d_high - d_low
        out[:, 2] = self.mass
        if k > 1:
            parts = _LEAST_SHARE + x[2 * k :]
            shares = parts / parts.sum()
            out[:, 2] *= shares
            chain[:, 2, 2 * k :] = self.mass * (np.eye(k) - shares[:, None]) / parts.sum()
        return out, chain

    def cases(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same for every corner of the tolerance."""
        out, chain = self.nominal(x)
        return out * self.factors, chain * self.factors[..., None]

    def absorbers(self, x: FloatArray, ports: Sequence[str]) -> tuple[MountedAbsorber, ...]:
        rows, _ = self.nominal(x)
        return tuple(
            MountedAbsorber(AbsorberParameters(float(f), float(d), float(m), source="minimax design"), port)
            for (f, d, m), port in zip(rows, ports, strict=True)
        )
