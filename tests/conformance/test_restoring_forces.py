"""Every restoring force, through the same suite: force, tangent, describing function, energy, kernels, scale."""

from __future__ import annotations

import importlib
from dataclasses import fields, replace
from pathlib import Path

import numba
import numpy as np
import pytest
from scipy import integrate, optimize

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.restoring_forces import (
    BilinearStiffness,
    CubicStiffness,
    DryFriction,
    Freeplay,
    Hysteretic,
    JointSlip,
    LocalDamping,
    LocalStiffness,
    Memoryless,
    QuadraticDamping,
    RestoringForce,
    packed,
    registered,
)
from cutvib_ss.model.restoring_forces.compiled import (
    coulomb,
    implicit,
    mean,
    resist,
    steepest,
    tangents,
)
from cutvib_ss.model.restoring_forces.contacts import contacts, implicit_slide, move, place, read, slide
from cutvib_ss.model.restoring_forces.dry_friction import CONTACTS

FORCES: dict[str, RestoringForce] = {
    "cubic": CubicStiffness(3.0),
    "cubic, off its middle": CubicStiffness(3.0, 0.2),
    "cubic, a fifth power beyond a bend": CubicStiffness(3.0, None, 0.5, 5.0),
    "cubic, straight beyond a bend": CubicStiffness(-3.0, 0.1, 0.3, 1.0),
    "softening": CubicStiffness(-0.2),
    "freeplay": Freeplay(0.4, 5.0),
    "freeplay, stiff contact": Freeplay(0.4, 5.0, 20.0),
    "freeplay, soft contact": Freeplay(0.4, 5.0, 2.0),
    "freeplay, off its middle": Freeplay(0.4, 5.0, 20.0, offset=-0.15),
    "freeplay, in contact at rest": Freeplay(0.4, 5.0, offset=0.5),
    "freeplay, round corners": Freeplay(0.4, 5.0, rounding=0.5),
    "freeplay, round corners off its middle": Freeplay(0.4, 5.0, 2.0, offset=0.1, rounding=0.1),
    "freeplay, contacts that lose energy": Freeplay(0.4, 5.0, 20.0, offset=0.1, rounding=0.3, contact_damping=0.2),
    "bilinear": BilinearStiffness(0.3, 5.0),
    "Coulomb": DryFriction(2.0),
    "friction that sticks elastically": DryFriction(2.0, 7.0),
    "friction over a knee": DryFriction(2.0, 7.0, 0.4),
    "friction of Dahl": DryFriction(2.0, 7.0, 1.0),
    "quadratic": QuadraticDamping(0.7),
    "local spring": LocalStiffness(3.0, 0.5, 1.0),
    "local damper": LocalDamping(0.4, 5.0, -1.0),
    "slip": JointSlip(4.0, 1.5),
    "slip, spread": JointSlip(4.0, 1.5, 0.6),
    "slip, from nothing": JointSlip(4.0, 1.5, 1.0),
}
each = pytest.mark.parametrize("force", FORCES.values(), ids=FORCES)
smooth = pytest.mark.parametrize("name", [n for n, f in FORCES.items() if not f.jumps])


