"""Sine sweeps of nonlinear models: against closed forms, and against time stepping until motion is steady."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import Attachment, SpringDamperMass
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.measurement_chain import ChannelChain, MeasurementChain
from cutvib_ss.model.paths import Path, value_at, with_value
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.model.restoring_forces.cubic_stiffness import CubicStiffness
from cutvib_ss.model.restoring_forces.joint_slip import JointSlip
from cutvib_ss.model.restoring_forces.packed import packed
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.compiled_forces import forces
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.harmonic_balance import SineSweep, sine_response
from cutvib_ss.response.port_motion import harmonic_tables
from cutvib_ss.response.stepping import modal_form, step

W0, ZETA = 2 * np.pi * 50.0, 0.01
LAWS = {
    "cubic_stiffness": {"stiffness3": 3e9},
    "freeplay": {"gap": 2e-4, "stiffness": 2.5e5},
    "bilinear_stiffness": {"asymmetry": 0.25, "stiffness": 2.5e5},
    "dry_friction": {"torque": 6.0},
    "quadratic_damping": {"coefficient": 200.0},
    "joint_slip": {"stiffness": 1e5, "slip_torque": 15.0},
}


def duffing(stiffness3: float) -> Structure:
    """A mass of 1 kg on a cubic spring."""
    system = SecondOrder(np.eye(1), [[2 * ZETA * W0]], [[W0**2]], ("x",), {"x": np.ones(1)})
    model = Structure(system, {"x": Channel("x", "displacement")}, "x")
    return replace(model, nonlinear=(NonlinearElement("x", "cubic_stiffness", {"stiffness3": stiffness3}),))


def two_masses(*laws: str, kind: str = "force") -> Structure:
    """Two masses on a wall, 40 and 120 Hz, damped by three to nine percent, with laws between them."""
    link = np.array([[2.0, -1.0], [-1.0, 1.0]])
    ports = {"drive": np.array([1.0, 0.0]), "link": np.array([-1.0, 1.0])}
    system = SecondOrder(np.diag([2.0, 1.5]), 60.0 * link, 2.5e5 * link, ("x1", "x2"), ports)
    channels = {"a": Channel("drive", "acceleration"), "d": Channel("link", "displacement")}
    elements = tuple(NonlinearElement("link", law, LAWS[law]) for law in laws)
    return Structure(system, channels, "drive", kind, nonlinear=elements)  # type: ignore[arg-type]


def by_stepping(model: Machine | Structure, freq: float, amplitude: float, position: float | None = None) -> np.ndarray:
    """Fundamental of the channels over force once the motion is steady."""
    per, fs = 80, 80 * freq
    periods = round(1.6 * freq)
    force = amplitude * np.cos(2 * np.pi * np.arange(per * periods) / per)
    shown = step(modal_form(model, position), force[None], fs, model.nonlinear).responses[0]
    # The last periods, but for those that the end of the force shapes.
    used = shown[:, -per * 9 : -per * 3].reshape(len(shown), 6, per).mean(axis=1)
    return np.fft.rfft(used)[:, 1] * 2 / per / amplitude


@pytest.mark.parametrize("numbers", [(1, 2, 3), (1, 3, 5)], ids=["all", "odd"])
@pytest.mark.parametrize(("spread", "exponent"), [(0.0, 0.0), (1.0, 0.0), (1.0, -0.7)])
def test_contacts_that_turn_within_a_period_are_what_marching_comes_to(
    spread: float, exponent: float, numbers: tuple[int, ...]
) -> None:
    law = JointSlip(2.0, 1.5, spread, exponent)
    laws, values, sliders = packed([law])
    tables = harmonic_tables(np.array(numbers), 256)
    x = np.array([0.9, 0.3, -0.8, 0.5, 0.7, -0.6])

    def shown(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        out, slope = np.zeros(6), np.zeros((6, 6))
        forces(at, 1.0, laws, 0, values, sliders, tables, out, slope)
        return out, slope

    turn = np.linspace(0.0, 6.0 * np.pi, 3 * 12_000 + 1)
    waves = np.array([f(k * turn) for k in numbers for f in (np.cos, np.sin)])
    marched = law.force(x @ waves, 0.0 * turn)[-12_000:]
    expected = 2.0 * waves[:, -12_000:] @ marched / 12_000
    got, slope = shown(x)
    assert got == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())
    moved = np.array([(shown(x + 1e-6 * e)[0] - shown(x - 1e-6 * e)[0]) / 2e-6 for e in np.eye(6)]).T
    assert slope == pytest.approx(moved, abs=1e-6 * np.abs(slope).max())


@pytest.mark.parametrize("numbers", [(0, 1, 2, 3), (1, 3, 5)], ids=["all", "odd"])
def test_a_polynomial_needs_no_more_samples_than_its_harmonics(numbers: tuple[int, ...]) -> None:
    laws, values, sliders = packed([CubicStiffness(2.0)])
    few = 2 * ((CubicStiffness(2.0).degree or 0) + 1) * numbers[-1]
    x = np.random.default_rng(3).normal(size=2 * len(numbers) - (numbers[0] == 0))

    def shown(samples: int) -> tuple[np.ndarray, np.ndarray]:
        out, slope = np.zeros(x.size), np.zeros((x.size, x.size))
        forces(x, 1.0, laws, 0, values, sliders, harmonic_tables(np.array(numbers), samples), out, slope)
        return out, slope

    for got, expected in zip(shown(few), shown(512), strict=True):
        assert got == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())


# --- limits -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", ["up", "down"])
def test_without_elements_it_is_the_linear_response(direction: str) -> None:
    freq = np.linspace(10.0, 300.0, 40)
    machine = published_machine()
    shown = sine_response(machine, [0.3, 0.5], freq, 20.0, direction=direction)  # type: ignore[arg-type]
    linear = frequency_response(machine, [0.3, 0.5], freq)
    assert np.abs(shown.data - linear.data).max() < 1e-12 * np.abs(linear.data).max()
    assert (shown.outputs, shown.unit) == (linear.outputs, linear.unit)


def test_small_motion_is_linear() -> None:
    freq = np.linspace(190.0, 260.0, 71)
    machine = replace(
        published_machine(), nonlinear=(NonlinearElement("joint2", "cubic_stiffness", {"stiffness3": 8e9}),)
    )
    linear = frequency_response(machine, 0.4, freq).data
    errors = [
        np.abs(sine_response(machine, 0.4, freq, f).data - linear).max() / np.abs(linear).max() for f in (0.1, 0.2)
    ]
    assert errors[0] < 2e-4
    # What is left goes with the square of the force.
    assert errors[1] / errors[0] == pytest.approx(4.0, rel=0.01)


# --- Duffing's equation -----------------------------------------------------------------------------------------------


def amplitudes(omega: float, force: float, stiffness3: float) -> np.ndarray:
    """All amplitudes of the fundamental, of ((ω0² - ω²) + ¾ k3 A²)² A² + (2ζω0ω)² A² = f², ascending."""
    d, k, c = W0**2 - omega**2, 0.75 * stiffness3, (2 * ZETA * W0 * omega) ** 2
    roots = np.roots([k**2, 2 * k * d, d**2 + c, -(force**2)])
    return np.sqrt(np.sort(roots[np.abs(roots.imag) < 1e-6 * np.abs(roots)].real))


@pytest.mark.parametrize("stiffness3", [1e9, -6e8])
def test_both_branches_of_duffing_and_where_they_end(stiffness3: float) -> None:
    freq, force = np.linspace(42.0, 62.0, 401), 8.0
    model = duffing(stiffness3)
    up, down = (
        np.abs(sine_response(model, None, freq, force, direction=d, harmonics=1).data[0, 0, 0]) * force
        for d in ("up", "down")
    )
    roots = [amplitudes(2 * np.pi * f, force, stiffness3) for f in freq]
    several = np.array([r.size == 3 for r in roots])
    assert several.sum() > 10
    # Hardening: up along the high branch; softening: down along it.
    high, low = (up, down) if stiffness3 > 0 else (down, up)
    assert high == pytest.approx([r[-1] for r in roots], rel=1e-7)
    assert low == pytest.approx([r[0] for r in roots], rel=1e-7)
    # The peak lies on the backbone.
    peak = np.argmax(high)
    backbone = np.sqrt(W0**2 + 0.75 * stiffness3 * high[peak] ** 2) / (2 * np.pi)
    assert freq[peak] == pytest.approx(backbone, abs=2 * (freq[1] - freq[0]))


def test_coarse_lines_jump_where_fine_ones_do() -> None:
    model, force = duffing(1e9), 8.0
    fine = np.linspace(42.0, 62.0, 2001)
    coarse = fine[::40]
    one, other = (sine_response(model, None, f, force).data[0, 0, 0] for f in (fine, coarse))
    assert np.abs(one[::40] - other).max() < 1e-8 * np.abs(one).max()


def test_the_third_harmonic_of_duffing() -> None:
    # Near a third of the resonance the third harmonic rings: one harmonic alone is not enough, seven and eleven agree.
    freq = np.linspace(15.0, 18.5, 36)
    one, seven, eleven = (sine_response(duffing(3e9), None, freq, 60.0, harmonics=h).data[0, 0, 0] for h in (1, 7, 11))
    assert np.abs(one - seven).max() > 1e-3 * np.abs(seven).max()
    assert np.abs(seven - eleven).max() < 1e-8 * np.abs(seven).max()


# --- every law --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
def test_every_law_is_what_stepping_comes_to(law: str) -> None:
    model, freq = two_masses(law), np.array([31.0, 38.0, 41.0, 55.0, 92.0, 120.0])
    # A clearance that is not much smaller than the motion may settle unevenly, to one side.
    amplitude = 200.0 if law == "freeplay" else 60.0
    within = 0.012 if law == "dry_friction" else 1e-3
    shown = sine_response(model, None, np.arange(25.0, 130.0, 1.0), amplitude, harmonics=9)
    linear = frequency_response(model, None, freq).data[0, :, 0]
    off = 0.0
    for k, f in enumerate(freq):
        at = np.flatnonzero(shown.freq == f)[0]
        expected = by_stepping(model, float(f), amplitude)
        found = shown.data[0, :, 0, at]
        assert (np.abs(found - expected) < within * np.abs(expected)).all()
        off = max(off, float((np.abs(linear[:, k] - expected) / np.abs(expected)).max()))
    # The law matters at all.
    assert off > 0.04


def test_two_laws_at_once_and_a_shaken_base() -> None:
    model = two_masses("cubic_stiffness", "dry_friction", kind="acceleration")
    freq = np.arange(30.0, 60.0, 1.0)
    shown = sine_response(model, None, freq, 15.0, harmonics=9)
    assert shown.units[0] == "m/s^2/(m/s^2)"
    for f in (36.0, 41.0):
        expected = by_stepping(model, f, 15.0)
        assert (np.abs(shown.data[0, :, 0, int(f) - 30] - expected) < 0.012 * np.abs(expected)).all()


def test_the_machine_s_joint_is_what_stepping_comes_to() -> None:
    element = NonlinearElement("joint2", "cubic_stiffness", {"stiffness3": 8e9})
    machine = replace(published_machine(), nonlinear=(element,))
    # Quicker to settle than the published rail.
    machine = with_value(machine, ("rail", "parameters", "damping_ratio"), 0.04)
    shown = sine_response(machine, 0.5, np.arange(190.0, 240.0, 1.0), 60.0)
    linear = frequency_response(machine, 0.5, [212.0]).data[0, :, 0, 0]
    expected = by_stepping(machine, 212.0, 60.0, 0.5)
    found = shown.data[0, :, 0, 22]
    assert (np.abs(found - expected) < 5e-3 * np.abs(expected).max()).all()
    assert np.abs(linear - expected).max() > 0.05 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        ("dry_friction", {"torque": 5.0, "sticking_stiffness": 1e6}),
        ("joint_slip", {"stiffness": 2e6, "slip_torque": 20.0, "spread": 0.5, "exponent": -0.5}),
    ],
)
def test_the_same_sweep_gives_the_same_bits_wherever_its_arrays_lie(law: str, parameters: dict[str, float]) -> None:
    """Sums in an order that depends on memory differed by rounding in one call of ten."""
    machine = replace(published_machine(), nonlinear=(NonlinearElement("joint2", law, parameters),))
    rng, freq, seen, kept = np.random.default_rng(1), np.linspace(5.0, 40.0, 120), set(), []
    force = 20.0 * (1.0 + 0.1 * rng.standard_normal(freq.size))
    for _ in range(120):
        kept.append(np.zeros(rng.integers(1, 64)))
        seen.add(sine_response(machine, 0.5, freq, force).data.tobytes())
    assert len(seen) == 1


# --- chain, derivatives, refusals -------------------------------------------------------------------------------------


def test_the_measurement_chain_is_in_between() -> None:
    model, freq = two_masses("cubic_stiffness"), np.arange(30.0, 60.0, 0.5)
    chained = replace(model, chain=MeasurementChain({"a": ChannelChain(1.1, 1e-4)}, decay_rate=3.0))
    plain, shown = (sine_response(m, None, freq, 60.0).data for m in (model, chained))
    factor = 1.1 * np.exp(-2j * np.pi * freq * 1e-4)
    assert np.abs(shown[0, 0, 0] - factor * plain[0, 0, 0]).max() < 1e-9 * np.abs(plain[0, 0]).max()
    assert np.abs(shown[0, 1] - plain[0, 1]).max() < 1e-9 * np.abs(plain[0, 1]).max()


@pytest.mark.parametrize("law", LAWS)
def test_derivatives(law: str) -> None:
    machine = published_machine()
    spring = machine.head.k2
    sizes = {
        "cubic_stiffness": {"stiffness3": 8e9},
        "freeplay": {"gap": 2e-5, "stiffness": spring},
        "bilinear_stiffness": {"asymmetry": 0.1, "stiffness": spring},
        "dry_friction": {"torque": 0.1},
        "quadratic_damping": {"coefficient": 0.05},
        "joint_slip": {"stiffness": 1500.0, "slip_torque": 0.3},
    }
    machine = replace(machine, nonlinear=(NonlinearElement("joint2", law, sizes[law]),))
    freq = np.arange(195.0, 235.0, 1.0)
    sweep = SineSweep(machine, [0.3], freq, 30.0)
    paths: list[Path] = [("head", "k2"), ("head", "l1"), ("rail", "parameters", "mass")]
    paths += [("nonlinear", 0, "parameters", name) for name in sizes[law]]
    for path in paths:
        value = value_at(machine, path)
        h = 1e-6 * abs(value)
        moved = [SineSweep(with_value(machine, path, value + d), [0.3], freq, 30.0).data for d in (h, -h)]
        expected = (moved[0] - moved[1]) / (2 * h)
        found = sweep.derivative(path)
        assert np.abs(found - expected).max() < 0.02 * np.abs(expected).max()


def test_hysteretic_damping_needs_a_frequency() -> None:
    model = two_masses("cubic_stiffness")
    model = replace(model, attachments=(Attachment("link", SpringDamperMass(loss_stiffness=5e3)),))
    with pytest.raises(CouplingError, match="equivalent viscous"):
        sine_response(model, None, [40.0, 41.0], 5.0)
    assert np.isfinite(sine_response(model, None, [40.0, 41.0], 5.0, viscous_at=40.0).data).all()


def test_a_softening_spring_that_gives_way_is_refused() -> None:
    with pytest.raises(CouplingError, match="run away"):
        sine_response(duffing(-5e10), None, np.linspace(42.0, 62.0, 101), 400.0)


@pytest.mark.parametrize(
    ("more", "match"),
    [
        ({"freq": [50.0, 40.0]}, "ascend"),
        ({"freq": [0.0, 40.0]}, "above 0"),
        ({"amplitude": 0.0}, "amplitude"),
        ({"direction": "sideways"}, "sideways"),
        ({"harmonics": 0}, "harmonics"),
    ],
)
def test_impossible_sweeps_are_refused(more: dict[str, object], match: str) -> None:
    asked: dict[str, object] = {"freq": [40.0, 41.0], "amplitude": 1.0, **more}
    with pytest.raises(ParameterError, match=match):
        sine_response(duffing(1e9), None, **asked)  # type: ignore[arg-type]


# --- force line by line, and a held response ---------------------------------------------------------------------------


@pytest.mark.parametrize("direction", ["up", "down"])
def test_a_force_that_varies_along_the_sweep_follows_duffing(direction: str) -> None:
    freq = np.linspace(42.0, 62.0, 401)
    force = 8.0 * (1.0 + 0.6 * np.sin(freq / 3.0 + 2.5))
    shown = sine_response(duffing(1e9), None, freq, force, direction=direction, harmonics=1)  # type: ignore[arg-type]
    size = np.abs(shown.data[0, 0, 0]) * force
    roots = [amplitudes(2 * np.pi * f, float(p), 1e9) for f, p in zip(freq, force, strict=True)]
    nearest = np.array([r[np.argmin(np.abs(r - a))] for r, a in zip(roots, size, strict=True)])
    assert size == pytest.approx(nearest, rel=1e-7)
    assert max(r.size for r in roots) == 3
    constant = sine_response(duffing(1e9), None, freq, np.full(freq.size, 8.0), harmonics=1).data
    assert np.array_equal(constant, sine_response(duffing(1e9), None, freq, 8.0, harmonics=1).data)


@pytest.mark.parametrize("scatter", [0.01, 0.05])
@pytest.mark.parametrize("direction", ["up", "down"])
def test_a_force_that_scatters_from_line_to_line_is_followed(direction: str, scatter: float) -> None:
    """Measured forces do; a curve under a force with a corner at each line was given up in a third of all sweeps."""
    freq = np.arange(42.0, 62.0, 0.5)
    for seed in range(8):
        force = 8.0 * (1.0 + scatter * np.random.default_rng(seed).standard_normal(freq.size))
        shown = sine_response(duffing(1e9), None, freq, force, direction=direction, harmonics=1)  # type: ignore[arg-type]
        size = np.abs(shown.data[0, 0, 0]) * force
        roots = [amplitudes(2 * np.pi * f, float(p), 1e9) for f, p in zip(freq, force, strict=True)]
        left = np.array([np.abs(r / a - 1.0).min() for r, a in zip(roots, size, strict=True)])
        # Where a line's own force is less than a fold needs, the motion is that of the smooth force, in proportion.
        assert np.sort(left)[-3] < 1e-7
        assert left.max() < 2.0 * scatter


@pytest.mark.parametrize("stiffness3", [1e9, -1e9])
def test_a_held_response_is_duffing_on_its_backbone(stiffness3: float) -> None:
    # At a held amplitude A the cubic spring is one of k + ¾ k3 A²: H is that of a linear oscillator, without folds.
    freq, held = np.linspace(42.0, 62.0, 81), 2.5e-3
    shown = sine_response(duffing(stiffness3), None, freq, held, harmonics=1, controlled="response").data[0, 0, 0]
    w = 2 * np.pi * freq
    expected = 1.0 / (W0**2 + 0.75 * stiffness3 * held**2 - w**2 + 2j * ZETA * W0 * w)
    assert np.abs(shown - expected).max() < 1e-7 * np.abs(expected).max()
    # The shift is many times the width of the resonance.
    assert abs(0.375 * stiffness3 * held**2 / W0**2) > 2 * ZETA


def test_a_held_response_is_what_the_force_it_needs_comes_to() -> None:
    model, freq = two_masses("cubic_stiffness", "dry_friction"), np.arange(30.0, 60.0, 0.5)
    held = 20.0
    shown = sine_response(model, None, freq, held, harmonics=9, controlled="response")
    force = held / np.abs(shown.data[0, 0, 0])
    # Where the force alone has one answer, it is the same.
    there = sine_response(model, None, freq, force, harmonics=9)
    alike = np.abs(there.data - shown.data)[0, :, 0].max(axis=0) < 1e-6 * np.abs(shown.data).max()
    assert alike.mean() > 0.9
    for f in (38.0, 41.0):
        expected = by_stepping(model, f, float(force[freq == f][0]))
        assert (np.abs(shown.data[0, :, 0, freq == f][0] - expected) < 0.03 * np.abs(expected)).all()


@pytest.mark.parametrize("law", ["cubic_stiffness", "joint_slip"])
def test_derivatives_of_a_held_response_and_of_a_varying_force(law: str) -> None:
    model = two_masses(law)
    freq = np.arange(30.0, 60.0, 1.0)
    for asked in ({"controlled": "response", "amplitude": 40.0}, {"amplitude": 40.0 + freq}):

        def at(m: Structure, asked: dict[str, object] = asked) -> SineSweep:
            return SineSweep(m, None, freq, harmonics=5, **asked)  # type: ignore[arg-type]

        sweep = at(model)
        for path in [("scales", 2), ("scales", 0), *(("nonlinear", 0, "parameters", n) for n in LAWS[law])]:
            value = value_at(model, path)
            h = 1e-5 * abs(value)
            moved = [at(with_value(model, path, value + d)).data for d in (h, -h)]
            expected = (moved[0] - moved[1]) / (2 * h)
            assert np.abs(sweep.derivative(path) - expected).max() < 0.02 * np.abs(expected).max()


def test_a_sweep_from_another_port() -> None:
    freq = np.arange(30.0, 60.0, 1.0)
    model = two_masses("cubic_stiffness")
    plain = replace(model, nonlinear=())
    linear = frequency_response(plain, None, freq, inputs=["link"]).data
    assert (
        np.abs(sine_response(model, None, freq, 1e-3, input="link").data - linear).max() < 1e-6 * np.abs(linear).max()
    )
    hit = replace(model, input_port="link")
    one, other = (sine_response(model, None, freq, 300.0, input="link"), sine_response(hit, None, freq, 300.0))
    assert np.abs(one.data - other.data).max() < 1e-9 * np.abs(one.data).max()
    assert np.abs(one.data - linear).max() > 0.05 * np.abs(linear).max()


def test_amplitudes_that_fit_no_line_are_refused() -> None:
    with pytest.raises(ParameterError, match="each of the 2 lines"):
        sine_response(duffing(1e9), None, [40.0, 41.0], [1.0, 2.0, 3.0])
    with pytest.raises(ParameterError, match="controlled"):
        sine_response(duffing(1e9), None, [40.0, 41.0], 1.0, controlled="voltage")  # type: ignore[arg-type]
