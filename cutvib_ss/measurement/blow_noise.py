"""
Noise of blows told apart: what the sensors add, what orders with the force of the blow, and the rest from blow to blow.

The variance that `estimate` gives is all scatter from blow to blow. Part of it is the sensors' own noise, which is there before the
blow, too; part follows the force, and is nonlinearity of the structure; the rest is the hand: point, direction and gain of the hit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import signal, stats

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.estimation import h1, spectra_of_blows
from cutvib_ss.measurement.force_window import followed_by, stands_out
from cutvib_ss.measurement.noise import NOISE_BINS, high_pass_variance, smooth_noise
from cutvib_ss.measurement.records import History, Record
from cutvib_ss.measurement.rounding import orders_by_rounding
from cutvib_ss.results import ComplexArray, FloatArray

_FEWEST_QUIET = 32  # samples of a quiet part from which a power is told
_ROUNDING = 1e-24  # of the same: what double precision leaves where there is nothing
_HEARD = 1e-3  # of the largest power of the force over frequency
_OVER_NOISE = 2.0  # power of a direction of hits over that of the sensors' noise in it
_SEGMENT = 256  # samples of the segments of long quiet parts
_STEADY = (
    1.3  # of the power of the last eighth of a record over that of the one before it, and over that before the blow
)


@dataclass(frozen=True)
class SensorNoise:
    """Noise of the sensors of an impact record, and what it does to H1."""

    freq: FloatArray  # Lines of the record's transform [Hz]
    # One-sided power spectral density of the force channel's noise [N^2/Hz]; NaN where no part is quiet
    force: FloatArray
    responses: FloatArray  # The same of each response channel [unit^2/Hz]
    # Variance E|ΔH|² that it leaves on H1 of all blows; NaN where unknown, infinite at lines without force
    variance: FloatArray
    samples: np.ndarray  # Quiet samples behind the force and each channel, over all blows
    # Part by which the force's noise makes H1 too small, lines weighted by their variance; NaN where no part is quiet
    bias: FloatArray


class Ordering(NamedTuple):
    """Scatter of a record's blows beyond the noise of its sensors, all channels together, over that noise."""

    ordered: float  # What orders with the force
    rest: float  # What does not, a degree of freedom
    open: float  # Standard deviation with which that is known
    free: int  # Degrees of freedom of the rest


@dataclass(frozen=True)
class BlowScatter:
    """Scatter of single blows about their H1, told apart by what orders with the force."""

    freq: FloatArray  # Lines [Hz]
    # Mean square over the blows of the part of H that goes with the peak force, its own noise taken off (may be
    # negative where there is none); NaN with fewer than three blows
    ordered: FloatArray
    rest: FloatArray  # Variance of the H of a single blow about that, smoothed over frequency
    noise: FloatArray  # Variance that the sensors' noise alone leaves on the H of a single blow; NaN where unknown
    ratio: FloatArray  # Mean of rest over noise: one where the sensors explain it, above where the hits differ
    # Probability of an ordered part as large as this where nothing orders with the force; NaN where it cannot be told
    significance: FloatArray
    force_spread: float  # Standard deviation of the peak forces over their mean
    ordering: Ordering  # All channels together; NaN where it cannot be told


def pretrigger_noise(record: Record) -> SensorNoise:
    """
    Noise of each channel from the samples before the blows and from tails that have died out.

    With N_a on the response and N_f on the force, H1 = Σ A F* / Σ |F|² is off by Σ (N_a - H N_f) F* / Σ |F|², so that
    E|ΔH|² = (E|N_a|² + |H|² E|N_f|²) / Σ |F|². The powers come from the quiet parts of all blows (Welch 1967, Hann segments, each
    part's own mean taken off), on their coarse lines, and are interpolated. A force is quiet but for its blow. A response is quiet
    before the blow; its last eighth counts where its power neither falls any more nor exceeds that before the blow. A part in which
    the analyser wrote zeros is no noise of a sensor and is passed over.
    """
    if record.kind != "impact":
        raise ParameterError(
            f"record {record.name!r} is of kind {record.kind!r}; only blows have quiet parts before them"
        )
    fs = record.histories[0].fs
    freq, force, response, window, _ = spectra_of_blows(record)
    input_power = np.sum(np.abs(force) ** 2, axis=0)
    on_force, counts = _density([part for h in record.histories for part in _quiet_force(h)], freq, fs)
    densities, samples_of = [], [counts]
    for k in range(len(record.channels)):
        parts = [part for h in record.histories for part in _quiet_response(h, k)]
        density, count = _density(parts, freq, fs)
        densities.append(density)
        samples_of.append(count)
    # of a transform rfft(x)/fs over T = samples/fs, noise of one-sided density S has the power S T / 2
    duration = window.size / fs
    h = np.stack([h1(force, response[:, k]) for k in range(len(record.channels))])
    power = 0.5 * duration * (np.stack(densities) + np.abs(h) ** 2 * on_force)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = power / input_power
        # Lines weigh by Σ |F|², noise included: so weighted H1 is too small by all of the noise's part, even of a single blow.
        bias = len(force) * 0.5 * duration * on_force / input_power
    return SensorNoise(freq, on_force, np.stack(densities), variance, np.array(samples_of), bias)


