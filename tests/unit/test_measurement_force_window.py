"""Force window: the sensor's noise goes where no force acts; what acts, however faint or slow, stays."""

import numpy as np
import pytest
from scipy import signal

import cutvib_ss as cv
from cutvib_ss.measurement.blow_noise import blow_scatter, pretrigger_noise
from cutvib_ss.measurement.force_window import windowed
from cutvib_ss.measurement.records import History, Record

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
    made, _ = windowed(force, FS, AT - 10)
    assert np.array_equal(made, force)


def test_noise_is_taken_out_but_for_where_the_blow_acts() -> None:
    force = pulse(100.0)
    made, acts = windowed(shown(force), FS, AT - 10)
    assert acts[AT : AT + 12].all()
    assert acts.mean() < 0.05
    assert of_band(made - force) < 0.25 * of_band(shown(force) - force)


@pytest.mark.parametrize("second", [0.5, 2.0, 30.0])
def test_a_second_hit_stays_however_small(second: float) -> None:
    force = pulse(100.0) + pulse(second, AT + 900, 20)
    made, _ = windowed(shown(force), FS, AT - 10)
    assert of_band(made - force) < 0.35 * of_band(shown(force) - force)
    assert of_band(made - force) < 0.5 * of_band(force - pulse(100.0))


@pytest.mark.parametrize("corner", [0.05, 0.3, 1.5])
def test_an_ac_coupled_force_swings_back_as_it_did(corner: float) -> None:
    force = signal.lfilter(*signal.butter(1, corner, "high", fs=FS), pulse(100.0, length=30))
    made, _ = windowed(shown(force), FS, AT - 10)
    assert of_band(made - force) < 0.7 * of_band(shown(force) - force)
    slow = of_band(force - pulse(100.0, length=30), 2.0, 20.0)
    assert of_band(made - force, 2.0, 20.0) < max(0.1 * slow, of_band(shown(force) - force, 2.0, 20.0))


def test_a_force_that_acts_all_along_stays_as_it_is() -> None:
    force = shown(10.0 * np.sin(2 * np.pi * 3.0 * np.arange(COUNT) / FS) + pulse(100.0))
    assert np.array_equal(windowed(force, FS, AT - 10)[0], force)


def test_rounding_of_a_quiet_force_stands_out_of_nothing() -> None:
    step = 1.2 * NOISE
    force = np.round(shown(pulse(100.0)) / step) * step
    assert windowed(force, FS, AT - 10)[1].mean() < 0.05


def test_h1_is_free_of_the_forces_noise_and_its_variance_says_so() -> None:
    # a lightly damped mode, hardly any noise on the response: the force's noise alone would scatter H1
    b, a = signal.cont2discrete(([1.0, 0.0, 0.0], [1.0, 16.0, (2 * np.pi * 60.0) ** 2]), 1 / FS, "bilinear")[:2]
    rng = np.random.default_rng(3)
    histories = []
    for k in range(6):
        force = pulse(20.0 + k)
        motion = signal.lfilter(np.ravel(b), a, force)
        noisy = force + NOISE * rng.standard_normal(COUNT)
        histories.append(History(FS, noisy, (motion + 1e-4 * rng.standard_normal(COUNT))[np.newaxis], ("a",), str(k)))
    record = Record("r.csv", "impact", None, 20.0, None, ("a",), ("acceleration",), tuple(histories), averages=6)
    band = (30.0, 120.0)
    response = cv.estimate(record, band=band)
    _, exact = signal.freqz(np.ravel(b), a, response.freq, fs=FS)
    variance = response.variance[0, 0, 0]
    off = np.abs(response.data[0, 0, 0] - exact) ** 2 / variance
    assert np.mean(off) == pytest.approx(1.0, abs=0.4)
    without = 2.0 * NOISE**2 * COUNT / 2.0 / FS**2 * np.abs(exact) ** 2
    power = sum(np.abs(np.fft.rfft(h.force) / FS) ** 2 for h in histories)[1:]
    freq = np.fft.rfftfreq(COUNT, 1 / FS)[1:]
    assert np.median(variance / (without / np.interp(response.freq, freq, power))) < 0.15
    assert blow_scatter(record, band).ratio[0] == pytest.approx(1.0, abs=0.35)
    assert np.all(np.isfinite(pretrigger_noise(record).variance[0, 10:200]))
