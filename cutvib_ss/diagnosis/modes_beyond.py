"""
Resonances of the records above the highest mode of a structure's model.

A model of a few modes says nothing of those above. Where one lies in the band, no tuning and no cause can stand for it, and an
engineer looks at the lines below only. A cause may bring a resonance of its own, so that the band is cut only where no linear
cause explains what is there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import ndimage, signal

from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.results import FloatArray

BEYOND = (
    "the model's highest mode is at {:.4g} Hz, and the responses have a resonance at {:.4g} Hz that nothing here explains: "
    "lines above {:.4g} Hz are left out; add modes to the model, or state band_hz"
)


def resonance_beyond(nominal: Model, entries: Sequence[Entry]) -> float | None:
    """Lowest resonance [Hz] well above the model's highest mode that most records of one input show; None where there is none."""
    if nominal.highest_mode is None:
        return None
    above = nominal.highest_mode[0] * SETTINGS.record_beyond_mode
    found = [
        _shared([_resonances(e, above) for e in entries if e.input == name]) for name in {e.input for e in entries}
    ]
    return min((f for f in found if f is not None), default=None)


def _shared(each: Sequence[FloatArray]) -> float | None:
    """The lowest resonance that most records show: one that comes by chance is not close to it in others."""
    for f in np.sort(np.concatenate(each)).tolist():
        same = sum(bool(np.any(np.abs(other / f - 1.0) < SETTINGS.record_same_resonance)) for other in each)
        if same > len(each) / 2:
            return float(f)
    return None


def _resonances(e: Entry, above: float) -> FloatArray:
    """Frequencies above some frequency at which the responses of all channels together have a peak."""
    heard = (e.freq > above) & (np.max(np.abs(e.data) ** 2 / e.variance, axis=0) > SETTINGS.record_heard)
    if np.count_nonzero(heard) < SETTINGS.record_fewest_lines:
        return np.zeros(0)
    size = np.abs(e.data[:, heard])
    together = np.linalg.norm(size / np.mean(size, axis=1, keepdims=True), axis=0)
    height = 20.0 * np.log10(ndimage.median_filter(together, 3, mode="nearest"))
    peaks, _ = signal.find_peaks(height, prominence=SETTINGS.record_prominence)
    return np.asarray(e.freq[heard][peaks], dtype=np.float64)
