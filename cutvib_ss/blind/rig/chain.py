"""The measurement chain: from what the machine does to what the files hold."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.blind.rig.blows import BLOCK, FS
from cutvib_ss.blind.rig.conditions import Conditions
from cutvib_ss.blind.rig.motion import CHANNELS
from cutvib_ss.blind.rig.structure import TOLERANCE, Chain

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_PADDED = round(4.0 * FS)
_TERMS = 5


def smooth_error(rng: np.random.Generator, freq: Array) -> Complex:
    """
    Draw a channel's calibration error.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator.
    freq : ndarray, shape (frequency,)
        Frequencies [Hz].

    Returns
    -------
    ndarray of complex, shape (frequency,)
        1 + ε, smooth and complex, of the tolerance's size.

    Notes
    -----
    ε is a few slow cosines, real and imaginary part independent, over an axis between log-frequency (an amplifier's corner,
    low down) and frequency (a resonance far above); the phase error tends to 0 at 0 Hz.
    """
    corner = float(np.exp(rng.uniform(np.log(30.0), np.log(1000.0))))
    x = np.log1p(freq / corner) / np.log1p(FS / 2 / corner)
    shapes = np.cos(np.pi * np.arange(_TERMS)[:, None] * x[None]) * np.sqrt([1.0, 2.0, 2.0, 2.0, 2.0])[:, None]
    share = np.array([0.7, 0.5, 0.35, 0.25, 0.15])
    share *= TOLERANCE["calibration"] / np.linalg.norm(share)
    gain, phase = (rng.standard_normal((2, _TERMS)) * share) @ shapes
    return np.asarray(1 + gain + 1j * phase * np.minimum(freq / 20.0, 1.0))


def linear_part(chain: Chain, name: str, freq: Array) -> Complex:
    """
    Gain, delay and a loose mount's resonance of one channel.

    Parameters
    ----------
    chain : Chain
        The measurement chain.
    name : str
        The channel.
    freq : ndarray, shape (frequency,)
        Frequencies [Hz].

    Returns
    -------
    ndarray of complex, shape (frequency,)
        Shown over true.
    """
    answer = chain.gains.get(name, 1.0) * np.exp(-2j * np.pi * freq * chain.delays.get(name, 0.0))
    if name in chain.mounts:
        resonance, ratio = chain.mounts[name]
        x = freq / resonance
        answer = answer / (1 - x**2 + 2j * ratio * x)
    return np.asarray(answer)


def sensed(chain: Chain, accelerations: Array, late: float, errors: Complex | None = None) -> Array:
    """
    What the response channels show without noise.

    Parameters
    ----------
    chain : Chain
        The measurement chain.
    accelerations : ndarray, shape (channel, sample)
        Accelerations at FS [m/s^2].
    late : float
        How late the responses of this blow are [s].
    errors : ndarray of complex, shape (channel, frequency), optional
        Calibration errors at `frequencies`.

    Returns
    -------
    ndarray, shape (channel, sample)
        Histories over BLOCK [m/s^2].

    Notes
    -----
    Saturation comes first, in the sensor; then the leak of X into Z; then gains, delays and calibration errors.
    """
    count = round(BLOCK * FS)
    shown = accelerations.copy()
    for i, name in enumerate(CHANNELS):
        if name in chain.saturation:
            limit = chain.saturation[name]
            shown[i] = limit * np.tanh(shown[i] / limit)
    shown[1] += chain.cross_axis * shown[0]
    freq = frequencies()
    spectra = np.fft.rfft(shown, _PADDED)
    for i, name in enumerate(CHANNELS):
        spectra[i] *= linear_part(chain, name, freq) * np.exp(-2j * np.pi * freq * late)
        if errors is not None:
            spectra[i] *= errors[i]
    return np.asarray(np.fft.irfft(spectra, _PADDED)[:, :count])


def frequencies() -> Array:
    """
    Frequencies of the transforms in `sensed`.

    Returns
    -------
    ndarray, shape (frequency,)
        Frequencies [Hz].
    """
    return np.asarray(np.fft.rfftfreq(_PADDED, 1 / FS))


def hum(chain: Chain, rng: np.random.Generator) -> Array:
    """
    Mains hum on one blow; its phase is where the blow happened to fall.

    Parameters
    ----------
    chain : Chain
        The measurement chain.
    rng : numpy.random.Generator
        Generator.

    Returns
    -------
    ndarray, shape (channel, sample)
        Hum over BLOCK [m/s^2].
    """
    time = np.arange(round(BLOCK * FS)) / FS
    start, mains = rng.uniform(0, 1), 50.0 * (1 + 4e-4 * rng.standard_normal())
    total = np.zeros((len(CHANNELS), time.size))
    for k, amplitude in enumerate(chain.hum, start=1):
        wave = np.sin(2 * np.pi * k * (mains * time + start) + 1.7 * k)
        total += amplitude * np.array([1.0, 0.7, 1.2])[:, None] * wave
    return total


def noise(rng: np.random.Generator, deviation: float, wander: float, count: int) -> Array:
    """
    White noise with a little 1/f, an offset and a slow drift.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator.
    deviation : float
        Standard deviation of the white part, by sample.
    wander : float
        Offset and drift over ten standard deviations.
    count : int
        Number of samples.

    Returns
    -------
    ndarray, shape (count,)
        Noise.
    """
    white = rng.standard_normal(count)
    spectrum = np.fft.rfft(rng.standard_normal(count))
    slow = np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(spectrum.size), 4.0) / 40.0), count)
    time = np.linspace(0, 1, count)
    drift = 10 * wander * (rng.standard_normal() + rng.standard_normal() * time)
    return np.asarray(deviation * (white + 0.3 * slow + drift))


def digitised(signal: Array, full_scale: float, bits: int) -> Array:
    """
    Clipped at full scale and rounded to the converter's steps.

    Parameters
    ----------
    signal : ndarray, shape (sample,)
        Analog signal.
    full_scale : float
        Largest value either way.
    bits : int
        Of the converter.

    Returns
    -------
    ndarray, shape (sample,)
        Digital signal.
    """
    step = 2 * full_scale / 2**bits
    return np.asarray(np.clip(np.round(signal / step) * step, -full_scale, full_scale))


def recorded(
    chain: Chain, conditions: Conditions, force: Array, responses: Array, rng: np.random.Generator, overload: bool
) -> tuple[Array, Array]:
    """
    One blow as the digitiser gives it.

    Parameters
    ----------
    chain : Chain
        The measurement chain.
    conditions : Conditions
        Noise, range and bits.
    force : ndarray, shape (sample,)
        Force [N].
    responses : ndarray, shape (channel, sample)
        What `sensed` gives [m/s^2].
    rng : numpy.random.Generator
        Generator.
    overload : bool
        Whether the loudest channel exceeds its range.

    Returns
    -------
    force : ndarray, shape (sample,)
        Force as recorded [N].
    responses : ndarray, shape (channel, sample)
        Responses as recorded [m/s^2].

    Notes
    -----
    Noise, hum, range and rounding; at last the exponential window, where one is never taken out.
    """
    count = round(BLOCK * FS)
    force = force[:count] + noise(rng, conditions.force_noise, conditions.wander, count)
    force = digitised(force, conditions.force_range, conditions.bits)
    responses = responses + (hum(chain, rng) if chain.hum else 0.0)
    loudest = int(np.argmax(np.abs(responses).max(axis=1)))
    shown = np.empty((len(CHANNELS), count))
    for i, deviation in enumerate(conditions.noise):
        analog = responses[i] + noise(rng, deviation, conditions.wander, count)
        reach = max(conditions.response_range, 1.2 * float(np.abs(analog).max()))
        if overload and i == loudest:
            reach = float(rng.uniform(0.6, 0.9)) * float(np.abs(analog).max())
        shown[i] = digitised(analog, reach, conditions.bits)
    window = np.exp(-chain.decay_rate * np.arange(count) / FS)
    return force * window, shown * window
