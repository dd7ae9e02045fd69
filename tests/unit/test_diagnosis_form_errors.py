"""Errors of a restoring force's form: what they do to records, and what they leave of the model's other discrepancies."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis import climb, form_errors
from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.form_errors import form_of, scaled
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.diagnosis.simulation import SimulatedProblem, problem_for
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from tests.unit.test_diagnosis_simulation import MACHINE, measured, records

DAMPER = QuadraticDamping("joint2", 2.0)


def problem_at(cause, *levels):
    problem = problem_for(MACHINE, records(*levels), Hypothesis((cause,)))
    assert isinstance(problem, SimulatedProblem)
    x = problem.start()
    return problem, x, problem.predictions(x)


def test_a_form_errs_by_as_much_at_each_amplitude() -> None:
    problem, _, predictions = problem_at(CubicStiffness("joint2", 4e9), 10.0, 60.0)
    springs = [
        e.restoring_force
        for e in problem.form_at(predictions)
        if e.law == "local_stiffness" and e.parameters["side"] > 0.0
    ]
    a = np.exp(np.linspace(np.log(springs[-1].displacement), np.log(springs[0].displacement), 50))
    around = [np.exp(-(np.log(a / f.displacement) ** 2)) for f in springs]
    assert np.sum(around, axis=0)[10:-10] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(
    ("cause", "rounded"), [(CubicStiffness("joint2", 4e9), 0.01), (DAMPER, 0.01), (DryFriction("joint2", 0.05), 0.05)]
)
def test_what_an_error_does_is_a_derivative(cause, rounded) -> None:
    """Of friction but for what the instants at which its force jumps are rounded by."""
    problem, x, predictions = problem_at(cause, 10.0, 60.0)
    form = problem.form_at(predictions)
    found = problem.form_errors(x, predictions, form)
    for k, error in enumerate(form):
        ends = []
        for part in (0.02, -0.02):
            models = [replace(p.model, nonlinear=(*p.model.nonlinear, scaled(error, part))) for p in predictions]
            ends.append([simulated(m, p.group).data for m, p in zip(models, predictions, strict=True)])
        slopes = np.concatenate([(a - b) / 0.04 for a, b in zip(*ends, strict=True)])
        own = np.array([found[e.record][k] for p in predictions for (e,) in p.group.entries])
        largest = max(np.linalg.norm(found[r]) for r in found)
        assert np.linalg.norm(own - slopes) < 0.2 * np.linalg.norm(slopes) + rounded * largest


def test_errors_are_columns_of_the_discrepancy() -> None:
    problem, x, predictions = problem_at(DAMPER, 10.0, 60.0)
    form = problem.form_at(predictions)
    errors = problem.form_errors(x, predictions, form)
    _, residuals, _ = problem.residuals(x)
    directions = Directions(problem, x, predictions, form=(form, errors))
    lay, rows = directions.layout, directions.flat()
    own = slice(lay.first_form, lay.first_residual)
    assert own.stop - own.start == len(form) == 4 * SETTINGS.discrepancy_amplitudes
    weight = predictions[0].group.weight[0]
    expected = errors[predictions[0].group.entries[0][0].record][1] * weight
    assert rows[own][1][: expected.size] == pytest.approx(expected.real.ravel())
    matrix, _ = directions.normal(residuals)
    size = np.sqrt(np.sum(rows**2, axis=1))
    size[size == 0.0] = 1.0
    np.testing.assert_allclose(matrix / np.outer(size, size), rows @ rows.T / np.outer(size, size), atol=1e-9)


def test_a_damper_of_another_form_errs_in_its_force(monkeypatch: pytest.MonkeyPatch) -> None:
    """A damper with some friction, fitted as a damper: the error is one of the force rather than of the machine."""
    truth = DryFriction("joint2", 0.01).apply(DAMPER.apply(MACHINE))
    seen = measured(records(10.0, 30.0, 60.0), truth)
    with_errors = fit(MACHINE, seen, Hypothesis((DAMPER,)))
    monkeypatch.setattr(climb.Climb, "take_form", lambda self, form=None: None)
    without = fit(MACHINE, seen, Hypothesis((DAMPER,)))
    assert with_errors.log_evidence > without.log_evidence + 20.0
    assert with_errors.spread.sizes.nominal <= without.spread.sizes.nominal


def test_nothing_errs_where_nothing_moves() -> None:
    assert form_of([]) == ()
    assert form_errors.form_of([simulated(MACHINE, g) for g in records(10.0).apart_groups()]) == ()
