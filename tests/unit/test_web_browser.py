"""The page in a real Chromium: load, slide, diagnose, cancel, download, a bad upload; skipped where there is no Chromium."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import tomllib
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutvib_ss.interchange import write_frf
from cutvib_ss.model_files import read_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.web.session import DEMO

pytest.importorskip("nicegui", reason="the page needs NiceGUI (extra web)")
webdriver = pytest.importorskip("selenium.webdriver", reason="the page is tested through selenium")

ROOT = Path(__file__).resolve().parents[2]
WAIT = 60.0
DIAGNOSIS = 900.0

TWO_MASSES = """
[model]
kind = "second_order"
dofs = ["x1", "x2"]
mass = [[2.0, 0.0], [0.0, 1.0]]
damping = [[3.0, -1.0], [-1.0, 1.0]]
stiffness = [[30000.0, -10000.0], [-10000.0, 10000.0]]

[ports]
drive = [1.0, 0.0]
end = [0.0, 1.0]

[channels]
v = { port = "drive", quantity = "velocity" }
a = { port = "end", quantity = "acceleration" }

[input]
force = "drive"
"""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    # NiceGUI takes another way of starting where it finds pytest.
    environment = {k: v for k, v in os.environ.items() if k != "PYTEST_CURRENT_TEST"}
    process = subprocess.Popen(
        [sys.executable, "-m", "cutvib_ss", "serve", "--port", str(port), "--no-open"],
        cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True,
        # Behind a shell that runs the tests in the background interrupts would be ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    assert process.stderr is not None
    try:
        told = process.stderr.readline()
        assert f"http://127.0.0.1:{port} " in told, told
        _until("a server that listens", lambda: _listens(port))
        yield f"http://127.0.0.1:{port}"
    finally:
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=30.0)
    assert process.returncode == 130
    assert "Traceback" not in rest


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _until(what: str, told: Callable[[], Any], seconds: float = WAIT) -> Any:
    """What a question answers once it answers with anything."""
    until = time.monotonic() + seconds
    while True:
        try:
            if answer := told():
                return answer
        except webdriver.remote.webdriver.WebDriverException:
            pass  # the page is being built, or drawn anew
        assert time.monotonic() < until, f"no {what} within {seconds:g} s"
        time.sleep(0.1)


def _all(browser: Any, selector: str) -> list[Any]:
    return [e for e in browser.find_elements("css selector", selector) if e.is_displayed()]


def _one(browser: Any, selector: str, seconds: float = WAIT) -> Any:
    return _until(selector, lambda: _all(browser, selector), seconds)[0]


def _click(browser: Any, selector: str) -> None:
    element = _one(browser, selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", element)

    def clicked() -> bool:
        element.click()
        return True

    _until(f"click on {selector}", clicked)


def _curves(browser: Any, plot: str) -> dict[str, list[float]]:
    """Curves of a picture by name, as the browser has drawn them."""
    script = (
        "const e = document.querySelector(arguments[0]); const p = e?.data ? e : e?.querySelector('.js-plotly-plot');"
        "return p?.data ? p.data.map(t => [t.name, t.y]) : []"
    )
    return dict(browser.execute_script(script, f'[data-plot="{plot}"]'))


def _open(browser: Any, server: str) -> None:
    browser.get_log("performance")
    browser.get(server)
    _one(browser, "[data-act=demo]")


def _take_demo(browser: Any) -> None:
    _click(browser, "[data-act=demo]")
    _until("curve", lambda: len(_curves(browser, "measured")) == 10)
    _until("curve", lambda: "the model" in _curves(browser, "model"))


def _pick(browser: Any, which: str, *paths: Path) -> None:
    browser.find_element("css selector", f"[data-pick={which}]").send_keys("\n".join(map(str, paths)))


def _asked_elsewhere(browser: Any, server: str) -> list[str]:
    """Addresses that the page asked for and that are not the server's."""
    asked = [json.loads(line["message"])["message"] for line in browser.get_log("performance")]
    urls = [m["params"]["request"]["url"] for m in asked if m["method"] == "Network.requestWillBeSent"]
    return [u for u in urls if not u.startswith((server, "data:", "blob:", "chrome:"))]


def _downloaded(browser: Any, name: str) -> Path:
    _click(browser, f'[data-file="{name}"]')
    path: Path = browser.downloads / name
    _until(name, path.is_file)
    return path


