"""Closed form, dense dynamic stiffness and python-control on the plant give one frequency response."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.gap.modification import Lines
from cutvib_ss.gap.records import Group
from cutvib_ss.model.elements import SpringDamperMass, SprungMass
from cutvib_ss.model.machine import CUTTING_SIGNALS, Machine, published_machine
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray
from tests.properties.machines import FREQ, POSITIONS, bare_machines, full_machines, machines, structures

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


def through_localisation(machine: Machine, positions: np.ndarray, channels: tuple[str, ...]) -> ComplexArray:
    """Responses as the localisation sees them, shape (position, channel, frequency)."""
    shape = (positions.size, len(channels), FREQ.size)
    nowhere = np.zeros(positions.size)
    group = Group(
        positions, FREQ, channels, ("acceleration",) * len(channels), np.zeros(shape, dtype=complex), np.ones(shape),
        nowhere, nowhere, nowhere,
    )  # fmt: skip
    return Lines(machine, group, np.zeros(shape, dtype=complex), np.ones((positions.size, 1, 1))).response


def test_cross_axis_leaks_whether_or_not_tool_x_is_measured() -> None:
    # The sensor feels the tool's motion in X, which no choice of channels changes.
    machine = CrossAxis("measurement", 0.2).apply(published_machine())
    alone = frequency_response(machine, 0.5, 217.0, outputs=["tool_z"]).data.item()
    x, z = frequency_response(published_machine(), 0.5, 217.0, outputs=["tool_x", "tool_z"]).data.ravel()
    assert alone == pytest.approx(z + 0.2 * x, rel=1e-12)
    assert alone == pytest.approx(-2.131 + 5.486j, abs=1e-3)
    plant = machine.plant(0.5, outputs=["tool_z"], quantity="acceleration")
    assert plant.output_labels == ["tool_z"]
    assert complex(plant(2j * np.pi * 217.0)) == pytest.approx(alone, rel=1e-9)
    assert (
        differ(
            frequency_response(machine, 0.5, FREQ, outputs=["tool_z"]).data[:, :, 0],
            through_localisation(machine, np.array([0.5]), ("tool_z",)),
        )
        < TOLERANCE
    )


@given(full_machines(), POSITIONS, st.sampled_from([("tool_z",), ("tool_x", "tool_z", "base_x"), ("tool_z", "base_x")]))
def test_localisation_sees_the_model_that_is_fitted(machine: Machine, y: float, channels: tuple[str, ...]) -> None:
    fitted = frequency_response(machine, y, FREQ, outputs=channels).data[:, :, 0]
    assert differ(fitted, through_localisation(machine, np.array([y]), channels)) < TOLERANCE


@given(full_machines(), POSITIONS, st.sampled_from([("tool_z",), ("tool_x", "tool_z", "base_x"), ("base_x", "tool_z")]))
def test_the_plant_goes_through_the_same_chain(machine: Machine, y: float, outputs: tuple[str, ...]) -> None:
    # A plant takes gains and leaks; a window, a phase and an exact delay it cannot have.
    still = {name: replace(c, delay=0.0, phase=0.0) for name, c in machine.chain.channels.items()}
    attached = tuple(replace(a, element=without_loss(a.element)) for a in machine.attachments)
    machine = replace(machine, chain=replace(machine.chain, channels=still, decay_rate=0.0), attachments=attached)
    machine = replace(machine, rail=replace(machine.rail, attachments=()))
    closed = frequency_response(machine, y, FREQ, form="receptance", outputs=outputs).data[0]
    plant = control.frequency_response(machine.plant(y, outputs=outputs), 2 * np.pi * FREQ).frdata
    assert differ(closed, plant) < TOLERANCE


def without_loss(element: SpringDamperMass | SprungMass) -> SpringDamperMass | SprungMass:
    """The element without hysteresis."""
    return replace(element, loss_stiffness=0.0) if isinstance(element, SpringDamperMass) else element


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
