"""The evidence of a fit whose likelihood counts as a power, against the same integral of a Gaussian in closed form."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.likelihood import EVEN
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.tempered import tempered_evidence
from cutvib_ss.effects.parameter_shift import ParameterShift
from tests.unit.test_diagnosis_limits import MACHINE, measured

PRECISION = np.array([1.0, 1.0, 4.0, EVEN])


def of_line(heat: float) -> tuple[float, np.ndarray]:
    """Log evidence and optimum of 30 data that are linear in four unknowns, of which the last has an even prior."""
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(30, 4))
    data = slopes @ np.array([4.0, -1.0, 2.0, 0.5]) + rng.normal(size=30)
    prior = np.where(PRECISION == EVEN, 0.0, PRECISION)
    matrix, gradient = slopes.T @ slopes / heat, slopes.T @ data / heat
    x = np.linalg.solve(matrix + np.diag(prior), gradient)
    squares = data @ data / heat - gradient @ x
    determinant = np.linalg.slogdet(matrix + np.diag(PRECISION))[1] - np.sum(np.log(prior[prior > 0.0]))
    return -0.5 * (squares + determinant - np.log(2.0 * np.pi)), x


@pytest.mark.parametrize("heat", [1.0, 3.0, 18.0])
def test_it_is_the_integral_of_the_likelihoods_power_times_the_prior(heat: float) -> None:
    evidence, x = of_line(1.0)
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(30, 4))
    covariance = np.linalg.inv(slopes.T @ slopes + np.diag(PRECISION))
    fitted: Any = SimpleNamespace(
        x=x, precision=PRECISION, covariance=covariance, log_evidence=evidence, log_prior=0.5 * np.log(2.0 * np.pi)
    )
    assert tempered_evidence(fitted, heat) == pytest.approx(of_line(heat)[0], rel=1e-10)


def test_a_value_out_of_its_tolerance_costs_what_its_prior_says_however_many_residuals_tell_the_same() -> None:
    """Damping 6.8 tolerances off beside a window cost 1.3 nats in place of 23, since its residuals told the same 18 times over."""
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-4))
    wrong = ParameterShift("joint2", "k2", 1.06)
    records, _ = measured(3e-3, model=wrong.apply(steady))
    none, one = (fit(steady, records, h) for h in (Hypothesis(), Hypothesis((wrong,))))
    assert none.tuned_away
    # Both are one model: what tells them apart are the priors.
    assert none.chi2 == pytest.approx(one.chi2, rel=0.01)
    lead = one.log_evidence - none.log_evidence
    assert lead > SETTINGS.search_caught
    assert tempered_evidence(one, 10.0) - tempered_evidence(none, 10.0) > 0.7 * lead
    assert tempered_evidence(none, 1.0) == none.log_evidence
