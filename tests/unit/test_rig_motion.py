"""The trial's machine in motion: what the quick way computes is what exudyn steps."""

import numpy as np
import pytest

pytest.importorskip("exudyn")

from cutvib_ss.validation.rig import motion
from cutvib_ss.validation.rig.blows import FINE, FS, Blow, Pulse, antialiased
from cutvib_ss.validation.rig.cases import draw_case
from cutvib_ss.validation.rig.fittings import Bob, Law, Spring, Supports, Twist
from cutvib_ss.validation.rig.motion import (
    CONVERGED,
    SENSITIVE,
    NotConvergedError,
    converged_answer,
    frequency_response,
    linear_answer,
    nonlinear_answer,
)
from cutvib_ss.validation.rig.multibody import build, linearise
from cutvib_ss.validation.rig.structure import CHANNELS, Head, Rig
from tests.unit.exudyn_stepping import stepped

POSITION = 0.3333
K2 = Head().k2


def pulse(peak: float, fs: float, duration: float) -> np.ndarray:
    time = np.arange(round(duration * fs) + 1) / fs
    phase = np.clip((time - 0.001) / 0.003, 0.0, 1.0)
    return peak * np.sin(np.pi * phase) ** 1.3


def band(histories: np.ndarray, fs: float) -> np.ndarray:
    """Spectra between 15 and 450 Hz."""
    freq = np.fft.rfftfreq(histories.shape[-1], 1 / fs)
    return np.fft.rfft(histories, axis=-1)[..., (freq > 15) & (freq < 450)]


def difference(one: np.ndarray, other: np.ndarray, fs: float) -> float:
    return float(np.linalg.norm(band(one - other, fs)) / np.linalg.norm(band(other, fs)))


def test_the_head_has_the_papers_mass_matrix() -> None:
    h = Head()
    machine = linearise(build(Rig(), POSITION))
    a, b = np.deg2rad(h.theta01_deg), np.deg2rad(h.theta01_deg + h.theta02_deg)
    cosine = np.cos(b - a)
    m12 = h.m2 * h.l2 * (h.l2 + h.l1 * cosine)
    m13 = h.m2 * h.l2 * np.cos(b) + (h.m1 + h.m2) * h.l1 * np.cos(a)
    expected = [  # Eq. 2, over base, theta1, theta2; the rail's own mass on the base left out
        [m13, h.m2 * h.l2 * np.cos(b)],
        [h.m2 * (h.l1**2 + h.l2**2 + 2 * h.l1 * h.l2 * cosine) + h.m1 * h.l1**2, m12],
        [m12, h.m2 * h.l2**2],
    ]
    assert machine.mass[:3, 1:3] == pytest.approx(np.array(expected), rel=1e-8, abs=1e-10)
    tool_z = -h.l1 * np.sin(a) - h.l2 * np.sin(b)  # Eq. 13
    assert machine.ports["tool_z"][:3] == pytest.approx([0.0, tool_z, -h.l2 * np.sin(b)], abs=1e-9)


@pytest.mark.parametrize(
    "law",
    [
        None,
        Law("joint2", "cubic", (1e10,)),
        Law("joint2", "freeplay", (2e-5, K2)),
        Law("joint2", "jenkins", (0.1, 3e3)),
        Law("joint2", "jenkins", (0.1, 60 * K2)),
        Law("joint2", "bilinear", (0.2 * K2,)),
        Law("joint2", "quadratic_damping", (2.0,)),
        Law("joint1", "jenkins", (0.5, 2e5)),
    ],
    ids=lambda law: law and f"{law.kind}-{law.port}-{law.values[-1]:.3g}",
)
def test_the_quick_way_is_what_exudyn_steps(law: Law | None) -> None:
    # 15 N: the large rotations that only exudyn knows are then a few parts in ten thousand
    # exudyn's own steps must be shorter where a slider sticks: its difference to the quick way falls from 1.1e-3 at 64 kHz to 2e-4
    fs, peak = 128000.0 if law and law.kind == "jenkins" else 64000.0, 15.0
    force = pulse(peak, fs, 0.03)
    rig = Rig().fitted(laws=(law,) if law else ())
    quick = rig.fitted(laws=(law or Law("joint2", "cubic", (0.0,)),))
    reference = stepped(rig, POSITION, force, fs)
    answer = nonlinear_answer(quick, linearise(build(quick, POSITION, 2500.0)), force, fs)
    assert difference(answer, reference, fs) < 1e-3
    if law:
        linear = nonlinear_answer(
            quick.fitted(laws=(Law("joint2", "cubic", (0.0,)),)), linearise(build(rig, POSITION, 2500.0)), force, fs
        )
        assert difference(linear, reference, fs) > 5e-3  # the element is felt


