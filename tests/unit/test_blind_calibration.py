"""Fitting the numbers behind the probabilities: on evidence that is too sure of itself by a known factor."""

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutvib_ss.blind.calibration import BOUNDS, calibrate, figures, fit_numbers
from cutvib_ss.blind.cases import NONE, UNKNOWN
from cutvib_ss.blind.evidence import CaseEvidence, case_evidence, read_evidence, stated
from cutvib_ss.effects.catalogue import is_alias
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.gap import calibration
from cutvib_ss.gap.calibration import Calibration, Evidence, posterior, shipped
from tests.unit.blind_example import diagnosis, label, opened_trial

NAMES = [f"effect{k} place" for k in range(6)]
NUMBERS = Calibration(
    temperature=1.0, detection=5.0, left_over=1.3, sharpness=0.05, of_the_gap=1e-3, most_unknown=0.999, doubt=1e-3
)


def evidence(log: dict[str, float], held: dict[str, float], reduced: float = 1.0) -> Evidence:
    return Evidence(log, {n: 0 if n == "none" else 1 + n.count(" + ") for n in log}, reduced, held)


def drawn(count: int, seed: int, heat: float) -> list[CaseEvidence]:
    """Cases whose log evidence is the true one times ``heat``: a temperature of that makes it right."""
    rng = np.random.default_rng(seed)
    named = {"none": NONE} | {n: frozenset({tuple(n.split())}) for n in NAMES}
    cases = []
    for k in range(count):
        outside = rng.random() < 0.15
        true = rng.normal(0, 3, len(NAMES) + 1)
        p = np.exp(true - true.max())
        pick = int(rng.choice(p.size, p=p / p.sum()))
        names = ["none", *NAMES]
        # The even prior of the draw, made up for the half on none and the evidence that a cause has to bring.
        log = {n: heat * (v + (0 if n == "none" else np.log(len(NAMES)))) for n, v in zip(names, true)}
        log |= {n: log[n] + 5.0 for n in NAMES}
        held = dict.fromkeys(names, float(rng.normal(2.0 if outside else 1.05, 0.05)))
        truth = UNKNOWN if outside else named[names[pick]]
        cases.append(CaseEvidence(f"c{k}", truth, named, evidence(log, held)))
    return cases


# --- the probabilities ------------------------------------------------------------------------------------------------


def test_probabilities_sum_to_one_and_include_unknown() -> None:
    found = posterior(evidence({"none": 0.0, "a x": 30.0, "b x": 28.0}, {"none": 9.0, "a x": 1.0}), NUMBERS)
    assert sum(found.values()) == pytest.approx(1.0)
    assert set(found) == {"none", "a x", "b x", "unknown"}
    assert found["a x"] / found["b x"] == pytest.approx(np.exp(2.0), rel=0.02)


def test_a_cause_has_to_bring_evidence_and_a_pair_twice() -> None:
    held = {"none": 1.0}
    assert posterior(evidence({"none": 0.0, "a x": 4.0}, held), NUMBERS)["none"] > 0.5
    assert posterior(evidence({"none": 0.0, "a x": 8.0}, held), NUMBERS)["none"] < 0.2
    one, two = {"none": 0.0, "a x": 20.0, "b x": 0.0}, {"a x + b x": 24.0}
    assert posterior(evidence(one | two, held), NUMBERS)["a x"] > 0.5


def test_what_is_left_over_makes_it_unknown() -> None:
    log = {"none": 0.0, "a x": 900.0}
    shares = [posterior(evidence(log, {"none": 9.0, "a x": r}), NUMBERS)["unknown"] for r in (1.0, 1.3, 2.0, np.inf)]
    assert shares[0] < 0.01
    assert shares[1] == pytest.approx(0.5, abs=0.05)
    assert shares[2] > 0.99
    assert shares[3] > 0.99
    # Of a gap a thousand times the noise, a thousandth may stay.
    assert posterior(evidence(log, {"none": 1e3, "a x": 2.0}), NUMBERS)["unknown"] < 0.2


def test_doubt_leaves_something_to_what_comes_close_behind() -> None:
    log = {"none": 0.0, "a x": 300.0, "b y": 275.0, "c z": 100.0}
    sure, doubtful = (
        posterior(evidence(log, {"none": 9.0, "a x": 1.0}), replace(NUMBERS, doubt=doubt)) for doubt in (1e-5, 0.1)
    )
    assert sure["a x"] > 0.98
    assert 0.9 < doubtful["a x"] < 0.99
    assert doubtful["b y"] > 100 * sure["b y"]
    assert doubtful["c z"] < 0.001


