"""The oracle of the trial: exact responses, the generator's prior, and posteriors that come true."""

import numpy as np
import pytest

pytest.importorskip("exudyn")

from cutvib_ss.validation.rig import draw_case
from cutvib_ss.validation.rig.assembly import assembled
from cutvib_ss.validation.rig.causes import FORMS
from cutvib_ss.validation.rig.chain_forms import CHAIN_FORMS
from cutvib_ss.validation.rig.evidence import WARMING, Marginal, calibration, warming, whitening
from cutvib_ss.validation.rig.motion import frequency_response
from cutvib_ss.validation.rig.oracle import MOVING, NONE, TUNED, Model, Seen, judged, knows, posterior, seen
from cutvib_ss.validation.rig.prior import Hypothesis, Script, hypotheses
from cutvib_ss.validation.rig.responses import covered, responses
from cutvib_ss.validation.rig.structure import Rig
from cutvib_ss.validation.statistics import calibration_error, calibration_error_if_perfect

PARTS = [
    (cause, form.name) for cause, forms in FORMS.items() if cause not in CHAIN_FORMS for form in forms
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("cause", "form"), PARTS)
def test_responses_are_those_of_the_finite_elements(cause: str, form: str) -> None:
    case = draw_case(5, "single", cause, form=form, severity=(1.0, 1.001))
    if not covered(case.rig):
        pytest.skip("not a machine that the oracle covers")
    s = 2.0 + 2j * np.pi * np.array([20.0, 25.0, 31.0, 48.0, 90.0, 130.0, 180.0, 215.0, 220.0, 240.0, 300.0, 440.0])
    exact = frequency_response(case.rig, assembled(case.rig, 0.37), s)
    quick, plain = (responses(rig, [0.37], s)[0] for rig in (case.rig, case.plain))
    size = np.abs(exact).max(axis=1, keepdims=True)
    assert np.abs((quick - exact) / size).max() < 2e-3
    assert np.abs((plain - exact) / size).max() > 0.1  # the cause is felt


def test_a_script_gives_a_form_its_draws_and_finds_all_its_choices() -> None:
    listed = hypotheses(Rig(), {"added_mass": 1.0}, (1.0, 1.0), varied=0.0)
    assert {(h.place, round(h.probability, 3)) for h in listed} == {
        ("tool", 0.375),
        ("tool", 0.125),
        ("head", 0.375),
        ("head", 0.125),
    }
    assert sum(h.probability for h in listed) == pytest.approx(1.0)
    machine = listed[0].machine(Rig(), np.array([0.0, 0.0]), (1.0, 1.0))
    assert isinstance(machine, Rig)
    assert machine != Rig()
    # a uniform draw is its distribution function
    script = Script([-1.0, 0.0, 1.0])
    assert [round(script.uniform(0.0, 1.0), 3) for _ in range(3)] == [0.159, 0.5, 0.841]
    every = hypotheses(Rig(), dict.fromkeys(FORMS, 1.0), (0.3, 2.0))
    assert {h.effect for h in every} >= {"rail_torsion", "guide_compliance", "channel_delay", "structural_damping"}
    assert not {h.effect for h in every} & {"freeplay", "dry_friction", "cubic_stiffness"}


def test_noise_of_neighbouring_lines_is_made_independent() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(8000) / 4000.0
    lines = np.round(np.arange(18.0, 450.1, 2.0) * 2).astype(int)
    noise = np.exp(-2.0 * time) * rng.standard_normal((300, 8000))
    shift = np.exp(2j * np.pi * lines / 2 * 0.052)
    spectra = np.fft.rfft(noise)[:, lines] * shift / np.sqrt(np.sum(np.exp(-4.0 * time)))
    bands = whitening(lines.size, 2.0, 2.0)
    white = bands[0] * spectra
    for j in range(1, len(bands)):
        white[:, j:] += bands[j, j:] * spectra[:, :-j]
    assert abs(np.mean(spectra[:, 1:] * spectra[:, :-1].conj())) > 0.25
    assert abs(np.mean(white[:, 1:] * white[:, :-1].conj())) < 0.05
    assert np.mean(np.abs(white[:, 5:]) ** 2) == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("value", [*range(len(MOVING)), "trend", "bow"])
def test_the_linear_model_of_movement_is_that_of_the_machine(value: int | str) -> None:
    s = np.asarray(2.0 + 2j * np.pi * np.arange(18.0, 450.1, 6.0))
    positions = (0.2, 0.45, 0.7)
    what = Seen(positions, (0, 1), s, np.ones((3, 2, s.size)), np.ones((3, 2, s.size)), np.ones(s.size, complex), 1)
    model, tuning, size = Model(Rig(), what, (0.3, 2.0)), np.full(len(TUNED), 0.5), 1e-5
    point, moved = np.zeros(len(TUNED) + 2), np.zeros((3, len(MOVING)))
    if isinstance(value, int):
        moved[:, value] = size * np.array([1.0, -2.0, 1.5])
        total = moved
    else:
        point[-2 if value == "trend" else -1] = size
        total = np.outer(point[-2:] @ warming(3), [float(name in WARMING) for name in MOVING])
    here = model.at(None, np.zeros(0), tuning)
    there = model.at(None, np.zeros(0), tuning, total)
    marginal = Marginal(what, 0.0)
    parts = marginal.parts(there - here, np.zeros((0, *here.shape)), model.slopes(None, tuning, here), here)
    assert parts.after(point, moved).square < 1e-3 * parts.square


