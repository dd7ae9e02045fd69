"""Machines that move between sessions: how far, and what of it reaches the records."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("exudyn")

import cutvib_ss as cv
from cutvib_ss.validation.rig import draw_case, write_campaign
from cutvib_ss.validation.rig.campaign import Campaign
from cutvib_ss.validation.rig.repeatability import CUTTING_MACHINE, Repeatability, draw_repeatability, states

SMALL = {"positions": (0.2, 0.6), "levels": (50.0, 100.0), "blows": 1, "overloads": 0, "file_format": "tdms"}


def test_sessions_scatter_by_what_is_asked_and_records_of_one_session_share_it() -> None:
    sessions = tuple(np.repeat(np.arange(400), 2).tolist())
    drawn = states(Repeatability(drift=0.004), sessions, CUTTING_MACHINE, 3, seed=5)
    logs = {name: np.log([s.values[name] for s in drawn]) for name in drawn[0].values}
    assert np.std(logs["k1"][::2]) == pytest.approx(0.004, rel=0.12)
    assert np.std(logs["first_frequency"][::2]) == pytest.approx(0.002, rel=0.12)
    assert np.std(logs["c2"][::2]) == pytest.approx(0.04, rel=0.12)
    assert np.std(np.log([s.gains for s in drawn[::2]])) == pytest.approx(0.004, rel=0.12)
    assert all(np.array_equal(log[::2], log[1::2]) for log in logs.values())
    assert "m1" not in logs


def test_the_temperature_moves_stiffnesses_together_and_frequencies_half_as_far() -> None:
    drawn = states(Repeatability(temperature=0.02), tuple(range(6)), CUTTING_MACHINE, 3, seed=1)
    for s in drawn:
        assert s.values["k1"] == s.values["k2"] == pytest.approx(s.values["first_frequency"] ** 2)
        assert s.values["c1"] == 1.0
        assert s.gains == (1.0, 1.0, 1.0)
    assert drawn[0].values["k1"] == 1.0
    assert drawn[-1].values["k1"] == pytest.approx(np.exp(0.02))


def test_a_drifting_machine_changes_from_position_to_position_but_not_between_levels() -> None:
    case = draw_case(4, "none", conditions=SMALL)
    still = Campaign(case.rig, case.conditions, 4)
    moved = Campaign(case.rig, replace(case.conditions, repeatability=Repeatability(drift=0.01)), 4)
    change = [np.linalg.norm(moved.answer(i, 0)[1] - still.answer(i, 0)[1]) for i in range(4)]
    size = [np.linalg.norm(still.answer(i, 0)[1]) for i in range(4)]
    assert all(c > 0.01 * s for c, s in zip(change, size, strict=True))
    assert moved.states[0] == moved.states[1] != moved.states[2]


@pytest.mark.parametrize("stated", [0.004, None])
def test_the_drift_is_in_machine_toml_where_it_is_stated(stated: float | None, tmp_path: Path) -> None:
    conditions = SMALL | {"repeatability": Repeatability(drift=0.004, stated=stated)}
    write_campaign(draw_case(4, "none", conditions=conditions), tmp_path)
    assert cv.read_campaign(tmp_path).machine.tolerance.drift == stated


def test_drifts_are_of_a_tenth_of_a_percent_to_two_percent_and_rarely_of_ten() -> None:
    rng = np.random.default_rng(0)
    drawn = [draw_repeatability(rng, stated=i % 2 == 0) for i in range(600)]
    drifts = np.array([r.drift for r in drawn])
    assert drifts.min() >= 0.001
    assert drifts.max() <= 0.1
    assert 0.01 < np.mean(drifts > 0.02) < 0.08
    assert all((r.stated is not None) == (i % 2 == 0) for i, r in enumerate(drawn))
    told = np.log([r.stated / r.drift for r in drawn[::2]])
    assert np.std(told) == pytest.approx(0.2, rel=0.2), "what is stated is about right"


def test_about_every_other_drifting_case_states_it_and_drift_leaves_the_rest_of_the_case_alone() -> None:
    cases = [draw_case(seed, "single", "tool_contact", traits=("drifting",)) for seed in range(24)]
    assert 6 <= sum(c.conditions.repeatability.stated is not None for c in cases) <= 18
    plain = draw_case(3, "single", "tool_contact")
    assert cases[3].rig == plain.rig
    assert replace(cases[3].conditions, repeatability=Repeatability()) == plain.conditions


def test_some_drifting_machines_state_sessions_of_several_positions(tmp_path: Path) -> None:
    cases = [draw_case(seed, "single", "tool_contact", traits=("drifting",)) for seed in range(24)]
    stated = [c.conditions.repeatability for c in cases]
    assert 3 <= sum(r.days > 0 for r in stated) <= 12
    assert not any(r.days and r.stated is not None for r in stated)
    conditions = SMALL | {"positions": (0.2, 0.4, 0.6), "repeatability": Repeatability(drift=0.004, days=2)}
    write_campaign(draw_case(4, "none", conditions=conditions), tmp_path)
    told = [(r.position, r.session) for r in cv.read_campaign(tmp_path).records]
    assert dict(told) == {0.2: "day 1", 0.4: "day 1", 0.6: "day 2"}
    assert len(told) == 6
