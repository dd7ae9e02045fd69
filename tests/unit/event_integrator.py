"""Accurate integration of a second-order system with one nonlinear element: pieces between events, each with tight tolerances."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.restoring_forces import Hysteretic
from cutvib_ss.model.second_order import SecondOrder

TIGHT = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-14}


def integrate(
    system: SecondOrder,
    drive: np.ndarray,
    force: Callable[[float], float],
    element: NonlinearElement,
    times: np.ndarray,
    max_step: float,
) -> np.ndarray:
    """
    Displacement of the element's port from rest, shape (sample,).

    Friction and slip switch between stick and slide at the roots of what decides them; the other laws are integrated as they are.
    """  # fmt: skip
    with np.errstate(invalid="ignore"):  # the integrator's first error estimate is 0/0 at rest
        return _integrate(system, drive, force, element, times, max_step)


def _integrate(
    system: SecondOrder,
    drive: np.ndarray,
    force: Callable[[float], float],
    element: NonlinearElement,
    times: np.ndarray,
    max_step: float,
) -> np.ndarray:
    n = len(system.dofs)
    inverse, row = np.linalg.inv(system.mass), system.port(element.port)
    law = element.restoring_force

    def free(t: float, x: np.ndarray) -> np.ndarray:
        return inverse @ (drive * force(t) - system.damping @ x[n:] - system.stiffness @ x[:n])

    if not isinstance(law, Hysteretic):

        def smooth(t: float, x: np.ndarray) -> np.ndarray:
            f = law.force(row @ x[:n], row @ x[n:])
            return np.concatenate([x[n:], free(t, x) - inverse @ row * f])

        return row @ solve_ivp(smooth, times[[0, -1]], np.zeros(2 * n), t_eval=times, max_step=max_step, **TIGHT).y[:n]

    compliance = row @ inverse @ row
    [(k, limit)] = law.sliders()
    k = 0.0 if law.jumps else k

    # The state: displacements, velocities, and the element's force where it is elastic. Modes: stick (0), slide to either side.
    def rates(mode: int) -> Callable[[float, np.ndarray], np.ndarray]:
        def rate(t: float, x: np.ndarray) -> np.ndarray:
            a, v = free(t, x[:-1]), row @ x[n:-1]
            if mode:
                f, df = mode * limit, 0.0
            elif k:
                f, df = x[-1], k * v
            else:
                f, df = row @ a / compliance, 0.0
            return np.concatenate([x[n:-1], a - inverse @ row * f, [df]])

        return rate

    def ends(mode: int) -> Callable[[float, np.ndarray], float]:
        def end(t: float, x: np.ndarray) -> float:
            if mode:
                return float(mode * (row @ x[n:-1]))
            held = x[-1] if k else row @ free(t, x[:-1]) / compliance
            return float(limit - abs(held))

        end.terminal = True  # type: ignore[attr-defined]
        end.direction = -1  # type: ignore[attr-defined]
        return end

    mode, x, t = 0, np.zeros(2 * n + 1), times[0]
    out = np.zeros(times.size)
    while t < times[-1]:
        due = times[times >= t]
        done = solve_ivp(
            rates(mode), (t, times[-1]), x, events=ends(mode), dense_output=True, max_step=max_step, **TIGHT
        )
        upto = due[due <= done.t[-1]]
        out[times.size - due.size : times.size - due.size + upto.size] = row @ done.sol(upto)[:n]
        t, x = done.t[-1], done.y[:, -1]
        if t >= times[-1]:
            break
        if mode == 0:
            held = x[-1] if k else row @ free(t, x[:-1]) / compliance
            mode = int(np.sign(held))
            x[-1] = mode * limit
            x = x + 1e-12 * rates(mode)(t, x)  # off the event
            t += 1e-12
        elif k:
            mode = 0
            x[-1] *= 1 - 1e-12
        else:
            held = row @ free(t, x[:-1]) / compliance
            mode = 0 if abs(held) < limit else int(np.sign(held))
    return out
