"""The score: figures against hand-made answers, intervals against their definitions, and the pages that show them."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

from cutvib_ss.report.blind import score_html, score_markdown
from cutvib_ss.report.frame import plotly_script, unpacked
from cutvib_ss.validation.cases import FAILED, NONE, UNKNOWN, Case, answer_of, causes_of, truth_of
from cutvib_ss.validation.measured import MeasuredRow
from cutvib_ss.validation.rows import Row, rows
from cutvib_ss.validation.score import Score, case_data, scored
from cutvib_ss.validation.statistics import (
    calibration_error,
    calibration_error_if_perfect,
    proportion,
    quantile,
    reliability,
    resampled,
    risk_coverage,
)
from tests.unit.blind_example import diagnosis, label

ABOUT = {
    "sealed": "2026-01-01T00:00:00+00:00", "opened": "2026-01-01T01:00:00+00:00", "version": "0", "commit": None,
    "code_sha256": "c" * 64,
    "settings": {"cases": 1, "seed": 1, "mix": {"none": 1, "single": 2}, "severity": [0.3, 2.0]},
}  # fmt: skip
JOINT, GUIDE = ("cubic_stiffness", "joint2"), ("guide_compliance", "head_base")


def case(truth: dict[str, Any], said: dict[str, Any] | None, name: str = "c0", seconds: float = 5.0) -> Case:
    return Case(name, truth_of(truth), FAILED if said is None else answer_of(said), {"cpu_seconds": seconds})


def says(effect: str, place: str, p: float = 0.97, verdict: str = "explained", **more: Any) -> dict[str, Any]:
    rest = [("none", "none", (1 - p) / 2), ("unknown", "rail", (1 - p) / 2)]
    others = [r for r in rest if r[0] != effect]
    return diagnosis([(effect, place, p), *others], verdict, **more)


def figures(*cases: Case) -> dict[str, Row]:
    return {row.key: row for row in rows(cases)}


# --- what counts as right ---------------------------------------------------------------------------------------------


def test_a_cause_is_right_by_effect_and_place() -> None:
    truth = label(*JOINT)
    assert case(truth, says(*JOINT)).right
    assert not case(truth, says("cubic_stiffness", "joint1")).right
    assert not case(truth, says("freeplay", "joint2")).right
    assert not case(truth, None).right


@pytest.mark.parametrize(
    ("parameter", "place", "same"), [("m2", "tool", True), ("m1", "head", True), ("l2", "tool", False)]
)
def test_equivalent_causes_count_as_one(parameter: str, place: str, same: bool) -> None:
    shifted = {"effect": "parameter_shift", "place": place, "probability": 0.99,
               "parameters": {"parameter": {"value": parameter, "std": 0.0, "unit": ""}}}  # fmt: skip
    said = says("added_mass", place)
    said["causes"][0] |= shifted
    assert case(label("added_mass", place), said).right is same
    assert case(label("parameter_shift", place, parameter=parameter), says("added_mass", place)).right is same


def test_pairs_are_sets() -> None:
    truth = label("guide_compliance+cubic_stiffness", "head_base+joint2")
    assert case(truth, says("cubic_stiffness+guide_compliance", "joint2+head_base")).right
    assert not case(truth, says(*JOINT)).right
    crossed = says("cubic_stiffness+guide_compliance", "head_base+joint2")
    assert not case(truth, crossed).right, "each cause belongs to its own place"
    assert causes_of("added_mass+parameter_shift", "tool+joint1", {"parameter_shift.parameter": "k1"}) == {
        ("added_mass", "tool"), ("parameter_shift", "joint1"),
    }  # fmt: skip


def test_unknown_is_right_outside_the_catalogue_and_nowhere_else() -> None:
    outside = label("outside:hum", "measurement")
    assert truth_of(outside).causes == UNKNOWN
    assert case(outside, says("unknown", "rail", verdict="unknown")).right
    assert not case(outside, says("none", "none", verdict="no_gap")).right
    assert not case(label(*JOINT), says("unknown", "joint2", verdict="unknown")).right
    assert truth_of(label("none", "none")).causes == NONE


def test_rows_of_one_name_are_one_answer() -> None:
    said = diagnosis([("parameter_shift", "joint2", 0.5), ("parameter_shift", "joint2", 0.4), ("none", "none", 0.1)])
    one = case(label("parameter_shift", "joint2"), said)
    assert one.answer.confidence == pytest.approx(0.9)
    assert len(one.answer.likely) == 2, "three rows, two answers"


def test_a_cause_beside_an_unknown_element_is_flagged_outside_the_catalogue_and_right_of_a_varied_form() -> None:
    said = says("cubic_stiffness+unknown", "joint2+rail", verdict="partly_explained")
    outside = case(label("outside:crack", "rail"), said)
    assert outside.right
    assert outside.right_place
    assert outside.answer.probability_that(outside.truth) == pytest.approx(0.97 + 0.015)
    assert not case(label(*JOINT), said).right, "the catalogue's own form leaves nothing unknown"
    assert case(label(*JOINT) | {"grade": 2}, said).right
    assert case(label(*JOINT) | {"grade": 2}, says(*JOINT)).right
    assert not case(label(*JOINT) | {"grade": 2}, says("unknown", "joint2", verdict="unknown")).right
    found = figures(outside, case(label(*JOINT) | {"grade": 1}, said), case(label(*JOINT), says(*GUIDE)))
    assert found["outside_flagged"].estimate.value == 1.0
    assert found["outside_unknown"].estimate.value == 0.0
    assert found["right_varied"].estimate.value == 1.0
    assert (found["right_large"].estimate.value, found["right_large"].estimate.cases) == (0.0, 1)


@pytest.mark.parametrize(
    ("place", "place_set", "right"),
    [
        ("rail", ["rail"], False),
        ("tool", ["tool"], True),
        ("joint2", ["joint2"], True),
        ("rail", ["rail", "tool"], True),
        ("rail", ["rail", "joint1", "head", "tool"], False),
        ("rail", None, False),
    ],
)
def test_a_place_is_right_by_name_by_equivalence_or_in_a_small_set(
    place: str, place_set: list[str] | None, right: bool
) -> None:
    said = says("unknown", place, verdict="unknown")
    if place_set is not None:
        said["where"]["place_set"] = place_set
    truth = label("outside:hose", "tool") | {"equivalent_places": ["joint2"]}
    assert case(truth, said).right_place is right


def oracle(*odds: tuple[str, str, float]) -> dict[str, Any]:
    return {"oracle": {"causes": [{"effect": e, "place": p, "probability": q} for e, p, q in odds], "drift": 0.0}}


def test_log_score_is_lost_against_what_could_be_known() -> None:
    known = case(label(*JOINT) | oracle((*JOINT, 0.8), ("none", "none", 0.2)), says(*JOINT, p=0.4, verdict="ambiguous"))
    assert known.lost == pytest.approx(math.log(0.8 / 0.4))
    # What is not listed costs as much as one in ten thousand.
    missed = case(label(*JOINT) | oracle((*JOINT, 1.0)), diagnosis([(*GUIDE, 1.0)]))
    assert missed.lost == pytest.approx(math.log(1e4))
    uncovered = case(label(*JOINT) | {"oracle": None}, says(*JOINT))
    assert math.isnan(uncovered.lost)
    row = figures(known, missed, uncovered)["log_score_lost"]
    assert (row.estimate.value, row.estimate.cases) == (pytest.approx((math.log(2) + math.log(1e4)) / 2), 2)
    assert row.goal == 0.15
    assert figures(known)["oracle_log_score"].estimate.value == pytest.approx(-math.log(0.8))


def test_a_gap_that_tolerance_hides_is_no_miss() -> None:
    hidden = case(label(*JOINT) | oracle(("none", "none", 0.9), (*JOINT, 0.1)), says("none", "none", verdict="no_gap"))
    seen = case(label(*JOINT) | oracle((*JOINT, 1.0)), says("none", "none", verdict="no_gap"))
    found = figures(hidden, seen)
    assert (found["right_large"].estimate.value, found["right_large"].estimate.cases) == (0.0, 1)
    assert (found["missed"].estimate.value, found["missed"].estimate.cases) == (1.0, 1)
    assert found["right_hidden"].estimate.value == 1.0
    assert hidden.lost == pytest.approx(math.log(0.1 / 1e-4))


def test_other_names_of_a_documented_cause_are_right_too() -> None:
    truth = label("joint_slip+added_mass", "joint+joint") | {
        "or": [{"effect": "dry_friction+added_mass", "place": "joint+joint"}], "machine": "measured", "gap_sigma": None,
    }  # fmt: skip
    right = [case(truth, says(f"{e}+added_mass", "joint+joint")) for e in ("joint_slip", "dry_friction")]
    wrong = case(truth, says("added_mass", "joint"))
    assert [c.right for c in (*right, wrong)] == [True, True, False]
    found = figures(*right, wrong)
    assert found["measured_added"].estimate.value == pytest.approx(2 / 3)
    assert found["measured_added_one"].estimate.value == 1.0


def test_measured_rigs_have_rows() -> None:
    slip = MeasuredRow("a", ("joint_slip",), ("joint",), "explained", 0.97, 1, confidence=0.97)
    wrong = MeasuredRow("b", ("cubic_stiffness",), ("spring",), "explained", 0.02, 3, confidence=0.95)
    none = MeasuredRow("c", ("none",), ("none",), "no_gap", 0.9, 1, halves=("no_gap", "unknown"), confidence=0.9)
    found = {row.key: row for row in rows([], [slip, wrong, none])}
    assert (found["measured_first"].estimate.value, found["measured_first"].estimate.cases) == (0.5, 2)
    assert found["measured_sure_and_wrong"].estimate.value == pytest.approx(1 / 3)
    assert (found["measured_halves"].estimate.value, found["measured_halves"].estimate.cases) == (0.5, 2)


def test_false_alarms_of_drifting_machines_have_a_row_of_their_own() -> None:
    drifts = label("none", "none", 0.0) | {"conditions": {"repeatability": {"drift": 0.004, "stated": None}}}
    found = figures(
        case(label("none", "none", 0.0), says("none", "none", verdict="no_gap")),
        case(drifts, says("unknown", "rail", verdict="unknown")),
    )
    assert found["false_alarm"].estimate.value == 0.5
    assert (found["false_alarm_drifting"].estimate.value, found["false_alarm_drifting"].estimate.cases) == (1.0, 1)
    score = scored([case(drifts, None)], ABOUT)
    assert [g.name for g in score.groups["by repeatability"]] == ["drifts 0.3-2 %, not stated"]


# --- the rows ---------------------------------------------------------------------------------------------------------


def test_causes_are_counted_by_the_size_of_the_gap() -> None:
    found = figures(
        case(label(*JOINT, gap_sigma=2.0), says(*JOINT)),
        case(label(*JOINT, gap_sigma=9.0), says(*GUIDE)),
        case(label(*JOINT, gap_sigma=1.9), says(*JOINT)),
        case(label(*JOINT, gap_sigma=0.4), says("none", "none", verdict="no_gap")),
        case(label("none", "none", gap_sigma=0.0), says("none", "none", verdict="no_gap")),
    )
    assert (found["right_large"].estimate.value, found["right_large"].estimate.cases) == (0.5, 2)
    assert (found["right_small"].estimate.value, found["right_small"].estimate.cases) == (1.0, 1)
    assert (found["right_faint"].estimate.value, found["right_faint"].estimate.cases) == (1.0, 1)
    assert found["right_all"].estimate.value == pytest.approx(3 / 5)
    assert found["probability"].estimate.value == pytest.approx((0.97 + 0.0 + 0.97) / 3)
    assert found["right_large"].met is False
    assert found["right_small"].met is True


def test_a_case_without_a_diagnosis_counts_as_wrong_everywhere() -> None:
    found = figures(
        case(label(*JOINT), None), case(label("none", "none", 0.0), None), case(label("outside:hum", "rail"), None)
    )
    for key in ("right_large", "probability", "place", "place_outside", "coverage", "outside_unknown"):
        assert found[key].estimate.value == 0.0, key
    assert found["false_alarm"].estimate.value == 1.0
    assert found["inside_unknown"].estimate.value == 1.0
    assert found["failed"].estimate.value == 1.0
    assert found["missed"].estimate.value == 1.0


def test_why_there_is_no_diagnosis_is_told_in_one_line() -> None:
    said = "Traceback\n  File x\nValueError: 23 columns\ncutvib: a fault of the program, not of the input; please report it"
    crashed = replace(case(label(*JOINT), None), run={"status": "failed", "message": said})
    late = replace(crashed, run={"status": "timeout", "message": ""})
    assert [case_data(c)["message"] for c in (crashed, late)] == ["failed: ValueError: 23 columns", "timeout"]


def test_false_alarms_and_unknowns_go_by_the_verdict() -> None:
    none = label("none", "none", gap_sigma=0.0)
    found = figures(
        case(none, says("none", "none", verdict="no_gap")),
        case(none, says("none", "none", 0.4, verdict="ambiguous")),
        case(label("outside:hum", "rail"), says("unknown", "rail", verdict="unknown")),
        case(label("outside:hum", "rail"), says(*JOINT)),
        case(label(*JOINT), says("unknown", "joint2", verdict="unknown")),
        case(label(*JOINT), says(*JOINT)),
    )
    assert found["false_alarm"].estimate.value == 0.5
    assert found["outside_unknown"].estimate.value == 0.5
    assert found["inside_unknown"].estimate.value == 0.5
    assert found["place_outside"].estimate.value == 0.5
    assert found["place"].estimate.value == 1.0


def test_sure_and_wrong_is_a_part_of_all_cases() -> None:
    found = figures(
        case(label(*JOINT), says(*GUIDE, p=0.9)),
        case(label(*JOINT), says(*GUIDE, p=0.89)),
        case(label("outside:hum", "rail"), says(*GUIDE, p=0.99)),
        case(label(*JOINT), says(*JOINT, p=0.99)),
    )
    assert found["sure_and_wrong"].estimate.value == 0.5
    assert found["sure_and_wrong"].met is False


def test_the_set_of_95_percent() -> None:
    said = diagnosis([(*GUIDE, 0.6), (*JOINT, 0.36), ("none", "none", 0.04)], "ambiguous")
    found = figures(case(label(*JOINT), said), case(label("added_mass", "tool"), said))
    assert found["coverage"].estimate.value == 0.5
    assert found["set_size"].estimate.value == 2.0


def test_how_far_comes_from_held_out_records() -> None:
    def gap(before: float, after: float, noise: float) -> dict[str, Any]:
        return {"before": before, "after": after, "noise_floor": noise, "shrinkage": 1 - after / before,
                "shrinkage_interval": [0.0, 1.0]}  # fmt: skip

    found = figures(
        case(label(*JOINT), says(*JOINT, gap=gap(0.03, 0.002, 0.001))),
        case(label(*JOINT), says(*JOINT, gap=gap(0.03, 0.0009, 0.001))),
        case(label(*JOINT), says(*JOINT, gap=gap(0.00105, 0.001, 0.001))),  # nothing to close
    )
    assert found["excess_closed"].estimate.value == pytest.approx((28 / 29 + 1.0) / 2)
    assert found["excess_closed"].estimate.cases == 2
    assert found["chi2_median"].estimate.value == pytest.approx(1.02)


def test_what_is_stated_is_held_against_what_is_achieved() -> None:
    gap = {
        "before": 0.03,
        "after": 0.004,
        "noise_floor": 0.001,
        "shrinkage": 1 - 4 / 30,
        "shrinkage_interval": [0.84, 0.88],
    }
    one = replace(case(label(*JOINT), says(*JOINT, gap=gap)), achieved=0.8)
    found = figures(one, case(label(*JOINT), says(*JOINT, gap=gap)))
    assert found["achieved"].estimate.value == pytest.approx(0.8)
    assert found["overstated"].estimate.value == pytest.approx(26 / 29 - 0.8)
    assert found["overstated"].estimate.cases == 1
    (shown,) = scored([one], ABOUT).shrinkage
    assert (shown.stated, shown.low, shown.high) == pytest.approx((26 / 29, 0.84 * 30 / 29, 0.88 * 30 / 29))


def test_time_is_told_apart_by_what_the_campaign_needed() -> None:
    level = {"place": "joint2", "level_dependent": True}
    found = figures(
        case(label(*JOINT), says(*JOINT), seconds=4.0), case(label(*JOINT), says(*JOINT, where=level), seconds=40.0)
    )
    assert found["time_linear"].estimate.value == 4.0
    assert found["time_nonlinear"].estimate.value == 40.0


# --- statistics -------------------------------------------------------------------------------------------------------


def test_the_exact_interval() -> None:
    # 0 of 300: the rule of three; 8 of 10: Clopper and Pearson's own tables.
    assert proportion([False] * 300).high == pytest.approx(1 - 0.025 ** (1 / 300))
    found = proportion([True] * 8 + [False] * 2)
    assert (round(found.low, 3), round(found.high, 3)) == (0.444, 0.975)
    assert math.isnan(proportion([]).value)


def test_bootstrap_and_order_statistics_cover_what_they_should() -> None:
    rng = np.random.default_rng(3)
    means, medians = 0, 0
    for _ in range(100):
        sample = rng.standard_normal(40).tolist()
        means += resampled(sample).low <= 0 <= resampled(sample).high
        medians += quantile(sample, 0.5).low <= 0 <= quantile(sample, 0.5).high
    assert 0.86 <= means / 100 <= 0.99
    assert 0.9 <= medians / 100 <= 1.0


def test_a_quantile_that_few_cases_cannot_bound() -> None:
    found = quantile([1.0, 2.0, 3.0], 0.95)
    assert found.high == np.inf
    assert quantile(np.arange(1000.0).tolist(), 0.95).high < 1000


def test_calibration_error_of_known_answers() -> None:
    assert calibration_error([1.0] * 4, [True] * 4) == 0.0
    assert calibration_error([0.95] * 4, [True, True, False, False]) == pytest.approx(0.45)
    assert calibration_error([0.95] * 2 + [0.55] * 2, [True, True, False, False]) == pytest.approx((0.05 + 0.55) / 2)


def test_perfect_calibration_shows_what_chance_alone_does() -> None:
    p = np.random.default_rng(1).uniform(0.3, 1.0, 400)
    mean, bound = calibration_error_if_perfect(p.tolist())
    right = np.random.default_rng(2).random((300, 400)) < p
    drawn = [calibration_error(p.tolist(), r.tolist()) for r in right]
    assert mean == pytest.approx(np.mean(drawn), rel=0.05)
    assert np.mean(np.array(drawn) > bound) == pytest.approx(0.05, abs=0.04)


def test_reliability_and_risk() -> None:
    bins = reliability([0.95, 0.97, 0.31], [True, False, True])
    assert [b.right.cases for b in bins] == [0, 0, 0, 1, 0, 0, 0, 0, 0, 2]
    assert bins[-1].right.value == 0.5
    coverage, risk = risk_coverage([0.9, 0.99, 0.9, 0.5], [False, True, True, False])
    assert coverage.tolist() == [0.25, 0.75, 1.0]
    assert risk.tolist() == pytest.approx([0.0, 1 / 3, 0.5])


# --- the pages --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def score() -> Score:
    return example_score(120)


def example_score(count: int) -> Score:
    """Answers of a diagnosis that is right about as often as it says."""
    rng = np.random.default_rng(7)
    causes = [
        JOINT,
        GUIDE,
        ("added_mass", "tool"),
        ("channel_delay", "measurement"),
        ("support_compliance", "rail_ends"),
    ]
    cases = []
    for k in range(count):
        kind = rng.choice(["none", "outside", "pair", "single"], p=[0.3, 0.12, 0.08, 0.5])
        mine, other = (causes[i] for i in rng.permutation(len(causes))[:2])
        truth, right = {
            "none": (("none", "none"), ("none", "none", "no_gap")),
            "outside": (("outside:hum", "rail"), ("unknown", "rail", "unknown")),
            "pair": ((f"{mine[0]}+{other[0]}", f"{mine[1]}+{other[1]}"),) * 1
            + ((f"{mine[0]}+{other[0]}", f"{mine[1]}+{other[1]}", "explained"),),
            "single": (mine, (*mine, "explained")),
        }[kind]
        p = float(rng.beta(12, 1.2))
        effect, place, verdict = right if rng.random() < p else (*other, "explained")
        sigma = 0.0 if kind == "none" else float(np.exp(rng.uniform(np.log(0.3), np.log(30))))
        reach = float(rng.uniform(0.2, 0.95))
        stated = reach - abs(rng.normal(0, 0.03))
        gap = {"before": 0.03, "after": 0.03 * (1 - stated), "noise_floor": 0.03 * (1 - reach), "shrinkage": stated,
               "shrinkage_interval": [stated - 0.03, stated + 0.03]}  # fmt: skip
        said = says(effect, place, p, verdict, gap=gap)
        one = case(label(*truth, gap_sigma=sigma), said if k % 60 else None, f"{k:012x}", float(rng.uniform(3, 20)))
        truly = 1 - 10 ** float(rng.normal(-1.5, 0.5)) if kind in ("single", "pair") and k % 60 else math.nan
        cases.append(replace(one, achieved=truly))
    return scored(cases, ABOUT)


def test_json_has_no_nan_and_every_case(score: Score) -> None:
    def refuse(name: str) -> None:
        raise AssertionError(name)

    data = json.loads(json.dumps(score.to_dict(), allow_nan=False), parse_constant=refuse)
    assert data["schema"] == "cutvib-blind-score/1"
    assert len(data["cases"]) == 120
    assert sum(map(sum, data["confusion"]["causes"]["counts"])) == 120
    assert sum(map(sum, data["confusion"]["places"]["counts"])) == 120
    assert {"right_large", "false_alarm", "calibration_error", "sure_and_wrong"} <= {r["key"] for r in data["rows"]}
    assert data["sure_and_wrong"] == [c.name for c in score.sure_and_wrong]
    assert sum(g["cases"] for g in data["by_severity"]) == data["trial"]["kinds"]["single"]
    assert set(data["shrinkage"][0]) == {"name", "stated", "low", "high", "achieved", "right"}


def test_the_page_stands_alone_and_names_every_sure_and_wrong_case(score: Score) -> None:
    page = score_html(score).replace(plotly_script(), "")
    assert not re.search(r'(src|href)="(?!#|data:)', page)
    found = re.search(r'id="charts-data">(.*?)</script>', page, re.DOTALL)
    assert found
    data = unpacked(found[1])
    assert sum(b["cases"] for b in data["bins"]) == 120
    assert data["maps"]["causes"]["counts"] == score.causes.counts.tolist()
    assert [s["name"] for s in data["shrinkage"]] == [s.name for s in score.shrinkage]
    for chart in ("reliability", "risk", "severity", "shrinkage", "causes", "places"):
        assert page.count(f'class="chart" id="{chart}"') == 1
    for wrong in score.sure_and_wrong:
        assert f'href="#case-{wrong.name}"' in page
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids))


def test_the_table_in_markdown_has_goal_beside_figure(score: Score) -> None:
    text = score_markdown(score)
    (line,) = (x for x in text.splitlines() if x.startswith("| right cause first, gap ≥ 2 σ"))
    cells = [c.strip() for c in line.strip("|").split("|")]
    assert cells[1] == "≥ 97 %"
    assert cells[2].endswith("%")
    assert cells[5] in ("yes", "no")
    assert "cutvib blind run --cases 1 --seed 1" in text


def test_a_trial_of_one_case_can_be_shown() -> None:
    none = scored([case(label("none", "none", 0.0), says("none", "none", verdict="no_gap"))], ABOUT)
    assert "| false alarm on gap-free campaigns | ≤ 1 % | 0.0 % | 0.0-97.5 % | 1 | yes |" in score_markdown(none)
    assert "no_gap" in score_html(none)


def test_pictures_go_into_files_of_the_documents(score: Score, tmp_path: Path) -> None:
    from cutvib_ss.plot.blind import confusion_map, reliability_diagram
    from cutvib_ss.plot.style import save

    save(reliability_diagram(score), tmp_path / "a.png")
    save(confusion_map(score.causes, "Causes"), tmp_path / "b.svg")
    assert (tmp_path / "a.png").stat().st_size > 5000


def test_the_interval_matches_scipy() -> None:
    found = proportion([True] * 3 + [False] * 17)
    assert found.low == pytest.approx(stats.beta.ppf(0.025, 3, 18))
    assert found.high == pytest.approx(stats.beta.ppf(0.975, 4, 17))


def test_slip_at_one_torque_goes_by_the_name_of_dry_friction():
    label = {
        "effect": "joint_slip",
        "place": "joint2",
        "kind": "single",
        "form": "jenkins",
        "grade": 0,
        "gap_sigma": 1.0,
    }
    friction = frozenset({("dry_friction", "joint2")})
    assert truth_of(label).holds(friction)
    assert truth_of(label).holds(frozenset({("joint_slip", "joint2")}))
    assert not truth_of({**label, "form": "iwan"}).holds(friction)
