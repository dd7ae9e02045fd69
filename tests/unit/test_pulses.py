"""Where a recorded blow ends: not where its sensor's noise, its amplifier's droop or its converter's last step do."""

import numpy as np
import pytest

from cutvib_ss.diagnosis.pulses import pulses_of

FS, PULSE = 4000.0, np.hanning(26)[1:-1]


def blow(peak: float = 100.0, count: int = 8000) -> np.ndarray:
    force = np.zeros(count)
    force[200 : 200 + PULSE.size] = peak * PULSE
    return force


def samples(force: np.ndarray) -> int:
    """How long the pulse that was cut out may be at most."""
    return pulses_of([force], FS, 0.05).tables[0].size


def test_noise_is_no_part_of_a_blow() -> None:
    noisy = blow() + 0.2 * np.random.default_rng(1).standard_normal(8000)
    assert samples(noisy) <= 36


def test_the_last_step_of_a_converter_is_no_part_of_a_blow() -> None:
    step = 100.0 / 400
    droop = -0.7 * step * np.exp(-np.arange(8000) / 4000)
    coarse = step * np.round((blow() + droop + 0.3 * step * np.sin(np.arange(8000))) / step)
    assert np.count_nonzero(coarse) > 1000
    assert samples(coarse) <= 36


def test_a_second_hit_is_a_part_of_its_blow() -> None:
    double = blow() + 0.2 * np.random.default_rng(2).standard_normal(8000)
    double[600 : 600 + PULSE.size] += 5.0 * PULSE
    assert samples(double) >= 400


def test_a_long_push_without_noise_is_kept() -> None:
    push = 100.0 * np.hanning(8000)
    assert samples(push) >= 7000


@pytest.mark.parametrize("z", [-3.0 + 200.0j, 0.4j])
def test_the_transform_is_the_sum_over_the_samples(z: complex) -> None:
    forces = [blow(), blow(40.0)]
    start = 200 / FS
    shown = pulses_of(forces, FS, start).transform(np.array([z]))
    times = np.arange(8000) / FS - start
    assert shown[0] == pytest.approx([np.sum(f * np.exp(-z * times)) for f in forces], rel=2e-3)
