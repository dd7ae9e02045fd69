"""Estimated responses that stop ringing, for the rest of a decay is less than half a converter's step."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.stopped import with_what_stops
from cutvib_ss.measurement.dead_zone import stops
from cutvib_ss.measurement.noise import frf_variance
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances
from cutvib_ss.results import MeasuredFrequencyResponse

FS, BLOCK, BLOW_AT, BLOWS = 2048.0, 2.0, 0.05, 3
MASS, DAMPING, SPRING = 2.0, 4.0, 8e4
DECAY = DAMPING / (2 * MASS)
BAR = Structure(
    SecondOrder(np.array([[MASS]]), np.array([[DAMPING]]), np.array([[SPRING]]), ("x",), {"tip": np.ones(1)}),
    {"y": Channel("tip", "displacement")},
    "tip",
    tolerance=StructureTolerances(0.01, 0.1, 0.01, 0.01),
)


def record(name: str, step: float, noise: float, level: float, window: float = 0.0) -> Record:
    """Blows on an oscillator, rounded to a converter's steps, as an analyser exports them; step and noise over the first swing."""
    rng = np.random.default_rng(7)
    time = np.arange(round(BLOCK * FS)) / FS
    rate = np.sqrt(SPRING / MASS - DECAY**2)
    swing = np.where(time > BLOW_AT, np.exp(-DECAY * (time - BLOW_AT)) * np.sin(rate * (time - BLOW_AT)), 0.0) / (
        MASS * rate
    )
    half_sine = np.sin(np.pi * np.arange(9) / 8) / 5.0
    pulse = np.zeros(time.size)
    pulse[round(BLOW_AT * FS) : round(BLOW_AT * FS) + 9] = half_sine
    largest = 1.0 / (MASS * rate)
    force, shown = [], []
    for size in level * (1 + 0.1 * rng.standard_normal(BLOWS)):
        y = size * np.convolve(swing, half_sine)[: time.size] / np.sum(half_sine)
        y = y + noise * largest * rng.standard_normal(time.size)
        y = np.round(y / (step * largest)) * step * largest if step else y
        fade = np.exp(-window * time)
        force.append(np.fft.rfft(size * pulse / np.sum(half_sine) * FS * fade) / FS)
        shown.append(np.fft.rfft(y * fade) / FS)
    f, a = np.array(force), np.array(shown)
    power, cross = np.sum(np.abs(f) ** 2, axis=0), np.sum(a * f.conj(), axis=0)
    coherence = np.abs(cross) ** 2 / (power * np.sum(np.abs(a) ** 2, axis=0))
    lines = slice(10, 400)
    freq, data = np.fft.rfftfreq(time.size, 1 / FS)[lines], (cross / power)[lines]
    shape = (1, 1, 1, freq.size)
    variance = frf_variance(data[None], coherence[None, lines], BLOWS)
    frf = MeasuredFrequencyResponse(
        data=data.reshape(shape), freq=freq, positions=np.array([np.nan]), outputs=("y",), inputs=("force",),
        quantities=("displacement",), input_unit="N", variance=variance.reshape(shape),
        coherence=coherence[lines].reshape(shape), averages=BLOWS,
    )  # fmt: skip
    return Record(
        name, "frf", None, level, None, ("y",), ("displacement",), (), frf=frf, averages=BLOWS, excitation="impact"
    )


def stop(step: float, noise: float, level: float = 1.0, window: float = 0.0) -> float:
    frf = record("r", step, noise, level, window).frf
    assert frf is not None
    return float(stops(frf)[0])


@pytest.mark.parametrize("level", [0.5, 1.0])
def test_a_decay_stops_where_it_falls_below_half_a_step(level: float) -> None:
    assert stop(0.6, 1e-3, level) == pytest.approx(np.log(level / 0.3) / DECAY, abs=0.15)


def test_noise_that_a_converter_sees_carries_a_decay_through_its_steps() -> None:
    assert np.isinf(stop(0.3, 0.3))
    assert np.isinf(stop(0.0, 1e-2))


@pytest.mark.parametrize("rate", [3.0, 30.0])
def test_an_exponential_window_is_no_stop(rate: float) -> None:
    assert np.isinf(stop(0.0, 1e-2, window=rate))


def test_what_responses_lack_where_they_stop_counts_as_noise() -> None:
    campaign = Campaign("", Path(), BAR, (record("soft", 0.6, 1e-3, 0.5), record("hard", 0.6, 1e-3, 1.0)), ())
    plain = observe(campaign, BAR)
    seen = with_what_stops(BAR, plain)
    assert any("stop ringing" in w for w in seen.warnings)
    for before, after in zip(plain.entries, seen.entries, strict=True):
        s = 2j * np.pi * after.freq
        right = 1.0 / (MASS * s**2 + DAMPING * s + SPRING)
        assert np.mean(np.abs(before.data - right) ** 2 / before.variance) > 4.0
        assert np.mean(np.abs(after.data - right) ** 2 / after.variance) < 2.0


def test_responses_that_all_stop_at_one_instant_are_left_alone() -> None:
    campaign = Campaign("", Path(), BAR, (record("a", 0.6, 1e-3, 1.0), record("b", 0.6, 1e-3, 1.0)), ())
    plain = observe(campaign, BAR)
    assert with_what_stops(BAR, plain) is plain


def test_time_histories_tell_their_steps_themselves() -> None:
    campaign = Campaign("", Path(), BAR, (record("soft", 0.6, 1e-3, 0.5), record("hard", 0.6, 1e-3, 1.0)), ())
    plain = observe(campaign, BAR)
    entries = tuple(
        replace(e, response=replace(e.response, estimator=replace(e.estimator, kind="H1"))) for e in plain.entries
    )
    histories = replace(plain, entries=entries)
    assert with_what_stops(BAR, histories) is histories
