"""Margins against hand cases, python-control and a brute search."""

import control
import numpy as np
import pytest
from slycot.exceptions import SlycotArithmeticError

from cutvib_ss.control_design import disk_margin, margins
from cutvib_ss.control_design.loop import in_rad_per_s
from cutvib_ss.control_design.norms import peak_gain
from cutvib_ss.errors import DesignError


def of(loop: control.StateSpace) -> control.StateSpace:
    return control.ss(loop)


def all_margins(gain: control.StateSpace) -> tuple[float, float, float, float, float]:
    eye = control.ss([], [], [], np.eye(gain.noutputs), gain.dt)
    poles = np.asarray(eye.feedback(gain).poles(), dtype=complex)
    found = margins(gain, in_rad_per_s(poles, gain.dt) if gain.dt else poles)
    return found.disk, found.gain_up, found.gain_down, found.phase, found.delay


def test_an_integrator_bears_any_gain_and_a_right_angle() -> None:
    disk, up, down, phase, delay = all_margins(control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]]))
    assert disk == pytest.approx(2.0)  # |S - 1/2| = |jω - 1| / 2|jω + 1| = 1/2
    assert up == np.inf
    assert down == 0.0
    assert phase == pytest.approx(90.0)
    assert delay == pytest.approx(np.pi / 2)


def test_an_iteration_that_does_not_end_is_asked_for_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop of 57 states with poles up to 3e6 rad/s ended a diagnosis: the eigenvalues of its Hamiltonian did not converge."""
    asked, found = [], control.linfnorm

    def strict(system: control.StateSpace, tol: float) -> tuple[float, float]:
        asked.append(tol)
        if tol < fails:
            raise SlycotArithmeticError("the QR algorithm did not converge", 3)
        norm, at = found(system, tol)
        return norm, at

    monkeypatch.setattr(control, "linfnorm", strict)
    lag = control.ss([[-1.0]], [[1.0]], [[3.0]], [[0.0]])
    fails = 1e-7
    assert peak_gain(lag) == pytest.approx(3.0, rel=1e-6)
    assert asked == [1e-10, 1e-8, 1e-6]
    fails = 1.0
    with pytest.raises(DesignError, match="1 states"):
        peak_gain(lag)


def test_a_third_order_loop() -> None:
    s = control.tf("s")
    loop = of(1 / (s * (s + 1) * (s + 2)))
    disk, up, _, phase, delay = all_margins(loop)
    gm, pm, _, _, at, _ = control.stability_margins(loop)
    assert up == pytest.approx(6.0)  # s³ + 3s² + 2s + k is marginal at k = 6
    assert up == pytest.approx(gm)
    assert phase == pytest.approx(pm)
    assert delay == pytest.approx(np.radians(pm) / at)
    by_grid, _, _ = control.disk_margins(loop, np.logspace(-2, 2, 20_001))
    assert disk == pytest.approx(by_grid, rel=1e-6)


def test_a_loop_that_needs_its_gain() -> None:
    # 3/(s - 1): unstable below a gain of 1/3; S - 1/2 = (s/2 - 2)/(s + 2), largest at zero.
    disk, up, down, _, _ = all_margins(control.ss([[1.0]], [[1.0]], [[3.0]], [[0.0]]))
    assert up == np.inf
    assert down == pytest.approx(1 / 3, rel=1e-9)
    assert disk == pytest.approx(1.0)


def test_a_sampled_loop() -> None:
    # 0.5/(z - 1) turns unstable at z = -1, where it is -0.25.
    disk, up, _, phase, _ = all_margins(control.ss([[1.0]], [[1.0]], [[0.5]], [[0.0]], 0.01))
    assert up == pytest.approx(4.0)
    # |L| = 1 where 2 sin(ωT/2) = 1/2.
    half = np.arcsin(0.25)
    assert phase == pytest.approx(90.0 - np.degrees(half))
    assert disk == pytest.approx(2 * 3 / 5, rel=1e-6)  # (1 + α/2)/(1 - α/2) = 4 at z = -1


def test_two_loops_have_the_worse_of_their_margins() -> None:
    s = control.tf("s")
    one, other = of(1 / (s * (s + 1) * (s + 2))), of(3 / (s * (s + 1) * (s + 2)))
    both = all_margins(control.append(one, other))
    for mine, theirs in zip(both, all_margins(other), strict=True):
        assert mine == pytest.approx(theirs, rel=1e-6)


def test_cross_coupling_is_closed_one_loop_at_a_time() -> None:
    a, b, c = np.array([[-1.0, 0.5], [0.3, -2.0]]), np.eye(2), np.array([[2.0, -1.0], [1.5, 1.0]])
    loop = control.ss(a, b, c, np.zeros((2, 2)))
    *_, delay = all_margins(loop)
    # By definition: the first command breaks while the second is closed, and the reverse.
    worst = []
    for k in (0, 1):
        closed = control.ss(a - b[:, [1 - k]] @ c[[1 - k]], b[:, [k]], c[[k]], [[0.0]])
        worst.append(all_margins(closed)[-1])
    assert delay == pytest.approx(min(worst), rel=1e-6)


def test_no_grid_misses_a_sharp_resonance() -> None:
    w, zeta = 2 * np.pi * 217.3, 1e-6
    loop = control.ss([[0.0, w], [-w, -2 * zeta * w]], [[0.0], [w]], [[-0.5, 0.0]], [[0.0]])
    eye = control.ss([], [], [], [[1.0]])
    poles = eye.feedback(loop).poles()
    assert poles.real.max() < 0.0
    coarse, _, _ = control.disk_margins(loop, np.geomspace(10.0, 1e4, 2000))
    exact = disk_margin(loop)
    assert exact < 1e-3 * coarse
    assert exact == pytest.approx(1 / abs(1 / (1 + loop(1j * abs(poles[0].imag))) - 0.5), rel=1e-3)
    # What it says: a delay that turns the phase by that much brings the loop down.
    assert margins(loop, poles).phase < 0.1


def test_a_delay_beyond_the_margin_makes_the_loop_unstable() -> None:
    s = control.tf("s")
    loop = of(12 * (s + 3) / ((s**2 + 2 * s + 25) * (s + 1)))
    *_, delay = all_margins(loop)
    assert np.isfinite(delay)
    for factor, stable in ((0.97, True), (1.03, False)):
        late = control.ss(control.tf(*control.pade(factor * delay, 8)))
        poles = control.feedback(loop * late, 1).poles()
        assert (poles.real.max() < 0.0) == stable
