"""Compiled recursion of modes under sampled forces, for histories at every sample."""

from __future__ import annotations

import numba
import numpy as np

from cutvib_ss.results import FloatArray


@numba.njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def advance(
    forces: FloatArray,
    turn: FloatArray,
    pushes: FloatArray,
    reads: FloatArray,
    begin: FloatArray,
    every: int,
) -> tuple[FloatArray, FloatArray]:
    """Modes under forces that are linear between instants."""
    count, instants = forces.shape
    modes, outputs = turn.shape[1], reads.shape[1]
    histories = np.zeros((outputs, (instants - 1) // every + 1))
    re, im = begin[0].copy(), begin[1].copy()
    for k in range(instants):
        if k:
            for j in range(count):
                start, end = forces[j, k - 1], forces[j, k]
                if j == 0:
                    for m in range(modes):
                        r = turn[0, m] * re[m] - turn[1, m] * im[m]
                        i = turn[1, m] * re[m] + turn[0, m] * im[m]
                        re[m] = r + pushes[0, 0, 0, m] * start + pushes[1, 0, 0, m] * end
                        im[m] = i + pushes[0, 1, 0, m] * start + pushes[1, 1, 0, m] * end
                else:
                    for m in range(modes):
                        re[m] += pushes[0, 0, j, m] * start + pushes[1, 0, j, m] * end
                        im[m] += pushes[0, 1, j, m] * start + pushes[1, 1, j, m] * end
        if k % every == 0:
            for o in range(outputs):
                total = 0.0
                for m in range(modes):
                    total += reads[0, o, m] * re[m] + reads[1, o, m] * im[m]
                histories[o, k // every] = total
    return histories, np.stack((re, im))
