"""Drift within sessions that goes with the level, as a machine's that warms while each is measured from soft to hard."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.level_trend import about_sessions, evidence_of_trend
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from tests.unit.record_example import entry_of

FREQ, DATA, NOISE = np.arange(50.0, 60.0, 0.5), 40, 0.3
LEVELS = np.tile([10.0, 40.0, 160.0], 2)


def records(levels=LEVELS):
    """Two sessions of three levels each."""
    ones = np.ones((1, FREQ.size))
    return Records(
        tuple(
            entry_of(
                k, 0.1 + 0.2 * (k // 3), level, ones, ones, FREQ, ("a",), ("acceleration",), session=f"day {k // 3}"
            )
            for k, level in enumerate(levels)
        )
    )


def of_data(slope, seed):
    """What a linear fit with two drifting values finds in data of known derivatives, and what it gains by a slope exactly."""
    rng, layout = np.random.default_rng(seed), Layout(2, ((0.0,),), ("a",), (0, 1), (), (), 1, tuple(range(6)))
    rows = rng.standard_normal((layout.size, DATA)) / NOISE
    level = np.log(LEVELS) - np.repeat(np.log(LEVELS).reshape(2, 3).mean(axis=1), 3)
    level /= np.sqrt(np.mean(level**2))
    within = np.arange(layout.first_within, layout.first_nominal).reshape(6, layout.per_session)
    along = np.array([level @ rows[within[:, k]] for k in range(layout.per_session)])
    data = slope * along[0] + rng.standard_normal(layout.size) @ rows + rng.standard_normal(DATA)
    iid = np.eye(DATA) + rows.T @ rows
    exact = (
        stats.multivariate_normal(np.zeros(DATA), iid + along.T @ along).logpdf(data)
        - stats.multivariate_normal(np.zeros(DATA), iid).logpdf(data)
    )  # fmt: skip
    precision = np.eye(layout.size) + rows @ rows.T
    return Spread(layout, Sizes(), np.linalg.solve(precision, rows @ data), precision), float(exact)


@pytest.mark.parametrize("slope", [0.0, 0.5, 3.0])
@pytest.mark.parametrize("seed", [1, 2])
def test_evidence_is_that_of_the_model_with_a_slope_beside(slope, seed):
    spread, exact = of_data(slope, seed)
    part = SETTINGS.level_trend
    assert evidence_of_trend(spread, records()) == pytest.approx(np.log(1.0 - part + part * np.exp(exact)), abs=1e-6)
    assert exact < 5.0 or slope == 3.0


def test_without_levels_there_is_no_trend():
    spread, _ = of_data(3.0, 1)
    assert evidence_of_trend(spread, records(np.full(6, 10.0))) == 0.0
    unknown = records()
    assert (
        evidence_of_trend(
            spread, replace(unknown, entries=(replace(unknown.entries[0], level=None), *unknown.entries[1:]))
        )
        == 0.0
    )


def test_values_are_taken_about_their_session():
    np.testing.assert_allclose(about_sessions(np.array([1.0, 3.0, 10.0]), ["a", "a", "b"]), [-1.0, 1.0, 0.0])
