"""
H2 and H∞ synthesis by SLICOT, every norm computed anew from the closed loop.

Two things make it reliable on lightly damped plants. Time is scaled first, for rates of 1 s⁻¹ and of 1e5 s⁻¹ do not mix well in a
Riccati equation. And γ is sought here, among controllers that keep it: the search inside `control.hinfsyn` takes what its
formulas give for granted, and on the published machine with the head at y/L = 0.1 reports γ = 0.004 for a loop of norm 2.8, where
0.205 is the least.
"""

from __future__ import annotations

import control
import numpy as np
import slycot
from slycot.exceptions import SlycotError

from cutvib_ss.control_design.norms import peak_gain
from cutvib_ss.errors import DesignError

_FIRST, _LARGEST, _FINE = 1.0, 1e8, 1.005
"""Where the search for γ starts and gives up, and how closely it closes in on the smallest one."""


def scaled_in_time(system: control.StateSpace) -> tuple[control.StateSpace, float]:
    """A system in units of its own time."""
    rate = float(np.exp(np.mean(np.log(np.maximum(np.abs(system.poles()), 1.0))))) if system.nstates else 1.0
    return control.ss(system.A / rate, system.B / np.sqrt(rate), system.C / np.sqrt(rate), system.D), rate


def in_seconds(system: control.StateSpace, rate: float) -> control.StateSpace:
    """A system back in seconds."""
    return control.ss(system.A * rate, system.B * np.sqrt(rate), system.C * np.sqrt(rate), system.D)


def hinf_controller(plant: control.StateSpace, nmeas: int, ncon: int, gamma: float) -> control.StateSpace:
    """
    The central H∞ controller for a given γ, not verified.

    Parameters
    ----------
    plant : control.StateSpace
        Generalised plant, (w, u) to (z, y).
    nmeas, ncon : int
        Number of measurements y and of commands u, the last of outputs and inputs.
    gamma : float
        Bound on the closed loop's H∞ norm.

    Returns
    -------
    control.StateSpace
        Controller u = K y, in the plant's coordinates.

    Raises
    ------
    DesignError
        If there is no controller for this γ.

    Notes
    -----
    SLICOT's SB10FD, Glover and Doyle's formulas of 1988.
    """
    scaled, rate = scaled_in_time(plant)
    try:
        a, b, c, d, _ = slycot.sb10fd(
            scaled.nstates, scaled.ninputs, scaled.noutputs, ncon, nmeas, gamma, scaled.A, scaled.B, scaled.C, scaled.D
        )
    except SlycotError as error:
        raise DesignError(f"no H∞ controller for γ = {gamma:.6g} ({' '.join(str(error).split())})") from error
    return in_seconds(control.ss(a, b, c, d), rate)


def closed_norm(plant: control.StateSpace, controller: control.StateSpace) -> float:
    """
    H∞ norm of a closed generalised plant, computed from its state space.

    Parameters
    ----------
    plant : control.StateSpace
        Generalised plant.
    controller : control.StateSpace
        Controller u = K y.

    Returns
    -------
    float
        The norm; infinite where the loop is unstable.
    """
    closed = plant.lft(controller)
    return peak_gain(closed) if closed.poles().real.max() < 0.0 else float("inf")


def h2_synthesis(plant: control.StateSpace, nmeas: int, ncon: int) -> tuple[control.StateSpace, float]:
    """
    The controller of least H2 norm.

    Parameters
    ----------
    plant : control.StateSpace
        Generalised plant, (w, u) to (z, y), no feedthrough from w to z.
    nmeas, ncon : int
        Number of measurements and of commands.

    Returns
    -------
    controller : control.StateSpace
        Controller u = K y, in the plant's coordinates.
    norm : float
        H2 norm of the loop that it closes, computed from that loop.

    Raises
    ------
    DesignError
        If there is no solution, or the loop that it closes is unstable.
    """
    scaled, rate = scaled_in_time(plant)
    try:
        controller = in_seconds(control.h2syn(scaled, nmeas, ncon), rate)
    except SlycotError as error:
        raise DesignError(f"no H2 controller ({' '.join(str(error).split())})") from error
    closed = plant.lft(controller)
    if closed.poles().real.max() >= 0.0:
        raise DesignError("the H2 controller does not stabilise its own plant; raise the noise or the effort's weight")
    return controller, float(control.system_norm(closed, 2))


def hinf_synthesis(
    plant: control.StateSpace, nmeas: int, ncon: int, slack: float = 1.1
) -> tuple[control.StateSpace, float]:
    """
    A controller whose closed loop's H∞ norm lies within a factor of the least possible.

    Parameters
    ----------
    plant : control.StateSpace
        Generalised plant, (w, u) to (z, y).
    nmeas, ncon : int
        Number of measurements and of commands.
    slack : float
        By how much γ exceeds the smallest one for which a verified controller was found: at the limit itself the controller's
        poles run off to infinity.

    Returns
    -------
    controller : control.StateSpace
        Controller u = K y.
    norm : float
        H∞ norm of the loop that it closes, computed from that loop; at most γ.

    Raises
    ------
    DesignError
        If no γ gives a controller that keeps it.
    """
    high = _FIRST
    while _verified(plant, nmeas, ncon, high) is None:
        high *= 4.0
        if high > _LARGEST:
            raise DesignError("no H∞ controller keeps its norm; lower the weights or raise the noise")
    low = high / 4.0
    while _verified(plant, nmeas, ncon, low) is not None:
        high, low = low, low / 4.0
        if low < 1.0 / _LARGEST:
            break
    while high / low > _FINE:
        middle = float(np.sqrt(low * high))
        if _verified(plant, nmeas, ncon, middle) is None:
            low = middle
        else:
            high = middle
    found = _verified(plant, nmeas, ncon, high * slack) or _verified(plant, nmeas, ncon, high)
    assert found is not None
    return found


def _verified(
    plant: control.StateSpace, nmeas: int, ncon: int, gamma: float
) -> tuple[control.StateSpace, float] | None:
    """The controller for γ, if its loop keeps γ when the norm is computed from it."""
    try:
        controller = hinf_controller(plant, nmeas, ncon, gamma)
    except DesignError:
        return None
    norm = closed_norm(plant, controller)
    return (controller, norm) if norm <= gamma * (1 + 1e-6) else None