def cycle(amplitude: float, omega: float, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Phase, displacement and velocity over two periods, in the second of which a law with memory has settled."""
    angle = 2 * np.pi * (np.arange(2 * samples) + 0.5) / samples
    return angle, amplitude * np.cos(angle), -amplitude * omega * np.sin(angle)


def test_every_law_is_tried() -> None:
    assert {type(f) for f in FORCES.values()} == set(registered().values())
    for name, law in registered().items():
        assert law.name == name
        assert list(law.units()) == [f.name for f in fields(law)]


@each
@pytest.mark.parametrize("amplitude", [0.2, 0.7, 3.0])
@pytest.mark.parametrize("omega", [1.0, 30.0])
def test_describing_function_is_the_fundamental_of_the_loop(
    force: RestoringForce, amplitude: float, omega: float
) -> None:
    n = 4000 if isinstance(force, Hysteretic) else 20_000
    angle, q, v = cycle(amplitude, omega, n)
    loop = force.force(q, v)[n:]
    fundamental = 2 * np.mean(loop * np.exp(-1j * angle[n:])) / amplitude
    found = complex(force.describing_function(amplitude, omega))
    stiffness, damping = force.equivalent(amplitude, omega)
    assert stiffness + 1j * omega * damping == pytest.approx(found, rel=1e-12)
    assert found == pytest.approx(fundamental, abs=2e-4 * max(np.abs(loop).max() / amplitude, 1.0))


@each
@pytest.mark.parametrize("amplitude", [0.2, 0.7, 3.0])
def test_energy_lost_in_a_cycle_is_not_negative_and_that_of_the_describing_function(
    force: RestoringForce, amplitude: float
) -> None:
    n = 8000
    _, q, v = cycle(amplitude, 2.0, n)
    loop = force.force(q, v)
    lost = np.sum(0.5 * (loop[n:] + loop[n - 1 : -1]) * np.diff(q[n - 1 :]))
    scale = np.abs(loop).max() * amplitude
    assert lost > -1e-6 * scale
    expected = np.pi * amplitude**2 * force.describing_function(amplitude, 2.0).imag
    assert lost == pytest.approx(expected, abs=2e-3 * scale)
    if not (force.dissipates() or "contact_damping" in force.parameters):
        assert abs(lost) < 1e-6 * scale


@each
def test_tangent_is_the_derivative_of_the_force(force: RestoringForce) -> None:
    q = np.array([[0.0, x] for x in (-1.3, -0.31, 0.05, 0.2, 0.9)])
    v, h = 0.3 + 0.7 * q, 1e-6
    by_q, by_v = force.tangent(q, v)
    moved = np.array([0.0, h])
    numeric_q = (force.force(q + moved, v) - force.force(q - moved, v))[:, 1] / (2 * h)
    numeric_v = (force.force(q, v + moved) - force.force(q, v - moved))[:, 1] / (2 * h)
    assert by_q[:, 1] == pytest.approx(numeric_q, rel=1e-6, abs=1e-8)
    assert by_v[:, 1] == pytest.approx(numeric_v, rel=1e-6, abs=1e-8)


@each
def test_histories_are_taken_along_the_last_axis(force: RestoringForce) -> None:
    q = np.cumsum(np.random.default_rng(3).normal(size=(2, 3, 50)), axis=-1) * 0.2
    v = np.gradient(q, axis=-1)
    found = force.force(q, v)
    assert found.shape == q.shape
    assert np.array_equal(found[1, 2], force.force(q[1, 2], v[1, 2]))


@each
def test_it_is_scale_free_and_odd_if_it_says_so(force: RestoringForce) -> None:
    _, q, v = cycle(0.9, 2.0, 200)
    once, twice, back = force.force(q, v), force.force(2 * q, 2 * v), force.force(-q, -v)
    assert np.allclose(twice, 2 * once, rtol=1e-12, atol=0) == force.scale_free
    assert np.allclose(back, -once, rtol=1e-12, atol=1e-15) == force.odd


@each
def test_it_is_in_proportion_to_its_strength(force: RestoringForce) -> None:
    _, q, v = cycle(0.9, 2.0, 200)
    assert force.scaled(0.3).force(q, v) == pytest.approx(0.3 * force.force(q, v), rel=1e-12, abs=1e-15)


@each
def test_impossible_parameters_are_refused(force: RestoringForce) -> None:
    for f in fields(force):
        for bad in (float("nan"), "much", *([-1.0] if f.metadata["minimum"] == 0.0 else [])):
            with pytest.raises(ParameterError, match=f"{force.name}: {f.name}"):
                replace(force, **{f.name: bad})  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="at most 1"):
        JointSlip(1.0, 1.0, 1.1)


# --- kernels ----------------------------------------------------------------------------------------------------------


@numba.njit
def _all(laws, p, q, v, a, b, course_q, course_v, f0, f1):  # type: ignore[no-untyped-def]
    code = laws[0].code
    slopes = tangents(laws, code, p, q, v)
    return (
        resist(laws, code, p, q, v), slopes[0], slopes[1], steepest(laws, code, p, q, v),
        implicit(laws, code, p, q, a, v, b), mean(laws, code, p, course_q, course_v, f0, f1),
    )  # fmt: skip


@smooth
@pytest.mark.parametrize("compliance", [1e-6, 0.01, 0.15])
def test_kernels_are_the_law(name: str, compliance: float) -> None:
    force, old_q = FORCES[name], 0.1
    laws, values, sliders = packed([force])
    old = np.zeros(sliders.shape[:2])
    for moved in (0.9, -1.1, 0.3) if isinstance(force, Hysteretic) else ():
        # There and back, and some of the way again: contacts stand as they may.
        old = np.clip(old + sliders[:, :, 0] * moved, -sliders[:, :, 1], sliders[:, :, 1])
    a, b = compliance, 5.0 * compliance
    for q in (-7.0, -0.41, -0.05, 0.0, 0.3, 0.42, 2.0):
        v = 3.0 * q - 0.5

        def law_at(f: float, q: float = q, v: float = v) -> float:
            if isinstance(force, Memoryless):
                return float(force.force(q - a * f, v - b * f))
            k, limit = sliders[0].T
            return float(np.clip(old[0] + k * (q - a * f - old_q), -limit, limit).sum())

        if name == "softening" and compliance > 0.1 and abs(q) > 2.0:
            continue  # beyond the peak
        if isinstance(force, Hysteretic):
            new, stand = np.zeros(old.shape[1]), contacts(sliders)
            place(stand, 0, old[0], old_q)
            got, sliding = implicit_slide(stand, 0, q, a)
            assert slide(stand, 0, q - a * got) == pytest.approx(got, rel=1e-9, abs=1e-12)
            move(stand, 0, q - a * got, sliding)
            read(stand, 0, new)
            assert new.sum() == pytest.approx(got, rel=1e-12)
        else:
            course = (q, q + 0.02, q + 0.03), (v, v + 0.1, v)
            ends = [float(force.force(course[0][i], course[1][i])) for i in (0, 2)]
            value, by_q, by_v, steepest_, got, mean_ = _all(laws, tuple(values[0]), q, v, a, b, *course, *ends)
            assert value == pytest.approx(float(force.force(q, v)), rel=1e-12)
            assert (by_q, by_v) == pytest.approx([float(x) for x in force.tangent(q, v)], rel=1e-12)
            assert steepest_ >= max(abs(by_q), abs(by_v)) * (1 - 1e-12)
            # The mean along the quadratic course through the three motions; of fourth order, or of its corner's size.
            t = np.linspace(0.0, 1.0, 2_001)
            along = [(2 * t - 1) * (t - 1) * x + 4 * t * (1 - t) * y + t * (2 * t - 1) * z for x, y, z in course]
            expected = integrate.simpson(force.force(*along), x=t)
            assert mean_ == pytest.approx(
                expected, abs=0.05 * np.ptp(force.force(*along)) + 1e-6 * abs(expected) + 1e-14
            )
        assert law_at(got) == pytest.approx(got, rel=1e-10, abs=1e-12)
        if name != "softening":
            root = optimize.brentq(lambda f, law_at=law_at: f - law_at(f), -1e7, 1e7, xtol=1e-13, rtol=1e-13)
            assert got == pytest.approx(root, rel=1e-8, abs=1e-9)


def test_a_softening_spring_is_followed_up_to_its_peak() -> None:
    law, a = CubicStiffness(-3.0), 0.1
    peak = law.holds_below(3 * a)
    for q in (0.1, 0.6, 2 / 3 * peak * 0.999):
        f = law.implicit(law.values, q, a, 0.0, 0.0)
        assert f == pytest.approx(-3.0 * (q - a * f) ** 3, rel=1e-9)
        assert abs(q - a * f) < peak
    assert np.isnan(law.implicit(law.values, 50.0, a, 0.0, 0.0))


def test_friction_slides_sticks_and_turns_back() -> None:
    torque, b = 2.0, 0.1
    # Slides: the friction of a whole step does not stop it.
    assert coulomb(torque, 1.0, b, 0.9) == torque
    assert coulomb(torque, -1.0, b, -0.9) == -torque
    # Sticks: stopped within the step, and held against what drives it.
    f = coulomb(torque, 0.15, b, 0.1)
    assert 0.15 - b * f == pytest.approx(0.0, abs=1e-15)
    assert coulomb(torque, 0.12, b, 0.0) == pytest.approx(1.2)
    # From rest, once what drives it is stronger.
    assert coulomb(torque, 0.5, b, 0.0) == torque
    # Turned back by a stronger drive: the mean is that of the sign of a velocity that falls evenly.
    f = coulomb(torque, -0.4, b, 0.1)
    new = -0.4 - b * f
    assert new < 0.0
    assert f == pytest.approx(torque * (0.1 + new) / (0.1 - new))
    # It never makes the port faster than it would have been without, or was.
    rng = np.random.default_rng(5)
    for v, v0 in rng.normal(size=(200, 2)):
        f = coulomb(torque, v, b, v0)
        assert abs(f) <= torque
        assert abs(v - b * f) <= max(abs(v), abs(v0))


# --- variants of form -------------------------------------------------------------------------------------------------


def test_slip_without_spread_is_friction_that_sticks_elastically() -> None:
    _, q, v = cycle(0.9, 2.0, 400)
    one, other = JointSlip(4.0, 1.5), DryFriction(1.5, 4.0)
    assert np.array_equal(one.force(q, v), other.force(q, v))
    assert np.array_equal(one.sliders(), other.sliders())
    assert JointSlip(4.0, 1.5, 1e-9).force(q, v) == pytest.approx(one.force(q, v), abs=1e-8)


def test_friction_comes_to_coulomb_s_law_as_it_sticks_more_stiffly() -> None:
    ideal = complex(DryFriction(2.0).describing_function(0.5, 1.0))
    errors = [abs(complex(DryFriction(2.0, k).describing_function(0.5, 1.0)) - ideal) for k in (1e2, 1e4, 1e6)]
    assert errors[1] < 0.15 * errors[0]
    assert errors[2] < 0.15 * errors[1]
    assert errors[2] < 1e-2 * abs(ideal)


def backbone(u: float, s: float) -> float:
    """Force over slip torque of evenly distributed slip torques, first loading to u = stiffness · q over slip torque."""
    return u if u <= 1 - s else 1.0 if u >= 1 + s else u - (u - 1 + s) ** 2 / (4 * s)


@pytest.mark.parametrize("spread", [0.2, 0.6, 1.0])
def test_contacts_follow_the_closed_form_of_the_even_distribution(spread: float) -> None:
    k, torque = 4.0, 1.5
    force = JointSlip(k, torque, spread)
    u = np.linspace(0.0, 2.2, 2001)
    exact = np.array([backbone(x, spread) for x in u])
    found = force.force(u * torque / k, np.zeros(u.size)) / torque
    assert np.abs(found - exact).max() < 1.02 * spread / (4 * CONTACTS**2)
    assert np.abs(found - exact).max() > 0.5 * spread / (4 * CONTACTS**2)  # the bound is no larger than it has to be
    # By Masing's rules a loop of amplitude A is the backbone doubled: f(q) = 2 F((A + q)/2) - F(A).
    for x in (0.7, 1.3, 3.0):
        angle = np.linspace(0.0, np.pi, 20_001)
        down = backbone(x, spread) - 2 * np.array([backbone(x * (1 - c) / 2, spread) for c in np.cos(angle)])
        loop = integrate.simpson(down * np.exp(-1j * angle), x=angle) * 2 / np.pi * k / x
        equivalent = complex(force.describing_function(x * torque / k, 1.0))
        assert abs(equivalent - loop) < 2e-3 * k


def test_contact_of_freeplay_by_default_is_the_spring_s() -> None:
    q = np.linspace(-2.0, 2.0, 101)
    assert np.array_equal(Freeplay(0.4, 5.0).force(q, q), Freeplay(0.4, 5.0, 5.0).force(q, q))
    stiff = Freeplay(0.4, 5.0, 20.0).force(q, q) + 5.0 * q
    assert stiff == pytest.approx(np.where(np.abs(q) < 0.4, 0.0, 20.0 * (q - 0.4 * np.sign(q))), abs=1e-12)


def test_loops_are_compiled_anew_where_a_file_of_theirs_has_changed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A sweep went on with contacts as they were before a pull: they are inlined from another file than its own."""
    arrays = importlib.import_module("cutvib_ss.model.restoring_forces.packed")
    assert {"contacts.py", "compiled_forces.py", "compiled_balance.py"} <= {f.name for f in arrays._loops()}
    inlined = tmp_path / "inlined.py"
    monkeypatch.setattr(arrays, "_loops", lambda: [inlined])
    names = []
    for text in ("a = 1", "a = 2", "a = 1"):
        inlined.write_text(text, encoding="utf-8")
        names.append(arrays._record.__wrapped__(arrays.memoryless()).names)
    assert names[0] == names[2] != names[1]
