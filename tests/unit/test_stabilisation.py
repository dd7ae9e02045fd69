"""Poles of responses for growing model orders: those of the model come back, and the diagram shows which stay."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import cutvib_ss as cv
from cutvib_ss import plot
from cutvib_ss.errors import IdentificationError, ParameterError
from cutvib_ss.results import MeasuredFrequencyResponse

FREQ = np.arange(15.0, 450.0, 0.5)
MACHINE = cv.published_machine()


def test_without_noise_the_poles_of_the_model_stay() -> None:
    found = cv.stabilisation(cv.frequency_response(MACHINE, 0.4, FREQ))
    modes = cv.modes(MACHINE, 0.4)
    poles = np.sort(np.abs(modes.poles))[:5]
    columns = np.array(found.columns())
    assert np.allclose(columns[:, 0], poles / (2 * np.pi), rtol=1e-4)
    damping = -modes.poles.real / np.abs(modes.poles)
    assert np.allclose(columns[:, 1], damping[np.argsort(np.abs(modes.poles))][:5], rtol=1e-3)
    assert (columns[:, 2] > 25).all()
    assert np.all((found.natural_freq >= 15.0) & (found.damping_ratio > 0.0))


def test_noise_leaves_frequencies_and_brings_no_other_column() -> None:
    exact = cv.frequency_response(MACHINE, 0.4, FREQ, form="receptance")
    rng = np.random.default_rng(3)
    std = 3e-3 * np.abs(exact.data).mean(axis=-1, keepdims=True) * np.ones(FREQ.size)
    noise = std / np.sqrt(2) * (rng.standard_normal(std.shape) + 1j * rng.standard_normal(std.shape))
    measured = MeasuredFrequencyResponse(
        exact.data + noise, exact.freq, exact.positions, exact.outputs, exact.inputs, exact.quantities,
        variance=std**2, coherence=np.full(std.shape, np.nan), averages=3,
    )  # fmt: skip
    natural = cv.modes(MACHINE, 0.4).natural_freq[:4]
    columns = np.array(cv.stabilisation(measured, highest_order=30).columns(8))
    assert all(np.min(np.abs(natural / f - 1.0)) < 0.01 for f in columns[:, 0] if f < 300.0)
    # The highest peaks are among them.
    assert all(np.min(np.abs(columns[:, 0] / f - 1.0)) < 0.01 for f in natural[2:4])


def test_the_band_bounds_the_poles_and_wrong_requests_are_refused() -> None:
    frf = cv.frequency_response(MACHINE, [0.2, 0.4], FREQ)
    found = cv.stabilisation(frf, position=0.4, band=(80.0, 200.0), highest_order=12)
    assert found.position == 0.4
    assert [round(f) for f, _, _ in found.columns()] == [117]
    with pytest.raises(ParameterError, match=r"choose one of the positions \[0.2, 0.4\]"):
        cv.stabilisation(frf)
    with pytest.raises(ParameterError, match="low < high"):
        cv.stabilisation(frf, position=0.4, band=(200.0, 80.0))
    with pytest.raises(IdentificationError, match="too few for order 40"):
        cv.stabilisation(frf, position=0.4, band=(80.0, 90.0))
    uneven = cv.frequency_response(MACHINE, 0.4, np.geomspace(20.0, 400.0, 300))
    with pytest.raises(IdentificationError, match="evenly spaced"):
        cv.stabilisation(uneven)


def test_the_diagram_draws_each_pole_once_on_the_axes_it_is_given() -> None:
    found = cv.stabilisation(cv.frequency_response(MACHINE, 0.4, FREQ), highest_order=12)
    ax = Figure().subplots()
    assert plot.stabilisation_diagram(found, ax=ax) is ax
    drawn = np.concatenate([np.asarray(c.get_offsets()) for c in ax.collections])
    assert len(drawn) == found.order.size
    assert set(map(tuple, drawn)) == set(zip(found.natural_freq, found.order, strict=True))
    assert ax.get_title(loc="left") == "y/L = 0.4"
    assert "tool, 217 Hz" in [str(line.get_label()) for line in ax.lines]
    assert plot.draw(replace(found, position=float("nan"))) is not None
