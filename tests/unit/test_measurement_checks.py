"""Double hits, overloads, dead channels and turned signs: found, named, and nothing dropped without a word."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement import History, Record, estimate, read_campaign
from cutvib_ss.measurement.checks import check_record, overloaded, second_hit
from cutvib_ss.measurement.signs import sign_at_driving_point
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import MeasuredFrequencyResponse
from tests.unit.measurement_rig import FS, OneMass, blow, impact

MODEL = OneMass()


def _with_history(record, index, **changes):
    histories = list(record.histories)
    histories[index] = replace(histories[index], **changes)
    return replace(record, histories=tuple(histories))


def test_good_record_passes_unchanged():
    record = impact(3, 0.005, 0.05)
    checked, warnings = check_record(record, MODEL, "r.csv")
    assert warnings == ()
    assert checked.histories == record.histories


# --- double hits -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [1.0, -1.0])
@pytest.mark.parametrize(("second", "gap"), [(10.0, 0.02), (45.0, 0.012), (30.0, 1.5)])
def test_second_hit_is_found_with_its_height_and_delay(turn, second, gap):
    rng = np.random.default_rng(0)
    force, _ = blow(50.0, 0.1, second=(second, 0.1 + gap))
    found = second_hit(turn * force + 0.005 * rng.standard_normal(force.size))
    assert found is not None
    assert found[0] / FS == pytest.approx(gap, abs=1 / FS)
    assert found[1] == pytest.approx(second / 50, rel=0.05)


@pytest.mark.parametrize("noise", [0.0, 0.005, 1.0])
def test_single_hit_has_no_second(noise):
    rng = np.random.default_rng(1)
    force, _ = blow(15.0, 0.1)
    assert second_hit(force + noise * rng.standard_normal(force.size)) is None


def test_ringing_of_a_digitiser_is_no_second_hit():
    """A hit shorter than the filter: band-limited to 0.4 fs, it rings on both sides."""
    spectrum = np.zeros(1001, dtype=complex)
    spectrum[:800] = np.exp(-2j * np.pi * np.arange(800) * 150.3 / 2000) * np.cos(np.linspace(0, np.pi / 2, 800))
    assert second_hit(np.fft.irfft(spectrum)) is None


def test_double_hit_is_kept_with_a_warning():
    record = impact(3)
    force, motion = blow(50.0, 0.1, second=(20.0, 0.13))
    record = _with_history(record, 1, force=force, responses=motion[np.newaxis])
    checked, warnings = check_record(record, MODEL, "r.csv")
    assert len(checked.histories) == 3
    (warning,) = warnings
    assert "r.csv: blow 2: double hit" in warning
    assert "40 % of the first 30.0 ms after it" in warning


# --- loose cables ----------------------------------------------------------------------------------------------------


class TwoChannels(OneMass):
    """The same with a second sensor."""

    channels = {**OneMass.channels, "b": OneMass.channels["a"]}


def two_channels(gains_a, gains_b, noise_b=0.02, soften=0.0):
    """Three blows on two channels, with a gain of each in each blow; softening bends the louder motion of `b`."""
    rng = np.random.default_rng(3)
    record = impact(3, 0.005, 0.0)
    histories = []
    for h, a, b in zip(record.histories, gains_a, gains_b, strict=True):
        motion = h.responses[0]
        own = np.stack([a * motion, b * (motion - soften * motion**3 / np.max(np.abs(motion)) ** 2)])
        own += np.array([[0.02], [noise_b]]) * rng.standard_normal(own.shape)
        histories.append(replace(h, responses=own, channels=("a", "b")))
    return replace(record, channels=("a", "b"), quantities=("acceleration",) * 2, histories=tuple(histories))


def test_a_channel_whose_gain_alone_changes_is_left_out():
    checked, warnings = check_record(two_channels((1, 1, 1), (1.0, 0.7, 0.85)), TwoChannels(), "r.csv")
    assert checked.channels == ("a",)
    assert all(h.responses.shape[0] == 1 for h in checked.histories)
    (told,) = (w for w in warnings if "loose cable" in w)
    assert told.startswith("r.csv: b: its gain differs by 18 % from blow to blow")  # 0.15 of a mean of 0.85


@pytest.mark.parametrize(
    "record",
    [
        two_channels((1.0, 0.7, 0.85), (1.0, 0.7, 0.85)),  # the hammer's gain, if any
        two_channels((1, 1, 1), (1.0, 0.97, 1.02)),  # what a hand does
        two_channels((1, 1, 1), (1, 1, 1), noise_b=5.0),
        two_channels((1, 1, 1), (1.0, 0.9, 1.0), noise_b=5.0),  # it may be one, but noise hides it
        two_channels((1, 1, 1), (1, 1, 1), soften=0.9),
    ],
    ids=["all", "hand", "noise", "hidden", "softening"],
)
def test_what_is_no_loose_cable_stays(record):
    checked, warnings = check_record(record, TwoChannels(), "r.csv")
    assert checked.channels == ("a", "b")
    assert not any("loose" in w for w in warnings)


# --- overloads -------------------------------------------------------------------------------------------------------


def test_overload_is_consecutive_samples_at_the_extreme():
    rng = np.random.default_rng(2)
    wave = np.sin(np.arange(3000) * 0.02) + 0.01 * rng.standard_normal(3000)
    assert not overloaded(wave)
    assert overloaded(np.clip(wave, -0.8, 0.8))
    assert overloaded(np.minimum(wave, 0.8))
    assert overloaded(np.maximum(wave, -0.8))
    assert not overloaded(np.zeros(100))


def test_coarse_digitiser_is_no_overload():
    assert not overloaded(np.round(8 * np.sin(np.arange(3000) * 0.02)))


def test_overloaded_blow_is_dropped_with_a_word():
    record = impact(3, noise=0.05)
    motion = record.histories[1].responses
    record = _with_history(record, 1, responses=np.clip(motion, -8, 8))
    checked, warnings = check_record(record, MODEL, "r.csv")
    assert [h.name for h in checked.histories] == ["blow 1", "blow 3"]
    assert checked.averages == 2
    assert warnings == ("r.csv: blow 2: a overloaded (clipped): dropped",)


def test_overloaded_blow_is_kept_where_there_is_no_other():
    record = impact(1, noise=0.05)
    record = _with_history(record, 0, force=np.minimum(record.histories[0].force, 30.0))
    checked, warnings = check_record(record, MODEL, "r.csv")
    assert len(checked.histories) == 1
    assert "force overloaded (clipped): kept for want of another" in warnings[0]


def test_channel_overloaded_in_every_blow_is_left_out_where_there_are_others():
    record = _two_channels(impact(3, noise=0.05))
    for k, h in enumerate(record.histories):
        clean = h.responses[0] * 0.5 + 0.3 * np.random.default_rng(k).standard_normal(h.force.size)
        clipped = np.clip(h.responses[0], -8, 8) if k != 2 else np.clip(h.responses[0], -6, 6)
        record = _with_history(record, k, responses=np.vstack([clean, clipped]))
    checked, warnings = check_record(record, TwoChannels(), "r.csv")
    assert checked.channels == ("a",)
    assert len(checked.histories) == 3
    assert "r.csv: b overloaded (clipped) in every blow: left out; lower the gain and record again" in warnings
    # One clean blow, and the channel is kept with that.
    clean = np.vstack([record.histories[1].responses[0], impact(3, noise=0.05).histories[1].responses[0]])
    checked, _ = check_record(_with_history(record, 1, responses=clean), TwoChannels(), "r.csv")
    assert checked.channels == ("a", "b")
    assert [h.name for h in checked.histories] == ["blow 2"]


def test_overloaded_recording_is_named():
    rng = np.random.default_rng(3)
    force = rng.standard_normal(4000)
    history = History(500.0, force, np.clip(np.cumsum(force), -5, 5)[np.newaxis], ("a",), "1")
    record = Record("r", "timeseries", None, None, None, ("a",), ("acceleration",), (history,))
    _, warnings = check_record(record, MODEL, "r.csv")
    assert any("1: a is overloaded" in warning for warning in warnings)


# --- dead channels and forces ----------------------------------------------------------------------------------------


def _two_channels(record):
    histories = tuple(
        replace(h, responses=np.vstack([h.responses, np.full(h.force.size, 0.25)]), channels=("a", "b"))
        for h in record.histories
    )
    return replace(record, histories=histories, channels=("a", "b"), quantities=("acceleration",) * 2)


def test_dead_channel_is_left_out_with_a_word():
    checked, warnings = check_record(_two_channels(impact(2)), TwoChannels(), "r.csv")
    assert checked.channels == checked.histories[0].channels == ("a",)
    assert checked.histories[1].responses.shape[0] == 1
    assert warnings == ("r.csv: b is constant (dead channel): left out",)


def test_all_channels_dead():
    record = _with_history(impact(1), 0, responses=np.zeros((1, 8000)))
    with pytest.raises(DataFormatError, match="every response channel"):
        check_record(record, MODEL, "r.csv")


def test_zero_force():
    record = _with_history(impact(1), 0, force=np.full(8000, 0.1))
    with pytest.raises(DataFormatError, match=r"r\.csv: the force is constant"):
        check_record(record, MODEL, "r.csv")


def test_blow_without_force_is_dropped_with_a_word():
    record = _with_history(impact(3), 0, force=np.zeros(8000))
    checked, warnings = check_record(record, MODEL, "r.csv")
    assert checked.averages == len(checked.histories) == 2
    assert warnings == ("r.csv: blow 1 dropped: its force is constant (zero)",)


# --- signs -----------------------------------------------------------------------------------------------------------


def test_sign_at_the_driving_point():
    assert sign_at_driving_point(estimate(impact(3, 0.005, 0.3)), "a") > 0.99
    assert sign_at_driving_point(estimate(impact(3, 0.005, 0.3, turn=-1.0)), "a") < -0.99


def test_turned_hammer_is_named():
    _, warnings = check_record(impact(2, noise=0.05, turn=-1.0), MODEL, "r.csv")
    (warning,) = warnings
    assert "opposite signs at the driving point a" in warning
    assert "turn the sign of `force`" in warning


def _measured(turn):
    """Noisy responses of the published machine, each channel with a sign."""
    rng = np.random.default_rng(4)
    machine = published_machine()
    names = ("tool_x", "tool_z", "base_x")
    response = frequency_response(machine, [0.3], np.arange(10, 500, 0.5), outputs=names)
    data = response.data * np.array(turn)[:, np.newaxis, np.newaxis]
    noise = 0.001 * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
    frf = MeasuredFrequencyResponse(
        data + noise, response.freq, [0.3], names, ("force",), response.quantities,
        variance=np.full(data.shape, 2e-6), coherence=np.full(data.shape, 0.99), averages=3,
    )  # fmt: skip
    record = Record("r.uff", "frf", 0.3, 50.0, None, names, frf.quantities, (), frf, 3)
    return check_record(record, machine, "r.uff")[1]


@pytest.mark.parametrize(
    ("turn", "expected"),
    [
        ((1, 1, 1), []),
        ((-1, -1, -1), ["turn the sign of `force`"]),
        ((-1, 1, 1), ["turn the sign of tool_x"]),
        ((1, -1, 1), ["turn the sign of tool_z"]),
        ((1, -1, -1), ["turn the sign of tool_z", "turn the sign of base_x"]),
    ],
)
def test_nominal_model_tells_a_turned_force_from_a_turned_sensor(turn, expected):
    warnings = _measured(turn)
    assert len(warnings) == len(expected)
    for warning, words in zip(warnings, expected, strict=True):
        assert words in warning


@pytest.mark.parametrize("case", ["c01", "c03", "c06", "c08", "c09"])
def test_real_campaigns_raise_no_false_alarm(shared, case):
    """A late channel, friction and soft supports are gaps, not turned signs or double hits."""
    assert read_campaign(shared / "campaigns" / case).warnings == ()
