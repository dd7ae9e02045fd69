"""Springs that are neither odd nor of one power: causes of the catalogue in further forms."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.diagnosis import ranking
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import in_further_form, rival_in_further_form
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Measured, Model, Motion
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.restoring_forces import law
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from tests.unit.struck_oscillator import DAMPING, FINE, MASS, OSCILLATOR, SPRING
from tests.unit.test_diagnosis_kindred import fitted

Force = Callable[[float, float], float]
CUBIC, SQUARE = 4e9, 1.5e6


def bowed(x: float, v: float) -> float:
    return SPRING * x + CUBIC * x**3 + SQUARE * x**2


def saturating(x: float, v: float) -> float:
    return SPRING * (0.6 * x + 0.4 * 2e-3 * np.tanh(x / 2e-3))


def bumping(x: float, v: float) -> float:
    """Round stops on both sides of the spring, which lose energy: Hertz' contact, as Hunt and Crossley have it."""
    depth = max(abs(x) - 1e-3, 0.0)
    return SPRING * x + float(np.copysign(SPRING * 15.0 * depth**1.5 * (1.0 + 0.5 * np.copysign(v, x * v)), x))


def diagnosed(force_of: Force) -> cv.Diagnosis:
    """Blows on the oscillator with that force in place of its spring, by semi-implicit Euler steps of a sixteenth of a sample."""
    rng, fs, count, records = np.random.default_rng(7), 1024.0, 1024, []
    fine, step = np.arange(count * FINE) / (FINE * fs), 1.0 / (FINE * fs)
    for k, level in enumerate((60.0, 200.0, 600.0)):
        histories = []
        for _ in range(3):
            force = level * rng.uniform(0.9, 1.1) * np.sin(np.pi * np.clip((fine - 0.05) / 0.006, 0.0, 1.0)) ** 2
            x = v = 0.0
            response = np.empty(force.size)
            for i, f in enumerate(force.tolist()):
                response[i] = (f - DAMPING * v - force_of(x, v)) / MASS
                v += step * response[i]
                x += step * v
            seen = response[::FINE] + 0.02 * rng.standard_normal(count)
            histories.append(History(fs, force[::FINE] + 0.02 * rng.standard_normal(count), seen[None], ("a",)))
        records.append(Record(f"r{k}", "impact", None, level, None, ("a",), ("acceleration",), tuple(histories)))
    return cv.diagnose(Campaign("", Path(), OSCILLATOR, tuple(records), ()))


def test_a_cubic_spring_off_its_middle_is_sure() -> None:
    """A slot that stiffens, slightly asymmetrically, had the largest error of its prior, and 0.60."""
    best = diagnosed(bowed).causes[0]
    assert best.effect == "cubic_stiffness"
    assert best.probability > 0.9
    assert best.parameters["stiffness3"].value == pytest.approx(CUBIC, rel=0.1)
    quadratic = 3.0 * best.parameters["stiffness3"].value * best.parameters["offset"].value
    assert quadratic == pytest.approx(SQUARE, rel=0.1)


@pytest.mark.slow
def test_a_spring_that_softens_to_another_stiffness_is_sure() -> None:
    best = diagnosed(saturating).causes[0]
    assert best.effect == "cubic_stiffness"
    assert best.probability > 0.9


@pytest.mark.slow
def test_stops_that_lose_energy_are_named() -> None:
    """In its textbook form a cubic spring led, and in a further one it errs as much."""
    best = diagnosed(bumping).causes[0]
    assert best.effect == "freeplay"
    assert best.probability > 0.5
    assert best.parameters["beside"].value
    assert best.parameters["contact_damping"].value == pytest.approx(0.5, rel=0.2)


def test_each_form_is_a_special_case_of_the_further_one() -> None:
    cubic = CubicStiffness("spring", -1e9)
    further = cubic.further(1e-3)
    assert further is not None
    assert further.further(1e-3) is None
    x = np.linspace(-1e-3, 1e-3, 9)
    plain = [law(e.effect)(**e._parameters()).force(x, 0.0 * x) for e in (cubic, replace(further, exponent=3.0))]
    assert plain[1] == pytest.approx(plain[0] * further.stiffness3 / cubic.stiffness3, rel=1e-12)
    with pytest.raises(ParameterError, match="go together"):
        replace(further, exponent=None)
    # As strong where it is strong.
    end = [float(law(e.effect)(**e._parameters()).force(7e-4, 0.0)) for e in (cubic, further)]
    assert end[1] == pytest.approx(end[0], rel=1e-12)
    play = Freeplay("spring", 1e-4, 1e5)
    worn = play.further(1e-3)
    assert worn is not None
    gaps = [
        law("freeplay")(**e._parameters(), stiffness=1e5).force(x, 0.0 * x)
        for e in (play, replace(worn, rounding=1e-9))
    ]
    assert gaps[1] == pytest.approx(gaps[0], rel=1e-6, abs=1e-9)


def test_clearance_of_a_part_of_a_spring_has_further_forms_too() -> None:
    worn = Freeplay("spring", 1e-4, 2e4, 3e-5, 0.4, within=True)
    [element] = worn.apply(OSCILLATOR).nonlinear
    assert element.parameters == {"gap": 1e-4, "stiffness": 2e4, "offset": 3e-5, "rounding": 0.4}


