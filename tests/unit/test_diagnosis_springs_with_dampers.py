"""A port that hardens and loses more energy as it moves more: one restoring force of each kind."""

from pathlib import Path

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.restoring_forces import law, registered
from tests.unit.struck_oscillator import DAMPING, FINE, MASS, OSCILLATOR, SPRING

CUBIC, QUADRATIC = 4e9, 60.0


def hit(force: np.ndarray, step: float) -> np.ndarray:
    """Acceleration of the oscillator beside both restoring forces, by semi-implicit Euler steps of a sixteenth of a sample."""
    x = v = 0.0
    out = np.empty(force.size)
    for i, f in enumerate(force.tolist()):
        a = (f - DAMPING * v - SPRING * x - CUBIC * x**3 - QUADRATIC * abs(v) * v) / MASS
        out[i] = a
        v += step * a
        x += step * v
    return out


@pytest.fixture(scope="module")
def answer():
    rng, fs, count, records = np.random.default_rng(7), 1024.0, 2048, []
    fine = np.arange(count * FINE) / (FINE * fs)
    for k, level in enumerate((60.0, 200.0, 600.0)):
        histories = []
        for _ in range(3):
            force = level * rng.uniform(0.9, 1.1) * np.sin(np.pi * np.clip((fine - 0.05) / 0.006, 0.0, 1.0)) ** 2
            response = hit(force, 1.0 / (FINE * fs))[::FINE] + 0.02 * rng.standard_normal(count)
            measured = force[::FINE] + 0.02 * rng.standard_normal(count)
            histories.append(History(fs, measured, response[None], ("a",)))
        records.append(Record(f"r{k}", "impact", None, level, None, ("a",), ("acceleration",), tuple(histories)))
    return cv.diagnose(Campaign("", Path(), OSCILLATOR, tuple(records), ()))


def test_both_are_named_with_their_sizes(answer):
    best = answer.causes[0]
    assert {*best.effect.split("+")} == {"cubic_stiffness", "quadratic_damping"}
    assert best.probability > 0.9
    found = {name.rpartition(".")[2]: value.value for name, value in best.parameters.items()}
    assert found["stiffness3"] == pytest.approx(CUBIC, rel=0.05)
    assert found["coefficient"] == pytest.approx(QUADRATIC, rel=0.1)


def test_forces_are_told_apart_by_what_they_do_with_energy():
    loses = {name for name, law in registered().items() if law.dissipates()}
    assert loses == {"dry_friction", "joint_slip", "local_damping", "quadratic_damping"}
    # By their describing functions at one amplitude: what loses energy has an imaginary part.
    for name, parameters in {
        "cubic_stiffness": {"stiffness3": 1e9},
        "dry_friction": {"torque": 1.0},
        "quadratic_damping": {"coefficient": 1.0},
        "joint_slip": {"stiffness": 1e4, "slip_torque": 1.0},
    }.items():
        z = law(name)(**parameters).describing_function(1e-3, 100.0)
        assert (abs(z.imag) > 1e-9 * abs(z)) == (name in loses)
