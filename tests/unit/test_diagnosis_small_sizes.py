"""Sizes of causes beside a fit, and the evidence of those that are too small to be seen."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypotheses import candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.posterior import that_may_hide
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.scouting import _from_tuning, beside_tuned, relieved, tuned_away
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.small_sizes import scan_beside, small_sizes, weak
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.prior import Range
from cutvib_ss.response.frequency import frequency_response
from tests.unit.test_diagnosis_drift import CHANNELS, FREQ, campaign
from tests.unit.test_diagnosis_drift import MACHINE as DRIFTING
from tests.unit.test_diagnosis_limits import COUNTS, MACHINE, measured


@pytest.mark.parametrize("scale", ["log", "linear", "asinh", "ratio"])
def test_a_density_is_that_of_values_drawn_from_the_prior(scale: str) -> None:
    bounds = Range("kg", 0.01 if scale in ("log", "ratio") else -0.3, 8.0, scale)
    drawn = np.array([bounds.at(u) for u in (np.arange(200_000) + 0.5) / 200_000])
    for mean, std in ((0.05, 0.02), (0.002, 0.05), (3.0, 0.01), (3.0, 1.0)):
        normal = np.exp(-0.5 * ((drawn - mean) / std) ** 2) / (np.sqrt(2.0 * np.pi) * std)
        assert bounds.density(mean, std) == pytest.approx(normal.mean(), rel=0.02)


def test_a_size_of_either_sign_is_even_in_its_logarithm() -> None:
    bounds = Range("kg", -8.0, 8.0, "asinh")
    each = [np.mean([low < abs(bounds.at(u)) < 10.0 * low for u in np.linspace(0, 1, 4001)]) for low in (0.08, 0.8)]
    assert each[0] == pytest.approx(each[1], rel=0.02)
    normal = Range("rad", 0.0, 0.3, "normal")
    assert normal.density(0.0, 0.4) == pytest.approx(1.0 / (np.sqrt(2.0 * np.pi) * 0.5))


@pytest.mark.parametrize("mass", [0.0, 0.03])
def test_evidence_is_the_integral_over_the_prior_of_the_size(mass: float) -> None:
    records, observed = measured(3e-3, mass)
    bounds = AddedMass.ranges(MACHINE, "tool")["mass"]
    none, named = fit(MACHINE, records, Hypothesis()), fit(MACHINE, records, Hypothesis((AddedMass("tool", 0.02),)))
    m = named.hypothesis.effects[0].mass
    std = named.stds["0.mass"]

    def likelihood(x: float) -> float:
        """Of a mass beside that of none, all that the fit may move being fitted anew."""
        return float(
            np.exp(fit(AddedMass("tool", x).apply(MACHINE), records, Hypothesis()).log_evidence - named.log_evidence)
        )

    inside = np.unique(np.clip(m + std * np.linspace(-4.0, 4.0, 25), bounds.low, bounds.high))
    weight = [likelihood(x) * bounds.density(x, 1e-9 + 1e-3 * std) for x in inside]
    assert np.log(integrate.trapezoid(weight, inside)) == pytest.approx(0.0, abs=0.35)
    if mass == 0.0:
        # To first order, on some of the lines, it is the same.
        (size,) = next(s for s in small_sizes(MACHINE, none, records, observed) if s[0].cause == ("added_mass", "tool"))
        assert np.log(size.evidence) == pytest.approx(named.log_evidence - none.log_evidence, abs=0.7)


def test_a_small_cause_is_found_beside_the_tuned_model() -> None:
    late = 2e-5
    records, _ = measured(3e-3, model=ChannelDelay("measurement", channel="all", delay=late).apply(MACHINE))
    none = fit(MACHINE, records, Hypothesis())
    # Calibration has taken up nearly all of it.
    assert none.reduced < SETTINGS.search_enough
    assert not none.tuned_away
    found = beside_tuned(
        MACHINE,
        records,
        Ranked("none", none, True),
        candidates(MACHINE, (16.0, 300.0), ("tool_x", "base_x")),
        Workers(1),
    )
    best = max(found, key=lambda r: r.fit.log_evidence)
    assert best.name == "channel_delay all"
    assert best.fit.log_evidence > none.log_evidence
    assert abs(best.fit.hypothesis.effects[0].delay - late) < 3.0 * best.fit.stds["0.delay"]
    assert all(r.refined for r in found)


def test_a_second_cause_that_gains_take_up_is_found_beside_the_first() -> None:
    # One session alone tells no gain from a drift: the machine is known to repeat.
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-4))
    wrong = CalibrationError("measurement", channel="all", gain=0.93).apply(steady)
    records, _ = measured(3e-3, 0.3, wrong)
    alone = fit(steady, records, Hypothesis((AddedMass("tool", 0.3),)))
    # The residual is noise: only the gains, seven times their tolerance off, tell that something is missing.
    assert alone.reduced < SETTINGS.search_enough
    assert alone.calibrated_away == set(CHANNELS)
    others = [c for c in candidates(steady, (16.0, 300.0), CHANNELS) if c.name != "added_mass tool"]
    missed = [c for c in others if tuned_away(steady, alone, c.starts[0])]
    assert {"calibration_error all", "calibration_error tool_x"} < {c.name for c in missed} < {c.name for c in others}
    found = beside_tuned(steady, records, Ranked("added_mass tool", alone, True), missed, Workers(1))
    best = max(found, key=lambda r: r.fit.log_evidence)
    assert best.name == "added_mass tool + calibration_error all"
    assert best.fit.log_evidence > alone.log_evidence + SETTINGS.search_caught
    assert abs(best.fit.hypothesis.effects[1].gain - 0.93) < 3.0 * best.fit.stds["1.gain"]


@pytest.mark.parametrize(
    ("wrong", "name"),
    [
        (ParameterShift("joint2", "k2", 1.06), "parameter_shift joint2.k2"),
        (AddedMass("tool", 0.06), "added_mass tool"),
    ],
)
def test_a_cause_starts_with_all_that_a_value_is_out_of_its_tolerance_by(wrong: Effect, name: str) -> None:
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-4))
    records, _ = measured(3e-3, model=wrong.apply(steady))
    none = fit(steady, records, Hypothesis())
    assert none.reduced < SETTINGS.search_enough
    assert none.tuned_away
    cause = next(c for c in candidates(steady, (16.0, 300.0), CHANNELS) if c.name == name)
    started, x = _from_tuning(steady, scan_beside(steady, records, none), none, cause.starts[0])
    # It is the tuned model under another name, with the value itself in the middle of its prior.
    one, other = (
        frequency_response(m, [0.45], FREQ, outputs=CHANNELS).data
        for m in (none.model, started.apply(problem_for(steady, records, Hypothesis()).tuned(x)))
    )
    assert np.sum(np.abs(one - other) ** 2) < 1e-12 * np.sum(np.abs(one) ** 2)
    assert np.abs(x[: none.n_tuning]).max() < SETTINGS.fit_tuned_away
    (found,) = beside_tuned(steady, records, Ranked("none", none, True), [cause], Workers(1))
    assert found.fit.log_evidence > none.log_evidence + SETTINGS.search_caught


def test_a_second_cause_is_looked_for_beside_one_that_errs_by_more_than_most() -> None:
    """A shear ratio with an error of 0.1 held a resonator of 0.12 kg at the tool, and was named alone with 1.00."""
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-4))
    late = ChannelDelay("measurement", channel="all", delay=2e-5)
    both = late.apply(AddedMass("tool", 0.3).apply(steady))
    records, _ = measured(3e-3, model=both)
    linear = candidates(steady, (16.0, 300.0), CHANNELS)
    alone = fit(steady, records, Hypothesis((AddedMass("tool", 0.3),)))
    assert alone.reduced < SETTINGS.search_enough

    def seconds(size: float) -> dict[str, float]:
        spread = replace(alone.spread, sizes=replace(alone.spread.sizes, cause=size))
        erring = Ranked("added_mass tool", replace(alone, spread=spread), True)
        return {r.name: r.fit.log_evidence for r in relieved(steady, records, erring, linear, Workers(1))}

    assert "added_mass tool + channel_delay all" not in seconds(0.01)
    found = seconds(0.1)
    assert max(found, key=lambda name: found[name]) == "added_mass tool + channel_delay all"
    assert found["added_mass tool + channel_delay all"] > alone.log_evidence + SETTINGS.search_caught


def test_what_makes_up_for_an_error_at_the_place_of_a_cause_is_its_form(monkeypatch: pytest.MonkeyPatch) -> None:
    records, _ = measured(3e-3, 0.3)
    alone = fit(MACHINE, records, Hypothesis((AddedMass("tool", 0.3),)))
    spread = replace(alone.spread, sizes=replace(alone.spread.sizes, cause=0.1))
    erring = Ranked("added_mass tool", replace(alone, spread=spread), True)

    def ahead(place: str, by: float) -> Ranked:
        both = Hypothesis((AddedMass("tool", 0.3), LocalResonator(place, 0.1, 100.0, 0.02)))
        fitted = replace(alone, hypothesis=both, log_evidence=alone.log_evidence + by)
        return Ranked(f"added_mass tool + local_resonator {place}", fitted, True)

    linear = candidates(MACHINE, (16.0, 300.0), CHANNELS)
    for here, named in ((160.0, []), (60.0, ["tool", "head"])):
        beside = [ahead("tool", here), ahead("head", 80.0)]
        monkeypatch.setattr("cutvib_ss.diagnosis.scouting.beside_tuned", lambda *args, beside=beside: beside)
        monkeypatch.setattr("cutvib_ss.diagnosis.scouting.refit", lambda *args: None)
        found = relieved(MACHINE, records, erring, linear, Workers(1))
        assert [r.name.split()[-1] for r in found] == named


def test_neither_a_length_nor_what_stands_beside_a_force_that_errs_is_a_second_cause_in_the_tuning() -> None:
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-4))
    longer = ParameterShift("head", "l1", 1.03).apply(steady)
    records, _ = measured(3e-3, 0.3, longer)
    linear = candidates(steady, (16.0, 300.0), CHANNELS)
    alone = fit(steady, records, Hypothesis((AddedMass("tool", 0.3),)))
    assert alone.reduced < SETTINGS.search_enough
    assert tuned_away(steady, alone, ParameterShift("head", "l1", 1.0))
    found = relieved(steady, records, Ranked("added_mass tool", alone, True), linear, Workers(1))
    assert all("l1" not in r.name for r in found)
    # For the form of a restoring force that errs tuning may make up.
    erring = replace(alone.spread, sizes=replace(alone.spread.sizes, cause=0.1))
    spring = replace(alone, hypothesis=Hypothesis((CubicStiffness("joint2", 1e9),)), spread=erring)
    assert relieved(steady, records, Ranked("cubic_stiffness joint2", spring, True), linear, Workers(1)) == []


def test_a_damping_is_a_second_cause_beside_a_linear_one() -> None:
    """A window beside a rail's damping of 2.5 times the model's was named alone, with 0.97, and the damping only warned of."""
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-4))
    records, _ = measured(3e-3, 0.3, ParameterShift("rail", "damping_ratio", 9.0).apply(steady))
    linear = candidates(steady, (16.0, 300.0), CHANNELS)
    alone = fit(steady, records, Hypothesis((AddedMass("tool", 0.3),)))
    assert alone.reduced < SETTINGS.search_enough
    found = relieved(steady, records, Ranked("added_mass tool", alone, True), linear, Workers(1))
    best = max(found, key=lambda r: r.fit.log_evidence)
    assert best.name == "added_mass tool + parameter_shift rail.damping_ratio"
    assert best.fit.log_evidence > alone.log_evidence + SETTINGS.search_caught
    # What rubs shows as damping, too.
    spring = replace(alone, hypothesis=Hypothesis((CubicStiffness("joint2", 1e9),)))
    beside = relieved(steady, records, Ranked("cubic_stiffness joint2", spring, True), linear, Workers(1))
    assert all("damping" not in r.name for r in beside)


def test_a_weak_cause_has_the_sign_of_its_estimate_where_it_may() -> None:
    records, _ = measured(3e-3, -0.1)
    tuned = fit(MACHINE, records, Hypothesis())
    assert tuned.reduced < SETTINGS.search_enough
    scan = scan_beside(MACHINE, records, tuned)
    # The machine lacks mass, and a resonator's cannot be negative.
    assert -0.1 < weak(MACHINE, scan, AddedMass("tool", 0.1)).mass < 0.0
    assert weak(MACHINE, scan, LocalResonator("tool", 0.1, 400.0, 0.02)).mass > 0.0


@pytest.mark.parametrize(
    ("place", "error", "tried"),
    [("joint2", 0.01, ["added_mass head"]), ("joint2", 0.03, []), ("head", 0.01, [])],
)
def test_beside_a_restoring_force_of_the_right_form_a_cause_takes_over_what_tuning_stands_for(
    monkeypatch: pytest.MonkeyPatch, place: str, error: float, tried: list[str]
) -> None:
    """A mass of 1.3 kg on the head was 7.6 tolerances of the head's own, beside a quadratic damper with 0.60."""
    records, _ = measured(3e-3)
    none = fit(MACHINE, records, Hypothesis())
    (m1,) = [i for i, (path, _) in enumerate(tuning_paths(MACHINE)) if path == ("head", "m1")]
    x = none.x.copy()
    x[m1] = 4.0
    spread = replace(none.spread, sizes=replace(none.spread.sizes, cause=error))
    strained = replace(none, x=x, hypothesis=Hypothesis((CubicStiffness(place, 1e9),)), spread=spread)
    asked: list[tuple[Hypothesis, np.ndarray]] = []
    monkeypatch.setattr(
        "cutvib_ss.diagnosis.scouting.refit", lambda nominal, records, h, x, **rest: asked.append((h, x))
    )
    linear = candidates(MACHINE, (16.0, 300.0), CHANNELS)
    assert relieved(MACHINE, records, Ranked("cubic_stiffness", strained, True), linear, Workers(1)) == []
    assert [f"{h.effects[1].effect} {h.effects[1].place}" for h, _ in asked] == tried
    for h, start in asked:
        # The same model under another name, with the value itself in the middle of its prior.
        assert start[m1] == 0.0
        tolerance = dict(tuning_paths(MACHINE))["head", "m1"]
        assert h.effects[1].mass == pytest.approx(MACHINE.head.m1 * (np.exp(4.0 * tolerance) - 1.0))


