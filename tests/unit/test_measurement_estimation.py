"""Frequency responses from time records, against a rig simulated exactly."""

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.measurement import History, Record, estimate
from cutvib_ss.measurement.estimation import coherence, h1, h2, hv, measured_response
from cutvib_ss.results import Estimator, MeasuredFrequencyResponse
from tests.unit.measurement_rig import FS, accelerance, blow, impact


def _error(found, decay_rate=0.0, low=5.0, high=400.0):
    band = (found.freq > low) & (found.freq < high)
    wanted = accelerance(decay_rate + 2j * np.pi * found.freq)[band]
    return np.max(np.abs(found.data[0, 0, 0, band] - wanted)) / np.max(np.abs(wanted))


def _reduced_chi_square(found, decay_rate=0.0, around=None):
    band = (found.freq > 5) & (found.freq < 300)
    if around is not None:
        band &= np.abs(found.freq - around) < 2
    wanted = accelerance(decay_rate + 2j * np.pi * found.freq)
    return np.mean((np.abs(found.data[0, 0, 0] - wanted) ** 2 / found.variance[0, 0, 0])[band])


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_clean_blows_give_the_analytic_response(estimator):
    assert _error(estimate(impact(), estimator=estimator)) < 2e-5


def test_truncated_response_leaks_and_decay_rate_undoes_it():
    record = impact(seconds=0.6)  # the mode has fallen to 15 % only
    assert _error(estimate(record)) > 0.1
    assert _error(estimate(record, decay_rate=20.0), 20.0) < 5e-5


def test_decay_rate_with_offset_and_noise_stays_at_the_noise():
    rng = np.random.default_rng(1)
    found = estimate(impact(offset=0.3, noise=0.1, rng=rng), decay_rate=4.0)
    assert found.decay_rate == 4.0
    assert _reduced_chi_square(found, 4.0) < 2.0
    assert _error(found, 4.0) < 0.02


@pytest.mark.parametrize(("blows", "tolerance"), [(2, 0.04), (3, 0.03), (5, 0.03)])
@pytest.mark.parametrize(("force_noise", "noise"), [(0.0, 0.3), (0.05, 0.3)])
def test_reduced_chi_square_of_the_true_model_is_one(blows, tolerance, force_noise, noise):
    rng = np.random.default_rng(2)
    chi = [_reduced_chi_square(estimate(impact(blows, force_noise, noise, rng=rng))) for _ in range(40)]
    assert np.mean(chi) == pytest.approx(1.0, abs=tolerance)


def test_force_noise_is_seen_at_the_peak():
    """It is |H|² times the force's noise there: thousands of times what it is beside the peak."""
    rng = np.random.default_rng(3)
    chi = [_reduced_chi_square(estimate(impact(3, 0.05, 0.03, rng=rng)), around=60.0) for _ in range(40)]
    assert np.mean(chi) == pytest.approx(1.0, abs=0.15)


def test_reduced_chi_square_under_a_decay_window_is_one():
    rng = np.random.default_rng(4)
    chi = [_reduced_chi_square(estimate(impact(3, 0.0, 0.3, rng=rng), decay_rate=4.0), 4.0) for _ in range(40)]
    assert np.mean(chi) == pytest.approx(1.0, abs=0.08)


def test_single_blow_takes_its_noise_from_before_the_hit():
    rng = np.random.default_rng(5)
    found = [estimate(impact(1, 0.0, 0.3, rng=rng)) for _ in range(40)]
    assert np.mean([_reduced_chi_square(f) for f in found]) == pytest.approx(1.0, abs=0.2)
    assert np.all(np.isnan(found[0].coherence))


def test_single_blow_without_rest_takes_its_noise_from_along_frequency():
    rng = np.random.default_rng(6)
    chi = []
    force, motion = blow(at=0.004)
    for _ in range(20):
        noisy = motion + 0.3 * rng.standard_normal(motion.size)
        history = History(FS, force, noisy[np.newaxis], ("a",), "b")
        record = Record("r", "impact", None, None, None, ("a",), ("acceleration",), (history,))
        chi.append(_reduced_chi_square(estimate(record)))
    assert np.mean(chi) == pytest.approx(1.0, abs=0.25)


def test_phase_is_not_conjugated():
    found = estimate(impact())
    peak = np.argmax(np.abs(found.data[0, 0, 0]) * (found.freq < 400))
    assert found.freq[peak] == pytest.approx(60.0, abs=0.3)
    assert found.data[0, 0, 0, peak].imag > 0  # accelerance at resonance is +j
    below = found.data[0, 0, 0, np.searchsorted(found.freq, 59.0)]
    assert below.real < 0 < below.imag


def test_sign_of_the_response_comes_through():
    right, turned = estimate(impact()), estimate(impact(turn=-1.0))
    band = (right.freq > 5) & (right.freq < 400)
    np.testing.assert_allclose(turned.data[..., band], -right.data[..., band], rtol=1e-9)


