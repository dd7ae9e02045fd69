"""The report: says the verdict first, carries its figures, and needs nothing from outside."""

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutvib_ss.diagnosis.result import Cause, Comparison, Diagnosis, FittedParameter, NextTest
from cutvib_ss.report import report_html, write_report
from cutvib_ss.report.frame import embedded, lines_to_draw, number_list, plotly_script, unpacked
from cutvib_ss.report.wording import (
    EFFECTS,
    cause_name,
    excess_text,
    next_test_sentence,
    parameter_text,
    shrinkage_text,
    verdict_sentence,
)
from cutvib_ss.response.frequency import frequency_response
from tests.unit.diagnosis_example import example_diagnosis, example_structure, measured


class _Reader(HTMLParser):
    """Text of a page, and what its tags load."""

    def __init__(self) -> None:
        super().__init__()
        self.text: list[str] = []
        self.loads: list[str] = []
        self.headings: list[str] = []
        self._open: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open.append(tag)
        self.loads += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if not {"style", "script"} & set(self._open):
            self.text.append(data)
            if self._open and self._open[-1] in ("h1", "h2"):
                self.headings.append(data)


def _read(page: str) -> _Reader:
    reader = _Reader()
    reader.feed(page)
    reader.text = [" ".join(" ".join(reader.text).split())]
    return reader


@pytest.fixture(scope="module")
def page() -> str:
    return report_html(example_diagnosis(records=2))


def test_the_verdict_comes_first_in_one_sentence(page: str) -> None:
    reader = _read(page)
    sentence = verdict_sentence(example_diagnosis(lines=20, records=1))
    assert sentence == (
        "One cause explains the gap: the supports under the rail's ends give. With it in the model the mean error on records "
        "kept out of the fit falls from 0.0286 to 0.00214 g/N; noise alone leaves 0.0019."
    )
    text = reader.text[0]
    assert text.index(sentence) < text.index("How sure, and why") < text.index("What to do") < text.index("Inspect: ")
    assert reader.headings[0] == "Example <campaign> & more"
    assert reader.headings[1:] == [
        "How sure, and why", "What to do", "Where", "Measured and computed responses", "Which cause", "How far",
        "The corrected model", "What was found in the measurement", "How to repeat it", "How far to trust this",
    ]  # fmt: skip


def test_it_carries_parameters_figures_warnings_and_the_caveat(page: str) -> None:
    text = _read(page).text[0]
    for said in (
        "k_left (1.310 ± 0.024)·10⁷ N/m",
        "damping 310 N s/m",
        "18-41.5 Hz, 80-130 Hz, 190-300 Hz",
        "92.5 % is closed (95 % interval 91.0 to 94.0 %); of what stood above the noise, 99 %.",
        "blow 2: double hit",
        "None is exact",
        "95 %: (1.263 to 1.357)·10⁷ N/m",
    ):
        assert said in text
    assert "nan" not in text.lower()


def _without_library(page: str) -> str:
    """The page but for the plotting library, which names addresses that it loads only for maps."""
    assert page.count(plotly_script()) == 1
    return page.replace(plotly_script(), "")


def test_it_loads_nothing_and_is_the_same_every_time(page: str) -> None:
    own = _without_library(page)
    assert len(own) < 1_500_000
    reader = _read(own)
    assert len(reader.loads) == 1
    assert all(value.startswith("data:image/png;base64,") for value in reader.loads)
    assert not re.search(r"https?://|@import|url\(", own)
    assert page == report_html(example_diagnosis(records=2))


def _charts(d: Diagnosis) -> Any:
    found = re.search(r'id="charts-data">(.*?)</script>', report_html(d), re.DOTALL)
    assert found
    return unpacked(found[1])


def test_charts_hold_the_responses_as_they_are() -> None:
    d = example_diagnosis(lines=40, records=2)
    data = _charts(d)
    assert [r["name"] for r in data["records"]] == ["y/L = 0.06", "y/L = 0.27"]
    channel = data["records"][1]["channels"][2]
    frf = d.comparisons[1].corrected.sel(output="base_x")
    assert (channel["name"], channel["unit"]) == ("base_x", "g/N")
    expected = frf.data[0, 0, 0] / 9.80665
    assert np.allclose(
        np.array(channel["corrected"]["re"]) + 1j * np.array(channel["corrected"]["im"]), expected, rtol=1e-4
    )
    assert channel["coherence"] is None
    assert data["maps"]["rows"] == ["y/L = 0.06", "y/L = 0.27"]
    assert np.array(data["maps"]["ratio"]["tuned"]["tool_z"]).shape == (2, 40)


