"""
How uncertain an estimated frequency response is: noise power smoothed over frequency, and the variance that follows.

A variance from few averages is itself so scattered that the reduced χ² of a perfect model doubles at three averages
(the mean of 1/χ²_ν is 1/(ν - 2)). The noise is smooth along frequency where the response is not, so it is the noise
power that is smoothed, never the variance: in S_e(f) = a(f) + b(f) |H(f)|², a is the response channel's own noise
and b |H|² is that of the force, which peaks where the response does; a and b are what varies slowly.
"""

from __future__ import annotations

import numpy as np

from cutvib_ss.results import ComplexArray, FloatArray

CORRELATED = 0.2
"""Correlation between bins from which it is taken as one."""
NOISE_BINS = 15
"""Half width of the smoothing, in independent frequency bins."""
WIDE = 6
"""Half width, in those, of the mean about which the scatter of powers is taken."""

_FLOOR = 1e-20  # of the largest |H|²: what twelve printed digits leave of a noiseless response
_FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
_SECOND_DIFFERENCE = np.array([1.0, -2.0, 1.0])


def smooth_noise(power: FloatArray, gain: FloatArray, half_width: int) -> FloatArray:
    """
    Expected noise power a(f) + b(f) |H|² behind scattered estimates of it.

    Weighted least squares within a running window, weights 1/S_e² iterated from the running mean (the estimates are
    gamma distributed: their spread is proportional to their mean); neither a nor b is let below zero.
    """
    known = np.isfinite(power) & np.isfinite(gain)
    if not np.any(known):
        return np.full(power.shape, np.nan)
    scale = float(np.mean(power[known])) or 1.0
    p = np.where(known, power, 0.0) / scale
    g = np.where(known, gain, 0.0) ** 2
    g = g / (float(np.max(g)) or 1.0)
    weight = known.astype(float)
    total, count = _running(np.array([weight * p, weight]), half_width)
    expected: FloatArray = np.maximum(total / np.maximum(count, 1e-300), 1e-12)
    terms = np.array([np.ones_like(g), g, g * g, p, g * p])
    for _ in range(4):
        w = weight / expected**2
        s0, s1, s2, t0, t1 = _running(w * terms, half_width)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            constant = t0 / s0
            proportional = t1 / s2
            determinant = s0 * s2 - s1 * s1
            a = (t0 * s2 - t1 * s1) / determinant
            b = (s0 * t1 - s1 * t0) / determinant
            told_apart = determinant > 1e-3 * s0 * s2
            only_a = ~told_apart | (b < 0) | ~np.isfinite(a + b)
            only_b = ~only_a & (a < 0)
            fit = np.where(only_a, constant, np.where(only_b, proportional * g, a + b * g))
        expected = np.where(np.isfinite(fit), np.maximum(fit, 1e-12), expected)
    return expected * scale


def scatter_correction(freedom: float, half_width: int, correlation: FloatArray, size: int) -> float:
    """Factor ν/(ν-2) that makes the mean of |ΔH|² over its estimated variance one."""
    bins = min(2 * half_width + 1, size)
    lags = correlation[1:bins]
    independent = bins / (1 + 2 * float(np.sum(lags * (1 - np.arange(1, lags.size + 1) / bins))))
    nu = freedom * independent / 1.5  # two coefficients are fitted; where the gain is flat in the window, one
    return nu / (nu - 2) if nu > 4 else 2.0


def bin_correlation(window: FloatArray) -> FloatArray:
    """
    Squared modulus of the correlation between bins of a windowed noise spectrum, by lag.

    White noise under a window w has E[X_k X_l*] ∝ DFT(w²)[k-l].
    """
    spectrum = np.abs(np.fft.rfft(window**2)) ** 2
    return np.asarray(spectrum / spectrum[0], dtype=np.float64)


