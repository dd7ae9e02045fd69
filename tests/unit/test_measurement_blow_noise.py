"""Noise of blows told apart, on blows whose parts are known: a one-mode rig, noise and scatter put on by hand."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal, stats

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement import History, Record, estimate
from cutvib_ss.measurement.blow_noise import (
    Ordering,
    blow_scatter,
    chance_of_ordering,
    deviations,
    hit_directions,
    pretrigger_noise,
)
from tests.unit.measurement_rig import FS, blow, clean_blow

PEAKS = (30.0, 45.0, 60.0, 75.0)
_LEVELS = [blow(peak, 0.25, 4.0) for peak in PEAKS]


def _record(histories):
    return Record(
        "r.csv", "impact", None, None, None, ("a",), ("acceleration",), tuple(histories), averages=len(histories)
    )


def _noisy(rng, pairs, on_force=0.02, on_response=0.05, factors=None):
    histories = []
    for k, (force, motion) in enumerate(pairs):
        scale = 1.0 if factors is None else factors[k]
        histories.append(
            History(
                FS,
                force + on_force * rng.standard_normal(force.size),
                (scale * motion + on_response * rng.standard_normal(motion.size))[np.newaxis],
                ("a",),
                str(k),
            )
        )
    return _record(histories)


def test_variance_of_h1_is_what_repetition_shows():
    """Mean of |ΔH|² over the variance told from quiet parts is one: within three deviations of that mean."""
    rng = np.random.default_rng(1)
    pairs = [clean_blow(k) for k in range(3)]
    true = estimate(_record([History(FS, f, a[np.newaxis], ("a",)) for f, a in pairs])).data[0, 0, 0]
    ratios = []
    for _ in range(40):
        record = _noisy(rng, pairs)
        found = pretrigger_noise(record)
        band = (found.freq > 20) & (found.freq < 300)
        off = np.abs(estimate(record).data[0, 0, 0] - true) ** 2
        ratios.append(np.mean(off[band] / found.variance[0, band]))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.08)


def test_densities_of_coloured_noise_on_each_channel():
    rng = np.random.default_rng(2)
    force, motion = _LEVELS[2]
    b, a = signal.butter(1, 0.2)
    histories = []
    for _ in range(6):
        coloured = signal.lfilter(b, a, rng.standard_normal(motion.size + 500))[500:]
        histories.append(
            History(FS, force + 0.03 * rng.standard_normal(force.size), (motion + coloured)[np.newaxis], ("a",))
        )
    found = pretrigger_noise(_record(histories))
    band = (found.freq > 20) & (found.freq < 800)
    _, response = signal.freqz(b, a, found.freq[band], fs=FS)
    assert np.mean(found.force[band]) == pytest.approx(2 * 0.03**2 / FS, rel=0.05)
    level = found.responses[0, band] / (2 * np.abs(response) ** 2 / FS)
    assert np.mean(np.log(level)) == pytest.approx(0.0, abs=0.1)


def test_a_tail_that_still_rings_is_no_noise():
    rng = np.random.default_rng(3)
    short = [tuple(x[:1500] for x in pair) for pair in _LEVELS]
    found = pretrigger_noise(_noisy(rng, short))
    before = found.samples[1] / len(short)
    assert before < 500  # the rest before the blow alone
    band = (found.freq > 20) & (found.freq < 800)
    assert np.mean(found.responses[0, band]) == pytest.approx(2 * 0.05**2 / FS, rel=0.15)
    long = pretrigger_noise(_noisy(rng, _LEVELS))
    assert long.samples[1] > 4 * before * 1.5  # died out after four seconds: the last eighth counts


def test_a_force_window_of_zeros_is_no_noise():
    rng = np.random.default_rng(4)
    histories = []
    for history in _noisy(rng, _LEVELS).histories:
        force = history.force.copy()
        force[700:] = 0.0
        histories.append(History(FS, force, history.responses, ("a",)))
    found = pretrigger_noise(_record(histories))
    assert np.mean(found.force[20:]) == pytest.approx(2 * 0.02**2 / FS, rel=0.2)


def test_nothing_quiet_is_unknown():
    rng = np.random.default_rng(5)
    cut = [tuple(x[498:1200] for x in pair) for pair in _LEVELS]
    found = pretrigger_noise(_noisy(rng, cut))
    assert found.samples[1] == 0
    assert np.all(np.isnan(found.variance))


def test_sensor_noise_alone_orders_with_nothing():
    """Nothing is found where nothing is, and the rest is what the sensors explain."""
    rng = np.random.default_rng(6)
    found = [blow_scatter(_noisy(rng, _LEVELS), band=(20, 300)) for _ in range(60)]
    values = np.array([f.significance[0] for f in found])
    assert np.mean(values < 0.05) <= 0.05 + 3 * np.sqrt(0.05 * 0.95 / 60)
    # A chance that is never too small, and not always one.
    assert stats.kstest(values, "uniform", alternative="greater").statistic < 0.2
    assert np.mean(values < 0.5) > 0.1
    assert np.mean([f.ratio[0] for f in found]) == pytest.approx(1.0, abs=0.15)
    assert np.mean([np.mean(f.ordered / f.rest) for f in found]) == pytest.approx(0.0, abs=0.03)


def test_what_orders_with_the_force():
    """A gain that grows with the peak force: its mean square over the blows, and no doubt about it."""
    rng = np.random.default_rng(7)
    slope = 0.002
    record = _noisy(rng, _LEVELS, 1e-3, 1e-3, factors=[1 + slope * p for p in PEAKS])
    found = blow_scatter(record, band=(30, 200))
    share = np.array(PEAKS) ** 2 / np.sum(np.array(PEAKS) ** 2)
    spread = np.sqrt(np.sum(share * (PEAKS - np.sum(share * PEAKS)) ** 2))
    plain = np.abs(estimate(record, band=(30, 200)).data[0, 0, 0])
    expected = slope * spread / (1 + slope * np.sum(share * PEAKS)) * plain
    ratio = np.sqrt(found.ordered[0]) / expected
    assert np.median(ratio) == pytest.approx(1.0, abs=0.003)
    np.testing.assert_allclose(ratio, 1.0, atol=0.1)  # single lines scatter by their noise
    # Four hits that differ by chance along one direction would be in this order as well as any other, noise apart.
    assert found.significance[0] < 1e-4


def test_hits_that_differ_at_random_are_rest_and_not_taken_for_a_law():
    rng = np.random.default_rng(8)
    values, ratios = [], []
    for _ in range(200):
        factors = 1 + 0.02 * rng.standard_normal(len(PEAKS))
        found = blow_scatter(_noisy(rng, _LEVELS, 1e-3, 1e-3, factors=factors), band=(30, 200))
        values.append(found.significance[0])
        ratios.append(found.ratio[0])
    assert np.median(ratios) > 10
    # honest at five per cent: at most what 200 draws scatter above it
    assert np.mean(np.array(values) < 0.05) < 0.05 + 3 * np.sqrt(0.05 * 0.95 / 200)


@pytest.mark.parametrize("size", [1e-3, 1e-2])
def test_three_hits_of_a_hand_are_ordered_by_chance_alone(size):
    """Hits that differ by little more than the noise or by far more: one number a blow, which three blows often order."""
    rng = np.random.default_rng(11)
    values = []
    for _ in range(150):
        factors = 1 + size * rng.standard_normal(3)
        found = blow_scatter(_noisy(rng, _LEVELS[:3], 3e-4, 3e-3, factors=factors), band=(30, 200))
        values.append(found.significance[0])
    for chance in (0.01, 0.05, 0.2):
        assert np.mean(np.array(values) < chance) < chance + 3 * np.sqrt(chance * (1 - chance) / 150)


def test_many_records_tell_what_three_blows_do_not():
    """A gain that grows with the peak force, seen by three blows in each of six records beside hits that differ; and without it."""
    rng = np.random.default_rng(12)

    def records(slope):
        for _ in range(6):
            factors = 1 + slope * np.array(PEAKS[:3]) + 1e-3 * rng.standard_normal(3)
            yield blow_scatter(_noisy(rng, _LEVELS[:3], 1e-3, 1e-3, factors=factors), band=(30, 200))

    grows = list(records(2e-3))
    assert min(found.significance[0] for found in grows) > 1e-3
    assert chance_of_ordering(found.ordering for found in grows) < 1e-4
    assert chance_of_ordering(found.ordering for found in records(0.0)) > 1e-3
    # What nobody saw tells nothing.
    assert chance_of_ordering([Ordering(np.nan, np.nan, np.nan, 1)]) == chance_of_ordering([]) == 1.0


def test_hits_of_a_hand_order_all_records_as_rarely_as_stated():
    """Six records of three hits that differ by little more than the noise, or by far more in one place than in another."""
    rng, values = np.random.default_rng(13), []
    for _ in range(60):
        own = (
            blow_scatter(
                _noisy(rng, _LEVELS[:3], 3e-4, 3e-3, factors=1 + size * rng.standard_normal(3)), band=(30, 200)
            )
            for size in (1e-3, 1e-3, 2e-3, 5e-3, 5e-3, 1e-2)
        )
        values.append(chance_of_ordering(found.ordering for found in own))
    for chance in (0.01, 0.05, 0.2):
        assert np.mean(np.array(values) < chance) < chance + 3 * np.sqrt(chance * (1 - chance) / 60)


def test_two_blows_tell_nothing_apart():
    found = blow_scatter(_noisy(np.random.default_rng(9), _LEVELS[:2]), band=(20, 300))
    assert np.all(np.isnan(found.rest))
    assert np.isnan(found.significance[0])
    assert np.all(np.isfinite(found.noise))


def test_other_kinds_and_empty_bands():
    record = _noisy(np.random.default_rng(10), _LEVELS)
    with pytest.raises(ParameterError, match="no line"):
        blow_scatter(record, band=(5000, 6000))
    other = Record("r", "timeseries", None, None, None, ("a",), ("acceleration",), record.histories)
    with pytest.raises(ParameterError, match="only blows"):
        pretrigger_noise(other)
    with pytest.raises(ParameterError, match="only blows"):
        blow_scatter(other)


def _beside(rng, sizes, ordered=0.0, noise=0.05):
    """Blows of one level that hit beside the point: a second, slower oscillator answers by a part of its own in each."""
    other = signal.butter(2, [18.0, 24.0], "bandpass", fs=FS)
    force, motion = blow(50.0, 0.25, 4.0)
    histories = []
    for k, c in enumerate(sizes):
        peak = 1.0 + 0.02 * k
        own = peak * (motion + (c + ordered * (peak - 1.0)) * signal.lfilter(*other, 40.0 * force))
        histories.append(
            History(
                FS,
                peak * force + 0.02 * rng.standard_normal(force.size),
                (own + noise * rng.standard_normal(own.size))[np.newaxis],
                ("a",),
                str(k),
            )
        )
    return _record(histories), other


def test_what_hits_do_is_told_with_its_size():
    rng = np.random.default_rng(11)
    sizes = rng.standard_normal(12)
    record, other = _beside(rng, sizes)
    told = deviations(record)
    freq, found = told.freq, hit_directions(told)
    assert found.shape == (1, 1, freq.size)
    band = (freq > 12) & (freq < 40)
    _, g = signal.freqz(*other, freq[band], fs=FS)
    along = np.vdot(40.0 * g, found[0, 0, band]) / np.vdot(40.0 * g, 40.0 * g)
    assert abs(along.imag) < 0.02 * abs(along.real)
    assert abs(along.real) == pytest.approx(np.std(sizes) / np.sqrt(12), rel=0.15)
    left = found[0, 0, band] - along * 40.0 * g
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(found[0, 0, band])


@pytest.mark.parametrize(("sizes", "ordered"), [((0.0,) * 6, 0.0), ((0.0,) * 6, 3.0), ((0.5, -0.5), 0.0)])
def test_noise_what_orders_with_the_force_and_two_blows_give_no_direction(sizes, ordered):
    record, _ = _beside(np.random.default_rng(12), sizes, ordered)
    assert len(hit_directions(deviations(record))) == 0


def test_noise_that_is_known_is_not_told_again():
    record, _ = _beside(np.random.default_rng(11), (0.5, -0.5, 1.0, -1.0, 0.2, 0.0))
    noise = pretrigger_noise(record)
    np.testing.assert_array_equal(deviations(record, noise=noise).single, deviations(record).single)
    np.testing.assert_array_equal(blow_scatter(record, noise=noise).noise, blow_scatter(record).noise)
    quieter = replace(noise, variance=noise.variance / 4)
    np.testing.assert_allclose(blow_scatter(record, noise=quieter).noise, blow_scatter(record).noise / 4)
