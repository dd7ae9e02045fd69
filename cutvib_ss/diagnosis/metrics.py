"""
Distances between measured and computed responses: mean modulus, FRAC, logarithmic error and the pointwise ν-gap.

The ν-gap says whether a controller would notice: one that gives a model P₁ a stability margin b(P₁, C) above it keeps P₂ stable
too, and loses no more than that of its margin. Pointwise it is the chordal distance between the two responses on the Riemann
sphere,

    κ = |P₁ - P₂| / √((1 + |P₁|²)(1 + |P₂|²)),

for one input and several outputs with |P₁ - P₂|² + |P₁|²|P₂|² - |P₁ᴴP₂|² in place of |P₁ - P₂|². It weighs responses around one
most, so that the scaling decides what is asked: each channel is divided by the root mean square of the nominal model's response
over records and band, which asks for loops whose gain is around one at a typical line. It is the ν-gap if the winding
condition holds (`cutvib_ss.diagnosis.nu_gap`).

Source: G. Vinnicombe, Frequency domain uncertainty and the graph topology, IEEE Trans. Automatic Control 38 (1993). FRAC is in
`cutvib_ss.diagnosis.correlation`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import optimize, special

from cutvib_ss.diagnosis.correlation import frac
from cutvib_ss.diagnosis.cross_validation import Judged
from cutvib_ss.diagnosis.findings import Distances, Metric
from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.results import ComplexArray, FloatArray

ALL = "all"
"""Name of the channels taken together."""


@dataclass(frozen=True)
class Sides:
    """The same held-out records against several models."""

    before: tuple[Judged, ...]  # Against the model as given, re-tuned, and with the cause
    tuned: tuple[Judged, ...]
    after: tuple[Judged, ...]
    second: tuple[Judged, ...] | None = None  # With the second-best cause; None where there is none


def mean_modulus(measured: ComplexArray, computed: ComplexArray) -> float:
    """Mean of |ΔH|, the metric of the paper's Table 4."""
    return float(np.mean(np.abs(measured - computed)))


def log_error(measured: ComplexArray, computed: ComplexArray) -> float:
    """Mean of |20 lg |H₂/H₁||."""
    both = (np.abs(measured) > 0) & (np.abs(computed) > 0)
    return (
        float(np.mean(np.abs(20 * np.log10(np.abs(computed[both] / measured[both]))))) if both.any() else float("nan")
    )


def chordal_distance(first: ComplexArray, second: ComplexArray) -> FloatArray:
    """
    Pointwise ν-gap of responses with one input.

    >>> chordal_distance(np.array([[0.0 + 0j]]), np.array([[1.0 + 0j]])).round(4)
    array([0.7071])
    """
    one, two = np.sum(np.abs(first) ** 2, axis=0), np.sum(np.abs(second) ** 2, axis=0)
    apart = np.sum(np.abs(first - second) ** 2, axis=0)
    aside = one * two - np.abs(np.sum(first.conj() * second, axis=0)) ** 2
    distance: FloatArray = np.sqrt((apart + np.maximum(aside, 0.0)) / ((1.0 + one) * (1.0 + two)))
    return distance


def nu_distance(first: ComplexArray, second: ComplexArray, variance: FloatArray) -> float:
    """Largest chordal distance over a band of what was measured from what was computed, the noise taken out."""
    power = chordal_distance(first, second) ** 2 - _noise_power(first, variance)
    return float(np.sqrt(max(float(_neighbours(power).max()), 0.0)))


def noise_distance(response: ComplexArray, variance: FloatArray) -> float:
    """What noise alone makes of `nu_distance` in one record out of twenty, at most."""
    power = _noise_power(response, variance)
    mean = _neighbours(power)
    if not (mean > 0).any():
        return 0.0
    lines = min(SETTINGS.metric_lines, power.size) * mean**2 / np.maximum(_neighbours(power**2), 1e-300)
    wanted = float(np.log(1.0 - 1.0 / SETTINGS.metric_one_in))

    def excess(log_t: float) -> float:
        # A mean of squares of complex noise is a gamma variable; of neighbouring ones every other is about independent.
        ratio = np.exp(2 * log_t) / np.maximum(mean, 1e-300)
        below = special.gammainc(lines, lines * (1.0 + np.minimum(ratio, 1e6)))
        return float(np.sum(np.log(np.maximum(below, 1e-300)))) / 2.0 - wanted

    middle = 0.5 * float(np.log(mean.max()))
    return float(min(np.exp(optimize.brentq(excess, middle - 12.0, middle + 4.0)), 1.0))


def _noise_power(response: ComplexArray, variance: FloatArray) -> FloatArray:
    power: FloatArray = variance.sum(axis=0) / (1.0 + np.sum(np.abs(response) ** 2, axis=0)) ** 2
    return power


def _neighbours(values: FloatArray) -> FloatArray:
    """Means over a few neighbouring lines."""
    lines = min(SETTINGS.metric_lines, values.size)
    means: FloatArray = np.convolve(values, np.ones(lines) / lines, mode="valid")
    return means


def scales_of(records: Sequence[Judged]) -> dict[str, float]:
    """Root mean square of a model's response in each channel, over records and band."""
    power: dict[str, list[float]] = {}
    for j in records:
        for c, row in zip(j.entry.channels, j.predicted, strict=True):
            power.setdefault(c, []).append(float(np.mean(np.abs(row) ** 2)))
    return {c: float(np.sqrt(np.mean(p))) or 1.0 for c, p in power.items()}


def metrics(sides: Sides, per_unit: float, scales: Mapping[str, float]) -> tuple[Metric, ...]:
    """Distances by record and channel."""
    out = []
    for i, j in enumerate(sides.before):
        names = j.entry.channels
        rows = [(c, [k]) for k, c in enumerate(names)]
        for channel, index in rows if len(names) == 1 else [*rows, (ALL, list(range(len(names))))]:
            scale = np.array([scales[names[k]] for k in index])[:, None]
            scaled, spread = j.entry.data[index] / scale, j.entry.variance[index] / scale**2
            given, again, corrected = (
                _distances(j.entry, side[i].predicted, index, scale, per_unit)
                for side in (sides.before, sides.tuned, sides.after)
            )
            other = None
            if sides.second is not None:
                other = _distances(j.entry, sides.second[i].predicted, index, scale, per_unit)
            out.append(
                Metric(
                    position=j.entry.position,
                    level=j.entry.level,
                    channel=channel,
                    input=None if j.entry.input == FORCE else j.entry.input,
                    before=given,
                    tuned=again,
                    after=corrected,
                    second=other,
                    noise_modulus=float(np.mean(j.noise[index])) / per_unit,
                    noise_nu_gap=noise_distance(scaled, spread),
                )
            )
    return tuple(out)


def _distances(e: Entry, predicted: ComplexArray, index: list[int], scale: FloatArray, per_unit: float) -> Distances:
    measured, computed = e.data[index], predicted[index]
    return Distances(
        mean_modulus=mean_modulus(measured, computed) / per_unit,
        frac=frac(measured / scale, computed / scale),
        log_error_db=log_error(measured, computed),
        nu_gap=nu_distance(measured / scale, computed / scale, e.variance[index] / scale**2),
    )
