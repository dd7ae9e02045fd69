"""
H2 and H∞ synthesis by two Riccati equations, every norm computed anew from the closed loop.

`control.hinfsyn` and `control.h2syn` rest on SLICOT's Riccati solver, which loses these lightly damped plants: on the published
machine hinfsyn takes a minute to report γ = 1.7 for a loop whose norm is 55. `scipy.linalg.solve_continuous_are` solves the
same equations through a balanced pencil, sign-indefinite ones too; the formulas of the controller then take a few lines.
"""

from __future__ import annotations

import control
import numpy as np
from scipy import linalg

from cutvib_ss.errors import DesignError
from cutvib_ss.results import FloatArray

_FIRST, _LARGEST, _FINE = 1.0, 1e8, 1.005
"""Where the search for γ starts and gives up, and how closely it closes in on the smallest one."""


def central_controller(plant: control.StateSpace, nmeas: int, ncon: int, gamma: float = np.inf) -> control.StateSpace:
    """
    The central controller of H∞ control for a given γ, or the H2 optimal one.

    Parameters
    ----------
    plant : control.StateSpace
        Generalised plant, (w, u) to (z, y); no feedthrough from w to z, nor from u to y.
    nmeas, ncon : int
        Number of measurements y and of commands u, the last of outputs and inputs.
    gamma : float
        Bound on the closed loop's H∞ norm; infinite for H2.

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
    Zhou, Doyle and Glover, Robust and Optimal Control (1996), Theorems 14.7 and 17.1, for D11 = 0 and D22 = 0. With
    F = -R⁻¹(D1ᵀC1 + BᵀX), L = -(B1 D1ᵀ + Y Cᵀ)R̃⁻¹ and Z = (I - YX/γ²)⁻¹ the controller is an observer of the state under the
    worst disturbance w = F1 x: A_K = A + B1F1 + B2F2 + Z L2 (C2 + D21 F1), B_K = -Z L2, C_K = F2.
    """
    n, m1, p1 = plant.nstates, plant.ninputs - ncon, plant.noutputs - nmeas
    if np.any(plant.D[:p1, :m1]) or np.any(plant.D[p1:, m1:]):
        raise DesignError(
            "the generalised plant has feedthrough from disturbance to performance or from command to sensor"
        )
    # In units of the plant's own time: rates of 1 s⁻¹ and of 1e5 s⁻¹ do not mix well in one pencil.
    rate = float(np.exp(np.mean(np.log(np.maximum(np.abs(plant.poles()), 1.0)))))
    a, b, c, d = plant.A / rate, plant.B / np.sqrt(rate), plant.C / np.sqrt(rate), plant.D
    f1, f2, x = _gains(a, b, c[:p1], d[:p1], m1, gamma)
    _, l2, y = _gains(a.T, c.T, b[:, :m1].T, d[:, :m1].T, p1, gamma)
    z = np.eye(n)
    if np.isfinite(gamma):
        if float(np.abs(linalg.eigvals(x @ y)).max()) >= gamma**2:
            raise DesignError(f"no controller for γ = {gamma:.6g}: the spectral radius of XY is too large")
        z = linalg.inv(np.eye(n) - y @ x / gamma**2)
    inject = z @ l2.T
    a_k = a + b[:, :m1] @ f1 + b[:, m1:] @ f2 + inject @ (c[p1:] + d[p1:, :m1] @ f1)
    return control.ss(
        a_k * rate, -inject * np.sqrt(rate), f2 * np.sqrt(rate), np.zeros((ncon, nmeas)),
        inputs=plant.output_labels[p1:], outputs=plant.input_labels[m1:],
    )  # fmt: skip


def _gains(
    a: FloatArray, b: FloatArray, c1: FloatArray, d1: FloatArray, m1: int, gamma: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gains on disturbance and command, and the solution of the Riccati equation behind them."""
    n, m = b.shape
    used = slice(0 if np.isfinite(gamma) else m1, m)
    weight = d1.T @ d1
    weight[:m1, :m1] -= gamma**2 * np.eye(m1) if np.isfinite(gamma) else 0.0
    try:
        x = np.asarray(
            linalg.solve_continuous_are(a, b[:, used], c1.T @ c1, weight[used, used], s=c1.T @ d1[:, used]), np.float64
        )
    except (linalg.LinAlgError, ValueError) as error:
        raise DesignError(
            f"no controller for γ = {gamma:.6g}: a Riccati equation has no stabilising solution"
        ) from error
    if float(linalg.eigvalsh(x)[0]) < -1e-7 * float(np.abs(x).max()):
        raise DesignError(f"no controller for γ = {gamma:.6g}: a Riccati equation has no positive solution")
    gains = np.zeros((m, n))
    gains[used] = -linalg.solve(weight[used, used], d1[:, used].T @ c1 + b[:, used].T @ x)
    return gains[:m1], gains[m1:], x


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
    return float(control.linfnorm(closed)[0]) if closed.poles().real.max() < 0.0 else float("inf")


def h2_synthesis(plant: control.StateSpace, nmeas: int, ncon: int) -> tuple[control.StateSpace, float]:
    """
    The controller of least H2 norm.

    Parameters
    ----------
    plant : control.StateSpace
        Generalised plant, as for `central_controller`.
    nmeas, ncon : int
        Number of measurements and of commands.

    Returns
    -------
    controller : control.StateSpace
        Controller u = K y.
    norm : float
        H2 norm of the loop that it closes, computed from that loop.

    Raises
    ------
    DesignError
        If the loop that it closes is unstable.
    """
    controller = central_controller(plant, nmeas, ncon)
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
        Generalised plant, as for `central_controller`.
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
        controller = central_controller(plant, nmeas, ncon, gamma)
    except DesignError:
        return None
    norm = closed_norm(plant, controller)
    return (controller, norm) if norm <= gamma * (1 + 1e-6) else None
