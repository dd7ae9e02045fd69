"""The rail's twist against the continuous shaft, whose receptance under a torque is known in closed form."""

import numpy as np
import pytest

from cutvib_ss.model.rail import Rail, Torsion, rail
from cutvib_ss.model.twist import TWIST_MODES, twist_shapes, twist_stiffness
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
    given = np.sum(twist_shapes(position) ** 2 / twist_stiffness())
    assert given == pytest.approx(np.pi**2 * position * (1 - position) / 2, rel=1e-12)


def test_the_second_order_form_has_the_shaft_s_frequencies() -> None:
    system = rail(Rail(recovered_rail(), torsion=TORSION), {"base": 0.5})
    twist = [i for i, name in enumerate(system.dofs) if name.startswith("twist")]
    frequencies = np.sqrt(np.diag(system.stiffness)[twist] / np.diag(system.mass)[twist]) / (2 * np.pi)
    assert frequencies[:TWIST_MODES] == pytest.approx(150.0 * np.arange(1, TWIST_MODES + 1), rel=1e-12)
