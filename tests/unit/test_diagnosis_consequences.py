"""What a diagnosis means, on models whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.bands import bands
from cutvib_ss.diagnosis.consequences import consequences
from cutvib_ss.diagnosis.cross_validation import judged, predicted
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.metrics import Sides
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.units import STANDARD_GRAVITY
from tests.unit.record_example import entry_of

FREQ = np.arange(20.0, 400.0, 1.0)
CHANNELS = ("tool_x", "tool_z", "base_x")
NOMINAL = published_machine()
SOFT = ParameterShift("joint2", "k2", 0.9)
MACHINE = SOFT.apply(NOMINAL)


def entries(positions=(0.1, 0.4, 0.8), levels=(None,)):
    rng, out = np.random.default_rng(7), []
    for y in positions:
        for level in levels:
            data = frequency_response(MACHINE, [y], FREQ).data[0, :, 0]
            std = 1e-3 * np.abs(data).max(axis=1, keepdims=True) * np.ones(FREQ.size)
            data = data + std * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
            out.append(
                entry_of(
                    len(out), y, level, data, std**2, FREQ, CHANNELS, ("acceleration",) * 3
                )
            )  # fmt: skip
    return tuple(out)


@pytest.fixture(scope="module")
def told():
    records = Records(entries())
    observed = Observations(records.entries, (20.0, 399.0), CHANNELS, "g/N", STANDARD_GRAVITY)
    found = fit(NOMINAL, records, Hypothesis((replace(SOFT, factor=0.93),)))
    return consequences(NOMINAL, found, records, observed, "explained", 0)


def test_vibration_now_and_mended_lies_within_its_interval(told):
    for o in told.vibration:
        now, fixed = (
            np.abs(frequency_response(m, [o.position], [217.0], outputs=["tool_x"]).data.item()) / STANDARD_GRAVITY
            for m in (MACHINE, NOMINAL)
        )
        for value, estimate, (low, high) in ((now, o.now, o.now_interval), (fixed, o.fixed, o.fixed_interval)):
            room = high - low
            assert low - room < value < high + room
            assert low <= estimate <= high
            assert room < 0.2 * estimate
        # How much of k2 is tuning, how much the fault, no record tells: what mending leaves is less certain than what is there.
        assert np.ptp(o.fixed_interval) > 3 * np.ptp(o.now_interval)
        assert o.measured == pytest.approx(now, rel=0.1)
    assert not told.warnings


def test_controller_of_the_nominal_model_does_worse_on_the_corrected_one(told):
    assert [loop.position for loop in told.loops] == [o.position for o in told.vibration]
    assert all(loop.nominal_attenuation_db > 10.0 for loop in told.loops)
    assert min(loop.corrected_attenuation_db - loop.nominal_attenuation_db for loop in told.loops) < -1.0


def test_extrapolation_is_said():
    records = Records(entries(positions=(0.3,)))
    observed = Observations(records.entries, (20.0, 200.0), CHANNELS, "g/N", STANDARD_GRAVITY)
    found = fit(NOMINAL, records, Hypothesis())
    said = " ".join(consequences(NOMINAL, found, records, observed, "unknown", 0).warnings)
    assert "outside the measured band" in said
    assert "fewer than three positions" in said
    assert "not known" in said


def test_bands_hold_most_of_the_error_and_say_that_it_repeats():
    records = entries(levels=(15.0, 60.0))
    tuned, after = (tuple(judged(e, predicted(e, m, 0.0)) for e in records) for m in (NOMINAL, MACHINE))
    found = bands([(20.0, 399.0)], (20.0, 399.0), Sides(tuned, tuned, after), 1.0)
    main = [b for b in found if b.stands_out]
    assert main
    assert all(180.0 < b.low < b.high < 260.0 for b in main), main
    for b in main:
        assert b.tuned > 10 * b.noise
        assert b.after == pytest.approx(b.noise, rel=0.2)
        assert b.coherence == pytest.approx(1.0, abs=0.01)
        assert not b.moves_with_level
    assert all(b.tuned < main[0].tuned for b in found if not b.stands_out)
