"""
Nonlinear elements: the force that each puts on its port, and the memory that some of them have.

Memory is carried over a step implicitly, so that the force at the step's end is a function of the motion there alone.
"""

from __future__ import annotations

from math import atan, copysign, cos, exp, expm1, log1p, sqrt, tanh

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = {
    name: number
    for number, name in enumerate((
        "cubic", "freeplay", "jenkins", "bilinear", "quadratic_damping", "lift_off", "cable", "saturating_damper",
        "power_spring", "tanh_spring", "rounded_freeplay", "offset_freeplay", "hertz_freeplay", "tanh_friction", "lugre",
        "iwan", "dahl", "rounded_bilinear", "offset_bilinear", "power_damper", "orifice", "mixed_damper", "preloaded_hertz",
        "one_sided", "parametric", "fading", "quadratic_spring",
    ))
}  # fmt: skip
"""Numbers of the laws; their values are described in `force`."""

VALUES, STATES, SLIDERS = 6, 26, 24
"""Values of a law at most, numbers of its memory (the last two are the motion at the step's begin), sliders of Iwan's element."""


@njit(cache=True, error_model="numpy")
def force(kind: int, v: Array, y: float, rate: float, state: Array, time: float, step: float) -> float:
    """
    Force that an element puts on its port, beyond what the linear machine holds there.

    cubic (k3): -k3 y³. freeplay (gap, k): what k y lacks of k (y ∓ gap). jenkins (limit, k): -k (y - slider) within ±limit.
    bilinear (k a): -k a |y|. quadratic_damping (c): -c rate |rate|. lift_off (k, preload): a support of stiffness k that
    pushes only. cable (k2): -k2 y² where taut, y > 0. saturating_damper (limit, rate at which it saturates): -limit tanh.
    power_spring (k, scale, p): -k scale |y/scale|^p. tanh_spring (k, scale): k (y - scale tanh(y/scale)), softer for k > 0.
    rounded_freeplay (gap, k, radius), offset_freeplay (gap below, gap above, k). hertz_freeplay (gap, k, kh, loss): no torque
    within the gap, kh (|y| - gap)^1.5 (1 + loss d|y|/dt) beyond. tanh_friction (limit, rate). lugre (kinetic, static,
    Stribeck rate, bristle stiffness, bristle damping). iwan (k, slip at which the last slider slides, exponent of the density
    of slips). dahl (limit, k). rounded_bilinear (k a, radius), offset_bilinear (k a, where). power_damper (c, scale, p):
    -c scale |rate/scale|^p. orifice (c one way, c the other), times rate². mixed_damper (c, rate where laminar turns
    turbulent). preloaded_hertz (k, approach at rest): (y + a)^1.5 in place of its tangent. one_sided (gap, k, c). parametric
    (k, angular frequency, phase). fading (k, scale, time constant): k y times what has faded. quadratic_spring (k2): -k2 y².
    """
    a = abs(y)
    out = 0.0
    if kind == 0:
        out = -v[0] * y**3
    elif kind == 1:
        out = v[1] * min(max(y, -v[0]), v[0])
    elif kind == 2:
        out = -min(max(v[1] * (y - state[0]), -v[0]), v[0])
    elif kind == 3:
        out = -v[0] * a
    elif kind == 4:
        out = -v[0] * rate * abs(rate)
    elif kind == 5:
        out = min(0.0, v[0] * y + v[1])
    elif kind == 6:
        out = -v[0] * max(y, 0.0) ** 2
    elif kind == 7:
        out = -v[0] * tanh(rate / v[1])
    elif kind == 8:
        out = -v[0] * v[1] * copysign((a / v[1]) ** v[2], y)
    elif kind == 9:
        out = v[0] * (y - v[1] * tanh(y / v[1]))
    elif kind == 10:
        out = 0.5 * v[1] * (sqrt((y + v[0]) ** 2 + v[2] ** 2) - sqrt((y - v[0]) ** 2 + v[2] ** 2))
    elif kind == 11:
        out = v[2] * min(max(y, -v[0]), v[1])
    elif kind == 12:
        press = max(a - v[0], 0.0) ** 1.5 * max(1.0 + v[3] * rate * copysign(1.0, y), 0.0)
        out = v[1] * y - copysign(v[2] * press, y)
    elif kind == 13:
        out = -v[0] * tanh(rate / v[1])
    elif kind == 14:
        z = bristle(v, rate, state, step)
        out = -(v[3] * z + v[4] * (z - state[0]) / step)
    elif kind == 15:
        for i in range(SLIDERS):
            reach = v[1] * ((i + 0.5) / SLIDERS) ** (1.0 / (v[2] + 1.0))
            out -= v[0] / SLIDERS * min(max(y - state[i], -reach), reach)
    elif kind == 16:
        out = -v[1] * dahl(v, y, state)
    elif kind == 17:
        out = -v[0] * (sqrt(y * y + v[1] ** 2) - v[1])
    elif kind == 18:
        out = -v[0] * (abs(y - v[1]) - abs(v[1]))
    elif kind == 19:
        out = -v[0] * v[1] * copysign((abs(rate) / v[1]) ** v[2], rate)
    elif kind == 20:
        out = -(v[0] if rate > 0 else v[1]) * rate * abs(rate)
    elif kind == 21:
        out = -v[0] * rate * abs(rate) / (abs(rate) + v[1])
    elif kind == 22:
        x = max(y / v[1], -1.0)
        out = v[0] * y - v[0] * v[1] / 1.5 * expm1(1.5 * log1p(x)) if x > -1.0 else v[0] * y + v[0] * v[1] / 1.5
    elif kind == 23:
        out = -max(v[1] * (y - v[0]) + v[2] * rate, 0.0) if y > v[0] else 0.0
    elif kind == 24:
        out = -v[0] * cos(v[1] * time + v[2]) * y
    elif kind == 25:
        out = v[0] * faded(v, y, state, step) * y
    elif kind == 26:
        out = -v[0] * y * y
    return out