def test_rotations_of_the_head_are_felt_in_proportion_to_the_force() -> None:
    fs = 64000.0
    rig = Rig().fitted(laws=(Law("joint2", "cubic", (0.0,)),))
    machine = linearise(build(rig, POSITION, 2500.0))
    errors = []
    for peak in (15.0, 150.0):
        force = pulse(peak, fs, 0.02)
        errors.append(difference(nonlinear_answer(rig, machine, force, fs), stepped(Rig(), POSITION, force, fs), fs))
    assert errors[1] < 3e-3
    assert errors[1] / errors[0] == pytest.approx(10.0, rel=0.1)


def test_a_machine_with_everything_on_it_rests_when_nothing_strikes_it() -> None:
    rig = Rig().fitted(
        supports=Supports(1e7, 2e7),
        twist=Twist(0.05, 0.5, 220.0, 0.02),
        guide=(1e8, 1e3),
        bobs=(Bob("tool_x", 0.05, 180.0, 0.02), Bob("head_z", 0.5, 180.0, 0.02)),
        springs=(Spring(("tool", "ground"), "x", 1e5, 10.0), Spring(("tool", "base"), "z", 1e5, 10.0)),
        coupling=500.0,
    )
    rest = stepped(rig, POSITION, np.zeros(100), 1e6)
    # what is left is rounding: 1e-9 m of stretch of a spring of 1e5 N/m would show as 1e-4
    assert np.abs(rest).max() < 1e-6


def test_both_quick_ways_agree_on_a_linear_machine() -> None:
    force = Blow((Pulse(0.05, 50.0, 2.8e-3, -0.1),)).force()
    rig = Rig().fitted(laws=(Law("joint2", "cubic", (0.0,)),))
    machine = linearise(build(rig, POSITION))
    in_time = antialiased(nonlinear_answer(rig, machine, force, FS * FINE))
    in_frequency = linear_answer(Rig(), machine, antialiased(force)[None], FS)[0]
    scale = np.abs(in_frequency).max(axis=1, keepdims=True)
    early = slice(0, round(2.0 * FS))
    assert np.abs((in_time - in_frequency)[:, early] / scale).max() < 5e-6


@pytest.mark.parametrize(
    "law",
    [
        Law("joint2", "freeplay", (2e-5, K2)),
        Law("joint2", "jenkins", (0.2, 60 * K2)),
        Law("rail_left", "lift_off", (2e9, 4.0)),
    ],
    ids=lambda law: law.kind,
)
def test_the_time_step_has_converged(law: Law) -> None:
    rig = Rig().fitted(laws=(law,))
    if law.kind == "lift_off":
        rig = rig.fitted(supports=Supports(2e9, 1e10))
    machine = linearise(build(rig, POSITION))
    answers = []
    for fs in (FS * FINE, 4 * FS * FINE):
        force = pulse(50.0, fs, 0.5)
        answers.append(band(nonlinear_answer(rig, machine, force, fs)[:, :: round(fs / FS / FINE)], FS * FINE))
    # an end that lands on a pin rattles: landings fall between steps
    tolerance = 1e-3 if law.kind == "lift_off" else 1e-4
    assert np.linalg.norm(answers[0] - answers[1]) / np.linalg.norm(answers[1]) < tolerance


