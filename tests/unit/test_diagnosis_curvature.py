"""Derivatives of what a discrepancy takes up, against differences of all that is predicted; and where climbs end by them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from cutvib_ss.diagnosis.climb import Beside, Climb
from cutvib_ss.diagnosis.curvature import curvature_of
from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.drifted import problems_of
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from tests.unit.test_diagnosis_work import MACHINE, records

TRUE = RailAddedMass("rail", 0.37, 1.5, 50.0)


def test_derivatives_are_those_of_all_that_is_predicted() -> None:
    """To every unknown, calibration errors included: central differences of prediction and discrepancy together."""
    problem: Problem = problems_of(MACHINE, records(TRUE.apply(MACHINE)), Hypothesis((TRUE,)), True)[-1]
    x = problem.start(None)
    rng = np.random.default_rng(0)

    def directions_at(x: np.ndarray) -> tuple[Directions, list[np.ndarray]]:
        predictions, residuals, _ = problem.residuals(x)
        return Directions(problem, x, predictions), residuals

    directions, residuals = directions_at(x)
    lay = directions.layout
    assert lay.pivots
    coefficients = np.zeros(lay.size)
    coefficients[lay.first_nominal : lay.first_form] = 0.02 * rng.standard_normal(lay.first_form - lay.first_nominal)

    def predicted(x: np.ndarray) -> np.ndarray:
        there, left = directions_at(x)
        measured = np.concatenate([part for r in left for part in (r.real.ravel(), r.imag.ravel())])
        return np.asarray(coefficients @ there.flat() - measured)

    step = 1e-5 * np.eye(x.size)
    ways = np.array([(predicted(x + h) - predicted(x - h)) / 2e-5 for h in step])
    added = curvature_of(directions, [x] * len(problem.groups), coefficients)
    matrix, gradient = directions.normal(residuals, added)
    left = np.concatenate([part for r in residuals for part in (r.real.ravel(), r.imag.ravel())])
    # Of the last one, the damping of the mass, the weight in the cause's size moves with it.
    ways, n = ways[:-1], x.size - 1
    size = np.linalg.norm(ways, axis=1)
    np.testing.assert_allclose(matrix[:n, :n] / np.outer(size, size), ways @ ways.T / np.outer(size, size), atol=1e-3)
    np.testing.assert_allclose(gradient[:n] / size, ways @ left / size, atol=1e-3 * np.linalg.norm(left))
    # By much more than they differ from the plain ones.
    plain, _ = directions.normal(residuals)
    assert np.abs(plain[:n, :n] - matrix[:n, :n]).max() > 0.02 * np.abs(matrix[:n, :n]).max()
    assert curvature_of(directions, [x] * len(problem.groups), 1e-4 * coefficients) is None


def test_a_climb_ends_where_no_way_leads_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """A discrepancy takes up ends that resist turning; without its derivatives the steps end below the optimum."""
    measured = records(EndFixity("rail_ends", 5e3, 2e4).apply(MACHINE), positions=(0.2, 0.35, 0.5, 0.7))

    machine = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-5))

    def climbed() -> Climb:
        problems = problems_of(machine, measured, Hypothesis(), True)
        search = Climb(problems, problems[0].start(None), True, Beside(0.0, 0, True))
        search.climb(40, 1e-5)
        return search

    search = climbed()
    at = search.at

    def objective(step: np.ndarray) -> float:
        return search.evaluated(np.clip(at.x + step, search.low, search.high), at.drift).objective

    # By differences of the objective itself, tens of gradients of them.
    best = optimize.minimize(objective, np.zeros(at.x.size), method="L-BFGS-B", options={"maxfun": 3000})
    monkeypatch.setattr("cutvib_ss.diagnosis.climb.curvature_of", lambda *given: None)
    assert at.objective - best.fun < 1.0
    assert climbed().at.objective - best.fun > 20.0
