"""Levels of records that state none: by their blows."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.repeatability import repeatability
from cutvib_ss.measurement import History, Record
from cutvib_ss.measurement.levels import levels_of, own_level, same_level
from cutvib_ss.measurement.record_pairs import PairSummary
from cutvib_ss.measurement.records import Campaign
from cutvib_ss.measurement.summary import Summary, summarise
from cutvib_ss.measurement.sweep_direction import direction_of
from tests.unit.struck_oscillator import OSCILLATOR

FS = 1000.0


def _blows(*peaks, stated=None, kind="impact", offset=0.0):
    pulse = np.zeros(200)
    pulse[20:25] = [0.3, 0.8, 1.0, 0.8, 0.3]
    histories = tuple(History(FS, offset + p * pulse, np.zeros((1, 200)), ("a",)) for p in peaks)
    return Record("r", kind, 0.5, stated, None, ("a",), ("acceleration",), histories)


def test_blows_of_a_hand_make_levels():
    records = [_blows(14, 15, 17), _blows(48, 55, 50), _blows(16.5), _blows(150, 149), _blows(44)]
    assert levels_of(records) == [15.75, 47.0, 15.75, 149.5, 47.0]


def test_a_stated_level_goes_before_the_blows():
    assert levels_of([_blows(14, 16, stated=20.0)]) == [20.0]
    # What was struck as hard in another record is that level, too.
    assert levels_of([_blows(49.0), _blows(52.0, stated=50.0)]) == [50.0, 50.0]


def test_a_row_of_levels_is_not_one():
    """Hits that grow by a tenth from record to record are two levels in the end, neither of which spans half as much again."""
    peaks = 20.0 * 1.1 ** np.arange(9)
    found = levels_of([_blows(p) for p in peaks])
    assert len(set(found)) == 2
    for level in set(found):
        own = [p for p, other in zip(peaks, found, strict=True) if other == level]
        assert max(own) / min(own) < 1.5


def test_recordings_state_their_level_for_tables_alone():
    rng = np.random.default_rng(0)
    history = History(FS, 5.0 + 2.0 * rng.standard_normal(40_000), np.zeros((1, 40_000)), ("a",))
    record = replace(_blows(1.0), kind="timeseries", histories=(history,))
    # Of Gaussian noise 3.29 standard deviations, whatever force holds it in place.
    assert own_level(record) == pytest.approx(6.58, rel=0.05)
    assert levels_of([record]) == [None]


def test_an_offset_is_no_blow():
    assert own_level(_blows(10.0, offset=3.0)) == pytest.approx(10.0)
    assert same_level(None, None)
    assert not same_level(None, 1.0)
    assert levels_of([_blows(0.0)]) == [None]


def _recorded(*shapes):
    """Recordings of an oscillator, each stated as of 10 N."""
    numerator, denominator, _ = signal.cont2discrete(([1.0], [1.0, 4.0, 1e4]), 1 / 500.0, "foh")
    records = []
    for k, shape in enumerate(shapes):
        force = 10.0 * shape
        shown = signal.lfilter(numerator.ravel(), denominator, force)
        shown = shown + 1e-3 * shown.std() * np.random.default_rng(k).standard_normal(force.size)
        history = History(500.0, force, shown[None], ("a",))
        records.append(
            Record(f"r{k}", "timeseries", None, 10.0, None, ("a",), ("displacement",), (history,), block=4.0)
        )
    return Campaign("", Path(), OSCILLATOR, tuple(records), ())


_T = np.arange(40_000) / 500.0
_UP, _NOISE = signal.chirp(_T, 5.0, _T[-1], 60.0), np.random.default_rng(0).standard_normal(_T.size) / 3.0


def test_a_sweep_does_not_repeat_noise_of_its_peak():
    """Two sweeps and noise: the sweeps are what repeats."""
    campaign = _recorded(_UP, _UP, _NOISE)
    found = summarise(campaign)
    assert [(pair.first, pair.second) for pair in found.repeated] == [("r0", "r1")]
    assert len(found.levels) == 2
    entries = observe(campaign, OSCILLATOR).entries
    assert repeatability(entries) == repeatability(entries[:2])
    assert np.isnan(repeatability(entries[1:]))


def test_a_sweep_down_does_not_repeat_one_up():
    """A machine that remembers differs between the two directions, and repeats for all that."""
    campaign = _recorded(_UP, _UP[::-1], _UP[::-1])
    found = summarise(campaign)
    assert [r.sweep for r in found.records] == ["up", "down", "down"]
    assert [(pair.first, pair.second) for pair in found.repeated] == [("r1", "r2")]
    assert [pair.row()[3] for pair in found.levels] == ["10 up and 10 down"] * 2
    entries = observe(campaign, OSCILLATOR).entries
    assert repeatability(entries) == repeatability(entries[1:])
    assert np.isnan(repeatability(entries[:2]))


@pytest.mark.parametrize("shape", ["linear", "logarithmic"])
def test_direction_of_a_sweep(shape):
    up = signal.chirp(_T, 4.0, _T[-1], 150.0, shape)
    quiet = np.zeros(5_000)
    assert direction_of([up]) == direction_of([np.concatenate([quiet, up]), up]) == "up"
    assert direction_of([up[::-1]]) == "down"
    both = np.concatenate([up, up[::-1]])
    for other in ([up, up[::-1]], [both], [_NOISE], [np.sin(2 * np.pi * 50.0 * _T)], [up[:100]], []):
        assert direction_of(other) is None


def _summary(repeated, levels):
    def pairs(differences):
        return tuple(
            PairSummary("a", "b", 0.5, (10.0, 50.0), d, 10.0 if d > 0.0 else 1.0, {"x": d}, "x") for d in differences
        )

    return Summary("t", "N", (), pairs(repeated), pairs(levels), (), ())


def _depends(repeated, levels):
    return [s for s in _summary(repeated, levels).sentences() if "depends on the level" in s]


def test_levels_differ_by_more_than_records_of_one_level_do_by_chance():
    # One repetition tells little of how far others may differ: a pair at three times as much is nothing, seven at twenty times are.
    assert not _depends([0.01], [0.03, 0.0, 0.01, 0.005, 0.01, 0.0, 0.01])
    assert "in 7 of 7" in _depends([0.01], [0.2] * 7)[0]
    # Eight repetitions tell that.
    assert "in 1 of 3" in _depends([0.01] * 8, [0.05, 0.0, 0.01])[0]


def test_levels_that_nothing_repeats_are_not_said_to_depend():
    said = " ".join(_summary([], [0.03, 0.0]).sentences())
    assert "differ in 1 of 2 pairs of levels by more than noise, by 3 % at most" in said
    assert "measure one level twice" in said
    assert "No dependence" in " ".join(_summary([], [0.0, 0.0]).sentences())
