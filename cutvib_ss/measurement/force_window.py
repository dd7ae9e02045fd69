"""
Force window of a blow: what its sensor reads while no force acts is noise, and is taken out before a model is run through it.

A model would be shaken by it to the end of the record, where the structure was not. A contact that sticks in the model holds
against it: its H1 scatters by -H N/F, as the noise N of the force makes the measured one, and the contact would pass for one
of the structure's. H1 itself keeps that noise, which is white as its variance says; what a window leaves of it would be smooth.

Kept are the samples at which the force stands out, of the blow, of a second hit and of a sensor that swings out, and what follows
them for some lengths of the blow. Elsewhere the force is smoothed: what an AC-coupled one swings back, over a second and more, and
an offset that drifts stay (the transient window of McConnell and Varoto, Vibration Testing, Wiley).
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from cutvib_ss.results import FloatArray

_OF_PEAK = 0.05  # of the largest force: a blow, or a second one
_OF_NOISE = 6.0  # standard deviations of the noise, 1.48 times the median deviation: a force is noise but for the blow
_LONGER = 8  # times the length of the blow that a digitiser's filter rings, and a sensor swings out, after it
_FEWEST = 64  # samples that are kept after it at least
_OVER = (1, 4, 16, 64)  # samples whose mean may stand out of the noise
_STANDS_OUT = 5.0  # standard deviations of it: one sample in a million does by chance
_SLOW = 0.05  # s, standard deviation of the smoothing: of what lies above 8 Hz less than 5 % is left
_BOXES = 3  # running means, one after the other
_SMOOTH = 0.2  # of the power of white noise's differences: what changes less from sample to sample is no noise
_PASSES = 6  # until nothing more stands out


def stands_out(force: FloatArray) -> np.ndarray:
    """Samples at which a force passes 5 % of its peak, and six times its noise."""
    size = np.abs(force - np.median(force))
    peak = float(np.max(size, initial=0.0))
    return np.asarray(size > min(max(_OF_PEAK * peak, _OF_NOISE * 1.48 * float(np.median(size))), 0.5 * peak))


def followed_by(length: int) -> int:
    """Samples after a blow of a length that are not quiet yet."""
    return max(_LONGER * (length + 8), _FEWEST)


def windowed(force: FloatArray, fs: float, start: int) -> FloatArray:
    """The force of a blow that begins at a sample, its sensor's noise taken out; as it is where that is no noise."""
    loud = stands_out(force)
    if not loud.any():
        return force
    peak = int(np.argmax(np.abs(force - np.median(force))))
    acts = _widened(loud, 8, followed_by(_length(loud, peak)))
    acts[start : int(np.argmax(loud))] = True
    for _ in range(_PASSES):
        slow = _smoothed(force, ~acts, _SLOW * fs)
        rest = np.where(acts, 0.0, force - slow)
        more = _standing_out(rest, ~acts)
        if not more.any():
            break
        acts |= _widened(more, 8, _FEWEST)
    quiet = rest[~acts]
    if quiet.size < _FEWEST or np.var(np.diff(quiet)) < _SMOOTH * 2.0 * np.var(quiet):
        return force
    return np.where(acts, force, slow)


def _length(loud: np.ndarray, peak: int) -> int:
    """Samples of the run that holds the peak."""
    runs, _ = ndimage.label(loud)
    return int(np.count_nonzero(runs == runs[peak]))


def _widened(mask: np.ndarray, before: int, after: int) -> np.ndarray:
    """Samples so near to those of a mask."""
    steps = np.zeros(mask.size + 1, dtype=np.intp)
    at = np.flatnonzero(mask)
    np.add.at(steps, np.maximum(at - before, 0), 1)
    np.add.at(steps, np.minimum(at + after + 1, mask.size), -1)
    return np.asarray(np.cumsum(steps)[:-1] > 0)


def _smoothed(values: FloatArray, known: np.ndarray, width: float) -> FloatArray:
    """Weighted means about each sample, of those that are known; weights of a standard deviation [samples], nearly a Gaussian's."""
    both = np.stack([np.where(known, values, 0.0), known.astype(np.float64)])
    for _ in range(_BOXES):
        # Of a box of w samples the variance is w²/12.
        both = ndimage.uniform_filter1d(both, max(round(width * np.sqrt(12.0 / _BOXES)), 1), axis=-1, mode="constant")
    return np.asarray(both[0] / np.maximum(both[1], 1e-12))


def _standing_out(rest: FloatArray, quiet: np.ndarray) -> np.ndarray:
    """Samples over which the mean of a force that does not act stands out of its noise."""
    out = np.zeros(rest.size, dtype=bool)
    for count in _OVER:
        mean = ndimage.uniform_filter1d(rest, count, mode="constant")
        # Clipped from pass to pass; the median deviation says nothing of noise within a step of the converter.
        noise = float(np.std(mean[quiet])) if quiet.any() else 0.0
        stands = quiet & (np.abs(mean) > _STANDS_OUT * noise)
        out |= _widened(stands, count // 2, count // 2) & quiet
    return out
