"""
Records of blows: their scatter told apart into errors of the single hits, nonlinearity, and noise.

Every hit is tilted and offset a little, and shows H + Σ c G with the G of the nominal model (`set_ups.of_force`) and a c of its
own. What these explain of the scatter is no noise of the lines: the variance holds the rest, and no less than the sensors read
before the blows. The mean of n blows is off along each G by the hand's standard deviation over √n.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.set_ups import of_force
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.blow_noise import (
    Deviations,
    SensorNoise,
    blow_scatter,
    deviations,
    hit_directions,
    pretrigger_noise,
)
from cutvib_ss.measurement.noise import NOISE_BINS, smooth_noise
from cutvib_ss.measurement.records import Record
from cutvib_ss.results import ComplexArray, FloatArray


class _Hand(NamedTuple):
    """Errors of the single hits of a record."""

    errors: FloatArray  # Tilt and offset of each blow about their mean, in their units; shape (blow, 2)
    shown: ComplexArray  # What a unit of each does; shape (2, channel, frequency)


def of_blows(nominal: Model, entries: Sequence[Entry], records: Sequence[Record]) -> list[Entry]:
    """The records, those of blows without the bias of H1, and with their scatter told apart."""
    found = [_told_apart(nominal, e, records[e.record]) for e in entries]
    hands = [hand for _, hand in found if hand is not None]
    if not hands:
        return [e for e, _ in found]
    # One hand: a few blows of a record tell little of how much it scatters.
    free = sum(len(hand.errors) - 1 for hand in hands)
    size, axes = np.linalg.eigh(sum(hand.errors.T @ hand.errors for hand in hands) / free)
    spread = axes * np.sqrt(np.maximum(size, 0.0))
    return [e if hand is None else _with_hand(e, hand, spread) for e, hand in found]


def _with_hand(e: Entry, hand: _Hand, spread: FloatArray) -> Entry:
    """A record with the directions in which the mean of its hits is off."""
    mean = np.tensordot(spread.T, hand.shown, 1) / np.sqrt(len(hand.errors))
    others = {hit: shown for hit, shown in e.hits.items() if hit[0] == "hit"}
    own = {("hit", e.record, len(others) + k): shown for k, shown in enumerate(mean)}
    return replace(e, hits={**e.hits, **own})


def _told_apart(nominal: Model, e: Entry, record: Record) -> tuple[Entry, _Hand | None]:
    """A record of blows without the bias of H1, its variance without what hits explain, and how surely blows order with force."""
    if record.kind != "impact":
        return e, None
    noise = pretrigger_noise(record)
    e = _unbiased(e, noise)
    if len(record.histories) < 2:
        return e, None
    found = deviations(record, e.estimator.exponential_decay, noise)
    found = found.at(np.isin(found.freq.round(9), e.freq.round(9)))
    hand = _hand(nominal, e, found)
    if hand is not None:
        rest = found._replace(off=found.off - np.tensordot(hand.errors, hand.shown, 1))
        e = e.showing(e.data, _variance(e, found, rest))
        found = rest
    if len(record.histories) < SETTINGS.level_blows:
        return e, hand
    # The variance keeps what orders: a hand may hit elsewhere when it hits harder.
    e = replace(e, hits={("hit", e.record, k): direction for k, direction in enumerate(hit_directions(found))})
    ordering = blow_scatter(record, (float(e.freq[0]), float(e.freq[-1])), noise=noise).ordering
    return replace(e, ordering=ordering), hand


def _hand(nominal: Model, e: Entry, found: Deviations) -> _Hand | None:
    """Tilt and offset of single hits, by least squares with the prior of set-up errors; None where the model has no such force."""
    shown = of_force(nominal, e)
    if not len(shown) or not found.heard.any():
        return None
    weight = np.where(found.heard, np.sqrt(2.0 / np.where(found.heard, found.single, 1.0)), 0.0)
    rows, off = ((weight * part).reshape(len(part), -1) for part in (shown, found.off))
    largest = SETTINGS.likelihood_set_up_sizes[-1][0]
    inner = (rows.conj() @ rows.T).real + np.eye(len(rows)) / largest**2
    errors = np.linalg.solve(inner, (rows.conj() @ off.T).real).T
    return _Hand(errors - errors.mean(axis=0), shown)


def _variance(e: Entry, found: Deviations, rest: Deviations) -> FloatArray:
    """Variance of H1 by the scatter that hits leave, no less than by the noise of the sensors and the converter's steps."""
    before, after = (
        np.array([smooth_noise(power, np.abs(h), NOISE_BINS) for power, h in zip(_power(d), d.h, strict=True)])
        for d in (found, rest)
    )
    part = np.divide(after, before, out=np.ones_like(after), where=before > 0.0)
    steps = 0.0 if e.rounded is None else e.rounded * e.variance
    sensors = np.where(np.isfinite(found.single), found.single / len(found.off), e.variance)
    return np.asarray(np.minimum(e.variance, np.maximum(np.minimum(part, 1.0) * e.variance, sensors + steps)))


def _power(found: Deviations) -> FloatArray:
    """Mean square of the deviations of the blows, shape (channel, frequency)."""
    return np.asarray(np.sum(np.abs(found.off) ** 2, axis=0) / (len(found.off) - 1))


def _unbiased(e: Entry, noise: SensorNoise) -> Entry:
    """A record of blows without the bias of H1 by the force's noise, which is largest at the softest level."""
    part = noise.bias[np.isin(noise.freq.round(9), e.freq.round(9))]
    return e.showing(e.data / (1.0 - np.clip(np.nan_to_num(part), 0.0, SETTINGS.record_most_bias)))
