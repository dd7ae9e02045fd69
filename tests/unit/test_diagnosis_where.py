"""The place of elements that no catalogue knows, from unknown dynamic stiffnesses; the laws that these suggest."""

import numpy as np
import pytest

from cutvib_ss.diagnosis.element_type import element_type_of, with_level
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.place import locate
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import with_values
from tests.unit.record_example import entry_of

FREQ = np.arange(18.0, 400.0, 4.0)
S = 2j * np.pi * FREQ
CHANNELS = ("tool_x", "tool_z", "base_x")
POSITIONS = (0.1, 0.3, 0.5, 0.8)
OFF = with_values(published_machine(), {("head", "k2"): 1.01 * published_machine().head.k2})
"""The nominal model is a tolerance away from the machine."""


def entry(index, position, level, data, rng):
    noise = 2e-3 * np.abs(data).max(axis=1, keepdims=True) * np.ones(FREQ.size)
    blurred = data + noise * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
    quantities = ("acceleration",) * 3
    return entry_of(
        index, position, level, blurred, noise**2, FREQ, CHANNELS, quantities
    )  # fmt: skip


def dense(machine, position, elements):
    """Accelerance by the dense second-order form, at each line its own: no closed form takes part."""
    system = machine.second_order(position)
    stiffness = system.dynamic_stiffness(S)
    for port, z in elements.items():
        first, *other = (system.port(name) for name in port.split("-"))
        row = first - sum(other)
        stiffness = stiffness + z[:, None, None] * np.outer(row, row)
    load = np.broadcast_to(system.port("tool_x")[:, None], (FREQ.size, len(system.dofs), 1))
    reads = np.array([system.port(p) for p in ("tool_x", "tool_z", "base")])
    return (reads @ np.linalg.solve(stiffness, load)[..., 0].T) * S**2


def located(entries, by_level=False):
    none = fit(OFF, Records(tuple(entries)), Hypothesis())
    return locate(OFF, none, entries, 0.0, by_level)


def test_place_of_a_fractional_damper():
    rng, z = np.random.default_rng(1), 40.0 * S**0.5
    found = located(
        [entry(k, y, None, dense(published_machine(), y, {"joint2": z}), rng) for k, y in enumerate(POSITIONS)]
    )
    assert found.best == "joint2"
    assert found.scores[0].probability > 0.9
    # z itself comes out, within its stated uncertainty, where it is seen.
    [element] = [e for e in found.stiffness if e.place == "joint2"]
    seen = (FREQ > 180) & (FREQ < 280)
    off = np.abs(element.value[0] / z - 1)[seen]
    assert np.median(off) < 0.1  # of which tuning takes its part
    assert np.median(np.abs(element.value[0] - z)[seen] / element.std[0][seen]) < 4.0


@pytest.mark.slow
def test_place_of_ends_on_fractional_dampers():
    rng, stiff = np.random.default_rng(2), 1.5e7
    machine = SupportCompliance("rail_ends", stiff, 2 * stiff, 0.0, 0.0).apply(published_machine())
    ends = {"rail_left": 0.3 * stiff * (S / 1e3) ** 0.4, "rail_right": 0.6 * stiff * (S / 1e3) ** 0.4}
    found = located([entry(k, y, None, dense(machine, y, ends), rng) for k, y in enumerate(POSITIONS)])
    assert found.best == "rail_ends"
    left = next(e for e in found.stiffness if e.label == "left")
    assert np.median(np.abs(left.value[0] * (stiff + ends["rail_left"]) - 1)[FREQ > 100]) < 0.15


@pytest.mark.slow
def test_place_of_a_force_that_depends_on_the_level():
    # To one record a nonlinear force is one function of frequency, whatever the law.
    rng, entries = np.random.default_rng(3), []
    for y in POSITIONS:
        for level in (15.0, 60.0):
            amplitude = level * np.abs(dense(published_machine(), y, {})[0] / S**2)
            law = 300.0 * (level / 15.0) * (amplitude / amplitude.max()) + 0j
            entries.append(entry(len(entries), y, level, dense(published_machine(), y, {"joint2": law}), rng))
    found = located(entries, by_level=True)
    assert found.best == "joint2"
    assert found.stiffness[0].levels == (15.0, 60.0)
    assert "stiffness" in found.stiffness[0].with_level