def test_the_first_record_shown_is_where_the_gap_stands_out_most() -> None:
    base = example_diagnosis(lines=40, records=3)
    quiet = base.comparisons[1]
    data = quiet.measured.data.copy()
    data[0, 2] += 30 * np.sqrt(quiet.measured.variance[0, 2].max())
    loud = replace(quiet, measured=replace(quiet.measured, data=data))
    d = replace(base, comparisons=(base.comparisons[0], loud, base.comparisons[2]))
    assert _charts(d)["first"] == [1, quiet.measured.outputs[2]]
    # On paper the choices are gone: both charts have a place for the names of what they show.
    page = report_html(d)
    assert page.count('class="printed" id="frf-shown"') == page.count('class="printed" id="map-shown"') == 1


def test_a_long_response_is_thinned_and_keeps_its_peaks() -> None:
    modulus = np.ones(50_000)
    modulus[[0, 7_777, 31_234, 49_999]] = 5.0, 9.0, 0.1, 7.0
    at = lines_to_draw(modulus)
    assert at.size <= 2000
    assert {0, 7_777, 31_234, 49_999} <= set(at.tolist())
    assert np.array_equal(lines_to_draw(modulus[:2000]), np.arange(2000))


def test_numbers_of_the_charts_take_half_of_what_their_digits_would() -> None:
    values = np.random.default_rng(1).standard_normal(5000)
    values[3] = np.inf
    text = embedded({"values": number_list(values)})
    assert len(text) < 5.5 * values.size
    found = unpacked(text)["values"]
    assert np.isnan(found[3])
    assert np.allclose(np.delete(found, 3), np.delete(values, 3), rtol=1e-7)


def test_a_name_cannot_end_the_script() -> None:
    base = example_diagnosis(lines=20, records=1)
    named = replace(base.comparisons[0], label="</script><b>")
    page = _without_library(report_html(replace(base, comparisons=(named,), title="</script><b>")))
    assert "</script><b>" not in page


def test_an_ambiguous_diagnosis_marks_its_set_and_says_what_to_measure() -> None:
    page = report_html(example_diagnosis("ambiguous", lines=60, records=1))
    text = _read(page).text[0]
    assert "cannot tell these causes apart: the supports under the rail's ends give; or the guide between" in text
    assert "Put the head at y/L = 0.02, give blows of about 60 N and look at base_x: tells" in text
    assert page.count('<tr class="likely">') == 2


def test_a_value_as_which_others_appear_is_to_be_measured_by_itself() -> None:
    base = example_diagnosis("ambiguous", lines=20, records=1)
    values = {"factor": FittedParameter(0.95, 0.01, "1"), "parameter": FittedParameter("l2", 0.0, "")}
    shifted = Cause("parameter_shift", "tool", 0.55, values)
    unknown = Cause("unknown", "tool", 0.44)
    said = verdict_sentence(replace(base, causes=(shifted, unknown), ambiguity_set=(0, 1)))
    assert said.endswith("Measure l2 by itself, since other causes at its place show as such a value.")
    others = verdict_sentence(replace(base, causes=(shifted, base.causes[0]), ambiguity_set=(0, 1)))
    assert "Measure" not in others


def test_no_gap_and_unknown_are_said_plainly() -> None:
    none = _read(report_html(example_diagnosis("no_gap", lines=60, records=1))).text[0]
    assert "Model and machine agree" in none
    assert "Nowhere does the re-tuned nominal model's error stand out of noise and repeatability." in none
    base = example_diagnosis("no_gap", lines=20, records=1)
    for flexibility, others in ((0.3, "noise, drift and modes that the model leaves out"), (1e-4, "noise and drift")):
        loud = replace(base, gap=replace(base.gap, tuned=0.05), sizes={**base.sizes, "flexibility": flexibility})
        assert f"does not stand out of {others} (" in verdict_sentence(loud)
    unknown = verdict_sentence(example_diagnosis("unknown", lines=20, records=1))
    assert "no cause of the catalogue explains" in unknown
    assert "the supports under the rail's ends give" in unknown


