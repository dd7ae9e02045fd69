"""Evidence that counts as a power but for the priors that all hypotheses share, against linear models in closed form."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.tempered import tempered_evidence
from cutvib_ss.effects.parameter_shift import ParameterShift
from tests.unit.test_diagnosis_limits import MACHINE, measured

PRECISION = np.array([1.0, 1.0, 4.0, 2.0])  # Of two unknowns of tuning, and of two of an effect
SHARED = np.array([True, True, False, False])


@pytest.mark.parametrize("heat", [1.0, 3.0, 18.0])
def test_priors_that_hypotheses_share_count_as_they_are_and_all_else_as_a_power(heat: float) -> None:
    rng = np.random.default_rng(0)
    slopes = rng.normal(size=(30, 4))
    data = slopes @ np.array([4.0, -1.0, 2.0, 0.5]) + rng.normal(size=30)

    def optimum(heat: float) -> tuple[float, np.ndarray]:
        whole = slopes.T @ slopes / heat + np.diag(PRECISION / np.where(SHARED, 1.0, heat))
        x = np.linalg.solve(whole, slopes.T @ data / heat)
        return -0.5 * (data @ data / heat - x @ whole @ x), x

    at_one, x = optimum(1.0)
    # Occam's factor is one of those things that count as a power.
    whole = slopes.T @ slopes + np.diag(PRECISION)
    occam = -0.5 * np.linalg.slogdet(whole)[1]
    fitted: Any = SimpleNamespace(
        x=x,
        covariance=np.linalg.inv(whole),
        log_evidence=at_one + occam,
        first_effect=2,
        shared_precision=PRECISION[SHARED],
    )
    assert tempered_evidence(fitted, heat) == pytest.approx(optimum(heat)[0] + occam / heat, rel=1e-10)


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
