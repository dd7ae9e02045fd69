"""What a fit on few records leaves on others, and how sure it can be of them."""

import numpy as np
import pytest

from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.gap import shrinkage
from cutvib_ss.gap.candidate_evidence import at_their_ends, unspecific
from cutvib_ss.gap.fit import fit
from cutvib_ss.gap.hypothesis import Hypothesis
from cutvib_ss.gap.observations import Observations
from cutvib_ss.gap.problem import Problem
from cutvib_ss.gap.ranking import Ranked
from cutvib_ss.gap.records import Entry, Records, merged
from cutvib_ss.gap.simulation import SimulatedProblem, simulated
from cutvib_ss.gap.workers import Workers
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit.test_gap_simulation import records as with_forces

MACHINE = published_machine()
CHANNELS = ("tool_x", "tool_z", "base_x")
FREQ = np.arange(15.0, 450.0, 1.5)
NOISE = 0.003


def measured(machine, positions, rng):
    out = []
    for i, y in enumerate(positions):
        data = frequency_response(machine, [y], FREQ).data[0, :, 0]
        size = NOISE * np.abs(data).mean(axis=1, keepdims=True) * np.ones(FREQ.size)
        noise = (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) * size / np.sqrt(2)
        out.append(
            Entry(
                i, y, 50.0, data + noise, size**2, FREQ, CHANNELS, ("acceleration",) * 3, np.inf, np.nan, 0.0, False
            )
        )  # fmt: skip
    return tuple(out)


def observations(entries):
    return Observations(entries, (15.0, 450.0), CHANNELS, "m/s^2/N", 1.0)


@pytest.fixture(scope="module")
def two_positions():
    """Machines within their tolerances, each measured at two positions; each position predicted from the other."""
    rng = np.random.default_rng(4)
    problem = Problem(MACHINE, merged(measured(MACHINE, (0.1, 0.6), rng)), Hypothesis())
    out = []
    with Workers() as workers:
        for _ in range(4):
            scatter = np.zeros(problem.size)
            scatter[: problem.n_tuning] = rng.standard_normal(problem.n_tuning)
            seen = observations(measured(problem.tuned(scatter), (0.1, 0.6), rng))
            none = fit(MACHINE, Records(seen.entries), Hypothesis())
            out += shrinkage.judge(MACHINE, shrinkage.folds(seen, None, 0), none, workers)
    return out


def test_what_one_position_does_not_tell_is_no_error_of_the_model(two_positions):
    assert shrinkage.reduced_chi2(two_positions) == pytest.approx(1.0, abs=0.03)
    alone = [shrinkage.judged(j.entry, j.predicted) for j in two_positions]
    assert shrinkage.reduced_chi2(alone) > 1.05, "the tuning was left uncertain: noise alone does not say by how much"


def test_the_spread_of_a_prediction_is_that_of_the_unknowns():
    rng = np.random.default_rng(0)
    entries = measured(MACHINE, (0.1, 0.6), rng)
    problem = Problem(MACHINE, merged(entries[:1]), Hypothesis())
    (elsewhere,) = merged(entries[1:])
    x = problem.start()
    root = 0.05 * rng.standard_normal((problem.size, problem.size)) / np.sqrt(problem.size)
    there = Problem(MACHINE, (elsewhere,), Hypothesis())

    def shown(x):
        return there.predictions(x)[0].data * there.calibration_of(CHANNELS, FREQ, x)

    draws = np.array([shown(x + root @ rng.standard_normal(problem.size)) for _ in range(400)])
    spread = problem.spread(x, there.predictions(x)[0], root @ root.T)
    assert spread == pytest.approx(np.mean(np.abs(draws - shown(x)) ** 2, axis=0), rel=0.35)
    assert spread.sum() == pytest.approx(np.mean(np.abs(draws - shown(x)) ** 2, axis=0).sum(), rel=0.1)


def test_a_law_is_as_uncertain_where_it_was_not_fitted():
    law = Hypothesis((CubicStiffness("joint2", 4e9),), {"joint2": 1e-4})
    fitted, other = with_forces(20.0, 60.0), with_forces(40.0)
    problem = SimulatedProblem(MACHINE, fitted.apart, law)
    covariance = np.zeros((problem.size, problem.size))
    covariance[-1, -1] = 1e-3**2
    (group,) = other.apart
    x = problem.start()
    found = problem.spread(x, simulated(problem.applied(x), group), covariance)
    moved = x + np.eye(x.size)[-1] * 1e-3
    change = simulated(problem.applied(moved), group).data - simulated(problem.applied(x), group).data
    assert found.sum() == pytest.approx(np.sum(np.abs(change) ** 2), rel=0.05)


def test_a_value_at_the_end_of_its_range_is_told():
    def found(gain):
        wrong = CalibrationError("measurement", "tool_x", gain).apply(MACHINE)
        entries = measured(wrong, (0.1, 0.6), np.random.default_rng(1))
        return fit(MACHINE, Records(entries), Hypothesis((CalibrationError("measurement", "tool_x", 1.1),)))

    inside, beyond = found(1.4), found(7.0)
    assert inside.at_end == ()
    assert at_their_ends(inside) == []
    assert beyond.at_end == ("0.gain",)
    assert [unspecific(Ranked("", f, True)) for f in (inside, beyond)] == [False, True]
    assert at_their_ends(beyond) == [
        "gain of calibration_error at measurement = 5 lies at the end of what is believed of it: the true value may lie "
        "beyond, or the cause be another"
    ]


def test_ends_that_are_limits_say_nothing():
    soft = SupportCompliance("rail_ends", 2e7, 1e12, 0.0, 0.0).apply(MACHINE)
    start = SupportCompliance("rail_ends", 2.1e7, 1e9, 0.0, 0.0)
    found = fit(MACHINE, Records(measured(soft, (0.1, 0.6), np.random.default_rng(1))), Hypothesis((start,)))
    assert found.hypothesis.effects[0].k_right > 4e8
    assert found.at_end == ()
    assert not unspecific(Ranked("support_compliance", found, True))


def test_a_resonator_on_the_head_may_be_as_heavy_as_the_head():
    assert LocalResonator.ranges(MACHINE, "head")["mass"].high == MACHINE.head.m1
    assert LocalResonator.ranges(MACHINE, "tool")["mass"].high == 5.0