def test_load_slide_diagnose_read_and_download(browser: Any, server: str) -> None:
    _open(browser, server)
    _take_demo(browser)
    assert "Demonstration campaign" in _one(browser, ".page-title").text

    # The head moves: the curve follows, and the line under it says that it took no time.
    before = _curves(browser, "model")["the model"]
    thumb = _one(browser, "[data-slider=position] [tabindex]")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", thumb)
    thumb.send_keys(webdriver.Keys.ARROW_RIGHT * 5)
    _until("moved curve", lambda: _curves(browser, "model")["the model"] != before)
    _click(browser, "[data-act=absorber]")
    _until("absorber", lambda: "with the absorber" in _curves(browser, "model"))
    facts = _one(browser, "[data-facts=model]").text
    peaks = [float(v) for v in re.findall(r"peak ([\d.]+)", facts)]
    at_work = [float(v) for v in re.findall(r"([\d.]+) at 217 Hz", facts)]
    assert at_work[1] < 0.6 * at_work[0], facts
    assert peaks[1] < peaks[0], facts
    with_absorber = _curves(browser, "model")["with the absorber"]
    _one(browser, "[data-slider=mass] [tabindex]").send_keys(webdriver.Keys.ARROW_RIGHT * 5)
    _until("other absorber", lambda: _curves(browser, "model")["with the absorber"] != with_absorber)
    _click(browser, "[data-act=controller]")
    _until("choices", lambda: len(_all(browser, ".q-menu .q-item")) == 7)
    next(e for e in _all(browser, ".q-menu .q-item") if "position feedback" in e.text).click()
    _until("controller", lambda: "with the controller" in _curves(browser, "model"))
    longest = (
        "const e = document.querySelector('[data-plot=rail]'); const p = e?.data ? e : e?.querySelector('.js-plotly-plot');"
        "return Math.max(0, ...(p?.data ?? []).filter(t => t.name === 'with the controller').map(t => t.y.length))"
    )
    _until("controller over the rail", lambda: browser.execute_script(longest) > 10)

    # The diagnosis runs in the background, can be cancelled, and begun again.
    _click(browser, "[data-act=diagnose]")
    _until("progress", lambda: "Diagnosing" in _one(browser, ".progress").text)
    _click(browser, "[data-act=cancel]")
    _until("cancelled", lambda: "Cancelled after" in _one(browser, ".clock").text)
    assert not _all(browser, "[data-verdict]")
    _click(browser, "[data-act=diagnose]")
    _until("progress", lambda: "Diagnosing" in _one(browser, ".progress").text)

    # A bad upload meanwhile is told in a line, and neither the campaign nor its diagnosis is lost.
    _pick(browser, "files", DEMO / "machine.toml")
    error = _until("error", lambda: [e.text for e in _all(browser, ".error") if e.text])[0]
    assert error.startswith("no campaign.toml among the uploaded files")
    assert "“Demonstration campaign” stays open" in error
    assert len(_curves(browser, "measured")) == 10

    assert "local_resonator" not in _one(browser, ".progress").text
    verdict = _one(browser, "[data-verdict]", DIAGNOSIS).text
    assert "explained" in verdict.lower()
    _until("corrected curves", lambda: len(_curves(browser, "measured")) == 15)
    browser.switch_to.frame(_one(browser, "iframe.report"))
    assert "Demonstration campaign" in _one(browser, "h1").text
    _until("charts of the report", lambda: _all(browser, "#frf .main-svg") and _all(browser, "#map .main-svg"))
    browser.switch_to.default_content()

    # The report in its frame turns dark with the page.
    theme = "return document.querySelector('iframe.report').contentDocument.documentElement.dataset.theme"
    assert browser.execute_script(theme) == "light"
    for wanted in ("light", "dark"):  # from that of the system, in this order
        _click(browser, "[aria-label='light or dark']")
        _until(f"{wanted} report", lambda wanted=wanted: browser.execute_script(theme) == wanted)

    result = json.loads(_downloaded(browser, "diagnosis.json").read_text(encoding="utf-8"))
    assert result["schema"] == "cutvib-diagnosis/1"
    assert (result["causes"][0]["effect"], result["causes"][0]["place"]) == ("local_resonator", "head")
    corrected = _downloaded(browser, "corrected-machine.toml")
    assert tomllib.loads(corrected.read_text(encoding="utf-8"))["effect"][0]["effect"] == "local_resonator"
    assert read_machine(corrected).effects
    assert "</html>" in _downloaded(browser, "report.html").read_text(encoding="utf-8")

    # A reload finds it all again.
    browser.refresh()
    assert "explained" in _one(browser, "[data-verdict]").text.lower()
    _until("corrected curves", lambda: len(_curves(browser, "measured")) == 15)
    faults = [line["message"] for line in browser.get_log("browser") if line["level"] == "SEVERE"]
    assert all("422" in message for message in faults), faults  # the bad upload's answer
    assert not _asked_elsewhere(browser, server)


