"""The smooth shapes of a calibration error against what real sensors and amplifiers do to a response."""

from __future__ import annotations

import numpy as np
import pytest

from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknowns import calibration_shapes

BAND = (15.0, 370.0)
FREQ = np.linspace(*BAND, 711)

INSTRUMENTS = {
    "coupled for alternating signals": lambda f: 1j * (f / 3.0) / (1.0 + 1j * f / 3.0),
    "a sensor below its resonance": lambda f: 1.0 / (1.0 - (f / 1000.0) ** 2 + 0.1j * f / 1000.0),
    "a Bessel filter far above": lambda f: 3.0 / (3.0 + 3j * f / 2000.0 - (f / 2000.0) ** 2),
    "late": lambda f: np.exp(-2j * np.pi * f * 1e-5),
}


@pytest.mark.parametrize("name", INSTRUMENTS)
@pytest.mark.parametrize("part", ["gain", "phase"])
def test_an_instrument_is_met_to_a_hundredth_of_its_error(name: str, part: str) -> None:
    answer = np.log(INSTRUMENTS[name](FREQ))
    error = answer.real - answer.real.mean() if part == "gain" else answer.imag
    shapes = calibration_shapes(FREQ, BAND, SETTINGS.calibration_shapes)
    left = error - shapes.T @ np.linalg.lstsq(shapes.T, error, rcond=None)[0]
    assert np.sqrt(np.mean(left**2)) <= 0.01 * np.sqrt(np.mean(error**2)) + 1e-15


def test_with_unit_normal_coefficients_they_have_unit_variance() -> None:
    shapes = calibration_shapes(FREQ, BAND, SETTINGS.calibration_shapes)
    assert np.mean(np.sum(shapes**2, axis=0)) == pytest.approx(1.0)
    # Most of it is a constant: a sensitivity that is stated wrongly.
    assert np.mean(shapes[0] ** 2) > 0.5


def test_they_outlive_the_call_unchanged() -> None:
    shapes = calibration_shapes(FREQ, BAND, 3)
    with pytest.raises(ValueError, match="read-only"):
        shapes[0] = 0.0
    assert calibration_shapes(FREQ, BAND, 0).shape == (0, FREQ.size)
