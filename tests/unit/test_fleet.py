"""Every campaign below a folder: the table, what is kept, what is done anew, what cannot be done."""

import json
import re
import shutil
from pathlib import Path
from typing import Any

import pytest

from cutvib_ss.cli import main
from cutvib_ss.cli.output import json_text
from cutvib_ss.errors import CutvibError
from cutvib_ss.fleet import KEPT, Diagnosed, FleetRow, Task, _files, _task, diagnose_fleet, diagnose_one, table_data
from cutvib_ss.report.fleet import fleet_html
from tests.unit.blind_example import diagnosis
from tests.unit.test_blind_measured import MASS, write

NONE = diagnosis([("none", "none", 0.98), ("unknown", "drive", 0.02)], "no_gap", warnings=["r0.csv: <noisy>"])
NONE["where"]["place_set"] = ["none"]
NONE["gap"]["shrinkage_interval"] = [None, None]


def strict(text: str) -> Any:
    def refuse(constant: str) -> None:
        pytest.fail(f"{constant} in JSON")

    return json.loads(text, parse_constant=refuse)


class Counting:
    """A worker that diagnoses nothing and remembers what it was given."""

    def __init__(self, fails: str = "") -> None:
        self.asked: list[str] = []
        self.fails = fails

    def __call__(self, task: Task) -> Diagnosed:
        self.asked.append(task.name)
        if task.name == self.fails:
            return Diagnosed(None, None, "no memory")
        return Diagnosed(json.dumps(NONE).encode(), b"<html></html>" if task.report else None, "")


@pytest.fixture
def fleet(tmp_path: Path) -> Path:
    """Two campaigns of oscillators at different depths."""
    root = tmp_path / "fleet"
    write(root / "hall" / "heavier", 1.1 * MASS, None, 1)
    write(root / "plain", MASS, None, 2)
    return root


