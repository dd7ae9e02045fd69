"""What holds of every machine: a definite mass, reciprocity, passivity, symmetry of the rail."""

from dataclasses import replace

import numpy as np
from hypothesis import given

from cutvib_ss.model.head import head
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import table_1
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes
from tests.properties.machines import FREQ, POSITIONS, bare_machines, machines, structures

PORTS = ("tool_x", "tool_z", "head_x", "joint1", "joint2", "base", "rail(0.3)")


@given(machines(), POSITIONS)
def test_the_mass_matrix_is_symmetric_and_positive_definite(machine: Machine, position: float) -> None:
    mass = machine.second_order(position).mass
    assert np.abs(mass - mass.T).max() <= 1e-14 * np.abs(mass).max()
    # Scaled to a unit diagonal: rotations and translations have different units.
    scale = np.sqrt(np.diag(mass))
    assert np.linalg.eigvalsh(mass / np.outer(scale, scale)).min() > 0.0


@given(bare_machines(), POSITIONS)
def test_it_is_definite_even_where_the_head_s_own_is_singular(machine: Machine, position: float) -> None:
    # Table 1's theta01 = 0 leaves the base of the head no inertia of its own; the rail gives it some.
    upright = replace(machine, head=replace(machine.head, theta01=0.0))
    own = head(upright.head).mass
    scale = np.sqrt(np.diag(own))
    assert abs(np.linalg.eigvalsh(own / np.outer(scale, scale)).min()) < 1e-12
    assert np.linalg.eigvalsh(upright.second_order(position).mass).min() > 0.0


def test_the_head_of_table_1_is_that_case() -> None:
    assert table_1().theta01 == 0.0


@given(machines(), POSITIONS)
def test_responses_are_reciprocal(machine: Machine, position: float) -> None:
    data = frequency_response(machine, position, FREQ, form="receptance", inputs=PORTS, outputs=PORTS).data[0]
    size = np.sqrt(np.abs(np.einsum("iif->if", data)))
    # Every pair on the scale of its two driving points: micrometres and radians do not compare.
    error = np.abs(data - data.transpose(1, 0, 2)) / (size[:, None] * size[None, :])
    assert error.max() < 1e-9


@given(machines(), POSITIONS)
def test_driving_points_take_power_and_give_none(machine: Machine, position: float) -> None:
    for port in PORTS:
        mobility = frequency_response(machine, position, FREQ, form="mobility", inputs=(port,), outputs=(port,)).data[
            0, 0, 0
        ]
        assert (mobility.real >= -1e-9 * np.abs(mobility)).all()


@given(structures())
def test_structures_are_passive_and_reciprocal(structure: Structure) -> None:
    ports = ("first", "last", "between")
    data = frequency_response(structure, None, FREQ, form="mobility", inputs=ports, outputs=ports).data[0]
    assert np.abs(data - data.transpose(1, 0, 2)).max() <= 1e-9 * np.abs(data).max()
    driving = np.einsum("iif->if", data)
    assert (driving.real >= -1e-9 * np.abs(driving)).all()


@given(bare_machines(), POSITIONS)
def test_left_and_right_of_a_bare_rail_are_alike(machine: Machine, position: float) -> None:
    here, there = (frequency_response(machine, y, FREQ).data for y in (position, 1.0 - position))
    assert np.abs(here - there).max() <= 1e-9 * np.abs(here).max()


@given(machines(), POSITIONS)
def test_every_pole_is_stable_and_belongs_to_one_mode(machine: Machine, position: float) -> None:
    found = modes(machine, position)
    assert found.natural_freq.size == len(found.dofs) == found.poles.size
    assert (np.diff(found.natural_freq) >= 0.0).all()
    assert (found.poles.real < 0.0).all()
    assert (found.poles.imag >= 0.0).all()
    system = machine.second_order(position)
    shapes = found.mode_shapes
    assert np.abs(shapes.T @ system.mass @ shapes - np.eye(len(found.dofs))).max() < 1e-8


@given(machines(), POSITIONS)
def test_without_damping_poles_are_the_natural_frequencies(machine: Machine, position: float) -> None:
    from tests.properties.undamped import undamped

    found = modes(undamped(machine), position)
    assert np.abs(found.poles.imag - 2 * np.pi * found.natural_freq).max() < 1e-9 * np.abs(found.poles).max()