def blow_scatter(
    record: Record,
    band: tuple[float, float] | None = None,
    noise_bins: int = NOISE_BINS,
    noise: SensorNoise | None = None,
) -> BlowScatter:
    """
    What of the scatter from blow to blow orders with the peak force, and the rest.

    At each line A_i = (H + G x_i) F_i + E_i by least squares, x_i the peak force about its mean (weighted by |F_i|²) and of unit
    mean square: |G|² is the ordered power, with one complex degree of freedom, and the rest has n - 2.

    Significance: the sum over lines of ordered over rest is compared with an F distribution. Sensor noise is independent from
    line to line, a hit beside the point is not: with a rest of ρ times the noise, whose excess is taken as one real direction
    common to all L lines (a gain, at worst), the sum has ν = 2 L ρ² / (1 + 2(ρ-1) + 2 L (ρ-1)²) degrees of freedom (Satterthwaite
    1946), ordered and rest alike. Such hits are one number a blow, besides, which a few blows may order by chance whatever the
    noise: beyond the noise, ordered over rest is compared with an F distribution of 1 and n - 2 degrees of freedom, and the larger
    chance counts. So three blows alone never tell; those of many records do (`chance_of_ordering`). A structure with a restoring
    force orders all channels; so does a hand that hits elsewhere when it hits harder: what orders with the force is evidence of
    nonlinearity, not proof. Of a channel rounded to steps that noise does not reach it is not told: a soft blow loses more of its
    ringing than a hard one.
    """
    if record.kind != "impact":
        raise ParameterError(
            f"record {record.name!r} is of kind {record.kind!r}; only blows can be compared one by one"
        )
    noise = noise or pretrigger_noise(record)
    fs = record.histories[0].fs
    _, force, response, window, peaks = spectra_of_blows(record)
    samples = window.size
    input_power = np.sum(np.abs(force) ** 2, axis=0)
    keep = input_power > _HEARD * np.max(input_power)
    keep[0] = False
    if band is not None:
        # At zeros of a pulse's spectrum there is rounding.
        keep = (
            (input_power > _ROUNDING * np.max(input_power))
            & (noise.freq >= band[0])
            & (noise.freq <= band[1])
            & (noise.freq > 0)
        )
    if not np.any(keep):
        raise ParameterError(f"record {record.name!r}: band {band} Hz holds no line with force")
    force, input_power, freq = force[:, keep], input_power[keep], noise.freq[keep]
    count, channels = len(force), len(record.channels)
    spread = float(np.std(peaks) / np.mean(peaks))
    # of a single blow, the mean blow's: the variance of H1 over all of them is that over their number
    single = noise.variance[:, keep] * count
    shape = (channels, freq.size)
    if count < 3 or spread < 1e-9:
        blank = np.full(shape, np.nan)
        none = np.full(channels, np.nan)
        return BlowScatter(freq, blank, blank, single, none, none, spread, Ordering(np.nan, np.nan, np.nan, count - 2))
    share = np.abs(force) ** 2 / input_power
    x = peaks[:, np.newaxis] - np.sum(share * peaks[:, np.newaxis], axis=0)
    x = x / np.sqrt(np.sum(share * x**2, axis=0))
    ordered, rest = np.empty(shape), np.empty(shape)
    ratio, significance = np.empty(channels), np.empty(channels)
    beyond = np.full((channels, 3), np.nan)
    for k in range(channels):
        a = response[:, k][:, keep]
        h = np.sum(a * force.conj(), axis=0) / input_power
        g = np.sum(x * (a - h * force) * force.conj(), axis=0) / input_power
        left = np.sum(np.abs(a - (h + g * x) * force) ** 2, axis=0)
        expected = smooth_noise(left / (count - 2), np.abs(h), noise_bins) / input_power
        ordered[k] = np.abs(g) ** 2 - expected
        rest[k] = expected * count
        known = single[k] if np.all(np.isfinite(single[k])) else high_pass_variance(a[0] / force[0], noise_bins)
        ratio[k] = float(np.mean(rest[k] / np.maximum(known, 1e-12 * np.max(rest[k]) + 1e-300)))
        # an excess counts beyond two deviations of what noise and its estimate scatter themselves
        quiet = max(noise.samples[1 + k], 1) * freq.size * fs / samples / (fs / 2)
        scatter = np.sqrt(1 / (freq.size * (count - 2)) + 1 / max(quiet, 1.0))
        freedom = _freedom(freq.size, max(float(ratio[k]) / (1 + 2 * scatter), 1.0))
        # both over one smooth power that takes no side
        weight = 1 / smooth_noise((np.abs(g) ** 2 * input_power + left) / (count - 1), np.abs(h), noise_bins)
        by_force, beside = np.mean(np.abs(g) ** 2 * input_power * weight), np.mean(left / (count - 2) * weight)
        # A channel that shows nothing tells nothing.
        if not beside > 0.0:
            significance[k] = np.nan
            continue
        by_noise = stats.f.sf(by_force / beside, freedom, freedom * (count - 2))
        # In units of the noise, beyond it.
        beyond[k] = by_force / beside * ratio[k] - 1.0, ratio[k] - 1.0, scatter
        significance[k] = max(by_noise, chance_of_ordering([_ordering(beyond[[k]], count - 2)]))
    rounded = orders_by_rounding(record, [h.start for h in record.histories])
    significance = np.where(rounded, np.nan, significance)
    told = beyond[~rounded & np.isfinite(significance)]
    return BlowScatter(freq, ordered, rest, single, ratio, significance, spread, _ordering(told, count - 2))


