"""
A linear machine that carries nonlinear elements, stepped in time.

Between steps the linear machine is propagated exactly in modal coordinates, its inputs linear in time. What the elements put on
their ports at the end of a step, f, satisfies f = F(y + A f): y is the motion without f, A ≥ 0 the answer of the ports to it
within the step. Newton's method solves it; a fixed point f ← F(y + A f) would diverge where a stiff element sits on a light
part, |A F'| > 1. Every step is checked.

A line through the forces at a step's ends misses what happens within it: a contact that closes, a slider that lets go. Where an
element is gentle, |A F'| small, the force within the step is looked at along the motion found, and the line is replaced by that
of the same mean and first moment, which moves the machine alike up to terms of third order in the step.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from cutvib_ss.validation.rig.laws import KINDS, STATES, advance, force

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

NEWTON, SWEEPS, BISECTIONS = 40, 200, 120
"""Iterations at most: of Newton's method, of sweeps over the elements where that fails, of the bisection within those."""

PARTS, FEW_PARTS, IWAN = 12, 3, KINDS["iwan"]
"""Parts of a step in which a force is looked at; of an element with many sliders, whose force has no sharp kinks, fewer."""

GENTLE = 0.2
"""Change of an element's force by its own effect within a step, up to which that is done."""

TOLERANCE = 1e-10
"""Residual of a force, relative to the largest so far, at which a step is solved."""


@njit(cache=True, error_model="numpy")
def _motion(e: int, free: Array, feed: Array, f: Array) -> tuple[float, float]:
    """Deflection and rate of an element at the end of a step, given all elements' forces there."""
    n = f.size
    y, rate = free[e], free[n + e]
    for q in range(n):
        y += feed[e, q] * f[q]
        rate += feed[n + e, q] * f[q]
    return y, rate


@njit(cache=True, error_model="numpy")
def _residual(
    kinds: NDArray[np.int64],
    values: Array,
    free: Array,
    feed: Array,
    f: Array,
    states: Array,
    time: float,
    step: float,
    out: Array,
) -> float:
    """F(y + A f) - f of each element; the largest of them is returned."""
    worst = 0.0
    for e in range(f.size):
        y, rate = _motion(e, free, feed, f)
        out[e] = force(kinds[e], values[e], y, rate, states[e], time, step) - f[e]
        worst = max(worst, abs(out[e]))
    return worst


@njit(cache=True, error_model="numpy")
def _swept(
    kinds: NDArray[np.int64],
    values: Array,
    free: Array,
    feed: Array,
    f: Array,
    states: Array,
    time: float,
    step: float,
    limit: float,
    out: Array,
) -> float:
    """One element after the other by bisection: F - f falls with f at every port of a passive element, so its root is unique."""
    worst = 0.0
    for _ in range(SWEEPS):
        for e in range(f.size):
            own = f[e]
            y, rate = _motion(e, free, feed, f)
            low = high = own
            g = force(kinds[e], values[e], y, rate, states[e], time, step) - own
            reach = max(abs(g), limit)
            for _ in range(BISECTIONS):  # out to where the sign changes
                other = own + np.sign(g) * reach
                f[e] = other
                y, rate = _motion(e, free, feed, f)
                if (force(kinds[e], values[e], y, rate, states[e], time, step) - other) * g <= 0.0:
                    break
                reach *= 2.0
            low, high = min(own, f[e]), max(own, f[e])
            for _ in range(BISECTIONS):
                f[e] = 0.5 * (low + high)
                y, rate = _motion(e, free, feed, f)
                if force(kinds[e], values[e], y, rate, states[e], time, step) > f[e]:
                    low = f[e]
                else:
                    high = f[e]
        worst = _residual(kinds, values, free, feed, f, states, time, step, out)
        if worst <= limit:
            break
    return worst


@njit(cache=True, error_model="numpy")
def _solved(
    kinds: NDArray[np.int64],
    values: Array,
    free: Array,
    feed: Array,
    f: Array,
    states: Array,
    time: float,
    step: float,
    limit: float,
) -> float:
    """Forces at the end of a step, in place, from those at its begin; the largest residual that remains."""
    n = f.size
    g, trial, moved = np.zeros(n), np.zeros(n), np.zeros(n)
    jacobian = np.zeros((n, n))
    left = _residual(kinds, values, free, feed, f, states, time, step, g)
    for _ in range(NEWTON):
        if left <= limit:
            return left
        for e in range(n):
            y, rate = _motion(e, free, feed, f)
            here = g[e] + f[e]
            dy = 1e-7 * abs(y) + 1e-6 * abs(feed[e, e]) * (abs(f[e]) + limit) + 1e-18
            dr = 1e-7 * abs(rate) + 1e-6 * abs(feed[n + e, e]) * (abs(f[e]) + limit) + 1e-15
            by_y = (force(kinds[e], values[e], y + dy, rate, states[e], time, step) - here) / dy
            by_rate = (force(kinds[e], values[e], y, rate + dr, states[e], time, step) - here) / dr
            for q in range(n):
                jacobian[e, q] = by_y * feed[e, q] + by_rate * feed[n + e, q]
            jacobian[e, e] -= 1.0
        move = g / jacobian[0, 0] if n == 1 else np.linalg.solve(jacobian, g)
        share = 1.0
        while True:
            trial[:] = f - share * move
            after = _residual(kinds, values, free, feed, trial, states, time, step, moved)
            if after < left or share < 1e-3:
                break
            share *= 0.5
        if not after < left:
            break
        f[:], g[:], left = trial, moved, after
    if left <= limit:
        return left
    return _swept(kinds, values, free, feed, f, states, time, step, limit, g)


