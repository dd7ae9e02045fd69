"""H2, H∞ and LQG: known optima, and norms computed anew without the code that states them."""

import control
import numpy as np
import pytest

from cutvib_ss.control_design import (
    PROTOTYPES,
    Sampling,
    closed_norm,
    control_plant,
    h2_synthesis,
    hinf_controller,
    hinf_synthesis,
    lqg,
)
from cutvib_ss.control_design.weights import generalised_plant, tone, working_gains
from cutvib_ss.errors import DesignError
from cutvib_ss.model.machine import published_machine

KIT = PROTOTYPES["h2"].hardware("head_x", Sampling())
PLANT = control_plant(published_machine(), 0.3, KIT)
WEIGHTED = generalised_plant(PLANT, 0.4, 0.04, 217.0, 0.003)


def integrator() -> control.StateSpace:
    """x' = w1 + u, z = (x, u), y = x + w2: X = Y for every γ, so that all is known in closed form."""
    return control.ss([[0.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]])


def singular_values(plant: control.StateSpace, controller: control.StateSpace, freq: np.ndarray) -> np.ndarray:
    """Largest singular value of the closed loop, from responses alone."""
    s = 2j * np.pi * freq
    p, k = np.moveaxis(plant(s, squeeze=False), -1, 0), np.moveaxis(controller(s, squeeze=False), -1, 0)
    inner = np.linalg.solve(1.0 - k @ p[:, -1:, -1:], k @ p[:, -1:, :-1])
    return np.linalg.svd(p[:, :-1, :-1] + p[:, :-1, -1:] @ inner, compute_uv=False)[:, 0]


def test_h2_of_the_integrator() -> None:
    # X = Y = 1: K = -1/(s + 2), and the norm's square is tr(B1' X B1) + tr(F Y F') = 2.
    controller, norm = h2_synthesis(integrator(), 1, 1)
    assert norm == pytest.approx(np.sqrt(2), rel=1e-9)
    assert controller(1j).item() == pytest.approx(-1 / (2 + 1j), rel=1e-9)


def test_hinf_of_the_integrator() -> None:
    # X² (1 - 1/γ²) = 1, and XY < γ² asks for γ² > 2.
    controller, norm = hinf_synthesis(integrator(), 1, 1, slack=1.0)
    assert np.sqrt(2) < norm < np.sqrt(2) * 1.006
    assert closed_norm(integrator(), controller) == norm
    # Below the least γ SLICOT gives a controller all the same; the norm tells.
    assert closed_norm(integrator(), hinf_controller(integrator(), 1, 1, 1.4)) > 1.4


def test_gamma_is_the_least_where_hinfsyn_misses_it() -> None:
    plant = generalised_plant(control_plant(published_machine(), 0.1, KIT), 0.4, 0.04, 217.0, 0.003)
    _, norm = hinf_synthesis(plant, 1, 1, slack=1.0)
    assert norm == pytest.approx(0.2046, rel=0.01)  # by Riccati equations solved another way
    assert closed_norm(plant, hinf_controller(plant, 1, 1, 0.98 * norm)) > 0.98 * norm


def test_the_norm_of_an_hinf_loop_is_what_its_responses_show() -> None:
    controller, norm = hinf_synthesis(WEIGHTED, 1, 1, 1.5)
    around = np.abs(WEIGHTED.lft(controller).poles().imag) / (2 * np.pi)
    freq = np.unique(np.concatenate([np.geomspace(1.0, 1e4, 2000), *(around * k for k in np.linspace(0.98, 1.02, 41))]))
    largest = singular_values(WEIGHTED, controller, freq[freq > 0]).max()
    assert largest <= norm * (1 + 1e-6)
    assert largest == pytest.approx(norm, rel=0.01)


def test_the_h2_norm_is_the_integral_over_frequency() -> None:
    controller, norm = h2_synthesis(WEIGHTED, 1, 1)
    closed = WEIGHTED.lft(controller)
    # Trapezoidal rule over resonances of 0.1 %: fine steps around each pole.
    poles = closed.poles()
    poles = poles[poles.imag > 0]
    fine = (poles.imag[:, None] + np.abs(poles.real)[:, None] * np.sinh(np.linspace(-9, 9, 301))).ravel()
    omega = np.unique(np.concatenate([np.geomspace(1e-2, 1e7, 4000), fine[fine > 0]]))
    square = np.sum(np.abs(closed(1j * omega)) ** 2, axis=(0, 1))
    assert np.sqrt(np.trapezoid(square, omega) / np.pi) == pytest.approx(norm, rel=2e-3)


def test_h2_is_the_least_norm() -> None:
    controller, norm = h2_synthesis(WEIGHTED, 1, 1)
    for factor in (0.9, 1.1):
        assert control.system_norm(WEIGHTED.lft(factor * controller), 2) > norm * 1.001
    relaxed, _ = hinf_synthesis(WEIGHTED, 1, 1)
    assert control.system_norm(WEIGHTED.lft(relaxed), 2) > norm
    assert closed_norm(WEIGHTED, controller) > closed_norm(WEIGHTED, relaxed)


def test_lqg_is_h2_of_its_own_problem_and_keeps_the_separation() -> None:
    effort, noise = 0.12, 0.04
    controller = lqg(PLANT, effort, noise)
    (of_command,), (of_signal,) = working_gains(PLANT, 217.0)
    part = PLANT[["tool_x", "y_tool_x"], ["force", "u_head_x"]] * control.append(
        tone(217.0, 0.01), control.ss([], [], [], 1.0)
    )
    plant = control.ss(
        part.A,
        np.column_stack([part.B[:, 0], 0 * part.B[:, 0], part.B[:, 1]]),
        np.vstack([part.C[0], 0 * part.C[0], part.C[1]]),
        [[0, 0, 0], [0, 0, effort * of_command], [0, noise * of_signal, 0]],
    )
    twin, _ = h2_synthesis(plant, 1, 1)
    s = 2j * np.pi * np.array([20.0, 100.0, 200.0, 217.0, 230.0, 600.0])
    assert np.allclose(controller(s), twin(s), rtol=1e-5)
    # Twice the order: those of the regulator and those of the estimator, all stable.
    assert plant.lft(controller).poles().real.max() < 0.0


def test_what_has_no_solution_is_refused() -> None:
    # An unstable state that no command moves.
    lost = control.ss(
        [[1.0, 0.0], [0.0, -1.0]], [[1, 0, 0], [1, 0, 1]], [[1.0, 1], [0, 0], [1, 1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    )
    with pytest.raises(DesignError):
        h2_synthesis(lost, 1, 1)
    with pytest.raises(DesignError):
        hinf_synthesis(lost, 1, 1)
