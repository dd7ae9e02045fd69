"""The base-force constraint: against Lagrange multipliers, as python-control objects, and as a function of position."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy import linalg

from cutvib_ss.absorber import attach_absorber
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import Guide
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.position_dependence import position_dependence
from cutvib_ss.parameters import table_7
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray, FloatArray
from tests.properties.machines import machines

# Shrinking a machine with a twist takes minutes.
QUICK = settings(max_examples=15, phases=[Phase.explicit, Phase.generate])
MATRICES = ("mass", "damping", "stiffness")


def _close(one: FloatArray, other: FloatArray, tolerance: float = 1e-12) -> bool:
    return bool(np.abs(one - other).max() <= tolerance * max(float(np.abs(other).max()), 1e-300))


def by_multipliers(machine: Machine, position: float, s: complex, port: str) -> ComplexArray:
    """Motion of head and rail under a unit force at a port of the head, the constraint kept by Lagrange multipliers."""
    head, beam = machine.head_system(), machine.rail_system(position)
    n, k = len(head.dofs), len(beam.dofs)
    stiffness = linalg.block_diag(*(x.dynamic_stiffness([s])[0] for x in (head, beam)))
    pairs = [("base", "at_head"), *([("twist", "at_head_twist")] if machine.rail.torsion else [])]
    apart = [np.concatenate([head.port(a), -beam.port(b)]) for a, b in pairs]
    if machine.guide is not None:
        stretch = apart.pop(0)
        stiffness = stiffness + (machine.guide.stiffness + s * machine.guide.damping) * np.outer(stretch, stretch)
    held = np.reshape(apart, (len(apart), n + k))
    bordered = np.block([[stiffness, held.T], [held, np.zeros((len(apart), len(apart)))]])
    force = np.concatenate([head.port(port), np.zeros(k + len(apart))])
    moved: ComplexArray = np.linalg.solve(bordered, force)[: n + k]
    return moved


@QUICK
@given(machines(), st.floats(0.01, 0.99), st.sampled_from([24.6j, 217.0j, 480.1j]))
def test_it_is_the_constraint_of_lagrange_multipliers(machine: Machine, position: float, s: complex) -> None:
    moved = by_multipliers(machine, position, 2 * np.pi * s, "tool_x")
    system, head, beam = machine.second_order(position), machine.head_system(), machine.rail_system(position)
    answer = np.linalg.solve(system.dynamic_stiffness([2 * np.pi * s])[0], system.port("tool_x"))
    wanted = {p: head.port(p) @ moved[: len(head.dofs)] for p in ("tool_x", "tool_z", "head_x", "head_base", "joint2")}
    wanted |= {p: beam.port(p) @ moved[len(head.dofs) :] for p in ("at_head", "eta1")}
    wanted["base"] = wanted["at_head" if machine.guide and machine.guide.sensor_side == "rail" else "head_base"]
    for port, value in wanted.items():
        assert abs(system.port(port) @ answer - value) < 1e-9 * abs(wanted["tool_x"]) + 1e-9 * abs(value)


def test_the_head_and_the_rail_are_python_control_objects() -> None:
    machine = published_machine()
    head, rail = machine.coupling().parts(0.5, {"force": "tool_x"}, {"tool_x": ("tool_x", "displacement")})
    assert head.state_labels == ["theta1", "theta2", "d_theta1", "d_theta2"]
    assert head.output_labels == ["tool_x", "base_reaction"]
    assert rail.nstates == 8
    assert rail.input_labels == ["base_force"]
    # Eq. 3 at once: with the joints at rest the base feels the head's masses, less what swings free of it, and the force.
    p, base = machine.head, head.input_labels.index("base_acceleration")
    system = machine.head_system()
    swinging = np.linalg.inv(system.mass[:2, :2])
    left = p.m1 + p.m2 - system.mass[2, :2] @ swinging @ system.mass[:2, 2]
    assert head.D[1, base] == pytest.approx(-left)
    assert head.D[1, 0] == pytest.approx(1.0 - system.mass[2, :2] @ swinging @ system.port("tool_x")[:2])


def test_states_of_the_plant_are_coordinates_and_rates_of_known_scale() -> None:
    machine = attach_absorber(published_machine(), table_7())
    plant, scales = machine.plant(0.4, outputs=["joint1", "eta2"]), machine.coupling().state_scales
    names = ["theta1", "theta2", "eta1", "eta2", "eta3", "eta4"]
    attached = ["attached1_mass", "d_attached1_mass"]
    assert plant.state_labels == [*names, *(f"d_{n}" for n in names), *attached] == list(scales)
    for output, state in (("joint1", "theta1"), ("eta2", "eta2")):
        row = plant.C[plant.output_labels.index(output)]
        assert row[plant.state_labels.index(state)] == pytest.approx(1 / scales[state])
        assert np.count_nonzero(np.abs(row) > 1e-12 * np.abs(row).max()) == 1
        rate = row @ plant.A
        assert rate[plant.state_labels.index(f"d_{state}")] == pytest.approx(1 / scales[f"d_{state}"])


def test_the_sensor_may_sit_on_either_side_of_the_guide() -> None:
    freq = np.array([30.0, 217.0])
    for side, port in (("head", "head_base"), ("rail", "at_head")):
        machine = replace(published_machine(), guide=Guide(2e7, 300.0, side))  # type: ignore[arg-type]
        shown = frequency_response(machine, 0.4, freq, form="receptance", outputs=["base_x", "head_base", "at_head"])
        assert np.array_equal(shown.sel(output="base_x").data, shown.sel(output=port).data)
        # A force across the guide moves both of its sides.
        reacting = frequency_response(machine, 0.4, freq, form="receptance", inputs=["guide"], outputs=["head_base"])
        assert np.abs(shown.sel(output="head_base").data - shown.sel(output="at_head").data).max() > 0.0
        assert reacting.data.shape == (1, 1, 1, 2)
    with pytest.raises(ParameterError, match="sensor_side"):
        Guide(2e7, 300.0, "tool")  # type: ignore[arg-type]


def test_wrong_names_list_the_choices() -> None:
    machine = published_machine()
    for asked in ({"inputs": "t"}, {"outputs": "t"}):
        with pytest.raises(ParameterError, match=r"no port 't'.*tool_x"):
            machine.plant(0.5, **asked)
        with pytest.raises(ParameterError, match=r"no port 't'.*tool_x.*base_x.*joint1.*rail_left"):
            frequency_response(machine, 0.5, [217.0], **asked)
    with pytest.raises(ParameterError, match="'accel' is not one of displacement"):
        machine.plant(0.5, quantity="accel")  # type: ignore[arg-type]
    assert machine.plant(0.5, outputs="tool_x").output_labels == ["tool_x"]


@QUICK
@given(machines().filter(lambda m: m.rail.parameters.n_modes < 5 and m.rail.torsion is None), st.floats(0.01, 0.99))
def test_constant_matrices_times_functions_of_position_are_the_matrices(machine: Machine, position: float) -> None:
    exact = machine.coupling()
    terms = position_dependence(exact)
    weights = terms.functions(position)
    for k, name in enumerate(MATRICES):
        assert _close(np.einsum("k,kij->ij", weights, getattr(terms, name)), exact.matrices(position)[k])


@QUICK
@given(machines(), st.lists(st.floats(0.01, 0.99), min_size=1, max_size=4))
def test_matrices_of_many_positions_are_those_of_each(machine: Machine, positions: list[float]) -> None:
    stack = machine.matrices(positions)
    for k, position in enumerate(positions):
        system = machine.second_order(position)
        assert stack.dofs == system.dofs
        for name in MATRICES:
            assert _close(getattr(stack, name)[k], getattr(system, name))


def test_a_rail_that_twists_has_its_functions_too() -> None:
    machine = RailTorsion("rail", 0.05, 1.0, 120.0, 0.02).apply(published_machine())
    exact = machine.coupling()
    terms = position_dependence(exact)
    assert "psi[twist1]" in terms.names
    weights = terms.functions(0.37)
    assert _close(np.einsum("k,kij->ij", weights, terms.mass), machine.second_order(0.37).mass)
    with pytest.raises(CouplingError, match="no derivatives"):
        exact.matrices(0.37, 1)
    with pytest.raises(CouplingError, match="place of the head"):
        exact.matrices_bound(1)


def test_the_bare_machine_s_terms_are_its_head_s_masses() -> None:
    machine = published_machine()
    terms = position_dependence(machine.coupling())
    assert len(terms.names) == 1 + 4 + 10
    k = terms.names.index("phi[eta1]*phi[eta3]")
    assert terms.mass[k, 0, 2] == pytest.approx(machine.head.m1 + machine.head.m2)
    assert not terms.stiffness[1:].any()
    assert not terms.damping[1:].any()


@QUICK
@given(machines().filter(lambda m: m.rail.torsion is None), st.floats(0.05, 0.95), st.integers(0, 3))
def test_derivatives_are_differences_and_within_their_bounds(machine: Machine, position: float, order: int) -> None:
    exact, step = machine.coupling(), 1e-4
    after, before = (exact.matrices(position + sign * step, order) for sign in (1, -1))
    found, bound = exact.matrices(position, order + 1), exact.matrices_bound(order + 1)
    for k in range(3):
        difference = (after[k] - before[k]) / (2 * step)
        assert np.abs(found[k] - difference).max() <= 1e-4 * bound[k].max() + 1e-9 * np.abs(after[k]).max() / step
        assert (np.abs(found[k]) <= bound[k] * (1 + 1e-12)).all()
    for port in ("tool_x", "base"):
        ends = [exact.port(port, position + sign * step, order) for sign in (1, -1)]
        row = exact.port(port, position, order + 1)
        largest = exact.rows_bound(order + 1).max()
        assert np.abs(row - (ends[0] - ends[1]) / (2 * step)).max() <= 1e-4 * largest + 1e-9
