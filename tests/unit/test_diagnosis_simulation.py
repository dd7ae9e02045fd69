"""Causes that depend on the level: simulation through the estimator, its derivatives, forces that are guessed, second causes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cutvib_ss.diagnosis import scouting
from cutvib_ss.diagnosis.cross_validation import judged, predicted
from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.ranking import Ranked, by_their_names, sharpened
from cutvib_ss.diagnosis.records import Records, merged
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulated import _window, simulated
from cutvib_ss.diagnosis.simulation import SimulatedProblem, problem_for
from cutvib_ss.diagnosis.unknowns import to_unknown
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.window_damping import WindowDamping
from cutvib_ss.measurement.replay import assumed_blow
from cutvib_ss.model.machine import published_machine
from tests.unit.record_example import entry_of

MACHINE = published_machine()
FREQ = np.arange(20.0, 400.0, 2.0)
CHANNELS = ("tool_x", "tool_z", "base_x")
NOISE = 1e-3


def records(*levels, position=0.5):
    """Records without histories, whose responses are still to be filled in."""
    entries = []
    for i, level in enumerate(levels):
        empty = np.zeros((len(CHANNELS), FREQ.size), dtype=complex)
        entries.append(
            entry_of(
                i,
                position,
                level,
                empty,
                np.full(empty.shape, NOISE**2),
                FREQ,
                CHANNELS,
                ("acceleration",) * 3,
                block=0.5,
                blow_at=0.05,
                replay=assumed_blow(FREQ, 0.5, 0.05, level),
            )
        )
    return Records(tuple(entries))


def measured(empty, model, force_scale=None, seed=0):
    """The same with what a model shows, and noise."""
    (group,) = empty.apart_groups()
    shown = simulated(model, group, force_scale=force_scale).data
    rng = np.random.default_rng(seed)
    noise = NOISE / np.sqrt(2) * (rng.standard_normal(shown.shape) + 1j * rng.standard_normal(shown.shape))
    return Records(tuple(e.showing(d) for e, d in zip(empty.entries, shown + noise, strict=True)))


def test_without_a_law_the_simulation_is_the_closed_form():
    (group,) = merged(records(30.0).entries, apart=True)
    closed, stepped = Prediction(MACHINE, group, 0.05).data, simulated(MACHINE, group).data
    assert np.abs(stepped - closed).max() < 2e-3 * np.abs(closed).max()


@pytest.mark.parametrize("law", [CubicStiffness("joint2", 4e9), QuadraticDamping("joint2", 2.0)])
def test_derivatives_lead_where_differences_do(law):
    seen = records(10.0, 60.0)
    problem = problem_for(MACHINE, seen, Hypothesis((law,)))
    assert isinstance(problem, SimulatedProblem)
    x = problem.start()
    predictions, left, _ = problem.residuals(x)
    rows = Directions(problem, x, predictions, spread=False).flat()

    def flat(residuals):
        return np.concatenate([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in residuals])

    for i in (*range(problem.n_tuning), *range(problem.first_effect - len(problem.force_scaled), problem.size)):
        moved = x.copy()
        moved[i] += 0.02 if i < problem.n_tuning else 1e-3
        change = (flat(left) - flat(problem.residuals(moved)[1])) / (moved[i] - x[i])
        size = np.linalg.norm(change)
        if size > 1e-3 * np.linalg.norm(rows, axis=1).max():
            # Tuning moves the equivalent linear model, which holds the law's own stiffness still.
            alike = 0.95 if i < problem.n_tuning else 0.999
            assert change @ rows[i] > alike * size * np.linalg.norm(rows[i])


@pytest.mark.parametrize(("derivatives", "least", "most"), [("of all blows", 0.995, 1.0), ("no", 0.4, 0.98)])
def test_what_is_tuned_changes_a_sticking_joints_equivalent_stiffness_as_well(derivatives, least, most):
    """Derivatives of the equivalent stiffness, which they hold still, miss that; those by simulation do not."""
    problem = problem_for(MACHINE, records(20.0, 60.0, 150.0), Hypothesis((DryFriction("joint2", 0.1),)))
    problem.by_simulation = derivatives
    found = [alike for alike, _ in against_differences(problem)]
    assert least < min(found) <= most


def against_differences(problem):
    """Of each tuned value that matters, cosine and relative error of the derivative against a central difference."""
    x = problem.start()
    predictions, _, _ = problem.residuals(x)
    rows = [problem.jacobian(x, p) for p in predictions]
    largest = max(np.linalg.norm(row) for row in rows[0][: problem.n_tuning])
    found = []
    # Those of errors of parts, which are small, are of the equivalent stiffness in any case.
    for i in set(range(problem.n_tuning)) - set(problem.parts.all):
        there = [problem.residuals(x + step * np.eye(x.size)[i])[1][0] for step in (-0.15, 0.15)]
        change = (there[0] - there[1]) / 0.3
        size = np.linalg.norm(change)
        if size > 0.05 * largest:
            row = rows[0][i]
            alike = np.vdot(change, row).real / (size * np.linalg.norm(row))
            found.append((alike, np.linalg.norm(row - change) / size))
    assert len(found) > 3
    return found


def test_the_blow_of_middle_size_tells_more_of_a_record_than_its_first():
    """Blows of 0.5, 2 and 1 times a size: beside friction the machine answers each otherwise."""
    seen = records(60.0)
    (entry,) = seen.entries
    blow = entry.replay.forces[0]
    three = replace(entry.replay, forces=(0.5 * blow, 2.0 * blow, blow))
    assert three.middle == 2
    assert len(three.typical.forces) == 1
    assert three.typical.forces[0] is blow
    problem = problem_for(MACHINE, Records((replace(entry, replay=three),)), Hypothesis((DryFriction("joint2", 0.1),)))
    errors = {}
    for derivatives in ("of all blows", "of one blow", "no"):
        problem.by_simulation = derivatives
        errors[derivatives] = max(error for _, error in against_differences(problem))
    assert errors["of all blows"] < 0.1
    assert errors["of all blows"] < errors["of one blow"] < errors["no"]


def test_a_fit_of_friction_is_gone_on_with_by_all_blows():
    truth = DryFriction("joint2", 0.1)
    seen = measured(records(20.0, 60.0, 150.0), truth.apply(MACHINE))
    found = fit(MACHINE, seen, Hypothesis((DryFriction("joint2", 0.06),)), None, 15)
    assert found.derivatives == "of one blow"
    (on,) = sharpened(MACHINE, seen, [Ranked("dry_friction joint2", found, True)])
    assert on.fit.log_evidence >= found.log_evidence
    assert on.fit.derivatives == "of all blows"
    assert sharpened(MACHINE, seen, [on]) == [on]
    linear = Ranked("mass", replace(found, derivatives="no"), True)
    assert sharpened(MACHINE, seen, [linear]) == [linear]


def test_a_guessed_force_is_found_with_the_law():
    scales = np.array([1.25, 0.8])
    truth = CubicStiffness("joint2", 4e9)
    seen = measured(records(20.0, 60.0), truth.apply(MACHINE), scales)
    found = fit(MACHINE, seen, Hypothesis((CubicStiffness("joint2", 2e9),), {"joint2": 1e-4}))
    problem = problem_for(MACHINE, seen, found.hypothesis)
    assert len(problem.force_scaled) == 2
    assert found.reduced < 1.05
    # The law's size and all forces together cannot be told apart: motion goes with force, the cubic part with its square. The
    # ratio of the forces can, and the stiffness times the square of their mean.
    x = SETTINGS.simulation_force_scale * found.x[found.first_effect - 2 : found.first_effect]
    assert x[0] - x[1] == pytest.approx(np.log(scales[0] / scales[1]), abs=0.02)
    size = np.log(found.hypothesis.effects[0].stiffness3 / 4e9)
    assert size + 2 * x.mean() == pytest.approx(np.log(scales).sum(), abs=0.05)
    assert abs(size) < 3 * 2 * SETTINGS.simulation_force_scale / np.sqrt(2)


def test_the_corrected_model_with_a_law_is_the_closest_without_its_discrepancy():
    """A cubic fitted to a joint that is lossier at speed, too: the discrepancy takes that up, the corrected machine has none."""
    true = QuadraticDamping("joint2", 2e-3).apply(CubicStiffness("joint2", 2e9).apply(MACHINE))
    seen = measured(records(30.0, 100.0), true)
    found = fit(MACHINE, seen, Hypothesis((CubicStiffness("joint2", 1e9),)), None, SETTINGS.search_most_law_steps)
    problem = problem_for(MACHINE, seen, found.hypothesis)
    prior = problem.prior_precision()

    def squares(x):
        return problem.residuals(x)[2] + float(prior @ x**2)

    least = squares(found.corrected.x)
    # Far more than noise tells the two apart.
    assert squares(found.x) > least + 100.0
    for i in (*range(problem.n_tuning), problem.first_effect):
        for step in (-0.02, 0.02):
            moved = found.corrected.x.copy()
            moved[i] += step
            assert squares(moved) > least - 1.0
    assert found.corrected.hypothesis.effects[0].stiffness3 != found.hypothesis.effects[0].stiffness3


def test_a_held_out_record_lends_its_force_alone():
    law = CubicStiffness("joint2", 4e9).apply(MACHINE)
    (entry,) = measured(records(60.0), law, np.array([1.3])).entries
    problem = problem_for(MACHINE, Records((entry,)), Hypothesis())
    by_force = predicted(entry, law, 0.05, problem, problem.start())
    assert np.mean(np.abs(entry.data - by_force.data) ** 2) < 1.1 * NOISE**2
    # A smooth law does nearly the same under any blow of that size: what it changes cannot hide behind the force.
    changed = np.mean(np.abs(by_force.data - simulated(MACHINE, merged([entry])[0]).data[0]) ** 2)
    assert 0.0 < np.mean(by_force.variance) < 0.01 * changed
    certain = by_force._replace(variance=np.zeros(by_force.variance.shape))
    assert judged(entry, by_force).chi2.mean() < judged(entry, certain).chi2.mean()
    as_stated = simulated(law, merged([entry])[0]).data[0]
    assert np.mean(np.abs(entry.data - as_stated) ** 2) > 10 * NOISE**2


def test_linear_hypotheses_have_no_force_scale():
    seen = records(10.0, 60.0)
    assert problem_for(MACHINE, seen, Hypothesis()).force_scaled == ()
    apart = problem_for(MACHINE, seen, Hypothesis(), apart=True)
    assert isinstance(apart, SimulatedProblem)
    assert apart.force_scaled == ()


def test_forces_belong_to_their_records_however_these_are_grouped():
    one, two = (records(20.0, 60.0, position=y).entries for y in (0.2, 0.8))
    mixed = Records(tuple(replace(e, record=k) for k, e in enumerate((one[0], two[0], one[1], two[1]))))
    law, x = Hypothesis((CubicStiffness("joint2", 4e9),)), np.arange(4) / 10
    for by in (None, "session"):
        problem = problem_for(MACHINE, mixed, law, by=by)
        unknowns = problem.start()
        unknowns[problem.first_effect - 4 : problem.first_effect] = x
        factors = problem._force_scales(unknowns)
        found = {problem.groups[i].entries[row][0].record: factors[i][row] for i, row in problem.force_scaled}
        assert [found[k] for k in range(4)] == pytest.approx(np.exp(SETTINGS.simulation_force_scale * x))


def test_the_second_cause_promises_most():
    first, second = RailAddedMass("rail", 0.3, 3.0, 1.0), ChannelDelay("measurement", channel="all", delay=2e-4)
    seen = Records(
        tuple(e for y in (0.2, 0.5, 0.8) for e in measured(records(30.0, position=y), second.apply(first.apply(MACHINE))).entries)
    )  # fmt: skip
    base = fit(MACHINE, seen, Hypothesis((RailAddedMass("rail", 0.35, 2.0, 0.0),)))
    scan = Scan(MACHINE, seen, base.hypothesis, base.x, {}, apart=False)
    # A delay of nothing does nothing: it is moved off its start.
    promised, both = scan.promise([ChannelDelay("measurement", channel="all", delay=0.0)])
    other, *_ = scan.promise([RailAddedMass("rail", 0.6, 1.0, 0.0)])
    assert both.effect == "rail_added_mass+channel_delay"
    assert promised > 3 * other
    together = fit(MACHINE, seen, both, scan.warm)
    # What is left is how far the sampled blow is from the closed form.
    assert together.reduced < 2.0
    assert base.reduced > 10.0
    # A sensor's phase, which may err by a hundredth, leaves a part of a delay open.
    assert together.stds["1.delay"] < 0.05 * 2e-4
    assert abs(together.hypothesis.effects[1].delay - 2e-4) < 3 * together.stds["1.delay"]


def test_a_clearance_is_found_from_values_far_from_it():
    seen = measured(records(20.0, 60.0), Freeplay("joint2", 2.2e-5).apply(MACHINE))
    motion = {"joint2": 1e-4}
    from_afar = Hypothesis((Freeplay("joint2", 6e-6),), motion)
    caught = fit(MACHINE, seen, from_afar)
    assert caught.reduced > 10  # steps alone do not lead there
    scan = Scan(MACHINE, seen, Hypothesis(), None, motion, apart=True)
    tried = scan.promise([Freeplay("joint2", gap) for gap in (1e-6, 6e-6, 1.5e-5, 4e-5)])
    best = scan.refined(tried)
    assert best.gain > tried.gain
    assert best.hypothesis.effects[0].gap == pytest.approx(2.2e-5, rel=0.1)
    found = fit(MACHINE, seen, best.hypothesis)
    assert found.chi2 < 2.0 * found.count
    assert found.hypothesis.effects[0].gap == pytest.approx(2.2e-5, rel=0.02)


def test_a_law_is_promised_below_its_starts_and_with_the_other_sign():
    seen = measured(records(20.0, 60.0), CubicStiffness("joint2", -4e8).apply(MACHINE))
    scan = Scan(MACHINE, seen, Hypothesis(), None, {"joint2": 1e-4}, apart=True)
    starts = [CubicStiffness("joint2", k) for k in (1.2e9, 6e9)]
    assert all(scan.as_it_stands(e).gain < 0 for e in starts)
    best = scan.promise(starts)
    assert best.gain > 0.9 * (scan.leaves - scan.left.size)
    assert best.hypothesis.effects[0].stiffness3 == pytest.approx(-4e8, rel=0.2)
    # Damping that feeds energy is no law of the catalogue: turned round it promises nothing.
    undamped = scan.promise([QuadraticDamping("joint2", 0.5)])
    assert undamped.gain < best.gain


def test_a_faint_law_changes_the_response_in_proportion():
    """Friction a hundred times weaker than its starts: in each shape so weak that half of it does half."""
    seen = measured(records(20.0, 60.0), DryFriction("joint2", 1e-4).apply(MACHINE))
    scan = Scan(MACHINE, seen, Hypothesis(), None, {"joint2": 1e-4}, apart=True)
    starts = [*(DryFriction("joint2", r) for r in (0.03, 0.3)), *(JointSlip("joint2", k, 0.1, 0.5) for k in (1e2, 1e3))]
    found = [h for same in (starts[:2], starts[2:]) for h in scan.faint(same)]
    # Friction without a spring has one shape; slip at one torque has one for each stiffness.
    assert len(found) == 3
    for h in found:
        (effect,) = h.effects
        half = effect.changed({name: 0.5 * getattr(effect, name) for name in effect.strength})
        changes = []
        for e in (effect, half):
            problem = problem_for(MACHINE, seen, Hypothesis((e,), h.motions), apart=True)
            x = problem.start(scan.warm)
            for i, (_, name, r) in enumerate(problem.parameters):
                x[problem.first_effect + i] = to_unknown(getattr(e, name), r)
            changes.append(scan.change(problem, x)[2])
        assert changes[1] == pytest.approx(changes[0] / 4, rel=0.3)
        assert 0.0 < changes[0] <= 0.011 * scan.left.size
    assert scan.faint([Freeplay("joint2", 1e-5)]) == []


def test_friction_is_promised_far_below_its_starts():
    """Of a drive axis, friction of 1e-4 of its force was passed over: each of its starts is worse than none."""
    seen = measured(records(20.0, 60.0), DryFriction("joint2", 1e-4).apply(MACHINE))
    scan = Scan(MACHINE, seen, Hypothesis(), None, {"joint2": 1e-4}, apart=True)
    # One that hardly sticks does nothing, however strong.
    starts = [*(DryFriction("joint2", r) for r in (0.03, 0.3)), DryFriction("joint2", 0.01, 30.0)]
    assert all(scan.as_it_stands(e).gain < 0 for e in starts[:2])
    best = scan.promise(starts)
    assert best.gain > 0.5 * (scan.leaves - scan.left.size)
    assert best.hypothesis.effects[0].torque == pytest.approx(1e-4, rel=0.5)


@pytest.mark.parametrize(
    ("left", "noise", "beside", "softest"),
    [(0.5, False, True, [False]), (12.7, False, False, [False, True]), (12.7, True, False, [False, False])],
)
def test_restoring_forces_are_looked_for_beside_a_tuning_that_holds_on_few_lines(
    monkeypatch, left, noise, beside, softest
):
    """Else beside that to the softest level, unless the tuned model leaves noise on all lines."""
    given, at = [], []

    class Seen(Scan):
        def __init__(self, nominal, records, hypothesis, x, motion, apart, tuned=None):
            super().__init__(nominal, records, hypothesis, None, motion, apart, tuned=tuned)
            given.append(x)
            at.append(tuned is not None)
            self.underneath = None if x is None else SimpleNamespace(reduced=left)

    monkeypatch.setattr(scouting, "Scan", Seen)
    seen = measured(records(20.0, 60.0), CubicStiffness("joint2", 4e9).apply(MACHINE))
    warm = np.zeros(problem_for(MACHINE, seen, Hypothesis()).size)
    found = [Candidate("cubic_stiffness joint2", (CubicStiffness("joint2", 4e9),))]
    with Workers(1, None) as workers:
        ((_, best),) = scouting.scouted_laws(MACHINE, seen, found, {"joint2": 1e-4}, warm, workers, not noise)
    assert [x is not None for x in given] == ([True] if beside else [True, False])
    assert at == softest
    assert best.reduced < 1.5


@pytest.mark.parametrize("assumed", [True, False])
def test_a_window_that_nobody_took_out_acts_on_what_is_simulated(assumed):
    windowed = WindowDamping("measurement", 8.0).apply(MACHINE)
    entries = records(30.0).entries
    group = merged([replace(e, replay=replace(e.replay, assumed=assumed)) for e in entries], apart=True)[0]
    closed, stepped = Prediction(windowed, group, 0.05).data, simulated(windowed, group).data
    assert np.abs(stepped - closed).max() < 1e-2 * np.abs(closed).max()


def test_a_window_leaves_continuous_recordings_alone():
    entry = records(30.0).entries[0]
    continuous = replace(entry.replay, block=entry.replay.forces[0].size // 4)
    gain, window = _window(WindowDamping("measurement", 40.0).apply(MACHINE), continuous)
    assert gain == 1.0
    assert (window == 1.0).all()


def test_a_cause_that_is_another_within_its_deviation_goes_by_that_name():
    """Contacts in a joint of which nobody can tell that their slip torques differ are dry friction."""
    seen = measured(records(10.0, 60.0), DryFriction("joint2", 0.1, 900.0).apply(MACHINE))
    slip = fit(MACHINE, seen, Hypothesis((JointSlip("joint2", 900.0, 0.1, 0.2),)), None, 2)
    one = Ranked("joint_slip joint2", slip, True)
    told = {**slip.stds, "0.spread": 0.5 * slip.hypothesis.effects[0].spread}
    untold = replace(one, fit=replace(slip, stds={**told, "0.spread": 1.0}))
    assert by_their_names(MACHINE, seen, [replace(one, fit=replace(slip, stds=told))])[0].name == one.name
    (renamed,) = by_their_names(MACHINE, seen, [untold])
    assert renamed.name == "dry_friction joint2"
    assert renamed.fit.hypothesis.causes == (("dry_friction", "joint2"),)
    # Lengths and the joint's stiffness go with the torque: it ends where a fit from the true values does.
    best = fit(MACHINE, seen, Hypothesis((DryFriction("joint2", 0.1, 900.0),)), None, 15)
    assert renamed.fit.hypothesis.effects[0].torque == pytest.approx(best.hypothesis.effects[0].torque, rel=0.02)
    assert renamed.fit.log_evidence == pytest.approx(best.log_evidence, abs=1.0)
    # Where dry friction was fitted itself, it is one cause and not two.
    assert by_their_names(MACHINE, seen, [renamed, untold]) == [renamed]
