"""
The compiled loop of `compiled` for one element alone, which is what nearly every model with a restoring force has.

Nothing couples its force to another's, and the modes' constants lie in rows of one table whose length is a whole number of vector
registers: the loop over the modes then has no remainder, which would take longer than all the rest. The step itself stands here and
in `compiled`: in a function of its own, inlined, it took the loops 1.1 to 1.6 times as long.
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
from cutvib_ss.results import FloatArray

_WIDE = 8
"""Modes in a vector register, at most; those that are lacking stay at rest."""
STIFF = 0.3
"""Slope of a law times the step's compliance beyond which the force is held constant over the step, since its course there is not
resolved anyway: stable at any slope, the mean of both ends' forces for displacement, the new one for velocity."""
AWAY = 1e3
"""A motion this many times what the largest linear velocity could do over the record has run away (a softening law)."""
_MEANS = 2
"""Sweeps of a step: the second with the mean that follows from the first, whose error is the step's times the same factor again."""


@numba.njit(cache=True, fastmath=FAST)
def interact_alone(
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
    """Nonlinear forces of one element whose port's linear motion is known."""
    blows, _, _, instants = motion.shape
    modes = turn.shape[1]
    wide = (modes + _WIDE - 1) // _WIDE * _WIDE
    forces = np.zeros((blows, 1, instants))
    away = np.zeros(blows, dtype=np.bool_)
    kept = state.copy()
    stand, sliding = contacts(sliders), 0
    code, by_rate, p = laws[0].code, laws[0].by_rate == 1, numbers(values, 0)
    stiffness, friction = sliders[0, :, 0].sum(), sliders[0, 0, 1]
    # Turn of each mode, what forces at both ends of a step add to it at the new instant, and displacement and velocity of the port:
    # real parts, then imaginary ones.
    table = np.zeros((10, wide))
    # Compliances of displacement (a) and velocity (b) at the new instant to the force at the start and at the end of a step.
    a0, a1, b0, b1 = 0.0, compliance[0, 0, 0], 0.0, compliance[1, 0, 0]
    for m in range(modes):
        table[0, m], table[1, m] = turn[0, m], turn[1, m]
        for x in range(2):
            re, im = pushes[x, 0, 0, m], pushes[x, 1, 0, m]
            table[2 + 2 * x, m] = turn[0, m] * re - turn[1, m] * im
            table[3 + 2 * x, m] = turn[1, m] * re + turn[0, m] * im
        for w in range(2):
            table[6 + 2 * w, m], table[7 + 2 * w, m] = reads[w, 0, 0, m], reads[w, 1, 0, m]
        a0 += reads[0, 0, 0, m] * pushes[0, 0, 0, m] + reads[0, 1, 0, m] * pushes[0, 1, 0, m]
        a1 += reads[0, 0, 0, m] * pushes[1, 0, 0, m] + reads[0, 1, 0, m] * pushes[1, 1, 0, m]
        b0 += reads[1, 0, 0, m] * pushes[0, 0, 0, m] + reads[1, 1, 0, m] * pushes[0, 1, 0, m]
        b1 += reads[1, 0, 0, m] * pushes[1, 0, 0, m] + reads[1, 1, 0, m] * pushes[1, 1, 0, m]
    z = np.zeros((2, wide))
    for blow in range(blows):
        x0, x1, extra = 0.0, 0.0, 0.0
        bound, peak = 0.0, 0.0
        q0, v0 = motion[blow, 0, 0, 0], motion[blow, 1, 0, 0]
        for m in range(modes):
            re, im = surplus[blow, 0, m], surplus[blow, 1, m]
            z[0, m], z[1, m] = re, im
            q0 -= table[6, m] * re + table[7, m] * im
            v0 -= table[8, m] * re + table[9, m] * im
            bound += (abs(table[8, m]) + abs(table[9, m])) * (abs(re) + abs(im))
        for k in range(instants):
            peak = max(peak, abs(motion[blow, 1, 0, k]))
        bound = AWAY * (bound + peak) * step * instants
        f0 = 0.0
        if code == SLIDES:
            place(stand, 0, state[blow, 0], q0)
            f0 = state[blow, 0].sum()
        elif code != JUMPS:
            f0 = resist(laws, code, p, q0, v0)
        forces[blow, 0, 0] = f0
        for k in range(1, instants):
            # In one pass: forces of the last step in, on to the new instant, motion out.
            dq, dv = 0.0, 0.0
            for m in range(wide):
                re = table[0, m] * z[0, m] - table[1, m] * z[1, m] + table[2, m] * x0 + table[4, m] * x1
                im = table[1, m] * z[0, m] + table[0, m] * z[1, m] + table[3, m] * x0 + table[5, m] * x1
                z[0, m], z[1, m] = re, im
                dq += table[6, m] * re + table[7, m] * im
                dv += table[8, m] * re + table[9, m] * im
            q, v = motion[blow, 0, 0, k] - dq, motion[blow, 1, 0, k] - dv
            f = 0.0
            if code == JUMPS:
                f = coulomb(friction, v, b0 + b1, v0)
                x0, x1 = f, f
            else:
                slope = stiffness if code == SLIDES else steepest(laws, code, p, q, v)
                held = slope * (b0 + b1 if by_rate else a0 + a1) > STIFF
                if held:
                    old = 0.0 if by_rate else 0.5
                    a, b, part = (1.0 - old) * (a0 + a1), (1.0 - old) * (b0 + b1), old * f0
                    own_q, own_v = q - (a0 + a1) * part, v - (b0 + b1) * part
                    if code == SLIDES:
                        f, sliding = implicit_slide(stand, 0, own_q, a)
                    else:
                        f = implicit(laws, code, p, own_q, a, own_v, b)
                    x0 = part + (1.0 - old) * f
                    x1, extra = x0, 0.0
                else:
                    for sweep in range(_MEANS):
                        c = extra
                        part = f0 + c
                        own_q, own_v = q - a0 * part - a1 * c, v - b0 * part - b1 * c
                        if code == SLIDES:
                            f, sliding = implicit_slide(stand, 0, own_q, a1)
                        else:
                            f = implicit(laws, code, p, own_q, a1, own_v, b1)
                        x0, x1 = part, f + c
                        if sweep == 0:
                            q1, v1 = own_q - a1 * f, own_v - b1 * f
                            half_q = 0.5 * (q0 + q1) + 0.125 * step * (v0 - v1)
                            half_v = 1.5 * (q1 - q0) / step - 0.25 * (v0 + v1)
                            if code == SLIDES:
                                half = slide(stand, 0, half_q)
                                whole = (f0 + 4.0 * half + f) / 6.0
                            else:
                                course_q, course_v = (q0, half_q, q1), (v0, half_v, v1)
                                whole = mean(laws, code, p, course_q, course_v, f0, f)
                            extra = whole - 0.5 * (f0 + f)
            q -= a0 * x0 + a1 * x1
            v -= b0 * x0 + b1 * x1
            if not abs(q) <= bound:
                away[blow] = True
                break
            forces[blow, 0, k] = f
            if code != JUMPS:
                # Half of a step's mean correction to either end: the same impulse.
                forces[blow, 0, k] += 0.5 * extra
                forces[blow, 0, k - 1] += 0.5 * extra
            if code == SLIDES:
                move(stand, 0, q, sliding)
            q0, v0, f0 = q, v, f
        if code == SLIDES:
            read(stand, 0, kept[blow, 0])
        else:
            kept[blow, 0, 0] = f0
        if code == JUMPS and instants > 1:
            forces[blow, 0, 0] = forces[blow, 0, 1]
    return forces, away, kept
