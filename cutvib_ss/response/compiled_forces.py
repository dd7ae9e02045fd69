"""
Compiled loops of the harmonic balance, first half: from the harmonics of a port's motion to those of a law's force.

With q = Tx and v = ωT'x over the samples of a period the law's forces go back by the same table, F = P f, and so do their slopes.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from cutvib_ss.model.restoring_forces.compiled import numbers, resist, tangents
from cutvib_ss.model.restoring_forces.packed import SLIDES
from cutvib_ss.response.port_motion import Tables
from cutvib_ss.results import FloatArray


@numba.njit(cache=True)
def forces(
    x: FloatArray,
    omega: float,
    laws: np.ndarray,
    which: int,
    values: FloatArray,
    sliders: FloatArray,
    tables: Tables,
    out: FloatArray,
    slope: FloatArray,
) -> None:
    """Harmonics of a law's force into ``out``, their derivatives to the motion's x into ``slope``; ``which`` of the laws."""
    _, table, rate, edges, back = tables
    samples, n = table.shape
    code, p = laws[which].code, numbers(values, which)
    for u in range(n):
        out[u] = 0.0
        for w in range(n):
            slope[u, w] = 0.0
    if code == SLIDES:
        _slipping(x, sliders[which], edges, back, out, slope)
        return
    for t in range(samples):
        q, v = 0.0, 0.0
        for u in range(n):
            q += table[t, u] * x[u]
            v += omega * rate[t, u] * x[u]
        force = resist(laws, code, p, q, v)
        by_q, by_v = tangents(laws, code, p, q, v)
        by_v *= omega
        for u in range(n):
            weight = back[u, t]
            out[u] += weight * force
            for w in range(n):
                slope[u, w] += weight * (by_q * table[t, w] + by_v * rate[t, w])


@numba.njit(cache=True)
def _slipping(
    x: FloatArray, sliders: FloatArray, edges: FloatArray, back: FloatArray, out: FloatArray, slope: FloatArray
) -> None:
    """Jenkins elements, marched over two periods, of which the second counts: by then they have forgotten where they began."""
    # Between the samples the motion is taken as straight, and what counts at a sample is the force's mean from half a sample
    # before to half a sample after: the force turns round within a sample or two where the element is stiff.
    samples, n = edges.shape
    count = sliders.shape[0]
    ends, held = np.zeros((count, n)), np.zeros(count)
    middle, step = np.zeros(n), np.zeros(n)
    last = 0.0
    for u in range(n):
        last += edges[samples - 1, u] * x[u]
    for turn in range(2 * samples):
        t = turn % samples
        q = 0.0
        for u in range(n):
            q += edges[t, u] * x[u]
            step[u] = edges[t, u] - edges[t - 1, u]
            middle[u] = 0.0
        moved = q - last
        last = q
        mean = 0.0
        for i in range(count):
            k, limit, force = sliders[i, 0], sliders[i, 1], held[i]
            change = k * moved
            if abs(force + change) <= limit:
                mean += force + 0.5 * change
                held[i] = force + change
                for u in range(n):
                    middle[u] += ends[i, u] + 0.5 * k * step[u]
                    ends[i, u] += k * step[u]
            else:
                limit = math.copysign(limit, change)
                part = (limit - force) / change
                mean += limit - 0.5 * part * (limit - force)
                held[i] = limit
                for u in range(n):
                    middle[u] += part * ends[i, u] + 0.5 * part * part * k * step[u]
                    ends[i, u] = 0.0
        if turn >= samples:
            for u in range(n):
                weight = back[u, t]
                out[u] += weight * mean
                for w in range(n):
                    slope[u, w] += weight * middle[w]
