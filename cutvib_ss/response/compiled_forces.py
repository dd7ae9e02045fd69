"""
Compiled loops of the harmonic balance, first half: from the harmonics of a port's motion to those of a law's force.

With q = Tx and v = ωT'x over the samples of a period the law's forces go back by the same table, F = P f, and so do their slopes.
Sums are not reordered here: with that liberty the order depended on where the small arrays lie in memory, and a sweep over corners
magnified what rounding differed by from call to call.
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
    n, samples = table.shape
    code, p = laws[which].code, numbers(values, which)
    for u in range(n):
        out[u] = 0.0
        for w in range(n):
            slope[u, w] = 0.0
    if code == SLIDES:
        _slipping(x, sliders[which], edges, back, out, slope)
        return
    # Loops over samples inside, which vectorise.
    force, by_q, by_v, along = np.zeros(samples), np.zeros(samples), np.zeros(samples), np.zeros(samples)
    q, v = np.zeros(samples), np.zeros(samples)
    for u in range(n):
        for t in range(samples):
            q[t] += table[u, t] * x[u]
            v[t] += omega * rate[u, t] * x[u]
    for t in range(samples):
        force[t] = resist(laws, code, p, q[t], v[t])
        by_q[t], by_v[t] = tangents(laws, code, p, q[t], v[t])
        by_v[t] *= omega
    for w in range(n):
        for t in range(samples):
            along[t] = by_q[t] * table[w, t] + by_v[t] * rate[w, t]
        for u in range(n):
            total = 0.0
            for t in range(samples):
                total += back[u, t] * along[t]
            slope[u, w] = total
    for u in range(n):
        total = 0.0
        for t in range(samples):
            total += back[u, t] * force[t]
        out[u] = total


@numba.njit(cache=True)
def _slipping(
    x: FloatArray, sliders: FloatArray, edges: FloatArray, back: FloatArray, out: FloatArray, slope: FloatArray
) -> None:
    """Jenkins elements, marched from rest through a turn and on through one that counts: by then they have forgotten rest."""
    # A turn is a period, or half of one whose other half mirrors it. Between the samples the motion is taken as straight, and what
    # counts at a sample is the force's mean from half a sample before to half a sample after: the force turns round within a sample
    # or two where the element is stiff.
    # An element sticks about its centre, within its limit over its stiffness. Of elements in the order of those widths the centres
    # differ by no more than the widths do (Krejci's play operators): they begin to slide in that order, and where the motion turns
    # round all that slid stick. So of those that stick only sums are kept.
    samples, n = edges.shape[0] - 1, edges.shape[1]
    count, last, before = 0, 0.0, samples
    while count < sliders.shape[0] and sliders[count, 0] > 0.0:
        count += 1
    centre, since = np.zeros(count), np.full(count, before)
    # Of the first, which slide one way, the forces; of the others Σk, Σk centre and its derivative.
    sliding, sense, slid = 0, 1.0, 0.0
    stiffness, about, then, middle = 0.0, 0.0, np.zeros(n), np.zeros(n)
    for i in range(count):
        stiffness += sliders[i, 0]
    for turn in range(-back.shape[1], back.shape[1]):
        t = turn % samples
        q = 0.0
        for u in range(n):
            q += edges[t, u] * x[u]
            middle[u] = 0.0
        if sense * (q - last) < 0.0:
            for i in range(sliding):
                k, limit = sliders[i]
                centre[i], since[i] = last - sense * limit / k, before
                stiffness += k
                about += k * centre[i]
                for u in range(n):
                    then[u] += k * edges[before, u]
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
                middle[u] += part * k * (edges[before, u] - edges[begun, u])
                middle[u] += 0.5 * part * part * k * (edges[t, u] - edges[before, u])
                then[u] -= k * edges[begun, u]
            stiffness -= k
            about -= k * centre[sliding]
            slid += sense * limit
            sliding += 1
        if turn >= 0:
            mean += 0.5 * stiffness * (q + last) - about
            for u in range(n):
                middle[u] += 0.5 * stiffness * (edges[t, u] + edges[before, u]) - then[u]
            for u in range(n):
                weight = back[u, t]
                out[u] += weight * mean
                for w in range(n):
                    slope[u, w] += weight * middle[w]
        last, before = q, t
