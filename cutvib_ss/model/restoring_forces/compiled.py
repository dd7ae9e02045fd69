"""
Kernels of the laws, compiled: one function each that picks the law by its code, for compiled loops to call.

The first argument, the records of `packed`, carries in its type which laws there are: where a law is added or its file changes,
loops are compiled anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.extending import overload, register_jitable

from cutvib_ss.model.restoring_forces.base import HELPERS, Course, Memoryless, Values
from cutvib_ss.model.restoring_forces.packed import memoryless
from cutvib_ss.results import FloatArray

FAST = {"contract", "reassoc", "nsz", "arcp"}
"""Liberties of floating-point arithmetic; NaN stays NaN."""

for _helper in HELPERS:
    register_jitable(fastmath=FAST, forceinline=True)(_helper)


def _own(law: type[Memoryless], kernel: str) -> Callable[..., Any]:
    """A law's kernel, compiled; Newton's method, Simpson's rule or the tangent here where it has none of its own."""
    compiled = numba.njit(fastmath=FAST, forceinline=True)
    given = getattr(law, kernel)
    if given is not None:
        return compiled(given)
    resist, tangents = compiled(law.resist), compiled(law.tangents)

    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        f = 0.0
        for _ in range(50):
            by_q, by_v = tangents(p, q - a * f, v - b * f)
            slope = 1.0 + a * by_q + b * by_v
            if slope < 1e-6:
                return math.nan
            change = (f - resist(p, q - a * f, v - b * f)) / slope
            f -= change
            if abs(change) <= 1e-15 * abs(f):
                break
        return f

    def mean(p: Values, q: Course, v: Course, f0: float, f1: float) -> float:
        return (f0 + 4.0 * resist(p, q[1], v[1]) + f1) / 6.0

    def steepest(p: Values, q: float, v: float) -> float:
        by_q, by_v = tangents(p, q, v)
        return abs(by_q) + abs(by_v)

    general: dict[str, Any] = {"implicit": implicit, "mean": mean, "steepest": steepest}
    return compiled(general[kernel])


def _picking(laws: tuple[type[Memoryless], ...], kernel: str, code: int = 0) -> Callable[..., Any]:
    """A function that calls the kernel of the law with a code."""
    own = _own(laws[code], kernel)
    if code == len(laws) - 1:

        def last(code: int, *args: Any) -> Any:
            return own(*args)

        return numba.njit(fastmath=FAST, forceinline=True)(last)
    here, rest = code, _picking(laws, kernel, code + 1)

    def picked(code: int, *args: Any) -> Any:
        if code == here:
            return own(*args)
        return rest(code, *args)

    return numba.njit(fastmath=FAST, forceinline=True)(picked)


@register_jitable(fastmath=FAST, forceinline=True)
def numbers(values: FloatArray, e: int) -> tuple[float, float, float, float, float, float]:
    """What the kernels of an element take: a tuple, since views of arrays in compiled loops are counted."""
    return values[e, 0], values[e, 1], values[e, 2], values[e, 3], values[e, 4], values[e, 5]


def resist(laws: np.ndarray, code: int, *args: Any) -> float:
    """Force of the law with a code; only in compiled code."""
    raise NotImplementedError


def tangents(laws: np.ndarray, code: int, *args: Any) -> tuple[float, float]:
    """Its tangents."""
    raise NotImplementedError


def implicit(laws: np.ndarray, code: int, *args: Any) -> float:
    """Its force at the new instant."""
    raise NotImplementedError


def mean(laws: np.ndarray, code: int, *args: Any) -> float:
    """Its mean over a step."""
    raise NotImplementedError


def steepest(laws: np.ndarray, code: int, *args: Any) -> float:
    """Its largest tangent."""
    raise NotImplementedError


def _compiled_by_overload(kernel: Callable[..., Any]) -> None:
    @overload(kernel, jit_options={"fastmath": FAST, "forceinline": True})
    def choose(laws: Any, code: Any, *args: Any) -> Any:
        picked = _picking(memoryless(), kernel.__name__)

        def call(laws: Any, code: Any, *args: Any) -> Any:
            return picked(code, *args)

        return call


for _kernel in (resist, tangents, implicit, mean, steepest):
    _compiled_by_overload(_kernel)


# --- friction without springs ------------------------------------------------------------------------------------------


@numba.njit(fastmath=FAST, forceinline=True)
def coulomb(torque: float, v: float, b: float, v0: float) -> float:
    """
    Mean force of Coulomb friction over a step; v without it at the end, b its compliance to a constant force, v0 at the start.

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
