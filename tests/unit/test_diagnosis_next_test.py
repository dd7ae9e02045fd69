"""The record that would tell most."""

import numpy as np
import pytest

from cutvib_ss.diagnosis.next_test import next_test
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.measurement.replay import assumed_blow
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

MACHINE = published_machine()
FREQ = np.arange(20.0, 400.0, 1.0)
CHANNELS = ("tool_x", "base_x")


def record(level, position=0.5):
    data = np.ones((2, FREQ.size), dtype=complex)
    variance = np.full(data.shape, (0.05 / level) ** 2)
    replay = assumed_blow(FREQ, 1.0, 0.02, level)
    return entry_of(
        0, position, level, data, variance, FREQ, CHANNELS, ("acceleration",) * 2, block=1.0, blow_at=0.02, replay=replay
    )  # fmt: skip


def test_linear_causes_are_told_where_they_differ_most():
    models = [RailAddedMass("rail", y, 3.0, 1.0).apply(MACHINE) for y in (0.2, 0.8)]
    test = next_test(models, ["left", "right"], [record(20.0), record(80.0)])
    assert test.peak_force == 80.0
    at = {}  # in the middle both are alike
    for y in (0.5, test.position):
        a, b = (frequency_response(m, [y], FREQ, outputs=[test.channel]).data for m in models)
        at[y] = np.sum(np.abs(a - b) ** 2)
    assert at[test.position] > 100 * at[0.5]
    assert "left" in test.why
    assert "right" in test.why


@pytest.mark.parametrize(("other", "level"), [(None, 90.0), (DryFriction("joint2", 0.02), None)])
def test_level_matters_where_a_cause_depends_on_it(other, level):
    # A cubic spring shows at high levels what it hides at low ones; friction the other way round.
    cubic = CubicStiffness("joint2", 2e8).apply(MACHINE)
    rival = MACHINE if other is None else other.apply(MACHINE)
    test = next_test([cubic, rival], ["cubic", "rival"], [record(30.0)])
    assert test.peak_force == pytest.approx(level) if level else test.peak_force in (10.0, 90.0)


def test_odds_decide_which_pair_is_worth_telling():
    heavy, light = AddedMass("tool", 0.4).apply(MACHINE), AddedMass("tool", 0.39).apply(MACHINE)
    rail = RailAddedMass("rail", 0.3, 2.0, 1.0).apply(MACHINE)
    entries = [(given := record(50.0)).showing(given.data, np.full((2, FREQ.size), 1e-4))]
    likely = next_test([heavy, light, rail], ["a", "b", "c"], entries, [0.49, 0.49, 0.02])
    assert likely.channel == "tool_x"


def test_forms_of_one_cause_are_told_apart_only_where_nothing_else_is_left():
    near, far = (AddedMass("tool", mass).apply(MACHINE) for mass in (0.4, 0.1))
    rail = RailAddedMass("rail", 0.3, 2.0, 1.0).apply(MACHINE)
    entries = [record(50.0)]
    test = next_test([near, far, rail], ["a", "a", "b"], entries, [0.49, 0.49, 0.02])
    assert test.channel == next_test([near, rail], ["a", "b"], entries).channel
    assert test.why.startswith("tells a from b (expected")
    assert next_test([near, far], ["a", "a"], entries).why.startswith("tells two forms of a (expected")
