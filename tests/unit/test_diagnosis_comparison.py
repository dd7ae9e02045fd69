"""Records on different line grids: compared at common lines, by interpolation, and where their blocks cut off unlike tails."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.comparison import compared
from cutvib_ss.diagnosis.linearity import level_stands_out, levels_compared
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Records, merged
from cutvib_ss.diagnosis.repeatability import repeatability
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.where import level_dependence
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import with_values
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

MACHINE = published_machine()
SOFTER = with_values(MACHINE, {("head", "k2"): 0.97 * MACHINE.head.k2})
CHANNELS = ("tool_x", "tool_z", "base_x")
RELATIVE = 0.01


def entry(number, freq, level, model=MACHINE, block=np.inf, **more):
    """A record of a machine at y/L = 0.4 with noise of a percent."""
    rng = np.random.default_rng(number)
    blank = entry_of(
        number, 0.4, level, np.zeros((3, freq.size), dtype=complex), np.ones((3, freq.size)), freq, CHANNELS,
        ("acceleration",) * 3, block=block, blow_at=0.05, **more,
    )  # fmt: skip
    (group,) = merged([blank])
    data = Prediction(model, group).data[0]
    variance = (RELATIVE * np.abs(data)) ** 2
    noise = np.sqrt(variance / 2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
    return blank.showing(data + noise, variance)


FINE, COARSE, ASIDE, NARROW = (
    np.arange(20.0, 400.0, 0.25), np.arange(20.0, 400.0, 1.0), np.arange(20.11, 400.0, 0.85), np.arange(150.0, 320.0, 0.25),
)  # fmt: skip


@pytest.mark.parametrize(("one", "other"), [(FINE, COARSE), (FINE, NARROW), (FINE, ASIDE), (COARSE, NARROW)])
def test_records_alike_differ_by_their_noise_whatever_their_lines(one, other):
    a, b = entry(0, one, 20.0), entry(1, other, 60.0)
    pair = compared(a, b)
    assert pair.channels == CHANNELS
    assert pair.freq.size == min(
        np.sum((f >= max(one[0], other[0])) & (f <= min(one[-1], other[-1]))) for f in (one, other)
    )
    assert pair.power.mean() == pytest.approx(1.0, abs=0.15)
    records = Records((a, b))
    assert len(records.merged) == 2
    assert levels_compared(records)
    assert not level_stands_out(records)
    assert level_dependence((a, b)) < SETTINGS.level_excess


@pytest.mark.parametrize(("one", "other"), [(FINE, COARSE), (FINE, NARROW), (FINE, ASIDE)])
def test_a_change_with_the_level_shows_across_grids(one, other):
    a, b = entry(0, one, 20.0), entry(1, other, 60.0, SOFTER)
    assert level_stands_out(Records((a, b)))
    assert level_dependence((a, b)) > SETTINGS.level_excess
    # Of one level it is no matter of the level.
    assert not level_stands_out(Records((a, replace(b, level=20.0))))
    assert not levels_compared(Records((a, replace(b, level=20.0))))


def test_other_inputs_and_sessions_are_not_compared():
    a, b = entry(0, FINE, 20.0), entry(1, COARSE, 60.0, SOFTER)
    assert not level_stands_out(Records((a, replace(b, response=replace(b.response, inputs="head_x")))))
    assert not level_stands_out(Records((replace(a, session="monday"), replace(b, session="friday"))))
    assert np.isnan(repeatability((a, replace(b, level=20.0, response=replace(b.response, inputs="head_x")))))


def test_blocks_of_unlike_length_lose_unlike_tails():
    short, long = np.arange(20.0, 400.0, 2.0), np.arange(20.0, 400.0, 0.5)
    a, b = entry(0, short, 20.0, block=0.5), entry(1, long, 60.0, block=2.0)
    assert compared(a, b) is None
    pair = compared(a, b, MACHINE, 0.0)
    # What the model's tail may be off by is allowed for.
    assert 0.6 < pair.power.mean() < 1.1
    # What the long block has and the short one lacks is many times the noise.
    assert np.mean(np.abs(a.data - b.data[:, ::4]) ** 2 / (a.variance + b.variance[:, ::4])) > 3.0
    assert not level_stands_out(Records((a, b)), MACHINE)
    changed = entry(1, long, 60.0, with_values(MACHINE, {("head", "k2"): 0.9 * MACHINE.head.k2}), block=2.0)
    assert level_stands_out(Records((a, changed)), MACHINE)


def test_channels_in_common():
    a, b = entry(0, FINE, 20.0), entry(1, COARSE, 60.0)
    less = replace(b, response=b.response.sel(output=["base_x", "tool_x"]))
    pair = compared(a, less)
    assert pair.channels == ("tool_x", "base_x")
    assert pair.power.mean() == pytest.approx(1.0, abs=0.15)
    assert compared(a, replace(less, response=replace(less.response, outputs=("p", "q")))) is None
    assert compared(a, replace(less, response=replace(less.response, quantities=("velocity",) * 2))) is None
    assert compared(a, entry(1, np.arange(500.0, 600.0, 1.0), 60.0)) is None


def test_interpolation_owns_up_to_what_it_misses():
    # Lines as wide as the resonance: the spline is off by many times the noise, and says so.
    wide, other = np.arange(20.0, 400.0, 4.0), np.arange(21.3, 400.0, 4.7)
    a, b = entry(0, wide, 20.0), entry(1, other, 60.0)
    truth = frequency_response(MACHINE, [0.4], other).data[0, :, 0]
    pair = compared(a, b)
    inside = (other >= wide[0]) & (other <= wide[-1])
    missed = np.abs(pair.data[0] - truth[:, inside]) ** 2
    assert np.max(missed / (RELATIVE * np.abs(truth[:, inside])) ** 2) > 20.0
    assert np.mean(missed > 9.0 * pair.variance[0]) < 0.05
    assert not level_stands_out(Records((a, b)))


def test_repeatability_of_records_on_different_grids():
    a, b = entry(0, FINE, 20.0), entry(1, COARSE, 20.0)
    assert repeatability((a, b)) < 0.6 * RELATIVE
    moved = with_values(MACHINE, {("head", "k2"): 1.01 * MACHINE.head.k2})
    same = repeatability((a, entry(1, FINE, 20.0, moved)))
    assert same > 2 * RELATIVE
    assert repeatability((a, entry(1, COARSE, 20.0, moved))) == pytest.approx(same, rel=0.15)


def test_merged_records_are_one_measured_response():
    a, b = (entry(k, COARSE, 20.0, block=2.0) for k in (0, 1))
    (group,) = merged([a, b])
    both = group.entry(0)
    np.testing.assert_array_equal(both.data, group.data[0])
    assert both.response.averages == 2
    assert both.estimator == a.estimator
    assert both.position == 0.4
    assert replace(a, response=replace(a.response, positions=np.nan)).position is None


def test_tails_of_blows_at_unlike_instants_are_no_effect_of_the_level():
    def struck(number, level, at, model=MACHINE):
        """A record whose block of 0.8 s begins so long before the blow: the rail's first mode is cut off at another phase."""
        blank = entry(number, FINE, level, model, block=0.8)
        response = blank.response
        moved = replace(blank, response=replace(response, estimator=replace(response.estimator, blow_at=at)))
        shown, before = (Prediction(model, e.group).data[0] for e in (moved, blank))
        return moved.showing(moved.data + shown - before)

    a, b, softer = struck(0, 20.0, 0.05), struck(1, 60.0, 0.061), struck(1, 60.0, 0.061, SOFTER)
    assert len(Records((a, b)).merged[0].data) == 1
    assert level_stands_out(Records((a, b)))
    assert not level_stands_out(Records((a, b)), MACHINE)
    assert level_stands_out(Records((a, softer)), MACHINE)
