"""Friction and slip where it is hard: free bodies, the ideal limit, lightly damped resonances, a law of one's own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from cutvib_ss.effects.base import Motion
from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.effects.law_element import LawElement
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.restoring_forces import Memoryless, law, packed, registered, value
from cutvib_ss.model.restoring_forces.base import Values
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.response import compiled
from cutvib_ss.response.compiled_forces import forces
from cutvib_ss.response.harmonic_balance import sine_response
from cutvib_ss.response.port_motion import harmonic_tables
from cutvib_ss.response.stepping import modal_form, step
from tests.unit.event_integrator import integrate

W0 = 2 * np.pi * 50.0


def mass(m: float, k: float, c: float, law: str = "", **parameters: float) -> Structure:
    """One mass, with a law to ground."""
    system = SecondOrder(np.eye(1) * m, np.eye(1) * c, np.eye(1) * k, ("x",), {"x": np.ones(1)})
    elements = (NonlinearElement("x", law, parameters),) if law else ()
    return Structure(system, {"x": Channel("x", "displacement")}, "x", nonlinear=elements)


# --- a free carriage: 95 kg, 20 N of friction, pushed by 100 N, sampled at 1 kHz --------------------------------------

T = np.arange(2000) / 1000.0
PUSH = 100.0 * np.sin(2 * np.pi * 3.0 * T) * np.hanning(T.size)
CARRIAGE = {
    "Coulomb": ("dry_friction", {"torque": 20.0}, 3e-3),
    "elastic": ("dry_friction", {"torque": 20.0, "sticking_stiffness": 1e7}, 5e-4),
    "nearly rigid": ("dry_friction", {"torque": 20.0, "sticking_stiffness": 1e9}, 5e-3),
    "Iwan": ("joint_slip", {"stiffness": 1e6, "slip_torque": 20.0, "spread": 0.6}, 1e-4),
    "cubic": ("cubic_stiffness", {"stiffness3": 1e10}, 1e-5),
    "quadratic": ("quadratic_damping", {"coefficient": 2000.0}, 1e-5),
}


@pytest.mark.parametrize("name", CARRIAGE)
@pytest.mark.parametrize("c", [0.0, 300.0])
def test_a_free_carriage_converges_as_steps_are_halved(name: str, c: float) -> None:
    law, parameters, within = CARRIAGE[name]
    model = mass(95.0, 0.0, c, law, **parameters)
    form = modal_form(model)
    runs = [step(form, PUSH[None], 1000.0, model.nonlinear, fine).motions[0, 0] for fine in (4, 8, 32, None)]
    errors = [np.abs(x - runs[2]).max() / np.abs(runs[2]).max() for x in runs]
    # What is chosen unasked is good, and twice the steps never much worse; four times are better.
    assert errors[3] < within
    assert errors[1] < max(1.5 * errors[0], 1e-8)
    assert errors[1] < max(0.7 * errors[0], within)


@pytest.mark.parametrize("name", CARRIAGE)
def test_the_loop_of_one_element_is_that_of_several(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    law, parameters, within = CARRIAGE[name]
    model = mass(95.0, 4e5, 300.0, law, **parameters)
    blows = np.stack([PUSH, -0.3 * PUSH])
    alone = step(modal_form(model), blows, 1000.0, model.nonlinear, 8)
    monkeypatch.setattr(compiled, "interact_alone", compiled._interact_together)
    together = step(modal_form(model), blows, 1000.0, model.nonlinear, 8)
    # Alone two sweeps of a step are made, together as many as move a force: a small part of what steps leave.
    most = np.abs(together.motions).max()
    np.testing.assert_allclose(alone.motions, together.motions, rtol=0.0, atol=1e-3 * within * most)


@pytest.mark.parametrize("name", ["Coulomb", "elastic"])
def test_a_free_carriage_is_what_events_say(name: str) -> None:
    law, parameters, _ = CARRIAGE[name]
    model = mass(95.0, 0.0, 10.0, law, **parameters)
    got = step(modal_form(model), PUSH[None], 1000.0, model.nonlinear).motions[0, 0]
    want = integrate(
        model.system, np.ones(1), lambda t: float(np.interp(t, T, PUSH)), model.nonlinear[0], T[:1500], 1e-3
    )
    assert np.abs(got[:1500] - want).max() < 4e-3 * np.abs(want).max()


def test_friction_that_sticks_more_and_more_stiffly_comes_to_coulomb_s_law() -> None:
    def moved(**parameters: float) -> np.ndarray:
        model = mass(95.0, 0.0, 10.0, "dry_friction", torque=20.0, **parameters)
        return step(modal_form(model), PUSH[None], 1000.0, model.nonlinear, 16).motions[0, 0]

    ideal = moved()
    errors = [
        np.abs(moved(sticking_stiffness=k) - ideal).max() / np.abs(ideal).max() for k in 10.0 ** np.arange(5, 16, 2)
    ]
    assert errors[0] > 0.02
    assert max(errors[2:]) < 0.01
    # Beyond what steps resolve it is that law.
    assert errors[-1] == 0.0


def iwan_by_events(model: Structure, force: Any, times: np.ndarray) -> np.ndarray:
    """Displacement of a mass with sliders, each a state that stops at its limit; integrated with small steps."""
    sliders = model.nonlinear[0].restoring_force.sliders()  # type: ignore[attr-defined]
    k, limit = sliders.T
    m, c, stiff = model.system.mass[0, 0], model.system.damping[0, 0], model.system.stiffness[0, 0]

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        f = np.clip(y[2:], -limit, limit)
        slides = (np.abs(y[2:]) >= limit) & (y[2:] * y[1] > 0.0)
        a = (force(t) - c * y[1] - stiff * y[0] - f.sum()) / m
        return np.concatenate([[y[1], a], np.where(slides, 0.0, k * y[1])])

    return solve_ivp(rates, times[[0, -1]], np.zeros(2 + len(k)), t_eval=times, max_step=2e-5, rtol=1e-6).y[0]


def test_spread_slip_is_what_its_sliders_do_one_by_one() -> None:
    model = mass(1.0, W0**2, 6.0, "joint_slip", stiffness=0.5 * W0**2, slip_torque=40.0, spread=0.8)
    t = np.arange(600) / 8000.0

    def blow(s: Any) -> Any:
        return 600.0 * np.exp(-(((s - 0.01) / 1e-3) ** 2))

    got = step(modal_form(model), blow(t)[None], 8000.0, model.nonlinear, 8).motions[0, 0]
    want = iwan_by_events(model, blow, t)
    assert np.abs(got - want).max() < 1e-3 * np.abs(want).max()
    one = step(modal_form(mass(1.0, W0**2, 6.0)), blow(t)[None], 8000.0).responses[0, 0]
    assert np.abs(got - one).max() > 0.1 * np.abs(want).max()


# --- a lightly damped mode, swept ------------------------------------------------------------------------------------


@pytest.mark.parametrize("amplitude", [0.5, 2.0, 4.0])
@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        ("dry_friction", {"torque": 2.0, "sticking_stiffness": 0.2 * W0**2}),
        ("dry_friction", {"torque": 2.0, "sticking_stiffness": 5.0 * W0**2}),
        ("dry_friction", {"torque": 2.0, "sticking_stiffness": 1e6 * W0**2}),
        ("dry_friction", {"torque": 2.0}),
        ("joint_slip", {"stiffness": 0.2 * W0**2, "slip_torque": 2.0, "spread": 0.8}),
        ("joint_slip", {"stiffness": 1e8 * W0**2, "slip_torque": 2.0, "spread": 1.0}),
    ],
)
def test_a_lightly_damped_mode_is_swept_through_stick_and_slip(
    law: str, parameters: dict[str, float], amplitude: float
) -> None:
    model, freq = mass(1.0, W0**2, 2e-3 * W0, law, **parameters), np.arange(45.0, 62.0, 0.25)
    up, down, more = (
        sine_response(model, None, freq, amplitude, direction=d, harmonics=h).data[0, 0, 0]  # type: ignore[arg-type]
        for d, h in (("up", 7), ("down", 7), ("up", 11))
    )
    size = np.abs(up).max()
    assert np.abs(up - down).max() < 1e-8 * size
    # Where all sticks there is next to no response, of no exact size.
    assert np.abs(up - more).max() < 0.03 * max(size, 0.1 / W0**2)
    if "sticking_stiffness" in parameters and amplitude == 4.0:
        # Resonant motion slides nearly all of the time: energy put in is what friction and damper take out.
        k = int(np.argmin(np.abs(freq - 50.0)))
        a = abs(up[k]) * amplitude
        reach = min(2.0 / (min(parameters["sticking_stiffness"], 1e9) * a), 1.0)
        lost = 4.0 * 2.0 * a * (1.0 - reach) + np.pi * 2e-3 * W0 * W0 * a**2
        assert lost == pytest.approx(np.pi * amplitude * a * np.sin(-np.angle(up[k])), rel=0.01)


# --- places, starts, files -------------------------------------------------------------------------------------------

LAWS: tuple[type[LawElement], ...] = (
    CubicStiffness, Freeplay, DryFriction, JointSlip, BilinearStiffness, QuadraticDamping,
)  # fmt: skip


@pytest.mark.parametrize("kind", LAWS)
def test_where_nothing_holds_a_port_only_what_needs_a_spring_is_refused(kind: type[LawElement]) -> None:
    model = mass(95.0, 0.0, 10.0)
    motion = Motion(1e-3, 4e-3, 0.05, force=100.0)
    starts = kind.starts_at("x", motion, 0.0, 0.0)
    assert len(starts) >= 6
    if kind in (Freeplay, BilinearStiffness):
        # Stops with play take no spring away, and say so.
        stops = kind is Freeplay
        assert kind.places(model) == (("x",) if stops else ())
        hint = "stops with play need none" if stops else "none on this model$"
        with pytest.raises(ParameterError, match=f"there is none at 'x'.*{hint}"):
            starts[0].apply(model)
        return
    assert kind.places(model) == ("x",)
    for peak in (None, motion.high):
        for r in kind.ranges(model, "x", peak).values():
            assert r.low < r.high
            assert r.scale in ("linear", "asinh") or r.low > 0.0
    bare = step(modal_form(model), PUSH[None], 1000.0).responses[0]
    changes = []
    for start in starts:
        held = start.apply(model)
        got = step(modal_form(held), PUSH[None], 1000.0, held.nonlinear)
        changes.append(np.abs(got.responses[0] - bare).max() / np.abs(bare).max())
        for name, r in kind.ranges(model, "x", motion.high).items():
            given = getattr(start, name)
            assert given is None or not np.isfinite(given) or r.low <= given <= r.high
    assert min(changes) < 0.2
    assert max(changes) > 0.2


@pytest.mark.parametrize("kind", LAWS)
def test_starts_are_in_proportion_to_force_and_motion(kind: type[LawElement]) -> None:
    # The same records in other units of length: forces stay, motions and rates grow, stiffness and damping fall.
    far = 1e3
    one = kind.starts_at("joint2", Motion(1e-4, 4e-4, 0.1, 5.0), 1e4, 2.0)
    other = kind.starts_at("joint2", Motion(1e-4 * far, 4e-4 * far, 0.1 * far, 5.0), 1e4 / far, 2.0 / far)
    assert len(one) == len(other)
    for a, b in zip(one, other, strict=True):
        pair = [e.apply(published_machine()).nonlinear[0].restoring_force for e in (a, b)]
        if kind in (Freeplay, BilinearStiffness):
            continue
        q, v = 2e-4 * np.sin(np.arange(200.0)), 0.1 * np.cos(np.arange(200.0))
        assert pair[1].force(q * far, v * far) == pytest.approx(pair[0].force(q, v), rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    "effect",
    [
        DryFriction("joint2", 0.5),
        DryFriction("joint2", 0.5, 3e5),
        JointSlip("joint2", 2e3, 0.5, 0.7),
        Freeplay("joint2", 1e-5),
        Freeplay("joint2", 1e-5, 2e4),
    ],
)
def test_variants_are_written_to_and_read_from_machine_toml(effect: LawElement, tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    write_machine(effect.apply(published_machine()), path)
    assert read_machine(path).effects == (effect,)


def test_files_without_the_new_keys_mean_what_they_meant(tmp_path: Path) -> None:
    path = tmp_path / "machine.toml"
    path.write_text(
        '[[effect]]\neffect = "dry_friction"\nplace = "joint2"\ntorque = 0.5\n'
        '[[effect]]\neffect = "joint_slip"\nplace = "joint1"\nstiffness = 900.0\nslip_torque = 0.2\n'
        '[[effect]]\neffect = "freeplay"\nplace = "joint2"\ngap = 1e-5\n'
    )
    friction, slip, gap = (e.restoring_force for e in read_machine(path).nonlinear)
    assert friction.jumps
    assert slip.sliders().tolist() == [[900.0, 0.2]]
    assert gap.contact == published_machine().head.k2


def test_slip_without_spread_goes_by_the_name_of_friction() -> None:
    fitted = JointSlip("joint2", 900.0, 0.3, 0.04)
    assert fitted.alias(published_machine(), {"spread": 0.05}) == DryFriction("joint2", 0.3, 900.0)
    assert fitted.alias(published_machine(), {"spread": 0.01}) is fitted
    one, other = (
        e.apply(published_machine()).nonlinear[0].restoring_force
        for e in (JointSlip("joint2", 900.0, 0.3), DryFriction("joint2", 0.3, 900.0))
    )
    assert np.array_equal(one.sliders(), other.sliders())


@pytest.mark.parametrize("kind", LAWS)
def test_an_effect_is_as_free_of_scale_as_its_law(kind: type[LawElement]) -> None:
    assert kind.scale_free == kind.restoring_force().scale_free


# --- a law of one's own ----------------------------------------------------------------------------------------------


def test_a_law_of_one_s_own_needs_no_other_edit() -> None:
    # Registered last and taken off again: other tests count the laws.
    from cutvib_ss.model.restoring_forces import base

    @dataclass(frozen=True)
    class Fifth(Memoryless):
        name: ClassVar[str] = "fifth_power"
        strength: ClassVar[tuple[str, ...]] = ("stiffness5",)
        stiffness5: float = value("N m/rad^5")

        @staticmethod
        def resist(p: Values, q: float, v: float) -> float:
            return p[0] * q * q * q * q * q

        @staticmethod
        def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
            return 5.0 * p[0] * q * q * q * q, 0.0

        def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> Any:
            return np.asarray(0.625 * self.stiffness5 * np.asarray(amplitude) ** 4 + 0j * np.asarray(omega))

    try:
        model = mass(1.0, W0**2, 6.0, "fifth_power", stiffness5=1e16)
        t = np.arange(600) / 8000.0
        blow = 400.0 * np.exp(-(((t - 0.01) / 1e-3) ** 2))
        got = step(modal_form(model), blow[None], 8000.0, model.nonlinear).motions[0, 0]
        want = integrate(
            model.system,
            np.ones(1),
            lambda s: 400.0 * float(np.exp(-(((s - 0.01) / 1e-3) ** 2))),
            model.nonlinear[0],
            t,
            1e-4,
        )
        assert np.abs(got - want).max() < 1e-4 * np.abs(want).max()
        out, slope = np.zeros(2), np.zeros((2, 2))
        tables = harmonic_tables(np.array([1]), 64)
        laws, values, sliders = packed([Fifth(1e16)])
        forces(np.array([3e-4, 0.0]), 300.0, laws, 0, values, sliders, tables, out, slope)
        assert out == pytest.approx([0.625 * 1e16 * 3e-4**5, 0.0], abs=1e-12)
        assert slope[0, 0] == pytest.approx(5 * 0.625 * 1e16 * 3e-4**4)
    finally:
        del base._REGISTERED["fifth_power"]
    assert "fifth_power" not in registered()


@pytest.mark.parametrize("exponent", [-0.7, -0.4, 0.0])
def test_small_motions_lose_energy_with_the_power_of_segalman(exponent):
    """Per cycle π A² Im N(A), in proportion to A^(3 + exponent) far below gross slip (Segalman, J. Appl. Mech. 72, 2005, 752)."""
    slip = law("joint_slip")(1e4, 2.0, 1.0, exponent)
    # Sixteen contacts share the torques out: over some of them the power is that of the law.
    amplitude = np.geomspace(0.3, 0.8, 200) * 2.0 / 1e4
    lost = np.pi * amplitude**2 * slip.describing_function(amplitude, 100.0).imag
    slope = np.polyfit(np.log(amplitude), np.log(lost), 1)[0]
    assert slope == pytest.approx(3.0 + exponent, abs=0.05)


@pytest.mark.parametrize("exponent", [-0.7, 0.0, 0.5])
def test_the_mean_slip_torque_is_that_of_gross_slip(exponent):
    for spread in (0.3, 1.0):
        stiffness, torque = law("joint_slip")(1e4, 2.0, spread, exponent).sliders().T
        assert stiffness.sum() == pytest.approx(1e4)
        assert torque.sum() == pytest.approx(2.0, rel=0.05)
        assert 1.0 - spread < (torque / stiffness).min() * 1e4 / 2.0 < 1.0 - 0.8 * spread


@pytest.mark.parametrize("knee", [0.2, 0.5, 1.0])
def test_pushed_from_rest_it_yields_as_bouc_and_wen_say(knee: float) -> None:
    torque, stiffness = 1.5, 4.0
    q = np.linspace(0.0, 1.2, 1201)
    found = law("dry_friction")(torque, stiffness, knee).force(q, np.zeros(q.size))
    expected = solve_ivp(
        lambda _, f: stiffness * (1.0 - (f / torque) ** (1.0 / knee)),
        (0.0, 1.2),
        [0.0],
        t_eval=q,
        rtol=1e-9,
        atol=1e-12,
    ).y[0]
    assert found == pytest.approx(expected, abs=3e-3 * torque)
    # All of it slides in the end, and what sticks is as stiff as stated.
    assert law("dry_friction")(torque, stiffness, knee).sliders().sum(axis=0) == pytest.approx([stiffness, torque])


def test_a_knee_of_nothing_is_one_contact() -> None:
    q = 0.9 * np.sin(np.linspace(0.0, 20.0, 4001))
    sharp, rounded = (law("dry_friction")(1.5, 4.0, knee).force(q, np.zeros(q.size)) for knee in (None, 1e-3))
    assert rounded == pytest.approx(sharp, abs=6e-3)
