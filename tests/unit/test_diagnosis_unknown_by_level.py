"""What is unknown and depends on the level: recovered by level, derivatives, and told from what is the same at all levels."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import confounded, drift_for_levels
from cutvib_ss.diagnosis.ranking import some
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.unknown_by_level import ByLevelProblem
from cutvib_ss.diagnosis.unknown_element import UnknownElement, UnknownForce, UnknownSensor
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

FREQ = np.linspace(100.0, 300.0, 60)
LEVELS = (10.0, 100.0)


def records(by_level: dict[float, float]) -> Records:
    """Two positions, two levels; a joint whose stiffness differs by level, with noise of half a percent."""
    machine, rng, entries = published_machine(), np.random.default_rng(3), []
    for i, position in enumerate((0.3, 0.6)):
        for j, level in enumerate(LEVELS):
            true = machine.replace(k2=machine.head.k2 * (1.0 + by_level[level]))
            data = frequency_response(true, [position], FREQ, outputs=["tool_x"]).data[0, :, 0]
            size = 0.005 * np.abs(data)
            noise = size / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
            entries.append(
                entry_of(2 * i + j, position, level, data + noise, size**2, FREQ, ("tool_x",), ("acceleration",),
                      blow_at=0.0)
            )  # fmt: skip
    return Records(tuple(entries))


def element(kind: type) -> Hypothesis:
    machine = published_machine()
    return Hypothesis((kind("joint2", "joint2", 0.03 * machine.head.k2, 100.0, 300.0),))


def sensor(channel: str) -> Hypothesis:
    return Hypothesis((UnknownSensor("measurement", channel, 0.1, 100.0, 300.0),))


@pytest.mark.parametrize("hypothesis", [element(UnknownForce), sensor("tool_x"), sensor("all")])
def test_derivatives_are_differences(hypothesis: Hypothesis) -> None:
    problem = problem_for(published_machine(), records({10.0: 0.0, 100.0: 0.05}), hypothesis)
    assert isinstance(problem, ByLevelProblem)
    x = 0.3 * np.random.default_rng(0).standard_normal(problem.size)
    p = problem.predictions(x)[0]
    slopes = problem._slopes(x, p)
    for i in (0, problem.first_effect, problem.first_effect + 5, problem.size - 1):
        moved = x.copy()
        moved[i] += 1e-5
        change = (problem.predictions(moved)[0].data - p.data) / 1e-5
        at = i if i < problem.n_tuning else i - problem.n_calibration
        assert slopes[at] == pytest.approx(change, rel=1e-3, abs=1e-3 * np.abs(change).max() + 1e-9)


def test_it_takes_up_what_differs_by_level_and_nothing_else_does() -> None:
    apart = records({10.0: 0.0, 100.0: 0.05})
    by_level, alike = (fit(published_machine(), apart, element(kind)) for kind in (UnknownForce, UnknownElement))
    assert by_level.reduced < 1.1
    assert by_level.log_evidence > alike.log_evidence + 100.0
    problem = problem_for(published_machine(), apart, by_level.hypothesis)
    stiffness = []
    for group in problem.groups[:2]:
        attached = problem.model_of(by_level.x, group).attachments[-1].element
        stiffness.append(attached.dynamic_stiffness(np.array([2j * np.pi * 215.0]))[0])
    own = published_machine().head.k2
    assert (stiffness[1] - stiffness[0]).real == pytest.approx(0.05 * own, rel=0.1)


def test_a_sensor_that_saturates_is_told_from_a_restoring_force() -> None:
    apart = records({10.0: 0.0, 100.0: 0.0})
    saturating = [
        replace(e, response=replace(e.response, data=e.response.data * (1.0 if e.level == 10.0 else 0.92)))
        for e in apart.entries
    ]
    measured = Records(tuple(saturating))
    own, force = (fit(published_machine(), measured, h) for h in (sensor("tool_x"), element(UnknownForce)))
    assert own.reduced < 1.1
    assert own.log_evidence > force.log_evidence + 100.0


def test_where_levels_agree_it_pays_for_its_freedom() -> None:
    same = records({10.0: 0.05, 100.0: 0.05})
    by_level, alike = (fit(published_machine(), same, element(kind)) for kind in (UnknownForce, UnknownElement))
    assert alike.log_evidence > by_level.log_evidence


def test_records_of_all_levels_are_scanned() -> None:
    apart = records({10.0: 0.0, 100.0: 0.05}).entries
    more = tuple(
        replace(e, record=4 + e.record, response=replace(e.response, positions=e.position + 0.1)) for e in apart
    )
    kept = some(Records(apart + more))
    assert sorted(e.level for e in kept.entries) == [10.0, 10.0, 100.0, 100.0]
    assert len({e.position for e in kept.entries}) == 4


def test_a_level_that_was_measured_again_is_scanned_once() -> None:
    apart = records({10.0: 0.0, 100.0: 0.05}).entries
    again = tuple(replace(e, record=4 + e.record, level=1.3 * (e.level or 0.0), session="b") for e in apart)
    place = {e.position for e in apart}
    assert len(some(Records(apart + again)).entries) == 2 * len(place)
    # What tells no level may have been driven by any.
    untold = tuple(replace(e, level=None) for e in apart[:1]) * 3
    assert len(some(Records(untold)).entries) == 3


def test_a_level_for_each_session_is_confounded() -> None:
    apart = records({10.0: 0.0, 100.0: 0.05})
    assert not confounded(apart)
    named = tuple(replace(e, session="quiet" if e.level == LEVELS[0] else "loud") for e in apart.entries)
    assert confounded(Records(named))


@pytest.mark.parametrize(("louder", "hidden"), [(3.0, True), (1.0, False)])
def test_of_continuous_records_the_force_tells_the_level_in_which_drift_may_hide(louder: float, hidden: bool) -> None:
    noise = np.random.default_rng(1).standard_normal(256)
    apart = records({10.0: 0.0, 100.0: 0.05})
    continuous = []
    for k, e in enumerate(apart.entries):
        force = noise if e.level == LEVELS[0] else louder * noise
        replay = Replay((force,), 256.0, np.arange(100), block=64)
        continuous.append(replace(e, level=None, session=f"run {k}", replay=replay))
    assert confounded(Records(tuple(continuous))) is hidden
    # Sessions that drift by half a percent; less than machines do hides nothing.
    for drift, looked_for in ((5e-3, hidden), (1e-3, False)):
        tuned: Any = SimpleNamespace(spread=SimpleNamespace(sizes=SimpleNamespace(drift=drift)))
        assert drift_for_levels(tuned, Records(tuple(continuous))) is looked_for


def test_a_machine_that_moves_between_levels_of_a_session_is_followed() -> None:
    machine = published_machine()
    for moved, gains in ((0.004, True), (0.0, False)):
        own = records({10.0: 0.0, 100.0: moved})
        steady, apart = (fit(machine, replace(own, moving=moving), Hypothesis()) for moving in (False, True))
        assert (apart.log_evidence > steady.log_evidence + 3.0) is gains
        # Records by themselves that do not move tell the same as merged ones, but for the prior of not moving.
        if not gains:
            assert abs(apart.log_evidence - steady.log_evidence) < 1.5
            assert apart.spread.sizes.within < 1e-4
        assert apart.reduced == pytest.approx(1.0, abs=0.1)


def test_a_record_that_moves_far_is_followed_beyond_first_order() -> None:
    machine, wide = published_machine(), replace(records({10.0: -0.01, 100.0: 0.03}), moving=True)
    found = fit(machine, wide, Hypothesis())
    assert found.reduced == pytest.approx(1.0, abs=0.1)
    lay = found.spread.layout
    drifts = found.spread.drifts(lay.sessions, lay.records, len(lay.drifting))[len(lay.sessions) :, 1]  # of k2
    np.testing.assert_allclose(drifts[1::2] - drifts[::2], 0.04, atol=0.008)
