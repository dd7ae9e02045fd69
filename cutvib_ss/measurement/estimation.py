"""
Frequency responses from time records: H1, H2, Hv, coherence, variance, and leakage undone.

A blow is short and its response long: a 24.5 Hz mode at 0.6 % damping has not died out after 2 s, and a plain transform
leaves 16 % at its peak. Multiplying force and response alike by e^(-σt) moves the whole transform to s = σ + jω,
where the truncated rest is e^(-σT) smaller; the estimate is then H(σ + jω) without leakage, to be compared with a model
there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy import ndimage, signal

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.measurement.blocks import effective_averages, welch_blocks
from cutvib_ss.measurement.noise import (
    NOISE_BINS,
    bin_correlation,
    floored,
    high_pass_variance,
    residual_correlation,
    scatter_correction,
    smooth_noise,
    widened,
)
from cutvib_ss.measurement.records import FORCE, History, Record
from cutvib_ss.measurement.rounding import Steps, coarser, hidden_power, rounding_error, steps_in
from cutvib_ss.results import ComplexArray, Estimator, FloatArray, MeasuredFrequencyResponse
from cutvib_ss.results.arrays import optional_array
from cutvib_ss.results.frequency import EstimatorKind

_ESTIMATORS = ("H1", "H2", "Hv")
_FEWEST_REST = 32  # samples before a blow from which its noise can be told


def estimate(
    record: Record,
    *,
    estimator: EstimatorKind = "H1",
    decay_rate: float = 0.0,
    band: tuple[float, float] | None = None,
    noise_bins: int = NOISE_BINS,
    block: float | None = None,
    overlap: float = 0.5,
) -> MeasuredFrequencyResponse:
    """
    Frequency responses of a time record.

    Parameters
    ----------
    record : Record
        Blows (``"impact"``) or continuous recordings (``"timeseries"``).
    estimator : {"H1", "H2", "Hv"}
        H1 for noise on the responses, H2 for noise on the force, Hv for both.
    decay_rate : float
        σ [1/s] of the factor e^(-σt) on force and responses alike; the result is at s = σ + jω. Only for blows: it
        needs the structure at rest when the record starts.
    band : (float, float), optional
        Lowest and highest frequency to return [Hz]; default all lines from 0 to fs/2.
    noise_bins : int
        Half width of the smoothing of the noise power, in independent bins.
    block : float, optional
        Length of the blocks of a continuous recording [s]; default the record's ``block``, else a sixteenth of the
        recording, rounded down to a power of two of samples.
    overlap : float
        Overlap of the blocks, as a fraction.

    Returns
    -------
    MeasuredFrequencyResponse
        One position, one input; variance as described below; coherence NaN where there is one average.

    Raises
    ------
    ParameterError
        If an argument is impossible, or the record holds estimated responses (use its ``frf``).
    DataFormatError
        If there is no force.

    Notes
    -----
    Blows: boxcar over the whole record, the offset before the blow removed, no other detrending.
    H1 = Σ A F* / Σ |F|² over blows. The noise power is Σ |A - H F|²/(n-1), smoothed over frequency, and the variance
    of the estimate is that over Σ |F|². With a single blow the noise is taken from the samples before it, on force
    and response; without those, from what scatters along frequency.

    Continuous recordings: Hann blocks, overlapped (Welch); the noise power is the incoherent part S_aa (1 - γ²), with
    as many averages as the overlapped blocks are worth.
    """
    if estimator not in _ESTIMATORS:
        raise ParameterError(f"estimator {estimator!r} is not one of {', '.join(_ESTIMATORS)}")
    if not decay_rate >= 0 or not np.isfinite(decay_rate):
        raise ParameterError(f"decay_rate {decay_rate} 1/s must be finite and not negative")
    if record.kind == "frf":
        raise ParameterError(f"record {record.name!r} holds estimated responses already: use its `frf`")
    if record.kind == "impact":
        freq, data, variance, gamma, averages = _from_blows(record, estimator, decay_rate, noise_bins)
        variance = variance + _rounding_variance(record, estimator, decay_rate, noise_bins, data, variance)
    else:
        if decay_rate:
            raise ParameterError(
                f"record {record.name!r} does not start at rest, so e^(-σt) cannot undo its leakage: "
                "leave decay_rate at 0"
            )
        freq, data, variance, gamma, averages = _from_recording(record, estimator, noise_bins, block, overlap)
    keep = slice(None) if band is None else _lines(freq, band)
    shape = (1, len(record.channels), 1, -1)
    return MeasuredFrequencyResponse(
        data=data[:, keep].reshape(shape),
        freq=freq[keep],
        positions=optional_array([record.position]),
        outputs=record.channels,
        inputs=(record.input or FORCE,),
        quantities=record.quantities,
        input_unit=record.input_unit,
        decay_rate=decay_rate,
        variance=variance[:, keep].reshape(shape),
        coherence=gamma[:, keep].reshape(shape),
        averages=averages,
        estimator=Estimator(estimator, *_blow(record), record.exponential_decay, scatter_seen=averages > 1),
    )


def measured_response(record: Record) -> MeasuredFrequencyResponse:
    """Frequency responses of a record of any kind with what their estimator did: as recorded, else by H1 from its histories."""
    if record.frf is None:
        return estimate(record)
    seen = bool(np.any(np.isfinite(record.frf.coherence)))
    stated = Estimator(None, *_blow(record), record.exponential_decay, scatter_seen=seen)
    return replace(record.frf, inputs=(record.input or FORCE,), estimator=stated)


def _blow(record: Record) -> tuple[float, float | None]:
    """Length of the block that follows a blow, and the instant of the blow in it, as in `Estimator`."""
    if record.kind == "impact":
        at = [h.time[np.argmax(np.abs(h.force))] for h in record.histories]
        return min(h.duration for h in record.histories), float(np.mean(at))
    if record.frf is None or record.excitation != "impact":
        return np.inf, None
    if record.block is not None or record.frf.freq.size < 2:
        return record.block or np.inf, record.blow_at
    return 1.0 / float(np.median(np.diff(record.frf.freq))), record.blow_at


def h1(force: ComplexArray, response: ComplexArray) -> ComplexArray:
    """H1 = Σ A F* / Σ |F|²: least squares with the noise on the response."""
    return _quotient(np.sum(response * force.conj(), axis=0), np.sum(np.abs(force) ** 2, axis=0))


def h2(force: ComplexArray, response: ComplexArray) -> ComplexArray:
    """H2 = Σ |A|² / Σ F A*: least squares with the noise on the force."""
    return _quotient(np.sum(np.abs(response) ** 2, axis=0), np.sum(force * response.conj(), axis=0))


def hv(force: ComplexArray, response: ComplexArray) -> ComplexArray:
    """
    Hv: the phase of H1 and the geometric mean of |H1| and |H2|.

    Total least squares with noise on both sides in proportion to their powers: |Hv|² = Σ|A|² / Σ|F|².
    """
    cross = np.sum(response * force.conj(), axis=0)
    modulus = np.sqrt(_quotient(np.sum(np.abs(response) ** 2, axis=0), np.sum(np.abs(force) ** 2, axis=0)).real)
    return np.asarray(modulus * _quotient(cross, np.abs(cross)), dtype=np.complex128)


def coherence(force: ComplexArray, response: ComplexArray) -> FloatArray:
    """Ordinary coherence γ² = |Σ A F*|² / (Σ |F|² Σ |A|²)."""
    if len(force) < 2:
        return np.full(force.shape[-1], np.nan)
    cross = np.abs(np.sum(response * force.conj(), axis=0)) ** 2
    powers = np.sum(np.abs(force) ** 2, axis=0) * np.sum(np.abs(response) ** 2, axis=0)
    return np.minimum(_quotient(cross, powers).real, 1.0)


class BlowSpectra(NamedTuple):
    """Transforms of the blows of a record, each less what its channels read before it."""

    freq: FloatArray  # Lines [Hz]
    force: ComplexArray  # Shape (blow, frequency) [N s]
    response: ComplexArray  # Shape (blow, channel, frequency)
    window: FloatArray  # By which force and responses were multiplied, shape (sample,)
    peaks: FloatArray  # Largest force of each blow [N]


def spectra_of_blows(record: Record, decay_rate: float = 0.0) -> BlowSpectra:
    """Transforms of the blows of a record over the samples that all of them have, under an exponential window."""
    samples, fs = min(history.force.size for history in record.histories), record.histories[0].fs
    window = np.exp(-decay_rate * np.arange(samples) / fs)
    centred = [without_offset(history, samples) for history in record.histories]
    return BlowSpectra(
        np.arange(samples // 2 + 1, dtype=np.float64) * (fs / samples),
        np.stack([np.fft.rfft(f * window) / fs for f, _ in centred]),
        np.stack([np.fft.rfft(a * window, axis=-1) / fs for _, a in centred]),
        window,
        np.array([float(np.max(np.abs(f))) for f, _ in centred]),
    )


def _from_blows(
    record: Record, estimator: EstimatorKind, decay_rate: float, noise_bins: int
) -> tuple[FloatArray, ComplexArray, FloatArray, FloatArray, int]:
    freq, force, response, window, _ = spectra_of_blows(record, decay_rate)
    input_power = np.sum(np.abs(force) ** 2, axis=0)
    if not np.any(input_power > 0):
        raise DataFormatError(f"{record.name}: the force is zero throughout; check its sensor and channel")
    data, gamma = _estimates(force, response, estimator)
    told = bin_correlation(window)
    averages = len(force)
    variance = np.empty(data.shape)
    for k, h in enumerate(data):
        if averages > 1:
            # the residual of the least squares estimate, whichever estimator is wanted
            residual = response[:, k] - h1(force, response[:, k]) * force
            correlation = np.maximum(told, residual_correlation(residual))
            half_width = widened(noise_bins, correlation)
            power = smooth_noise(np.sum(np.abs(residual) ** 2, axis=0) / (averages - 1), np.abs(h), half_width)
            power = power * scatter_correction(2.0 * (averages - 1), half_width, correlation, h.size)
            variance[k] = _quotient(power, input_power).real
        else:
            variance[k] = _single_blow_variance(record.histories[0], k, h, input_power, window, noise_bins)
    return freq, data, _finite(variance, data, input_power), gamma, averages


def _rounding_variance(
    record: Record,
    estimator: EstimatorKind,
    decay_rate: float,
    noise_bins: int,
    data: ComplexArray,
    variance: FloatArray,
) -> FloatArray | float:
    """What rounding to coarse steps does alike in every blow, see `rounding`."""
    steps = steps_in(record, [h.start for h in record.histories])
    if not _any_coarse(steps):
        return 0.0
    freq, force, _, window, _ = spectra_of_blows(record, decay_rate)
    hidden = hidden_power(record, steps, freq, window)
    total: FloatArray | float = _quotient(
        hidden[1:] + np.abs(data) ** 2 * hidden[0], np.mean(np.abs(force) ** 2, axis=0)
    ).real
    for more in coarser(record, steps):
        _, other, scatter, _, _ = _from_blows(more.record, estimator, decay_rate, noise_bins)
        seen = np.maximum(scatter - variance, 0.0) if len(record.histories) > 1 else None
        total = total + rounding_error(data, other, seen, more.shares)
    return total


def _any_coarse(steps: Mapping[str, list[Steps]]) -> bool:
    """Whether rounding follows the signal anywhere."""
    return any(s.coarse for own in steps.values() for s in own)


def rounding_variance(record: Record) -> FloatArray:
    """Variance of H1 of blows that coarse steps make alike in all, on the lines of `estimate`, shape (channel, line)."""
    if not _any_coarse(steps_in(record, [h.start for h in record.histories])):
        return np.zeros((len(record.channels), min(h.force.size for h in record.histories) // 2 + 1))
    _, data, variance, _, _ = _from_blows(record, "H1", 0.0, NOISE_BINS)
    return _rounding_variance(record, "H1", 0.0, NOISE_BINS, data, variance) + np.zeros(data.shape)


def rounded_part(response: MeasuredFrequencyResponse, by_steps: FloatArray, width: float) -> FloatArray:
    """Mean square of what coarse steps do to H1 over that of H1, in bands of a width [Hz], shape (channel, line)."""
    lines = max(1, round(width / float(response.freq[1])))
    squares = np.abs(response.data[0, :, 0]) ** 2
    power, lost = (ndimage.uniform_filter1d(x, lines, axis=-1, mode="nearest") for x in (squares, by_steps))
    # Beyond the reach of the hammer both are anything.
    return np.asarray(lost / np.maximum(power, 1e-6 * lost + 1e-300), dtype=np.float64)


def without_offset(history: History, samples: int) -> tuple[FloatArray, FloatArray]:
    """Force and responses of a blow, less what they read before it."""
    rest = min(history.start, samples)
    force, responses = history.force[:samples], history.responses[:, :samples]
    if rest == 0:
        return force, responses
    return force - np.mean(force[:rest]), responses - np.mean(responses[:, :rest], axis=-1, keepdims=True)


def _estimates(
    force: ComplexArray, response: ComplexArray, estimator: EstimatorKind
) -> tuple[ComplexArray, FloatArray]:
    law = {"H1": h1, "H2": h2, "Hv": hv}[estimator]
    channels = range(response.shape[1])
    data = np.stack([law(force, response[:, k]) for k in channels])
    return data, np.stack([coherence(force, response[:, k]) for k in channels])


def _single_blow_variance(
    history: History, channel: int, data: ComplexArray, input_power: FloatArray, window: FloatArray, noise_bins: int
) -> FloatArray:
    rest = history.start
    if rest < _FEWEST_REST:
        return high_pass_variance(data, noise_bins)
    energy = float(np.sum(window**2)) / history.fs**2
    on_force = _rest_power(history.force[:rest], data.size) * energy
    on_response = _rest_power(history.responses[channel, :rest], data.size) * energy
    return _quotient(on_response + np.abs(data) ** 2 * on_force, input_power).real


def _rest_power(values: FloatArray, lines: int) -> FloatArray:
    """Variance per sample along frequency, of noise recorded at rest, on as many lines from 0 to fs/2."""
    half_width = 4
    periodogram = np.abs(np.fft.rfft(values - np.mean(values)))[1:] ** 2 / (values.size - 1)
    smooth = smooth_noise(periodogram, np.ones(periodogram.size), half_width)
    smooth = smooth * scatter_correction(2.0, half_width, np.zeros(1), periodogram.size)
    here = np.arange(1, periodogram.size + 1) / values.size
    return np.interp(np.linspace(0.0, 0.5, lines), here, smooth)


def _from_recording(
    record: Record, estimator: EstimatorKind, noise_bins: int, block: float | None, overlap: float
) -> tuple[FloatArray, ComplexArray, FloatArray, FloatArray, int]:
    fs = record.histories[0].fs
    size, shared = welch_blocks(record, block, overlap)
    step = size - shared
    window = signal.get_window("hann", size)
    blocks = [1 + (history.force.size - size) // step for history in record.histories]
    effective = sum(effective_averages(window, step, count) for count in blocks)
    shares = np.array(blocks) / sum(blocks)
    freq: FloatArray = np.arange(size // 2 + 1, dtype=np.float64) * (fs / size)
    spectra = [_spectra(history, window, size - step) for history in record.histories]
    ff, fa, aa = (sum(share * s[i] for share, s in zip(shares, spectra, strict=True)) for i in range(3))
    if not np.any(ff > 0):
        raise DataFormatError(f"{record.name}: the force is zero throughout; check its sensor and channel")
    gamma = np.minimum(_quotient(np.abs(fa) ** 2, ff * aa).real, 1.0)
    if estimator == "H1":
        data = _quotient(fa, ff)
    elif estimator == "H2":
        data = _quotient(aa, fa.conj())
    else:
        data = np.sqrt(_quotient(aa, ff).real) * _quotient(fa, np.abs(fa))
    variance = np.empty(data.shape)
    correlation = bin_correlation(window)
    half_width = widened(noise_bins, correlation)
    for k, h in enumerate(data):
        if effective > 1.5:
            incoherent = aa[k] * (1 - gamma[k]) * effective / (effective - 1)
            power = smooth_noise(incoherent, np.abs(h), half_width)
            power = power * scatter_correction(2.0 * (effective - 1), half_width, correlation, h.size)
            variance[k] = _quotient(power, effective * ff).real
        else:
            gamma[k] = np.nan
            variance[k] = high_pass_variance(h, noise_bins)
    return freq, data, _finite(variance, data, ff), gamma, max(round(effective), 1)


def _spectra(history: History, window: FloatArray, shared: int) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Averaged power of the force, Σ F* A, and power of the responses: one-sided densities."""

    def averaged(x: FloatArray, y: FloatArray) -> ComplexArray:
        # the order matters: csd(F, A) is Σ F* A, csd(A, F) its conjugate
        density = signal.csd(
            x, y, fs=history.fs, window=window.tolist(), nperseg=window.size, noverlap=shared, detrend="constant"
        )[1]
        return np.asarray(density, dtype=np.complex128)

    force, responses = history.force[np.newaxis], history.responses
    return averaged(force, force)[0].real, averaged(force, responses), averaged(responses, responses).real


def _finite(variance: FloatArray, data: ComplexArray, input_power: FloatArray) -> FloatArray:
    """Lines without force (the input's zero line, say) know nothing: a large variance in place of infinity."""
    gain = np.abs(data)
    dead = input_power <= 1e-28 * np.max(input_power)
    largest = np.max(gain, axis=-1, keepdims=True)
    return floored(np.where(dead, 1e6 * largest**2, variance), gain)


def _lines(freq: FloatArray, band: tuple[float, float]) -> slice:
    low, high = band
    if not low < high:
        raise ParameterError(f"band {band} Hz must run from low to high")
    first, last = np.searchsorted(freq, [low - 1e-9 * high, high * (1 + 1e-9)])
    if first >= last:
        raise ParameterError(
            f"band {band} Hz holds no line; the record's run from 0 to {freq[-1]:g} Hz by {freq[1]:g} Hz"
        )
    return slice(int(first), int(last))


def _quotient(numerator: ComplexArray | FloatArray, denominator: ComplexArray | FloatArray) -> ComplexArray:
    """Quotient, zero where the denominator is."""
    usable = denominator != 0
    return np.asarray(np.where(usable, numerator, 0) / np.where(usable, denominator, 1), dtype=np.complex128)