def test_a_dropped_folder_is_read_and_a_structure_has_no_position(browser: Any, server: str, tmp_path: Path) -> None:
    folder = tmp_path / "two-masses"
    folder.mkdir()
    (folder / "machine.toml").write_text(TWO_MASSES, encoding="utf-8")
    (folder / "campaign.toml").write_text(
        '[campaign]\ntitle = "Two masses"\nmachine = "machine.toml"\n\n[[record]]\nfile = "records/frf.csv"\n'
        'kind = "frf"\naverages = 3\n',
        encoding="utf-8",
    )
    (folder / "records").mkdir()
    machine = read_machine(folder / "machine.toml")
    write_frf(frequency_response(machine, None, np.arange(1.0, 60.0, 0.25)), folder / "records" / "frf.csv")
    _open(browser, server)
    at = _one(browser, ".drop-zone").rect
    dropped = {"items": [], "files": [str(folder)], "dragOperationsMask": 1}
    for event in ("dragEnter", "dragOver", "drop"):
        browser.execute_cdp_cmd(
            "Input.dispatchDragEvent", {"type": event, "x": at["x"] + 40, "y": at["y"] + 20, "data": dropped}
        )
    _until("title", lambda: _one(browser, ".page-title").text == "Two masses")
    _until("curve", lambda: len(_curves(browser, "measured")) == 2)
    assert not _all(browser, "[data-slider=position]")
    assert not _all(browser, "[data-act=controller]")
    _click(browser, "[data-act=absorber]")
    _until("absorber", lambda: "with the absorber" in _curves(browser, "model"))
    assert not [line for line in browser.get_log("browser") if line["level"] == "SEVERE"]


def test_a_folder_is_uploaded_with_its_paths_and_a_zip_unpacked(browser: Any, server: str, tmp_path: Path) -> None:
    _open(browser, server)
    assert not _all(browser, "[data-plot]")
    _pick(browser, "folder", DEMO)
    _until("curve", lambda: len(_curves(browser, "measured")) == 10)
    bad = tmp_path / "bad.zip"
    bad.write_bytes(b"no zip")
    _pick(browser, "files", bad)
    error = _until("error", lambda: [e.text for e in _all(browser, ".error") if e.text])[0]
    assert error.startswith("bad.zip: cannot be unpacked")
    other = tmp_path / "other"
    shutil.copytree(DEMO, other)
    text = (other / "campaign.toml").read_text(encoding="utf-8")
    (other / "campaign.toml").write_text(text.replace("Demonstration", "Zipped"), encoding="utf-8")
    _pick(browser, "files", Path(shutil.make_archive(str(tmp_path / "good"), "zip", other)))
    _until("title", lambda: _one(browser, ".page-title").text == "Zipped campaign")
    assert not [e.text for e in _all(browser, ".error") if e.text]


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_the_page_fits_a_phone_and_a_desktop_and_takes_its_colours(
    browser: Any, server: str, width: int, dark: bool
) -> None:
    metrics = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [scheme]})
    _open(browser, server)
    _take_demo(browser)
    wide = browser.execute_script(
        "return [...document.querySelectorAll('.page-main *')].filter(e => e.getBoundingClientRect().right > innerWidth + 1"
        " && !e.closest('.q-table__middle, .progress, svg')).map(e => e.outerHTML.slice(0, 120))"
    )
    assert not wide
    assert browser.execute_script("return document.documentElement.scrollWidth") <= width
    ink, card = browser.execute_script(
        "const c = getComputedStyle(document.querySelector('.card'));"
        "const t = document.querySelector('[data-plot=model] .xtick text');"
        "return [getComputedStyle(t).fill, c.backgroundColor]"
    )
    assert _contrast(ink, card) > 7.0


def _contrast(one: str, other: str) -> float:
    """WCAG contrast of two colours as the browser gives them."""

    def luminance(colour: str) -> float:
        parts = [int(v) / 255 for v in re.findall(r"\d+", colour)[:3]]
        r, g, b = (v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in parts)
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def test_another_name_of_the_machine_is_refused(server: str) -> None:
    foreign = urllib.request.Request(server, headers={"Host": "example.org"})
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(foreign)
    refused.value.close()
    assert refused.value.code == 400
    with urllib.request.urlopen(server) as page:
        assert "default-src 'self'" in page.headers["Content-Security-Policy"]