def test_a_search_may_have_missed_the_cause() -> None:
    found = posterior(
        evidence({"none": 0.0, "a x": 1e4}, {"none": 90.0, "a x": 9.0}), replace(NUMBERS, most_unknown=0.8)
    )
    assert found["unknown"] == pytest.approx(0.8)
    assert found["a x"] == pytest.approx(0.2)


def test_a_value_as_which_others_appear_leaves_unknown_its_share() -> None:
    said = evidence({"none": 0.0, "a x": 1e3, "b x": 985.0}, {"none": 9.0, "a x": 1.0})
    numbers = replace(NUMBERS, unspecific=0.4)
    sure, open_to_doubt = (posterior(replace(said, unspecific=frozenset(which)), numbers) for which in ((), ("a x",)))
    assert open_to_doubt["a x"] == pytest.approx(0.6 * sure["a x"], abs=0.01)
    assert open_to_doubt["unknown"] == pytest.approx(0.4 * sure["a x"], abs=0.01)
    assert open_to_doubt["b x"] == pytest.approx(sure["b x"])
    # Where it leaves more than noise anyway, a known cause may have been missed all the same.
    misfit = replace(said, held={"none": 9.0, "a x": 5.0}, unspecific=frozenset({"a x"}))
    assert posterior(misfit, replace(numbers, most_unknown=0.8))["unknown"] == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize(
    ("effect", "parameter", "expected"),
    [("parameter_shift", "l2", True), ("parameter_shift", "c1", True), ("parameter_shift", "k2", False),
     ("parameter_shift", "first_frequency", False), ("added_mass", None, False),
     ("parameter_shift+added_mass", "l2", False)],
)  # fmt: skip
def test_lengths_and_damping_are_what_others_appear_as(effect: str, parameter: str | None, expected: bool) -> None:
    assert is_alias(effect, {"parameter": parameter}) is expected


def test_only_some_numbers_are_fitted() -> None:
    found = fit_numbers(drawn(120, 4, heat=6.0), NUMBERS, only=["temperature"])
    assert found.temperature > 2.0
    assert replace(found, temperature=NUMBERS.temperature) == NUMBERS
    with pytest.raises(ParameterError, match="no such number: heat; there are temperature"):
        fit_numbers(drawn(5, 4, heat=6.0), NUMBERS, only=["heat"])


