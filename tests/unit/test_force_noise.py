"""Noise on the force: it goes where no force acts, what acts stays; H1 is not the smaller for it."""

import numpy as np
import pytest
from scipy import ndimage, signal

from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import merged
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.measurement.blow_noise import pretrigger_noise
from cutvib_ss.measurement.force_window import windowed
from tests.unit.struck_oscillator import OSCILLATOR, struck

FS, COUNT, AT = 4000.0, 8000, 210
NOISE = 0.02


def pulse(peak: float, at: int = AT, length: int = 12) -> np.ndarray:
    force = np.zeros(COUNT)
    force[at : at + length] = peak * np.sin(np.pi * (np.arange(length) + 0.5) / length)
    return force


def shown(force: np.ndarray, seed: int = 1) -> np.ndarray:
    return force + NOISE * np.random.default_rng(seed).standard_normal(COUNT)


def of_band(x: np.ndarray, low: float = 20.0, high: float = 800.0) -> float:
    freq = np.fft.rfftfreq(COUNT, 1 / FS)
    return float(np.linalg.norm(np.fft.rfft(x)[(freq >= low) & (freq <= high)]))


def test_a_force_without_noise_stays_as_it_is() -> None:
    force = pulse(100.0)
    made = windowed(force, FS, AT - 10)
    assert np.array_equal(made, force)


def test_noise_is_taken_out_but_for_where_the_blow_acts() -> None:
    force = pulse(100.0)
    made = windowed(shown(force), FS, AT - 10)
    assert np.array_equal(made[AT : AT + 12], shown(force)[AT : AT + 12])
    assert of_band(made - force) < 0.25 * of_band(shown(force) - force)


@pytest.mark.parametrize("second", [0.5, 2.0, 30.0])
def test_a_second_hit_stays_however_small(second: float) -> None:
    force = pulse(100.0) + pulse(second, AT + 900, 20)
    made = windowed(shown(force), FS, AT - 10)
    assert of_band(made - force) < 0.35 * of_band(shown(force) - force)
    assert of_band(made - force) < 0.5 * of_band(force - pulse(100.0))


@pytest.mark.parametrize("corner", [0.05, 0.3, 1.5])
def test_an_ac_coupled_force_swings_back_as_it_did(corner: float) -> None:
    force = signal.lfilter(*signal.butter(1, corner, "high", fs=FS), pulse(100.0, length=30))
    made = windowed(shown(force), FS, AT - 10)
    assert of_band(made - force) < 0.7 * of_band(shown(force) - force)
    slow = of_band(force - pulse(100.0, length=30), 2.0, 20.0)
    assert of_band(made - force, 2.0, 20.0) < max(0.1 * slow, of_band(shown(force) - force, 2.0, 20.0))


def test_a_force_that_acts_all_along_stays_as_it_is() -> None:
    force = shown(10.0 * np.sin(2 * np.pi * 3.0 * np.arange(COUNT) / FS) + pulse(100.0))
    assert np.array_equal(windowed(force, FS, AT - 10), force)


def test_rounding_of_a_quiet_force_stands_out_of_nothing() -> None:
    step = 1.2 * NOISE
    force = np.round(shown(pulse(100.0)) / step) * step
    assert of_band(windowed(force, FS, AT - 10) - pulse(100.0)) < 0.25 * of_band(force - pulse(100.0))


@pytest.mark.parametrize("friction", [0.3, 1.0, 3.0])
def test_noise_of_the_force_is_no_friction(friction: float) -> None:
    # friction as large as the noise holds a model that is run through it still, line by line as the structure was
    campaign = struck(noise=(0.5, 0.0005))
    group = merged(observe(campaign, campaign.machine).entries[:1], apart=True)[0]
    sticks = simulated(DryFriction("spring", friction).apply(OSCILLATOR), group).data[0, 0]
    free = simulated(OSCILLATOR, group).data[0, 0]
    measured, noise = group.data[0, 0], np.sqrt(group.variance[0, 0])
    scatter, change = (x - ndimage.uniform_filter1d(x, 9) for x in ((measured - free) / noise, (sticks - free) / noise))
    assert abs(np.vdot(scatter, change)) < 0.4 * np.linalg.norm(scatter) * np.linalg.norm(change)
    assert np.linalg.norm((measured - sticks) / noise) > np.linalg.norm((measured - free) / noise)


def test_h1_is_not_smaller_for_the_noise_of_the_force() -> None:
    # three soft blows: at the end of the band some percent of the force's power is noise
    noisy, quiet = struck(noise=(0.1, 1e-3)), struck(noise=(1e-4, 1e-3))
    e, exact = (observe(c, c.machine).entries[k] for c, k in ((noisy, 0), (quiet, 2)))
    known = pretrigger_noise(noisy.records[0])
    within = [(freq > 130.0) & (freq < 235.0) for freq in (e.freq, exact.freq, known.freq)]
    true, bias = exact.data[0, within[1]], known.bias[within[2]]
    weight = np.abs(true) ** 2 / e.variance[0, within[0]]
    left = float(np.sum(weight * (e.data[0, within[0]] / true - 1.0).real) / np.sum(weight))
    told = 1.0 / np.sqrt(2.0 * np.sum(weight))
    assert np.sum(weight * bias) / np.sum(weight) > 2.0 * told
    assert abs(left) < 2.5 * told
