"""Steps that are extrapolated, against a linear iteration."""

import numpy as np

from cutvib_ss.diagnosis.climb import Trail


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