def test_double_hit_is_a_valid_force():
    force, motion = blow(50.0, 0.1, second=(20.0, 0.13))
    history = History(FS, force, motion[np.newaxis], ("a",), "b")
    record = Record("r", "impact", None, None, None, ("a",), ("acceleration",), (history,))
    assert _error(estimate(record, decay_rate=4.0), 4.0) < 5e-5


def test_estimators_bracket_the_truth_under_noise_on_one_side():
    rng = np.random.default_rng(7)
    truth = 3.0 - 4.0j
    force = rng.standard_normal((4000, 5)) + 1j * rng.standard_normal((4000, 5))
    noise = rng.standard_normal((4000, 5)) + 1j * rng.standard_normal((4000, 5))
    noisy_response, noisy_force = truth * force + 2.5 * noise, force + 0.5 * noise
    np.testing.assert_allclose(h1(force, noisy_response), truth, rtol=0.05)
    np.testing.assert_allclose(h2(noisy_force, truth * force), truth, rtol=0.05)
    np.testing.assert_allclose(np.abs(h1(noisy_force, truth * force)), 5 / 1.25, rtol=0.05)
    np.testing.assert_allclose(np.abs(h2(force, noisy_response)), 5 * 1.25, rtol=0.05)
    both = hv(noisy_force, truth * force + 2.5 * np.roll(noise, 1, axis=0))
    np.testing.assert_allclose(both, truth, rtol=0.05)
    np.testing.assert_allclose(coherence(force, noisy_response), 0.8, atol=0.03)


def test_coherence_of_exact_blows_is_one_and_lies_within_bounds():
    found = estimate(impact(3, 0.01, 0.05))
    band = (found.freq > 5) & (found.freq < 300)
    assert np.all((found.coherence >= 0) & (found.coherence <= 1))
    assert np.median(found.coherence[0, 0, 0, band]) > 0.9
    assert found.averages == 3


def test_band_keeps_its_edges():
    found = estimate(impact(), band=(15.0, 450.0))
    assert (found.freq[0], found.freq[-1]) == (15.0, 450.0)
    assert found.data.shape == found.variance.shape == (1, 1, 1, found.freq.size)


def test_blows_of_different_length_are_cut_to_the_shortest():
    record = impact(2)
    longer, shorter = record.histories
    shorter = History(FS, shorter.force[:6000], shorter.responses[:, :6000], ("a",), "short")
    found = estimate(Record("r", "impact", None, None, None, ("a",), ("acceleration",), (longer, shorter)))
    assert found.freq[1] == pytest.approx(FS / 6000)


@pytest.mark.parametrize("variance_of", ["impact", "timeseries"])
def test_variance_is_finite_and_positive_everywhere(variance_of):
    record = impact(3) if variance_of == "impact" else _random_record(np.random.default_rng(8), 0.0)
    found = estimate(record)
    assert np.all(np.isfinite(found.variance))
    assert np.all(found.variance > 0)


def _random_record(rng, noise, seconds=60.0, fs=500.0, block=None):
    """A resonance at 40 Hz and 2 % driven by noise, as a digital filter: its response is known exactly."""
    force = rng.standard_normal(int(seconds * fs))
    numerator, denominator = _digital_resonance(fs)
    motion = signal.lfilter(numerator, denominator, force) + noise * rng.standard_normal(force.size)
    history = History(fs, force, motion[np.newaxis], ("a",), "1")
    return Record("r", "timeseries", None, None, None, ("a",), ("acceleration",), (history,), block=block)


def _digital_resonance(fs):
    pole = np.exp((-0.02 + 1j * np.sqrt(1 - 0.02**2)) * 2 * np.pi * 40 / fs)
    return [0.05], [1.0, -2 * pole.real, abs(pole) ** 2]


def test_continuous_recording_gives_the_response_and_its_noise():
    rng = np.random.default_rng(9)
    chi = []
    for _ in range(10):
        found = estimate(_random_record(rng, 1.0), block=2.048)
        wanted = signal.freqz(*_digital_resonance(500.0), worN=2 * np.pi * found.freq / 500.0)[1]
        band = (found.freq > 5) & (found.freq < 200)
        chi.append(np.mean((np.abs(found.data[0, 0, 0] - wanted) ** 2 / found.variance[0, 0, 0])[band]))
        assert found.averages == pytest.approx(55, abs=3)  # 57 blocks, half overlapped
        near = np.argmin(np.abs(found.freq - 39))
        assert found.data[0, 0, 0, near] == pytest.approx(wanted[near], rel=0.15)  # not conjugated
    assert np.mean(chi) == pytest.approx(1.0, abs=0.06)


