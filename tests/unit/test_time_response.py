"""Responses in time: against python-control, closed forms, and themselves by other routes."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace

import control
import numpy as np
import pytest

from cutvib_ss.absorber.force import HarmonicForce
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.errors import ConvergenceError, CouplingError, ParameterError
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.nonlinear_system import nonlinear_system
from cutvib_ss.response.pulses import harmonic_force, pulse_train
from cutvib_ss.response.time_response import time_response
from cutvib_ss.results import TimeResponse
from tests.unit.event_integrator import integrate

MACHINE = published_machine()
K2 = MACHINE.head.k2
FS = 217 * 64.0


def oscillator(k: float = (2 * np.pi * 50.0) ** 2, c: float = 0.0, **more: object) -> Structure:
    """One mass of 1 kg."""
    system = SecondOrder(np.eye(1), np.array([[c]]), np.array([[k]]), ("x",), {"x": np.ones(1)})
    return Structure(system, {"x": Channel("x", "displacement")}, "x", **more)  # type: ignore[arg-type]


def with_law(law: str, **parameters: float) -> Machine:
    """The published machine with a law in its second joint."""
    return replace(MACHINE, nonlinear=(NonlinearElement("joint2", law, parameters),))


# --- linear -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_agrees_with_forced_response(quantity: str) -> None:
    force = np.random.default_rng(1).normal(size=4000)
    got = time_response(MACHINE, 0.3, force, FS, outputs=["tool_x", "head_z", "base_x"], quantity=quantity)  # type: ignore[arg-type]
    plant = MACHINE.plant(0.3, outputs=got.outputs, quantity=quantity)  # type: ignore[arg-type]
    want = control.forced_response(plant, got.time, force).outputs
    assert (np.abs(got.data - want).max(axis=1) < 1e-9 * np.abs(want).max(axis=1)).all()
    assert set(got.units) == {{"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}[quantity]}


def test_a_shaken_structure_and_other_inputs() -> None:
    shaken = oscillator(c=3.0, input_quantity="acceleration")
    force = np.random.default_rng(2).normal(size=1000)
    got = time_response(shaken, None, force, 1000.0)
    want = control.forced_response(shaken.plant(), got.time, force).outputs
    assert np.abs(got.data - want).max() < 1e-9 * np.abs(want).max()
    assert got.force_unit == "m/s^2"
    there = time_response(MACHINE, 0.4, force, FS, outputs=["tool_x"], quantity="displacement", input="rail(0.7)")
    back = time_response(MACHINE, 0.4, force, FS, outputs=["rail(0.7)"], quantity="displacement")
    assert np.abs(there.data - back.data).max() < 1e-9 * np.abs(there.data).max()
    assert there.force_unit == "N"


def test_from_a_state() -> None:
    w, t = 2 * np.pi * 50.0, np.arange(500) / 2000.0
    got = time_response(
        oscillator(),
        None,
        np.zeros(500),
        2000.0,
        outputs=["x", "x"],
        quantity=["displacement", "velocity"],
        start=[0.1, 3.0],
    )
    assert np.allclose(got.data[0], 0.1 * np.cos(w * t) + 3.0 / w * np.sin(w * t), atol=1e-12)
    assert np.allclose(got.data[1], -0.1 * w * np.sin(w * t) + 3.0 * np.cos(w * t), atol=1e-9)


def test_the_periodic_state_is_the_end_of_a_long_run_and_the_frequency_response() -> None:
    force = pulse_train(FS, 1 / 217, amplitude=100.0)
    names = ["tool_x", "tool_z", "base_x", "rail_left_force", "joint2"]
    steady = time_response(MACHINE, 0.5, force, FS, outputs=names, start="periodic")
    long = time_response(MACHINE, 0.5, np.tile(force, 217 * 30), FS, outputs=names)
    size = np.abs(steady.data).max(axis=1)
    assert (np.abs(long.data[:, -64:] - steady.data).max(axis=1) < 1e-9 * size).all()
    # Lines of a spectrum of one period are the harmonics; a linear course between samples weighs them by sinc².
    freq, amplitude = time_response(
        MACHINE, 0.5, force, FS, outputs=["tool_x"], quantity="displacement", start="periodic"
    ).spectrum()
    assert freq[1] == pytest.approx(217.0)
    frf = np.abs(frequency_response(MACHINE, [0.5], freq[1:4], form="receptance", outputs=("tool_x",)).data[0, 0, 0])
    given = 2 * np.abs(np.fft.rfft(force))[1:4] / force.size
    assert amplitude[0, 1:4] == pytest.approx(frf * given * np.sinc(freq[1:4] / FS) ** 2, rel=1e-4)


def test_an_undamped_mode_in_tune_has_no_steady_state() -> None:
    with pytest.raises(ParameterError, match="in tune"):
        time_response(oscillator(), None, np.arange(40.0), 2000.0, start="periodic")


# --- the rail's ends --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("position", [0.2, 0.5])
def test_what_the_ends_pass_on(position: float) -> None:
    # Slowly loaded, the ends share the force like a lever; together with all inertia they balance it at any time.
    fs = 4000.0
    t = np.arange(24_000) / fs
    slow = 50.0 * np.clip(t / 5.0, 0.0, 1.0) ** 2 * (3 - 2 * np.clip(t / 5.0, 0.0, 1.0))
    ends = ["rail_left_force", "rail_right_force"]
    got = time_response(MACHINE, position, slow, fs, outputs=ends)
    assert got.unit == "N"
    assert got.data[0, -1] == pytest.approx(50.0 * (1 - position), rel=2e-3)
    assert got.data[1, -1] == pytest.approx(50.0 * position, rel=2e-3)


def test_rigid_ends_are_the_limit_of_stiff_ones() -> None:
    many = replace(MACHINE, rail=replace(MACHINE.rail, parameters=replace(MACHINE.rail.parameters, n_modes=12)))
    t = np.arange(4000) / FS
    blow = 100.0 * np.exp(-(((t - 0.01) / 2e-3) ** 2))
    for bare in (many, RailTorsion("rail", 0.05, 0.8, 180.0, 0.02).apply(many)):
        stiff = SupportCompliance("rail_ends", 1e11, 1e11, 1e5, 1e5).apply(bare)
        a, b = (
            time_response(m, 0.3, blow, FS, outputs=["rail_left_force", "rail_right_force"]).data for m in (bare, stiff)
        )
        # What is left is the ringing of the stiff ends themselves, far above the blow's spectrum.
        spectra = [np.abs(np.fft.rfft(x, axis=1)[:, :200]) for x in (a, b)]
        assert np.abs(spectra[0] - spectra[1]).max() < 2e-3 * spectra[0].max()


# --- nonlinear --------------------------------------------------------------------------------------------------------

CASES: list[tuple[str, dict[str, float], float]] = [
    ("cubic_stiffness", {"stiffness3": 8e9}, 5e-5),
    ("freeplay", {"gap": 2e-5, "stiffness": K2}, 1e-4),
    ("bilinear_stiffness", {"asymmetry": 0.2, "stiffness": K2}, 1e-4),
    ("quadratic_damping", {"coefficient": 20.0}, 5e-5),
    ("joint_slip", {"stiffness": 0.2 * K2, "slip_torque": 1.0}, 1e-3),
    ("dry_friction", {"torque": 0.5}, 1e-3),
]
each = pytest.mark.parametrize(("law", "parameters", "within"), CASES)


@each
def test_elements_take_part(law: str, parameters: dict[str, float], within: float) -> None:
    machine, t = with_law(law, **parameters), np.arange(600) / FS

    def force(t: np.ndarray | float) -> np.ndarray | float:
        return 150.0 * np.exp(-(((t - 0.01) / 1e-3) ** 2))

    # The force's own course between samples is no matter here: samples close to each other.
    fine = np.arange(600 * 8) / (8 * FS)
    got = time_response(machine, 0.4, np.asarray(force(fine)), 8 * FS, outputs=["joint2"]).data[0, ::8]
    system = machine.second_order(0.4)
    want = integrate(system, system.port("tool_x"), lambda t: float(force(t)), machine.nonlinear[0], t, 1e-4)
    assert np.abs(got - want).max() < within * np.abs(want).max()


@each
def test_the_nonlinear_periodic_state_is_the_end_of_a_long_run(
    law: str, parameters: dict[str, float], within: float
) -> None:
    machine, force = with_law(law, **parameters), pulse_train(FS, 1 / 217, amplitude=60.0)
    steady = time_response(machine, 0.5, force, FS, outputs=["tool_x", "joint2"], start="periodic")
    long = time_response(machine, 0.5, np.tile(force, 217 * 25), FS, outputs=["tool_x", "joint2"])
    size = np.abs(steady.data).max(axis=1)
    assert steady.periodic
    assert (np.abs(long.data[:, -64:] - steady.data).max(axis=1) < 1e-4 * size).all()
    linear = time_response(MACHINE, 0.5, force, FS, outputs=["tool_x", "joint2"], start="periodic")
    assert np.abs(linear.data - steady.data).max() > 1e-3 * size.max()


def test_running_away_is_said() -> None:
    softening = replace(oscillator(c=5.0), nonlinear=(NonlinearElement("x", "cubic_stiffness", {"stiffness3": -1e9}),))
    with pytest.raises(ConvergenceError, match="run away"):
        time_response(softening, None, 1e4 * np.ones(2000), 5000.0)


@pytest.mark.parametrize("law", ["cubic_stiffness", "quadratic_damping", "joint_slip", "dry_friction"])
def test_python_control_gets_the_same_machine(law: str) -> None:
    parameters = next(p for name, p, _ in CASES if name == law)
    machine, t = with_law(law, **parameters), np.arange(250) / FS
    force = 150.0 * np.exp(-(((t - 0.005) / 1e-3) ** 2))
    system = nonlinear_system(machine, 0.4, ["tool_x", "joint2"], "displacement", sticking_rate=1e-4)
    assert system.nstates == (13 if law == "joint_slip" else 12)
    solver = {"method": "RK45", "rtol": 1e-7, "atol": 1e-10, "max_step": 5e-5}
    want = control.input_output_response(system, t, force, solve_ivp_kwargs=solver).outputs
    got = time_response(machine, 0.4, force, FS, outputs=["tool_x", "joint2"], quantity="displacement").data
    assert (np.abs(got - want).max(axis=1) < (5e-3 if law == "dry_friction" else 5e-4) * np.abs(want).max(axis=1)).all()
    x, u = 1e-4 * np.arange(1.0, system.nstates + 1), [3.0]
    assert np.isfinite(system.output(0.0, x, u)).all()
    for effect in EFFECTS.values():
        if not effect.linear:
            assert effect.effect in {name for name, _, _ in CASES}


# --- forces -----------------------------------------------------------------------------------------------------------


def test_a_pulse_train_has_its_harmonics_and_its_mean() -> None:
    fs = 217 * 400.0
    force = pulse_train(fs, 1.0, duty=0.3, rise=5e-4, fall=8e-4, amplitude=20.0)
    assert force.mean() == pytest.approx(6.0, rel=1e-9)
    assert force.max() == pytest.approx(20.0, rel=1e-9)
    lines = 2 * np.abs(np.fft.rfft(force))[217 : 217 * 6 : 217] / force.size
    want = HarmonicForce.pulses(duty=0.3, rise=5e-4, fall=8e-4, peak=20.0).amplitude
    assert lines == pytest.approx(want * np.sinc(np.arange(1, 6) * 217 / fs), rel=1e-3, abs=2e-4)


def test_jitter_spreads_the_lines_and_keeps_the_mean() -> None:
    even, uneven = (pulse_train(FS, 2.0, amplitude=10.0, jitter=j, seed=4) for j in (0.0, 0.1))
    assert uneven.mean() == pytest.approx(even.mean(), rel=5e-3)
    line = [np.abs(np.fft.rfft(f))[2 * 217 * 3] for f in (even, uneven)]
    assert line[1] < 0.9 * line[0]
    assert np.array_equal(uneven, pulse_train(FS, 2.0, amplitude=10.0, jitter=0.1, seed=4))


def test_harmonics() -> None:
    force = harmonic_force(1000.0, 1.0, [50.0, 120.0], [2.0, 3.0], [0.0, np.pi / 2])
    t = np.arange(1000) / 1000.0
    assert np.allclose(force, 2 * np.cos(100 * np.pi * t) - 3 * np.sin(240 * np.pi * t))
    with pytest.raises(ParameterError, match="below fs/2"):
        harmonic_force(1000.0, 1.0, [500.0], [1.0])
    with pytest.raises(ParameterError, match="no room"):
        pulse_train(FS, 1.0, duty=0.05)


# --- the result -------------------------------------------------------------------------------------------------------


def test_the_result_is_labelled_and_frozen() -> None:
    t = np.arange(1000) / 1000.0
    made = TimeResponse(
        np.array([3.0 * np.sin(100 * np.pi * t) + 1.0, 9.80665 * np.ones(1000)]), t, 1000.0, ("a", "b"), ("m", "m/s^2")
    )
    assert made.unit == "m, m/s^2"
    assert made.rms() == pytest.approx([np.sqrt(5.5), 9.80665])
    assert made.peak() == pytest.approx([4.0, 9.80665])
    assert made.in_g().sel(output="b").peak() == pytest.approx([1.0])
    assert made.in_g().units == ("m", "g")
    assert made.after(0.4).time.size == 600
    freq, amplitude = made.spectrum(window=False)
    assert amplitude[0, [0, 50]] == pytest.approx([1.0, 3.0])
    assert freq[50] == 50.0
    assert made.spectrum()[1][0, 50] == pytest.approx(3.0)
    with pytest.raises(FrozenInstanceError):
        made.fs = 1.0  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        made.data[0] = 0.0
    with pytest.raises(ParameterError, match="no output"):
        made.sel(output="c")
    with pytest.raises(ParameterError, match="lasts 1 s"):
        made.after(2.0)
    with pytest.raises(ParameterError, match="do not fit"):
        replace(made, outputs=("a",))


# --- refusals ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"force": [1.0]}, "two samples"),
        ({"force": [1.0, np.inf]}, "finite"),
        ({"fs": 0.0}, "positive"),
        ({"outputs": ["nothing"]}, "no port"),
        ({"outputs": ["tool_x"], "quantity": ["velocity", "velocity"]}, "as many quantities"),
        ({"start": "somewhere"}, "neither"),
        ({"start": [0.0, 1.0]}, "displacement and velocity of"),
        ({"position": 1.2}, "position"),
    ],
)
def test_bad_input_is_refused(given: dict[str, object], complaint: str) -> None:
    call = {"machine": MACHINE, "position": 0.5, "force": np.zeros(10), "fs": FS} | given
    with pytest.raises(ParameterError, match=complaint):
        time_response(**call)  # type: ignore[arg-type]


def test_what_needs_a_rail_or_a_choice_says_so() -> None:
    with pytest.raises(ParameterError, match="has no rail"):
        time_response(oscillator(), None, np.zeros(5), 100.0, outputs=["rail_left_force"])
    hysteretic = StructuralDamping("joint2", 0.05).apply(MACHINE)
    with pytest.raises(CouplingError, match="equivalent viscous"):
        time_response(hysteretic, 0.5, np.zeros(5), 100.0)
    assert time_response(hysteretic, 0.5, np.zeros(5), 100.0, viscous_at=217.0).data.shape == (3, 5)
