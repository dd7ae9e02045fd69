"""Bands that stand out of noise and drift; FRAC and MAC; single blows that order with their force."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cutvib_ss.diagnosis import where
from cutvib_ss.diagnosis.correlation import frac, mac, mode_pairs
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.linearity import blows_order, chance_of_order, drift_of_any_order, level_stands_out
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records, merged, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import with_values
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from tests.unit.measurement_rig import FS, blow
from tests.unit.record_example import entry_of

W0, ZETA = 2 * np.pi * 60.0, 0.02
FREQ = np.arange(30.0, 150.0, 0.5)
S = 2j * np.pi * FREQ
NOISE = 0.02


def oscillator() -> Structure:
    """A mass of 1 kg on a spring, drive point accelerance."""
    system = SecondOrder(np.eye(1), [[2 * ZETA * W0]], [[W0**2]], ("x",), {"x": np.ones(1)})
    return Structure(system, {"a": Channel("x", "acceleration")}, "x")


def sessions(drift, bump=0.0, count=8):
    """A record a session: its stiffness drifts, and a resonance that the model lacks is there or not."""
    rng, out = np.random.default_rng(3), []
    for k in range(count):
        stiffness = W0**2 * (1.0 + drift * rng.standard_normal())
        data = S**2 / (S**2 + 2 * ZETA * W0 * S + stiffness)
        data = data * (1.0 + bump * 20.0 * S / (S**2 + 20.0 * S + (2 * np.pi * 110.0) ** 2))
        variance = (NOISE * np.abs(data)) ** 2
        data = data + np.sqrt(variance / 2) * (rng.standard_normal(S.size) + 1j * rng.standard_normal(S.size))
        out.append(entry_of(k, None, None, data[None], variance[None], FREQ, ("a",), ("acceleration",)))
    return out


def stand_out(entries, sizes=None):
    problem = Problem(oscillator(), merged(entries), Hypothesis())
    x = problem.start()
    predictions, residuals, _ = problem.residuals(x)
    drifts = None if sizes is None else where.drift_squares(problem, x, predictions, sizes)
    return where.bands(list(zip(problem.groups, residuals, strict=True)), 5.0, drifts)


def test_a_band_that_drift_explains_does_not_stand_out():
    entries = sessions(0.01)
    assert any(low < 60.0 < high for low, high in stand_out(entries))
    assert stand_out(entries, Sizes(drift=0.01)) == ()
    # A drift that is stated far too small explains nothing.
    assert any(low < 60.0 < high for low, high in stand_out(entries, Sizes(drift=1e-4)))


def test_an_error_beside_the_drift_still_stands_out():
    found = stand_out(sessions(0.01, bump=0.1), Sizes(drift=0.01))
    assert found
    assert all(90.0 < low < 110.0 < high < 130.0 for low, high in found)


def test_squares_of_drift_are_what_draws_of_it_come_to():
    problem = Problem(oscillator(), merged(sessions(0.0, count=1)), Hypothesis())
    x = problem.start()
    predictions, _, _ = problem.residuals(x)
    (told,) = where.drift_squares(problem, x, predictions, Sizes(drift=1e-3))
    rng, size, weight = np.random.default_rng(5), 1e-3, np.sqrt(2.0 / problem.groups[0].variance[0])
    plain = S**2 / (S**2 + 2 * ZETA * W0 * S + W0**2)
    total, draws = np.zeros(S.size), 4000
    for _ in range(draws):
        # Stiffness and gain drift alike; damping by its tolerance over that of the stiffness.
        k, gain, c = rng.standard_normal(), rng.standard_normal(2), rng.standard_normal()
        more = oscillator().tolerance.damping / oscillator().tolerance.stiffness
        moved = S**2 / (S**2 + 2 * ZETA * W0 * np.exp(more * size * c) * S + W0**2 * np.exp(size * k))
        total += np.abs(weight[0] * (moved * (1.0 + size * (gain[0] + 1j * gain[1])) - plain)) ** 2
    assert told[0, 0] == pytest.approx(total / draws, rel=0.12)


# --- correlation ------------------------------------------------------------------------------------------------------


def test_frac_and_mac_know_no_scale():
    rng = np.random.default_rng(1)
    a = rng.standard_normal((5, 3)) + 1j * rng.standard_normal((5, 3))
    turned = a * np.array([2.0, -1.0j, 0.3 + 0.1j])
    np.testing.assert_allclose(np.diag(mac(a, turned)), 1.0)
    orthogonal, _ = np.linalg.qr(a)
    np.testing.assert_allclose(mac(orthogonal, orthogonal), np.eye(3), atol=1e-12)
    assert frac(a[:, 0], (1 + 2j) * a[:, 0]) == pytest.approx(1.0)
    assert frac(a[:, 0], np.zeros(5)) == 0.0


def test_modes_are_followed_from_the_nominal_to_the_corrected_machine():
    machine = published_machine()
    softer = with_values(machine, {("head", "k2"): 0.9 * machine.head.k2})
    pairs = mode_pairs(machine, softer, (0.3, 0.5), (15.0, 450.0))
    assert {p.position for p in pairs} == {0.3, 0.5}
    assert all(p.mac > 0.9 and 0.9 < p.corrected_hz / p.nominal_hz < 1.001 for p in pairs)
    assert min(p.corrected_hz / p.nominal_hz for p in pairs) < 0.97
    # A panel adds a mode of its own, which continues none.
    panel = LocalResonator("head", 0.8, 120.0, 0.02).apply(machine)
    more = mode_pairs(machine, panel, (0.5,), (15.0, 450.0))
    alone = [p for p in more if p.nominal_hz is None]
    assert len(alone) == 1
    assert alone[0].mac is None
    assert abs(alone[0].corrected_hz - 120.0) < 15.0
    assert len(more) == len(mode_pairs(machine, machine, (0.5,), (15.0, 450.0))) + 1


def test_modes_of_a_structure():
    (pair,) = mode_pairs(oscillator(), oscillator(), (None,), (15.0, 150.0))
    assert (pair.mac, pair.position) == (pytest.approx(1.0), None)
    assert pair.corrected_hz == pytest.approx(60.0)
    assert pair.corrected_damping == pytest.approx(ZETA)


# --- single blows -----------------------------------------------------------------------------------------------------


def blows(law, seed=0):
    """Six blows of one record, of a mode that softens with the peak of the force, or does not."""
    rng, histories = np.random.default_rng(seed), []
    for k, peak in enumerate((30.0, 40.0, 50.0, 60.0, 70.0, 75.0)):
        force, _ = blow(peak, 0.25, 4.0)
        freq = np.fft.rfftfreq(force.size, 1.0 / FS)
        s = 2j * np.pi * freq
        w = W0 * (1.0 - law * peak)
        motion = np.fft.irfft(np.fft.rfft(force) * s**2 / (s**2 + 2 * 0.02 * w * s + w**2), force.size)
        histories.append(
            History(
                FS,
                force + 0.02 * rng.standard_normal(force.size),
                (motion + 0.02 * rng.standard_normal(motion.size))[None],
                ("a",),
                str(k),
            )
        )
    record = Record("r", "impact", None, 50.0, None, ("a",), ("acceleration",), tuple(histories), band_hz=(30.0, 150.0))
    return Campaign("c", ".", oscillator(), (record,))


def test_blows_that_order_with_their_force_are_nonlinearity_at_one_level():
    curved, straight = (observe(blows(law), oscillator()).entries for law in (1e-4, 0.0))
    assert blows_order(Records(curved))
    assert level_stands_out(Records(curved))
    assert not blows_order(Records(straight))
    assert not level_stands_out(Records(straight))
    # Levels that were compared and agree know better.
    agree = (curved[0], replace(curved[0], record=1, level=150.0))
    assert not level_stands_out(Records(tuple(replace(e, session="day") for e in agree)))


@pytest.mark.parametrize(
    ("ordered", "random", "found"), [(1.0, 0.2, True), (0.0, 1.0, False), (1.0, 1.0, False), (1.0, 0.0, True)]
)
def test_drift_that_orders_with_the_level_is_told_from_drift_that_does_not(ordered, random, found):
    """Four positions at two levels in sessions of their own; the drift of two stiffnesses and of a channel's gain."""
    rng, levels = np.random.default_rng(1), np.tile([20.0, 100.0], 4)
    ones = np.ones((1, FREQ.size))
    entries = tuple(
        entry_of(k, 0.1 + 0.2 * (k // 2), level, ones, ones, FREQ, ("a",), ("acceleration",), session=f"day {k // 2}")
        for k, level in enumerate(levels)
    )
    layout = Layout(2, ((0.0,),), ("a",), (0, 1), (), (), 1, tuple(range(8)))
    drift = random * rng.standard_normal((8, layout.per_session))
    drift[:, 0] += ordered * np.log(levels) + np.repeat(rng.standard_normal(4), 2)
    offsets = np.zeros(layout.size)
    offsets[layout.first_within : layout.first_nominal] = drift.ravel()
    spread = Spread(layout, Sizes(), offsets, np.eye(layout.size))
    assert (chance_of_order(spread, Records(entries)) < 0.05) is found
    # One level a session tells nothing, nor do records that hardly drift.
    apart = tuple(replace(e, session=str(e.record)) for e in entries)
    assert chance_of_order(spread, Records(apart)) == 1.0
    still = replace(spread, sizes=Sizes(within=0.3 * SETTINGS.level_hiding_within))
    assert chance_of_order(still, Records(entries)) == 1.0


@pytest.mark.parametrize(
    ("sessions", "few"),
    [
        ([[1.5, 3.0, 5.5, 5.5]], True),  # 4!/2! orders
        ([[1.5, 3.0, 5.5, 5.5, 10.0]], False),  # 5!/2!
        ([[20.0, 60.0], [20.0, 60.0], [20.0, 60.0], [20.0, 60.0]], True),  # 2⁴
        ([[20.0, 60.0, 180.0], [20.0, 60.0, 180.0]], False),  # 6²
        ([[20.0, 21.0, 60.0, 61.0]], True),  # 4!/(2! 2!): levels that nothing tells apart are one
    ],
)
def test_few_records_may_drift_in_any_order_of_their_levels(sessions, few):
    """A frame swept four times was no machine with a force: drift of 0.3 % from record to record took all of it up."""
    ones = np.ones((1, FREQ.size))
    levels = [(level, f"day {k}") for k, own in enumerate(sessions) for level in own]
    entries = tuple(
        entry_of(k, None, level, ones, ones, FREQ, ("a",), ("acceleration",), session=day)
        for k, (level, day) in enumerate(levels)
    )

    def drifts(within: float, followed: bool = True) -> bool:
        layout = SimpleNamespace(records=tuple(range(len(entries))) if followed else ())
        fit = SimpleNamespace(spread=SimpleNamespace(layout=layout, sizes=Sizes(within=within)))
        return drift_of_any_order(cast(Fit, fit), Records(entries))

    assert drifts(0.003) is few
    # What hardly drifts hides nothing, and what was not followed does not drift.
    assert not drifts(0.3 * SETTINGS.level_hiding_within)
    assert not drifts(0.003, followed=False)


@pytest.mark.parametrize(("ordered", "random", "found"), [(1.0, 0.02, True), (0.0, 1.0, False)])
def test_drift_of_sessions_that_have_a_level_each_is_told_too(ordered, random, found):
    """Six sessions of one record; the drift of two stiffnesses and of a channel's gain."""
    rng, levels, ones = np.random.default_rng(2), np.geomspace(5.0, 100.0, 6), np.ones((1, FREQ.size))
    entries = tuple(
        entry_of(k, None, level, ones, ones, FREQ, ("a",), ("acceleration",), session=str(k))
        for k, level in enumerate(levels)
    )
    layout = Layout(2, tuple(session_of(e) for e in entries), ("a",), (0, 1), (), (), 1)
    drift = random * rng.standard_normal((6, layout.per_session))
    drift[:, 0] += ordered * np.log(levels)
    offsets = np.zeros(layout.size)
    offsets[layout.unknowns : layout.unknowns + drift.size] = drift.ravel()
    spread = Spread(layout, Sizes(), offsets, np.eye(layout.size))
    assert (chance_of_order(spread, Records(entries)) < 0.05) is found


# --- figures by position and channel ----------------------------------------------------------------------------------


def judged(number, position, error, floor):
    """A held-out record of two channels with noise of one."""
    entry = SimpleNamespace(record=number, position=position, channels=("a", "b"), variance=np.ones((2, 5)))
    return SimpleNamespace(entry=entry, error=np.array([error, 2 * error]), noise=np.ones(2), floor=floor)


def test_the_floor_of_an_error_is_what_the_accepted_answer_leaves():
    # Drift that the re-tuned model needs for want of the cause is none.
    tuned = [judged(0, 0.1, 3.0, 100.0), judged(1, 0.5, 4.0, 100.0)]
    accepted = [judged(0, 0.1, 1.0, 4.0), judged(1, 0.5, 1.0, 0.5)]
    by_position = where.by_position(tuned, 1.0, accepted)
    assert [(f.label, f.error, f.noise, f.floor) for f in by_position] == [(0.1, 4.5, 1.0, 2.0), (0.5, 6.0, 1.0, 1.0)]
    by_channel = where.by_channel(tuned, ("a", "b"), 1.0, accepted)
    assert [(f.label, f.error, f.floor) for f in by_channel] == [("a", 3.5, 1.5), ("b", 7.0, 1.5)]


def test_lines_of_a_recording_that_nothing_drives_are_left_out():
    """Of a free body, whose band no natural frequency begins: lines below the excitation pass one by one by chance."""
    rng = np.random.default_rng(4)
    fs, count = 320.0, 8192
    driven = (np.fft.rfftfreq(count, 1 / fs) >= 20.0) & (np.fft.rfftfreq(count, 1 / fs) <= 120.0)
    force = np.fft.irfft(driven * np.fft.rfft(rng.standard_normal(count)))
    # A slow drift of the sensor is heard in the first lines.
    slow = 0.05 * np.sin(2 * np.pi * 0.5 * np.arange(count) / fs)
    shown = force / 2.0 + slow + 1e-3 * rng.standard_normal(count)
    system = SecondOrder(np.eye(1) * 2.0, np.eye(1), np.zeros((1, 1)), ("x",), {"p": np.ones(1)})
    body = Structure(system, {"a": Channel("p", "acceleration")}, "p")
    noisy = force + 1e-2 * force.std() * rng.standard_normal(count) + slow
    record = Record(
        "r", "timeseries", None, None, None, ("a",), ("acceleration",), (History(fs, noisy, shown[None], ("a",)),)
    )
    (e,) = observe(Campaign("", Path(), body, (record,), ()), body).entries
    assert 15.0 < e.freq[0] < 21.0
    assert 110.0 < e.freq[-1] < 125.0


@pytest.mark.parametrize("fs", [512.0, 1500.0])
def test_a_band_ends_where_the_forces_noise_is_a_hundredth_of_it(fs):
    """H1 is too small by the noise's part: of a filtered signal the lines are left out on which that is beyond a calibration."""
    rng = np.random.default_rng(8)
    count = 131072
    freq = np.fft.rfftfreq(count, 1 / fs)
    gain = 1.0 / np.sqrt(1.0 + (freq / 80.0) ** 6)
    force = np.fft.irfft(gain * np.fft.rfft(rng.standard_normal(count)))
    system = SecondOrder(np.eye(1) * 2.0, np.eye(1), np.eye(1) * 1e5, ("x",), {"p": np.ones(1)})
    body = Structure(system, {"a": Channel("p", "acceleration")}, "p")
    s = 2j * np.pi * freq
    shown = np.fft.irfft(s**2 / (2.0 * s**2 + s + 1e5) * np.fft.rfft(force))
    shown = shown + 1e-5 * shown.std() * rng.standard_normal(count)
    noisy = force + 1e-2 * rng.standard_normal(count)
    record = Record(
        "r", "timeseries", None, None, None, ("a",), ("acceleration",), (History(fs, noisy, shown[None], ("a",)),)
    )
    (e,) = observe(Campaign("", Path(), body, (record,), ()), body).entries
    # The signal's power is (80/f)⁶, that of the noise 10⁻⁴, which a signal that falls up to the Nyquist frequency does not show.
    end = 80.0 * 10 ** (1 / 3)
    assert e.freq[-1] > 0.95 * end if fs < 1000.0 else e.freq[-1] == pytest.approx(end, rel=0.08)