def test_the_blows_of_a_campaign_leave_noise_alone_about_the_machine_that_was_struck() -> None:
    small = {"positions": (0.2, 0.6), "levels": (100.0,), "blows": 2, "overloads": 0}
    case = draw_case(5, "none", conditions=small)
    assert knows(case)
    what = seen(case.campaign)
    found = responses(case.rig, what.positions, what.s)[:, list(what.channels)]
    from cutvib_ss.validation.rig.chain import frequencies

    freq = frequencies()
    errors = case.campaign.errors[list(what.channels)]
    lines = what.s.imag / (2 * np.pi)
    shown = found * np.array([np.interp(lines, freq, e.real) + 1j * np.interp(lines, freq, e.imag) for e in errors])
    assert np.mean(np.abs((what.data - shown) / what.noise) ** 2) == pytest.approx(1.0, abs=0.15)
    told = posterior(case)
    assert sum(told.odds.values()) == pytest.approx(1.0)
    assert max(told.odds, key=lambda name: told.odds[name]) == NONE


MOVES = {0.0: 0.8, 0.0024: 0.2}


def simulated(rng: np.random.Generator, listed: tuple[Hypothesis, ...], none: float, severity: tuple[float, float]):
    """What would be seen of a machine drawn from the oracle's own prior, and what is wrong with it."""
    odds = np.array([none, *(h.probability for h in listed)])
    k = int(rng.choice(odds.size, p=odds / odds.sum()))
    drift = float(rng.choice(list(MOVES), p=list(MOVES.values())))
    s = np.asarray(2.0 + 2j * np.pi * np.arange(18.0, 450.1, 6.0))
    positions, channels = (0.2, 0.6), (0, 1)
    empty = Seen(positions, channels, s, np.zeros(0), np.zeros(0), np.ones(s.size, dtype=complex), 1)
    hypothesis = listed[k - 1] if k else None
    x = rng.standard_normal(hypothesis.dimension if hypothesis else 0)
    tuning = rng.standard_normal(len(TUNED))
    within = drift * np.sqrt(1 + 0.5 * 0.09)
    moving = np.array([TUNED.index(name) for name in MOVING])
    trend, bow = drift * rng.standard_normal(2) * (1.22, 0.37)
    data = []
    for i in range(len(positions)):
        own = tuning.copy()
        own[moving] += within / 0.01 * rng.standard_normal(moving.size)
        own[[TUNED.index(n) for n in ("k1", "k2", "first_frequency")]] += (trend * i + bow * i * (1 - i)) / 0.01
        here = Model(Rig(), empty, severity).at(hypothesis, x, own)[i]
        data.append(here * (1 + within * rng.standard_normal((len(channels), 1))))
    gain, phase = calibration(s.imag / (2 * np.pi))
    errors = rng.standard_normal((2, gain.shape[1])) @ gain.T + 1j * rng.standard_normal((2, gain.shape[1])) @ phase.T
    data = np.array(data) * (1 + errors)
    size = 0.02 * np.abs(data).mean(axis=2, keepdims=True) * np.ones(s.size)
    # the noise of neighbouring lines as it is: independent noise, made dependent
    white = (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
    bands = whitening(s.size, 6.0, 2.0)
    for line in range(s.size):
        for j in range(1, min(line, len(bands) - 1) + 1):
            white[..., line] -= bands[j, line] * white[..., line - j]
        white[..., line] /= bands[0, line]
    truth = NONE if hypothesis is None else (hypothesis.effect, hypothesis.place)
    return Seen(positions, channels, s, data + size * white, size, empty.coupling, 1), truth


@pytest.mark.slow
def test_on_its_own_draws_the_oracle_is_calibrated_and_beats_a_guess() -> None:
    rng = np.random.default_rng(8)
    severity, none = (0.03, 0.7), 0.3
    causes = dict.fromkeys(("guide_compliance", "tool_contact", "added_mass", "end_fixity", "cross_axis"), 0.14)
    listed = hypotheses(Rig(), causes, severity, varied=0.0)
    names = {NONE, *((h.effect, h.place) for h in listed)}
    stated, right, lost = [], [], []
    for _ in range(120):
        what, truth = simulated(rng, listed, none, severity)
        told = judged(Rig(), what, listed, none, MOVES, severity).odds
        first = max(told, key=lambda name: told[name])
        stated.append(min(told[first], 1.0))
        right.append(first == truth)
        lost.append(-np.log(max(told.get(truth, 0.0), 1e-6)))
    # As often right as it says, within what chance allows, over all and where it is sure and where it is not.
    p, hit = np.array(stated), np.array(right)
    for own in (p > 0, p >= 0.9, p < 0.9):
        deviation = np.sqrt(np.sum(p[own] * (1 - p[own])))
        assert abs(hit[own].sum() - p[own].sum()) < 2.6 * deviation + 0.5
    _, bound = calibration_error_if_perfect(stated)
    assert calibration_error(stated, right) <= 1.25 * bound
    assert np.mean(p < 0.9) > 0.1  # some cases are hard
    assert np.mean(lost) < np.log(len(names))  # better than a uniform guess
