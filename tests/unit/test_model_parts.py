"""Errors of single parts of a structure: one spring, one mass, one mode's losses, in modal coordinates."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.parts import MOST_MODES, modal_parts
from cutvib_ss.model.paths import with_value, with_values
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.response.frequency import frequency_response

FREQ = np.linspace(3.0, 60.0, 40)
MASS = np.diag([2.0, 1.0, 1.5])


def springs(to_ground: float, lower: float, upper: float) -> np.ndarray:
    return np.array([[to_ground + lower, -lower, 0.0], [-lower, lower + upper, -upper], [0.0, -upper, upper]])


def of(stiffness: np.ndarray, damping: np.ndarray | None = None, mass: np.ndarray = MASS) -> Structure:
    n = len(mass)
    ports = dict(zip("abc", np.eye(n), strict=False))
    names = tuple("xyzuvw"[k] if k < 6 else f"q{k}" for k in range(n))
    system = SecondOrder(mass, 2e-4 * stiffness if damping is None else damping, stiffness, names, ports)
    last = tuple(ports)[-1]
    return Structure(system, {"y": Channel("a", "displacement"), "t": Channel(last, "acceleration")}, "a")


def factors(structure: Structure, power: int, change: np.ndarray) -> Structure:
    """The structure with the factors on its parts that make up a change of one matrix."""
    own = [k for k, part in enumerate(structure.system.parts) if part.power == power]
    rows = np.array([structure.system.parts[k].change.ravel() for k in own])
    found, *_ = np.linalg.lstsq(rows.T, change.ravel(), rcond=None)
    assert rows.T @ found == pytest.approx(change.ravel(), abs=1e-9 * np.abs(change).max())
    return with_values(structure, {("parts", k): 1.0 + e for k, e in zip(own, found, strict=True)})


def test_one_spring_that_differs_is_a_sum_of_parts() -> None:
    stiffness, other = springs(2e4, 3e4, 1e4), springs(2e4, 3.3e4, 1e4)
    loss = 2e-4 * stiffness
    found = factors(of(stiffness, loss), 0, other - stiffness)
    assert any(f != 1.0 for f in found.parts)
    np.testing.assert_allclose(
        frequency_response(found, None, FREQ).data, frequency_response(of(other, loss), None, FREQ).data, rtol=1e-9
    )
    # The factors on whole matrices multiply those of their parts, and are written into them with those.
    both = replace(found, scales=(1.0, 1.0, 1.1))
    np.testing.assert_allclose(both.scaled.stiffness, 1.1 * other, atol=1e-6)
    assert both.as_written.parts == (1.0,) * len(found.parts)
    np.testing.assert_allclose(both.as_written.system.stiffness, 1.1 * other, atol=1e-6)


def test_a_part_is_an_error_relative_to_its_modes() -> None:
    structure = of(springs(2e4, 3e4, 1e4))
    squares = np.linalg.eigvals(np.linalg.solve(MASS, structure.system.stiffness))
    for k, part in enumerate(structure.system.parts):
        moved = with_value(structure, ("parts", k), 1.02).scaled
        if part.power == 0 and part.modes[0] == part.modes[1]:
            there = np.linalg.eigvals(np.linalg.solve(moved.mass, moved.stiffness))
            ratio = np.sort(np.sort(there) / np.sort(squares))
            np.testing.assert_allclose(ratio, [1.0, 1.0, 1.02], rtol=1e-9)


def test_masses_and_losses_are_parts_as_springs_are() -> None:
    floating = of(springs(0.0, 3e4, 1e4))
    assert {part.power for part in floating.system.parts} == {0, 1, 2}
    moving = [part.modes for part in floating.system.parts if part.power == 2]
    assert moving == [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]
    # Of each matrix of one that is held, every mode and every pair of them.
    powers = [part.power for part in of(springs(2e4, 3e4, 1e4)).system.parts]
    assert [powers.count(power) for power in (0, 1, 2)] == [6, 6, 6]


def test_what_one_factor_says_already_is_no_part() -> None:
    assert of(np.array([[1e4]]), mass=np.array([[2.0]])).system.parts == ()
    # Of a mass on another that floats, the spring is the whole stiffness; its masses differ.
    assert {part.power for part in of(1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]]), mass=np.eye(2)).system.parts} == {2}


def test_many_degrees_of_freedom_have_parts_of_the_lowest_modes() -> None:
    chain = 2.0 * np.eye(12) - np.eye(12, k=1) - np.eye(12, k=-1)
    parts = modal_parts(np.eye(12), 1e-3 * chain, 1e4 * chain)
    assert {mode for part in parts for mode in part.modes} == set(range(MOST_MODES))


def test_factors_of_other_parts_are_refused() -> None:
    with pytest.raises(ParameterError, match="2 factors on 18 parts"):
        replace(of(springs(2e4, 3e4, 1e4)), parts=(1.1, 0.9))


def test_a_law_in_place_of_a_spring_is_written_and_read_back_beside_errors_of_parts(tmp_path: Path) -> None:
    structure = of(springs(2e4, 3e4, 1e4))
    ports = {**structure.system.ports, "between": np.array([-1.0, 1.0, 0.0])}
    structure = replace(structure, system=replace(structure.system, ports=ports))
    moved = replace(structure, scales=(1.01, 0.9, 1.02), parts=tuple(1.0 + 1e-3 * k for k in range(18)))
    model = BilinearStiffness("between", 0.3).apply(moved)
    write_machine(model, tmp_path / "machine.toml")
    found = read_machine(tmp_path / "machine.toml")
    assert isinstance(found, Structure)
    np.testing.assert_allclose(found.scaled.stiffness, model.scaled.stiffness, rtol=1e-9, atol=1e-6)
    spring, again = model.spring_at("between"), found.spring_at("between")
    assert spring is not None
    assert again is not None
    assert again[0] == pytest.approx(spring[0], rel=1e-9)
