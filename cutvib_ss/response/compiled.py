"""
Compiled loops: modes driven by forces at a few ports, and the nonlinear laws there, implicit at each new instant.

Modes are kept as real and imaginary parts apart, so that loops over them vectorise.

Over a step of length h a nonlinear force is taken as linear, from x0 to x1. For a law without jumps these are the law's values at
both ends plus a constant that gives the force its true mean over the step (Simpson's rule on the cubic through both ends'
motions); what is left of the error is of fourth order. A force that jumps (friction) is constant over a step, its mean.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import numba
import numpy as np

from cutvib_ss.results import FloatArray

Values: TypeAlias = Sequence[float]
Course: TypeAlias = tuple[float, float, float]

CUBIC, FREEPLAY, BILINEAR, FRICTION, QUADRATIC, SLIP = range(6)
"""Codes of the laws, in the order of `cutvib_ss.laws.LAWS`."""

_SWEEPS = 30
"""Largest number of sweeps over several elements in a step. A single one needs two, the second with the mean that follows from
the first: their error is that of the step times the same factor once more."""
_SAME = 1e-9
"""Sweeps end when forces move by less than this part of the largest one so far."""
_STIFF = 0.3
"""Slope of a law times the step's compliance beyond which the force is held constant over the step, since its course there is not
resolved anyway: stable at any slope, the mean of both ends' forces for displacement, the new one for velocity."""
_AWAY = 1e3
"""A motion this many times what the largest linear velocity could do over the record has run away (a softening law)."""

_fast = {"contract", "reassoc", "nsz", "arcp"}


@numba.njit(cache=True, fastmath=_fast)
def _law_force(code: int, p: Values, q: float, v: float) -> float:
    """Force of a law without jumps or memory."""
    if code == CUBIC:
        return p[0] * q * q * q
    if code == FREEPLAY:
        return -p[1] * min(max(q, -p[0]), p[0])
    if code == BILINEAR:
        return p[0] * p[1] * abs(q)
    return p[0] * v * abs(v)


@numba.njit(cache=True, fastmath=_fast)
def _mean_size(a: float, b: float) -> float:
    """Mean of abs(x) as x goes evenly from one value to another."""
    if a * b >= 0.0:
        return 0.5 * abs(a + b)
    return 0.5 * (a * a + b * b) / (abs(a) + abs(b))


@numba.njit(cache=True, fastmath=_fast)
def _law_mean(code: int, p: Values, q: Course, v: Course, f0: float, f1: float) -> float:
    """
    Mean force of a law without jumps over a step: displacement and velocity at its start, half-way and at its end.

    Simpson's rule; where the law has corners, straight motion over each half, on which the mean is exact, with what Simpson's
    rule adds to that for the motion.
    """
    if code == CUBIC:
        return (f0 + 4.0 * p[0] * q[1] * q[1] * q[1] + f1) / 6.0
    if code == QUADRATIC:
        return (f0 + 4.0 * p[0] * v[1] * abs(v[1]) + f1) / 6.0
    bend = (2.0 * q[1] - q[0] - q[2]) / 12.0
    if code == BILINEAR:
        size = 0.5 * (_mean_size(q[0], q[1]) + _mean_size(q[1], q[2])) + bend * math.copysign(1.0, q[1])
        return p[0] * p[1] * size
    if code == FREEPLAY:
        gap = p[0]
        high = _mean_size(q[0] + gap, q[1] + gap) + _mean_size(q[1] + gap, q[2] + gap)
        low = _mean_size(q[0] - gap, q[1] - gap) + _mean_size(q[1] - gap, q[2] - gap)
        return -p[1] * (0.25 * (high - low) + (bend if abs(q[1]) < gap else 0.0))
    half = min(max(f0 + p[0] * (q[1] - q[0]), -p[1]), p[1])
    return (f0 + 4.0 * half + f1) / 6.0


@numba.njit(cache=True, fastmath=_fast)
def _law_slope(code: int, p: Values, q: float, v: float) -> float:
    """Largest size that ∂f/∂q, or ∂f/∂v for a law of the velocity, can have about a motion."""
    if code == CUBIC:
        return 3.0 * abs(p[0]) * q * q
    if code == FREEPLAY:
        return p[1]
    if code == BILINEAR:
        return abs(p[0]) * p[1]
    if code == QUADRATIC:
        return 2.0 * p[0] * abs(v)
    return p[0]


