"""Instruments and hands as they are: filters, couplings, clocks, windows, hammers, records that went wrong."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("exudyn")

from cutvib_ss.validation.rig import draw_case
from cutvib_ss.validation.rig.blows import BLOCK, FS, HAMMERS, Pulse
from cutvib_ss.validation.rig.campaign import Campaign
from cutvib_ss.validation.rig.chain import filtered, recorded, sensed, windowed
from cutvib_ss.validation.rig.conditions import BAD, draw_conditions, roughened
from cutvib_ss.validation.rig.structure import CHANNELS, Chain, Filter, Window

SMALL = {"positions": (0.3,), "levels": (50.0, 100.0), "blows": 2, "overloads": 0, "file_format": "tdms"}
COUNT = round(BLOCK * FS)
TIME = np.arange(COUNT + 400) / FS
TONE = np.tile(np.sin(2 * np.pi * 100.0 * TIME) * np.exp(-8 * TIME), (3, 1))


def shown(chain: Chain, force: np.ndarray | None = None) -> np.ndarray:
    return sensed(chain, CHANNELS, np.zeros(TIME.size) if force is None else force, TONE, 0.0)


def test_a_sound_chain_shows_what_is_there() -> None:
    assert shown(Chain()) == pytest.approx(TONE[:, :COUNT], abs=1e-9)


def test_filters_have_their_corners_and_the_flattest_one_is_a_delay_low_down() -> None:
    freq = np.array([1.0, 1000.0, 5000.0])
    assert abs(filtered([Filter("lowpass", 1000.0)], freq)[1]) == pytest.approx(np.sqrt(0.5))
    assert abs(filtered([Filter("highpass", 1000.0)], freq)[1]) == pytest.approx(np.sqrt(0.5))
    assert filtered([Filter("slope", 1000.0, 0.1)], freq)[1] == pytest.approx(1.0)
    low = np.linspace(15.0, 200.0, 20)
    delay = -np.unwrap(np.angle(filtered([Filter("bessel", 1000.0)], low))) / (2 * np.pi * low)
    assert delay == pytest.approx(1 / (2 * np.pi * 1000.0), rel=0.01)


def test_leaks_clock_feedthrough_and_zero_shift() -> None:
    leak = shown(Chain(tilts=(("tool_z", "tool_x", 0.2, 0.0),)))
    assert leak[1] == pytest.approx(1.2 * TONE[1, :COUNT], abs=1e-9)
    fast = shown(Chain(clock=1e-3))[0]
    late = TIME[:COUNT] * (1 + 1e-3)
    assert fast[:2000] == pytest.approx((np.sin(2 * np.pi * 100.0 * late) * np.exp(-8 * late))[:2000], abs=2e-3)
    force = np.where(np.abs(TIME - 0.05) < 0.001, 40.0, 0.0)
    assert (shown(Chain(feedthrough=0.1), force) - shown(Chain()))[2] == pytest.approx(0.1 * force[:COUNT], abs=1e-9)
    shift = (shown(Chain(shift=(0.1, 50.0)), force) - shown(Chain()))[0]
    assert np.abs(shift[:180]).max() < 0.02
    assert shift.max() == pytest.approx(0.1 * np.abs(TONE).max(), rel=0.2)


def test_windows_are_what_they_are_called() -> None:
    time = TIME[:COUNT]
    force, responses = windowed(Window("exponential", 10.0), time)
    assert force == pytest.approx(np.exp(-10 * time))
    assert responses == pytest.approx(force)
    force, responses = windowed(Window("late", 10.0, 0.5), time)
    assert force.min() == 1.0
    assert responses[time < 0.5].min() == 1.0
    assert windowed(Window("cut", 0.0, 0.5), time)[1].sum() / FS == pytest.approx(0.5, abs=1e-3)
    taper = windowed(Window("taper", 2.0, 0.5), time)[1]
    assert taper[round(0.75 * FS)] == pytest.approx(0.5, abs=1e-3)
    assert np.abs(taper[time > 1.0]).max() < 1e-9


def test_an_ac_coupled_input_loses_what_is_slow_and_a_coarse_converter_has_steps() -> None:
    conditions = replace(
        draw_conditions(np.random.default_rng(0)),
        coupling=(0.0, 1.0),
        bits=12,
        wander=0.0,
        noise=(1e-6,) * 3,
        force_noise=1e-6,
    )
    level = np.ones((3, COUNT)) + TONE[:, :COUNT]
    _, plain = recorded(Chain(), conditions, np.zeros(COUNT), level, np.random.default_rng(0), False)
    assert np.abs(plain[0, -400:]).max() < 0.01, "what stays is taken away"
    steps = np.unique(np.diff(np.unique(plain[0])).round(9))
    assert steps[0] == pytest.approx(2 * max(conditions.response_range, 1.0) / 2**12, rel=0.3)


def test_hammers_differ_in_shape_and_hardly_in_what_they_mean() -> None:
    time = np.arange(0.0, 0.05, 1e-5)
    pulses = {name: Pulse(0.01, 50.0, 3e-3, -0.1, name, detail).force(time) for name, detail in HAMMERS.items()}
    for name, pulse in pulses.items():
        assert 40.0 < pulse.max() < 65.0, name
        assert np.abs(pulse[time < 0.01]).max() == 0.0
        if name != "half_sine":
            assert np.abs(pulse - pulses["half_sine"]).max() > 1.0


@pytest.mark.parametrize("kind", BAD)
def test_a_record_goes_wrong_and_the_others_do_not(kind: str) -> None:
    case = draw_case(9, "none", conditions=SMALL)
    good = case.campaign
    bad = Campaign(case.rig, replace(case.conditions, bad=((1, kind),)), 9)
    pairs = [(good.recording(i, 0), bad.recording(i, 0)) for i in range(2)]
    assert np.array_equal(pairs[0][0][1], pairs[0][1][1])
    change = np.abs(pairs[1][0][1] - pairs[1][1][1]).max()
    assert change > 0.2


def test_rough_conditions_are_drawn_and_told() -> None:
    rng = np.random.default_rng(1)
    drawn = [roughened(draw_conditions(rng), rng) for _ in range(60)]
    assert {c.hammer for c in drawn} == set(HAMMERS) - {"half_sine"}
    assert {c.bits for c in drawn} == {12, 16, 24}
    assert 10 < sum(bool(c.bad) for c in drawn) < 50
    assert any(c.coupling[1] > 0 for c in drawn)
    label = draw_case(2, "none", conditions=SMALL, traits=("rough",)).label["conditions"]
    assert {"hammer", "coupling", "bad_records", "bits"} <= set(label)
