"""
Every effect of the catalogue through one suite, at every place of the published machine and of another structure.

A new effect joins by its line in `cases.CONTRACT`; how its severity runs it says itself, and there is nothing to write
here. What only time histories show of the nonlinear ones is in `test_nonlinear_effects`.
"""

from __future__ import annotations

from dataclasses import FrozenInstanceError, fields
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from cutvib_ss.diagnosis.problem import tuning_paths
from cutvib_ss.effects.base import Effect, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.paths import value_at, with_value
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.response.axes import as_positions
from cutvib_ss.response.frequency import ChainedResponse, frequency_response, output_quantities
from cutvib_ss.results import ComplexArray
from tests.conformance.cases import (
    ANYWHERE,
    AT_PORTS,
    AT_SPRINGS,
    CONTRACT,
    MACHINE_SHIFTS,
    MODELS,
    Case,
    cases,
    loaded,
    with_parameter,
)

FREQ = np.array([3.0, 24.6, 77.7, 151.3, 211.9, 240.4, 333.3, 480.1])
"""Frequencies of the comparisons [Hz]; none on a pole."""
WIDE = np.geomspace(2.0, 900.0, 300)
"""Frequencies at which passivity is looked for [Hz]."""
POSITIONS = (0.27, 0.62)

IDENTITY = 1e-9
"""Largest change over largest magnitude at zero severity. Where that is a limit, it is taken at a stiffness or inertia 10¹²
times that of a strong effect."""
SLOPES = 2e-5
"""Central differences lose half the digits; near a sharp resonance their own curvature adds."""
ROUTES = 1e-9
"""Largest difference of plant and closed form over largest magnitude."""
PADE = 1e-6
"""The same with a Padé approximation of sixth order and delays of a tenth of a millisecond."""

CASES = cases()
LINEAR = [c for c in CASES if EFFECTS[c.id].linear]
MECHANICAL = [c for c in LINEAR if not EFFECTS[c.id].measurement]
each_case = pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)
each_linear = pytest.mark.parametrize("case", LINEAR, ids=lambda c: c.name)
each_mechanical = pytest.mark.parametrize("case", MECHANICAL, ids=lambda c: c.name)
each_effect = pytest.mark.parametrize("kind", EFFECTS.values(), ids=EFFECTS)


def places_of(model: Machine | Structure) -> Any:
    """Positions of the comparisons, on a model that has any."""
    return POSITIONS if model.has_position else None


def responses(model: Machine | Structure, freq: np.ndarray = FREQ) -> ComplexArray:
    """The model's channels at all positions, shape (position, channel, frequency)."""
    return frequency_response(model, places_of(model), freq).data[:, :, 0]


def change(one: ComplexArray, other: ComplexArray) -> float:
    """Largest difference over largest magnitude, each channel by itself."""
    size = np.abs(other).max(axis=(0, 2))
    return float((np.abs(one - other).max(axis=(0, 2)) / size).max())


# --- the catalogue --------------------------------------------------------------------------------------------------------


@each_effect
def test_names_are_the_contract_s(kind: type[Effect]) -> None:
    assert kind.effect in CONTRACT
    places, parameters = CONTRACT[kind.effect]
    assert set(kind.places(published_machine())) == set(places)
    assert {f.name for f in fields(kind)} == {"place", *parameters}
    assert EFFECTS[kind.effect] is kind


@each_effect
def test_places_on_another_structure(kind: type[Effect]) -> None:
    model = MODELS["structure"]
    assert isinstance(model, Structure)
    found = kind.places(model)
    if kind.effect in AT_PORTS:
        assert set(found) == set(model.system.ports)
    elif kind.effect in AT_SPRINGS:
        assert set(found) == {"drive", "spring23"}  # the tip is not held to ground
    else:
        assert bool(found) == (kind.effect in ANYWHERE)


def test_parameters_that_may_be_off_are_the_contract_s() -> None:
    assert set(ParameterShift.choices(published_machine())) == MACHINE_SHIFTS
    assert {name for _, name in ParameterShift.choices(MODELS["structure"])} == {"mass", "damping", "stiffness"}


def test_every_effect_is_tried_at_every_place() -> None:
    tried = {(c.id, c.build(1.0).place) for c in CASES if isinstance(c.model, Machine)}
    assert tried == {(name, place) for name, kind in EFFECTS.items() for place in CONTRACT[name][0]}


@each_effect
def test_ranges_can_be_searched(kind: type[Effect]) -> None:
    searched = [{f.name: f.metadata["range"] for f in parameter_fields(kind)}]
    searched += [kind.ranges(model, place) for model in MODELS.values() for place in kind.places(model)]
    for ranges in searched:
        assert set(ranges) <= set(searched[0])
        for r in ranges.values():
            assert r.unit
            assert r.low < r.high
            assert r.scale != "log" or r.low > 0.0
            assert r.minimum is None or r.minimum <= r.low


