"""Identification of the head: recovered from noise, with what the data determine and what they do not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.errors import IdentificationError
from cutvib_ss.identification import (
    FitWeights,
    bounded_fit,
    bounds_around,
    determination,
    fit_data,
    held_response,
    identify,
    peaks_and_dip,
    tool_side,
)
from cutvib_ss.identification.bounded_fit import HeadModel, head_of, vector
from cutvib_ss.identification.held_head import HeldHead
from cutvib_ss.identification.tool_side import tool_side_gradient
from cutvib_ss.measurement import read_campaign
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.model.machine import cutting_machine, published_machine
from cutvib_ss.parameters import HeadParameters, RailParameters, table_2, table_3
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import FloatArray, FrequencyResponse, MeasuredFrequencyResponse

FREQ = np.arange(150.0, 300.5, 0.5)
TRUE = table_3()
CLEAN = held_response(TRUE, FREQ)
RMS = np.sqrt(np.mean(np.abs(CLEAN.data) ** 2, axis=-1, keepdims=True))
NOISE = 0.01
"""Standard deviation of the noise over the root mean square of each response."""


def noisy(rng: np.random.Generator, frf: FrequencyResponse = CLEAN, level: float = NOISE) -> FrequencyResponse:
    size = np.sqrt(np.mean(np.abs(frf.data) ** 2, axis=-1, keepdims=True))
    noise = rng.standard_normal((2, *frf.data.shape)) / np.sqrt(2)
    return replace(frf, data=frf.data + level * size * (noise[0] + 1j * noise[1]))


def a_start(rng: np.random.Generator) -> HeadParameters:
    low, high = map(vector, table_2())
    return head_of(low + (high - low) * rng.random(low.size))


def test_from_twenty_starts_and_one_percent_noise_responses_and_combinations_are_recovered() -> None:
    expected = tool_side(TRUE)
    recovered, within = 0, 0
    for seed in range(20):
        rng = np.random.default_rng([2024, seed])
        data = fit_data(noisy(rng))
        fit = bounded_fit(data, table_2(), a_start(rng))
        error = np.sqrt(np.mean(np.abs(held_response(fit.head, FREQ).data - CLEAN.data) ** 2, axis=-1, keepdims=True))
        recovered += bool((error < NOISE * RMS).all())
        known = determination(fit, data)
        # A value on a bound has no Gaussian interval; Table 3's m2 lies on one.
        assert all(e.interval is None for e in (*known.parameters, *known.combinations) if "bound" in e.status)
        determined = [e for e in known.combinations if e.interval is not None]
        assert len(determined) >= 7
        within += all(e.interval[0] <= expected[e.name] <= e.interval[1] for e in determined if e.interval)
    assert recovered == 20
    assert within == 20


def test_all_starts_reach_one_objective() -> None:
    rng = np.random.default_rng(7)
    data = fit_data(noisy(rng))
    objectives = [bounded_fit(data, table_2(), a_start(rng)).objective for _ in range(6)]
    assert max(objectives) == pytest.approx(min(objectives), rel=1e-6)


def test_a_start_beside_a_local_minimum_does_not_end_there() -> None:
    low, high = map(vector, table_2())
    u = np.array([0.371, 0.122, 0.181, 0.065, 0.146, 0.371, 0.272, 0.858, 0.183, 0.839])
    fit = bounded_fit(fit_data(noisy(np.random.default_rng(193))), table_2(), head_of(low + (high - low) * u))
    assert fit.objective < 2 * NOISE**2


def test_intervals_hold_as_often_as_they_say_where_no_bound_is_near() -> None:
    # Bounds around the true values: estimates are then plain least squares, and their scatter is what is claimed.
    expected = tool_side(TRUE)
    scores = []
    for seed in range(30):
        rng = np.random.default_rng([11, seed])
        data = fit_data(noisy(rng))
        known = determination(bounded_fit(data, bounds_around(TRUE), TRUE), data)
        scores.append([(e.value - expected[e.name]) / e.std for e in known.combinations if e.std])
    scatter = np.sqrt(np.mean(np.square(scores), axis=0))
    assert len(scatter) == 8
    # The root mean square of 30 standard scores is 1 ± 0.13.
    assert scatter.min() > 0.6
    assert scatter.max() < 1.5


def test_the_two_open_directions_leave_both_responses_as_they_are() -> None:
    # Rotations seen through other lengths: t_1 by a, t_2 by b, with all that goes with them.
    a, b = 1.04, 0.97
    s = 2j * np.pi * FREQ
    h = TRUE
    x2, y2 = h.l2 * np.cos(h.theta01 + h.theta02), h.l2 * np.sin(h.theta01 + h.theta02)
    x1, y1 = h.l1 * np.cos(h.theta01) + x2, h.l1 * np.sin(h.theta01) + y2
    u, v = a * x1 - b * x2, a * y1 - b * y2
    l1, theta01 = float(np.hypot(u, v)), float(np.arctan2(v, u))
    other = HeadParameters(
        m1=h.m1 * (a * h.l1 / l1) ** 2, m2=h.m2, l1=l1, l2=b * h.l2, theta01=theta01,
        theta02=h.theta01 + h.theta02 - theta01, k1=a**2 * h.k1, k2=b**2 * h.k2, c1=a**2 * h.c1, c2=b**2 * h.c2,
    )  # fmt: skip
    assert tool_side(other) == pytest.approx(tool_side(h))
    for output in ("tool_x", "tool_z"):
        one, two = HeldHead(h, s).receptance(output), HeldHead(other, s).receptance(output)
        assert np.abs(one - two).max() < 1e-12 * np.abs(one).max()


def test_the_held_head_is_the_machine_on_a_rail_that_does_not_move() -> None:
    rock = cutting_machine(TRUE, RailParameters(2.5, 1e12, 1e3, 0.01, 1))
    on_rock = frequency_response(rock, 0.5, FREQ, outputs=("tool_x", "tool_z"))
    assert np.abs(on_rock.data - CLEAN.data).max() < 1e-9 * np.abs(CLEAN.data).max()


@pytest.mark.parametrize("name", HEAD_PARAMETERS)
def test_derivatives_of_the_held_head_and_of_the_combinations(name: str) -> None:
    value, s = getattr(TRUE, name), 2j * np.pi * FREQ
    step = 1e-5 * max(abs(value), 0.1)
    up, down = (replace(TRUE, **{name: value + d}) for d in (step, -step))
    model = HeldHead(TRUE, s)
    for output in ("tool_x", "tool_z"):
        slope = (HeldHead(up, s).receptance(output) - HeldHead(down, s).receptance(output)) / (2 * step)
        exact = model.derivative(name, output)
        assert np.abs(slope - exact).max() < 1e-6 * np.abs(exact).max()
    index = HEAD_PARAMETERS.index(name)
    for combination, gradient in tool_side_gradient(TRUE).items():
        slope = (tool_side(up)[combination] - tool_side(down)[combination]) / (2 * step)
        assert slope == pytest.approx(gradient[index], rel=1e-6, abs=1e-9 * np.abs(gradient).max())


def test_weights_of_eq_21() -> None:
    weights = FitWeights()
    assert (weights.of("tool_x"), weights.of("tool_z")) == pytest.approx((1.0, 0.25 * 0.1**2))
    rows = fit_data(CLEAN).weights
    assert rows[1] / rows[0] == pytest.approx(0.0025)


def test_the_objective_vanishes_at_the_truth_only() -> None:
    data = fit_data(CLEAN)
    values = HeadModel(data, None).evaluate(TRUE)[0]
    assert np.abs(values - data.measured).max() < 1e-12 * np.abs(values).max()
    assert bounded_fit(data, table_2(), TRUE).objective < 1e-12


def _measured(frf: FrequencyResponse, rng: np.random.Generator) -> MeasuredFrequencyResponse:
    size = np.sqrt(np.mean(np.abs(frf.data) ** 2, axis=-1, keepdims=True))
    variance: FloatArray = (NOISE * size) ** 2 + np.zeros(frf.data.shape)
    shown = noisy(rng, frf)
    return MeasuredFrequencyResponse(
        shown.data, frf.freq, frf.positions, frf.outputs, frf.inputs, frf.quantities, variance=variance, averages=3
    )


def test_identify_on_the_rail_finds_a_head_that_is_not_the_nominal_one() -> None:
    nominal = published_machine()
    actual = replace(TRUE, k2=TRUE.k2 * 1.08, c1=TRUE.c1 * 0.7, m2=TRUE.m2 * 0.95)
    shown = frequency_response(replace(nominal, head=actual), 0.02, FREQ, outputs=("tool_x", "tool_z"))
    result = identify(_measured(shown, np.random.default_rng(3)), nominal)
    assert result.base == "rail"
    assert result.position == 0.02
    assert (result.error < 1.2 * result.noise).all()
    assert result.machine is not None
    assert result.machine.head == result.head
    assert result.head.m2 == pytest.approx(actual.m2, rel=0.01)
    for estimate in result.determination.combinations:
        assert estimate.interval is not None
        low, high = estimate.interval
        assert low <= tool_side(actual)[estimate.name] <= high


def test_identify_with_the_base_held_needs_no_machine() -> None:
    result = identify(noisy(np.random.default_rng(5)), bounds=table_2())
    assert (result.base, result.machine) == ("held", None)
    assert result.first_guess is not None
    size = np.abs(CLEAN.data).mean(axis=(0, 2, 3))
    assert (result.error < 0.02 * size).all()
    assert any("bound" in warning for warning in result.warnings) == bool(result.fit.on_bound)


def test_peaks_and_dip_of_the_published_head() -> None:
    (low, high), dip = peaks_and_dip(CLEAN)
    assert low == pytest.approx(213.5, abs=2.0)
    assert high == pytest.approx(242.0, abs=3.0)
    assert low < dip < high


def test_what_cannot_carry_a_fit_says_so() -> None:
    with pytest.raises(IdentificationError, match="tool_x"):
        fit_data(CLEAN.sel(output="tool_z"))
    with pytest.raises(IdentificationError, match="lines"):
        fit_data(CLEAN, (150.0, 150.9))
    with pytest.raises(IdentificationError, match="not finite"):
        fit_data(replace(CLEAN, data=np.where(CLEAN.freq == 200.0, np.nan, CLEAN.data)))
    with pytest.raises(IdentificationError, match="variance"):
        fit_data(CLEAN, weighting="variance")
    with pytest.raises(IdentificationError, match="peak"):
        peaks_and_dip(CLEAN, band=(250.0, 300.0))
    with pytest.raises(IdentificationError, match="machine"):
        identify(CLEAN, base="rail")
    with pytest.raises(IdentificationError, match="position"):
        identify(CLEAN, published_machine())
    lower, upper = table_2()
    with pytest.raises(IdentificationError, match="m1"):
        bounded_fit(fit_data(CLEAN), (replace(lower, m1=26.0), upper), TRUE)


def test_a_parameter_on_a_bound_has_no_gaussian_interval() -> None:
    lower, upper = table_2()
    tight = (replace(lower, m2=0.4), replace(upper, m2=0.58))
    data = fit_data(noisy(np.random.default_rng(1)))
    known = determination(bounded_fit(data, tight, TRUE), data)
    [m2] = [e for e in known.parameters if e.name == "m2"]
    assert (m2.status, m2.std, m2.interval) == ("on upper bound", None, None)


@pytest.mark.parametrize(
    ("campaign", "combination", "factor"),
    [
        ("c01", "joint2_stiffness_at_tool", 1.0),  # nothing is wrong there
        ("c09", "joint1_stiffness_at_tool", 1.0),
        ("c04", "joint2_stiffness_at_tool", 0.858),  # a worn second joint
    ],
)
def test_measured_records(shared: Path, campaign: str, combination: str, factor: float) -> None:
    given = read_campaign(shared / "campaigns" / campaign)
    result = identify(given)
    assert min(result.position, 1.0 - result.position) == pytest.approx(0.02)
    assert not result.warnings
    nominal = tool_side(given.machine.head)[combination]
    [found] = [e for e in result.determination.combinations if e.name == combination]
    assert found.interval is not None
    assert found.interval[0] <= factor * nominal <= found.interval[1]


def test_a_record_with_something_else_in_it_is_warned_of(shared: Path) -> None:
    result = identify(read_campaign(shared / "campaigns" / "c07"))
    assert any("something else" in warning for warning in result.warnings)