@pytest.mark.slow
def test_command_diagnoses_and_the_second_goes_on(
    fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(fleet / "plain", fleet / "spoilt")
    (fleet / "spoilt" / "r1.csv").unlink()
    (fleet / "empty").mkdir()
    (fleet / "empty" / "campaign.toml").write_text("[campaign]\n")
    file, page = tmp_path / "fleet.json", tmp_path / "fleet.html"
    command = ["fleet", str(fleet), "--json", str(file), "--report", str(page), "--reports"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "no [[record]]" in said
    data = strict(file.read_text())
    assert data["schema"] == "cutvib-fleet/1"
    empty, heavier, plain, spoilt = data["campaigns"]
    assert [r["campaign"] for r in data["campaigns"]] == ["empty", "hall/heavier", "plain", "spoilt"]
    assert heavier["probability"] > 0.5
    assert heavier["after"] < heavier["before"]
    assert heavier["error"] is None
    assert (plain["verdict"], plain["effect"], plain["place"]) == ("no_gap", "none", "none")
    assert "r1.csv" in spoilt["error"]
    assert (empty["verdict"], spoilt["verdict"]) == (None, None)
    # What is kept is the diagnosis itself, and the page leads to each report.
    assert strict(Path(heavier["diagnosis"]).read_text())["causes"][0]["effect"] == heavier["effect"]
    links = re.findall(r'<a href="([^"]+)"', page.read_text())
    assert len(links) == 2
    assert all((tmp_path / link).read_text().startswith("<!DOCTYPE html>") for link in links)

    times = {p: p.stat().st_mtime_ns for p in (fleet / KEPT).rglob("*.json")}
    assert main(command) == 0
    again = strict(file.read_text())["campaigns"]
    assert [r["resumed"] for r in again] == [False, True, True, False]
    assert {p: p.stat().st_mtime_ns for p in (fleet / KEPT).rglob("*.json")} == times
    assert [{**r, "resumed": False} for r in again] == data["campaigns"]


def test_only_what_is_not_done_is_diagnosed(fleet: Path) -> None:
    first = Counting(fails="plain")
    rows = diagnose_fleet(fleet, worker=first)
    assert first.asked == ["hall/heavier", "plain"]
    assert [r.error for r in rows] == [None, "no memory"]
    second = Counting()
    rows = diagnose_fleet(fleet, worker=second)
    assert second.asked == ["plain"]
    assert [r.resumed for r in rows] == [True, False]
    third = Counting()
    diagnose_fleet(fleet, worker=third)
    assert third.asked == []
    # Reports cannot be made of what is kept.
    reports = Counting()
    assert all(r.report for r in diagnose_fleet(fleet, worker=reports, reports=True))
    assert reports.asked == ["hall/heavier", "plain"]


def test_broken_campaign_is_a_row(fleet: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (fleet / "plain" / "r1.csv").unlink()
    (fleet / "hall" / "heavier" / "campaign.toml").write_text("[campaign]\n")
    file = tmp_path / "fleet.json"
    assert main(["fleet", str(fleet), "--json", str(file)]) == 0
    assert "r1.csv" in capsys.readouterr().out
    data = strict(file.read_text())
    heavier, plain = data["campaigns"]
    assert (data["schema"], heavier["campaign"], plain["campaign"]) == ("cutvib-fleet/1", "hall/heavier", "plain")
    assert "no [[record]]" in heavier["error"]
    assert "r1.csv" in plain["error"]
    assert plain["verdict"] is None
    # Beside a broken one the others are diagnosed.
    write(fleet / "sound", MASS, None, 3)
    last = diagnose_fleet(fleet, worker=Counting())[-1]
    assert (last.campaign, last.verdict, last.place_set, last.before) == ("sound", "no_gap", ("none",), 0.0286)
    assert strict(json_text(table_data([last])))["campaigns"][0]["shrinkage_interval"] == [None, None]


def test_stop_keeps_what_is_done(fleet: Path) -> None:
    def stopped(task: Task) -> Diagnosed:
        if task.name == "plain":
            raise KeyboardInterrupt
        return Counting()(task)

    with pytest.raises(KeyboardInterrupt):
        diagnose_fleet(fleet, worker=stopped)
    rest = Counting()
    diagnose_fleet(fleet, worker=rest)
    assert rest.asked == ["plain"]


@pytest.mark.parametrize("changed", ["r1.csv", "machine.toml", "campaign.toml"])
def test_changed_file_is_diagnosed_anew(fleet: Path, changed: str) -> None:
    diagnose_fleet(fleet, worker=Counting())
    before = list((fleet / KEPT / "plain").iterdir())
    (fleet / "plain" / "notes.txt").write_text("no record")
    file = fleet / "plain" / changed
    file.write_text(file.read_text() + "\n")
    counting = Counting()
    diagnose_fleet(fleet, worker=counting)
    assert counting.asked == ["plain"]
    after = list((fleet / KEPT / "plain").iterdir())
    assert len(after) == 1
    assert after != before


def test_spoilt_diagnosis_is_made_anew(fleet: Path) -> None:
    (row, _) = diagnose_fleet(fleet, worker=Counting())
    assert row.diagnosis is not None
    Path(row.diagnosis).write_text('{"verdict": ')
    counting = Counting()
    assert [r.verdict for r in diagnose_fleet(fleet, worker=counting)] == ["no_gap", "no_gap"]
    assert counting.asked == ["hall/heavier"]


def test_out_is_no_campaign_and_files_of_others_stay(fleet: Path) -> None:
    out = fleet / "kept"
    (out / "plain").mkdir(parents=True)
    (out / "plain" / "mine.json").write_text("{}")
    diagnose_fleet(fleet, out=out, worker=Counting())
    shutil.copytree(fleet / "plain", out / "copied")
    counting = Counting()
    diagnose_fleet(fleet, out=out, worker=counting)
    assert counting.asked == []
    assert (out / "plain" / "mine.json").is_file()
    assert not (fleet / KEPT).exists()


@pytest.mark.slow
def test_worker_elsewhere_gets_every_file(fleet: Path) -> None:
    """A machine.toml that several campaigns share lies outside their folders, and here outside the fleet's."""
    (fleet / "plain" / "machine.toml").rename(fleet.parent / "shared.toml")
    file = fleet / "plain" / "campaign.toml"
    file.write_text(file.read_text().replace("machine.toml", "../../shared.toml"))
    task = _task(fleet, "plain", _files(fleet / "plain"), False, True)
    assert task.archive is not None
    shutil.rmtree(fleet)
    (fleet.parent / "shared.toml").unlink()
    found = diagnose_one(task)
    assert found.error == ""
    assert found.diagnosis is not None
    assert strict(found.diagnosis.decode())["verdict"] == "no_gap"


def test_nothing_to_diagnose_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for folder in (tmp_path, tmp_path / "nowhere"):
        assert main(["fleet", str(folder)]) == 2
        said = capsys.readouterr()
        assert said.err.count("\n") == 1
        assert str(folder) in said.err
        assert said.out == ""
    assert list(tmp_path.iterdir()) == []


def test_page_loads_nothing_and_escapes(tmp_path: Path) -> None:
    rows = (
        FleetRow("a", "no_gap", "none", "none", ("none",), 0.98, "g/N", 0.02, 0.002, 0.9, (None, None), ("<noisy>",)),
        FleetRow("b", error="b/campaign.toml: <broken>"),
    )
    page = fleet_html(rows, tmp_path / "fleet.html")
    assert not re.search(r'(?:src|href)="[^"#]|https?://|url\(', page)
    assert "2 campaigns. No gap: 1. 1 could not be diagnosed." in page
    assert "&lt;noisy&gt;" in page
    assert "b/campaign.toml: &lt;broken&gt;" in page
    assert "0.02 g/N" in page


def test_a_nominal_model_of_its_own_is_given_to_every_campaign(fleet: Path) -> None:
    own, given = Counting(), []

    def remembers(task: Task) -> Diagnosed:
        given.append(task.machine)
        return own(task)

    diagnose_fleet(fleet, worker=own)
    machine = fleet / "plain" / "machine.toml"
    diagnose_fleet(fleet, machine=machine, worker=remembers)
    assert given == [machine.read_bytes()] * 2
    # Another model is another diagnosis; the same goes on where it was.
    diagnose_fleet(fleet, machine=machine, worker=remembers)
    assert len(given) == 2
    with pytest.raises(CutvibError, match="absent"):
        diagnose_fleet(fleet, machine=fleet / "absent.toml", worker=own)
