"""The trial's own rail against closed forms."""

import numpy as np
import pytest

pytest.importorskip("exudyn")

from cutvib_ss.validation.rig.beam import RailMatrices, rail_matrices
from cutvib_ss.validation.rig.fittings import Crack, Fittings, Lump, Shear, Supports, Twist
from cutvib_ss.validation.rig.structure import Rail


def frequencies(rail: RailMatrices) -> np.ndarray:
    squares = np.linalg.eigvals(np.linalg.solve(rail.mass, rail.stiffness)).real
    return np.sqrt(np.sort(squares)) / (2 * np.pi)


def static(rail: RailMatrices, row: int = 0) -> float:
    """Deflection of an interface coordinate under a unit force there."""
    return float(np.linalg.inv(rail.stiffness)[row, row])


def bending_stiffness(rail: Rail) -> float:
    return rail.mass / rail.length * (2 * np.pi * rail.first_frequency) ** 2 * (rail.length / np.pi) ** 4


def test_a_pinned_rail_has_its_frequencies_and_damping_in_every_mode() -> None:
    rail = rail_matrices(Rail(), Fittings(), 0.37, 12000.0)
    r = np.arange(1, 9)
    assert frequencies(rail)[:4] == pytest.approx(31.7 * r[:4] ** 2, rel=3e-5)
    squares, modes = np.linalg.eig(np.linalg.solve(rail.mass, rail.stiffness))
    ratios = np.diag(np.linalg.solve(modes, np.linalg.solve(rail.mass, rail.damping) @ modes)) / 2 / np.sqrt(squares)
    assert ratios[np.argsort(squares)][:6] == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("position", [0.02, 0.37, 0.5])
def test_a_pinned_rail_deflects_as_a_beam_on_two_supports(position: float) -> None:
    rail = Rail()
    a, b = position * rail.length, (1 - position) * rail.length
    expected = a**2 * b**2 / (3 * bending_stiffness(rail) * rail.length)
    assert static(rail_matrices(rail, Fittings(), position, 12000.0)) == pytest.approx(expected, rel=1e-9)


def test_supports_add_their_own_deflection_and_move_a_rigid_rail_without_damping() -> None:
    rail, y = Rail(), 0.3
    supported = rail_matrices(rail, Fittings(supports=Supports(4e6, 9e6)), y, 12000.0)
    pinned = rail_matrices(rail, Fittings(), y, 12000.0)
    assert static(supported) == pytest.approx(static(pinned) + (1 - y) ** 2 / 4e6 + y**2 / 9e6, rel=1e-9)
    weak = rail_matrices(rail, Fittings(supports=Supports(10.0, 10.0)), y, 12000.0)
    shape = np.linalg.solve(weak.stiffness, weak.stiffness[:, 0])
    rigid = np.linalg.eigh(weak.stiffness)[1][:, 0]
    assert rigid @ weak.damping @ rigid < 1e-6 * np.trace(weak.damping) * (rigid @ rigid)
    assert np.isfinite(shape).all()


def test_shear_and_rotary_inertia_are_timoshenkos() -> None:
    ratio, modulus = 60.0, 0.25
    rail = rail_matrices(Rail(), Fittings(shear=Shear(ratio, modulus)), 0.37, 12000.0)
    r2 = np.arange(1.0, 7) ** 2
    # the lower root of Timoshenko's quadratic for pinned ends, in squares of Euler's first frequency
    shear, rotary = r2 / ratio, r2 * modulus / ratio
    a, b = shear * rotary / r2**2, 1 + shear + rotary
    squares = (b - np.sqrt(b**2 - 4 * a * r2**2)) / (2 * a)
    assert frequencies(rail)[:4] == pytest.approx(31.7 * np.sqrt(squares[:4]), rel=3e-5)


def test_a_twisting_rail_has_the_shafts_frequencies_and_the_exact_twist_under_the_head() -> None:
    twist = Twist(0.05, 0.5, 220.0, 0.02)
    y = 0.37
    rail = rail_matrices(Rail(), Fittings(twist=twist), y, 12000.0)
    assert rail.interface[:2] == ("base", "twist")
    both = np.sort(np.concatenate([31.7 * np.arange(1, 14) ** 2, 220.0 * np.arange(1, 20)]))
    assert frequencies(rail)[:5] == pytest.approx(both[:5], rel=3e-5)
    rigidity = twist.inertia * 2.5 * (2 * 220.0) ** 2  # GJ of a shaft of 2.5 m
    assert static(rail, 1) == pytest.approx(y * (1 - y) * 2.5 / rigidity, rel=1e-9)


def test_a_mass_on_the_rail_weighs_and_is_damped_where_it_is() -> None:
    lump = Lump(0.6, 5.0, 40.0)
    with_lump, without = (rail_matrices(Rail(), Fittings(lumps=x), 0.6, 12000.0) for x in ((lump,), ()))
    assert with_lump.mass[0, 0] - without.mass[0, 0] == pytest.approx(5.0)
    assert with_lump.damping[0, 0] - without.damping[0, 0] == pytest.approx(40.0)


def test_ends_that_resist_turning_stiffen_the_rail_up_to_clamped() -> None:
    clamped = frequencies(rail_matrices(Rail(), Fittings(fixity=(1e12, 1e12)), 0.37, 12000.0))
    assert clamped[0] / 31.7 == pytest.approx((4.730041 / np.pi) ** 2, rel=1e-4)


def test_a_crack_adds_the_turn_of_its_hinge() -> None:
    rail, y, stiffness = Rail(), 0.4, 2e5
    cracked = rail_matrices(rail, Fittings(crack=Crack(y, stiffness)), y, 12000.0)
    whole = rail_matrices(rail, Fittings(), y, 12000.0)
    moment = y * (1 - y) * rail.length  # of a unit force there
    assert static(cracked) == pytest.approx(static(whole) + moment**2 / stiffness, rel=1e-9)


def test_a_truncated_model_keeps_the_first_modes_alone() -> None:
    few = rail_matrices(Rail(truncation=3), Fittings(), 0.37, 12000.0)
    assert frequencies(few) == pytest.approx(31.7 * np.arange(1, 4) ** 2, rel=1e-5)
    shapes = np.sin(np.pi * 0.37 * np.arange(1, 4)) ** 2
    expected = np.sum(2 / 76.5 * shapes / (2 * np.pi * 31.7 * np.arange(1, 4) ** 2) ** 2)
    assert static(few) == pytest.approx(expected, rel=1e-5)