def _ordering(beyond: FloatArray, free: int) -> Ordering:
    """Of what channels order with the force, what they do not and how well that is known, all together; NaN of none."""
    if not len(beyond):
        return Ordering(np.nan, np.nan, np.nan, free)
    return Ordering(
        float(beyond[:, 0].sum()), float(beyond[:, 1].sum()), float(np.sqrt(np.sum(beyond[:, 2] ** 2))), free
    )


def chance_of_ordering(records: Iterable[Ordering]) -> float:
    """
    Probability that the blows of some records order with their force as much where nothing does; 1 where none tells.

    Hits that differ along one direction are a number a blow. Over records ordered and rest are compared by an F distribution, whose
    degrees of freedom are those of unlike powers (Satterthwaite 1946). The rest is no less than the noise leaves open.
    """
    each = np.array([r for r in records if np.all(np.isfinite(r))]).reshape(-1, len(Ordering._fields))
    if not each.size:
        return 1.0
    ordered, rest, open_, free = each.T
    power = np.maximum(ordered + free * rest, open_)
    count = float(np.sum(power) ** 2 / np.sum(power**2))
    differ = max(float(np.sum(rest)), 2.0 * float(np.sqrt(np.sum(open_**2))))
    return float(stats.f.sf(max(float(np.sum(ordered)), 0.0) / differ, count, count * free.mean()))


class Deviations(NamedTuple):
    """What single blows are off the H1 of their record by."""

    freq: FloatArray  # Lines [Hz]
    h: ComplexArray  # H1, shape (channel, frequency)
    off: ComplexArray  # Of like noise in every blow, whatever its force; shape (blow, channel, frequency)
    single: FloatArray  # Variance that the sensors leave on one blow, shape (channel, frequency)
    heard: np.ndarray  # Lines on which the force is heard and that variance is known
    peaks: FloatArray  # Largest force of each blow [N]

    def at(self, keep: np.ndarray) -> Deviations:
        """The same on some lines."""
        return self._replace(
            freq=self.freq[keep],
            h=self.h[:, keep],
            off=self.off[..., keep],
            single=self.single[:, keep],
            heard=self.heard[keep],
        )


