"""A small sealed trial with the package's own rig and diagnosis, from the first blow to the score."""

import json
from pathlib import Path

import pytest

from cutvib_ss.cli import main

pytest.importorskip("exudyn")


# Its plan has one cause that is simulated, which cost most: with three the gate would take longer than it may.
SEED = "37"


@pytest.mark.slow
def test_a_small_trial(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "trial"
    run = [
        "blind",
        "run",
        "--cases",
        "12",
        "--seed",
        SEED,
        "--mix",
        "none=7,outside=1,drifting=0,varied=0,rough=0,structure=0",
        "--small",
        "--out",
        str(out),
        "--jobs",
        "2",
    ]
    assert main(run) == 0
    assert main(["blind", "score", str(out), "--json", str(tmp_path / "score.json")]) == 0
    score = json.loads((tmp_path / "score.json").read_text())
    figures = {row["key"]: row["value"] for row in score["rows"]}
    assert len(score["cases"]) == 12
    assert figures["failed"] == 0.0
    assert figures["false_alarm"] == 0.0
    assert figures["right_all"] >= 8 / 12
    assert figures["sure_and_wrong"] <= 1 / 12
    assert figures["chi2_median"] < 1.2
    # No diagnosis had the words of a label at hand.
    told = json.loads((out / "labels.json").read_text())["labels"]
    for name in told:
        text = (out / "campaigns" / name / "campaign.toml").read_text() + (
            out / "campaigns" / name / "machine.toml"
        ).read_text()
        assert not any(
            effect in text for effect in told[name]["effect"].replace("outside:", "").split("+") if effect != "none"
        )


@pytest.mark.slow
def test_a_small_trial_as_hard_as_the_large_one(tmp_path: Path) -> None:
    # Machines that drift, causes of other forms, real instruments, other structures: what is checked here is the trial, not how
    # good the diagnosis is.
    out = tmp_path / "trial"
    run = [
        "blind",
        "run",
        "--cases",
        "12",
        "--seed",
        "41",
        "--mix",
        "none=4,outside=2,pair=1",
        "--small",
        "--out",
        str(out),
    ]
    assert main([*run, "--jobs", "2"]) == 0
    assert main(["blind", "score", str(out), "--json", str(tmp_path / "score.json")]) == 0
    score = json.loads((tmp_path / "score.json").read_text())
    figures = {row["key"]: row for row in score["rows"]}
    assert len(score["cases"]) == 12
    assert figures["failed"]["value"] <= 1 / 12
    assert figures["right_varied"]["cases"] >= 1
    assert figures["false_alarm_drifting"]["cases"] >= 1
    names = {title: [group["name"] for group in groups] for title, groups in score["groups"].items()}
    assert names["by kind"] == ["none", "outside", "pair", "single"]
    assert len(names["by machine"]) >= 2
    assert any("drifts" in name for name in names["by repeatability"])
