"""
Compiled loops: modes driven by forces at a few ports, and the restoring forces there, implicit at each new instant.

Modes are kept as real and imaginary parts apart, so that loops over them vectorise.

Over a step of length h a nonlinear force is taken as linear, from x0 to x1. For a law without jumps these are the law's values at
both ends plus a constant that gives the force its true mean over the step (Simpson's rule on the cubic through both ends'
motions); the remaining error is of fourth order. A force that jumps (friction) is constant over a step, its mean.
"""

from __future__ import annotations

import numba
import numpy as np

from cutvib_ss.model.restoring_forces.compiled import (
    FAST,
    coulomb,
    implicit,
    mean,
    numbers,
    resist,
    steepest,
)
from cutvib_ss.model.restoring_forces.contacts import contacts, implicit_slide, move, place, read, slide
from cutvib_ss.model.restoring_forces.packed import JUMPS, SLIDES
from cutvib_ss.response.compiled_alone import AWAY, STIFF, interact_alone
from cutvib_ss.results import FloatArray

_SWEEPS = 12
"""Largest number of sweeps over several elements in a step."""
_SAME = 1e-9
"""Sweeps end when forces move by less than this part of the largest one so far."""


def interact(
    motion: FloatArray,
    surplus: FloatArray,
    step: float,
    turn: FloatArray,
    pushes: FloatArray,
    reads: FloatArray,
    compliance: FloatArray,
    laws: np.ndarray,
    values: FloatArray,
    sliders: FloatArray,
    state: FloatArray,
) -> tuple[FloatArray, np.ndarray, FloatArray]:
    """Nonlinear forces at ports whose linear motion is known."""
    loop = interact_alone if motion.shape[2] == 1 else _interact_together
    found: tuple[FloatArray, np.ndarray, FloatArray] = loop(
        motion, surplus, step, turn, pushes, reads, compliance, laws, values, sliders, state
    )
    return found