@each_case
def test_what_is_strong_lies_in_the_range(case: Case) -> None:
    effect = case.build(1.0)
    for name, r in effect.ranges(case.model, effect.place).items():
        value = getattr(effect, name)
        # Left out, or infinite: not searched.
        assert value in (None, np.inf) or r.low <= value <= r.high


@each_case
def test_frozen_and_fussy(case: Case) -> None:
    effect = case.build(1.0)
    with pytest.raises(FrozenInstanceError):
        effect.place = "elsewhere"  # type: ignore[misc]
    with pytest.raises(ParameterError, match="its places are"):
        with_parameter(effect, "place", "nowhere").apply(case.model)
    for f in parameter_fields(type(effect)):
        with pytest.raises(ParameterError, match=f.name):
            with_parameter(effect, f.name, float("nan"))
        if f.metadata["range"].minimum is not None:
            with pytest.raises(ParameterError, match=f.name):
                with_parameter(effect, f.name, f.metadata["range"].minimum - 1e-3)


# --- apply ----------------------------------------------------------------------------------------------------------------


@each_case
def test_zero_severity_is_the_identity(case: Case) -> None:
    assert change(responses(case.none.apply(case.model)), responses(case.reference)) < IDENTITY


@each_linear
def test_a_strong_effect_is_seen(case: Case) -> None:
    # Else the identity above would say nothing.
    assert change(responses(case.build(1.0).apply(case.model)), responses(case.reference)) > 1e-4


@each_case
def test_apply_leaves_the_model_alone_and_records_itself(case: Case) -> None:
    before = repr(case.model)
    effect, second = case.build(1.0), case.build(0.5)
    once = effect.apply(case.model)
    twice = second.apply(once)
    assert repr(case.model) == before
    assert type(once) is type(case.model)
    assert once.effects == (effect,)
    assert twice.effects == (effect, second)
    assert once.bare is case.model
    assert twice.bare is case.model
    assert once.effects == (effect,)


@each_linear
def test_more_severity_more_change(case: Case) -> None:
    reference = responses(case.reference)
    steps = (1 / 3, 2 / 3, 1.0) if case.id == "modal_truncation" else (1e-4, 3e-4, 1e-3)
    norms = [float(np.linalg.norm(responses(case.build(s).apply(case.model)) - reference)) for s in steps]
    assert 0.0 < norms[0] < norms[1] < norms[2]


@each_case
def test_machine_files_hold_it(case: Case, tmp_path: Path) -> None:
    effect = case.build(0.7)
    model = case.build(0.3).apply(effect.apply(case.model))
    write_machine(model, tmp_path / "machine.toml")
    again = read_machine(tmp_path / "machine.toml")
    assert again.effects == model.effects
    assert change(responses(again), responses(model)) < 1e-12


# --- derivatives ----------------------------------------------------------------------------------------------------------


def slope(model: Machine | Structure, carried: Any) -> ComplexArray:
    """Derivative along some values of a model, as a fit takes it."""
    outputs = tuple(model.channels)
    quantities = output_quantities(model, outputs, None)
    chained = ChainedResponse(
        model, as_positions(model, places_of(model)), 2j * np.pi * FREQ, quantities, outputs, ("force",)
    )
    total = np.zeros(chained.data()[:, :, 0].shape, dtype=np.complex128)
    for path, weight in carried:
        total = total + weight * chained.derivative(path)[:, :, 0]
    return total


def by_difference(at: Any, value: float) -> ComplexArray:
    """Central difference of the responses of ``at(value)``, of fourth order."""
    h = 1e-4 * max(abs(value), 1e-7)
    near, far = (responses(at(value + k * h)) - responses(at(value - k * h)) for k in (1, 2))
    return (8 * near - far) / (12 * h)


def assert_same_slope(analytic: ComplexArray, numeric: ComplexArray, value: float, size: ComplexArray) -> None:
    error = np.abs(analytic - numeric).max(axis=(0, 2)) * abs(value)
    # A slope that moves nothing is held against the rounding of the responses themselves.
    scale = SLOPES * np.abs(numeric).max(axis=(0, 2)) * abs(value) + 1e-9 * np.abs(size).max(axis=(0, 2))
    assert (error <= scale).all()


@pytest.mark.parametrize("under", ["bare", "loaded"])
@each_linear
def test_moves_is_the_derivative_to_the_parameters(case: Case, under: str) -> None:
    model = case.model if under == "bare" else loaded(case.model)
    effect = case.build(1.0)
    applied = effect.apply(model)
    moved = effect.moved_by(model, applied)
    names = [f.name for f in parameter_fields(type(effect))]
    assert set(moved) == set(names)
    for name in effect.ranges(model, effect.place):
        value = getattr(effect, name)
        if value == np.inf:  # not fitted
            continue
        numeric = by_difference(lambda v, name=name: with_parameter(effect, name, v).apply(model), value)
        # Underneath may lie an effect that has taken the shifted damper away.
        assert under == "loaded" or np.abs(numeric).max() > 0.0
        assert_same_slope(slope(applied, moved[name]), numeric, value, responses(applied))