def test_a_structure_without_positions_has_a_report(tmp_path: Path) -> None:
    structure = example_structure()
    freq = np.linspace(10.0, 120.0, 200)
    model = frequency_response(structure, None, freq)
    comparison = Comparison("records/a.csv", measured(structure, None, freq), model, model, model)
    base = example_diagnosis(lines=20, records=1)
    where = replace(base.where, by_position=(replace(base.where.by_position[0], label=None),))
    d = replace(base, nominal=structure, corrected_machine=structure, comparisons=(comparison,), where=where)
    write_report(d, tmp_path / "report.html")
    reader = _read((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "The corrected model" not in reader.headings
    assert "position y/L" not in reader.text[0]


def test_a_diagnosis_without_pictures_to_compare_has_a_report() -> None:
    reader = _read(report_html(replace(example_diagnosis(lines=20, records=1), comparisons=())))
    assert "Measured and computed responses" not in reader.headings
    assert reader.loads == []


def test_many_records_show_one_a_position_the_least_noisy() -> None:
    base = example_diagnosis(lines=30)
    louder = [replace(c.measured, variance=4 * c.measured.variance) for c in base.comparisons]
    noisy = [replace(c, measured=m) for c, m in zip(base.comparisons, louder, strict=True)]
    d: Diagnosis = replace(base, comparisons=(*noisy, *base.comparisons))
    assert "One record a position; the campaign has 10." in _read(report_html(d)).text[0]


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        (FittedParameter(1.31e7, 2.4e5, "N/m"), "(1.310 ± 0.024)·10⁷ N/m"),
        (FittedParameter(8.1e9, 2e8, "N m/rad^3"), "(8.10 ± 0.20)·10⁹ N m/rad³"),
        (FittedParameter(2.117e-4, 3e-7, "s"), "(2.1170 ± 0.0030)·10⁻⁴ s"),
        (FittedParameter(0.0, 0.02, "m"), "0.000 ± 0.020 m"),
        (FittedParameter(247.5, 1.2, "Hz"), "247.5 ± 1.2 Hz"),
        (FittedParameter(131.0, 4000.0, "N s/m"), "131 ± 4000 N s/m"),
        (FittedParameter(310.0, float("nan"), "N s/m"), "310 N s/m"),
        (FittedParameter(float("nan"), 1.0, "kg"), "not determined"),
    ],
)
def test_parameters_are_rounded_to_their_deviation(parameter: FittedParameter, text: str) -> None:
    assert parameter_text(parameter) == text


def test_pairs_and_strangers_have_names() -> None:
    assert cause_name("support_compliance+cubic_stiffness", "rail_ends+joint2") == (
        "the supports under the rail's ends give; together with: joint 2 (tool in its slot) changes its stiffness with "
        "amplitude"
    )
    late = {"delay": FittedParameter(2e-4, 1e-6, "s"), "channel": FittedParameter("all", 0.0, "")}  # type: ignore[arg-type]
    assert cause_name("channel_delay", "measurement", late) == "every channel is late against the force"
    assert cause_name("calibration_error", "measurement") == "the sensitivity of one channel is wrong"
    assert cause_name("brand_new_effect", "drive") == "brand new effect at drive"


def test_every_effect_of_the_catalogue_has_words() -> None:
    from cutvib_ss.effects.catalogue import EFFECTS as CATALOGUE

    assert set(CATALOGUE) <= set(EFFECTS)


def test_what_is_not_known_is_left_out() -> None:
    assert next_test_sentence(NextTest("why", None, None, "y")) == "Look at y: why."
    gap = example_diagnosis(lines=20, records=1).gap
    assert shrinkage_text(replace(gap, shrinkage_interval=(float("nan"), 1.0))) == ("92.5 %", "")
    assert shrinkage_text(replace(gap, shrinkage=float("nan"))) == ("not known", "")
    assert excess_text(replace(gap, before=0.00195, after=0.0019)) == ""


def test_unlikely_causes_are_counted_not_listed() -> None:
    base = example_diagnosis(lines=20, records=1)
    more = tuple(replace(base.causes[-1], place=f"port{k}") for k in range(5))
    text = _read(report_html(replace(base, causes=base.causes + more))).text[0]
    assert "6 less probable causes are in the JSON" in text
    assert "port3" not in text
