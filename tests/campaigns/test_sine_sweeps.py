"""Stepped sines on a structure that is no machine: the responses are integrated in time here, by nothing of the package's."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss import diagnose, read_campaign

MASS = np.array([[2.0, 0.0], [0.0, 1.0]])
DAMPING = np.array([[9.0, -4.0], [-4.0, 4.0]])
STIFFNESS = np.array([[9.0e4, -3.0e4], [-3.0e4, 3.0e4]])
FREQ = np.arange(12.0, 48.0, 0.4)
LEVELS = np.array([1.0, 4.0, 10.0])
CYCLES, STEPS = 220, 100

MACHINE = f"""
[model]
kind = "second_order"
dofs = ["x1", "x2"]
mass = {MASS.tolist()}
damping = {DAMPING.tolist()}
stiffness = {STIFFNESS.tolist()}
[ports]
drive = [1.0, 0.0]
joint = [-1.0, 1.0]
far = [0.0, 1.0]
[channels]
a = {{ port = "drive", quantity = "acceleration" }}
b = {{ port = "far", quantity = "acceleration" }}
[input]
force = "drive"
[tolerance]
mass = 0.01
damping = 0.2
stiffness = 0.01
calibration = 0.01
"""


def steady(law: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """
    First harmonic of both accelerations over the force, shape (2, level, frequency).

    Every level and frequency is an oscillator of its own, stepped after Runge and Kutta until it has settled.
    """
    level, w = (part.ravel() for part in np.meshgrid(LEVELS, 2 * np.pi * FREQ, indexing="ij"))
    inverse = np.linalg.inv(MASS)

    def accelerations(turn: float, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        force = -STIFFNESS @ x - DAMPING @ v
        force[0] += level * np.sin(2 * np.pi * turn)
        f = law(x[1] - x[0], v[1] - v[0])
        force[0] += f
        force[1] -= f
        return inverse @ force

    h = 2 * np.pi / w / STEPS
    x, v, out = np.zeros((2, w.size)), np.zeros((2, w.size)), np.zeros((2, w.size), dtype=complex)
    for step in range(CYCLES * STEPS):
        turn = step / STEPS
        a1 = accelerations(turn, x, v)
        if step >= (CYCLES - 4) * STEPS:
            out += a1 * np.exp(-2j * np.pi * turn)
        v2 = v + h / 2 * a1
        a2 = accelerations(turn + 0.5 / STEPS, x + h / 2 * v, v2)
        v3 = v + h / 2 * a2
        a3 = accelerations(turn + 0.5 / STEPS, x + h / 2 * v2, v3)
        v4 = v + h * a3
        a4 = accelerations(turn + 1.0 / STEPS, x + h * v3, v4)
        x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    # Σ a e^(-iwt) over n samples is n/2 of the amplitude; the force is a sine, -i of a cosine.
    return (2j * out / (4 * STEPS) / level).reshape(2, LEVELS.size, FREQ.size)


def campaign(folder: Path, law: Callable[[np.ndarray, np.ndarray], np.ndarray], seed: int) -> Path:
    """Three stepped sines with noise of 0.3 % of a typical response."""
    rng = np.random.default_rng(seed)
    lines = ['[campaign]\ntitle = "stepped sines"\nmachine = "machine.toml"\n']
    (folder / "machine.toml").write_text(MACHINE)
    responses = steady(law)
    for k, level in enumerate(LEVELS):
        h = responses[:, k]
        noise = rng.standard_normal(h.shape) + 1j * rng.standard_normal(h.shape)
        h = h + 3e-3 * np.median(np.abs(h), axis=1, keepdims=True) * noise
        table = np.column_stack([FREQ, h[0].real, h[0].imag, h[1].real, h[1].imag])
        head = "freq [Hz],a re [m/s^2/N],a im [m/s^2/N],b re [m/s^2/N],b im [m/s^2/N]"
        np.savetxt(folder / f"sine{k}.csv", table, delimiter=",", header=head, comments="", fmt="%.9e")
        lines.append(
            f'[[record]]\nfile = "sine{k}.csv"\nkind = "frf"\nexcitation = "sine"\npeak_force = {level}\naverages = 1\n'
        )
    (folder / "campaign.toml").write_text("\n".join(lines))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "law"),
    [
        ("cubic_stiffness", lambda q, v: 3e8 * q**3),
        ("quadratic_damping", lambda q, v: 30.0 * v * np.abs(v)),
    ],
)
def test_a_law_is_named_from_stepped_sines(
    effect: str, law: Callable[[np.ndarray, np.ndarray], np.ndarray], tmp_path: Path
) -> None:
    found = diagnose(read_campaign(campaign(tmp_path, law, 4)))
    assert found.where.level_dependent
    assert found.causes[0].effect == effect
    assert found.causes[0].place == "joint"
    assert found.verdict == "explained"
    assert found.causes[0].reduced_chi2 < 1.2
    size = next(iter(found.causes[0].parameters.values()))
    truth = 3e8 if effect == "cubic_stiffness" else 30.0
    assert size.value == pytest.approx(truth, rel=0.05)
