"""
Compiled loops of the harmonic balance, first half: from the harmonics of a port's motion to those of a law's force.

With q = Tx and v = ωT'x over the samples of a period the law's forces go back by the same table, F = P f, and so do their slopes.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numba
import numpy as np

from cutvib_ss.response.compiled import BILINEAR, CUBIC, FREEPLAY, SLIP
from cutvib_ss.results import FloatArray

_Tables: TypeAlias = tuple[np.ndarray, FloatArray, FloatArray, FloatArray, FloatArray]
"""Harmonic numbers, a zero for the mean; T, T', and T half a sample later (sample, unknown); P (unknown, sample)."""


@numba.njit(cache=True)
def _law(code: int, p: FloatArray, q: float, v: float) -> tuple[float, float, float]:
    """Force of a law without memory, and its slopes to displacement and velocity."""
    if code == CUBIC:
        return p[0] * q * q * q, 3.0 * p[0] * q * q, 0.0
    if code == FREEPLAY:
        if abs(q) < p[0]:
            return -p[1] * q, -p[1], 0.0
        return -p[1] * math.copysign(p[0], q), 0.0, 0.0
    if code == BILINEAR:
        return p[0] * p[1] * abs(q), p[0] * p[1] * math.copysign(1.0, q), 0.0
    return p[0] * v * abs(v), 0.0, 2.0 * p[0] * abs(v)


@numba.njit(cache=True)
def forces(
    x: FloatArray, omega: float, code: int, p: FloatArray, tables: _Tables, out: FloatArray, slope: FloatArray
) -> None:
    """
    Harmonics of a law's force and their derivatives to the motion's.

    Parameters
    ----------
    x : ndarray, shape (unknown,)
        Motion of the port.
    omega : float
        Frequency [rad/s].
    code : int
        The law.
    p : ndarray, shape (2,)
        Its parameters.
    tables : tuple
        Harmonics and tables.
    out : ndarray, shape (unknown,)
        Takes the harmonics of the force.
    slope : ndarray, shape (unknown, unknown)
        Takes their derivatives.
    """
    _, table, rate, edges, back = tables
    samples, n = table.shape
    for u in range(n):
        out[u] = 0.0
        for w in range(n):
            slope[u, w] = 0.0
    if code == SLIP:
        _slipping(x, p, edges, back, out, slope)
        return
    for t in range(samples):
        q, v = 0.0, 0.0
        for u in range(n):
            q += table[t, u] * x[u]
            v += omega * rate[t, u] * x[u]
        force, by_q, by_v = _law(code, p, q, v)
        by_v *= omega
        for u in range(n):
            weight = back[u, t]
            out[u] += weight * force
            for w in range(n):
                slope[u, w] += weight * (by_q * table[t, w] + by_v * rate[t, w])


@numba.njit(cache=True)
def _slipping(
    x: FloatArray, p: FloatArray, edges: FloatArray, back: FloatArray, out: FloatArray, slope: FloatArray
) -> None:
    """
    A Jenkins element, marched over two periods, of which the second counts: by then it has forgotten where it began.

    Between the samples the motion is taken as straight, and what counts at a sample is the force's mean from half a sample
    before to half a sample after: the force turns round within a sample or two where the element is stiff.
    """
    samples, n = edges.shape
    ends, middle, step = np.zeros(n), np.zeros(n), np.zeros(n)
    force, last = 0.0, 0.0
    for u in range(n):
        last += edges[samples - 1, u] * x[u]
    for turn in range(2 * samples):
        t = turn % samples
        q = 0.0
        for u in range(n):
            q += edges[t, u] * x[u]
            step[u] = p[0] * (edges[t, u] - edges[t - 1, u])
        change = p[0] * (q - last)
        last = q
        if abs(force + change) <= p[1]:
            mean = force + 0.5 * change
            force += change
            for u in range(n):
                middle[u] = ends[u] + 0.5 * step[u]
                ends[u] += step[u]
        else:
            limit = math.copysign(p[1], change)
            part = (limit - force) / change
            mean = limit - 0.5 * part * (limit - force)
            force = limit
            for u in range(n):
                middle[u] = part * ends[u] + 0.5 * part * part * step[u]
                ends[u] = 0.0
        if turn >= samples:
            for u in range(n):
                weight = back[u, t]
                out[u] += weight * mean
                for w in range(n):
                    slope[u, w] += weight * middle[w]
