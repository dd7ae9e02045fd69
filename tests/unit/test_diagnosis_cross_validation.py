"""What a fit on few records leaves on others, and how sure it can be of them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.candidate_evidence import at_their_ends, of_held_force, out_of_tolerance
from cutvib_ss.diagnosis.discrepancy import features, pivots_beside, pivots_of, shapes_over
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records, merged
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.diagnosis.simulation import SimulatedProblem
from cutvib_ss.diagnosis.standing import shows_gap
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.errors import CouplingError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of
from tests.unit.test_diagnosis_simulation import NOISE as NOISE_OF_LAWS
from tests.unit.test_diagnosis_simulation import records as with_forces

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
            entry_of(
                i, y, 50.0, data + noise, size**2, FREQ, CHANNELS, ("acceleration",) * 3
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
            out += cross_validation.judge(MACHINE, cross_validation.folds(seen, None, 0), none, workers)
    return out


def test_a_cause_along_the_rail_errs_at_a_position_that_was_not_fitted_as_its_prior_says():
    near, far = measured(MACHINE, (0.1, 0.9), np.random.default_rng(2))
    problem = Problem(MACHINE, merged((near,)), Hypothesis((SupportCompliance("rail_ends", 1e7, 1e7),)))
    fitted = pivots_of(problem)
    beside = pivots_beside(fitted, far.group, problem)
    at = features(far.group, 0, problem)
    variance, known = (np.sum(shapes_over(p, *at) ** 2, axis=0) for p in (beside, fitted))
    assert known.max() < 0.1
    assert variance.min() > 0.97
    # What was inferred of the fitted position keeps its meaning, and that position needs nothing beside it.
    np.testing.assert_allclose(shapes_over(beside, *at)[: len(fitted)], shapes_over(fitted, *at), atol=1e-9)
    assert pivots_beside(fitted, near.group, problem) == fitted


def test_what_one_position_does_not_tell_is_no_error_of_the_model(two_positions):
    assert cross_validation.reduced_chi2(two_positions) == pytest.approx(1.0, abs=0.03)
    alone = [
        cross_validation.judged(j.entry, cross_validation.Shown(j.predicted, np.zeros(j.predicted.shape), None))
        for j in two_positions
    ]
    assert cross_validation.reduced_chi2(alone) > 1.05, (
        "the tuning was left uncertain: noise alone does not say by how much"
    )


@pytest.mark.parametrize("failing", ["fit", "predicted"])
def test_a_hypothesis_that_runs_away_predicts_nothing(monkeypatch, failing):
    seen = observations(measured(MACHINE, (0.1, 0.6), np.random.default_rng(4)))
    none = fit(MACHINE, Records(seen.entries), Hypothesis())

    def runs_away(*_, **__):
        raise CouplingError("no steady motion")

    monkeypatch.setattr(cross_validation, failing, runs_away)
    with Workers() as workers:
        for j in cross_validation.judge(MACHINE, cross_validation.folds(seen, None, 0), none, workers):
            assert j.error == pytest.approx(np.abs(j.entry.data).mean(axis=1))
            assert j.chi2.min() > 100.0
            assert j.log_density == pytest.approx(-j.chi2.sum() * j.entry.freq.size)


def left(shown, x, root, entry):
    """χ² per datum of each channel by the dense covariance of noise and prediction, moved along each column of a root."""
    weight = np.sqrt(2 / entry.variance)
    moved = np.array([(shown(x + r) - shown(x - r)) / 2 * weight for r in root.T])
    residual = (entry.data - shown(x)) * weight
    out = []
    for a, r in zip(np.moveaxis(moved, 1, 0), residual, strict=True):
        a, y = np.concatenate([a.real, a.imag], axis=1), np.append(r.real, r.imag)
        out.append(y @ np.linalg.solve(np.eye(y.size) + a.T @ a, y) / y.size)
    return np.array(out)


def uncertain(problem, x, root):
    """A fit of which the covariance is given, without drift and discrepancy."""
    none = Layout(problem.size, (), problem.channels, (), (), (), 1)
    return SimpleNamespace(x=x, spread=Spread(none, Sizes(), np.zeros(x.size), np.linalg.inv(root @ root.T)))


def test_a_prediction_is_as_uncertain_as_its_unknowns():
    rng = np.random.default_rng(0)
    entries = measured(MACHINE, (0.1, 0.6), rng)
    problem = Problem(MACHINE, merged(entries[:1]), Hypothesis())
    x = problem.start()
    root = 0.05 * rng.standard_normal((problem.size, problem.size)) / np.sqrt(problem.size)
    there = Problem(MACHINE, merged(entries[1:]), Hypothesis())

    def shown(x):
        return there.predictions(x)[0].data[0] * there.calibration_of(CHANNELS, FREQ, x)

    # What the unknowns may be off by, and by as much they are.
    off = x + 2.0 * root @ rng.standard_normal(problem.size)
    entry = entries[1].showing(entries[1].data + shown(off) - shown(x))
    seen = cross_validation.predicted(entry, MACHINE, 0.0, problem, x)
    found = cross_validation.judged(entry, seen, problem, uncertain(problem, x, root)).chi2
    np.testing.assert_allclose(found, left(shown, x, root, entry), rtol=0.01)
    assert np.all(cross_validation.judged(entry, seen).chi2 > 1.3 * found)


def test_a_law_is_as_uncertain_where_it_was_not_fitted():
    law = Hypothesis((CubicStiffness("joint2", 4e9),), {"joint2": 1e-4})
    problem = SimulatedProblem(MACHINE, with_forces(20.0, 60.0).apart_groups(), law)
    x = problem.start()
    (group,) = with_forces(40.0).apart_groups()

    def shown(x):
        return simulated(problem.applied(x), group).data[0]

    root = 1e-6 * np.eye(x.size)
    root[-1, -1] = 1e-4
    noise = np.random.default_rng(2).standard_normal((2, *group.data[0].shape)) * NOISE_OF_LAWS / np.sqrt(2)
    entry = group.entries[0][0].showing(shown(x + 2.0 * root[-1]) + noise[0] + 1j * noise[1])
    seen = cross_validation.Shown(shown(x), np.zeros(entry.data.shape), simulated(problem.applied(x), group))
    found = cross_validation.judged(entry, seen, problem, uncertain(problem, x, root)).chi2
    np.testing.assert_allclose(found, left(shown, x, root[:, -1:], entry), rtol=0.02)
    # The base hardly moves with the second joint.
    assert np.all(found[:2] < 0.1 * cross_validation.judged(entry, seen).chi2[:2])


def test_a_value_at_the_end_of_its_range_is_told():
    def found(gain):
        wrong = CalibrationError("measurement", "tool_x", gain).apply(MACHINE)
        entries = measured(wrong, (0.1, 0.6), np.random.default_rng(1))
        return fit(MACHINE, Records(entries), Hypothesis((CalibrationError("measurement", "tool_x", 1.1),)))

    inside, beyond = found(1.4), found(7.0)
    assert inside.at_end == ()
    assert at_their_ends(inside) == []
    assert beyond.at_end == ("0.gain",)
    assert at_their_ends(beyond) == [
        "gain of calibration_error at measurement = 5 is at its prior bound: the true value may lie "
        "beyond, or the cause be another"
    ]


def test_tuning_far_out_of_its_tolerance_is_told():
    heavier = ParameterShift("tool", "l2", 1.03).apply(MACHINE)
    light = CalibrationError("measurement", "tool_x", 1.07).apply(heavier)
    given, off = (
        fit(MACHINE, Records(measured(m, (0.1, 0.6), np.random.default_rng(1))), Hypothesis()) for m in (MACHINE, light)
    )
    assert out_of_tolerance(MACHINE, given) == []
    told = out_of_tolerance(MACHINE, off)
    # What moves farthest comes first.
    assert told[0].startswith("with this answer the gain or phase of tool_x is 7.")
    assert told[1].startswith("with this answer l2 of the head is 6.")
    assert all(line.endswith("a second cause may hide there, measure it by itself") for line in told)


def test_ends_that_are_limits_say_nothing():
    soft = SupportCompliance("rail_ends", 2e7, 1e12, 0.0, 0.0).apply(MACHINE)
    start = SupportCompliance("rail_ends", 2.1e7, 1e9, 0.0, 0.0)
    found = fit(MACHINE, Records(measured(soft, (0.1, 0.6), np.random.default_rng(1))), Hypothesis((start,)))
    assert found.hypothesis.effects[0].k_right > 4e8
    assert found.at_end == ()


def test_a_resonator_on_the_head_may_be_as_heavy_as_the_head():
    assert LocalResonator.ranges(MACHINE, "head")["mass"].high == MACHINE.head.m1
    assert LocalResonator.ranges(MACHINE, "tool")["mass"].high == 5.0


def test_lines_that_tell_nothing_need_no_variance_where_the_force_is_guessed():
    model = CubicStiffness("joint2", 1e9).apply(MACHINE)
    (e,) = with_forces(60.0).entries
    lost = np.zeros(e.data.shape, dtype=bool)
    lost[0, :5] = True
    seen = cross_validation.predicted(replace(e, lost=lost), model, 0.05)
    assert e.replay is not None
    assert e.replay.assumed
    assert np.all(np.isfinite(seen.variance))
    assert np.all(seen.variance[lost] == 0.0)
    assert np.all(seen.variance[~lost] > 0.0)


def test_a_lead_counts_by_how_many_data_tell_the_same():
    def ranked(evidence, correlation):
        return SimpleNamespace(
            refined=True, reduced=0.9, fit=SimpleNamespace(log_evidence=evidence, correlation=correlation)
        )

    none = ranked(0.0, 1.0)
    assert shows_gap([ranked(100.0, 1.0)], none)
    assert not shows_gap([ranked(100.0, 150.0)], none)
    assert shows_gap([ranked(100.0 * 150.0, 150.0)], none)


@pytest.mark.parametrize(
    ("channel", "delay", "std", "told"),
    [
        ("all", 2.51e-4, 5e-6, True),
        ("tool_x", 2.51e-4, 5e-6, False),
        ("all", 3e-4, 5e-6, False),
        ("all", 2.6e-4, 5e-5, False),
    ],
)
def test_a_delay_of_half_a_sample_may_be_a_force_that_is_held(channel, delay, std, told):
    fitted = SimpleNamespace(
        hypothesis=Hypothesis((ChannelDelay("measurement", channel, delay),)), stds={"0.delay": std}
    )
    entries = [SimpleNamespace(replay=SimpleNamespace(clock=2000.0, assumed=False))] * 2
    assert bool(of_held_force(fitted, entries)) is told
    assert not of_held_force(fitted, [SimpleNamespace(replay=None)])
