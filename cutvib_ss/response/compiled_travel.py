"""Compiled stepping of a machine whose head travels: Gauss collocation of order six."""

from __future__ import annotations

import numba
import numpy as np

from cutvib_ss.results import FloatArray

_ROOT = 15.0**0.5
NODES = np.array([0.5 - _ROOT / 10, 0.5, 0.5 + _ROOT / 10])
"""Stages of a step, as parts of it: zeros of Legendre's polynomial of degree three."""
WEIGHTS = np.array([5 / 18, 4 / 9, 5 / 18])
"""Gauss' weights there."""
STAGES = np.array(
    [
        [5 / 36, 2 / 9 - _ROOT / 15, 5 / 36 - _ROOT / 30],
        [5 / 36 + _ROOT / 24, 2 / 9, 5 / 36 - _ROOT / 24],
        [5 / 36 + _ROOT / 30, 2 / 9 + _ROOT / 15, 5 / 36],
    ]
)
"""Integrals of Lagrange's polynomials up to each stage."""
TWICE = STAGES @ STAGES
"""The same, integrated once more."""
RULES = np.vstack([NODES, WEIGHTS, STAGES, TWICE, WEIGHTS @ STAGES])
"""All of them, and the weights of accelerations in a step's displacement, as the loop takes them."""

_fast = {"contract", "reassoc", "nsz", "arcp"}


@numba.njit(cache=True, fastmath=_fast)
def _dot(a: FloatArray, b: FloatArray) -> float:
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@numba.njit(cache=True, fastmath=_fast)
def _solve(matrix: FloatArray, right: FloatArray) -> None:
    """Gaussian elimination with pivots, in place; for a few dozen unknowns quicker than a call of LAPACK."""
    n = right.size
    for i in range(n):
        pivot = i
        for r in range(i + 1, n):
            if abs(matrix[r, i]) > abs(matrix[pivot, i]):
                pivot = r
        if pivot != i:
            for j in range(i, n):
                matrix[i, j], matrix[pivot, j] = matrix[pivot, j], matrix[i, j]
            right[i], right[pivot] = right[pivot], right[i]
        for r in range(i + 1, n):
            part = matrix[r, i] / matrix[i, i]
            if part != 0.0:
                for j in range(i + 1, n):
                    matrix[r, j] -= part * matrix[i, j]
                right[r] -= part * right[i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            right[i] -= matrix[i, j] * right[j]
        right[i] /= matrix[i, i]


@numba.njit(cache=True, fastmath=_fast)
def travel_steps(
    fixed: FloatArray,
    rows: FloatArray,
    own: FloatArray,
    pushes: FloatArray,
    own_pushes: FloatArray,
    carried: FloatArray,
    forces: FloatArray,
    h: float,
    rules: FloatArray,
    begin: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Steps of a machine whose head travels, forces being linear between samples."""
    _, steps, _, n = carried.shape
    count = own_pushes.size
    motion, stages = np.zeros((steps + 1, 2, n)), np.zeros((steps, 3, n))
    motion[0] = begin
    system, a = np.zeros((3 * n, 3 * n)), np.zeros(3 * n)
    force = np.zeros(count)
    for step in range(steps):
        q, v = motion[step, 0], motion[step, 1]
        for s in range(3):
            p, d, dd = carried[0, step, s], carried[1, step, s], carried[2, step, s]
            for i in range(count):
                force[i] = forces[step, i] + rules[0, s] * (forces[step + 1, i] - forces[step, i])
            along = _dot(own_pushes, force)
            for i in range(n):
                gm, gc, gk = rows[0, i] + own[0] * p[i], rows[1, i] + own[1] * p[i], rows[2, i] + own[2] * p[i]
                right = _dot(pushes[i], force) + along * p[i]
                for j in range(n):
                    m = fixed[0, i, j] + p[i] * rows[0, j] + gm * p[j]
                    c = fixed[1, i, j] + p[i] * rows[1, j] + gc * p[j] + 2.0 * gm * d[j]
                    k = fixed[2, i, j] + p[i] * rows[2, j] + gk * p[j] + gc * d[j] + gm * dd[j]
                    right -= (c + rules[0, s] * h * k) * v[j] + k * q[j]
                    for t in range(3):
                        system[s * n + i, t * n + j] = h * (rules[2 + s, t] * c + h * rules[5 + s, t] * k)
                    system[s * n + i, s * n + j] += m
                a[s * n + i] = right
        _solve(system, a)
        for i in range(n):
            for t in range(3):
                stages[step, t, i] = a[t * n + i]
            x, u = q[i] + h * v[i], v[i]
            for t in range(3):
                u += h * rules[1, t] * stages[step, t, i]
                x += h * h * rules[8, t] * stages[step, t, i]
            motion[step + 1, 0, i], motion[step + 1, 1, i] = x, u
    return motion, stages
