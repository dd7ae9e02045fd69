"""The rail's twist against the continuous shaft, whose receptance under a torque is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import optimize

from cutvib_ss.model.rail import Rail, Torsion, rail
from cutvib_ss.model.twist import TWIST_MODES, twist_modes
from cutvib_ss.parameters import recovered_rail
from cutvib_ss.response.twist_receptance import TwistReceptance

TORSION = Torsion(eccentricity=0.05, inertia=0.8, torsion_frequency=150.0, damping_ratio=0.02)
POSITIONS = np.array([0.02, 0.0337, 0.27, 0.4873, 0.5, 0.8])


def shaft(y: np.ndarray, s: np.ndarray) -> np.ndarray:
    """
    Twist per torque at y of a uniform shaft held at both ends, shape (position, frequency).

    GK ψ'' = (J/L) s² ψ with a jump of 1/GK in the slope at y; damping by the rate of strain, GK (1 + 2ζs/ω_1).
    """
    w = 2 * np.pi * TORSION.torsion_frequency
    length = 3.0
    stiffness = TORSION.inertia * length * (w / np.pi) ** 2 * (1 + 2 * TORSION.damping_ratio * s / w)
    wave = s * np.sqrt(TORSION.inertia / length / stiffness)
    at = y[:, None] * length
    return np.sinh(wave * at) * np.sinh(wave * (length - at)) / (stiffness * wave * np.sinh(wave * length))


def test_the_receptance_is_the_continuous_shaft_s_everywhere_in_the_band() -> None:
    s = 2j * np.pi * np.linspace(1.0, 700.0, 400)
    exact = shaft(POSITIONS, s)
    error = np.abs(TwistReceptance(TORSION, POSITIONS, s).value - exact).max(axis=1) / np.abs(exact).max(axis=1)
    assert error[2:].max() < 1e-5
    # At the very ends, where the rail hardly twists, the modes left out are most of what is there.
    assert error.max() < 2e-3


@pytest.mark.parametrize("position", POSITIONS)
def test_the_static_twist_is_exact(position: float) -> None:
    held = twist_modes()
    given = np.sum(held.shapes(position) ** 2 / held.stiffness)
    assert given == pytest.approx(np.pi**2 * position * (1 - position) / 2, rel=1e-12)


def test_the_second_order_form_has_the_shaft_s_frequencies() -> None:
    system = rail(Rail(recovered_rail(), torsion=TORSION), {"base": 0.5})
    twist = [i for i, name in enumerate(system.dofs) if name.startswith("twist")]
    frequencies = np.sqrt(np.diag(system.stiffness)[twist] / np.diag(system.mass)[twist]) / (2 * np.pi)
    assert frequencies[:TWIST_MODES] == pytest.approx(150.0 * np.arange(1, TWIST_MODES + 1), rel=1e-12)


def on_springs(y: np.ndarray, s: np.ndarray, fixing: float) -> np.ndarray:
    """
    Twist per torque at y of a shaft whose ends are springs of `fixing` times its stiffness, shape (position, frequency).

    Seen from y each side is a line of that length that ends in a spring: its stiffness by the impedance of a lossy line. Damping of
    shaft and springs by the rate of strain. The shaft's own stiffness is what gives the first frequency, root of its equation.
    """
    w = 2 * np.pi * TORSION.torsion_frequency
    first = optimize.brentq(lambda b: b + 2 * np.arctan(b / fixing) - np.pi, 1e-9, np.pi)
    shaft_stiffness = TORSION.inertia * (w / first) ** 2
    k = shaft_stiffness * (1 + 2 * TORSION.damping_ratio * s / w)
    wave = s * np.sqrt(TORSION.inertia / k)
    sides = []
    for part in (y[:, None], 1 - y[:, None]):
        tanh = np.tanh(wave * part)
        sides.append(k * wave * (fixing + wave * tanh) / (wave + fixing * tanh))
    return 1.0 / (sides[0] + sides[1])


@pytest.mark.parametrize("fixing", [0.05, 0.5, 4.0, 40.0])
def test_on_soft_ends_the_receptance_is_the_continuous_shaft_s(fixing: float) -> None:
    s = 2j * np.pi * np.linspace(1.0, 700.0, 400)
    exact = on_springs(POSITIONS, s, fixing)
    soft = replace(TORSION, fixing=fixing)
    error = np.abs(TwistReceptance(soft, POSITIONS, s).value - exact).max(axis=1) / np.abs(exact).max(axis=1)
    assert error[2:].max() < 2e-5
    assert error.max() < 2e-3


def test_a_rail_on_very_soft_ends_rocks_as_one() -> None:
    shapes = twist_modes(1e-3).shapes(POSITIONS)
    # Of the inertia J, in a normalisation to J/2, the same twist everywhere is one over the root of two.
    assert shapes[:, 0] == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert twist_modes(1e6).shapes(POSITIONS) == pytest.approx(twist_modes().shapes(POSITIONS), abs=1e-4)


@pytest.mark.parametrize("fixing", [0.05, 2.0, 30.0])
def test_the_derivative_to_the_fixing_is_that_of_the_continuous_shaft(fixing: float) -> None:
    s, step = 2j * np.pi * np.array([20.0, 120.0, 160.0, 330.0]), 1e-4
    ends = [on_springs(POSITIONS, s, fixing * (1 + d)) for d in (step, -step)]
    exact = (ends[0] - ends[1]) / (2 * step * fixing)
    found = TwistReceptance(replace(TORSION, fixing=fixing), POSITIONS, s).derivative("fixing")
    assert np.abs(found - exact)[2:].max() < 1e-3 * np.abs(exact)[2:].max()
