"""Modes at a position, and modes followed along the rail."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import Attachment, Guide, SpringDamperMass, SprungMass
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.rail import EndSupports, Torsion
from cutvib_ss.model.second_order import Channel, MatrixStack, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response import modes as at_work
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import mac, modes, track_modes

MACHINE = published_machine()
TEN = MACHINE.replace(n_modes=10)
POSITIONS = np.linspace(0.03, 0.97, 9)
OTHERS = {
    "published": MACHINE,
    "20 modes": MACHINE.replace(n_modes=20),
    "40 modes": MACHINE.replace(n_modes=40),
    "guide": replace(TEN, guide=Guide(5e7, 500.0)),
    "torsion": replace(TEN, rail=replace(TEN.rail, torsion=Torsion(0.05, 0.8, 180.0, 0.02))),
    "supports": replace(TEN, rail=replace(TEN.rail, supports=EndSupports(1e7, 2e7, 300.0, 200.0))),
    "overdamped supports": replace(TEN, rail=replace(TEN.rail, supports=EndSupports(1e7, 2e7, 3e5, 2e5))),
    "absorber": replace(MACHINE, attachments=(Attachment("tool_x", SprungMass(0.05, 217.0, 0.1)),)),
    "veering": MACHINE.replace(first_frequency=53.0),
    "heavy damping": MACHINE.replace(c1=400.0, c2=10.0),
    "undamped": MACHINE.replace(c1=0.0, c2=0.0, damping_ratio=0.0),
}
"""Machines whose modes are held against other routes."""


def structure(mass: np.ndarray, damping: np.ndarray, stiffness: np.ndarray) -> Structure:
    n = len(mass)
    system = SecondOrder(mass, damping, stiffness, tuple(f"x{i}" for i in range(n)), {"first": np.eye(n)[0]})
    return Structure(system, {"y": Channel("first", "displacement")}, "first")


def test_poles_are_those_of_the_plant() -> None:
    for position in (0.02, 1 / 3, 0.5, 0.77):
        found = modes(MACHINE, position)
        of_plant = np.linalg.eigvals(MACHINE.plant(position).A)
        of_plant = of_plant[of_plant.imag > 0]
        assert np.abs(found.poles[:, None] - of_plant[None, :]).min(axis=1).max() < 1e-9 * np.abs(of_plant).max()
        assert np.array_equal(found.damping_ratio, -found.poles.real / np.abs(found.poles))


def test_each_pole_is_near_the_frequency_that_it_continues() -> None:
    found = modes(MACHINE, 0.4)
    assert np.abs(found.poles) / (2 * np.pi) == pytest.approx(found.natural_freq, rel=0.01)


def test_shapes_solve_the_undamped_problem() -> None:
    found, system = modes(MACHINE, 0.3), MACHINE.second_order(0.3)
    omega = 2 * np.pi * found.natural_freq
    left = system.stiffness @ found.mode_shapes
    right = system.mass @ found.mode_shapes * omega**2
    assert np.abs(left - right).max() < 1e-9 * np.abs(left).max()


def test_modal_sum_gives_the_undamped_response() -> None:
    still = replace(
        MACHINE,
        head=replace(MACHINE.head, c1=0.0, c2=0.0),
        rail=replace(MACHINE.rail, parameters=replace(MACHINE.rail.parameters, damping_ratio=0.0)),
    )
    found, freq = modes(still, 0.3), np.array([10.0, 100.0, 217.0])
    at_tool = still.second_order(0.3).port("tool_x") @ found.mode_shapes
    summed = (at_tool**2 / ((2 * np.pi * found.natural_freq) ** 2 - (2 * np.pi * freq[:, None]) ** 2)).sum(axis=1)
    closed = frequency_response(still, 0.3, freq, form="receptance", outputs=("tool_x",)).data[0, 0, 0]
    assert summed == pytest.approx(closed.real, rel=1e-9)


def test_a_free_body_has_a_mode_and_a_pole_at_zero() -> None:
    k = 1e4 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    found = modes(structure(np.diag([1.0, 2.0]), 1e-4 * k, k))
    assert found.natural_freq[0] == 0.0
    assert found.poles[0] == 0.0
    assert found.damping_ratio[0] == 0.0
    assert found.natural_freq[1] == pytest.approx(np.sqrt(1.5e4) / (2 * np.pi))


def test_a_mode_damped_beyond_oscillation_has_its_slower_real_pole() -> None:
    found = modes(structure(np.eye(1), np.array([[50.0]]), np.array([[400.0]])))
    assert found.poles == pytest.approx([-10.0])
    assert found.damping_ratio == pytest.approx([1.0])


def test_hysteretic_damping_enters_the_poles_exactly() -> None:
    damped = EFFECTS["structural_damping"](place="joint2", loss_factor=0.1).apply(MACHINE)
    found = modes(damped, 0.3)
    for pole in found.poles:
        freq = [pole.imag / (2 * np.pi)]
        at, beside = (
            np.abs(frequency_response(damped, 0.3, freq, form="receptance", decay_rate=rate).data).max()
            for rate in (pole.real, 1.01 * pole.real)
        )
        assert at > 1e5 * beside


def test_a_machine_needs_a_position_and_a_structure_has_none() -> None:
    with pytest.raises(ParameterError, match="position"):
        modes(MACHINE)
    with pytest.raises(ParameterError, match="position"):
        modes(MACHINE, 1.2)
    with pytest.raises(ParameterError, match="position"):
        modes(structure(np.eye(1), np.eye(1), np.eye(1)), 0.5)


@pytest.mark.parametrize("machine", OTHERS.values(), ids=OTHERS)
def test_modes_of_many_positions_are_those_of_the_plants(machine: Machine) -> None:
    for position, found in zip(POSITIONS, modes(machine, POSITIONS), strict=True):
        system, n = machine.second_order(position), found.natural_freq.size
        squares, shapes = linalg.eigh(system.stiffness, system.mass)
        assert found.position == position
        assert found.dofs == system.dofs
        assert found.natural_freq == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-10)
        assert np.abs(np.abs(found.mode_shapes) - np.abs(shapes)).max() < 1e-8 * np.abs(shapes).max()
        assert (found.mode_shapes.max(axis=0) >= -found.mode_shapes.min(axis=0)).all()
        # All poles of the upper half plane, each once; beyond oscillation some of the real ones.
        of_plant = np.linalg.eigvals(np.asarray(machine.plant(position).A))
        upper = of_plant[of_plant.imag > 0]
        swinging = found.poles[found.poles.imag > 0]
        assert swinging.size == upper.size
        near = np.abs(swinging[:, None] - upper)
        assert sorted(near.argmin(axis=1)) == list(range(upper.size))
        assert (near.min(axis=1) < 1e-9 * np.abs(upper).max()).all()
        # Each continues the mode that takes the largest part in its motion, as far as the parts can be told apart.
        first = np.block([[system.damping, system.mass], [system.mass, np.zeros((n, n))]])
        values, vectors = linalg.eig(
            np.block([[-system.stiffness, np.zeros((n, n))], [np.zeros((n, n)), system.mass]]), first
        )
        parts = np.abs(found.mode_shapes.T @ system.mass @ vectors[:n]) ** 2
        parts = (parts / parts.sum(axis=0))[:, np.abs(found.poles[:, None] - values).argmin(axis=1)]
        clear = parts.max(axis=0) > 0.6
        assert (parts.argmax(axis=0) == np.arange(n))[clear & (found.poles.imag > 0)].all()


@pytest.mark.parametrize("machine", OTHERS.values(), ids=OTHERS)
def test_many_positions_and_one_are_the_same_modes(machine: Machine) -> None:
    for position, found in zip(POSITIONS, modes(machine, POSITIONS), strict=True):
        one = modes(machine, position)
        assert found.natural_freq == pytest.approx(one.natural_freq, rel=1e-12)
        assert np.abs(found.poles - one.poles).max() < 1e-12 * np.abs(one.poles).max()
        assert np.abs(found.mode_shapes - one.mode_shapes).max() < 1e-9


LOSSY = MACHINE.replace(attachments=(Attachment("joint2", SpringDamperMass(loss_stiffness=900.0)),))


@pytest.mark.parametrize("machine", [*OTHERS.values(), LOSSY], ids=[*OTHERS, "hysteresis"])
def test_poles_that_are_followed_are_those_that_are_paired(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    positions = np.linspace(0.03, 0.97, 31)
    followed = modes(machine, positions)
    monkeypatch.setattr(at_work, "_LEADING", 2.0)  # nothing is without doubt
    for found, paired in zip(followed, modes(machine, positions), strict=True):
        assert found.poles == pytest.approx(paired.poles, rel=1e-9)


def test_light_damping_needs_no_pairing_and_heavy_damping_does(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    pairing = at_work._paired
    monkeypatch.setattr(at_work, "_paired", lambda *given: asked.append(given) or pairing(*given))  # type: ignore[func-returns-value]
    modes(OTHERS["20 modes"], POSITIONS)
    assert not asked
    modes(OTHERS["heavy damping"], POSITIONS)
    assert len(asked) == POSITIONS.size


def test_many_hysteretic_and_causal_positions_are_taken_one_by_one() -> None:
    for form in ("constant", "causal"):
        damped = EFFECTS["structural_damping"](place="joint2", loss_factor=0.05, form=form).apply(MACHINE)
        for position, found in zip((0.2, 0.5), modes(damped, [0.2, 0.5]), strict=True):
            assert found.position == position
            assert found.poles == pytest.approx(modes(damped, position).poles, rel=1e-12)


def test_a_stiff_guide_costs_low_frequencies_no_digits() -> None:
    # Of the problem the other way round the slow modes are the largest values, and exact.
    system = (stiff := replace(TEN, guide=Guide(1e12))).second_order(0.31)
    slow = linalg.eigh(system.mass, system.stiffness, eigvals_only=True)[::-1]
    assert modes(stiff, 0.31).natural_freq[:3] == pytest.approx(1 / (2 * np.pi * np.sqrt(slow[:3])), rel=1e-10)


def test_several_positions_give_a_tuple_and_names_are_taken() -> None:
    assert isinstance(modes(MACHINE, [0.3]), tuple)
    assert [at.position for at in modes(MACHINE, (0.3, 0.2))] == [0.3, 0.2]
    assert [at.position for at in modes(MACHINE, ["FC", 0.2])] == [modes(MACHINE, "FC").position, 0.2]  # type: ignore[call-overload, list-item]
    assert not isinstance(modes(MACHINE, np.array(0.3)), tuple)  # type: ignore[call-overload]


def test_wrong_positions_are_refused() -> None:
    with pytest.raises(ParameterError, match="list of positions is empty"):
        modes(MACHINE, [])
    with pytest.raises(ParameterError, match="list of positions is empty"):
        track_modes(MACHINE, [])
    with pytest.raises(ParameterError, match="list of positions is empty"):
        frequency_response(MACHINE, [], [10.0])
    with pytest.raises(ParameterError, match=r"position = 1.2 must lie strictly between 0 and 1"):
        modes(MACHINE, [0.3, 1.2])
    with pytest.raises(ParameterError, match="has no position"):
        modes(structure(np.eye(1), np.eye(1), np.eye(1)), [0.2, 0.3])


def test_a_mass_matrix_that_is_not_positive_definite_has_no_modes() -> None:
    two = np.array([np.eye(2), np.diag([1.0, -1.0])])
    with pytest.raises(CouplingError, match="not positive definite"):
        at_work._undamped(MatrixStack(two, two, np.abs(two), ("a", "b")))


def test_mac_of_a_set_with_itself_is_one_on_the_diagonal() -> None:
    found, mass = modes(MACHINE, 0.3), MACHINE.second_order(0.3).mass
    assert mac(found.mode_shapes, found.mode_shapes, mass) == pytest.approx(np.eye(6), abs=1e-12)
    assert np.diag(mac(found.mode_shapes, -2j * found.mode_shapes)) == pytest.approx(np.ones(6))
    assert mac([[1.0], [0.0]], [[0.0], [0.0]]) == 0.0
    with pytest.raises(ParameterError, match="compared"):
        mac(np.ones((2, 1)), np.ones((3, 1)))


def test_tracked_modes_are_those_of_each_position() -> None:
    positions = np.linspace(0.02, 0.98, 25)
    tracked = track_modes(MACHINE, positions)
    for k, position in enumerate(positions):
        found = modes(MACHINE, position)
        order = np.argsort(tracked.natural_freq[k])
        assert tracked.natural_freq[k, order] == pytest.approx(found.natural_freq, rel=1e-12)
        assert tracked.poles[k, order] == pytest.approx(found.poles, rel=1e-9)
    assert tracked.mac.min() > 0.9


def test_tracked_shapes_change_little_from_step_to_step() -> None:
    positions = np.linspace(0.1, 0.9, 401)
    tracked = track_modes(MACHINE, positions)
    for k in range(1, positions.size):
        mass = MACHINE.second_order(positions[k]).mass
        overlap = np.einsum("ik,ij,jk->k", tracked.mode_shapes[k - 1], mass, tracked.mode_shapes[k])
        assert overlap.min() > 0.95


def test_a_mode_is_followed_through_a_crossing() -> None:
    # At L/2 the even modes do not feel the head: with a rail whose second mode is near the head's they cross others.
    crossing = replace(
        MACHINE, rail=replace(MACHINE.rail, parameters=replace(MACHINE.rail.parameters, first_frequency=53.0))
    )
    tracked = track_modes(crossing, np.linspace(0.3, 0.5, 41))
    pure = np.abs(tracked.mode_shapes[-1, 1]) ** 2
    follower = int(np.argmax(pure))
    assert tracked.natural_freq[-1, follower] == pytest.approx(4 * 53.0, rel=1e-9)
    jumps = np.abs(np.diff(tracked.natural_freq, axis=0)).max(axis=0)
    assert jumps.max() < 8.0


def test_a_coarse_walk_ends_on_the_same_modes_as_a_fine_one() -> None:
    fine, coarse = (track_modes(MACHINE, np.linspace(0.05, 0.95, n)) for n in (181, 4))
    assert coarse.natural_freq[-1] == pytest.approx(fine.natural_freq[-1], rel=1e-9)


def test_structures_are_not_tracked() -> None:
    with pytest.raises(ParameterError, match="no"):
        track_modes(structure(np.eye(1), np.eye(1), np.eye(1)), [0.1, 0.2])  # type: ignore[arg-type]


def test_attachments_add_their_own_modes() -> None:
    heavier = replace(MACHINE, attachments=(Attachment("tool_x", SpringDamperMass(mass=0.3)),))
    assert (modes(heavier, 0.3).natural_freq <= modes(MACHINE, 0.3).natural_freq).all()
    resonator = EFFECTS["local_resonator"](place="tool", mass=0.1, frequency=150.0, damping_ratio=0.02).apply(MACHINE)
    assert modes(resonator, 0.3).natural_freq.size == 7


def test_the_generalised_problem_is_scipy_s() -> None:
    system = MACHINE.second_order(0.21)
    squares = linalg.eigh(system.stiffness, system.mass, eigvals_only=True)
    assert modes(MACHINE, 0.21).natural_freq == pytest.approx(np.sqrt(squares) / (2 * np.pi), rel=1e-12)