@pytest.mark.parametrize(("part", "name"), [(0, "gain"), (1, "phase")])
def test_beside_a_restoring_force_a_gain_takes_over_what_calibration_stands_for(
    monkeypatch: pytest.MonkeyPatch, part: int, name: str
) -> None:
    """A gain 13 % off was 6.5 tolerances of calibration beside a joint that slips, which was named alone, as dry friction, 0.96."""
    records, _ = measured(3e-3)
    none = fit(MACHINE, records, Hypothesis())
    x = none.x.copy()
    own = none.constant["tool_x"]
    x[list(own)] = 0.0
    x[own[part]] = 6.5
    strained = replace(none, x=x, hypothesis=Hypothesis((CubicStiffness("joint2", 1e9),)))
    asked: list[tuple[Hypothesis, np.ndarray]] = []
    monkeypatch.setattr(
        "cutvib_ss.diagnosis.scouting.refit", lambda nominal, records, h, x, **rest: asked.append((h, x))
    )
    linear = candidates(MACHINE, (16.0, 300.0), CHANNELS)
    assert relieved(MACHINE, records, Ranked("cubic_stiffness", strained, True), linear, Workers(1)) == []
    found = {
        h.effects[1].channel: (h.effects[1], start) for h, start in asked if h.effects[1].effect == "calibration_error"
    }
    assert set(found) == {"tool_x", "all"}
    shift = MACHINE.tolerance.calibration * 6.5
    for effect, start in found.values():
        assert (start[own[0]], start[own[1]]) == (0.0, 0.0)
        assert getattr(effect, name) == pytest.approx(np.exp(shift) if name == "gain" else shift)