def test_place_of_a_slow_sensor():
    rng, entries = np.random.default_rng(4), []
    for k, y in enumerate(POSITIONS):
        data = dense(published_machine(), y, {})
        data[1] /= 1 + S / 2e3
        entries.append(entry(k, y, None, data, rng))
    found = located(entries)
    assert found.best == "measurement"
    assert found.stiffness[0].label == "tool_z"
    seen = FREQ > 180
    np.testing.assert_allclose((1 + found.stiffness[0].value[0])[seen], (1 / (1 + S / 2e3))[seen], atol=0.05)


def test_place_of_a_cable_between_tool_and_carriage():
    rng, z = np.random.default_rng(6), 1e6 * (1 + S / 4e3) ** 1.5
    found = located(
        [entry(k, y, None, dense(published_machine(), y, {"tool_x-base": z}), rng) for k, y in enumerate(POSITIONS)]
    )
    assert (found.best, found.scores[0].variant) == ("tool", "tool_x-base")
    [element] = [e for e in found.stiffness if e.place == "tool"]
    seen = (FREQ > 180) & (FREQ < 280)
    assert np.median(np.abs(element.value[0] / z - 1)[seen]) < 0.1


@pytest.mark.slow
def test_place_of_ends_that_give_more_with_the_level():
    # Record by record anything behind the base is one function: how it depends on position tells the ends from the rail.
    rng, entries = np.random.default_rng(7), []
    for y in POSITIONS:
        for level in (15.0, 60.0):
            machine = SupportCompliance("rail_ends", 6e8 / level, 1e9, 50.0, 50.0).apply(published_machine())
            entries.append(entry(len(entries), y, level, dense(machine, y, {}), rng))
    assert located(entries, by_level=True).best == "rail_ends"


@pytest.mark.slow
def test_place_of_a_trigger_that_jitters():
    # A gain of all channels, another in every record: as good as any element at the tool, but smooth.
    rng, entries = np.random.default_rng(8), []
    for y in POSITIONS:
        for level in (15.0, 60.0):
            late = np.exp(-S[:, None] * rng.normal(0.0, 2e-4, 3)).mean(axis=1)
            entries.append(entry(len(entries), y, level, late * dense(published_machine(), y, {}), rng))
    assert located(entries, by_level=True).best == "measurement"


Z = {
    "mass": 1.5 * S**2,
    "spring and damper": 2e5 + 150 * S,
    "hysteretic spring": 2e5 * (1 + 0.2j) + 0 * S,
    "sprung mass": 1.2 * S**2 * (1e6 + 60 * S) / (S**2 + 60 * S + 1e6),
}


@pytest.mark.parametrize("name", list(Z))
def test_shape_names_the_family(name):
    rng = np.random.default_rng(5)
    std = np.full(FREQ.size, 0.02 * np.median(np.abs(Z[name])))
    blurred = Z[name] + std * (rng.standard_normal(FREQ.size) + 1j * rng.standard_normal(FREQ.size))
    law = element_type_of("dynamic stiffness", FREQ, blurred, std)
    assert law is not None
    assert law.name == name


def test_shape_of_a_late_channel():
    law = element_type_of("gain", FREQ, np.exp(-S * 2e-4) - 1, np.full(FREQ.size, 1e-3))
    assert law is not None
    assert law.name == "delay"
    assert law.parameters["delay"] == pytest.approx(2e-4, rel=1e-3)


@pytest.mark.parametrize(
    ("power", "damps", "told"),
    [(2.0, False, "cubic"), (-1.0, True, "dry friction"), (1.0, True, "grows with speed"), (0.0, False, "")],
)
def test_growth_with_the_level_names_the_law(power, damps, told):
    levels = np.array([15.0, 50.0, 150.0])
    value = np.outer((levels / 50) ** power, 8.0 * S if damps else 500.0 + 0 * S)
    said = with_level(FREQ, levels, value, np.full(value.shape, 5.0))
    assert told in said
    assert bool(said) == bool(told)


@pytest.mark.parametrize("nothing", [np.nan, np.inf])
def test_a_level_of_which_nothing_is_known_says_nothing_of_the_change(nothing):
    levels = np.array([15.0, 50.0, 150.0])
    value = np.outer((levels / 50) ** 2.0, 500.0 + 0 * S)
    std = np.full(value.shape, 5.0)
    std[1] = nothing
    said = with_level(FREQ, levels, value, std)
    assert "level" in said
    assert with_level(FREQ, levels[:2], value[:2], std[:2]) == ""
    value[1], std[1] = nothing, 5.0
    assert with_level(FREQ, levels, value, std) == said
