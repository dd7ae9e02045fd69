"""Parts of a structure differ by themselves within the tolerance of their matrix; springs in reduced coordinates."""

import numpy as np
import pytest

from cutvib_ss.diagnosis.linearity import _in_band
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure

MASS = np.diag([2.0, 1.0, 1.0])
STIFFNESS = np.array([[5e4, -3e4, 0.0], [-3e4, 5e4, -2e4], [0.0, -2e4, 2e4]])
PORTS = {"base": [1.0, 0.0, 0.0], "tip": [0.0, 0.0, 1.0], "upper": [0.0, -1.0, 1.0], "both": [-1.0, 0.0, 1.0]}


def of(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray, ports: dict[str, np.ndarray]) -> Structure:
    system = SecondOrder(mass, damping, stiffness, ("a", "b", "c"), ports)
    return Structure(system, {"y": Channel("tip", "acceleration")}, "base")


def structure(turned: np.ndarray | None = None) -> Structure:
    """A chain of three masses, its coordinates turned if need be."""
    t = np.eye(3) if turned is None else turned
    matrices = [t.T @ m @ t for m in (MASS, 1e-4 * STIFFNESS, STIFFNESS)]
    return of(*matrices, {name: t.T @ np.array(row) for name, row in PORTS.items()})


def test_what_a_part_may_differ_by_is_tolerated() -> None:
    chain = structure()
    # Two percent each, of a spring of 2e4 N/m, of a mass of 1 kg.
    assert ToolContact("upper", 600.0, 0.0).tolerated(chain)
    assert ToolContact("upper", -600.0, 0.0).tolerated(chain)
    assert not ToolContact("upper", 1000.0, 0.0).tolerated(chain)
    assert not ToolContact("upper", 600.0, 50.0).tolerated(chain)
    assert AddedMass("tip", 0.03).tolerated(chain)
    assert not AddedMass("tip", 0.06).tolerated(chain)
    # Nothing holds the tip to ground: a spring there is no part of the model.
    assert not ToolContact("tip", 10.0, 0.0).tolerated(chain)


def test_the_spring_of_a_port_in_modal_coordinates() -> None:
    chain = structure()
    rng = np.random.default_rng(1)
    turned = structure(np.linalg.qr(rng.standard_normal((3, 3)))[0])
    spring, same = chain.spring_at("upper"), turned.spring_at("upper")
    assert spring is not None
    assert same is not None
    # In a chain that is held at its base the static stiffness between two masses is that of the spring.
    assert same[0] == pytest.approx(spring[0], rel=1e-9)


def test_a_port_that_floats_has_no_spring() -> None:
    free = STIFFNESS.copy()
    free[0, 0] -= 2e4
    t = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))[0]
    ports = {name: t.T @ np.array(row) for name, row in PORTS.items()}
    floating = of(t.T @ MASS @ t, 1e-4 * t.T @ free @ t, t.T @ free @ t, ports)
    assert floating.spring_at("tip") is None
    found = floating.spring_at("both")
    assert found is not None
    assert found[0] == pytest.approx(1.0 / (1.0 / 3e4 + 1.0 / 2e4))


def test_what_wanders_off_is_no_motion_in_the_band() -> None:
    time = np.arange(8000) / 400.0
    ringing = 1e-4 * np.sin(2 * np.pi * 40.0 * time)
    found = _in_band((ringing + 1e-3 * time)[None, None], 400.0, 20.0)
    # 20 mm of wander; where a record is cut off in full swing the filter rings a little.
    np.testing.assert_allclose(found[0, 0, 2000:6000], ringing[2000:6000], atol=1e-6)
    assert np.abs(found).max() < 1.5e-4
