"""What a diagnosis may compute: the same count in any number of processes, and what is left out once it is reached."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import unknown_candidates
from cutvib_ss.diagnosis.unknown_search import best_unknown
from cutvib_ss.diagnosis.work import counted, done
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

FREQ = np.linspace(60.0, 260.0, 40)
BAND = (60.0, 260.0)
CHANNELS = ("tool_x", "tool_z")
MACHINE = published_machine()


def records(true: Machine, gain: float = 0.0, positions: tuple[float, ...] = (0.3, 0.6)) -> Records:
    """Two positions with noise of half a percent, and an error of one channel that grows over the band."""
    rng, entries = np.random.default_rng(5), []
    for i, position in enumerate(positions):
        data = frequency_response(true, [position], FREQ, outputs=list(CHANNELS)).data[0, :, 0].copy()
        data[1] *= 1.0 + gain * (FREQ - 60.0) / 200.0
        size = 0.005 * np.abs(data)
        noise = size / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        entries.append(
            entry_of(i, position, 50.0, data + noise, size**2, FREQ, CHANNELS, ("acceleration",) * 2, blow_at=0.0)
        )
    return Records(tuple(entries))


def fitted(measured: Records, size: float) -> Fit:
    """A mass on the rail from some start."""
    return fit(MACHINE, measured, Hypothesis((RailAddedMass("rail", 0.37, size, 0.0),)), max_iterations=3)


def test_the_work_of_other_processes_counts() -> None:
    measured, spent = records(MACHINE), []
    for jobs in (1, 2):
        before = done()
        with Workers(jobs) as workers:
            workers.map(partial(fitted, measured), [0.5, 1.0, 2.0])
        spent.append(done() - before)
    assert spent[0] == spent[1] > 0.0


def test_twice_the_records_are_twice_the_work() -> None:
    measured = records(MACHINE)
    others = records(MACHINE, positions=(0.4, 0.7)).entries
    twice = Records((*measured.entries, *(replace(e, record=e.record + 2) for e in others)))
    one, two = (counted(partial(fit, max_iterations=0), MACHINE, r, Hypothesis())[1] for r in (measured, twice))
    assert two == pytest.approx(2.0 * one, rel=0.1)


def test_steps_are_left_out_once_the_limit_is_reached() -> None:
    said: list[str] = []
    with Workers(1, said.append, limit=1.0) as workers:
        assert workers.begin("first")
        fitted(records(MACHINE), 1.0)
        assert not workers.begin("second")
        assert not workers.begin("third", 10.0)
        # What matters more may begin when more is done.
        assert workers.begin("fourth", 1e12)
    assert said == ["first", "fourth"]
    assert list(workers.left_out) == ["second", "third"]


def test_first_order_tells_what_an_unknown_error_gains_beside_a_cause() -> None:
    measured = records(RailAddedMass("rail", 0.37, 1.5, 0.0).apply(MACHINE), 0.25)
    beside = fit(MACHINE, measured, Hypothesis((RailAddedMass("rail", 0.37, 1.0, 0.0),)))
    scan = Scan(MACHINE, measured, beside.hypothesis, beside.x, {}, apart=False)
    starts = {c.name: c.starts[0] for c in unknown_candidates(MACHINE, BAND, CHANNELS)}
    leads = {}
    for name in ("unknown channel tool_x", "unknown channel tool_z"):
        gain, evidence = scan.all_free(starts[name])
        both = fit(
            MACHINE, measured, Hypothesis((*beside.hypothesis.effects, starts[name])), beside.x[: beside.first_effect]
        )
        leads[name] = evidence, 2.0 * (both.log_evidence - beside.log_evidence)
        assert evidence < gain
    assert leads["unknown channel tool_z"][0] == pytest.approx(leads["unknown channel tool_z"][1], rel=0.5)
    assert leads["unknown channel tool_z"][0] > 2.0 * leads["unknown channel tool_x"][0]


def test_no_element_is_fitted_beside_a_cause_that_leaves_noise_alone() -> None:
    measured = records(RailAddedMass("rail", 0.37, 1.5, 0.0).apply(MACHINE))
    beside = fit(MACHINE, measured, Hypothesis((RailAddedMass("rail", 0.37, 1.0, 0.0),)))
    first = Hypothesis(beside.hypothesis.effects)
    both = [
        replace(first, effects=(*first.effects, e))
        for c in unknown_candidates(MACHINE, BAND, CHANNELS)
        for e in c.starts
    ]
    few = measured.coarse(SETTINGS.search_coarse_lines, 0.0)
    before = done()
    with Workers(1) as workers:
        assert best_unknown(MACHINE, measured, few, both, beside.x[: beside.first_effect], workers, beside=beside) == []
    spent = done() - before
    # To first order each costs one evaluation; three steps of each would be several.
    one = counted(partial(fit, max_iterations=0), MACHINE, few, both[0])[1]
    assert spent < 3.0 * len(both) * one
