"""Distances between responses: figures known in closed form, and where they end."""

from dataclasses import replace

import control
import numpy as np
import pytest

from cutvib_ss.diagnosis import metrics
from cutvib_ss.diagnosis.nu_gap import Pair
from cutvib_ss.model.measurement_chain import ChannelChain
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure

RNG = np.random.default_rng(3)


def oscillator(stiffness, damping=2.0, mass=1.0):
    one = np.ones((1, 1))
    system = SecondOrder(mass * one, damping * one, stiffness * one, ("x",), {"x": np.ones(1)})
    return Structure(system, {"y": Channel("x", "displacement")}, "x")


def noise(shape, level):
    return level * (RNG.standard_normal(shape) + 1j * RNG.standard_normal(shape)) / np.sqrt(2)


def test_frac_forgets_scale_and_log_error_counts_it():
    h = noise((2, 50), 1.0)
    assert metrics.frac(h, (3 - 2j) * h) == pytest.approx(1.0)
    assert metrics.log_error(h, 10 * h) == pytest.approx(20.0)
    assert metrics.frac(np.array([1.0 + 0j, 0]), np.array([0j, 1.0])) == 0.0


def test_chordal_distance_on_the_sphere():
    p1, p2 = noise((1, 200), 2.0), noise((1, 200), 2.0)
    d = metrics.chordal_distance(p1, p2)
    # The definition by points of the sphere of diameter one over the complex plane.
    one, two = (np.array([p.real, p.imag, np.abs(p) ** 2])[:, 0] / (1 + np.abs(p) ** 2) for p in (p1, p2))
    np.testing.assert_allclose(d, np.linalg.norm(one - two, axis=0), atol=1e-12)
    assert metrics.chordal_distance(np.array([[1e9 + 0j]]), np.array([[-1e9 + 0j]]))[0] == pytest.approx(0.0, abs=1e-8)


def test_chordal_distance_of_several_outputs_is_the_sine_of_the_angle_between_graphs():
    p1, p2 = noise((3, 40), 1.0), noise((3, 40), 1.0)
    expected = []
    for a, b in zip(p1.T, p2.T, strict=True):
        # Graphs of one input and three outputs: lines in four dimensions.
        u, v = (np.append(1.0, p) / np.sqrt(1 + np.linalg.norm(p) ** 2) for p in (a, b))
        expected.append(np.sqrt(1 - np.abs(np.vdot(u, v)) ** 2))
    np.testing.assert_allclose(metrics.chordal_distance(p1, p2), expected, atol=1e-7)


def test_noise_distance_is_exceeded_in_one_record_of_twenty():
    response = noise((1, 300), 1.5)
    variance = np.full(response.shape, 0.05**2)
    stated = metrics.noise_distance(response, variance)
    seen = [
        metrics.nu_distance(response + noise(response.shape, 0.05), response, variance) > stated for _ in range(400)
    ]
    assert 0.01 < np.mean(seen) < 0.10


def test_what_is_farther_than_noise_shows():
    response = noise((1, 300), 1.0)
    variance = np.full(response.shape, 0.02**2)
    off = response.copy()
    off[:, 100:120] += 0.5
    assert metrics.nu_distance(off, response, variance) > 3 * metrics.noise_distance(response, variance)


def test_winding_holds_between_models_close_by():
    scales = {"y": 1e-3}
    assert Pair(oscillator(1e4), oscillator(1.1e4), None, scales, (1.0, 100.0)).winding() == (0, "")


@pytest.mark.parametrize(
    ("stiffness", "damping", "expected"), [(0.5e4, 2.0, 1), (0.8e4, 40.0, -1), (1.3e4, 2.0, 0), (1.3e4, 40.0, -2)]
)
def test_winding_counts_zeros_of_the_loop(stiffness, damping, expected):
    # A sensor the wrong way round, so that there is something to count.
    first, second = oscillator(1e4), oscillator(stiffness, damping)
    chain = second.chain.with_channel("y", ChannelChain(gain=-1.0))
    turns, _ = Pair(first, replace(second, chain=chain), None, {"y": 1e-4}, (1.0, 100.0)).winding()
    loop = 1 - control.tf([1e8], [1, -damping, stiffness]) * control.tf([1], [1, 2.0, 1e4])
    # Both poles of the mirrored second model lie to the right.
    assert turns == 2 - np.count_nonzero(loop.zeros().real > 0)
    assert turns == expected


def test_undamped_model_is_not_checked():
    turns, why = Pair(oscillator(1e4, 0.0), oscillator(1e4), None, {"y": 1.0}, (1.0, 100.0)).winding()
    assert turns is None
    assert "imaginary axis" in why
