"""
Estimated responses of blows that stop ringing: what moves by less than half a converter's step reads as nothing.

Noise that a converter sees carries a decay through its steps. Without it a response ends at the instant at which it falls below
half a step, at another one in each record and channel. All blows do that alike, so no coherence tells it, but the impulse response
does: after that instant it is far quieter than the noise that its record has by its coherence.
"""

from __future__ import annotations

import numpy as np

from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse

_BINS = 160  # Into which an impulse response is cut at the most
_EACH = 6  # Lines a bin at the least
_TAPER = 0.1  # Part of the band over which each of its ends is faded in
_BEFORE = 0.9  # Part of the block up to which what the taper smears ahead of the impulse does not reach
_SILENT = 0.15  # Part of the block that is quiet at the least
_QUIET = 1e-3  # Of the noise's power: a mean over six samples of white noise does not get there
_FALL = (
    0.05  # Part of the block within which the power falls to the next; exponential windows of usual rates take longer
)
_ABRUPT = 1e-3
_SMEARED = 2  # Bins by which the taper makes an end look late: earlier is safer


def stops(response: MeasuredFrequencyResponse) -> FloatArray:
    """
    When each channel's response stops after the impulse [s], shape (channel,); infinite where it does not.

    The lines are those of one block, and their variance is that of noise seen to scatter.
    """
    freq, data, variance = response.freq, response.data[0, :, 0], response.variance[0, :, 0]
    never = np.full(len(data), np.inf)
    bins = min(freq.size // _EACH, _BINS)
    if bins < 1.0 / _FALL or not response.estimator.scatter_seen:
        return never
    spacing = float(np.min(np.diff(freq)))
    at = np.round((freq - freq[0]) / spacing).astype(int)
    if at[-1] + 1 > 1.1 * freq.size or not np.allclose(freq, freq[0] + spacing * at, atol=0.01 * spacing):
        return never
    taper = _tapered(at / (at[-1] + 1))
    full = np.zeros((len(data), at[-1] + 1), dtype=np.complex128)
    full[:, at] = data * taper
    power = np.abs(np.fft.ifft(full, axis=-1)) ** 2
    each = full.shape[1] // bins
    noise = np.sum(variance * taper**2, axis=-1, keepdims=True) / full.shape[1] ** 2
    level = power[:, : bins * each].reshape(len(data), bins, each).mean(axis=-1) / np.maximum(noise, 1e-300)
    last, silent, fall = (round(part * bins) for part in (_BEFORE, _SILENT, _FALL))
    for k, own in enumerate(level):
        loud = np.flatnonzero(own[:last] > _QUIET)
        end = int(loud[-1]) if loud.size else last
        if (
            end + silent < last
            and own[end + 1 : end + 1 + fall].min() < _ABRUPT * own[max(end - fall, 0) : end + 1].max()
        ):
            never[k] = max(end - _SMEARED, 0.5) * each / (full.shape[1] * spacing)
    return never


def _tapered(part: FloatArray) -> FloatArray:
    """A window over the band that fades in and out as half a cosine; `part` runs from 0 to 1."""
    edge = np.clip(np.minimum(part, 1.0 - part) / _TAPER, 0.0, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * edge))