def test_all_lines_tell_no_less_than_a_part_of_them() -> None:
    # a difference of large numbers: of a channel's delay, which the calibration takes up, rounding may leave less than nothing
    records, _ = measured(3e-3)
    scan = scan_beside(MACHINE, records, fit(MACHINE, records, Hypothesis()))
    scan.part *= 0.5
    _, problem, x = scan.with_cause(ChannelDelay("measurement", channel="all", delay=1e-6))
    change = scan.change(problem, x)
    assert 0.0 < change.squares <= change.squares_of_all


def test_drift_passes_for_no_cause(tmp_path: Path) -> None:
    found = campaign(tmp_path, {"a": (0.2, 0.6), "b": (0.35, 0.7), "c": (0.5, 0.8)}, seed=4, noise_level=3e-4)
    records = Records(observe(found, DRIFTING).entries)
    none = fit(DRIFTING, records, Hypothesis())
    assert none.reduced < SETTINGS.search_enough
    scan = Scan(DRIFTING, records, none.hypothesis, none.x, {}, apart=False)
    assert scan.by == "session"
    gains = [max(g for _, g in scan.each(c.starts)) for c in candidates(DRIFTING, (FREQ[0], FREQ[-1]), CHANNELS)]
    # χ² of up to four parameters, the largest of forty.
    assert max(gains) < 25.0


def test_what_may_hide_has_its_share_of_the_prior() -> None:
    odds = {"none": 0.9, "added_mass tool": 0.06, "unknown": 0.04}
    known = {("added_mass", "tool"): 0.06}
    evidence = {
        ("added_mass", "tool"): 1.0,
        ("added_mass", "head"): 0.5,
        ("rail_shear", "rail"): 1e-9,
        ("cross_axis", "m"): 50.0,
    }
    left, hidden = that_may_hide(odds, "none", known, evidence, COUNTS)
    assert sum(left.values()) + sum(hidden.values()) == pytest.approx(1.0)
    ratio = SETTINGS.priors["known"] / COUNTS.known / SETTINGS.priors["none"]
    assert hidden["added_mass", "head"] / left["none"] == pytest.approx(0.5 * ratio)
    # More than its fit has it does not have; a score alone names nothing.
    assert hidden["added_mass", "tool"] == 0.0
    assert hidden["cross_axis", "m"] / left["none"] == pytest.approx(ratio)
    assert hidden["rail_shear", "rail"] < 1e-10