@njit(cache=True, error_model="numpy")
def bristle(v: Array, rate: float, state: Array, step: float) -> float:
    """LuGre's bristle at the end of a step: z' = r - k |r| z / g(r), by the trapezoidal rule (linear in the new z)."""
    old = state[STATES - 1]
    slope_old = v[3] * abs(old) / (v[0] + (v[1] - v[0]) * exp(-((old / v[2]) ** 2)))
    slope = v[3] * abs(rate) / (v[0] + (v[1] - v[0]) * exp(-((rate / v[2]) ** 2)))
    z = state[0]
    return float((z + 0.5 * step * (old - slope_old * z + rate)) / (1.0 + 0.5 * step * slope))


@njit(cache=True, error_model="numpy")
def dahl(v: Array, y: float, state: Array) -> float:
    """Dahl's deflection at the end of a step, dz/dy = 1 - z/zm sign(y'): exact where the step goes one way."""
    move = y - state[STATES - 2]
    top = copysign(v[0] / v[1], move)
    return float(top + (state[0] - top) * exp(-abs(move) * v[1] / v[0]))


@njit(cache=True, error_model="numpy")
def faded(v: Array, y: float, state: Array, step: float) -> float:
    """What has faded, between 0 and 1: s' = ((2/π) atan((y/scale)²) - s) / time constant, by the trapezoidal rule."""
    target = 2.0 / np.pi * atan((y / v[1]) ** 2)
    old = 2.0 / np.pi * atan((state[STATES - 2] / v[1]) ** 2)
    x = 0.5 * step / v[2]
    return float((state[0] * (1.0 - x) + x * (old + target)) / (1.0 + x))


@njit(cache=True, error_model="numpy")
def advance(kind: int, v: Array, y: float, rate: float, state: Array, step: float) -> None:
    """Carry an element's memory over a step that ended in this motion."""
    if kind == 2:
        reach = v[0] / v[1]
        state[0] = min(max(state[0], y - reach), y + reach)
    elif kind == 14:
        state[0] = bristle(v, rate, state, step)
    elif kind == 15:
        for i in range(SLIDERS):
            reach = v[1] * ((i + 0.5) / SLIDERS) ** (1.0 / (v[2] + 1.0))
            state[i] = min(max(state[i], y - reach), y + reach)
    elif kind == 16:
        state[0] = dahl(v, y, state)
    elif kind == 25:
        state[0] = faded(v, y, state, step)
    state[STATES - 2], state[STATES - 1] = y, rate
