"""The measurement chain: from what the machine does to what the files hold."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from cutvib_ss.validation.rig.blows import BLOCK, FS
from cutvib_ss.validation.rig.conditions import Conditions
from cutvib_ss.validation.rig.structure import TOLERANCE, Chain, Filter, Window

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_PADDED = round(4.0 * FS)
_TERMS = 5


def smooth_error(rng: np.random.Generator, freq: Array) -> Complex:
    """
    Draw a channel's calibration error.

    ε is a few slow cosines, real and imaginary part independent, over an axis between log-frequency (an amplifier's corner,
    low down) and frequency (a resonance far above); the phase error tends to 0 at 0 Hz.
    """
    corner = float(np.exp(rng.uniform(np.log(30.0), np.log(1000.0))))
    x = np.log1p(freq / corner) / np.log1p(FS / 2 / corner)
    shapes = np.cos(np.pi * np.arange(_TERMS)[:, None] * x[None]) * np.sqrt([1.0, 2.0, 2.0, 2.0, 2.0])[:, None]
    share = np.array([0.7, 0.5, 0.35, 0.25, 0.15])
    share *= TOLERANCE["calibration"] / np.linalg.norm(share)
    gain, phase = (rng.standard_normal((2, _TERMS)) * share) @ shapes
    return np.asarray(1 + gain + 1j * phase * freq / np.hypot(freq, 20.0))


def filtered(filters: Sequence[Filter], freq: Array) -> Complex:
    """Shown over true of what a channel's instrument does: (frequency,)."""
    answer = np.ones(freq.size, dtype=np.complex128)
    for one in filters:
        x = freq / one.freq
        if one.kind == "lowpass":
            answer /= 1 + 1j * x
        elif one.kind == "bessel":
            answer *= 3 / (3 + 3j * x - x**2)
        elif one.kind == "highpass":
            answer *= 1j * x / (1 + 1j * x)
        elif one.kind == "slope":
            answer *= np.maximum(1 + one.value * np.log10(np.maximum(x, 1e-3)), 0.05)
        else:
            answer /= 1 - x**2 + 2j * one.value * x
    return answer


def windowed(window: Window | None, time: Array) -> tuple[Array, Array]:
    """What the window multiplies force and responses by: two of (sample,)."""
    one = np.ones_like(time)
    if window is None:
        return one, one
    if window.kind == "exponential":
        shape = np.exp(-window.rate * time)
        return shape, shape
    late = np.maximum(time - window.start, 0.0)
    if window.kind == "late":
        return one, np.exp(-window.rate * late)
    faded = np.minimum(late * window.rate, 1.0)
    shape = 1.0 * (late == 0) if window.kind == "cut" else 0.5 + 0.5 * np.cos(np.pi * faded)
    return shape, shape


def sensed(
    chain: Chain, names: Sequence[str], force: Array, responses: Array, late: float, errors: Complex | None = None
) -> Array:
    """
    What the response channels show without noise: (channel, sample) over BLOCK.

    Saturation, distortion and zero shift come first, in the sensor; then leaks of one channel into another; then gains, delays,
    filters and calibration errors; the force's signal that is picked up, and the clock, last.
    """
    count = round(BLOCK * FS)
    shown = responses.copy()
    at = {name: i for i, name in enumerate(names)}
    for name, limit in chain.saturation.items():
        shown[at[name]] = limit * np.tanh(shown[at[name]] / limit)
    for name, level in chain.asymmetry.items():
        shown[at[name]] += shown[at[name]] ** 2 / level
    time = np.arange(shown.shape[-1]) / FS
    if chain.shift[0]:
        peak, when = np.abs(shown).max(axis=1, keepdims=True), time[np.argmax(np.abs(force))]
        shown += chain.shift[0] * peak * (time > when) * np.exp(-chain.shift[1] * np.maximum(time - when, 0.0))
    freq = frequencies()
    spectra = np.fft.rfft(shown, _PADDED)
    true = spectra.copy()
    leaks = [("tool_z", "tool_x", chain.cross_axis, 0.0)] if chain.cross_axis else []
    for into, source, fraction, corner in (*leaks, *chain.tilts):
        if into in at and source in at:
            spectra[at[into]] += fraction * true[at[source]] * (1j * freq / corner if corner else 1.0)
    for i, name in enumerate(names):
        spectra[i] *= chain.gains.get(name, 1.0) * np.exp(-2j * np.pi * freq * (chain.delays.get(name, 0.0) + late))
        spectra[i] *= filtered(chain.filters.get(name, ()), freq)
        if errors is not None:
            spectra[i] *= errors[i]
    shown = np.fft.irfft(spectra, _PADDED)[:, : time.size]
    shown += chain.feedthrough * force[: time.size]
    if chain.clock:
        fine = signal.resample(
            shown, 16 * time.size, axis=1
        )  # band-limited: read between samples of a 16 times finer grid
        grid = np.arange(16 * time.size) / (16 * FS)
        shown = np.array([np.interp(time * (1 + chain.clock), grid, row) for row in fine])
    return np.asarray(shown[:, :count])