@njit(cache=True, error_model="numpy")
def _gentle(
    kind: int,
    value: Array,
    y: float,
    rate: float,
    by_force: float,
    rate_by_force: float,
    state: Array,
    time: float,
    step: float,
) -> bool:
    """Whether an element hardly feels its own force within the step, so that what the step missed can be made good after it."""
    here = force(kind, value, y, rate, state, time, step)
    for sign in (-1.0, 1.0):
        dy = sign * (1e-6 * abs(y) + 1e-12)
        dr = sign * (1e-6 * abs(rate) + 1e-10)
        by_y = (force(kind, value, y + dy, rate, state, time, step) - here) / dy
        by_rate = (force(kind, value, y, rate + dr, state, time, step) - here) / dr
        if abs(by_y * by_force) + abs(by_rate * rate_by_force) > GENTLE:
            return False
    return True


@njit(cache=True, error_model="numpy")
def _within(
    kind: int, value: Array, y: float, rate: float, state: Array, begin: float, time: float, step: float
) -> tuple[float, float, float]:
    """The force within a step as the line of its mean and first moment, and the force at its end; memory is carried along."""
    # The motion within the step is the cubic through deflections and rates at its ends; the force is looked at in parts of the
    # step and is a line in each. So a contact that closes within a step pushes as long as it is closed.
    y0, r0 = state[STATES - 2], state[STATES - 1]
    parts = FEW_PARTS if kind == IWAN else PARTS
    mean, moment, last = 0.0, 0.0, begin
    for j in range(parts):
        s = (j + 1) / parts
        a, b = s * s * (3 - 2 * s), s * (1 - s)
        at = y0 + a * (y - y0) + step * b * ((1 - s) * r0 - s * rate)
        slope = 6 * b * (y - y0) / step + (1 - s) * (1 - 3 * s) * r0 + s * (3 * s - 2) * rate
        now = force(kind, value, at, slope, state, time + s * step, step / parts)
        advance(kind, value, at, slope, state, step / parts)
        mean += 0.5 * (last + now) / parts
        moment += (0.5 * (last + now) * j + (last + 2 * now) / 6) / parts**2
        last = now
    return 4 * mean - 6 * moment, 6 * moment - 2 * mean, last


@njit(cache=True, error_model="numpy")
def integrate(
    decay: Complex,
    begin: Complex,
    end: Complex,
    motion: Complex,
    acceleration: Complex,
    direct: Array,
    kinds: NDArray[np.int64],
    values: Array,
    drive: Array,
    step: float,
) -> tuple[Array, float]:
    """Accelerations of the channels under a force, from rest, and the largest residual of a step over the largest force."""
    modes, inputs = begin.shape
    channels, elements = direct.shape[0], inputs - 1
    # how deflections and rates at the end of a step answer the inputs there
    feed = np.zeros((2 * elements, inputs))
    for p in range(2 * elements):
        for q in range(inputs):
            for k in range(modes):
                feed[p, q] += (motion[p, k] * end[k, q]).real
    among = np.ascontiguousarray(feed[:, 1:])
    x = np.zeros(modes, dtype=np.complex128)
    now, new, free = np.zeros(inputs), np.zeros(inputs), np.zeros(2 * elements)
    f = np.zeros(elements)
    line = np.zeros((inputs, 2))
    states = np.zeros((elements, STATES))
    # forces far below this are noise of their own rounding
    largest, worst = 1e-5 * np.abs(drive).max() + 1e-12, 0.0
    out = np.zeros((channels, drive.size))
    for i in range(1, drive.size):
        # the line of the same mean and first moment as the parabola through the force's samples
        bow = (drive[max(i - 2, 0)] - drive[i - 1] - drive[i] + drive[min(i + 1, drive.size - 1)]) / 24
        now[0], new[0] = drive[i - 1] - bow, drive[i] - bow
        for p in range(2 * elements):
            free[p] = feed[p, 0] * new[0]
        for k in range(modes):
            x[k] *= decay[k]
            for q in range(inputs):
                x[k] += begin[k, q] * now[q]
            for p in range(2 * elements):
                free[p] += (motion[p, k] * x[k]).real
        limit = TOLERANCE * largest
        left = _solved(kinds, values, free, among, f, states, i * step, step, limit)
        worst = max(worst, left / max(largest, np.abs(f).max()))
        for e in range(elements):
            largest = max(largest, abs(f[e]))
            line[1 + e, 0], line[1 + e, 1], new[1 + e] = now[1 + e], f[e], f[e]
            y, rate = _motion(e, free, among, f)
            own, by_rate = among[e, e], among[elements + e, e]
            if _gentle(kinds[e], values[e], y, rate, own, by_rate, states[e], i * step, step):
                found = _within(kinds[e], values[e], y, rate, states[e], now[1 + e], (i - 1) * step, step)
                line[1 + e, 0], line[1 + e, 1], new[1 + e] = found
            else:
                advance(kinds[e], values[e], y, rate, states[e], step)
        line[0, 0], line[0, 1] = now[0], new[0]
        for k in range(modes):
            for q in range(inputs):
                x[k] += begin[k, q] * (line[q, 0] - now[q]) + end[k, q] * line[q, 1]
        for e in range(elements):
            y, rate = 0.0, 0.0
            for k in range(modes):
                y += (motion[e, k] * x[k]).real
                rate += (motion[elements + e, k] * x[k]).real
            states[e, STATES - 2], states[e, STATES - 1] = y, rate
        new[0] = drive[i]
        now[:] = new
        for c in range(channels):
            total = 0.0
            for k in range(modes):
                total += (acceleration[c, k] * x[k]).real
            for q in range(inputs):
                total += direct[c, q] * new[q]
            out[c, i] = total
    return out, worst
