"""Forces of the tool as histories: a train of pneumatic pulses, or harmonics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import check_number
from cutvib_ss.results import FloatArray

PULSE_RATE = 217.0
"""Pulses of the cutting tool a second (Section 2)."""


def pulse_train(
    fs: float,
    duration: float,
    *,
    rate: float = PULSE_RATE,
    duty: float = 0.3,
    rise: float = 5e-4,
    fall: float = 5e-4,
    amplitude: float = 1.0,
    jitter: float = 0.0,
    seed: int = 0,
) -> FloatArray:
    """
    A train of trapezoidal pulses, each sample its mean over the interval around it.

    Parameters
    ----------
    fs : float
        Sampling frequency [Hz].
    duration : float
        Length [s].
    rate : float
        Pulses a second [Hz].
    duty : float
        Part of the period in which the force is above half its peak.
    rise, fall : float
        Duration of either flank, foot to top [s].
    amplitude : float
        Force between the flanks [N].
    jitter : float
        Standard deviation of the instants of the pulses, as a part of the period.
    seed : int
        Seed of the jitter.

    Returns
    -------
    ndarray, shape (sample,)
        The force [N]; the first pulse begins at zero, and the history is periodic where ``rate * duration`` is whole and there
        is no jitter.

    Raises
    ------
    ParameterError
        If the pulse does not fit into its period, or its flanks into the pulse.

    Notes
    -----
    The mean over a sample's interval is the exact trapezoid convolved with a box, which keeps the harmonics of a train whose
    flanks are steeper than a sample from folding back.

    Examples
    --------
    >>> pulse_train(fs=8.0, duration=1.0, rate=1.0, duty=0.5, rise=0.0, fall=0.0)
    array([0.5, 1. , 1. , 1. , 0.5, 0. , 0. , 0. ])
    """
    check_number("pulse jitter", jitter, 0.0)
    check_number("pulse fs", fs, 0.0, strict=True)
    check_number("pulse duration", duration, 0.0, strict=True)
    check_pulse(rate, duty, rise, fall)
    check_number("pulse amplitude", amplitude)
    period, samples = 1.0 / rate, round(duration * fs)
    # One pulse more on either side, for what reaches in; their jitter is drawn like the others'.
    begins = period * np.arange(-1, int(np.ceil(duration * rate)) + 1)
    begins = begins + jitter * period * np.random.default_rng(seed).standard_normal(begins.size)
    edges = (np.arange(samples + 1) - 0.5) / fs
    middle = begins + duty * period + (rise - fall) / 2
    force = np.zeros(samples)
    for begin, end in zip(begins, middle, strict=True):
        first, last = np.searchsorted(edges, (begin - 1.0 / fs, end + fall + 1.0 / fs))
        near = edges[first:last]
        force[first : max(first, last - 1)] += np.diff(_ramped(near - begin, rise) - _ramped(near - end, fall))
    return np.asarray(amplitude * fs * force)


def check_pulse(rate: float, duty: float, rise: float, fall: float) -> None:
    """Refuse a trapezoidal pulse that does not fit into its period, or whose flanks do not fit into it."""
    for name, value in (("rise", rise), ("fall", fall)):
        check_number(f"pulse {name}", value, 0.0)
    for name, value in (("rate", rate), ("duty", duty)):
        check_number(f"pulse {name}", value, 0.0, strict=True)
    flanks = (rise + fall) / 2 * rate
    if not flanks <= duty <= 1.0 - flanks:
        raise ParameterError(
            f"a pulse of duty {duty:g} at {rate:g} Hz has no room for flanks of {rise:g} s and {fall:g} s"
        )


def _ramped(time: FloatArray, length: float) -> FloatArray:
    """Integral of a step that rises evenly over a length."""
    t = np.maximum(time, 0.0)
    if length == 0.0:
        return t
    return np.where(t < length, t**2 / (2 * length), t - length / 2)


def harmonic_force(
    fs: float, duration: float, freq: ArrayLike, amplitude: ArrayLike, phase: ArrayLike = 0.0
) -> FloatArray:
    """
    A sum of cosines.

    >>> harmonic_force(4.0, 1.0, [1.0], [2.0]).round(12)
    array([ 2., 0., -2., -0.])
    """
    f, a, p = np.broadcast_arrays(np.atleast_1d(freq), np.atleast_1d(amplitude), np.atleast_1d(phase))
    if not np.isfinite([f, a, p]).all() or (np.abs(f) >= fs / 2).any():
        raise ParameterError(f"harmonics need finite amplitudes and frequencies below fs/2 = {fs / 2:g} Hz")
    t = np.arange(round(duration * fs)) / fs
    return np.asarray(a @ np.cos(2 * np.pi * f[:, None] * t + p[:, None]))
