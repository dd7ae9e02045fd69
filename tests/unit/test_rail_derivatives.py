"""Derivatives to values of the rail that the property tests leave alone, since their ranges end where models sit."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.unknown_element import UnknownGive
from cutvib_ss.errors import CouplingError
from cutvib_ss.model.elements import Guide, SmoothElement, SpringDamperMass
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.measurement_chain import ChannelChain
from cutvib_ss.model.paths import value_at, with_value
from cutvib_ss.model.rail import EndSupports, RailAttachment, Shear
from cutvib_ss.response.frequency import ChainedResponse

CHANNELS = ("tool_x", "tool_z", "base_x")
S = 2j * np.pi * np.linspace(10.0, 400.0, 150)


def responses(machine):
    return ChainedResponse(machine, np.array([0.2, 0.55]), S, ("acceleration",) * 3, CHANNELS, ("force",))


@pytest.mark.parametrize(
    ("path", "value"),
    [(("rail", "supports", "k_right"), 9e6), (("rail", "attachments", 0, "position"), 0.3)],
)
@pytest.mark.parametrize("shear", [None, Shear(15.0)])
def test_derivative(path, value, shear):
    machine = published_machine()
    rail = replace(
        machine.rail,
        supports=EndSupports(4e7, 9e6, 100.0, 200.0),
        attachments=(RailAttachment(SpringDamperMass(stiffness=1e5), 0.3, slope=True),),
        shear=shear,
    )
    machine = replace(machine, rail=rail)
    up, down = (responses(with_value(machine, path, value * (1 + h))).data() for h in (1e-5, -1e-5))
    difference = (up - down) / (2e-5 * value)
    derivative = responses(machine).derivative(path)
    assert np.abs(derivative - difference).max() < 1e-6 * np.abs(difference).max()


def smooth(scale, seed):
    return SmoothElement(scale, (10.0, 400.0), tuple(np.random.default_rng(seed).normal(size=8).tolist()))


@pytest.mark.parametrize(
    "path", [("rail", "attachments", 0, "element", "coefficients", 3), ("rail", "attachments", 0, "position")]
)
def test_an_element_of_unknown_form_on_the_rail_is_differentiated(path):
    machine = published_machine()
    point = RailAttachment(smooth(1e6, 0), 0.3)
    machine = replace(machine, rail=replace(machine.rail, attachments=(point,)))
    value = value_at(machine, path)
    up, down = (responses(with_value(machine, path, value * (1 + h))).data() for h in (1e-5, -1e-5))
    difference = (up - down) / (2e-5 * value)
    derivative = responses(machine).derivative(path)
    assert np.abs(derivative - difference).max() < 1e-6 * np.abs(difference).max()


@pytest.mark.parametrize("decay", [0.0, 12.0])
@pytest.mark.parametrize("path", [("chain", "channels", "tool_x", "error", "coefficients", 5), ("chain", "decay_rate")])
def test_an_error_of_unknown_form_of_a_channel_is_differentiated(path, decay):
    machine = published_machine()
    chain = machine.chain.with_channel("tool_x", ChannelChain(1.1, 1e-4, 0.2, smooth(0.3, 1)))
    machine = replace(machine, chain=replace(chain, decay_rate=decay))
    value = value_at(machine, path)
    step = 1e-5 * (value or 1.0)
    if not decay and path[-1] == "decay_rate":
        up, down = responses(with_value(machine, path, step)).data(), responses(machine).data()
        step /= 2
    else:
        up, down = (responses(with_value(machine, path, value + h)).data() for h in (step, -step))
    difference = (up - down) / (2 * step)
    derivative = responses(machine).derivative(path)
    assert np.abs(derivative - difference).max() < 1e-4 * np.abs(difference).max()


def test_an_error_of_a_channel_multiplies_it_alone():
    machine, error = published_machine(), smooth(0.3, 2)
    wrong = replace(machine, chain=machine.chain.with_channel("tool_x", ChannelChain(error=error)))
    shown, true = responses(wrong).data(), responses(machine).data()
    assert np.allclose(shown[:, 0], true[:, 0] * (1.0 + error.dynamic_stiffness(S)), rtol=1e-12)
    assert np.array_equal(shown[:, 1:], true[:, 1:])


def test_an_element_of_unknown_form_on_the_rail_has_a_viscous_equivalent_and_no_finite_form():
    machine = published_machine()
    machine = replace(machine, rail=replace(machine.rail, attachments=(RailAttachment(smooth(1e5, 3), 0.4),)))
    with pytest.raises(CouplingError, match="viscous"):
        machine.second_order(0.5)
    freq = 90.0
    at = np.array([2j * np.pi * freq])
    dense = machine.second_order(0.3, viscous_at=freq)
    row = dense.port("tool_x")
    exact = ChainedResponse(machine, np.array([0.3]), at, ("displacement",), ("tool_x",), ("force",)).data()
    assert np.allclose(row @ np.linalg.solve(dense.dynamic_stiffness(at)[0], row), exact.ravel()[0], rtol=1e-9)


@pytest.mark.parametrize("place", ["head_base", "rail_ends"])
def test_a_compliance_of_unknown_form_is_differentiated_and_none_is_a_rigid_guide_or_support(place):
    machine = published_machine()
    none = UnknownGive(place, place, 1e-8, 10.0, 400.0, stiff=1e14)
    assert np.allclose(responses(none.apply(machine)).data(), responses(machine).data(), rtol=1e-4)
    values = dict(zip([f"c{k}" for k in range(18)], np.random.default_rng(4).normal(size=18).tolist(), strict=True))
    one = replace(none, **values)
    moves = one.moves(one.apply(machine))
    for name in ("c2", "c11"):
        up, down = (responses(replace(one, **{name: values[name] + h}).apply(machine)).data() for h in (1e-4, -1e-4))
        difference = (up - down) / 2e-4
        [(path, slope)] = moves[name]
        derivative = slope * responses(one.apply(machine)).derivative(path)
        assert np.abs(derivative - difference).max() < 1e-5 * np.abs(difference).max()


@pytest.mark.parametrize("place", ["head_base", "rail_ends"])
def test_a_constant_compliance_is_the_spring_of_the_catalogue(place):
    machine = published_machine()
    flat = replace(UnknownGive(place, place, 1e-8, 10.0, 400.0, stiff=1e14).element, coefficients=(0.7,) + (0.0,) * 17)
    give = float(np.real(flat.dynamic_stiffness(S[75:76])[0]))
    at = slice(75, 76)
    k = 1.0 / give
    if place == "head_base":
        known, smooth = replace(machine, guide=Guide(k)), replace(machine, guide=Guide(1e14, give=flat))
    else:
        known = replace(machine, rail=replace(machine.rail, supports=EndSupports(k, k)))
        smooth = replace(machine, rail=replace(machine.rail, supports=EndSupports(1e14, 1e14, give=flat)))
    assert np.allclose(responses(smooth).data()[..., at], responses(known).data()[..., at], rtol=1e-4)
