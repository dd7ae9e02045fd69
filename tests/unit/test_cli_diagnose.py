"""`cutvib diagnose`: which records and lines it takes, what it says meanwhile, how it ends when stopped."""

import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from cutvib_ss.cli import campaigns, main
from cutvib_ss.cli.campaigns import chosen, without_unknown
from cutvib_ss.cli.progress import Progress
from cutvib_ss.diagnosis.unknown_element import unknown_candidates
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement import Campaign, read_campaign
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import read_machine, write_machine
from tests.unit.diagnosis_example import example_diagnosis

DEMO = Path(campaigns.__file__).parents[1] / "data" / "demo"


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return read_campaign(DEMO)


def test_records_are_chosen_by_pattern_and_all_get_the_band(campaign: Campaign) -> None:
    found = chosen(campaign, (50.0, 300.0), ["records/p[12]*", "records/p5.tdms"])
    assert [r.name for r in found.records] == ["records/p1.tdms", "records/p2.tdms", "records/p5.tdms"]
    assert {r.band_hz for r in found.records} == {(50.0, 300.0)}
    assert chosen(campaign, None, ()) == campaign


def test_a_pattern_that_matches_nothing_is_answered_with_names(campaign: Campaign) -> None:
    with pytest.raises(ParameterError, match=r"--records q\*: matches no record; there are records/p1\.tdms"):
        chosen(campaign, None, ["q*"])


@pytest.mark.parametrize("band", ["50", "300:50", "a:b", "0:10"])
def test_an_impossible_band_is_refused(band: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", str(DEMO), "--band", band]) == 2
    assert f"--band {band}" in capsys.readouterr().err


@pytest.mark.parametrize(
    "wrong", [["nowhere"], [str(DEMO), "--machine", "none.toml"], [str(DEMO), "--json", "no/a.json"]]
)
def test_simple_errors_load_neither_control_nor_the_diagnosis(wrong: list[str]) -> None:
    code = (
        "import sys; from cutvib_ss.cli import main; status = main(); "
        "print({'control', 'cutvib_ss.diagnosis.diagnose'} & set(sys.modules)); sys.exit(status)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code, "diagnose", *wrong], capture_output=True, text=True, check=False, timeout=60
    )
    assert (ended.returncode, ended.stdout) == (2, "set()\n"), ended.stderr
    assert len(ended.stderr.splitlines()) == 1


def test_reading_a_campaign_does_not_load_control() -> None:
    code = "import sys, cutvib_ss.measurement.campaign; sys.exit('control' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0


@pytest.mark.parametrize(
    ("command", "unit"),
    [
        ("simulate", "[s]."),
        ("simulate", "[m/s]."),
        ("simulate", "[m/s^2]."),
        ("plan", "[s]."),
        ("absorber design", "[kg]"),
    ],
)
def test_units_stand_in_the_help(command: str, unit: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.split(), "--help"]) == 0
    said = capsys.readouterr().out
    assert unit in said
    assert "\\[" not in said


def test_help_says_that_a_diagnosis_cannot_be_resumed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", "--help"]) == 0
    assert "cannot be resumed" in " ".join(capsys.readouterr().out.split())


def test_progress_is_a_plain_line_for_each_step(capsys: pytest.CaptureFixture[str]) -> None:
    with Workers(1, Progress(None)) as workers:
        workers.say("squaring")
        assert workers.map(abs, [-1, -2, -3]) == [1, 2, 3]
        workers.say("resting")
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(None, 1)[1] for line in lines] == ["squaring", "resting"]
    assert all(re.match(r" *0:\d\d ", line) for line in lines)


def test_workers_tell_how_far_a_step_has_come() -> None:
    said: list[str] = []
    with Workers(1, said.append) as workers:
        workers.say("squaring")
        workers.map(abs, [-1, -2])
    assert said == ["squaring", "squaring: 1 of 2", "squaring: 2 of 2"]


def test_a_corrected_machine_is_saved_without_the_element_of_unknown_form(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    known = LocalResonator("head", 1.5, 170.0, 0.05).apply(published_machine())
    element = next(c for c in unknown_candidates(known, (15.0, 450.0)) if c.starts[0].place == "joint2").starts[0]
    both = element.apply(known)
    assert without_unknown(known) == (known, "")
    assert without_unknown(both) == (known, "joint2")
    found = replace(example_diagnosis(lines=20, records=1), corrected_machine=both)
    monkeypatch.setattr(campaigns, "diagnosis_of", lambda *_: found)
    saved = tmp_path / "corrected.toml"
    assert main(["diagnose", str(DEMO), "--save-machine", str(saved)]) == 0
    assert "without the element of unknown form at joint2" in capsys.readouterr().err
    write_machine(known, tmp_path / "known.toml")
    assert read_machine(saved) == read_machine(tmp_path / "known.toml")


@pytest.mark.slow
def test_ctrl_c_leaves_one_line_and_no_tracebacks_of_workers(tmp_path: Path) -> None:
    code = (
        "import signal, sys\nfrom cutvib_ss.cli import main\n"
        # A process in the background may have been started with SIGINT ignored.
        "if __name__ == '__main__':\n    signal.signal(signal.SIGINT, signal.default_int_handler)\n    sys.exit(main())"
    )
    said = tmp_path / "said.txt"
    with said.open("w") as stream:
        started = subprocess.Popen(
            [sys.executable, "-c", code, "diagnose", str(DEMO), "--jobs", "2"], stderr=stream, start_new_session=True
        )
    until = time.monotonic() + 120
    while "fitting" not in said.read_text() and time.monotonic() < until:
        time.sleep(0.2)
    time.sleep(2.0)  # the workers are at it
    os.killpg(started.pid, signal.SIGINT)  # as a terminal does: to parent and workers
    assert started.wait(timeout=60) == 130
    assert "Traceback" not in said.read_text()
    assert said.read_text().splitlines()[-1] == "cutvib: stopped"
    time.sleep(1.0)
    listed = subprocess.run(
        ["ps", "-eo", "pgid=,stat="], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    states = [stat for group, stat in (line.split() for line in listed) if int(group) == started.pid]
    assert all(state.startswith("Z") for state in states)  # none that still runs