@pytest.mark.parametrize("under", ["bare", "loaded"])
@each_linear
def test_carries_is_the_derivative_to_what_lies_underneath(case: Case, under: str) -> None:
    model = case.model if under == "bare" else loaded(case.model)
    effect = case.build(1.0)
    applied = effect.apply(model)
    size = responses(applied)
    for path, _ in tuning_paths(case.model):
        value = value_at(model, path)
        if value == 0.0:  # a damper that an effect underneath has replaced
            continue
        numeric = by_difference(lambda v, path=path: effect.apply(with_value(model, path, v)), value)
        assert_same_slope(slope(applied, effect.carries(path, applied)), numeric, value, size)


# --- physics --------------------------------------------------------------------------------------------------------------


@each_mechanical
@pytest.mark.parametrize("severity", [0.3, 1.0])
def test_passive_at_the_driving_point(case: Case, severity: float) -> None:
    applied = case.build(severity).apply(case.model)
    ports = ("tool_x", "head_x", "base") if isinstance(applied, Machine) else ("drive", "tip", "spring23")
    mobility = frequency_response(applied, places_of(applied), WIDE, form="mobility", inputs=ports, outputs=ports).data
    for k in range(len(ports)):
        own = mobility[:, k, k]
        assert own.real.min() >= -1e-12 * np.abs(own).max()
    # The power that any forces at the ports deliver together, and that any motion dissipates.
    square = mobility.transpose(0, 3, 1, 2)
    taken = np.linalg.eigvalsh(square + square.conj().swapaxes(-1, -2))
    assert (taken[..., 0] >= -1e-9 * np.abs(square).max(axis=(-1, -2))).all()
    matrices = applied.second_order(POSITIONS[0] if applied.has_position else None, viscous_at=200.0)
    assert np.linalg.eigvalsh(matrices.mass)[0] > 0.0
    for matrix in (matrices.damping, matrices.stiffness):
        powers = np.linalg.eigvalsh(matrix)
        assert powers[0] >= -1e-12 * powers[-1]


@each_mechanical
def test_reciprocal(case: Case) -> None:
    applied = case.build(1.0).apply(case.model)
    ports = ("tool_x", "tool_z", "head_x", "base") if isinstance(applied, Machine) else ("drive", "tip", "spring23")
    data = frequency_response(applied, places_of(applied), FREQ, form="receptance", inputs=ports, outputs=ports).data
    for i in range(len(ports)):
        for j in range(i):
            there, back = data[:, i, j], data[:, j, i]
            assert np.abs(there - back).max() <= 1e-9 * np.abs(there).max()


# --- the plant ------------------------------------------------------------------------------------------------------------


def by_plant(model: Machine | Structure, freq: np.ndarray = FREQ, **asked: Any) -> ComplexArray:
    """Receptances of the channels through python-control."""
    outputs = tuple(model.channels)
    rows = []
    for place in places_of(model) or (None,):
        plant = model.plant(place, outputs=outputs, quantity="displacement", **asked)
        rows.append(control.frequency_response(plant, 2 * np.pi * freq).frdata[:, 0])
    return np.array(rows)


def closed_form(model: Machine | Structure, freq: np.ndarray = FREQ) -> ComplexArray:
    """The same in closed form."""
    return frequency_response(model, places_of(model), freq, form="receptance").data[:, :, 0]


@each_linear
def test_the_plant_agrees_or_names_the_way_out(case: Case) -> None:
    applied = case.build(1.0).apply(case.model)
    if case.id == "window_damping":
        for asked in ({}, {"pade_order": 6, "viscous_at": 100.0}):
            with pytest.raises(CouplingError, match="no property of a plant"):
                by_plant(applied, **asked)
    elif case.id == "channel_delay":
        with pytest.raises(CouplingError, match="pade_order"):
            by_plant(applied)
        assert change(by_plant(applied, pade_order=6), closed_form(applied)) < PADE
    elif case.id == "calibration_error" and case.build(1.0).phase:
        with pytest.raises(CouplingError, match="constant phase"):
            by_plant(applied)
    elif case.id == "structural_damping":
        with pytest.raises(CouplingError, match="equivalent viscous"):
            by_plant(applied)
        for f in FREQ[2:6]:
            # Exact where the equivalent is taken, and nowhere else.
            here = np.array([f])
            assert change(by_plant(applied, here, viscous_at=float(f)), closed_form(applied, here)) < ROUTES
        assert change(by_plant(applied, viscous_at=100.0), closed_form(applied)) > 1e-4
    else:
        assert change(by_plant(applied), closed_form(applied)) < ROUTES
