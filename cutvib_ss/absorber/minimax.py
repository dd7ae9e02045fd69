"""
The smallest largest of many smooth functions, by successive linear programs.

min t subject to g_i(x) ≤ t, the epigraph form, is linearised at x and solved within a box around it: with g_i + J_i d ≤ t
and |d| ≤ Δ it is a linear program of one variable more than x has. A step that lowers the largest value about as much as
promised is taken and widens the box, any other narrows it (K. Madsen, *Minimax solution of non-linear equations without
calculating derivatives*, 1975, with derivatives). Where as many functions meet at the optimum as there are variables and
one more, as absorbers' do, convergence is quadratic. It takes tens of thousands of functions: a program begins with the
largest and takes others in until its step breaks none.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import optimize

from cutvib_ss.results import FloatArray

_FIRST_BOX = 0.05
_GOOD, _POOR = 0.75, 0.25
_ROWS = 200
"""Functions with which a linear program begins, and which it takes in at a time where its step breaks others."""


def minimax(
    functions: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    start: FloatArray,
    iterations: int = 60,
    tolerance: float = 1e-6,
) -> tuple[FloatArray, float]:
    """
    Local minimum of the largest of many functions in the unit cube.

    >>> def two(x):
    ...     return np.array([x[0], 1 - x[0] ** 2]), np.array([[1.0], [-2 * x[0]]])
    >>> x, largest = minimax(two, np.array([0.1]))
    >>> round(largest, 6)
    0.618034
    """
    x = np.clip(np.asarray(start, dtype=float), 0.0, 1.0)
    values, slopes = functions(x)
    largest, box = float(values.max()), _FIRST_BOX
    for _ in range(iterations):
        step, promised = _program(values, slopes, x, box)
        if promised >= largest * (1.0 - tolerance):
            break
        new_values, new_slopes = functions(x + step)
        gain = (largest - float(new_values.max())) / (largest - promised)
        if gain > _GOOD:
            box = min(2.0 * box, 0.5)
        elif gain < _POOR:
            box /= 4.0
        if gain > 0.0:
            x, values, slopes, largest = x + step, new_values, new_slopes, float(new_values.max())
        if box < 1e-9:
            break
    return x, largest


def _program(values: FloatArray, slopes: FloatArray, x: FloatArray, box: float) -> tuple[FloatArray, float]:
    """The best step of the linearised problem within the box, and the largest value that it promises."""
    low, high = np.maximum(-box, -x) / box, np.minimum(box, 1.0 - x) / box
    scale, n = float(values.max()), x.size
    # Unit step variables d/box and t/scale keep the program well scaled.
    g, j = values / scale, slopes * (box / scale)
    rows = np.argsort(-g)[:_ROWS]
    while True:
        solved = optimize.linprog(
            np.append(np.zeros(n), 1.0),
            A_ub=np.column_stack([j[rows], -np.ones(rows.size)]),
            b_ub=-g[rows],
            bounds=[*zip(low, high, strict=True), (None, None)],
            method="highs",
        )
        if solved.x is None:
            return np.zeros(n), scale
        step, promised = solved.x[:n], float(solved.x[n])
        there = g + j @ step
        # The program itself keeps its rows to 1e-7 only.
        broken = np.setdiff1d(np.flatnonzero(there > promised + 1e-7), rows)
        if broken.size == 0:
            return np.asarray(step * box), promised * scale
        rows = np.append(rows, broken[np.argsort(-there[broken])[:_ROWS]])
