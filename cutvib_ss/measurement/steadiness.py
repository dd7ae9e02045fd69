"""
Whether a machine stays the same over a continuous recording.

A frequency response is a mean over the record. Where the machine warms or settles meanwhile, resonances smear in it, as if there
were more of them. Block b shows H + t_b D, with t_b from -1 of the first block to 1 of the last; what blocks of a machine that
stays the same leave, noise and leakage, does not order with time.
"""

from __future__ import annotations

import numpy as np
from scipy import stats

from cutvib_ss.measurement.replay import Replay
from cutvib_ss.results import FloatArray

WORDS = (
    "the machine changes within {}: from the middle of a record to its ends the response moves by up to {:.0%}, and the mean is "
    "that of no machine; wait until it has settled, or record shorter"
)
"""What is said of it: names of the records, relative size."""

_CHANCE = 1e-6  # that a machine which stays the same orders with time as much
_FEWEST = 4  # blocks: two tell the response and its change, the others the noise
_LINES = 8  # that are taken together: neighbours leak into each other, and count half
_OVERLAP = 1.4  # of the variance of a slope over time: overlapping blocks share a part of their noise


def change_within(replay: Replay) -> FloatArray | None:
    """
    Mean square of what responses move by from the middle of a recording to its ends, shape (channel, line), less that of noise.

    None where it does not stand out of what scatters from block to block, or where too few blocks tell.
    """
    found, chances = [], [1.0]
    for force, responses in zip(replay.spectra, replay.measured, strict=False):
        blocks, responded = len(force), replay.transformed(responses)
        if blocks < _FEWEST:
            continue
        # A line that was not driven tells nothing.
        power = np.abs(force) ** 2
        power += 1e-28 * float(power.max())
        time = np.linspace(-1.0, 1.0, blocks)[:, None]
        time = time - np.sum(time * power, axis=0) / np.sum(power, axis=0)
        moving = np.sum(time**2 * power, axis=0)
        mean = np.einsum("bl,cbl->cl", force.conj(), responded) / np.sum(power, axis=0)
        rest = responded - mean[:, None] * force
        slope = np.einsum("bl,cbl->cl", time * force.conj(), rest) / moving
        told = np.abs(slope) ** 2 * moving
        noise = (np.sum(np.abs(rest) ** 2, axis=1) - told) / (blocks - 2)
        lines = told.shape[1] // _LINES * _LINES
        each, other = (a[:, :lines].reshape(-1, lines // _LINES, _LINES).sum(axis=-1) for a in (told, noise))
        if each.size:
            ratio = each / np.maximum(other, np.finfo(float).tiny) / _OVERLAP
            chances.append(float(stats.f.sf(ratio, _LINES, _LINES * (blocks - 2)).min()) * ratio.size)
        found.append((told - noise) / moving)
    return np.maximum(np.mean(found, axis=0), 0.0) if min(chances) < _CHANCE else None
