"""Stepping in time: against closed forms, python-control and an accurate integrator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import control
import numpy as np
import pytest

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import Attachment, SpringDamperMass
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.stepping import modal_form, step
from tests.unit.event_integrator import integrate

FS = 8000.0
HALF_MS = 5e-4


def pulse(t: np.ndarray | float, at: float = 0.01, width: float = HALF_MS) -> np.ndarray | float:
    """A blow of 1 N whose spectrum is nothing at 4 kHz: smooth, unlike what acts on a structure at rest, by 1e-17."""
    return np.exp(-(((t - at) / width) ** 2))


def two_masses(k: float = 2.5e5, input_quantity: str = "force") -> Structure:
    """Two masses on a wall; 40 and 120 Hz."""
    ports = {"drive": np.array([1.0, 0.0]), "link": np.array([-1.0, 1.0])}
    system = SecondOrder(
        np.diag([2.0, 1.5]), np.array([[20.0, -8.0], [-8.0, 8.0]]), k * np.array([[2.0, -1.0], [-1.0, 1.0]]), ("x1", "x2"), ports
    )  # fmt: skip
    channels = {"a": Channel("drive", "acceleration"), "d": Channel("link", "displacement")}
    return Structure(system, channels, "drive", input_quantity)  # type: ignore[arg-type]


def chain(n: int, c: float) -> Structure:
    """Masses in a row on springs, to 2 kHz; one dashpot at their end couples all modes."""
    k = (2 * np.pi * 1000.0) ** 2
    stiffness = k * (2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    damping = 1e-5 * stiffness
    damping[-1, -1] += c
    system = SecondOrder(np.eye(n), damping, stiffness, tuple(f"x{i}" for i in range(n)), {"end": np.eye(n)[-1]})
    return Structure(system, {"end": Channel("end", "displacement")}, "end")


def one_mass(k: float, c: float = 0.0) -> Structure:
    """A mass of 1 kg on a spring; without one it is free."""
    system = SecondOrder(np.eye(1), np.array([[c]]), np.array([[k]]), ("x",), {"x": np.ones(1)})
    return Structure(system, {"x": Channel("x", "displacement")}, "x")


def with_element(model: Machine | Structure, port: str, law: str, **parameters: float) -> Machine | Structure:
    """The model with one nonlinear element."""
    return replace(model, nonlinear=(NonlinearElement(port, law, parameters),))


@pytest.mark.parametrize("c", [30.0, 1e6])  # the latter overdamps a mode
def test_damping_that_couples_no_modes_above_a_limit(c: float) -> None:
    model, s = chain(30, c), 2j * np.pi * np.linspace(20.0, 200.0, 400)
    exact = modal_form(model).receptance(s)
    same = modal_form(model, classical_above=1e5)
    np.testing.assert_allclose(same.receptance(s), exact, rtol=1e-9)
    errors = [
        np.abs(modal_form(model, classical_above=f).receptance(s) - exact).max() / np.abs(exact).max()
        for f in (400.0, 800.0, 1600.0)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert c > 1e3 or errors[2] < 2e-4
    # One by one they are what they are together where nothing couples them.
    alone = replace(model, system=replace(model.system, damping=1e-5 * model.system.stiffness))
    split, whole = modal_form(alone, classical_above=800.0), modal_form(alone)
    np.testing.assert_allclose(split.receptance(s), whole.receptance(s), rtol=1e-9)
    state = np.random.default_rng(1).standard_normal(60)
    moved = [(f.shapes @ (f.from_state @ state)).real for f in (split, whole)]
    np.testing.assert_allclose(moved[0], moved[1], rtol=1e-9)
    assert moved[0] == pytest.approx(state[29])


# --- linear -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", [published_machine(), two_masses(), two_masses(input_quantity="acceleration")])
def test_without_elements_it_is_the_linear_response(model: Machine | Structure) -> None:
    at = 0.37 if model.has_position else None
    t, fine = np.arange(800) / FS, np.arange(800 * 32) / (32 * FS)
    shown = step(modal_form(model, at), pulse(t)[None], FS).responses[0]
    for k, (name, channel) in enumerate(model.channels.items()):
        plant = model.plant(at, outputs=[name], quantity=channel.quantity)
        exact = control.forced_response(plant, fine, pulse(fine)).outputs[::32]
        # The integrator's hold on the fine grid leaves an error of 1e-5.
        assert np.abs(shown[k] - exact).max() < 2e-5 * np.abs(exact).max()


def test_a_whole_response_has_the_exact_spectrum() -> None:
    # Damped so that everything dies out within the record.
    model = two_masses()
    system = replace(model.system, damping=20.0 * model.system.damping)
    model = replace(model, system=system)
    t = np.arange(6000) / FS
    shown = step(modal_form(model), pulse(t)[None], FS).responses[0]
    freq = np.fft.rfftfreq(t.size, 1 / FS)[1:400]
    exact = frequency_response(model, None, freq).data[0, :, 0] * np.fft.rfft(pulse(t))[1:400]
    error = np.abs(np.fft.rfft(shown)[:, 1:400] - exact).max(axis=1)
    assert (error < 1e-8 * np.abs(exact).max(axis=1)).all()


def test_ports_rail_points_and_other_quantities_are_read() -> None:
    machine, t = published_machine(), np.arange(2000) / FS
    form = modal_form(
        machine, 0.3, ["tool_x", "rail(0.3)", "base_x", "joint2"], quantities=["velocity"] + 3 * ["displacement"]
    )
    x, rail, base, joint = step(form, pulse(t)[None], FS).responses[0]
    assert np.allclose(rail, base, atol=1e-12 * np.abs(base).max())
    assert np.abs(joint).max() > 0.0
    moved = step(modal_form(machine, 0.3, ["tool_x"], quantities=["displacement"]), pulse(t)[None], FS).responses[0, 0]
    assert np.abs(np.gradient(moved, 1 / FS) - x)[5:-5].max() < 0.02 * np.abs(x).max()


def test_a_free_body_and_an_undamped_one() -> None:
    t = np.arange(4000) / FS
    impulse = HALF_MS * np.sqrt(np.pi)
    free = step(modal_form(one_mass(0.0)), pulse(t)[None], FS).responses[0, 0]
    assert np.abs(free - impulse * (t - 0.01))[200:].max() < 1e-6 * free[-1]
    w = 2 * np.pi * 50.0
    still = step(modal_form(one_mass(w**2)), pulse(t)[None], FS).responses[0, 0]
    exact = impulse * np.exp(-((w * HALF_MS) ** 2) / 4) * np.sin(w * (t - 0.01)) / w
    assert np.abs(still - exact)[200:].max() < 1e-9 * np.abs(exact).max()


def test_initial_states_are_let_go() -> None:
    model = two_masses()
    form, t = modal_form(model), np.arange(2000) / FS
    plant = model.system.state_space({"force": "drive"}, {"d": ("link", "displacement")})
    whole = step(form, pulse(t)[None], FS, initial=[1e-3, -2e-3, 0.1, 0.2])
    only = step(form, np.zeros((2, t.size)), FS, initial=[[1e-3, -2e-3, 0.1, 0.2], [0.0, 0.0, 0.0, 0.0]]).responses
    rest = step(form, pulse(t)[None], FS).responses
    assert np.abs(whole.responses - rest - only[:1]).max() < 1e-12 * np.abs(rest).max()
    assert not only[1].any()
    assert only[0, 1, 0] == pytest.approx(-3e-3, rel=1e-9)
    assert plant.nstates == 4
    # The same through an element that does nothing.
    idle = with_element(model, "link", "cubic_stiffness", stiffness3=0.0)
    assert np.abs(step(modal_form(idle), pulse(t)[None], FS, idle.nonlinear, initial=[1e-3, -2e-3, 0.1, 0.2]).motions[0, 0]
                  - whole.responses[0, 1]).max() < 1e-12 * np.abs(whole.responses[0, 1]).max()  # fmt: skip


def test_blows_do_not_see_each_other() -> None:
    model = with_element(two_masses(), "link", "joint_slip", stiffness=1e5, slip_torque=3.0)
    t = np.arange(1500) / FS
    forces = np.array([300.0 * pulse(t), 0 * t, 80.0 * pulse(t, 0.02)])
    together = step(modal_form(model), forces, FS, model.nonlinear)
    for k in range(3):
        alone = step(modal_form(model), forces[k : k + 1], FS, model.nonlinear)
        assert np.allclose(alone.forces[0], together.forces[k], rtol=0, atol=1e-9)
        assert np.allclose(
            alone.responses[0], together.responses[k], rtol=0, atol=1e-12 * np.abs(together.responses).max()
        )


# --- nonlinear --------------------------------------------------------------------------------------------------------

MACHINE, MASSES = published_machine(), two_masses()
K2 = MACHINE.head.k2
ON_MACHINE: list[tuple[str, dict[str, float], float]] = [
    ("cubic_stiffness", {"stiffness3": 8e9}, 1e-6),
    ("cubic_stiffness", {"stiffness3": -8e9}, 1e-6),
    ("quadratic_damping", {"coefficient": 20.0}, 1e-5),
    ("freeplay", {"gap": 2e-5, "stiffness": K2}, 1e-3),
    ("bilinear_stiffness", {"asymmetry": 0.2, "stiffness": K2}, 1e-4),
    ("joint_slip", {"stiffness": 0.2 * K2, "slip_torque": 1.0}, 1e-3),
    ("dry_friction", {"torque": 0.5}, 1e-3),
]
ON_MASSES: list[tuple[str, dict[str, float], float]] = [
    ("cubic_stiffness", {"stiffness3": 3e11}, 1e-6),
    ("quadratic_damping", {"coefficient": 300.0}, 1e-5),
    ("freeplay", {"gap": 1e-4, "stiffness": 2.5e5}, 1e-3),
    ("bilinear_stiffness", {"asymmetry": -0.3, "stiffness": 2.5e5}, 1e-4),
    ("joint_slip", {"stiffness": 1e5, "slip_torque": 10.0}, 1e-3),
    ("dry_friction", {"torque": 5.0}, 1e-3),
]


def against_integrator(model: Machine | Structure, peak: float, at: float | None) -> float:
    """Largest error of the port's motion over its largest size."""
    t = np.arange(700) / FS
    fine = 12 if model.nonlinear[0].law == "dry_friction" else 4
    got = step(modal_form(model, at), peak * pulse(t)[None], FS, model.nonlinear, fine).motions[0, 0]
    system = model.second_order(at)
    want = integrate(
        system, system.port(model.input_port), lambda t: peak * float(pulse(t)), model.nonlinear[0], t, 1e-4
    )
    return float(np.abs(got - want).max() / np.abs(want).max())


