"""The report in a real Chromium: its charts are drawn from the file alone, on screen, phone and paper."""

import time
from pathlib import Path
from typing import Any

import pytest

from cutvib_ss.report import write_report
from tests.unit.diagnosis_example import example_diagnosis

pytestmark = pytest.mark.slow


def _drawn(browser: Any, seconds: float = 60.0) -> None:
    until = time.monotonic() + seconds
    while not all(browser.find_elements("css selector", f"#{chart} .main-svg") for chart in ("frf", "map")):
        assert time.monotonic() < until, browser.find_element("tag name", "main").text[:200]
        time.sleep(0.1)


@pytest.mark.parametrize("width", [400, 1280])
def test_charts_are_drawn_from_the_file_alone(browser: Any, tmp_path: Path, width: int) -> None:
    write_report(example_diagnosis(lines=700, records=2), tmp_path / "report.html")
    size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
    browser.get((tmp_path / "report.html").as_uri())
    _drawn(browser)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    assert not [line for line in browser.get_log("browser") if line["level"] == "SEVERE"]
    curves = browser.execute_script("return document.getElementById('frf').data.map((t) => [t.name, t.y.length])")
    assert [curve for curve in curves if curve[0] == "corrected model"] == [["corrected model", 700]] * 3

    # On paper each chart has the sheet's width and says what it shows.
    browser.execute_script("dispatchEvent(new Event('beforeprint'))")
    widths = browser.execute_script("return ['frf', 'map'].map((id) => document.getElementById(id)._fullLayout.width)")
    assert widths == [680, 680]
    shown = browser.execute_script(
        "return ['frf-shown', 'map-shown'].map((id) => document.getElementById(id).textContent)"
    )
    first = browser.execute_script("return data.records[data.first[0]].name + ', ' + data.first[1]")
    assert shown == [first, f"re-tuned model, {first.split(', ')[-1]}"]


def test_a_browser_that_cannot_unpack_the_charts_says_so(browser: Any, tmp_path: Path) -> None:
    write_report(example_diagnosis(lines=20, records=1), tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    (tmp_path / "old.html").write_text(text.replace("<script>", "<script>delete window.DecompressionStream;", 1))
    browser.get((tmp_path / "old.html").as_uri())
    until = time.monotonic() + 30.0
    while not (told := browser.find_elements("css selector", "p.warnings")):
        assert time.monotonic() < until
        time.sleep(0.1)
    assert "charts cannot be drawn in this browser" in told[0].text
