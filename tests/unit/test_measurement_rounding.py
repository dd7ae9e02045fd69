"""What a converter's steps do to responses, against oscillators simulated exactly."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.measurement import Campaign, History, Record, estimate, read_campaign, write_campaign
from cutvib_ss.measurement import estimation as estimation_module
from cutvib_ss.measurement.blow_noise import blow_scatter
from cutvib_ss.measurement.estimation import rounded_part, rounding_variance
from cutvib_ss.measurement.rounding import COARSER, DITHERED, NONE, coarser, hidden_power, steps_in, steps_of
from tests.unit.measurement_rig import FREQ, FS, blow, impact, small_campaign

RNG = np.random.default_rng(5)
_TIME = np.arange(4000) / 2000.0
_RINGING = 20.0 * np.exp(-6.0 * _TIME) * np.sin(2 * np.pi * 37.0 * _TIME)  # m/s²; dies out within the record


def _rounded(values, step, middle=0.0):
    return step * np.round(values / step + middle)


def _record(histories):
    return Record(
        "r.csv", "impact", None, 50.0, None, ("a",), ("acceleration",), tuple(histories), averages=len(histories)
    )


def _digitised(record, step, force_step, middle=0.0):
    histories = [
        replace(h, force=_rounded(h.force, force_step), responses=_rounded(h.responses, step, middle))
        for h in record.histories
    ]
    return replace(record, histories=tuple(histories))


def _struck(rng, blows, noise, peak=50.0):
    """Blows of unlike strength and instant, long enough for the mode to die out."""
    histories = []
    for k in range(blows):
        force, motion = blow(peak * (1 + 0.12 * rng.standard_normal()), 0.1 + 0.002 * rng.random(), 3.0)
        motion = motion + noise * rng.standard_normal(motion.size)
        histories.append(History(FS, force, motion[None], ("a",), f"blow {k + 1}"))
    return _record(histories)


@pytest.mark.parametrize(
    "as_recorded",
    [
        lambda x: x,
        lambda x: 9.80665 * x + 3.3,
        lambda x: -x,
        lambda x: x.astype(np.float32).astype(float) * 1.7,
        lambda x: np.array([float(f"{v:.5e}") for v in x]),
        lambda x: np.array([float(f"{v:.3e}") for v in x]),
    ],
    ids=["plain", "gain and offset", "turned", "single precision", "six digits", "four digits"],
)
@pytest.mark.parametrize("step", [0.165, 0.01])
def test_step_is_read_off_the_values(as_recorded, step):
    found = steps_of(as_recorded(_rounded(_RINGING, step)))
    scale = abs(float(as_recorded(np.array([1.0]))[0] - as_recorded(np.array([0.0]))[0]))
    assert found.coarse
    assert found.size == pytest.approx(scale * step, rel=1e-3)
    assert found.largest == pytest.approx(np.max(np.abs(_rounded(_RINGING, step))) / step, rel=1e-3)


@pytest.mark.parametrize(("step", "largest"), [(30.0, 1), (12.0, 2), (7.0, 3)])
def test_a_channel_that_moves_by_a_step_or_two_has_steps_all_the_same(step, largest):
    found = steps_of(_rounded(_RINGING, step))
    assert found.coarse
    assert (found.size, found.largest) == (pytest.approx(step), pytest.approx(largest))


def test_values_that_are_counts_are_steps():
    assert steps_of(np.round(_RINGING * 10)).size == pytest.approx(1.0)


@pytest.mark.parametrize(
    "values",
    [
        np.zeros(4000),
        np.full(4000, 3.7),
        np.array([0.0, 1.0]),
        np.array([1.0]),
        _RINGING,
        _rounded(_RINGING, 40.0 / 2**24),
        _rounded(_RINGING + 0.2 * RNG.standard_normal(4000), 0.165),
        np.concatenate([np.zeros(100), [10.0, 30.0, 50.0, 30.0, 10.0], np.zeros(3000)]),
        np.concatenate([np.zeros(100), RNG.standard_normal(50), np.zeros(3000)]),
        _rounded(_RINGING, 0.165) * np.exp(-3.0 * _TIME),
    ],
    ids=["zero", "constant", "two", "one", "unrounded", "24 bits", "noise", "made up", "cut out", "windowed after"],
)
def test_no_coarse_steps_are_seen_where_there_are_none(values):
    assert not steps_of(values).coarse


def test_end_that_a_window_took_away_says_nothing_of_noise():
    """The rest before the blow does."""
    noisy = _rounded(_RINGING + 0.2 * RNG.standard_normal(4000), 0.165)
    noisy[-1000:] = 0.0
    before = _rounded(0.2 * RNG.standard_normal(200), 0.165)
    assert not steps_of(np.concatenate([before, noisy]), 200).coarse


@pytest.mark.parametrize("middle", [0.0, 0.2, 0.45])
@pytest.mark.parametrize("deviation", [0.2, 0.35, 0.7])
def test_noise_is_told_from_the_steps_that_it_makes(deviation, middle):
    rng = np.random.default_rng(7)
    quiet = np.round(_RINGING / 0.01 + deviation * rng.standard_normal(4000) + middle)
    found = steps_of(quiet)
    if deviation < DITHERED:
        # near the edge of a step one threshold alone may be passed, and half of what it can be is taken
        assert 0.5 * deviation < found.noise < 1.25 * deviation
    else:
        assert not found.coarse


def test_rounding_once_more_is_what_a_coarser_converter_had_shown():
    values = _RINGING + 0.01 * np.random.default_rng(3).standard_normal(4000)
    twice = steps_of(_rounded(values, 0.165)).coarser(_rounded(values, 0.165))
    assert twice == pytest.approx(_rounded(values, COARSER * 0.165))


def test_nothing_is_done_to_what_is_not_coarse():
    assert NONE.coarser(_RINGING) is _RINGING
    assert NONE.share == 0.0


def _error_over_variance(record_of, truth_of, draws):
    """Squared error of the estimate over its variance: at the peak, and away from it."""
    found = []
    for seed in range(draws):
        rng = np.random.default_rng(seed)
        analog = _struck(rng, *truth_of)
        shown = estimate(record_of(analog))
        plain = estimation_module._from_blows(record_of(analog), "H1", 0.0, 15)[2][0]
        error = np.abs(shown.data - estimate(analog).data)[0, 0, 0] ** 2
        found.append([error / plain, error / shown.variance[0, 0, 0]])
    freq = shown.freq
    peak, beside = np.abs(freq - FREQ) < 0.4, (freq > 20) & (freq < 200) & (np.abs(freq - FREQ) > 10)
    before, after = np.mean(found, axis=0)
    return np.mean(before[peak]), np.mean(after[peak]), np.mean(after[beside])


@pytest.mark.parametrize("middle", [0.0, 0.2])
@pytest.mark.parametrize("step", [0.1, 0.3])
def test_error_of_a_coarse_range_is_of_the_size_stated(step, middle):
    """A mode of some ten steps: what it loses is ten times and more what blows scatter, and as large as the variance now says."""

    def record_of(analog):
        return _digitised(analog, step, 0.02, middle)

    before, peak, beside = _error_over_variance(record_of, (3, 0.1 * step), 20)
    assert before > (8.0 if middle == 0.0 else 2.0)
    assert 0.05 < peak < 3.0
    assert 0.1 < beside < 3.0


def test_error_of_a_single_coarse_blow_is_of_the_size_stated():
    def record_of(analog):
        return _digitised(analog, 0.2, 0.02)

    _, peak, beside = _error_over_variance(record_of, (1, 0.0), 20)
    assert 0.05 < peak < 4.0
    assert 0.1 < beside < 4.0


def test_dithered_responses_are_left_to_their_scatter():
    record = _digitised(impact(noise=0.2, force_noise=0.02), 0.2, 0.02)
    starts = [h.start for h in record.histories]
    assert coarser(record, steps_in(record, starts)) == ()
    assert np.array_equal(estimate(record).variance[0, :, 0], estimation_module._from_blows(record, "H1", 0.0, 15)[2])


@pytest.mark.parametrize("bits", [16, 24])
def test_fine_converters_change_nothing(bits):
    step = 2 * 100.0 / 2**bits
    record = _digitised(impact(noise=0.02, force_noise=0.004), step, step)
    assert np.array_equal(estimate(record).variance[0, :, 0], estimation_module._from_blows(record, "H1", 0.0, 15)[2])


def test_user_is_told_once_and_how_to_mend_it(tmp_path):
    campaign = small_campaign(channels=("tool_x",))
    (record,) = campaign.records
    blows = []
    for k in range(2):
        force, motion = blow(50.0, 0.1 + 0.01 * k, 3.0)
        blows.append(History(FS, _rounded(force, 0.1), _rounded(motion[None], 0.2), ("tool_x",), f"blow {k}"))
    records = (
        replace(record, name="a.tdms", histories=tuple(blows)),
        replace(record, name="b.tdms", position=0.5, histories=tuple(blows[::-1])),
    )
    write_campaign(Campaign("c", tmp_path, campaign.machine, records), tmp_path / "c")
    said = [w for w in read_campaign(tmp_path / "c").warnings if "converter" in w]
    assert len(said) == 1
    assert "a.tdms and 1 more" in said[0]
    assert "tool_x" in said[0]
    assert "lower the range" in said[0]


def test_what_coarse_steps_lose_is_not_held_for_a_law_in_the_force():
    rng = np.random.default_rng(4)
    analog = _struck(rng, 4, 0.02)
    assert np.isnan(blow_scatter(_digitised(analog, 0.3, 0.02), band=(20, 300)).significance[0])
    assert blow_scatter(_digitised(analog, 0.03, 0.02), band=(20, 300)).significance[0] > 0.0


def test_part_of_a_response_that_coarse_steps_spoil():
    """Where less than a step is left of the response it is spoilt; at the resonance, hundreds of steps tall, it is not."""
    rng = np.random.default_rng(8)
    fine = _struck(rng, 3, 0.0)
    coarse = _digitised(fine, 0.6, 0.05)
    true, seen = estimate(fine), estimate(coarse)
    part = rounded_part(seen, rounding_variance(coarse), 10.0)
    assert part.shape == seen.data[0, :, 0].shape
    assert not rounding_variance(_digitised(fine, 1e-4, 1e-4)).any()
    power = np.abs(true.data[0, 0, 0]) ** 2
    error = np.abs(seen.data - true.data)[0, 0, 0] ** 2
    told = (seen.freq > 5.0) & (seen.freq < 200.0)
    spoilt = told & (part[0] > 0.05**2)
    kept = told & ~spoilt
    assert spoilt.any()
    assert kept.any()
    assert np.sum(error[kept]) < 0.05**2 * np.sum(power[kept])
    assert np.sum(error[spoilt]) > 0.05**2 * np.sum(power[spoilt])
    assert not spoilt[np.argmax(np.where(told, power, 0.0))]


@pytest.mark.parametrize("steps", [1.6, 2.6])
def test_nothing_is_left_of_a_response_that_moves_by_a_step_or_two(steps):
    fine = _struck(np.random.default_rng(8), 3, 0.0)
    largest = max(float(np.max(np.abs(h.responses))) for h in fine.histories)
    coarse = _digitised(fine, largest / steps, 0.05)
    part = rounded_part(estimate(coarse), rounding_variance(coarse), 10.0)
    freq = estimate(fine).freq
    told = (freq > 20.0) & (freq < 200.0)
    assert np.mean(part[0, told] > 0.05**2) > 0.8


@pytest.mark.parametrize(("corner", "peak"), [(0.15, 20.0), (0.15, 60.0), (0.5, 60.0)])
def test_what_a_channel_hides_on_one_step_is_counted(corner, peak):
    # An AC-coupled force swings back by less than a step, or by few, for seconds.
    fs, step = 8000.0, 0.08
    time = np.arange(16000) / fs
    over = []
    for k in range(40):
        area = peak * (1 + 0.1 * RNG.random()) * 2.5e-3
        force = np.where(time < 0.005, np.sin(np.pi * time / 0.005), 0.0) * area * np.pi / 0.01
        after = np.maximum(time - 0.0025, 0.0)
        force = force - area * 2 * np.pi * corner * np.exp(-2 * np.pi * corner * after) * (time > 0.0025)
        force = np.concatenate([np.zeros(400), force])
        read = _rounded(force, step)
        h = History(fs, read, np.zeros((1, read.size)), ("a",), f"blow {k}")
        freq, window = np.fft.rfftfreq(read.size, 1 / fs), np.ones(read.size)
        record = _record([h])
        hidden = hidden_power(record, steps_in(record, [400]), freq, window)[0]
        lost = np.abs(np.fft.rfft(read - force) / fs) ** 2
        band = (freq > 0.3) & (freq < 40.0)
        over.append(lost[band] / hidden[band])
    assert 0.3 < np.mean(over) < 1.2


def test_nothing_is_hidden_where_noise_dithers():
    noise = 0.1 * RNG.standard_normal(4000)
    h = History(2000.0, _rounded(noise, 0.08), noise[None], ("a",), "blow 1")
    record = _record([h])
    assert not hidden_power(record, steps_in(record, [100]), np.array([1.0, 10.0]), np.ones(4000)).any()