@pytest.mark.parametrize(("law", "parameters", "within"), ON_MACHINE)
def test_on_the_machine_it_agrees_with_an_accurate_integrator(
    law: str, parameters: dict[str, float], within: float
) -> None:
    model = with_element(MACHINE, "joint2", law, **parameters)
    assert against_integrator(model, 150.0, 0.4) < within


@pytest.mark.parametrize(("law", "parameters", "within"), ON_MASSES)
def test_on_two_masses_it_agrees_with_an_accurate_integrator(
    law: str, parameters: dict[str, float], within: float
) -> None:
    model = with_element(MASSES, "link", law, **parameters)
    assert against_integrator(model, 300.0, None) < within


def test_friction_takes_the_same_off_every_half_cycle_and_then_holds() -> None:
    # Closed form: about a centre that friction moves to and fro, the amplitude falls by 2 T/k each half cycle.
    w, torque, start = 2 * np.pi * 20.0, 10.0, 0.01
    model = with_element(one_mass(w**2), "x", "dry_friction", torque=torque)
    t = np.arange(2000) / FS
    got = step(modal_form(model), np.zeros((1, t.size)), FS, model.nonlinear, initial=[start, 0.0])
    drop = 2 * torque / w**2
    half = np.floor(t * w / np.pi)
    turns = int(np.ceil((start - torque / w**2) / drop))
    half = np.minimum(half, turns)
    centre = np.where(half % 2 == 0, 1.0, -1.0) * torque / w**2
    exact = centre + (-1.0) ** half * (start - half * drop - torque / w**2) * np.cos(w * t - half * np.pi)
    rest = (-1.0) ** turns * (start - turns * drop)
    exact = np.where(half == turns, rest, exact)
    assert 2 <= turns <= 9
    assert np.abs(got.motions[0, 0] - exact).max() < 1e-3 * start
    assert np.ptp(got.motions[0, 0, t > (turns + 1) * np.pi / w]) < 1e-4 * start
    assert got.forces[0, 0, -200] == pytest.approx(-(w**2) * rest, rel=1e-2)


