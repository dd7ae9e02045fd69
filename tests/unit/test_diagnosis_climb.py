"""Steps of a climb, against the quadratic that they are taken in, and a linear iteration."""

import numpy as np
import pytest

from cutvib_ss.diagnosis.climb import Beside, Climb
from cutvib_ss.diagnosis.drifted import problems_of
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.marginal import Marginal
from cutvib_ss.diagnosis.steps import Trail, bounded_step
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from tests.unit.test_diagnosis_work import MACHINE, records


def test_a_linear_iteration_is_followed_to_its_end() -> None:
    """Three factors, three steps remembered: the end is where they lead, whatever the factors."""
    rng = np.random.default_rng(0)
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    shrink, end = turn @ np.diag([0.3, 0.9, -0.6]) @ turn.T, np.array([1.0, -2.0, 0.5])
    trail, at = Trail(), np.zeros(3)
    for _ in range(3):
        step = (shrink - np.eye(3)) @ (at - end)
        trail.add(at, step)
        at = at + step
    assert np.linalg.norm(at - end) > 1.0
    ahead = trail.ahead(at, (shrink - np.eye(3)) @ (at - end), np.array([1.0, 10.0, 0.1]))
    assert ahead is not None
    np.testing.assert_allclose(ahead, end, atol=1e-9)


def test_without_steps_before_there_is_nothing_to_go_by() -> None:
    trail = Trail()
    assert trail.ahead(np.zeros(2), np.ones(2), np.ones(2)) is None
    trail.add(np.zeros(2), np.ones(2))
    assert trail.ahead(np.ones(2), np.full(2, 0.5), np.ones(2)) is not None
    trail.forget()
    assert trail.ahead(np.ones(2), np.ones(2), np.ones(2)) is None


def test_a_step_turns_at_the_first_bound_and_never_promises_a_loss() -> None:
    rng = np.random.default_rng(0)
    for _ in range(50):
        # A narrow valley, across which a step that is only cut off climbs.
        rows = rng.standard_normal((6, 6)) * 10.0 ** rng.uniform(-3, 3, 6)
        matrix, gradient = rows @ rows.T + 1e-3 * np.eye(6), rng.standard_normal(6)
        x, low, high = rng.uniform(-1.0, 1.0, 6), np.full(6, -1.0), np.full(6, 1.0)
        step = bounded_step(matrix, gradient, np.full(6, 1e-3), x, low, high)
        assert (x + step >= low - 1e-12).all()
        assert (x + step <= high + 1e-12).all()
        assert 2.0 * gradient @ step - step @ matrix @ step >= 0.0


def test_a_step_that_meets_no_bound_is_the_whole_one() -> None:
    matrix, gradient, far = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([0.3, -0.2]), np.full(2, 1e9)
    found = bounded_step(matrix, gradient, np.zeros(2), np.zeros(2), -far, far)
    np.testing.assert_allclose(found, np.linalg.solve(matrix, gradient), rtol=1e-9)


def test_a_step_gains_what_is_left_once_the_directions_have_followed() -> None:
    """Against the least squares in the directions, at both ends of the step."""
    rng = np.random.default_rng(0)
    rows, residual = rng.standard_normal((40, 7)), rng.standard_normal(40)
    matrix, gradient, step = rows.T @ rows + np.eye(7), rows.T @ residual, rng.standard_normal(3)
    marginal = Marginal(matrix, gradient, np.arange(3))

    def least(first: np.ndarray) -> float:
        left = residual - rows[:, :3] @ first
        fixed = left @ left + first @ first
        pull = rows[:, 3:].T @ left
        return float(fixed - pull @ np.linalg.solve(matrix[3:, 3:], pull))

    np.testing.assert_allclose(marginal.taken, residual @ residual - least(np.zeros(3)), rtol=1e-9)
    np.testing.assert_allclose(marginal.gain(step), least(np.zeros(3)) - least(step), rtol=1e-9)
    curvature = [2 * least(np.zeros(3)) - least(e) - least(-e) for e in np.eye(3)]
    np.testing.assert_allclose(marginal.diagonal, -0.5 * np.array(curvature), rtol=1e-9)
    np.testing.assert_allclose(marginal.log_determinant, np.linalg.slogdet(matrix[3:, 3:])[1], rtol=1e-9)


@pytest.mark.parametrize("before", [1e-9, 1e-7, 1e-3])
def test_a_step_that_gains_nothing_is_damped_far_enough_whatever_good_steps_came_before(
    monkeypatch: pytest.MonkeyPatch, before: float
) -> None:
    problems = problems_of(MACHINE, records(RailAddedMass("rail", 0.37, 1.5, 0.0).apply(MACHINE)), Hypothesis(), False)
    search = Climb(problems, problems[0].start(None), False, Beside(0.0, 0, True))
    search._linearise(search.at)
    tried: list[float] = []

    def step(matrix: np.ndarray, gradient: np.ndarray, damping: np.ndarray, *rest: np.ndarray) -> np.ndarray:
        tried.append(float(damping[0]))
        return bounded_step(matrix, gradient, damping, *rest)

    monkeypatch.setattr("cutvib_ss.diagnosis.climb.bounded_step", step)
    monkeypatch.setattr(Climb, "_moved_to", lambda self, there: False)
    assert search.at.quadratic is not None
    search._step(before, search.at.quadratic, Trail(), 0.1)
    assert tried == pytest.approx([before, 1e-2, 1.0, 1e3])
