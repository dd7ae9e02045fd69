"""Blows whose hits are tilted and offset: their scatter is a direction of the mean and no noise of the lines."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.diagnosis.blows import of_blows
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.diagnosis.set_ups import of_force
from cutvib_ss.measurement import Campaign, History, Record
from cutvib_ss.model.machine import published_machine

MACHINE = published_machine()
CHANNELS, FS, SECONDS = ("tool_x", "tool_z", "base_x"), 2000.0, 4.0
NOISE = (0.01, 0.01, 0.002)


def campaign(tilt: float, offset: float, position: float = 0.4, blows: int = 3, seed: int = 2) -> Campaign:
    """Records of blows, each hit with a tilt [rad] and an offset [m] of its own; responses of a period, by their spectra."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(FS * SECONDS)) / FS
    freq = np.fft.rfftfreq(time.size, 1 / FS)
    h = np.zeros((3, 4, freq.size), dtype=complex)
    inputs = ("force", "tool_z", "joint1", "joint2")
    h[..., 1:] = cv.frequency_response(MACHINE, [position], freq[1:], inputs=inputs, outputs=CHANNELS).data[0]
    records = []
    for k in range(4):
        histories = []
        for _ in range(blows):
            force = 50.0 * np.exp(-(((time - 0.3) / 1e-3) ** 2) / 2)
            a, b = tilt * rng.standard_normal(), offset * rng.standard_normal()
            shown = np.fft.irfft((h[:, 0] + a * h[:, 1] + b * (h[:, 2] + h[:, 3])) * np.fft.rfft(force), time.size)
            noise = np.array(NOISE)[:, None] * rng.standard_normal(shown.shape)
            histories.append(History(FS, force + 0.01 * rng.standard_normal(time.size), shown + noise, CHANNELS))
        record = Record(
            f"{k}.csv",
            "impact",
            position,
            None,
            None,
            CHANNELS,
            ("acceleration",) * 3,
            tuple(histories),
            averages=blows,
        )
        records.append(replace(record, band_hz=(20.0, 300.0)))
    return Campaign("blows", Path(), MACHINE, tuple(records))


def observed(told: Campaign) -> list[Entry]:
    return list(observe(told, MACHINE).entries)


def true_response(e: Entry) -> np.ndarray:
    return cv.frequency_response(MACHINE, [e.position], e.freq, outputs=e.channels).data[0, :, 0]


def test_hits_that_are_tilted_and_offset_leave_the_noise_of_the_sensors() -> None:
    aside, straight = (observed(campaign(*errors)) for errors in ((0.02, 1e-3), (0.0, 0.0)))
    for off, on in zip(aside, straight, strict=True):
        ratio = off.variance / on.variance
        assert np.median(ratio) == pytest.approx(1.0, abs=0.3)


def test_the_mean_is_off_along_the_directions_and_by_their_size() -> None:
    squares, before = [], []
    for seed in range(6):
        for e in observed(campaign(0.02, 1e-3, seed=seed)):
            rows = np.array([shown for key, shown in e.hits.items() if key[0] == "hit"])
            weight = np.sqrt(2.0 / e.variance)
            assert len(rows)
            flat = (rows * weight).reshape(len(rows), -1)
            left = ((e.data - true_response(e)) * weight).ravel()
            inner = (flat.conj() @ flat.T).real + np.eye(len(flat))
            found = np.linalg.solve(inner, (flat.conj() @ left).real)
            squares.append(float(found @ found) / 2.0)
            rest = np.linalg.norm(left - found @ flat) ** 2 / (2.0 * left.size)
            before.append(np.linalg.norm(left) ** 2 / (2.0 * left.size))
            assert rest < 1.5
    # Coefficients of unit variance: two of each record.
    assert 0.5 < np.mean(squares) < 2.0
    assert np.mean(before) > 10.0


def test_two_blows_are_told_apart_too() -> None:
    aside, straight = (observed(campaign(*errors, blows=2)) for errors in ((0.02, 1e-3), (0.0, 0.0)))
    assert np.median(aside[0].variance / straight[0].variance) == pytest.approx(1.0, abs=0.4)


def test_scatter_of_another_kind_stays_in_the_variance() -> None:
    told = campaign(0.0, 0.0)
    rng = np.random.default_rng(7)

    def other(h: History) -> History:
        # A sensor whose phase each blow finds at another place: no hit does that.
        phase = 0.1 * np.sin(np.fft.rfftfreq(h.force.size, 1 / FS) / 8.0 + rng.uniform(0, 2 * np.pi))
        shown = np.array(h.responses)
        shown[0] = np.fft.irfft(np.fft.rfft(shown[0]) * np.exp(1j * phase), h.force.size)
        return replace(h, responses=shown)

    scattered = replace(
        told, records=tuple(replace(r, histories=tuple(other(h) for h in r.histories)) for r in told.records)
    )
    parts = []
    for e in observed(scattered):
        size = np.abs(e.data[0])
        parts.append(np.median((e.variance[0] / size**2)[size > np.quantile(size, 0.8)]))
    # Three blows: the scatter itself scatters.
    assert np.mean(parts) == pytest.approx(0.1**2 / 2 / 3, rel=0.7)


def test_a_record_without_blows_and_one_of_another_input_have_no_hand() -> None:
    (e, *_) = observed(campaign(0.02, 1e-3))
    elsewhere = replace(e, response=replace(e.response, inputs=("rail@0.3",)))
    assert len(of_force(MACHINE, e)) == 2
    assert len(of_force(MACHINE, elsewhere)) == 0
    noise = replace(campaign(0.0, 0.0).records[0], kind="timeseries", averages=None)
    assert of_blows(MACHINE, [replace(e, record=0)], [noise]) == [replace(e, record=0)]
