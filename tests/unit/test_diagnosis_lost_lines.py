"""Lines that a converter has spoilt: left out of fits and of what is judged, wherever they lie."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import SPOILT, observe
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.stepping import modal_form, step
from tests.unit.test_diagnosis_unknown_sites import FREQ, records

MACHINE = published_machine()
LOW = FREQ < 120.0


def spoilt(measured: Records, which: tuple[int, ...]) -> Records:
    """The same with the lower lines of the first channel three times too large, and known to be lost."""
    out = []
    for i, e in enumerate(measured.entries):
        data, lost = e.data.copy(), np.zeros(e.data.shape, dtype=bool)
        if i in which:
            data[0, LOW] *= 3.0
            lost[0, LOW] = True
        out.append(replace(e.showing(data), lost=lost))
    return Records(tuple(out))


def twice(measured: Records) -> Records:
    """Every record, and another of the same position."""
    more = [replace(e, record=e.record + len(measured.entries)) for e in measured.entries]
    return Records((*measured.entries, *more))


@pytest.mark.parametrize("which", [(0, 1, 2), (0, 1, 2, 3, 4, 5)], ids=["beside good ones", "alone"])
def test_a_fit_does_not_see_lost_lines(which: tuple[int, ...]) -> None:
    measured = twice(records(MACHINE))
    wrong = spoilt(measured, which)
    (good,), (bad,) = measured.merged, wrong.merged
    # What a good record beside it tells is all that is told; where there is none, nothing is.
    assert np.isfinite(bad.variance[:, 0, LOW]).all() == (len(which) == 3)
    assert np.array_equal(good.data[:, 1], bad.data[:, 1])
    assert np.allclose(good.data[:, 0, ~LOW], bad.data[:, 0, ~LOW])
    found, right = fit(MACHINE, wrong, Hypothesis()), fit(MACHINE, measured, Hypothesis())
    assert found.count == right.count - 2 * len(which) * np.count_nonzero(LOW)
    assert found.reduced == pytest.approx(1.0, abs=0.15)
    assert np.abs(found.x[: found.n_tuning] - right.x[: found.n_tuning]).max() < 0.5
    problem = Problem(MACHINE, wrong.merged, Hypothesis())
    first = wrong.entries[0]
    seen = cross_validation.predicted(first, found.model, problem.blow_at(found.x), problem, found.x)
    judged = cross_validation.judged(first, seen, problem, found)
    assert judged.chi2 == pytest.approx(np.ones(2), abs=0.6)
    assert np.isfinite([judged.floor, judged.log_density]).all()


def digitised(size: float) -> Campaign:
    """Blows on the machine at one position, whose responses were rounded to steps."""
    form = modal_form(MACHINE, 0.3, ("tool_x", "tool_z"))
    fs, count = 2000.0, 4000
    force = np.zeros((3, count))
    pulse = np.sin(np.pi * np.arange(9) / 8)
    for k, peak in enumerate((40.0, 50.0, 60.0)):
        force[k, 100 + 3 * k : 109 + 3 * k] = peak * pulse
    responses = size * np.round(step(form, force, fs, ()).responses / size)
    histories = tuple(
        History(fs, f, a, ("tool_x", "tool_z"), f"blow {k + 1}")
        for k, (f, a) in enumerate(zip(force, responses, strict=True))
    )
    record = Record("r", "impact", 0.3, 50.0, None, ("tool_x", "tool_z"), ("acceleration",) * 2, histories, averages=3)
    return Campaign("", Path(), MACHINE, (record,))


def test_what_the_steps_of_a_converter_spoil_is_left_out_and_said() -> None:
    coarse, fine = observe(digitised(1.0), MACHINE), observe(digitised(1e-3), MACHINE)
    (e,) = coarse.entries
    assert e.lost is not None
    assert 0.0 < e.lost.mean() < 1.0
    assert any(SPOILT in w for w in coarse.warnings)
    (untouched,) = fine.entries
    assert untouched.lost is None
    assert not any("converter" in w for w in fine.warnings)
    # Coarser steps spoil more.
    (worse,) = observe(digitised(2.0), MACHINE).entries
    assert worse.lost is not None
    assert worse.lost.mean() > e.lost.mean()
