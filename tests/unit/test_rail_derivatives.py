"""Derivatives to values of the rail that the property tests leave alone, since their ranges end where models sit."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import with_value
from cutvib_ss.model.rail import EndSupports, RailAttachment, Shear
from cutvib_ss.response.frequency import ChainedResponse

CHANNELS = ("tool_x", "tool_z", "base_x")
S = 2j * np.pi * np.linspace(10.0, 400.0, 150)


def responses(machine):
    return ChainedResponse(machine, np.array([0.2, 0.55]), S, ("acceleration",) * 3, CHANNELS, ("force",))


@pytest.mark.parametrize(
    ("path", "value"),
    [(("rail", "supports", "k_right"), 9e6), (("rail", "attachments", 0, "position"), 0.3)],
)
@pytest.mark.parametrize("shear", [None, Shear(15.0)])
def test_derivative(path, value, shear):
    machine = published_machine()
    rail = replace(
        machine.rail,
        supports=EndSupports(4e7, 9e6, 100.0, 200.0),
        attachments=(RailAttachment(SpringDamperMass(stiffness=1e5), 0.3, slope=True),),
        shear=shear,
    )
    machine = replace(machine, rail=rail)
    up, down = (responses(with_value(machine, path, value * (1 + h))).data() for h in (1e-5, -1e-5))
    difference = (up - down) / (2e-5 * value)
    derivative = responses(machine).derivative(path)
    assert np.abs(derivative - difference).max() < 1e-6 * np.abs(difference).max()