def frequencies() -> Array:
    """Frequencies of the transforms in `sensed` [Hz]."""
    return np.asarray(np.fft.rfftfreq(_PADDED, 1 / FS))


def mains_interference(chain: Chain, channels: int, rng: np.random.Generator) -> Array:
    """Mains interference on one blow, (channel, sample) over BLOCK; its phase is where the blow happened to fall."""
    time = np.arange(round(BLOCK * FS)) / FS
    start, mains = rng.uniform(0, 1), 50.0 * (1 + 4e-4 * rng.standard_normal())
    total = np.zeros((channels, time.size))
    for k, amplitude in enumerate(chain.mains, start=1):
        wave = np.sin(2 * np.pi * k * (mains * time + start) + 1.7 * k)
        total += amplitude * np.resize([1.0, 0.7, 1.2], channels)[:, None] * wave
    return total


def noise(rng: np.random.Generator, deviation: float, wander: float, count: int) -> Array:
    """White noise with a little 1/f, an offset and a slow drift."""
    white = rng.standard_normal(count)
    spectrum = np.fft.rfft(rng.standard_normal(count))
    slow = np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(spectrum.size), 4.0) / 40.0), count)
    time = np.linspace(0, 1, count)
    drift = 10 * wander * (rng.standard_normal() + rng.standard_normal() * time)
    return np.asarray(deviation * (white + 0.3 * slow + drift))


def digitised(signal: Array, full_scale: float, bits: int) -> Array:
    """Clipped at full scale and rounded to the converter's steps."""
    step = 2 * full_scale / 2**bits
    return np.asarray(np.clip(np.round(signal / step) * step, -full_scale, full_scale))


def recorded(
    chain: Chain, conditions: Conditions, force: Array, responses: Array, rng: np.random.Generator, overload: bool
) -> tuple[Array, Array]:
    """
    One blow as the digitiser gives it: force (sample,) [N] and responses (channel, sample).

    Noise, mains interference, the coupling of the inputs, range and rounding; at last the window, where one is never taken out.
    """
    count = round(BLOCK * FS)
    force = force[:count] + noise(rng, conditions.force_noise, conditions.wander, count)
    force = digitised(_coupled(force, conditions.coupling[0]), conditions.force_range, conditions.bits)
    responses = responses + (mains_interference(chain, len(responses), rng) if chain.mains else 0.0)
    loudest = int(np.argmax((np.abs(responses) / np.array(conditions.noise)[:, None]).max(axis=1)))
    shown = np.empty((len(responses), count))
    for i, deviation in enumerate(conditions.noise):
        analog = _coupled(responses[i] + noise(rng, deviation, conditions.wander, count), conditions.coupling[1])
        # whoever measures sets the range so that it holds the hardest blow; inputs are not set one by one
        reach = max(conditions.response_range * deviation / conditions.noise[0], 1.2 * float(np.abs(analog).max()))
        if overload and i == loudest:
            reach = float(rng.uniform(0.6, 0.9)) * float(np.abs(analog).max())
        shown[i] = digitised(analog, reach, conditions.bits)
    on_force, on_responses = windowed(chain.window, np.arange(count) / FS)
    return force * on_force, shown * on_responses


def _coupled(analog: Array, corner: float) -> Array:
    """An input that is AC-coupled with a corner [Hz]; 0 where it is DC-coupled. The history begins at rest."""
    if corner == 0.0:
        return analog
    a = np.pi * corner / FS
    return np.asarray(signal.lfilter([1 / (1 + a), -1 / (1 + a)], [1.0, -(1 - a) / (1 + a)], analog - analog[0]))