@numba.njit(cache=True, fastmath=_fast)
def implicit_force(code: int, p: Values, q: float, a: float, v: float, b: float, f0: float, q0: float) -> float:
    """
    The force f = law(q - a f, v - b f) of a law without jumps.

    Parameters
    ----------
    code : int
        Which law.
    p : sequence of float, length 2
        Its parameters.
    q, a : float
        Displacement at the new instant, were f zero, and its compliance to f, positive.
    v, b : float
        Velocity, and its compliance.
    f0, q0 : float
        Force and displacement at the last instant, for laws with memory.

    Returns
    -------
    float
        The force.

    Notes
    -----
    Closed forms, but for the cubic, whose x + a k3 x³ = q Newton's method solves monotonically from x = q, from either side.
    A softening law (k3 < 0) has no such root beyond the peak of the left side, and runs away: NaN.
    """
    if code == CUBIC:
        g = a * p[0]
        x = q
        for _ in range(50):
            slope = 1.0 + 3.0 * g * x * x
            if slope < 1e-6:
                return math.nan
            change = (x + g * x * x * x - q) / slope
            x -= change
            if abs(change) <= 1e-15 * abs(x):
                break
        return p[0] * x * x * x
    if code == FREEPLAY:
        gap, k = p[0], p[1]
        if a * k < 1.0 and abs(q) <= gap * (1.0 - a * k):
            return -k * q / (1.0 - a * k)
        return -k * gap * math.copysign(1.0, q)
    if code == BILINEAR:
        g = p[0] * p[1]
        return g * abs(q) / (1.0 + a * g * math.copysign(1.0, q))
    if code == QUADRATIC:
        size = 2.0 * abs(v) / (1.0 + math.sqrt(1.0 + 4.0 * b * p[0] * abs(v)))
        return p[0] * size * size * math.copysign(1.0, v)
    elastic = (f0 + p[0] * (q - q0)) / (1.0 + a * p[0])
    return min(max(elastic, -p[1]), p[1])


@numba.njit(cache=True, fastmath=_fast)
def friction_mean(torque: float, v: float, b: float, v0: float) -> float:
    """
    Mean force of Coulomb friction over a step.

    Parameters
    ----------
    torque : float
        The friction's size.
    v : float
        Velocity at the new instant, were there no friction in the step.
    b : float
        Compliance of the velocity to a constant force over the step, positive.
    v0 : float
        Velocity at the last instant.

    Returns
    -------
    float
        The mean force.

    Notes
    -----
    The velocity is taken as straight over the step. If full friction does not bring it through zero, the port slides. If it does,
    the port stays at rest where friction can hold against what drives it (the new velocity is then zero exactly); else it turns
    back, and the mean of the sign over the step is (v0 + v1)/(v0 - v1), v1 being the new velocity.
    """
    side = -1.0 if v0 < 0.0 else 1.0
    v, v0, full = side * v, side * v0, b * torque
    if v - full >= 0.0:
        return side * torque
    new = 0.0
    if abs(v - v0) > full:
        total = v + v0 + full
        new = 0.5 * (total - math.sqrt(total * total + 4.0 * v0 * (full - v)))
    return side * min(max((v - new) / b, -torque), torque)


