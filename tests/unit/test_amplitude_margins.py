"""Loops around a nonlinear element: describing functions against the law itself, in time."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from cutvib_ss.control_design import (
    Sampling,
    amplitude_margins,
    check_controller,
    prototype,
    quasi_linear,
)
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.response.nonlinear_system import nonlinear_system

POSITION = 0.5


def machine_with(law: str, **values: float) -> Machine:
    return replace(published_machine(), nonlinear=(NonlinearElement("tool_x", law, values),))


def test_margins_move_with_the_amplitude_until_the_loop_loses_them() -> None:
    kind = prototype("lqg")
    hardware = kind.hardware("tool_x", Sampling())
    machine = machine_with("cubic_stiffness", stiffness3=1e14)
    controller = kind.design(published_machine(), POSITION, hardware)
    found = amplitude_margins(controller, machine, [1e-12, 1e-4, 1e-3], [POSITION], hardware)
    check = check_controller(controller, machine, [POSITION], hardware)
    # Small motion is the linear loop.
    assert found.growth_rate[0, 0] == pytest.approx(check.growth_rate[0, 0], rel=1e-6)
    assert found.disk_margin[0, 0] == pytest.approx(check.disk_margin[0, 0], rel=1e-5)
    # k(A) = 3/4 · 1e14 · 1e-8 = 750 kN/m: the tool's own mode moves away from the controller's.
    assert 0.0 < found.disk_margin[1, 0] < 0.2 * found.disk_margin[0, 0]
    assert found.worst == (found.disk_margin[1, 0], 1e-4, POSITION)


def test_a_limit_cycle_lies_where_the_slowest_pole_crosses() -> None:
    # A controller turned round feeds the tool's motion; damping that grows with velocity holds it at last.
    kind = prototype("h2")
    hardware = kind.hardware("tool_x", Sampling())
    k = kind.design(published_machine(), POSITION, hardware)
    wrong = control.ss(k.A, k.B, -k.C, -k.D, k.dt, inputs=k.input_labels, outputs=k.output_labels)
    machine = machine_with("quadratic_damping", coefficient=4000.0)
    found = amplitude_margins(wrong, machine, np.geomspace(1e-6, 1.0, 7), [POSITION], hardware)
    assert found.growth_rate[0, 0] > 0.0 > found.growth_rate[-1, 0]
    assert found.worst[0] == 0.0
    (cycle,) = found.limit_cycles
    assert cycle.attracts
    edge = quasi_linear(machine, cycle.amplitude)
    check = check_controller(wrong, edge, [POSITION], hardware)
    assert abs(check.growth_rate[0, 0]) < 1e-2 * found.growth_rate[0, 0]
    assert cycle.frequency == pytest.approx(check.growth_freq[0, 0], rel=1e-3)


def test_limit_cycle_agrees_with_the_law_in_time() -> None:
    # Velocity feedback of the wrong sign feeds the tool's motion until damping that grows with velocity holds it.
    machine, feed = machine_with("quadratic_damping", coefficient=400.0), 1000.0
    machine = replace(machine, rail=replace(machine.rail, parameters=replace(machine.rail.parameters, n_modes=1)))

    def growth(amplitude: float) -> float:
        plant = quasi_linear(machine, amplitude).plant(POSITION, inputs=["force"], outputs=["tool_x"])
        rate = control.ss(plant.A, plant.B, plant.C @ plant.A, plant.C @ plant.B)
        return float(rate.feedback(feed, sign=1).poles().real.max())

    predicted = float(brentq(growth, 1e-5, 1e-1))
    system = nonlinear_system(machine, POSITION, ["tool_x"], "velocity")

    def law(t: float, x: np.ndarray) -> np.ndarray:
        return np.asarray(system.dynamics(t, x, feed * np.atleast_1d(system.output(t, x, np.zeros(1)))))

    start = np.zeros(system.nstates)
    start[system.nstates // 2 :] = 0.02
    run = solve_ivp(law, (0.0, 1.0), start, method="LSODA", rtol=1e-7, atol=1e-10, t_eval=np.arange(0.8, 1.0, 2e-5))
    rate = np.array([float(np.squeeze(system.output(0.0, x, np.zeros(1)))) for x in run.y.T])
    measured = np.sqrt(2.0) * float(rate.std()) / (2 * np.pi * 217.0)
    assert measured == pytest.approx(predicted, rel=0.03)


@pytest.mark.parametrize("amplitudes", [[0.0, 1e-3], [1e-3, 1e-4], [np.nan]])
def test_amplitudes_must_rise(amplitudes: list[float]) -> None:
    kind = prototype("resonant")
    machine = machine_with("cubic_stiffness", stiffness3=1e14)
    with pytest.raises(ParameterError, match="rising"):
        amplitude_margins(kind.design(machine, POSITION, None), machine, amplitudes, [POSITION])


def test_no_such_element() -> None:
    with pytest.raises(ParameterError, match="no number 0"):
        quasi_linear(published_machine(), 1e-3)