@numba.njit(cache=True, fastmath=FAST)
def _interact_together(
    motion: FloatArray,
    surplus: FloatArray,
    step: float,
    turn: FloatArray,
    pushes: FloatArray,
    reads: FloatArray,
    compliance: FloatArray,
    laws: np.ndarray,
    values: FloatArray,
    sliders: FloatArray,
    state: FloatArray,
) -> tuple[FloatArray, np.ndarray, FloatArray]:
    """The same of several elements."""
    blows, _, elements, instants = motion.shape
    modes = turn.shape[1]
    forces = np.zeros((blows, elements, instants))
    away = np.zeros(blows, dtype=np.bool_)
    kept = state.copy()
    stand, sliding = contacts(sliders), np.zeros(elements, np.int64)
    codes, by_rate, stiffness = np.zeros(elements, np.int64), np.zeros(elements, np.bool_), np.zeros(elements)
    for e in range(elements):
        codes[e], by_rate[e], stiffness[e] = laws[e].code, laws[e].by_rate == 1, sliders[e, :, 0].sum()
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
    f0, f1, extra = np.zeros(elements), np.zeros(elements), np.zeros(elements)
    x0, x1 = np.zeros(elements), np.zeros(elements)
    for blow in range(blows):
        re[:], im[:] = surplus[blow, 0], surplus[blow, 1]
        x0[:], x1[:], extra[:] = 0.0, 0.0, 0.0
        largest, bound, peak = 0.0, 0.0, 0.0
        for e in range(elements):
            q0[e], v0[e] = motion[blow, 0, e, 0], motion[blow, 1, e, 0]
            for m in range(modes):
                q0[e] -= reads[0, 0, e, m] * re[m] + reads[0, 1, e, m] * im[m]
                v0[e] -= reads[1, 0, e, m] * re[m] + reads[1, 1, e, m] * im[m]
                bound += (abs(reads[1, 0, e, m]) + abs(reads[1, 1, e, m])) * (abs(re[m]) + abs(im[m]))
            f0[e] = 0.0
            if codes[e] == SLIDES:
                place(stand, e, state[blow, e], q0[e])
                f0[e] = state[blow, e].sum()
            elif codes[e] != JUMPS:
                f0[e] = resist(laws, codes[e], numbers(values, e), q0[e], v0[e])
            forces[blow, e, 0] = f0[e]
            for k in range(instants):
                peak = max(peak, abs(motion[blow, 1, e, k]))
        bound = AWAY * (bound + peak) * step * instants
        for k in range(1, instants):
            for e in range(1, elements):
                for m in range(modes):
                    re[m] += pushes[0, 0, e, m] * x0[e] + pushes[1, 0, e, m] * x1[e]
                    im[m] += pushes[0, 1, e, m] * x0[e] + pushes[1, 1, e, m] * x1[e]
            # In one pass for the first element: forces of the last step in, on to the new instant, motion out.
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
            for _ in range(_SWEEPS):
                change = 0.0
                for e in range(elements):
                    own_q, own_v = q[e], v[e]
                    for j in range(elements):
                        if j != e:
                            own_q += moved[0, 0, e, j] * x0[j] + moved[0, 1, e, j] * x1[j]
                            own_v += moved[1, 0, e, j] * x0[j] + moved[1, 1, e, j] * x1[j]
                    a0, a1, b0, b1 = -moved[0, 0, e, e], -moved[0, 1, e, e], -moved[1, 0, e, e], -moved[1, 1, e, e]
                    code, p = codes[e], numbers(values, e)
                    if code == JUMPS:
                        new = coulomb(sliders[e, 0, 1], own_v, b0 + b1, v0[e])
                        before = x0[e]
                        x0[e], x1[e], f1[e] = new, new, new
                        largest, change = max(largest, abs(new)), max(change, abs(new - before))
                        continue
                    slope = stiffness[e] if code == SLIDES else steepest(laws, code, p, own_q, own_v)
                    held = slope * (b0 + b1 if by_rate[e] else a0 + a1) > STIFF
                    if held:
                        old = 0.0 if by_rate[e] else 0.5
                        a, b = (1.0 - old) * (a0 + a1), (1.0 - old) * (b0 + b1)
                        part, c = old * f0[e], 0.0
                        own_q, own_v = own_q - (a0 + a1) * part, own_v - (b0 + b1) * part
                    else:
                        a, b, c = a1, b1, extra[e]
                        part = f0[e] + c
                        own_q, own_v = own_q - a0 * part - a1 * c, own_v - b0 * part - b1 * c
                    if code == SLIDES:
                        f, sliding[e] = implicit_slide(stand, e, own_q, a)
                    else:
                        f = implicit(laws, code, p, own_q, a, own_v, b)
                    f1[e] = f
                    if held:
                        before = x0[e]
                        new = part + (1.0 - old) * f
                        x0[e], x1[e], extra[e] = new, new, 0.0
                    else:
                        before = x1[e]
                        x0[e], x1[e] = part, f + c
                        q1, v1 = own_q - a * f, own_v - b * f
                        half_q = 0.5 * (q0[e] + q1) + 0.125 * step * (v0[e] - v1)
                        half_v = 1.5 * (q1 - q0[e]) / step - 0.25 * (v0[e] + v1)
                        if code == SLIDES:
                            half = slide(stand, e, half_q)
                            whole = (f0[e] + 4.0 * half + f) / 6.0
                        else:
                            course_q, course_v = (q0[e], half_q, q1), (v0[e], half_v, v1)
                            whole = mean(laws, code, p, course_q, course_v, f0[e], f)
                        extra[e] = whole - 0.5 * (f0[e] + f)
                        new = f + extra[e]
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
                if codes[e] != JUMPS:
                    # Half of a step's mean correction to either end: the same impulse.
                    forces[blow, e, k] += 0.5 * extra[e]
                    forces[blow, e, k - 1] += 0.5 * extra[e]
                if codes[e] == SLIDES:
                    move(stand, e, q[e], sliding[e])
                q0[e], v0[e], f0[e] = q[e], v[e], f1[e]
        for e in range(elements):
            if codes[e] == SLIDES:
                read(stand, e, kept[blow, e])
            else:
                kept[blow, e, 0] = f0[e]
            if codes[e] == JUMPS and instants > 1:
                forces[blow, e, 0] = forces[blow, e, 1]
    return forces, away, kept