def test_two_elements_are_solved_together() -> None:
    cubic = NonlinearElement("link", "cubic_stiffness", {"stiffness3": 3e11})
    halves = tuple(replace(cubic, parameters={"stiffness3": 1.5e11}) for _ in range(2))
    t = np.arange(1200) / FS
    one, two = (replace(MASSES, nonlinear=e) for e in ((cubic,), halves))
    a = step(modal_form(one), 300.0 * pulse(t)[None], FS, one.nonlinear)
    b = step(modal_form(two), 300.0 * pulse(t)[None], FS, two.nonlinear)
    assert np.abs(a.responses - b.responses).max() < 1e-7 * np.abs(a.responses).max()
    assert np.allclose(a.forces[0, 0], b.forces[0].sum(axis=0), atol=1e-7 * np.abs(a.forces).max())


@pytest.mark.parametrize(("law", "parameters", "within"), [*ON_MASSES[:1], *ON_MASSES[2:]])
def test_energy_never_grows(law: str, parameters: dict[str, float], within: float) -> None:
    # After the blow, energy with that of the element's own potential; freeplay and bilinear springs have one, too.
    model = with_element(MASSES, "link", law, **parameters)
    names = ["x1", "x2"]
    model = replace(
        model, system=replace(model.system, ports={**model.system.ports, "x1": np.eye(2)[0], "x2": np.eye(2)[1]})
    )
    t = np.arange(4000) / FS
    x = step(
        modal_form(model, None, names, quantities=["displacement"] * 2), 300.0 * pulse(t)[None], FS, model.nonlinear
    )
    v = step(modal_form(model, None, names, quantities=["velocity"] * 2), 300.0 * pulse(t)[None], FS, model.nonlinear)
    q, rate = x.responses[0], v.responses[0]
    energy = 0.5 * np.einsum("it,ij,jt->t", rate, model.system.mass, rate)
    energy += 0.5 * np.einsum("it,ij,jt->t", q, model.system.stiffness, q)
    link, value = q[1] - q[0], list(parameters.values())
    if law == "cubic_stiffness":
        energy += value[0] * link**4 / 4
    elif law == "freeplay":
        inside = np.minimum(np.abs(link), value[0])
        energy -= value[1] * (inside**2 / 2 + value[0] * (np.abs(link) - inside))
    elif law == "bilinear_stiffness":
        energy += value[0] * value[1] * link * np.abs(link) / 2
    elif law == "joint_slip":
        energy += x.forces[0, 0] ** 2 / (2 * value[0])
    after = energy[200:]
    # Corners of the energy lie above the Nyquist frequency: allow what their absence moves.
    assert (np.diff(after) <= 2e-3 * after[0]).all()
    assert after[-1] < 0.7 * after[0]