def deviations(record: Record, decay_rate: float = 0.0, noise: SensorNoise | None = None) -> Deviations:
    """What the blows of a record are off its H1 by, beside what its sensors leave."""
    single = (noise or pretrigger_noise(record)).variance * len(record.histories)
    freq, force, response, _, peaks = spectra_of_blows(record, decay_rate)
    count = len(force)
    force = force[:, None]
    power = np.sum(np.abs(force) ** 2, axis=0)
    heard = (power[0] > _HEARD * np.max(power)) & np.all(np.isfinite(single) & (single > 0.0), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        h = np.sum(response * force.conj(), axis=0) / power
        off = (response - h * force) * (force.conj() / np.abs(force)) / np.sqrt(power / count)
    off = np.where((power > 0.0) & np.isfinite(off), off, 0.0)
    return Deviations(freq, h, off, single, heard, peaks)


def hit_directions(found: Deviations, most: int = 2) -> ComplexArray:
    """
    What a hand's hits do to the mean of a record's blows: directions of H1 with coefficients of unit variance.

    A blow beside the point, or not quite along its direction, shows H + c G with one G for all lines and channels, and a c of its
    own. Of the deviations of single blows from H1 what goes with the peak force is taken off, for a structure that is not linear
    does that; the rest, over the sensors' noise, is parted into principal components with real scores. Those with twice the power
    of the noise are directions, and H1 is off along each by the standard deviation of their scores over the root of the number
    of blows. Shape (direction, channel, frequency); none with fewer than three blows, or where the noise is not known.
    """
    off, single, heard, peaks = found.off.copy(), found.single, found.heard, found.peaks
    count = len(off)
    none = np.zeros((0, *off.shape[1:]), dtype=np.complex128)
    if count < 3 or not np.any(heard):
        return none
    for same in (np.ones(count), peaks - peaks.mean()):
        off -= np.multiply.outer(same, np.tensordot(same, off, 1)) / max(float(same @ same), 1e-300)
    weighted = (off / np.sqrt(single / 2))[..., heard].reshape(count, -1)
    scores, sizes, _ = np.linalg.svd(np.concatenate([weighted.real, weighted.imag], axis=1), full_matrices=False)
    # What the sensors' noise alone would give each of them.
    alone = 2.0 * weighted.shape[1]
    strong = [k for k in range(min(most, count - 2)) if sizes[k] ** 2 > _OVER_NOISE * alone]
    if not strong:
        return none
    return np.asarray(np.stack([np.tensordot(scores[:, k], off, 1) for k in strong]) / np.sqrt((count - 2) * count))


def gains_of_blows(record: Record) -> tuple[FloatArray, FloatArray]:
    """Standard deviation of each channel's gain over the blows; what differs beside the gain, over what it does (powers)."""
    _, force, response, _, _ = spectra_of_blows(record)
    power = np.sum(np.abs(force) ** 2, axis=0)
    heard = power > _HEARD * power.max()
    force, response = force[:, None, heard], response[..., heard]
    expected = np.sum(response * force.conj(), axis=0) / power[heard] * force
    own = np.sum(np.abs(expected) ** 2, axis=-1)
    gain = np.sum((response * expected.conj()).real, axis=-1) / np.maximum(own, 1e-300)
    off = np.sum((gain - gain.mean(axis=0)) ** 2 * own, axis=0)
    rest = np.sum(np.abs(response - gain[..., None] * expected) ** 2, axis=(0, -1))
    return np.asarray(gain.std(axis=0, ddof=1)), np.asarray(rest / np.maximum(off, 1e-300))


def _freedom(lines: int, ratio: float) -> float:
    """Real degrees of freedom of a sum over lines of noise with an excess in one real direction common to all."""
    return 2 * lines * ratio**2 / (1 + 2 * (ratio - 1) + 2 * lines * (ratio - 1) ** 2)


def _quiet_force(history: History) -> list[FloatArray]:
    """Before the blow, and from a while after it to the end: a force is noise but for its blow."""
    start, force = history.start, history.force
    loud = np.flatnonzero(stands_out(force))
    end = int(loud[-1]) if loud.size else 0
    return _alive([force[:start], force[end + followed_by(end - start) :]])


def _quiet_response(history: History, channel: int) -> list[FloatArray]:
    """Before the blow; and the last eighth, where it has died out."""
    values = history.responses[channel]
    before = values[: history.start]
    eighth = values.size // 8
    last, earlier = values[-eighth:], values[-2 * eighth : -eighth]
    parts = [before]
    if eighth >= _FEWEST_QUIET and np.var(last) > 0:
        steady = np.var(earlier) <= _STEADY * np.var(last)
        if before.size >= _FEWEST_QUIET:
            # a few samples scatter: by three standard deviations of their variance
            steady = steady and np.var(last) <= _STEADY * np.var(before) * (1 + 3 * np.sqrt(2 / before.size))
        if steady:
            parts.append(last)
    return _alive(parts)


def _alive(parts: list[FloatArray]) -> list[FloatArray]:
    return [part for part in parts if part.size >= _FEWEST_QUIET and np.ptp(part) > 0]


def _density(parts: list[FloatArray], freq: FloatArray, fs: float) -> tuple[FloatArray, int]:
    """One-sided density of quiet parts together, weighted by their lengths, on the lines asked for; NaN where none is."""
    if not parts:
        return np.full(freq.size, np.nan), 0
    total, weights = np.zeros(freq.size), 0
    for part in parts:
        segment = min(part.size, _SEGMENT)
        at, density = signal.welch(part - np.mean(part), fs, window="hann", nperseg=segment, detrend=False)
        # the first lines carry what the mean took off
        total += part.size * np.interp(freq, at[2:-1], density[2:-1])
        weights += part.size
    return total / weights, weights