def residual_correlation(residual: ComplexArray) -> FloatArray:
    """
    Squared modulus of the correlation between bins of a measured noise, by lag.

    A window that nobody told of (exponential, on the analyser) lets neighbouring bins go together, and an estimate from fifteen of
    them is worth few. Each bin is brought to unit power first.
    """
    size = np.sqrt(np.sum(np.abs(residual) ** 2, axis=0))
    unit = np.divide(residual, size, out=np.zeros_like(residual), where=size > 0)
    lags = np.zeros(unit.shape[1])
    lags[0] = 1.0
    # A correlation of nothing has a standard deviation of one over the root of the bins.
    least = max(CORRELATED, 4.0 / np.sqrt(unit.shape[1]))
    for j in range(1, unit.shape[1] // 4):
        alike = abs(np.sum(unit[:, :-j].conj() * unit[:, j:])) / (unit.shape[1] - j)
        if alike < least:
            break
        lags[j] = alike**2
    return lags


def power_correlation(power: FloatArray, expected: FloatArray) -> FloatArray:
    """
    Squared modulus of the correlation between bins of a noise of which only the power is known, by lag.

    Of complex Gaussian noise with correlation ρ the powers have the correlation |ρ|², whatever the number of averages.
    """
    lags = np.zeros(power.size)
    lags[0] = 1.0
    known = np.isfinite(power) & (expected > 0)
    scatter = np.where(known, power / np.where(known, expected, 1.0), 0.0)
    scatter = np.where(known, scatter - np.mean(scatter[known]), 0.0)
    variance = float(np.mean(scatter[known] ** 2))
    least = max(CORRELATED**2, 4.0 / np.sqrt(power.size))
    for j in range(1, power.size // 4):
        both = int(np.count_nonzero(known[:-j] & known[j:]))
        alike = float(np.sum(scatter[:-j] * scatter[j:])) / max(both, 1)
        if not alike > least * variance:
            break
        lags[j] = min(alike / variance, 1.0)
    return lags


def widened(half_width: int, correlation: FloatArray) -> int:
    """Half width in bins where neighbouring bins are not independent."""
    return round(half_width * float(np.sqrt(1 + 2 * np.sum(correlation[1:]))))


def frf_variance(data: ComplexArray, coherence: FloatArray, averages: int, noise_bins: int = NOISE_BINS) -> FloatArray:
    """
    Variance of frequency responses that were estimated elsewhere.

    With coherence from n averages the noise-to-force ratio R = |H|² (1 - γ²)/γ² is smoothed (`smooth_noise`), and the
    variance is R/(n-1): per real part |H|² (1 - γ²)/(2 (n-1) γ²). With one average, or without coherence, or where it
    is one throughout, coherence says nothing: then the noise is what a fourth difference along frequency leaves, by its
    running median, which a few lines of a sharp peak do not move.
    """
    variance = np.empty(data.shape)
    for k, (h, c) in enumerate(zip(data, coherence, strict=True)):
        gain = np.abs(h)
        told = np.isfinite(c) & (c > 1e-12)
        ratio = gain**2 * (1 - c) / np.where(told, c, 1.0)
        if averages > 1 and np.count_nonzero(told) >= min(4, h.size) and np.any(ratio[told] > 0):
            power = np.where(told, ratio, np.nan)
            together = power_correlation(power, smooth_noise(power, gain, WIDE * noise_bins))
            half_width = widened(noise_bins, together)
            correction = scatter_correction(2.0 * (averages - 1), half_width, together, h.size)
            smooth = smooth_noise(power, gain, half_width) / (averages - 1) * correction
        else:
            smooth = high_pass_variance(h, noise_bins)
        variance[k] = floored(smooth, gain)
    return variance


def smeared_variance(data: ComplexArray, variance: FloatArray) -> FloatArray:
    """
    Square of what a Hann window takes from the peaks of a response under random force, beyond what noise scatters.

    On average such an estimate is ∫ H(f - ν) |W(ν)|² dν / ∫ |W|² dν, and ∫ ν² |W|² / ∫ |W|² = ∫ ẇ² dt / (4π² ∫ w² dt), which is
    Δf²/3 of a Hann window: it errs by Δf²/6 times the second derivative over frequency, a sixth of the second difference. That of
    white noise has six times its variance.
    """
    out = np.zeros(data.shape)
    if data.shape[-1] >= _SECOND_DIFFERENCE.size:
        second = np.abs(np.diff(data, 2)) ** 2
        out[..., 1:-1] = np.maximum(second - 6.0 * variance[..., 1:-1], 0.0) / 36.0
    return out


def leaking_variance(data: ComplexArray, variance: FloatArray, coherence: FloatArray, averages: int) -> FloatArray:
    """
    Variance of H1 of windowed blocks under random force, what leaks from block to block counted as noise.

    That rises at sharp resonances and is not smooth along frequency: |H|² (1 - γ²)/γ²/(n - 1) of each line, where it is more than
    the noise, and what the window takes (`smeared_variance`). Without coherence the noise alone stands for the first.
    """
    scatter = np.abs(data) ** 2 * (1.0 / np.maximum(coherence, 1e-12) - 1.0) / (averages - 1)
    leaking = np.fmax(variance, scatter)
    return np.asarray(leaking + smeared_variance(data, leaking), dtype=np.float64)


def high_pass_variance(data: ComplexArray, noise_bins: int = NOISE_BINS) -> FloatArray:
    """
    Variance of a single estimate, from what scatters along frequency.

    The fourth difference of white noise has 70 times its variance; the median of an exponential variable is ln 2 times
    its mean.
    """
    if data.size < _SECOND_DIFFERENCE.size:
        # Of a line or two nothing tells what is noise.
        return np.asarray(np.abs(data) ** 2)
    kernel = _FOURTH_DIFFERENCE if data.size >= 6 else _SECOND_DIFFERENCE
    residual = np.abs(np.convolve(data, kernel, mode="valid")) ** 2 / np.sum(kernel**2)
    margin = kernel.size // 2
    padded = np.pad(residual, margin + noise_bins, mode="symmetric")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * noise_bins + 1)
    return np.asarray(np.median(windows, axis=-1) / np.log(2), dtype=np.float64)


def floored(variance: FloatArray, gain: FloatArray) -> FloatArray:
    """The same variance, kept from zero and from NaN."""
    largest = np.max(gain, axis=-1, keepdims=True)
    known = np.where(np.isfinite(variance), variance, gain**2)
    return np.asarray(np.maximum(known, np.maximum(_FLOOR * largest**2, 1e-300)), dtype=np.float64)


def _running(values: FloatArray, half_width: int) -> FloatArray:
    """Running sums along the last axis over a window that is cut at the ends."""
    # Sums of 1, 2, 4, ... neighbours are put together to the window's length: as exact as adding them up, where differences of
    # one long sum lose what is small beside the rest of it.
    width = 2 * half_width + 1
    size = values.shape[-1]
    part = np.zeros((*values.shape[:-1], size + 2 * half_width))
    part[..., half_width : half_width + size] = values
    total = np.zeros(values.shape)
    done, length = 0, 1
    while True:
        if width & length:
            total += part[..., done : done + size]
            done += length
        if done == width:
            return total
        part = part[..., :-length] + part[..., length:]
        length *= 2
