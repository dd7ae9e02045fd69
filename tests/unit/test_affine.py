"""The affine form is the machine at every position, and its derivatives are those of the machine."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.errors import CouplingError
from cutvib_ss.model.coupling import affine_machine
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.position_dependence import affine_terms
from cutvib_ss.results import FloatArray
from tests.properties.machines import machines

# Shrinking a machine with a twist takes minutes.
QUICK = settings(max_examples=15, phases=[Phase.explicit, Phase.generate])
MATRICES = ("mass", "damping", "stiffness")


def _close(one: FloatArray, other: FloatArray, tolerance: float = 1e-12) -> bool:
    return bool(np.abs(one - other).max() <= tolerance * max(float(np.abs(other).max()), 1e-300))


@QUICK
@given(machines(), st.floats(0.01, 0.99))
def test_it_is_the_machine_at_every_position(machine: Machine, position: float) -> None:
    exact = affine_machine(machine, points={"middle": 0.5})
    found, expected = exact.second_order(position), machine.second_order(position, points={"middle": 0.5})
    assert found.dofs == expected.dofs
    for name in MATRICES:
        assert _close(getattr(found, name), getattr(expected, name))
    assert set(found.ports) >= set(expected.ports)
    for name, row in expected.ports.items():
        assert np.abs(found.port(name) - row).max() < 1e-12


@QUICK
@given(machines().filter(lambda m: m.rail.parameters.n_modes < 5 and m.rail.torsion is None), st.floats(0.01, 0.99))
def test_constant_matrices_times_functions_of_position_are_the_matrices(machine: Machine, position: float) -> None:
    exact = affine_machine(machine)
    terms = affine_terms(exact)
    weights = terms.functions(position)
    for k, name in enumerate(MATRICES):
        assert _close(np.einsum("k,kij->ij", weights, getattr(terms, name)), exact.matrices(position)[k])


def test_a_rail_that_twists_has_its_functions_too() -> None:
    machine = RailTorsion("rail", 0.05, 1.0, 120.0, 0.02).apply(published_machine())
    exact = affine_machine(machine)
    terms = affine_terms(exact)
    assert "psi[twist1]" in terms.names
    weights = terms.functions(0.37)
    assert _close(np.einsum("k,kij->ij", weights, terms.mass), machine.second_order(0.37).mass)
    with pytest.raises(CouplingError, match="no derivatives"):
        exact.matrices(0.37, 1)
    with pytest.raises(CouplingError, match="place of the head"):
        exact.matrices_bound(1)


def test_the_bare_machine_s_terms_are_its_head_s_masses() -> None:
    machine = published_machine()
    terms = affine_terms(affine_machine(machine))
    assert len(terms.names) == 1 + 4 + 10
    k = terms.names.index("phi[eta1]*phi[eta3]")
    assert terms.mass[k, 0, 2] == pytest.approx(machine.head.m1 + machine.head.m2)
    assert not terms.stiffness[1:].any()
    assert not terms.damping[1:].any()


@QUICK
@given(machines().filter(lambda m: m.rail.torsion is None), st.floats(0.05, 0.95), st.integers(0, 3))
def test_derivatives_are_differences_and_within_their_bounds(machine: Machine, position: float, order: int) -> None:
    exact, step = affine_machine(machine), 1e-4
    after, before = (exact.matrices(position + sign * step, order) for sign in (1, -1))
    found, bound = exact.matrices(position, order + 1), exact.matrices_bound(order + 1)
    for k in range(3):
        difference = (after[k] - before[k]) / (2 * step)
        assert np.abs(found[k] - difference).max() <= 1e-4 * bound[k].max() + 1e-9 * np.abs(after[k]).max() / step
        assert (np.abs(found[k]) <= bound[k] * (1 + 1e-12)).all()
    for port in ("tool_x", "base"):
        ends = [exact.port(port, position + sign * step, order) for sign in (1, -1)]
        row = exact.port(port, position, order + 1)
        largest = exact.rail_row_bound(order + 1).max()
        assert np.abs(row - (ends[0] - ends[1]) / (2 * step)).max() <= 1e-4 * largest + 1e-9