def test_a_softening_spring_may_run_away_and_says_so() -> None:
    model = with_element(one_mass((2 * np.pi * 30.0) ** 2), "x", "cubic_stiffness", stiffness3=-1e9)
    t = np.arange(4000) / FS
    got = step(modal_form(model), np.array([2.0 * pulse(t), 2e3 * pulse(t)]), FS, model.nonlinear)
    assert got.ran_away.tolist() == [False, True]
    assert np.isfinite(got.responses).all()


def test_stiff_laws_beyond_the_step_stay_bounded() -> None:
    for law, parameters in (
        ("cubic_stiffness", {"stiffness3": 1e22}),
        ("joint_slip", {"stiffness": 1e14, "slip_torque": 1e9}),
        ("quadratic_damping", {"coefficient": 1e9}),
    ):
        model = with_element(MASSES, "link", law, **parameters)
        t = np.arange(2000) / FS
        got = step(modal_form(model), 300.0 * pulse(t)[None], FS, model.nonlinear)
        together = MASSES.system.mass.sum()
        assert not got.ran_away.any()
        assert np.abs(got.responses[0, 0]).max() < 1.1 * 300.0 / together


# --- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "complaint"),
    [
        (lambda form: step(form, np.zeros(5), FS), "shape"),
        (lambda form: step(form, np.array([[np.nan]]), FS), "finite"),
        (lambda form: step(form, np.zeros((1, 5)), -1.0), "positive"),
        (
            lambda form: step(form, np.zeros((1, 5)), FS, (NonlinearElement("link", "dry_friction", {"torque": 1.0}),)),
            "ports",
        ),
        (lambda form: step(form, np.zeros((1, 5)), FS, initial=[1.0]), "displacement and velocity of x1, x2"),
    ],
)
def test_bad_input_is_refused(call: Callable[[object], object], complaint: str) -> None:
    with pytest.raises(ParameterError, match=complaint):
        call(modal_form(MASSES))


def test_bad_signals_are_refused() -> None:
    with pytest.raises(ParameterError, match="no port"):
        modal_form(MASSES, None, ["nowhere"])
    with pytest.raises(ParameterError, match=r"rail\(0.25\)"):
        modal_form(MACHINE, 0.5, ["rail(x)"])
    with pytest.raises(ParameterError, match="no law"):
        NonlinearElement("link", "magic", {})
    with pytest.raises(ParameterError, match="has the parameters gap, stiffness"):
        NonlinearElement("link", "freeplay", {"gap": 1.0})
    hysteretic = replace(MASSES, attachments=(Attachment("link", SpringDamperMass(loss_stiffness=1.0)),))
    with pytest.raises(CouplingError, match="equivalent viscous"):
        modal_form(hysteretic)
    assert modal_form(hysteretic, viscous_at=50.0).dofs == ("x1", "x2")
