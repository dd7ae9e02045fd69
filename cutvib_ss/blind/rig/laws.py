"""
Nonlinear elements, and the integration of a linear machine that carries them.

Between steps the linear machine is propagated exactly in modal coordinates, its inputs linear in time; the elements' forces
at the end of a step are iterated with the motion there until both agree. A Jenkins element keeps the place of its slider.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

KINDS = {
    "cubic": 0,
    "freeplay": 1,
    "jenkins": 2,
    "bilinear": 3,
    "quadratic_damping": 4,
    "lift_off": 5,
    "cable": 6,
    "saturating_damper": 7,
}
"""Numbers of the laws; their values are described in `force`."""

ITERATIONS = 60
TOLERANCE = 1e-9
"""Iterations at most within a step, and the change of a force, relative to the largest so far, at which they end."""


@njit(cache=True, error_model="numpy")
def force(kind: int, value: NDArray[np.float64], y: float, rate: float, slider: float) -> float:
    """
    Force that an element puts on its port, beyond what the linear machine holds there.

    Parameters
    ----------
    kind : int
        Its number in `KINDS`.
    value : ndarray, shape (4,)
        Its values.
    y, rate : float
        Deflection and rate of the port.
    slider : float
        Where a Jenkins element's slider is.

    Returns
    -------
    float
        The force.

    Notes
    -----
    cubic (k3): -k3 y³. freeplay (gap, k): what k y lacks of k (y ∓ gap). jenkins (limit, k): -k (y - slider) within ±limit.
    bilinear (k a): -k a |y|. quadratic_damping (c): -c rate |rate|. lift_off (k, preload): a support of stiffness k that
    pushes only. cable (k2): -k2 y² where taut, y > 0. saturating_damper (limit, rate at which it saturates): -limit tanh.
    """
    if kind == 0:
        return float(-value[0] * y**3)
    if kind == 1:
        return float(value[1] * min(max(y, -value[0]), value[0]))
    if kind == 2:
        return float(-min(max(value[1] * (y - slider), -value[0]), value[0]))
    if kind == 3:
        return float(-value[0] * abs(y))
    if kind == 4:
        return float(-value[0] * rate * abs(rate))
    if kind == 5:
        return float(min(0.0, value[0] * y + value[1]))
    if kind == 6:
        return float(-value[0] * max(y, 0.0) ** 2)
    return float(-value[0] * np.tanh(rate / value[1]))


@njit(cache=True, error_model="numpy")
def integrate(
    decay: NDArray[np.complex128],
    begin: NDArray[np.complex128],
    end: NDArray[np.complex128],
    motion: NDArray[np.complex128],
    acceleration: NDArray[np.complex128],
    direct: NDArray[np.float64],
    kinds: NDArray[np.int64],
    values: NDArray[np.float64],
    drive: NDArray[np.float64],
) -> NDArray[np.float64]:
    """
    Accelerations of the channels under a force, from rest.

    Parameters
    ----------
    decay : ndarray of complex, shape (mode,)
        By what a step multiplies a free mode.
    begin, end : ndarray of complex, shape (mode, input)
        What the inputs at its begin and end add; input 0 is the force, the others are the elements.
    motion : ndarray of complex, shape (2 elements, mode)
        Deflections of the elements, then their rates, by mode.
    acceleration : ndarray of complex, shape (channel, mode)
        Accelerations of the channels by mode.
    direct : ndarray, shape (channel, input)
        What inputs accelerate at once.
    kinds : ndarray of int, shape (element,)
        Numbers of the laws.
    values : ndarray, shape (element, 4)
        Their values.
    drive : ndarray, shape (step,)
        The force [N].

    Returns
    -------
    ndarray, shape (channel, step)
        Accelerations [m/s^2].
    """
    modes, inputs = begin.shape
    channels, elements = direct.shape[0], inputs - 1
    # how deflections and rates at the end of a step answer the inputs there
    feed = np.zeros((2 * elements, inputs))
    for p in range(2 * elements):
        for q in range(inputs):
            for k in range(modes):
                feed[p, q] += (motion[p, k] * end[k, q]).real
    x = np.zeros(modes, dtype=np.complex128)
    now, new, free = np.zeros(inputs), np.zeros(inputs), np.zeros(2 * elements)
    y = np.zeros(2 * elements)
    slider = np.zeros(elements)
    largest = 1e-12
    out = np.zeros((channels, drive.size))
    for step in range(1, drive.size):
        new[0] = drive[step]
        free[:] = 0.0
        for k in range(modes):
            x[k] *= decay[k]
            for q in range(inputs):
                x[k] += begin[k, q] * now[q]
            for p in range(2 * elements):
                free[p] += (motion[p, k] * x[k]).real
        for _ in range(ITERATIONS):
            change = 0.0
            for p in range(2 * elements):
                y[p] = free[p]
                for q in range(inputs):
                    y[p] += feed[p, q] * new[q]
            for e in range(elements):
                f = force(kinds[e], values[e], y[e], y[elements + e], slider[e])
                change = max(change, abs(f - new[1 + e]))
                new[1 + e] = f
                largest = max(largest, abs(f))
            if change <= TOLERANCE * largest:
                break
        for e in range(elements):
            if kinds[e] == 2:
                reach = values[e, 0] / values[e, 1]
                slider[e] = min(max(slider[e], y[e] - reach), y[e] + reach)
        for k in range(modes):
            for q in range(inputs):
                x[k] += end[k, q] * new[q]
        now[:] = new
        for c in range(channels):
            total = 0.0
            for k in range(modes):
                total += (acceleration[c, k] * x[k]).real
            for q in range(inputs):
                total += direct[c, q] * new[q]
            out[c, step] = total
    return out
