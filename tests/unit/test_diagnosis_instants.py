"""Estimated responses that do not state when the blow fell: the instant is found, whatever a discrepancy takes up before."""

from dataclasses import replace

import pytest

from cutvib_ss.diagnosis.fit import fit, led_by_the_model
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.measurement.estimation import estimate
from tests.unit.struck_oscillator import OSCILLATOR, struck

STRUCK = 0.053


@pytest.mark.parametrize("damping", [8.0, 8.6])
def test_the_model_leads_to_the_instant_where_a_discrepancy_does_not(damping: float) -> None:
    histories = struck(damping=damping, noise=(2e-3, 0.05)).records
    records = [
        replace(r, kind="frf", frf=estimate(r), histories=(), excitation="impact", averages=3) for r in histories
    ]
    campaign = replace(struck(), records=tuple(records))
    seen = Records(observe(campaign, OSCILLATOR).entries)
    made = fit(OSCILLATOR, seen, Hypothesis())
    found = led_by_the_model(OSCILLATOR, seen, made)
    problem = problem_for(OSCILLATOR, seen, Hypothesis())
    off, before = (abs(problem.blow_at(f.x) - STRUCK) for f in (found, made))
    assert found.log_evidence > made.log_evidence + 2.0
    assert off < 1e-3 < before
