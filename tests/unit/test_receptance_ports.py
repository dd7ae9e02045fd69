"""Ports that are solved for together, against the whole inverse."""

import numpy as np

from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.receptance import ModelReceptance


def chain(count: int = 6) -> Structure:
    """Masses in a row, the first held to ground."""
    stiffness = 4e4 * (2 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1))
    ports = {name: np.eye(count)[k] for name, k in (("foot", 0), ("middle", 3), ("tip", count - 1))}
    system = SecondOrder(
        mass=np.eye(count),
        damping=1e-4 * stiffness,
        stiffness=stiffness,
        dofs=tuple(f"x{k}" for k in range(count)),
        ports=ports,
    )
    return Structure(system, {name: Channel(name, "displacement") for name in ports}, "tip")


def test_named_ports_answer_as_the_whole_inverse_does() -> None:
    s = 2j * np.pi * np.linspace(5.0, 60.0, 40)
    named, whole = (ModelReceptance(chain(), np.zeros(1), s, ports) for ports in (("tip", "foot"), ()))
    for one, other in (("tip", "foot"), ("tip", "tip"), ("middle", "tip"), ("middle", "middle")):
        np.testing.assert_allclose(named.between(one, other), whole.between(one, other), rtol=1e-10)
    stiffness, mass = chain().system.stiffness, chain().system.mass
    direct = [np.linalg.inv(stiffness + z * 1e-4 * stiffness + z * z * mass)[-1, 0] for z in s]
    np.testing.assert_allclose(named.between("tip", "foot")[0], direct, rtol=1e-10)