def test_stops_with_play_leave_the_spring_as_it_is() -> None:
    stops = Freeplay("spring", 1e-4, 5e4, rounding=0.2, beside=True)
    [element] = stops.apply(OSCILLATOR).nonlinear
    x = np.array([-3e-4, 0.0, 3e-4])
    assert element.restoring_force.force(x, 0.0 * x) == pytest.approx(5e4 * np.sign(x) * 2e-4, rel=0.02)
    # On one side alone they are another effect.
    assert stops.further(1e-3) is None
    further = replace(stops, rounding=None).further(1e-3)
    assert further is not None
    assert further.offset is None
    with pytest.raises(ParameterError, match="not both"):
        replace(stops, within=True)
    with pytest.raises(ParameterError, match="beside the spring it takes a contact_stiffness"):
        replace(stops, contact_stiffness=None)
    motion = Motion(1e-4, 1e-3, 0.1)
    started = dict(Freeplay.starts(OSCILLATOR, Measured(motions={"spring": motion})))
    assert list(started) == ["spring", "spring within"]
    beside = [isinstance(e, Freeplay) and e.beside for e in started["spring"]]
    assert 0 < sum(beside) < len(beside)


def test_stops_are_anywhere_and_as_large_as_they_are_stiff() -> None:
    system = SecondOrder(np.eye(1), np.eye(1), np.zeros((1, 1)), ("x",), {"gap": np.ones(1)})
    free = Structure(system, {"a": Channel("gap", "acceleration")}, "gap")
    assert Freeplay.places(free) == ("gap",)
    started = dict(Freeplay.starts(free, Measured(motions={"gap": Motion(1e-4, 1e-3, 0.1, 0.1)})))
    stops = [e for e in started["gap"] if isinstance(e, Freeplay)]
    assert stops
    assert all(e.beside and e.contact_stiffness for e in stops)
    # A force of 0.1 N over the middle of motions from 0.1 to 1 mm is 316 N/m.
    assert {round(e._contact) for e in stops} == {95, 949, 9487}
    with pytest.raises(ParameterError, match="there is none at 'gap'"):
        Freeplay("gap", 1e-4).apply(free)
    [half] = {stops[0].at(0.5)}
    assert half.contact_stiffness == pytest.approx(0.5 * stops[0]._contact)
    assert half.gap == stops[0].gap
    assert list(stops[0].by_size()) == ["contact_stiffness"]
    assert list(Freeplay("spring", 1e-4).by_size()) == ["gap"]


def test_contact_damping_takes_round_corners() -> None:
    with pytest.raises(ParameterError, match="give a rounding"):
        law("freeplay")(1e-4, 1e5, contact_damping=1.0)
    lossy = law("freeplay")(1e-4, 0.0, 1e5, rounding=1e-3, contact_damping=2.0)
    q, v = np.array([5e-5, 3e-4, 3e-4, -3e-4]), np.array([0.1, 0.1, -0.1, 0.1])
    # As it closes more than as it opens, and next to nothing within the gap.
    assert lossy.force(q, v) == pytest.approx([0.0, 20.0 * 1.2, 20.0 * 0.8, -20.0 * 0.8], abs=1e-3)


def test_a_rival_in_its_further_form_has_to_lead_on_few_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    cubic, play = CubicStiffness("spring", 1e9), Freeplay("spring", 1e-4, 1e5, beside=True)
    friction = fitted("dry_friction spring", 0.0, DryFriction("spring", 1.0))
    best = fitted("cubic_stiffness spring", 0.0, cubic, motion=1e-3, place="spring")
    rough = [(Candidate(r.name, ()), r.fit) for r in (friction, best, fitted("freeplay spring", 0.0, play))]
    costs, asked = {"cubic_stiffness": 10.0, "freeplay": 5.0}, []

    def refit(nominal: object, records: object, hypothesis: Hypothesis, x: np.ndarray, steps: int) -> Fit:
        asked.append((records, hypothesis.effects))
        return replace(best.fit, hypothesis=hypothesis, log_evidence=-0.5 * costs[hypothesis.effect])

    monkeypatch.setattr(ranking, "refit", refit)
    few, records = cast(Records, "few"), cast(Records, "all")
    with Workers() as workers:
        [found] = rival_in_further_form(cast(Model, None), records, few, best, rough, workers)
        assert asked == [("few", (e.further(1e-3),)) for e in (cubic, play)] + [("all", (play.further(1e-3),))]
        assert found.name == "freeplay spring"
        costs["freeplay"] = 20.0
        assert not rival_in_further_form(cast(Model, None), records, few, best, rough, workers)
        assert not rival_in_further_form(cast(Model, None), records, few, best, rough[:2], workers)
        monkeypatch.setattr(ranking, "refit", lambda *given, **more: None)
        assert not rival_in_further_form(cast(Model, None), records, few, best, rough, workers)


def test_what_leads_is_fitted_in_its_further_form_from_where_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refit(nominal: object, records: object, hypothesis: Hypothesis, x: np.ndarray, steps: int, near: Fit) -> Fit:
        asked.append((hypothesis.effects, x.tolist()))
        return near

    monkeypatch.setattr(ranking, "refit", refit)
    mass, cubic = AddedMass("spring", 0.1), CubicStiffness("spring", 1e9)
    best = fitted("added_mass spring + cubic_stiffness spring", 0.0, mass, cubic, motion=1e-3, place="spring")
    [again] = in_further_form(cast(Model, None), cast(Records, None), best)
    assert again.name == best.name
    assert asked == [((mass, cubic.further(1e-3)), [0.0, 1.0, 2.0])]
    for other in (fitted("added_mass spring", 0.0, mass), fitted("none", 0.0)):
        assert in_further_form(cast(Model, None), cast(Records, None), other) == []