def test_numbers_that_ship(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped.cache_clear()
    monkeypatch.setattr(calibration, "FILE", tmp_path / "absent.json")
    assert shipped() == Calibration()
    shipped.cache_clear()
    (tmp_path / "there.json").write_text(json.dumps({"numbers": asdict(NUMBERS)}))
    monkeypatch.setattr(calibration, "FILE", tmp_path / "there.json")
    assert shipped() == NUMBERS
    shipped.cache_clear()


def test_many_campaigns_at_once_are_the_same_as_one_by_one() -> None:
    cases = drawn(30, 5, heat=2.0)
    log, held = {"none": 0.0, "a x": 30.0, "a x + b y": 40.0}, {"none": 9.0, "a x + b y": 1.1}
    few = CaseEvidence("few", frozenset({("a", "x"), ("b", "y")}),
                       {"none": NONE, "a x": frozenset({("a", "x")}), "a x + b y": frozenset({("a", "x"), ("b", "y")})},
                       evidence(log, held, 1.4))  # fmt: skip
    cases.append(few)
    one_by_one = [-np.log(stated(c, NUMBERS)[c.truth]) for c in cases]
    assert figures("", cases, NUMBERS).log_loss == pytest.approx(np.mean(one_by_one))


# --- the fit ----------------------------------------------------------------------------------------------------------


def test_a_known_temperature_is_found_and_probabilities_come_true_on_other_cases() -> None:
    fitted, judged = drawn(250, 1, heat=6.0), drawn(400, 2, heat=6.0)
    start = replace(NUMBERS, temperature=1.0, left_over=1.9, sharpness=0.2)
    found = fit_numbers(fitted, start)
    assert 4.0 < found.temperature < 9.0
    assert 1.15 < found.left_over < 1.85
    before, after = figures("", judged, start), figures("", judged, found)
    assert after.log_loss < 0.7 * before.log_loss
    assert after.calibration_error < 0.5 * before.calibration_error
    for name, (low, high) in BOUNDS.items():
        assert low * 0.999 <= getattr(found, name) <= high * 1.001


def test_what_no_case_decides_stays_where_it_was() -> None:
    found = fit_numbers(drawn(40, 3, heat=1.0), replace(NUMBERS, pairs=0.31))
    assert found.pairs == pytest.approx(0.31, rel=0.25), "there are no pairs among these cases"


# --- from trials ------------------------------------------------------------------------------------------------------


def said(best: tuple[str, str], brings: float, left: float) -> dict[str, Any]:
    rows = [
        {"name": "none", "effect": "none", "place": "none", "parameters": {}, "log_evidence": 0.0, "judged": True,
         "held_reduced_chi2": 6.0},
        {"name": "x", "effect": best[0], "place": best[1], "parameters": {}, "log_evidence": brings, "judged": True,
         "held_reduced_chi2": left},
        {"name": "y", "effect": "freeplay", "place": "joint1", "parameters": {}, "log_evidence": brings - 30.0,
         "judged": False, "held_reduced_chi2": None},
        {"name": "z", "effect": "parameter_shift", "place": "tool", "parameters": {"parameter": "m2"},
         "log_evidence": brings - 5.0, "judged": True, "held_reduced_chi2": None},
    ]  # fmt: skip
    return diagnosis([(*best, 0.97), ("none", "none", 0.03)], evidence={"reduced_chi2": 1.1, "candidates": rows})


def trial(folder: Path, seed: int, count: int = 12) -> Path:
    rng = np.random.default_rng(seed)
    cases = [
        (label("cubic_stiffness", "joint2"), said(("cubic_stiffness", "joint2"), float(rng.uniform(50, 90)), 1.0))
        for _ in range(count)
    ]
    cases.append((label("outside:hum", "rail"), said(("cubic_stiffness", "joint2"), 70.0, 3.0)))
    return opened_trial(folder, cases, seed)


def test_evidence_knows_which_values_others_appear_as() -> None:
    said = diagnosis([("parameter_shift", "tool", 0.9), ("none", "none", 0.1)])
    rows = [
        {"name": "none", "effect": "none", "place": "none", "log_evidence": 0.0, "held_reduced_chi2": 5.0},
        *(
            {"name": n, "effect": "parameter_shift", "place": "tool", "parameters": {"parameter": n},
             "log_evidence": 9.0, "held_reduced_chi2": 1.0}
            for n in ("l2", "k2")
        ),
    ]  # fmt: skip
    rows.append({**rows[-1], "name": "told", "parameters": {}, "effect": "added_mass", "unspecific": True})
    said["evidence"] = {"candidates": rows, "reduced_chi2": 1.0}
    assert case_evidence("c", label("parameter_shift", "tool"), said).evidence.unspecific == {"l2", "told"}


def test_evidence_is_read_from_diagnoses() -> None:
    found = case_evidence("c", label("added_mass", "tool"), said(("cubic_stiffness", "joint2"), 60.0, 1.02))
    assert found.named["z"] == {("added_mass", "tool")} == found.truth
    assert found.evidence.held == {"none": 6.0, "x": 1.02, "z": np.inf}
    assert found.evidence.causes == {"none": 0, "x": 1, "y": 1, "z": 1}
    with pytest.raises(DataFormatError, match="holds no evidence"):
        case_evidence("c", label("none", "none"), diagnosis([("none", "none", 1.0)]))


def test_calibration_records_how_it_came_about(tmp_path: Path) -> None:
    a, b = read_evidence(trial(tmp_path / "a", 1)), read_evidence(trial(tmp_path / "b", 2))
    found = calibrate([a], [b], NUMBERS)
    data = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert data["schema"] == "cutvib-calibration/1"
    assert data["command"] == "cutvib blind calibrate a --judge b --out calibration.json"
    assert data["fitted_on"][0]["settings"]["seed"] == 1
    assert data["judged_on"][0]["settings"]["seed"] == 2
    assert set(data["numbers"]) == set(BOUNDS) == set(asdict(Calibration()))
    assert [f["set"] for f in data["figures"]] == [
        "fitted on, before", "fitted on, after", "judged on, before", "judged on, after",
    ]  # fmt: skip
    assert data["figures"][3]["cases"] == 13
    one = calibrate([a], [b], NUMBERS, ["temperature"])
    assert one.to_dict()["command"].endswith("a --judge b --only temperature --out calibration.json")
    assert replace(one.numbers, temperature=NUMBERS.temperature) == NUMBERS


def test_the_judge_must_be_another(tmp_path: Path) -> None:
    a = read_evidence(trial(tmp_path / "a", 1))
    with pytest.raises(ParameterError, match="has the seed of a"):
        calibrate([a], [a])


def test_a_sealed_trial_is_not_read(tmp_path: Path) -> None:
    folder = trial(tmp_path / "a", 1)
    (folder / "labels.json").unlink()
    with pytest.raises(ParameterError, match="not open"):
        read_evidence(folder)