@numba.njit(cache=True, fastmath=_fast)
def interact(
    motion: FloatArray,
    surplus: FloatArray,
    step: float,
    turn: FloatArray,
    pushes: FloatArray,
    reads: FloatArray,
    compliance: FloatArray,
    codes: np.ndarray,
    parameters: FloatArray,
    state: FloatArray,
) -> tuple[FloatArray, np.ndarray, FloatArray]:
    """
    Nonlinear forces at ports whose linear motion is known.

    Parameters
    ----------
    motion : ndarray, shape (blow, 2, element, instant)
        Displacement and velocity of the elements' ports without nonlinear forces.
    surplus : ndarray, shape (blow, 2, mode)
        Modes at the first instant, real and imaginary part, whose free response ``motion`` has in excess.
    step : float
        Time between instants [s].
    turn : ndarray, shape (2, mode)
        Real and imaginary part of e^(p h), the factor of each mode over a step.
    pushes : ndarray, shape (2, 2, element, mode)
        Change of each mode by x0 and x1 of a linear course of each element's force; then real and imaginary part.
    reads : ndarray, shape (2, 2, element, mode)
        Displacement and velocity of each element's port by the modes; then by real and imaginary part.
    compliance : ndarray, shape (2, element, element)
        Displacement of each element's port (row) that modes beyond those kept add at once, and velocity.
    codes : ndarray of int, shape (element,)
        The laws.
    parameters : ndarray, shape (element, 2)
        Their parameters.
    state : ndarray, shape (blow, element)
        Force at the first instant, of laws with memory.

    Returns
    -------
    forces : ndarray, shape (blow, element, instant)
        Force of each element against its port's motion: at the instants, corrected so that its linear course between them has the
        right mean; for friction, the mean over the step that ends there.
    ran_away : ndarray of bool, shape (blow,)
        Whether the motion ran away; forces are zero from there on.
    kept : ndarray, shape (blow, element)
        Force at the last instant, as ``state`` takes it.
    """
    blows, _, elements, instants = motion.shape
    modes = turn.shape[1]
    forces = np.zeros((blows, elements, instants))
    away = np.zeros(blows, dtype=np.bool_)
    sweeps = _SWEEPS if elements > 1 else 1 if codes[0] == FRICTION else 2
    kept = np.zeros((blows, elements))
    # Motion of port i by x0 and x1 of element j.
    moved = np.zeros((2, 2, elements, elements))
    for w in range(2):
        for x in range(2):
            for i in range(elements):
                for j in range(elements):
                    total = compliance[w, i, j] if x == 1 else 0.0
                    for m in range(modes):
                        total += reads[w, 0, i, m] * pushes[x, 0, j, m] + reads[w, 1, i, m] * pushes[x, 1, j, m]
                    moved[w, x, i, j] = -total
    re, im = np.zeros(modes), np.zeros(modes)
    q, v, q0, v0 = np.zeros(elements), np.zeros(elements), np.zeros(elements), np.zeros(elements)
    f0, f1, mean = np.zeros(elements), np.zeros(elements), np.zeros(elements)
    x0, x1 = np.zeros(elements), np.zeros(elements)
    for blow in range(blows):
        re[:], im[:] = surplus[blow, 0], surplus[blow, 1]
        x0[:], x1[:], mean[:] = 0.0, 0.0, 0.0
        largest, bound, peak = 0.0, 0.0, 0.0
        for e in range(elements):
            q0[e], v0[e] = motion[blow, 0, e, 0], motion[blow, 1, e, 0]
            for m in range(modes):
                q0[e] -= reads[0, 0, e, m] * re[m] + reads[0, 1, e, m] * im[m]
                v0[e] -= reads[1, 0, e, m] * re[m] + reads[1, 1, e, m] * im[m]
                bound += (abs(reads[1, 0, e, m]) + abs(reads[1, 1, e, m])) * (abs(re[m]) + abs(im[m]))
            f0[e] = 0.0
            if codes[e] == SLIP:
                f0[e] = state[blow, e]
            elif codes[e] != FRICTION:
                f0[e] = _law_force(codes[e], parameters[e], q0[e], v0[e])
            forces[blow, e, 0] = f0[e]
            for k in range(instants):
                peak = max(peak, abs(motion[blow, 1, e, k]))
        bound = _AWAY * (bound + peak) * step * instants
        for k in range(1, instants):
            for e in range(1, elements):
                for m in range(modes):
                    re[m] += pushes[0, 0, e, m] * x0[e] + pushes[1, 0, e, m] * x1[e]
                    im[m] += pushes[0, 1, e, m] * x0[e] + pushes[1, 1, e, m] * x1[e]
            # In one pass for the first element, mostly the only one: forces of the last step in, on to the new instant, motion out.
            start, end, dq, dv = x0[0], x1[0], 0.0, 0.0
            for m in range(modes):
                r = re[m] + pushes[0, 0, 0, m] * start + pushes[1, 0, 0, m] * end
                i = im[m] + pushes[0, 1, 0, m] * start + pushes[1, 1, 0, m] * end
                re[m] = turn[0, m] * r - turn[1, m] * i
                im[m] = turn[1, m] * r + turn[0, m] * i
                dq += reads[0, 0, 0, m] * re[m] + reads[0, 1, 0, m] * im[m]
                dv += reads[1, 0, 0, m] * re[m] + reads[1, 1, 0, m] * im[m]
            q[0], v[0] = motion[blow, 0, 0, k] - dq, motion[blow, 1, 0, k] - dv
            for e in range(1, elements):
                dq, dv = 0.0, 0.0
                for m in range(modes):
                    dq += reads[0, 0, e, m] * re[m] + reads[0, 1, e, m] * im[m]
                    dv += reads[1, 0, e, m] * re[m] + reads[1, 1, e, m] * im[m]
                q[e], v[e] = motion[blow, 0, e, k] - dq, motion[blow, 1, e, k] - dv
            for sweep in range(sweeps):
                change = 0.0
                for e in range(elements):
                    own_q, own_v = q[e], v[e]
                    for j in range(elements):
                        if j != e:
                            own_q += moved[0, 0, e, j] * x0[j] + moved[0, 1, e, j] * x1[j]
                            own_v += moved[1, 0, e, j] * x0[j] + moved[1, 1, e, j] * x1[j]
                    a0, a1, b0, b1 = -moved[0, 0, e, e], -moved[0, 1, e, e], -moved[1, 0, e, e], -moved[1, 1, e, e]
                    code, p = codes[e], parameters[e]
                    if code == FRICTION:
                        new = friction_mean(p[0], own_v, b0 + b1, v0[e])
                        before = x0[e]
                        x0[e], x1[e], f1[e] = new, new, new
                    elif _law_slope(code, p, own_q, own_v) * (b0 + b1 if code == QUADRATIC else a0 + a1) > _STIFF:
                        old = 0.0 if code == QUADRATIC else 0.5
                        a, b = (1.0 - old) * (a0 + a1), (1.0 - old) * (b0 + b1)
                        part = old * f0[e]
                        own_q, own_v = own_q - (a0 + a1) * part, own_v - (b0 + b1) * part
                        f1[e] = implicit_force(code, p, own_q, a, own_v, b, f0[e], q0[e])
                        before = x0[e]
                        new = part + (1.0 - old) * f1[e]
                        x0[e], x1[e], mean[e] = new, new, 0.0
                    else:
                        c = mean[e]
                        x0[e] = f0[e] + c
                        own_q, own_v = own_q - a0 * x0[e] - a1 * c, own_v - b0 * x0[e] - b1 * c
                        new = implicit_force(code, p, own_q, a1, own_v, b1, f0[e], q0[e])
                        before = x1[e]
                        x1[e], f1[e] = new + c, new
                        if elements > 1 or sweep == 0:
                            q1, v1 = own_q - a1 * new, own_v - b1 * new
                            half_q = 0.5 * (q0[e] + q1) + 0.125 * step * (v0[e] - v1)
                            half_v = 1.5 * (q1 - q0[e]) / step - 0.25 * (v0[e] + v1)
                            course_q, course_v = (q0[e], half_q, q1), (v0[e], half_v, v1)
                            mean[e] = _law_mean(code, p, course_q, course_v, f0[e], new) - 0.5 * (f0[e] + new)
                        new += mean[e]
                    largest = max(largest, abs(new))
                    change = max(change, abs(new - before))
                if change <= _SAME * largest:
                    break
            for e in range(elements):
                for j in range(elements):
                    q[e] += moved[0, 0, e, j] * x0[j] + moved[0, 1, e, j] * x1[j]
                    v[e] += moved[1, 0, e, j] * x0[j] + moved[1, 1, e, j] * x1[j]
            for e in range(elements):
                if not abs(q[e]) <= bound:
                    away[blow] = True
            if away[blow]:
                break
            for e in range(elements):
                forces[blow, e, k] = f1[e]
                if codes[e] != FRICTION:
                    # Half of a step's mean correction to either end: the same impulse.
                    forces[blow, e, k] += 0.5 * mean[e]
                    forces[blow, e, k - 1] += 0.5 * mean[e]
                q0[e], v0[e], f0[e] = q[e], v[e], f1[e]
        for e in range(elements):
            kept[blow, e] = f0[e]
            if codes[e] == FRICTION and instants > 1:
                forces[blow, e, 0] = forces[blow, e, 1]
    return forces, away, kept
