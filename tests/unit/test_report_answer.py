"""How sure, what to do, what limits the answer; the drawing of the machine."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.cli.campaigns import print_diagnosis
from cutvib_ss.cli.output import results
from cutvib_ss.diagnosis.element_type import element_type_value
from cutvib_ss.diagnosis.findings import DynamicStiffness, ElementType, Findings, PlaceScore
from cutvib_ss.diagnosis.observations import SPOILT
from cutvib_ss.diagnosis.result import Cause, Limit
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.model.machine import published_machine
from cutvib_ss.report import answer, charts, report_html
from cutvib_ss.report.drawing import machine_drawing
from cutvib_ss.report.wording import repeatability_in_gap, verdict_sentence
from tests.unit.diagnosis_example import example_diagnosis, example_structure

EXAMPLE = example_diagnosis(lines=30, records=2)
SIZES = {"drift": 0.003, "nominal": 3e-5, "cause": 0.03, "noise": 2.0}
LIMITS = (Limit("added_mass", "tool", "mass", "kg", 0.03, 0.02),)


def test_repeatability_is_told_in_the_gap_s_unit_where_it_matters() -> None:
    d = replace(EXAMPLE, repeatability=0.02)
    mean = np.mean([np.mean(np.abs(c.measured.data)) for c in d.comparisons]) / 9.80665
    # |z| of a complex Gaussian of unit power is √π/2 in the mean.
    drawn = np.random.default_rng(1).standard_normal((2, 200_000)) / np.sqrt(2)
    assert repeatability_in_gap(d) == pytest.approx(0.02 * mean * np.mean(np.hypot(*drawn)), rel=0.01)
    assert "of that is the rig's repeatability" in verdict_sentence(d)
    assert "repeats" not in verdict_sentence(replace(EXAMPLE, repeatability=1e-5))
    assert "no more than the rig repeats to; noise alone" in verdict_sentence(replace(EXAMPLE, repeatability=1.0))


def test_partly_explained_names_what_is_known_and_what_is_not() -> None:
    d = example_diagnosis("partly_explained", lines=20, records=1)
    said = verdict_sentence(d)
    assert said.startswith(
        "One known cause and something else: the supports under the rail's ends give. With it and an element of unknown"
    )
    assert "most probably at joint 2 (tool in its slot)" in said
    steps = " ".join(answer.to_do(d))
    assert "Inspect: " in steps
    assert "Look at joint 2 (tool in its slot) for what the model lacks" in steps
    page = " ".join(report_html(d).split())
    assert "Partly explained" in page
    assert "together with: an element of unknown form at joint 2 (tool in its slot)" in page


@pytest.mark.parametrize(("left", "part"), [(0.002, "the gap"), (0.006, "most of the gap"), (0.02, "part of the gap")])
def test_the_sentence_says_how_much_of_the_gap_is_explained(left: float, part: str) -> None:
    d = replace(EXAMPLE, gap=replace(EXAMPLE.gap, after=left))
    assert verdict_sentence(d).startswith(f"One cause explains {part}: ")


def test_what_is_left_is_judged_by_its_size_too() -> None:
    """A law of the wrong form reaches χ² = 1 by the discrepancy that is granted to it."""
    causes = (replace(EXAMPLE.causes[0], reduced_chi2=0.97), *EXAMPLE.causes[1:])
    d = replace(EXAMPLE, causes=causes)
    assert "It leaves no more than noise and repeatability" in " ".join(answer.why_sentences(d))
    poor = replace(d, gap=replace(d.gap, after=5 * d.gap.noise_floor))
    assert "It leaves 5 times what noise and repeatability explain" in " ".join(answer.why_sentences(poor))


def test_less_than_the_noise_is_not_split_into_parts() -> None:
    d = replace(EXAMPLE, gap=replace(EXAMPLE.gap, after=0.5 * EXAMPLE.gap.noise_floor))
    assert "no more than noise would leave" in answer.sizes_sentence(d)
    assert "no more than the noise of the measurement" in verdict_sentence(d)


def test_places_that_cannot_be_told_apart_are_said_and_marked() -> None:
    d = replace(EXAMPLE, where=replace(EXAMPLE.where, place_set=("rail_ends", "head_base")))
    assert answer.place_set_sentence(d).endswith("the ends of the rail; the guide between rail and head.")
    marked = [g for g in ET.fromstring(str(machine_drawing(d))) if g.get("class") == "part marked"]
    assert [g.findtext("text") for g in marked] == ["ends of the rail · 98 %", "guide · 1.0 %"]


@pytest.mark.parametrize(
    ("place", "said"), [("rail_ends", "points to the same place"), ("tool", "points elsewhere, to the tool")]
)
def test_the_search_without_a_law_is_compared(place: str, said: str) -> None:
    scores = (PlaceScore(place, place, 1.0, 0.9), PlaceScore("head", "head_x", 2.0, 0.1))
    d = replace(EXAMPLE, findings=Findings(place_scores=scores))
    assert said in " ".join(answer.why_sentences(d))


def test_a_gap_that_tuning_closes_too_is_said_to_rest_on_the_tolerances() -> None:
    """A share of nothing is no figure to read: the tuned model leaves noise, far from its tolerances."""
    first = replace(EXAMPLE.causes[0], share=0.99)
    explained = replace(EXAMPLE, causes=(first, *EXAMPLE.causes[1:]))
    d = replace(explained, gap=replace(EXAMPLE.gap, tuned=1.05 * EXAMPLE.gap.noise_floor))
    said = " ".join(answer.why_sentences(d))
    assert "further than their tolerances make credible" in said
    assert "the cause takes" not in said
    assert "the cause takes 99 %" in " ".join(answer.why_sentences(explained))
    assert not answer.tuning_suffices(replace(d, verdict="no_gap"))


def test_the_restoring_force_is_the_spring_with_the_law_over_it() -> None:
    machine = CubicStiffness("joint2", 8e9).apply(published_machine())
    d = replace(EXAMPLE, corrected_machine=machine)
    [drawn] = charts.charts_data(d)["restoring"]
    q = np.array(drawn["q"])
    k2 = published_machine().head.k2
    assert np.allclose(drawn["alone"], k2 * q, rtol=1e-4)
    assert np.allclose(np.array(drawn["with"]), k2 * q + 8e9 * q**3, rtol=5e-4, atol=1e-4)  # five digits
    assert (drawn["x"], drawn["y"]) == ("deflection [rad]", "torque [N m]")
    assert 'id="restoring-0"' in report_html(d)
    assert charts.charts_data(EXAMPLE)["restoring"] == []


def test_what_to_do_names_the_inspection_and_a_test() -> None:
    first, last = answer.to_do(EXAMPLE)
    assert first.startswith("Inspect: ")
    assert last.endswith("measure again with the head at y/L = 0.06 and look at tool_z: there the error was largest.")
    assert answer.to_do(example_diagnosis("no_gap", lines=20, records=1))[0].startswith("No inspection is needed")
    spoilt = replace(
        example_diagnosis("no_gap", lines=20, records=1), warnings=(f"r1: 74% of tool_x {SPOILT}", "another")
    )
    assert [w for w in answer.to_do(spoilt) if "left out" in w] == [
        f"This does not cover what was left out: r1: 74% of tool_x {SPOILT}."
    ]
    ambiguous = answer.to_do(example_diagnosis("ambiguous", lines=20, records=1))
    assert sum(s.startswith("Inspect: ") for s in ambiguous) == 2
    assert "give blows of about 60 N" in ambiguous[-1]


@pytest.mark.parametrize(
    ("place", "said"), [("measurement", "sensors and how they are mounted"), ("rail", "the rail for what")]
)
def test_what_is_unknown_is_looked_for_where_it_is(place: str, said: str) -> None:
    d = example_diagnosis("unknown", lines=20, records=1)
    assert any(said in step for step in answer.to_do(replace(d, where=replace(d.where, place=place))))


def test_sizes_are_told_in_words() -> None:
    rows = {
        name: (size, words)
        for name, size, words in answer.size_rows(replace(EXAMPLE, sizes=SIZES, repeatability=0.004))
    }
    assert rows["drift"][0] == "0.3 %"
    assert rows["discrepancy, nominal"][0] == "0.003 % or less"
    assert "2 times larger" in rows["noise"][1]
    assert rows["repeatability"][0].startswith("0.4 %, about ")
    assert dict(r[:2] for r in answer.size_rows(EXAMPLE))["repeatability"] == "not measured"
    left = replace(EXAMPLE, gap=replace(EXAMPLE.gap, after=0.005, noise_floor=0.003))
    assert "what remains, about 0.004, is discrepancy of the model" in answer.sizes_sentence(left)
    assert "nothing that stands out remains" in answer.sizes_sentence(
        replace(EXAMPLE, gap=replace(EXAMPLE.gap, after=0.00193))
    )


def test_command_line_tells_sets_shares_limits_and_sizes(capsys: pytest.CaptureFixture[str]) -> None:
    where = replace(EXAMPLE.where, place_set=("rail_ends", "head_base"))
    causes = (replace(EXAMPLE.causes[0], share=0.97), *EXAMPLE.causes[1:])
    print_diagnosis(
        replace(EXAMPLE, where=where, causes=causes, limits=LIMITS, sizes=SIZES, repeatability=0.004), results()
    )
    said = " ".join(capsys.readouterr().out.split())
    for text in (
        "place set rail_ends, head_base", "repeats 0.4 % beyond noise", "98 % 97 % 0.00214", "drift 0.3 %",
        "the tool carries a mass that the model lacks mass 0.03 kg 0.02 kg", "Inspect: ",
    ):  # fmt: skip
        assert text in said


def test_limits_and_the_command_stand_in_the_page() -> None:
    page = " ".join(report_html(replace(EXAMPLE, limits=LIMITS), "cutvib diagnose a --seed 3").split())
    assert "What the data still allow of other causes" in page
    assert "<code>cutvib diagnose a --seed 3</code>" in page
    assert "What the data still allow" not in report_html(EXAMPLE)


def test_a_structure_is_drawn_as_its_ports() -> None:
    structure = example_structure()
    where = replace(EXAMPLE.where, place="top", places=(("top", 0.97), ("drive", 0.03)), place_set=("top",))
    drawn = ET.fromstring(str(machine_drawing(replace(EXAMPLE, nominal=structure, where=where))))
    assert [([t.text for t in g.iter("text")], g.get("class")) for g in drawn] == [
        (["drive"], "part"), (["top", "97 %"], "part marked"), (["measurement"], "part"),
    ]  # fmt: skip


def test_axes_of_the_dynamic_stiffness_hold_the_law_s_peak() -> None:
    freq = np.linspace(20.0, 400.0, 500)
    kind = ElementType("sprung mass", "", {"mass": 1.5, "frequency": 170.0, "damping_ratio": 0.02}, 0.97)
    law = element_type_value(kind, "dynamic stiffness", freq)
    std = 0.01 * np.abs(law).max() * (1 + 100 * (freq > 300))
    rng = np.random.default_rng(2)
    z = DynamicStiffness(
        "head", "head_x", "head_x", "dynamic stiffness", "N/m", None, freq, (None,),
        (law + std * rng.standard_normal(freq.size))[None], std[None], kind,
    )  # fmt: skip
    carried = LocalResonator("head", 1.5, 170.0, 0.02).apply(published_machine())
    data = charts._stiffness(z, replace(EXAMPLE, corrected_machine=carried))
    low, high = data["limits"]["imag"]
    assert low < law.imag.min() < law.imag.max() < high < 1.5 * law.imag.max()
    assert [w["name"] for w in data["laws"]] == [
        "element type of its shape: sprung mass",
        "dynamic stiffness of the named cause",
    ]
    strange = replace(EXAMPLE, corrected_machine=carried, causes=(Cause("unknown", "head", 1.0, {}, 0.1),))
    assert charts._stiffness(z, strange)["laws"][1]["name"] == "the element, as fitted"
    # The element that the corrected machine carries, and the formula of the shape: the same law by two routes.
    assert np.allclose(data["laws"][0]["im"], data["laws"][1]["im"], rtol=1e-3, atol=10.0)
