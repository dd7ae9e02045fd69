"""Closed form, dense dynamic stiffness and python-control on the plant give one frequency response."""

from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cutvib_ss.diagnosis.modification import Lines
from cutvib_ss.diagnosis.records import Group
from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.model.machine import CUTTING_SIGNALS, Machine, published_machine
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modal_form import modal_form
from cutvib_ss.results import ComplexArray
from tests.properties.machines import FREQ, POSITIONS, bare_machines, machines, stacked_machines, structures

TOLERANCE = 1e-9
"""Largest error over largest magnitude."""
OUTPUTS = ("tool_x", "tool_z", "base_x", "head_x", "head_z")
S = 2j * np.pi * FREQ
CHOICES = st.sampled_from([("tool_z",), ("tool_x", "tool_z", "base_x"), ("base_x", "tool_z")])
"""Channels that are measured."""


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


def by_hand(machine: Machine, position: float, outputs: tuple[str, ...]) -> ComplexArray:
    """Accelerances from the matrices, each channel's chain written out, shape (output, frequency)."""
    chain, s = machine.chain, S + machine.chain.decay_rate
    system = machine.second_order(position)
    motion = np.linalg.inv(system.dynamic_stiffness(s)) @ system.port("tool_x")
    found = []
    for name in outputs:
        port, channel = system.port(CUTTING_SIGNALS.get(name, name)), chain.channel(name)
        if name == "tool_z":
            port = port + chain.cross_axis * system.port("tool_x")
        turned = channel.gain * np.exp(1j * channel.phase - s * channel.delay)
        found.append(turned * s**2 * (motion @ port))
    return np.array(found)


@given(stacked_machines(), POSITIONS, CHOICES)
def test_all_routes_under_stacks_of_effects_and_chains(machine: Machine, y: float, outputs: tuple[str, ...]) -> None:
    chain = machine.chain
    lines = chain.at(outputs, [2] * len(outputs), S)
    closed = frequency_response(machine, y, FREQ, outputs=outputs).data[0]
    expected = by_hand(machine, y, outputs)
    assert differ(expected[:, None], closed) < TOLERANCE
    modal = modal_form(machine, y, lines.signals).receptance(lines.s)
    assert differ(expected[:, None], lines.shown(modal[:, 0])[:, None]) < TOLERANCE
    assert differ(expected[:, None], through_localisation(machine, np.array([y]), outputs)[0][:, None]) < TOLERANCE
    mass, damping, stiffness = (x[0] for x in machine.matrices([y])[:3])
    dynamic = stiffness + lines.s[:, None, None] * damping + lines.s[:, None, None] ** 2 * mass
    system = machine.second_order(y)
    rows = np.array([system.port(CUTTING_SIGNALS.get(name, name)) for name in lines.signals])
    receptance = (rows @ np.linalg.solve(dynamic, system.port("tool_x")[:, None]))[:, :, 0].T
    assert differ(expected[:, None], lines.shown(receptance)[:, None]) < TOLERANCE
    # A plant takes gains and leaks; a window, a phase and an exact delay are put to it by hand.
    static = {name: replace(c, delay=0.0, phase=0.0) for name, c in chain.channels.items()}
    plain = replace(machine, chain=replace(chain, channels=static, decay_rate=0.0))
    plant = plain.plant(y, outputs=outputs, quantity="acceleration")(lines.s, squeeze=False)[:, 0]
    late = [np.exp(1j * chain.channel(o).phase - lines.s * chain.channel(o).delay) for o in outputs]
    assert np.abs(expected - late * plant).max() < TOLERANCE * np.abs(expected).max()


@given(structures())
def test_modal_form_and_plant_of_other_structures(structure: Structure) -> None:
    closed = frequency_response(structure, None, FREQ).data[0]
    form = modal_form(structure)
    shares = np.array(form.base_shares)[:, None] if structure.influence is not None else 0.0
    orders = np.array(form.orders)[:, None]
    modal = S**orders * (form.receptance(S)[:, 0] + shares / S**2)
    # A free body's double pole is set apart, and known to the square root of a rounding error.
    assert differ(closed, modal[:, None]) < 5.0 * np.sqrt(np.finfo(float).eps)


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
