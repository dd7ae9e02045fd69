"""
Compiled loops of the harmonic balance, first half: from the harmonics of a port's motion to those of a law's force.

With q = Tx and v = ωT'x over the samples of a period the law's forces go back by the same table, F = P f, and so do their slopes.
"""

from __future__ import annotations

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
    # An element sticks about its centre, within its limit over its stiffness. Of elements in the order of those widths the centres
    # differ by no more than the widths do (Krejci's play operators): they begin to slide in that order, and where the motion turns
    # round all that slid stick. So of those that stick only sums are kept.
    samples, n = edges.shape
    count, last = 0, 0.0
    while count < sliders.shape[0] and sliders[count, 0] > 0.0:
        count += 1
    for u in range(n):
        last += edges[samples - 1, u] * x[u]
    centre, since = np.full(count, last), np.full(count, samples - 1)
    # Of the first, which slide one way, the forces; of the others Σk, Σk centre and its derivative.
    sliding, sense, slid = 0, 1.0, 0.0
    stiffness, then, middle = 0.0, np.zeros(n), np.zeros(n)
    for i in range(count):
        stiffness += sliders[i, 0]
    about = stiffness * last
    for u in range(n):
        then[u] = stiffness * edges[samples - 1, u]
    for turn in range(2 * samples):
        t = turn % samples
        q = 0.0
        for u in range(n):
            q += edges[t, u] * x[u]
            middle[u] = 0.0
        if sense * (q - last) < 0.0:
            for i in range(sliding):
                k, limit = sliders[i]
                centre[i], since[i] = last - sense * limit / k, t - 1
                stiffness += k
                about += k * centre[i]
                for u in range(n):
                    then[u] += k * edges[t - 1, u]
            sliding, sense, slid = 0, -sense, 0.0
        mean = slid
        while sliding < count:
            k, limit = sliders[sliding]
            if sense * k * (q - centre[sliding]) <= limit:
                break
            force = k * (last - centre[sliding])
            lacks = sense * limit - force
            part = lacks / (k * (q - last))
            mean += sense * limit - 0.5 * part * lacks
            begun = since[sliding]
            for u in range(n):
                middle[u] += part * k * (edges[t - 1, u] - edges[begun, u])
                middle[u] += 0.5 * part * part * k * (edges[t, u] - edges[t - 1, u])
                then[u] -= k * edges[begun, u]
            stiffness -= k
            about -= k * centre[sliding]
            slid += sense * limit
            sliding += 1
        if turn >= samples:
            mean += 0.5 * stiffness * (q + last) - about
            for u in range(n):
                middle[u] += 0.5 * stiffness * (edges[t, u] + edges[t - 1, u]) - then[u]
            for u in range(n):
                weight = back[u, t]
                out[u] += weight * mean
                for w in range(n):
                    slope[u, w] += weight * middle[w]
        last = q
