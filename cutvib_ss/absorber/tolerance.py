"""How far absorbers, the tool's rate and the machine may be from what was designed, and the cases that stand for it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.measurement_chain import MeasurementChain
from cutvib_ss.parameters import TOLERANCED_HEAD, TOLERANCED_RAIL, check_number
from cutvib_ss.results import FloatArray

_RATES = 5
"""Rates at which the tool is tried, from the slowest to the fastest within tolerance."""


@dataclass(frozen=True)
class AbsorberTolerance:
    """
    How far an absorber, the tool's rate and the machine may be from what was designed.

    Parameters
    ----------
    frequency : float
        Tuning frequency, either way, as a fraction: manufacture, clamping, temperature.
    damping_ratio : float
        Damping ratio, either way, as a fraction.
    mass : float
        Mass, either way, as a fraction.
    rate : float
        Rate of the tool, either way, as a fraction: the supply's pressure.
    machines : int
        Number of machines drawn within ``machine.tolerance`` (normal, cut at two standard deviations) and tried besides.
    seed : int
        Seed of that draw.
    """

    frequency: float = 0.02
    damping_ratio: float = 0.2
    mass: float = 0.01
    rate: float = 0.01
    machines: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("frequency", "damping_ratio", "mass", "rate"):
            if check_number(f"tolerance.{name}", getattr(self, name), 0.0) >= 1.0:
                raise ParameterError(f"tolerance.{name} = {getattr(self, name)} is a fraction: it must be below 1")
        check_number("tolerance.machines", self.machines, 0)

    def factors(self, count: int) -> FloatArray:
        """
        Factors on the absorbers' tuning, damping and mass: the design as it is, then the corners of the box.

        Parameters
        ----------
        count : int
            Number of absorbers.

        Returns
        -------
        ndarray, shape (case, absorber, 3)
            Each absorber is tuned by itself, while dampings and masses, being of one make, go together.

        Notes
        -----
        Tunings also take their middle: of two absorbers one may be right while the other is off.
        """
        tunings = sorted({-self.frequency, 0.0, self.frequency})
        others = product(sorted({-self.damping_ratio, self.damping_ratio}), sorted({-self.mass, self.mass}))
        cases = [[[0.0] * 3] * count]
        cases += [[[f, d, m] for f in each] for (d, m) in others for each in product(tunings, repeat=count)]
        return 1.0 + np.unique(np.reshape(cases, (len(cases), count, 3)), axis=0) if count else np.ones((1, 0, 3))

    def rates(self) -> FloatArray:
        """
        Factors on the tool's rate.

        Returns
        -------
        ndarray, shape (rate,)
            Evenly over the tolerance; one where there is none.
        """
        return 1.0 + np.linspace(-self.rate, self.rate, _RATES) if self.rate else np.ones(1)


EXACT = AbsorberTolerance(0.0, 0.0, 0.0, 0.0)
"""All as designed."""


def machine_as_built(machine: Machine) -> Machine:
    """A machine without its measurement chain."""
    return replace(machine, chain=MeasurementChain())


def machines_within(machine: Machine, tolerance: AbsorberTolerance) -> list[Machine]:
    """Machines drawn within the machine's own tolerances."""
    rng = np.random.default_rng(tolerance.seed)
    plain, out = machine_as_built(machine), []
    for _ in range(tolerance.machines):
        off = {
            name: 1.0 + getattr(machine.tolerance, name) * _cut_normal(rng)
            for name in (*TOLERANCED_HEAD, *TOLERANCED_RAIL)
        }
        head = replace(plain.head, **{name: off[name] * getattr(plain.head, name) for name in TOLERANCED_HEAD})
        beam = replace(
            plain.rail.parameters,
            **{name: off[name] * getattr(plain.rail.parameters, name) for name in TOLERANCED_RAIL},
        )
        out.append(replace(plain, head=head, rail=replace(plain.rail, parameters=beam)))
    return out


def _cut_normal(rng: np.random.Generator) -> float:
    return float(np.clip(rng.standard_normal(), -2.0, 2.0))
