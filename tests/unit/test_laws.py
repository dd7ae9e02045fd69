"""The nonlinear laws: forces, slopes, describing functions, and the compiled solutions of their implicit steps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import optimize

from cutvib_ss.laws import LAWS
from cutvib_ss.response import compiled

VALUES: dict[str, tuple[float, ...]] = {
    "cubic_stiffness": (3.0,),
    "freeplay": (0.4, 5.0),
    "bilinear_stiffness": (0.3, 5.0),
    "dry_friction": (2.0,),
    "quadratic_damping": (0.7,),
    "joint_slip": (4.0, 1.5),
}
each_law = pytest.mark.parametrize("name", LAWS)


def test_every_law_is_tried_and_takes_the_parameters_that_it_names() -> None:
    assert set(VALUES) == set(LAWS)
    for name, law in LAWS.items():
        assert law.name == name
        assert len(law.units) == len(VALUES[name])


@each_law
@pytest.mark.parametrize("amplitude", [0.2, 0.7, 3.0])
@pytest.mark.parametrize("omega", [1.0, 30.0])
def test_describing_function_is_the_fundamental(name: str, amplitude: float, omega: float) -> None:
    law, values = LAWS[name], VALUES[name]
    # Two periods, so that a law with memory has settled in the second.
    n = 4000 if law.memory else 40_000
    angle = 2 * np.pi * (np.arange(2 * n) + 0.5) / n
    q, v = amplitude * np.cos(angle), -amplitude * omega * np.sin(angle)
    force = law.force(q, v, *values)[n:]
    fundamental = 2 * np.mean(force * np.exp(-1j * angle[n:])) / amplitude
    stiffness, damping = law.equivalent(amplitude, omega, *values)
    scale = max(values) * (omega**2 if name == "quadratic_damping" and omega > 1.0 else 1.0)
    assert stiffness + 1j * omega * damping == pytest.approx(fundamental, abs=2e-4 * scale)
    if law.moved_by == "velocity" or law.memory:
        assert damping >= 0.0
        if name != "joint_slip" or amplitude > values[1] / values[0]:
            assert damping > 0.0
    else:
        assert damping == 0.0


@each_law
def test_slopes_are_the_derivatives(name: str) -> None:
    law, values = LAWS[name], VALUES[name]
    q = np.array([[0.0, x] for x in (-1.3, -0.31, 0.05, 0.2, 0.9)])
    v, h = 0.3 + 0.7 * q, 1e-6
    by_q, by_v = law.slopes(q, v, *values)
    moved = np.array([0.0, h])
    numeric_q = (law.force(q + moved, v, *values) - law.force(q - moved, v, *values))[:, 1] / (2 * h)
    numeric_v = (law.force(q, v + moved, *values) - law.force(q, v - moved, *values))[:, 1] / (2 * h)
    assert by_q[:, 1] == pytest.approx(numeric_q, rel=1e-6, abs=1e-8)
    assert by_v[:, 1] == pytest.approx(numeric_v, rel=1e-6, abs=1e-8)


@each_law
def test_histories_are_taken_along_the_last_axis(name: str) -> None:
    law, values = LAWS[name], VALUES[name]
    q = np.cumsum(np.random.default_rng(3).normal(size=(2, 3, 50)), axis=-1) * 0.2
    v = np.gradient(q, axis=-1)
    force = law.force(q, v, *values)
    assert force.shape == q.shape
    assert np.array_equal(force[1, 2], law.force(q[1, 2], v[1, 2], *values))


def test_slip_makes_a_loop_of_the_known_area() -> None:
    stiffness, limit, amplitude = 4.0, 1.5, 2.0
    angle = 2 * np.pi * np.arange(8001) / 4000
    q = amplitude * np.cos(angle)
    f = LAWS["joint_slip"].force(q, np.zeros_like(q), stiffness, limit)
    area = np.sum(0.5 * (f[4001:] + f[4000:-1]) * np.diff(q[4000:]))
    assert area == pytest.approx(4 * limit * (amplitude - limit / stiffness), rel=1e-3)


# --- compiled ---------------------------------------------------------------------------------------------------------

SMOOTH = ["cubic_stiffness", "freeplay", "bilinear_stiffness", "quadratic_damping", "joint_slip"]


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("compliance", [1e-6, 0.01, 0.15])
def test_implicit_forces_solve_their_equation(name: str, compliance: float) -> None:
    law, values = LAWS[name], VALUES[name]
    code, p = list(LAWS).index(name), np.array([*values, 0.0][:2])
    old_q, old_f = 0.1, (0.4 if law.memory else 0.0)
    for q in (-7.0, -0.41, -0.05, 0.0, 0.3, 0.42, 2.0):
        v = 3.0 * q - 0.5
        a, b = compliance, 5.0 * compliance
        got = compiled.implicit_force(code, p, q, a, v, b, old_f, old_q)

        def law_at(f: float, q: float = q, v: float = v, a: float = a, b: float = b) -> float:
            if law.memory:
                return float(np.clip(old_f + values[0] * (q - a * f - old_q), -values[1], values[1]))
            return float(law.force(np.array([q - a * f]), np.array([v - b * f]), *values)[0])

        assert law_at(got) == pytest.approx(got, rel=1e-10, abs=1e-12)
        root = optimize.brentq(lambda f, law_at=law_at: f - law_at(f), -1e5, 1e5, xtol=1e-13, rtol=1e-13)
        assert got == pytest.approx(root, rel=1e-8, abs=1e-9)


def test_a_softening_spring_is_followed_up_to_its_peak() -> None:
    p, a = np.array([-3.0, 0.0]), 0.1
    peak = 1 / np.sqrt(9.0 * a)
    for q in (0.1, 0.6, 2 / 3 * peak * 0.999):
        f = compiled.implicit_force(0, p, q, a, 0.0, 0.0, 0.0, 0.0)
        assert f == pytest.approx(-3.0 * (q - a * f) ** 3, rel=1e-9)
        assert abs(q - a * f) < peak
    assert np.isnan(compiled.implicit_force(0, p, 50.0, a, 0.0, 0.0, 0.0, 0.0))


def test_friction_slides_sticks_and_turns_back() -> None:
    torque, b = 2.0, 0.1
    # Slides: the friction of a whole step does not stop it.
    assert compiled.friction_mean(torque, 1.0, b, 0.9) == torque
    assert compiled.friction_mean(torque, -1.0, b, -0.9) == -torque
    # Sticks: stopped within the step, and held against what drives it.
    f = compiled.friction_mean(torque, 0.15, b, 0.1)
    assert 0.15 - b * f == pytest.approx(0.0, abs=1e-15)
    assert compiled.friction_mean(torque, 0.12, b, 0.0) == pytest.approx(1.2)
    # From rest, once what drives it is stronger.
    assert compiled.friction_mean(torque, 0.5, b, 0.0) == torque
    # Turned back by a stronger drive: the mean is that of the sign of a velocity that falls evenly.
    f = compiled.friction_mean(torque, -0.4, b, 0.1)
    new = -0.4 - b * f
    assert new < 0.0
    assert f == pytest.approx(torque * (0.1 + new) / (0.1 - new))
    # It never makes the port faster than it would have been without, or was.
    rng = np.random.default_rng(5)
    for v, v0 in rng.normal(size=(200, 2)):
        f = compiled.friction_mean(torque, v, b, v0)
        assert abs(f) <= torque
        assert abs(v - b * f) <= max(abs(v), abs(v0))
