"""Analytic derivatives of the responses against central differences, to every value that a model holds."""

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
from hypothesis import given, settings

from cutvib_ss.model.machine import Machine
from cutvib_ss.model.measurement_chain import ChannelChain, MeasurementChain
from cutvib_ss.model.paths import Path, value_at, with_value
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.axes import as_positions
from cutvib_ss.response.derivatives import ResponseDerivatives
from cutvib_ss.response.frequency import ChainedResponse, output_quantities
from tests.properties.machines import FREQ, POSITIONS, full_machines, structures

OUTPUTS = ("tool_x", "tool_z", "base_x", "head_x", "joint2", "rail(0.3)", "rail_left", "eta1")
INPUTS = ("force", "base")
# Not values that are fitted: what is known of them, where they come from, counts and conventions.
SKIPPED = {
    "tolerance",
    "source",
    "caveat",
    "n_modes",
    "effects",
    "bare",
    "nonlinear",
    "slope",
    "system",
    "damping_profile",
}
FEWER = max(5, settings().max_examples // 5)
"""Examples of these tests: each goes through all values of a model."""
TOLERANCE = 2e-5
"""Central differences lose half the digits; near a sharp resonance their own curvature adds."""


def paths(node: Any, at: Path = ()) -> Iterator[Path]:
    """Paths of all numbers in a model."""
    if isinstance(node, bool | str) or node is None:
        return
    if isinstance(node, float | int):
        yield at
    elif isinstance(node, tuple):
        for i, item in enumerate(node):
            yield from paths(item, (*at, i))
    elif isinstance(node, Mapping):
        for key, item in node.items():
            yield from paths(item, (*at, key))
    elif is_dataclass(node):
        # A spring on the slope sits at an end; its position is no value to vary.
        still = {"position"} if getattr(node, "slope", False) else set()
        for f in fields(node):
            if f.name not in SKIPPED | still:
                yield from paths(getattr(node, f.name), (*at, f.name))


def response(
    model: Machine | Structure, position: Any, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> ChainedResponse:
    places = as_positions(model, position)
    return ChainedResponse(model, places, 2j * np.pi * FREQ, output_quantities(model, outputs, None), outputs, inputs)


def worst(
    model: Machine | Structure, position: Any, outputs: tuple[str, ...], inputs: tuple[str, ...]
) -> dict[Path, float]:
    """Largest error of each derivative over its largest magnitude, each pair of output and input by itself."""
    exact = response(model, position, outputs, inputs)
    size = np.abs(exact.data()).max(axis=-1)
    found = {}
    for path in paths(model):
        by_formula = exact.derivative(path)
        moved = np.abs(by_formula).max(axis=-1)
        value = value_at(model, path)
        # The step that moves the response by a part in 1e5, so that neither rounding nor curvature is felt.
        with np.errstate(divide="ignore", invalid="ignore"):
            step = 1e-5 * float(np.nan_to_num(size / moved, nan=np.inf).min())
        step = min(step, 1e-4 * abs(value) if abs(value) > 1e-9 else 1e-3)
        up, down = (
            response(with_value(model, path, value + d), position, outputs, inputs).data() for d in (step, -step)
        )
        error = np.abs(by_formula - (up - down) / (2 * step)).max(axis=-1)
        # A difference cannot show a derivative below the rounding of the responses.
        found[path] = float((error / np.maximum(moved + 1e-6 * size / step, 1e-300)).max())
    return found


@given(full_machines(), POSITIONS)
@settings(max_examples=FEWER)
def test_every_value_of_a_machine(machine: Machine, position: float) -> None:
    found = worst(machine, position, OUTPUTS, INPUTS)
    assert len(found) > 40
    assert {p: e for p, e in found.items() if e > TOLERANCE} == {}


@given(structures())
@settings(max_examples=FEWER)
def test_every_value_of_a_structure(structure: Structure) -> None:
    chain = MeasurementChain({"y": ChannelChain(1.1, 2e-4)}, decay_rate=2.0)
    found = worst(replace(structure, chain=chain), None, ("y", "a", "between"), ("force",))
    assert len(found) >= 6
    assert {p: e for p, e in found.items() if e > TOLERANCE} == {}


@given(full_machines(), POSITIONS)
@settings(max_examples=FEWER)
def test_the_laplace_variable_itself(machine: Machine, position: float) -> None:
    places = as_positions(machine, position)
    quantities = output_quantities(machine, OUTPUTS, "receptance")
    s, step = 2j * np.pi * FREQ, 1e-3
    exact = ResponseDerivatives(
        ChainedResponse(machine, places, s, quantities, OUTPUTS, INPUTS).receptance, OUTPUTS, "force"
    )
    all_by_formula = exact.derivative(("s",))
    up, down = (ChainedResponse(machine, places, s + d, quantities, OUTPUTS, INPUTS).receptance for d in (step, -step))
    for k, output in enumerate(OUTPUTS):
        by_formula = all_by_formula[:, k]
        by_difference = (up.between(output, "force") - down.between(output, "force")) / (2 * step)
        assert np.abs(by_formula - by_difference).max() < TOLERANCE * np.abs(by_formula).max()
