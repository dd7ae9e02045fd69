"""The largest gain of a stable system over all frequencies."""

from __future__ import annotations

import control
from slycot.exceptions import SlycotArithmeticError

from cutvib_ss.errors import DesignError

_TOLERANCES = (1e-10, 1e-8, 1e-6, 1e-4)
"""Relative errors of the norm that are asked for, one after the other: for the first the iteration on eigenvalues may not end."""


def peak_gain(system: control.StateSpace) -> float:
    """L∞ norm of a system without poles on the axis, by a Hamiltonian (SLICOT AB13DD): no grid can miss a sharp peak."""
    for tolerance in _TOLERANCES:
        try:
            return float(control.linfnorm(system, tol=tolerance)[0])
        except SlycotArithmeticError:
            continue
    raise DesignError(
        f"the largest gain of a loop of {system.nstates} states was not found: its poles are too far apart"
    )
