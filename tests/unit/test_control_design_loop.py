"""The loop as it runs: sampling, delay and hold against simulation in time; hardware; the designs' own promises."""

import control
import numpy as np
import pytest
from scipy import linalg

from cutvib_ss.absorber import attach_absorber
from cutvib_ss.control_design import (
    PROTOTYPES,
    ForceActuator,
    Hardware,
    InertialActuator,
    Loop,
    Sampling,
    Sensor,
    active_absorber,
    control_plant,
    discretised,
    positive_position_feedback,
    resonant,
    sampled,
)
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.errors import DesignError, ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.parameters import table_7
from cutvib_ss.response.frequency import frequency_response

MACHINE = published_machine()
ON_TOOL = Hardware((InertialActuator("tool_x", mass=0.08),), (Sensor("tool_x"),))


def exact(a: np.ndarray, b: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    n = a.shape[0]
    whole = linalg.expm(np.block([[a, b], [np.zeros((b.shape[1], n + b.shape[1]))]]) * time)
    return whole[:n, :n], whole[:n, n:]


@pytest.mark.parametrize("late", [0.0, 0.3, 1.0, 1.7, 3.0])
def test_a_sampled_plant_with_any_delay_is_its_simulation(late: float) -> None:
    plant = control.ss([[0.0, 3.0], [-3.0, -0.2]], [[0.0], [2.0]], [[1.0, 0.5]], [[0.0]])
    period, fine = 0.4, 10
    discrete = sampled(plant, Sampling(1 / period, late * period))
    commands = np.random.default_rng(1).normal(size=30)
    _, seen = control.forced_response(discrete, inputs=commands, timepts=period * np.arange(30))
    # Step by step in tenths of a period; the command arrives late.
    move, add = exact(plant.A, plant.B, period / fine)
    x, expected = np.zeros((2, 1)), []
    for i in range(30 * fine):
        if i % fine == 0:
            expected.append((plant.C @ x).item())
        k = (i - round(late * fine)) // fine
        x = move @ x + add * (commands[k] if k >= 0 else 0.0)
    assert np.allclose(seen, expected, atol=1e-12)


def test_the_closed_sampled_loop_is_its_simulation() -> None:
    sampling, freq, fine = Sampling(5000.0, 1e-4), 200.0, 10
    kit = Hardware(ON_TOOL.actuators, ON_TOOL.sensors, sampling)
    plant = control_plant(MACHINE, 0.3, kit, delayed=False)
    loop = Loop(plant, resonant(control_plant(MACHINE, 0.3, kit), 2.0, freq, (1,), width=0.02), sampling)
    assert loop.poles.real.max() < 0.0
    _, closed, command = loop.response([freq])
    # The force is a sine between ramps, the command held: both exact in each tenth of a period but for the ramps.
    step = sampling.period / fine
    n = plant.nstates
    generator = np.zeros((n + 3, n + 3))
    # States of the inputs: the force's value and slope, the command.
    generator[:n, :n], generator[:n, n], generator[:n, n + 2] = plant.A, plant.B[:, 0], plant.B[:, 1]
    generator[n, n + 1] = 1.0
    move = linalg.expm(generator * step)[:n]
    k = loop.controller
    x, inside, held, waiting = np.zeros(n), np.zeros(k.nstates), 0.0, 0.0
    steps = round(1.5 / step)
    force = np.sin(2 * np.pi * freq * step * np.arange(steps + 1))
    last = round(0.2 / step)
    late = round(sampling.computation / step)
    motion, commands = np.zeros(steps), np.zeros(steps)
    for i in range(steps):
        motion[i] = plant.C[0] @ x + plant.D[0, 0] * force[i]
        if i % fine == 0:
            y = plant.C[-1:] @ x
            waiting = (k.C @ inside + k.D @ y).item()
            inside = k.A @ inside + k.B @ y
        if i % fine == late % fine:
            held = waiting
        commands[i] = waiting
        x = move @ np.concatenate([x, [force[i], (force[i + 1] - force[i]) / step, held]])
    times = step * np.arange(steps)[-last:]
    carrier = 2j * np.exp(-2j * np.pi * freq * times) / last
    assert (motion[-last:] @ carrier) == pytest.approx(closed[0, 0], rel=2e-3)
    # Commands at the samples alone.
    assert (commands[-last::fine] @ carrier[::fine]) * fine == pytest.approx(command[0, 0], rel=2e-3)


def test_an_analogue_loop_is_pythons_own_feedback() -> None:
    kit = Hardware(ON_TOOL.actuators, ON_TOOL.sensors, None)
    plant = control_plant(MACHINE, 0.4, kit)
    k = resonant(plant)
    loop = Loop(plant, k)
    closed = plant.lft(k)
    s = 2j * np.pi * np.array([100.0, 217.0, 230.0])
    passive, active, _ = loop.response(s.imag / (2 * np.pi))
    assert np.allclose(active[:4], closed(s)[:, 0], rtol=1e-9)
    assert np.allclose(passive, plant(s)[:, 0], rtol=1e-12)
    assert np.allclose(np.sort(loop.poles.real), np.sort(closed.poles().real), atol=1e-6)
    # At the sensor itself 1/(1 + gain) is left, exactly, at each harmonic.
    harmonics = 217.0 * np.arange(1, 4)
    passive, active, _ = loop.response(harmonics)
    assert np.allclose(np.abs(active[-1] / passive[-1]), 1 / 4, rtol=1e-9)


def test_the_command_of_noise_is_the_integral_over_its_spectrum() -> None:
    for sampling in (None, Sampling()):
        kit = Hardware(ON_TOOL.actuators, ON_TOOL.sensors, sampling)
        plant = control_plant(MACHINE, 0.4, kit, delayed=False)
        loop = Loop(plant, resonant(control_plant(MACHINE, 0.4, kit), harmonics=(1,), width=0.02), sampling)
        top = 5000.0 if sampling else 2e5
        freq = np.unique(np.concatenate([np.geomspace(0.1, top, 4000), np.linspace(150, 300, 3000)]))
        s = 2j * np.pi * freq
        z = np.exp(s * sampling.period) if sampling else s
        k, g = loop.controller(z), loop.seen(z)
        variance = np.trapezoid(np.abs(k / (1 - k * g)) ** 2, freq) * 1e-3**2
        assert loop.command_noise([1e-3]) == pytest.approx(np.sqrt(variance), rel=1e-3)


def test_a_resonator_keeps_its_frequency_when_sampled() -> None:
    k = resonant(control_plant(MACHINE, 0.5, ON_TOOL))
    assert k.nstates == 6
    digital = discretised(k, Sampling())
    assert np.allclose(np.sort_complex(np.log(digital.poles()) * 1e4), np.sort_complex(k.poles()), rtol=1e-8)
    assert digital.input_labels == k.input_labels == ["y_tool_x"]
    z = np.exp(2j * np.pi * 434.0 * 1e-4)
    assert digital(z).item() == pytest.approx(k(2j * np.pi * 434.0).item(), rel=0.02)


@pytest.mark.parametrize("corrected", [False, True])
def test_the_passive_plant_is_the_machine_with_an_absorber(corrected: bool) -> None:
    # Absorbers that are there already and those of an effect come before and after the actuator's mass.
    machine = attach_absorber(MACHINE, table_7())
    machine = LocalResonator("head", 0.5, 180.0, 0.03).apply(machine) if corrected else machine
    inertial = InertialActuator("head_x")
    kit = Hardware((inertial, ForceActuator("base")), (Sensor("head_x", "velocity"),))
    plant = control_plant(machine, 0.35, kit)
    assert plant.input_labels == ["force", "u_head_x", "u_base"]
    with_mass = attach_absorber(machine, inertial.suspension, "head_x")
    freq = np.array([20.0, 110.0, 180.0, 217.0, 400.0])
    frf = frequency_response(with_mass, 0.35, freq, outputs=("tool_x", "tool_z", "base_x", "head_x"))
    assert np.allclose(plant(2j * np.pi * freq)[:4, 0], frf.data[0, :, 0], rtol=1e-6)
    # Far below the suspension's frequency a coil between two masses moves the machine by nothing.
    low = np.abs(plant(2j * np.pi * np.array([1.0]))[3, 1:, 0])
    assert low[0] < 0.01 * low[1]
    # Far above, the mass stands still: the coil pushes as a force against ground does.
    against_ground = control_plant(machine, 0.35, Hardware((ForceActuator("head_x"),), kit.sensors))
    high = 2j * np.pi * np.array([1000.0])
    assert plant(high)[3, 1, 0] == pytest.approx(against_ground(high)[3, 1, 0], rel=0.05)


def test_what_belongs_to_a_measurement_or_is_hysteretic_does_not_stop_a_plant() -> None:
    chained = CalibrationError("measurement", channel="tool_x", gain=2.0).apply(MACHINE)
    s = 2j * np.pi * 217.0
    assert control_plant(chained, 0.5)(s)[0, 0] == pytest.approx(control_plant(MACHINE, 0.5)(s)[0, 0])
    hysteretic = StructuralDamping("joint2", loss_factor=0.05).apply(MACHINE)
    exact_ = frequency_response(hysteretic, 0.5, [217.0], outputs=("tool_x",)).data.item()
    light = Hardware((ForceActuator("base"),), (Sensor("tool_x"),))
    assert control_plant(hysteretic, 0.5, light)(s)[0, 0] == pytest.approx(exact_, rel=1e-9)


def test_positive_position_feedback_bears_twice_its_gain() -> None:
    kit = Hardware((ForceActuator("head_x"),), (Sensor("head_x", "displacement"),), None)
    plant = control_plant(MACHINE, 0.5, kit)
    k = positive_position_feedback(plant, share=0.5, quantity="displacement")
    for factor, stable in ((1.0, True), (1.98, True), (2.02, False)):
        louder = control.ss(factor * k, inputs=k.input_labels, outputs=k.output_labels)
        assert (Loop(plant, louder).poles.real.max() < 0.0) == stable
    with pytest.raises(DesignError, match="velocity"):
        positive_position_feedback(plant, quantity="velocity")


@pytest.mark.parametrize("sampling", [None, Sampling()])
def test_an_active_absorber_holds_the_tool_still(sampling: Sampling | None) -> None:
    prototype = PROTOTYPES["active-absorber"]
    kit = prototype.hardware("tool_x", sampling)
    plant = control_plant(MACHINE, 0.2, kit, delayed=False)
    still, nearly = (Loop(plant, active_absorber(kit, damping_ratio=z, pade_order=6), sampling) for z in (0.0, 0.005))
    passive, closed, _ = still.response([217.0])
    assert abs(closed[0, 0]) < 0.005 * abs(passive[0, 0])
    assert nearly.poles.real.max() < 0.0
    # Undamped at its frequency it leaves 2ζ of an absorber's mass: the tool sees m ω/(2jζ) more.
    _, damped, _ = nearly.response([217.0])
    alone = frequency_response(MACHINE, 0.2, [217.0], form="receptance", outputs=("tool_x",)).data.item()
    w = 2 * np.pi * 217.0
    own = 0.08 * w**2 * (1 + 0.01j) / 0.01j * -1
    assert abs(damped[0, 0]) == pytest.approx(abs(w**2 * alone / (1 + own * alone)), rel=0.02)


@pytest.mark.parametrize(
    ("kit", "error", "says"),
    [
        (lambda: Hardware(()), ParameterError, "at least one actuator"),
        (lambda: Hardware(sensors=(Sensor("tool_x"), Sensor("tool_x", "velocity"))), ParameterError, "share a port"),
        (lambda: Hardware((InertialActuator(mass=-1.0),)), ParameterError, "mass"),
        (lambda: Sensor(noise=0.0), ParameterError, "noise"),
        (lambda: Sensor(quantity="jerk"), ParameterError, "jerk"),  # type: ignore[arg-type]
        (lambda: Sampling(0.0), ParameterError, "rate"),
        (lambda: control_plant(MACHINE, 0.5, Hardware(sensors=(Sensor("stroke_tool_x"),))), ParameterError, "stroke_head_x"),
        (lambda: control_plant(MACHINE, 0.5, Hardware((ForceActuator("nowhere"),))), ParameterError, "nowhere"),
        (lambda: active_absorber(ON_TOOL), DesignError, "stroke"),
    ],
)  # fmt: skip
def test_hardware_that_cannot_be_is_refused(kit: object, error: type[Exception], says: str) -> None:
    with pytest.raises(error, match=says):
        kit()  # type: ignore[operator]


def test_a_controller_of_other_signals_or_period_is_refused() -> None:
    plant = control_plant(MACHINE, 0.5, ON_TOOL, delayed=False)
    k = resonant(control_plant(MACHINE, 0.5, ON_TOOL))
    with pytest.raises(ParameterError, match="u_head_x"):
        Loop(plant, control.ss(k, inputs=["y_tool_x"], outputs=["u_head_x"]))
    with pytest.raises(ParameterError, match=r"0\.0002"):
        Loop(plant, discretised(k, Sampling(5000.0)), Sampling())
    with pytest.raises(ParameterError, match="needs hardware with a sampling"):
        Loop(plant, discretised(k, Sampling()))
    with pytest.raises(ParameterError, match="feedthrough"):
        sampled(control.ss([[-1.0]], [[1.0]], [[1.0]], [[1.0]]), Sampling())
    two = Hardware(ON_TOOL.actuators, (Sensor("tool_x"), Sensor("head_x")))
    with pytest.raises(DesignError, match="one actuator and one sensor"):
        resonant(control_plant(MACHINE, 0.5, two))
