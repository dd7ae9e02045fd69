"""The nonlinear effects of the catalogue, in time histories: what the frequency response ignores, stepping honours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.effects.base import Model, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import value_at, with_value
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.stepping import Stepped, modal_form, step
from tests.conformance.cases import Case, cases, loaded, with_parameter

NONLINEAR = [c for c in cases() if not EFFECTS[c.id].linear]
DISSIPATIVE = ("dry_friction", "joint_slip", "quadratic_damping")
FS = 8000.0
each_case = pytest.mark.parametrize("case", NONLINEAR, ids=lambda c: c.name)


def blow(model: Model, newton: float = 60.0, samples: int = 1000) -> Stepped:
    """Responses to a hammer blow."""
    form = modal_form(model, 0.4 if model.has_position else None)
    t = np.arange(samples) / FS
    return step(form, newton * np.exp(-(((t - 0.008) / 6e-4) ** 2))[None], FS, model.nonlinear)


def change(one: Stepped, other: Stepped) -> float:
    """Difference over magnitude, the larger of the channels."""
    size = np.linalg.norm(other.responses, axis=-1)
    return float((np.linalg.norm(one.responses - other.responses, axis=-1) / size).max())


@each_case
def test_zero_severity_is_the_identity(case: Case) -> None:
    assert change(blow(case.none.apply(case.model)), blow(case.model)) < 1e-12


@each_case
def test_more_severity_more_change(case: Case) -> None:
    bare = blow(case.model)
    changes = [change(blow(case.build(s).apply(case.model)), bare) for s in (1e-3, 1e-2, 0.1, 1.0)]
    assert 1e-12 < changes[0] < changes[1] < changes[2] < changes[3]
    assert changes[3] > 1e-3


@each_case
def test_the_linear_model_ignores_it(case: Case) -> None:
    at, freq = ([0.4] if case.model.has_position else None), np.array([20.0, 90.0, 222.0])
    with_it = frequency_response(case.build(1.0).apply(case.model), at, freq).data
    assert np.array_equal(with_it, frequency_response(case.model, at, freq).data)


@each_case
def test_the_level_matters_unless_it_is_only_lopsided(case: Case) -> None:
    model = case.build(1.0).apply(case.model)
    low, high = blow(model, 6.0), blow(model, 60.0)
    moved = change(replace(high, responses=high.responses / 10), low)
    if case.id == "bilinear_stiffness":
        assert moved < 1e-9
        # It tells the two directions apart instead.
        other = blow(model, -60.0)
        assert change(replace(other, responses=-other.responses), high) > 1e-3
    else:
        assert moved > 1e-3


@each_case
def test_dissipation(case: Case) -> None:
    effect = case.build(1.0)
    got = blow(effect.apply(case.model), samples=4000)
    q, f = got.motions[0, 0], got.forces[0, 0]
    work = np.cumsum(0.5 * (f[1:] + f[:-1]) * np.diff(q))
    scale = np.sum(np.abs(0.5 * (f[1:] + f[:-1]) * np.diff(q)))
    # Work done against the element over the whole motion; corners of friction lie above the Nyquist frequency.
    if case.id in DISSIPATIVE:
        # A slipping element gives back what it holds while it sticks.
        elastic = case.id == "joint_slip" or "sticking" in case.name
        assert work[-1] > (0.0 if elastic else 0.5 * scale)
        if not elastic:
            assert np.diff(work).min() > -0.05 * np.diff(work).max()
    elif case.id != "bilinear_stiffness":
        # Forces of a spring give back all but what the last motion holds.
        assert abs(work[-1]) < 0.1 * scale


@pytest.mark.parametrize("under", ["bare", "loaded"])
@each_case
def test_moves_and_carries_say_what_the_element_takes_along(case: Case, under: str) -> None:
    model = case.model if under == "bare" else loaded(case.model)
    effect = case.build(1.0)
    applied = effect.apply(model)
    moved = effect.moved_by(model, applied)
    # What is not given, or infinite, is not fitted.
    given = {f.name: getattr(effect, f.name) for f in parameter_fields(type(effect))}
    assert set(moved) == {name for name, value in given.items() if value is not None and np.isfinite(value)}
    for name, carried in moved.items():
        other = with_parameter(effect, name, 1.1 * getattr(effect, name)).apply(model)
        for path, weight in carried:
            step_ = 0.1 * getattr(effect, name)
            assert value_at(other, path) - value_at(applied, path) == pytest.approx(weight * step_, rel=1e-9)
    for path, _ in tuning_paths(case.model):
        value = value_at(model, path)
        other = effect.apply(with_value(model, path, 1.1 * value)) if value else applied
        before, after = applied.nonlinear[-1], other.nonlinear[-1]
        weights = dict(effect.carries(path, applied))
        for name in before.parameters:
            weight = weights.get(("nonlinear", len(applied.nonlinear) - 1, "parameters", name), 0.0)
            assert after.parameters[name] - before.parameters[name] == pytest.approx(
                0.1 * value * weight, rel=1e-9, abs=1e-12
            )


def test_the_spring_of_a_port() -> None:
    freeplay = EFFECTS["freeplay"]
    case = next(c for c in NONLINEAR if c.name == "freeplay-structure-spring23")
    assert freeplay("spring23", gap=1e-5).apply(case.model).nonlinear[0].parameters["stiffness"] == pytest.approx(2.5e5)
    assert freeplay("drive", gap=1e-5).apply(case.model).nonlinear[0].parameters["stiffness"] == pytest.approx(2.5e5)
    machine = next(c.model for c in NONLINEAR if isinstance(c.model, Machine))
    assert freeplay("joint2", gap=1e-5).apply(machine).nonlinear[0].parameters["stiffness"] == machine.head.k2
