"""Closed form, dense dynamic stiffness and python-control on the plant give one frequency response."""

import control
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cutvib_ss.machine import CUTTING_SIGNALS, Machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray
from cutvib_ss.structure import Structure
from tests.properties.machines import FREQ, POSITIONS, bare_machines, machines, structures

TOLERANCE = 1e-9
"""Largest error over largest magnitude."""
OUTPUTS = ("tool_x", "tool_z", "base_x", "head_x", "head_z")
S = 2j * np.pi * FREQ


def dense(machine: Machine, position: float, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> ComplexArray:
    """Receptances from the matrices of the joined system, shape (output, input, frequency)."""
    system = machine.second_order(position)
    inverse = np.linalg.inv(system.dynamic_stiffness(S))
    b, c = (np.array([system.port(CUTTING_SIGNALS.get(n, n)) for n in names]) for names in (inputs, outputs))
    return np.einsum("oi,fij,pj->opf", c, inverse, b)


def differ(one: ComplexArray, other: ComplexArray) -> float:
    """Largest error over largest magnitude, each output by itself."""
    size = np.abs(one).max(axis=(-1, -2))
    return float((np.abs(one - other).max(axis=(-1, -2)) / size).max())


@given(bare_machines(), POSITIONS)
def test_three_routes_on_the_bare_machine(machine: Machine, position: float) -> None:
    closed = frequency_response(machine, position, FREQ, form="receptance", outputs=OUTPUTS).data[0]
    plant = control.frequency_response(machine.plant(position, outputs=OUTPUTS), 2 * np.pi * FREQ).frdata
    assert differ(closed, dense(machine, position, OUTPUTS, ("force",))) < TOLERANCE
    assert differ(closed, plant) < TOLERANCE


@given(machines(), POSITIONS)
def test_three_routes_with_any_slot_filled(machine: Machine, position: float) -> None:
    inputs = ("force", "head_x", "base")
    closed = frequency_response(machine, position, FREQ, form="receptance", inputs=inputs, outputs=OUTPUTS).data[0]
    plant = control.frequency_response(machine.plant(position, inputs=inputs, outputs=OUTPUTS), 2 * np.pi * FREQ).frdata
    assert differ(closed, dense(machine, position, OUTPUTS, inputs)) < TOLERANCE
    assert differ(closed, plant) < TOLERANCE


@given(machines(), POSITIONS, st.sampled_from(["velocity", "acceleration"]))
def test_velocity_and_acceleration_of_the_plant(machine: Machine, position: float, quantity: str) -> None:
    form = {"velocity": "mobility", "acceleration": "accelerance"}[quantity]
    closed = frequency_response(machine, position, FREQ, form=form, outputs=OUTPUTS).data[0]
    plant = machine.plant(position, outputs=OUTPUTS, quantity=quantity)
    by_control = control.frequency_response(plant, 2 * np.pi * FREQ).frdata
    # Over the largest of all outputs: the plant's accelerations are differences of large terms where the rail twists.
    assert np.abs(closed - by_control).max() < TOLERANCE * np.abs(closed).max()


@given(bare_machines(), POSITIONS)
def test_the_plant_is_minimal_in_size(machine: Machine, position: float) -> None:
    assert machine.plant(position).nstates == 2 * (2 + machine.rail.parameters.n_modes)


@given(structures())
def test_three_routes_on_other_structures(structure: Structure) -> None:
    closed = frequency_response(structure, None, FREQ).data[0]
    plant = control.frequency_response(structure.plant(), 2 * np.pi * FREQ).frdata
    assert differ(closed, plant) < TOLERANCE
    ports = ("first", "last", "between")
    system = structure.second_order()
    rows = np.array([system.port(p) for p in ports])
    inverse = np.linalg.inv(system.dynamic_stiffness(S))
    by_matrix = np.einsum("oi,fij,pj->opf", rows, inverse, rows)
    by_ports = frequency_response(structure, None, FREQ, form="receptance", inputs=ports, outputs=ports).data[0]
    assert differ(by_ports, by_matrix) < TOLERANCE
