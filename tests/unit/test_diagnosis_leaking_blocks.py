"""Short blocks of random vibration: where nothing replays how they leak, leakage is noise, and no effect of the level."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.linearity import level_stands_out
from cutvib_ss.diagnosis.observations import Observations, observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances

MASS, FREQUENCY, DAMPING_RATIO = 2.0, 40.0, 0.01
FS, SAMPLES, BLOCK = 500.0, 6000, 0.512
OMEGA = 2.0 * np.pi * FREQUENCY
OSCILLATOR = Structure(
    SecondOrder(
        np.array([[MASS]]),
        np.array([[2.0 * DAMPING_RATIO * OMEGA * MASS]]),
        np.array([[MASS * OMEGA**2]]),
        ("x",),
        {"spring": np.ones(1)},
    ),
    {"y": Channel("spring", "displacement")},
    "spring",
    tolerance=StructureTolerances(0.02, 0.2, 0.02, 0.01),
)


@cache
def _observed() -> Observations:
    """Six records of one session, by turns at two levels, on sixteen times the clock."""
    system = signal.TransferFunction([1.0], MASS * np.array([1.0, 2.0 * DAMPING_RATIO * OMEGA, OMEGA**2]))
    records = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        count = SAMPLES + 2000
        force = signal.sosfiltfilt(
            signal.butter(4, (10.0, 120.0), "band", fs=FS, output="sos"), rng.standard_normal(count)
        )
        force *= 1.0 + 2.0 * (seed % 2)
        fine = signal.resample(force, 16 * count)
        moved = signal.lsim(system, fine, np.arange(fine.size) / (16 * FS))[1][::16]
        measured = moved + 1e-4 * np.std(moved) * rng.standard_normal(count)
        history = History(FS, force[2000:], measured[None, 2000:], ("y",))
        records.append(
            Record(f"r{seed}", "timeseries", None, None, None, ("y",), ("displacement",), (history,), block=BLOCK,
                   session="a", band_hz=(15.0, 100.0))
        )  # fmt: skip
    return observe(Campaign("", Path(), OSCILLATOR, tuple(records), ()), OSCILLATOR)


def test_leakage_is_noise_where_it_is_not_replayed() -> None:
    over_noise, over_all = [], []
    for e in _observed().entries:
        s = 2j * np.pi * e.freq
        exact = 1.0 / (MASS * (s**2 + 2.0 * DAMPING_RATIO * OMEGA * s + OMEGA**2))
        error = np.abs(e.data[0] - exact) ** 2
        over_noise.append(error / e.variance[0])
        over_all.append(error / e.unreplayed.variance[0])
    # The sensor's noise is what a model that replays the blocks is held against.
    assert np.mean(over_noise) > 100.0
    assert 0.3 < np.mean(over_all) < 3.0


def test_few_lines_do_not_replay_and_know_it() -> None:
    records = Records(_observed().entries)
    step = max(1, records.entries[0].freq.size // 1000)
    few, replayed = records.coarse(1000, 0.0), records.coarse(1000, 0.0, replayed=True)
    for e, one, other in zip(records.entries, few.entries, replayed.entries, strict=True):
        assert one.variance == pytest.approx(e.unreplayed.variance[:, ::step])
        assert other.variance == pytest.approx(e.variance[:, ::step])


def test_leakage_is_no_effect_of_the_level() -> None:
    assert not level_stands_out(Records(_observed().entries))
