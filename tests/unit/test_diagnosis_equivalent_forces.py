"""What equivalent stiffnesses take away of a response moves as that of a machine which has them as springs."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.equivalent_forces import EquivalentForces
from cutvib_ss.diagnosis.records import merged
from cutvib_ss.effects.base import attached_to
from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import value_at, with_values
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

FREQ = np.linspace(20.0, 400.0, 96)
SPRINGS = {"joint1": SpringDamperMass(3e4, 5.0), "joint2": SpringDamperMass(-900.0, 2.0)}
PATHS = [
    ("head", "k2"),
    ("head", "m1"),
    ("head", "l2"),
    ("rail", "parameters", "first_frequency"),
    ("chain", "cross_axis"),
]


def _group(positions):
    data, variance = np.ones((3, FREQ.size), dtype=complex), np.ones((3, FREQ.size))
    channels, quantities = ("tool_x", "tool_z", "base_x"), ("acceleration",) * 3
    return merged([entry_of(i, y, 10.0, data, variance, FREQ, channels, quantities) for i, y in enumerate(positions)])[
        0
    ]


def _machine():
    machine = published_machine()
    for effect in (
        CubicStiffness("joint1", 1e8),
        QuadraticDamping("joint2", 5.0),
        CrossAxis("measurement", fraction=0.05),
    ):
        machine = effect.apply(machine)
    return machine


def _taken(model, positions):
    """Of the responses, by springs in place of the restoring forces."""
    sprung = replace(model, nonlinear=())
    for port, spring in SPRINGS.items():
        sprung = attached_to(sprung, port, spring)
    with_springs, without = (
        frequency_response(m, positions, FREQ, form="accelerance", outputs=["tool_x", "tool_z", "base_x"]).data[:, :, 0]
        for m in (sprung, model)
    )
    return without - with_springs


@pytest.mark.parametrize("path", PATHS)
def test_it_moves_as_that_of_springs_does(path):
    positions, model = (0.3, 0.6), _machine()
    group = _group(positions)
    z = np.array([spring.dynamic_stiffness(2j * np.pi * FREQ) for spring in SPRINGS.values()])
    # Three records at two positions.
    row = np.array([0, 1, 0])
    found = EquivalentForces(model, group, row, np.array([z, z, z])).derivatives([((path, 2.0),)])[0]
    value = value_at(model, path)
    step = 1e-5 * value
    up, down = (_taken(with_values(model, {path: value + d}), positions) for d in (step, -step))
    slope = (up - down)[row] / step
    np.testing.assert_allclose(found, slope, atol=1e-5 * np.abs(slope).max())