def test_block_of_the_record_is_used_unless_another_is_asked_for():
    record = _random_record(np.random.default_rng(10), 0.1, block=1.0)
    assert estimate(record).freq[1] == pytest.approx(1.0)
    assert estimate(record, block=0.5).freq[1] == pytest.approx(2.0)


def test_several_recordings_are_pooled():
    rng = np.random.default_rng(11)
    first, second = (_random_record(rng, 0.1).histories[0] for _ in range(2))
    both = Record("r", "timeseries", None, None, None, ("a",), ("acceleration",), (first, second))
    one = Record("r", "timeseries", None, None, None, ("a",), ("acceleration",), (first,))
    assert estimate(both).averages == pytest.approx(2 * estimate(one).averages, abs=2)


def test_base_excitation_is_labelled():
    record = impact()
    base = Record(
        "r", "impact", None, None, None, ("a",), ("acceleration",), record.histories, input_quantity="acceleration"
    )
    assert estimate(base).units == ("m/s^2/(m/s^2)",)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"estimator": "H3"}, "H1, H2, Hv"),
        ({"decay_rate": -1.0}, "not negative"),
        ({"decay_rate": float("nan")}, "finite"),
        ({"band": (10.0, 5.0)}, "low to high"),
        ({"band": (5000.0, 6000.0)}, "no line"),
    ],
)
def test_impossible_arguments(arguments, message):
    with pytest.raises(ParameterError, match=message):
        estimate(impact(), **arguments)


def test_decay_rate_is_refused_where_nothing_starts_at_rest():
    with pytest.raises(ParameterError, match="at rest"):
        estimate(_random_record(np.random.default_rng(12), 0.0), decay_rate=1.0)


@pytest.mark.parametrize("block", [0.001, 1e4])
def test_block_that_does_not_fit(block):
    with pytest.raises(ParameterError, match="block"):
        estimate(_random_record(np.random.default_rng(13), 0.0), block=block)


@pytest.mark.parametrize("kind", ["impact", "timeseries"])
def test_zero_force(kind):
    history = History(FS, np.zeros(2000), np.ones((1, 2000)), ("a",), "1")
    with pytest.raises(DataFormatError, match="force is zero"):
        estimate(Record("r", kind, None, None, None, ("a",), ("acceleration",), (history,)))


# --- what the estimator did ------------------------------------------------------------------------------------------


def test_an_estimate_carries_what_its_estimator_did():
    record = impact(3, seconds=0.6)
    done = estimate(record, estimator="H2").estimator
    assert (done.kind, done.block, done.scatter_seen) == ("H2", pytest.approx(0.6), True)
    first = record.histories[0]
    assert done.blow_at == pytest.approx(first.time[np.argmax(first.force)])
    assert not estimate(impact(1)).estimator.scatter_seen
    assert measured_response(record).estimator.kind == "H1"


@pytest.mark.parametrize(
    ("excitation", "stated", "coherence", "done"),
    [
        ("impact", {}, 0.9, Estimator(None, 2.0)),
        ("impact", {"block": 1.5, "blow_at": 0.1}, np.nan, Estimator(None, 1.5, 0.1, scatter_seen=False)),
        ("impact", {"exponential_decay": 3.0}, 0.9, Estimator(None, 2.0, None, 3.0)),
        ("random", {"block": 1.5}, 0.9, Estimator()),
    ],
)
def test_recorded_responses_carry_what_the_record_states(excitation, stated, coherence, done):
    freq = np.arange(10.0, 20.0, 0.5)
    frf = MeasuredFrequencyResponse(
        np.ones((1, 1, 1, freq.size)), freq, np.nan, "tool_x", "force", ["acceleration"],
        variance=np.ones((1, 1, 1, freq.size)), coherence=np.full((1, 1, 1, freq.size), coherence),
    )  # fmt: skip
    record = Record(
        "r", "frf", None, None, None, ("tool_x",), ("acceleration",), (), frf, 1, excitation, input="base", **stated
    )
    found = measured_response(record)
    assert found.estimator == done
    assert found.inputs == ("base",)


def test_parts_of_a_measured_response_keep_its_estimator():
    found = estimate(impact(3))
    few = found.at_lines(slice(4, None, 5))
    assert few.estimator == found.estimator
    np.testing.assert_array_equal(few.freq, found.freq[4::5])
    np.testing.assert_array_equal(few.variance, found.variance[..., 4::5])
    two = MeasuredFrequencyResponse(
        np.ones((1, 2, 1, 3)), [1.0, 2.0, 3.0], 0.5, ["a", "b"], "force", ["acceleration"] * 2,
        estimator=Estimator("H1"),
    )  # fmt: skip
    assert two.sel(output="b").estimator == two.estimator
    shown = two.computed(2.0 * two.data)
    assert type(shown) is not MeasuredFrequencyResponse
    assert (shown.outputs, shown.quantities, shown.data[0, 1, 0, 2]) == (two.outputs, two.quantities, 2.0)
