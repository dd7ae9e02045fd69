"""Modes of another structure err one by one: factors on each, their derivatives, and what tuning takes of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from cutvib_ss.diagnosis.discrepancy import weights
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknowns import of_mode, tuning_paths
from cutvib_ss.model.paths import value_at, with_value, with_values
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import StructureTolerances
from cutvib_ss.response.frequency import ChainedResponse
from cutvib_ss.response.modes import modes


def chain(free: bool = False, masses: int = 3) -> Structure:
    """Masses in a row, the first held by a spring, or not."""
    mass, links = np.diag(np.linspace(1.0, 1.5, masses)), np.zeros((masses, masses))
    for i in range(masses - 1):
        row = np.eye(masses)[i + 1] - np.eye(masses)[i]
        links += (1.0 + 0.2 * i) * np.outer(row, row)
    if not free:
        links[0, 0] += 1.0
    ports = {"first": np.eye(masses)[0], "last": np.eye(masses)[-1]}
    system = SecondOrder(mass, 2.0 * links, 1e4 * links, tuple(f"x{i}" for i in range(masses)), ports)
    return Structure(system, {"a": Channel("last", "acceleration")}, "first", tolerance=StructureTolerances())


def test_a_factor_moves_its_own_mode_alone():
    nominal = chain()
    before = modes(nominal)
    stiffer = modes(with_value(nominal, ("mode_stiffness", 1), 1.21))
    assert stiffer.natural_freq / before.natural_freq == pytest.approx([1.0, 1.1, 1.0])
    lossier = modes(with_value(nominal, ("mode_damping", 2), 1.5))
    assert lossier.damping_ratio / before.damping_ratio == pytest.approx([1.0, 1.0, 1.5])


def test_what_is_written_has_the_factors_in_its_matrices():
    moved = with_values(chain(), {("mode_stiffness", 0): 1.1, ("mode_damping", 1): 0.8, ("scales", 2): 1.2})
    written = moved.as_written
    assert written.mode_stiffness == written.mode_damping == (1.0, 1.0, 1.0)
    assert modes(written).poles == pytest.approx(modes(moved).poles)


def test_a_rigid_motion_and_a_single_mode_have_no_factor():
    assert len(chain(free=True).mode_stiffness) == 2
    assert chain(free=True, masses=2).mode_stiffness == ()
    assert chain(masses=1).mode_stiffness == chain(masses=1).mode_damping == ()


@pytest.mark.parametrize("path", [("mode_stiffness", 1), ("mode_damping", 0), ("scales", 1), ("scales", 2)])
def test_derivatives_are_those_of_differences(path):
    moved = with_values(chain(), {("mode_stiffness", 1): 1.1, ("mode_damping", 0): 0.8, ("scales", 2): 1.2})
    s = 2j * np.pi * np.array([5.0, 13.0, 22.0])

    def shown(model):
        return ChainedResponse(model, np.array([np.nan]), s, ("acceleration",), ("a",), ("force",))

    step = 1e-6
    there = with_value(moved, path, value_at(moved, path) + step)
    difference = (shown(there).data() - shown(moved).data()) / step
    assert shown(moved).derivative(path) == pytest.approx(difference, rel=1e-4)


def test_modes_are_tuned_by_a_part_of_their_matrix_and_drift_like_it():
    model = chain()
    tolerance = {path: t for path, t in tuning_paths(model) if of_mode(path)}
    assert tolerance["mode_stiffness", 2] == SETTINGS.tuning_modes * model.tolerance.stiffness
    assert tolerance["mode_damping", 0] == SETTINGS.tuning_modes * model.tolerance.damping
    problem = SimpleNamespace(tuning=tuning_paths(model))
    drift, nominal = weights(problem)
    by_path = dict(zip([path for path, _ in problem.tuning], zip(drift, nominal, strict=True), strict=True))
    assert by_path["mode_stiffness", 1] == (1.0 / tolerance["mode_stiffness", 1], 0.0)
    # The matrix errs for all: its discrepancy stays one of all modes.
    assert by_path["scales", 2] == (1.0 / model.tolerance.stiffness,) * 2