NOISE = (0.02, 0.02, 0.02)
HARD = Blow((Pulse(0.05, 150.0, 2.8e-3, -0.1),))


def test_friction_beside_a_compliant_guide_is_integrated_where_a_fixed_point_diverges() -> None:
    # what a force does to its own port within a step, times the slope of the force: 1.9, so f <- F(y + A f) runs away
    rig = Rig().fitted(guide=(5e7, 1e3), laws=(Law("joint1", "jenkins", (3.0, 60 * Head().k1)),))
    machine = linearise(build(rig, POSITION))
    found = converged_answer(rig, machine, HARD, NOISE)
    response, fine = found.response, found.steps
    assert found.error <= CONVERGED
    assert found.sensitivity == 0.0
    finest = antialiased(nonlinear_answer(rig, machine, HARD.force(8 * fine), FS * 8 * fine), 8 * fine)
    assert np.sqrt(np.mean((response - finest) ** 2)) < CONVERGED * NOISE[0]
    alone = rig.fitted(laws=())
    linear = linear_answer(alone, machine, antialiased(HARD.force())[None], FS)[0]
    assert np.sqrt(np.mean((response - linear) ** 2)) > 20 * NOISE[0]


def test_a_blow_that_has_not_converged_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = Rig().fitted(laws=(Law("joint2", "freeplay", (2e-5, K2)),))
    machine = linearise(build(rig, POSITION))
    monkeypatch.setattr(motion, "STEPS", (16, 32))
    with pytest.raises(NotConvergedError, match=r"freeplay: at steps of 1/128000 s \d.* of the noise is still wrong"):
        converged_answer(rig, machine, HARD, (1e-7,) * 3)


@pytest.mark.slow
def test_a_joint_that_rests_in_its_clearance_is_unstable_and_not_badly_integrated() -> None:
    # Resonators keep joint 1 moving within its clearance: what two runs differ by grows there by a factor of 1e5.
    case = draw_case(1226124233, "pair", "freeplay+local_resonator", traits=("varied",))
    level = int(np.argmax(case.conditions.levels))
    rig, machine = case.campaign.machine(level)
    blow, noise = case.campaign.blows[level][0], case.conditions.noise
    fine = 32
    runs = [
        antialiased(nonlinear_answer(rig, machine, blow.force(fine) * (1 + change), FS * fine), fine)
        for change in (0.0, 1e-8, SENSITIVE)
    ]
    first, least, little = ((run - runs[0]) / np.array(noise)[:, None] for run in runs)
    assert not first.any()
    early = slice(0, round(0.25 * FS))
    # Right after the blow a hundredth of the change has a hundredth of the effect, far below the noise ...
    assert np.abs(little[:, early]).max() < 0.01
    assert np.abs(little[:, early]).max() / np.abs(least[:, early]).max() == pytest.approx(100.0, rel=0.05)
    # ... and a second later a hundred millionth of the force shows.
    grown = np.sqrt(np.mean(least**2, axis=1)).max()
    assert grown > 1e3 * np.sqrt(np.mean(least[:, early] ** 2, axis=1)).max()
    found = converged_answer(rig, machine, blow, noise)
    assert found.sensitivity > found.error > CONVERGED


def test_modes_give_what_the_matrices_give() -> None:
    machine = linearise(build(Rig(), POSITION))
    s = 2j * np.pi * np.linspace(5.0, 1500.0, 400)
    dynamic = s[:, None, None] ** 2 * machine.mass + s[:, None, None] * machine.damping + machine.stiffness
    motion = np.linalg.solve(dynamic, machine.ports["tool_x"][None, :, None])[..., 0]
    direct = np.array([motion @ machine.ports[name] for name in CHANNELS]) * s**2
    assert np.abs(frequency_response(Rig(), machine, s) - direct).max() < 1e-9 * np.abs(direct).max()
