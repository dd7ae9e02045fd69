"""Structures of many degrees of freedom, solved over their modes, against the dense equation of motion."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.model.elements import Attachment, SpringDamperMass, SprungMass
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import ChainedResponse

N = 9
S = 0.4 + 2j * np.pi * np.linspace(1.0, 60.0, 83)
RNG = np.random.default_rng(5)


def chain(local_damper: bool = False, base: bool = False) -> Structure:
    """Masses in a row, damped by their modes or by a damper at one of them."""
    k = 2e4 * (2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1))
    m = np.diag(RNG.uniform(0.5, 2.0, N))
    c = 2e-4 * k + 0.5 * m
    if local_damper:
        c[3, 3] += 40.0
    ports = {f"p{i}": np.eye(N)[i] for i in range(N)} | {"between": np.eye(N)[2] - np.eye(N)[5], "base": np.ones(N)}
    channels = {"a": Channel("p1", "acceleration"), "b": Channel("p7", "displacement")}
    system = SecondOrder(m, c, k, tuple(f"q{i}" for i in range(N)), ports)
    return Structure(system, channels, "base" if base else "p4", "acceleration" if base else "force")


FEET = (
    Attachment("p2", SpringDamperMass(stiffness=3e3, damping=4.0, mass=0.2, loss_stiffness=100.0)),
    Attachment("between", SpringDamperMass(damping=25.0)),
    Attachment("p2", SprungMass(mass=0.3, frequency=12.0, damping_ratio=0.03)),
)


def dense(model: Structure) -> np.ndarray:
    """Responses by definition, shape (output, frequency)."""
    core = model.scaled
    e = core.dynamic_stiffness(S)
    load = np.broadcast_to(core.ports[model.input_port], (S.size, N)) + 0j
    if model.influence is not None:
        load = -np.broadcast_to(core.mass @ model.influence, (S.size, N)) + 0j
    for a in model.attachments:
        p, z = core.ports[a.port], a.element.dynamic_stiffness(S)
        e = e + z[:, None, None] * np.outer(p, p)
        if model.influence is not None:
            mass = z / S**2 if isinstance(a.element, SprungMass) else a.element.mass + 0 * S
            load = load - mass[:, None] * p * (p @ model.influence)
    x = np.linalg.solve(e, load[:, :, None])[:, :, 0]
    out = np.array([x @ core.ports["p1"], x @ core.ports["p7"]])
    if model.influence is not None:
        out[0] += 1.0 / S**2
    out[0] *= S**2
    return out


def seen(model: Structure) -> ChainedResponse:
    return ChainedResponse(model, np.array([np.nan]), S, ["acceleration", "displacement"], ["a", "b"], ["force"])


@pytest.mark.parametrize("base", [False, True])
@pytest.mark.parametrize("local_damper", [False, True])
@pytest.mark.parametrize("feet", [(), FEET[:1], FEET])
def test_responses_are_those_of_the_dense_equation(local_damper, base, feet) -> None:
    model = replace(chain(local_damper, base), attachments=feet)
    errors = 1.0 + 0.1 * RNG.standard_normal(len(model.system.parts))
    for tuned in (model, replace(model, parts=tuple(errors), scales=(1.02, 0.9, 0.97))):
        expected = dense(tuned)
        assert seen(tuned).data()[0, :, 0] == pytest.approx(expected, rel=1e-9, abs=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("path", [("parts", 1), ("parts", 40), ("scales", 2), ("attachments", 0, "element", "damping")])
def test_derivatives_are_those_of_differences(path) -> None:
    model = replace(chain(), attachments=FEET)
    h = 1e-5

    def moved(by: float) -> Structure:
        if path[0] in ("parts", "scales"):
            values = list(getattr(model, path[0]))
            values[path[1]] += by
            return replace(model, **{path[0]: tuple(values)})
        element = replace(FEET[0].element, damping=FEET[0].element.damping + by)
        return replace(model, attachments=(replace(FEET[0], element=element), *FEET[1:]))

    expected = (dense(moved(h)) - dense(moved(-h))) / (2 * h)
    found = seen(model).derivatives([path])[0, 0, :, 0]
    for own, other in zip(found, expected, strict=True):
        assert own == pytest.approx(other, rel=1e-5, abs=1e-6 * np.abs(other).max())


def test_parts_over_modes_are_the_same_parts() -> None:
    system = chain().system
    scale = np.diag(system.mass) ** -0.5
    _, shapes = np.linalg.eigh(scale[:, None] * system.stiffness * scale)
    basis = scale[:, None] * shapes
    for own, over in zip(system.parts, system.in_modes.parts, strict=True):
        assert (own.power, own.modes) == (over.power, over.modes)
        signs = np.sign(np.diag(np.linalg.solve(basis, _back(system, basis))))
        turned = (basis * signs).T @ own.change @ (basis * signs)
        assert turned == pytest.approx(over.change, rel=1e-8, abs=1e-8 * np.abs(over.change).max())


def _back(system: SecondOrder, basis: np.ndarray) -> np.ndarray:
    """The modes of `in_modes` over the degrees of freedom: its ports at single degrees of freedom are their rows."""
    return np.array([system.in_modes.ports[f"p{i}"] for i in range(N)])


def test_modal_damping_leaves_nothing_coupled() -> None:
    over = chain().system.in_modes
    for matrix in (over.mass, over.damping, over.stiffness):
        assert np.count_nonzero(matrix - np.diag(np.diag(matrix))) == 0
    assert np.count_nonzero(chain(local_damper=True).system.in_modes.damping) == N * N
