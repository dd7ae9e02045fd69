"""What touches the tool, or swings on it, at an angle between X and Z."""

import control
import numpy as np
import pytest

from cutvib_ss.effects.base import Effect, attached_to
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import ChainedResponse, frequency_response, output_quantities
from tests.conformance.cases import MODELS

MACHINE = published_machine()
FREQ = np.array([7.0, 31.3, 118.0, 152.0, 222.2, 401.0])
CHANNELS = ("tool_x", "tool_z", "base_x")
EFFECTS = [ToolContact("tool", 3e5, 40.0, 0.4), LocalResonator("head", 2.0, 150.0, 0.03, -0.7)]
each = pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.effect)


def response(model):
    return frequency_response(model, [0.3, 0.6], FREQ).data


@pytest.mark.parametrize(("angle", "port"), [(0.0, "tool_x"), (np.pi / 2, "tool_z"), (np.pi, "tool_x")])
def test_along_an_axis_it_is_an_element_at_its_port(angle: float, port: str) -> None:
    contact = ToolContact("tool", 3e5, 40.0, angle)
    along = response(attached_to(MACHINE, port, contact.element()))
    assert response(contact.apply(MACHINE)) == pytest.approx(along, rel=1e-9, abs=1e-15)


def test_a_stiff_one_holds_its_direction_and_leaves_the_other() -> None:
    angle = 0.6
    held = frequency_response(ToolContact("tool", 1e13, 0.0, angle).apply(MACHINE), [0.3], FREQ)
    x, z = (held.data[0, list(held.outputs).index(c), 0] for c in ("tool_x", "tool_z"))
    along, across = np.cos(angle) * x + np.sin(angle) * z, -np.sin(angle) * x + np.cos(angle) * z
    assert np.all(np.abs(along) < 1e-4 * np.abs(across))


@each
def test_the_plant_has_the_closed_form_s_response(effect: Effect) -> None:
    machine = effect.apply(MACHINE)
    plant = machine.plant(position=0.3)
    outputs = [plant.output_labels.index(c) for c in ("tool_x", "tool_z")]
    found = control.frequency_response(plant, 2 * np.pi * FREQ)
    closed = frequency_response(machine, [0.3], FREQ, form="receptance")
    for row, name in zip(outputs, ("tool_x", "tool_z"), strict=True):
        by_plant = found.magnitude[row, 0] * np.exp(1j * found.phase[row, 0])
        want = closed.data[0, list(closed.outputs).index(name), 0]
        assert np.abs(by_plant - want).max() < 1e-8 * np.abs(want).max()


@each
def test_derivatives_are_differences(effect: Effect) -> None:
    s, step = 2j * np.pi * FREQ, 1e-5

    def at(model):
        quantities = output_quantities(model, CHANNELS, "receptance")
        return ChainedResponse(model, np.array([0.3]), s, quantities, CHANNELS, ("force",))

    machine = effect.apply(MACHINE)
    for name, carried in effect.moved_by(MACHINE, machine).items():
        by_model = sum(weight * at(machine).derivative(path) for path, weight in carried)[:, :, 0]
        value = getattr(effect, name)
        ends = [
            frequency_response(
                effect.changed({name: value * (1 + d)}).apply(MACHINE), [0.3], FREQ, form="receptance"
            ).data[:, :, 0]
            for d in (-step, step)
        ]
        differences = (ends[1] - ends[0]) / (2 * step * value)
        assert np.abs(by_model - differences).max() < 1e-5 * np.abs(differences).max(), name


def test_a_port_of_another_structure_has_one_direction() -> None:
    model = MODELS["structure"]
    place = model.places[0]
    assert "angle" not in ToolContact.ranges(model, place)
    assert "angle" in ToolContact.ranges(MACHINE, "tool")
    with pytest.raises(ParameterError, match="one direction"):
        ToolContact(place, 1e4, 1.0, 0.3).apply(model)
