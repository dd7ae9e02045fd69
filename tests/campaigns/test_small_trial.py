"""A small sealed trial with the package's own rig and diagnosis, from the first blow to the score."""

import json
from pathlib import Path
from typing import Any

import pytest

from cutvib_ss.cli import main

pytest.importorskip("exudyn")


def run(out: Path, cases: int, seed: int, mix: str) -> dict[str, Any]:
    """A trial of small campaigns, run and scored: its score."""
    command = ["blind", "run", "--cases", str(cases), "--seed", str(seed), "--mix", mix, "--small", "--out", str(out)]
    assert main([*command, "--jobs", "2"]) == 0
    assert main(["blind", "score", str(out), "--json", str(out / "score.json")]) == 0
    score: dict[str, Any] = json.loads((out / "score.json").read_text())
    assert len(score["cases"]) == cases
    return score


@pytest.mark.slow
def test_a_small_trial(tmp_path: Path) -> None:
    out = tmp_path / "trial"
    score = run(out, 6, 37, "none=3,outside=1,pair=0,drifting=0,varied=0,rough=0,structure=0")
    rows = {row["key"]: row for row in score["rows"]}
    assert rows["failed"]["value"] == 0.0
    assert rows["false_alarm"]["value"] == 0.0
    assert rows["right_all"]["value"] >= 4 / 6
    assert rows["sure_and_wrong"]["value"] <= 1 / 6
    # The oracle judges what stands still and has nothing wrong with it, and knows that.
    assert rows["log_score_lost"]["cases"] >= 3
    assert rows["oracle_log_score"]["value"] < 0.5
    # No diagnosis had the words of a label at hand.
    told = json.loads((out / "labels.json").read_text())["labels"]
    for name in told:
        folder = out / "campaigns" / name
        text = (folder / "campaign.toml").read_text() + (folder / "machine.toml").read_text()
        assert not any(
            effect in text for effect in told[name]["effect"].replace("outside:", "").split("+") if effect != "none"
        )


@pytest.mark.slow
def test_a_small_trial_as_hard_as_the_large_one(tmp_path: Path) -> None:
    # Machines that drift, causes of other forms, real instruments, other structures: what is checked here is the trial, not how
    # good the diagnosis is.
    score = run(tmp_path / "trial", 6, 41, "none=2,outside=1,pair=1,drifting=3,varied=6,rough=3,structure=3")
    rows = {row["key"]: row for row in score["rows"]}
    assert rows["failed"]["value"] <= 1 / 6
    assert rows["false_alarm_drifting"]["cases"] == 1
    groups = {title: [group["name"] for group in own] for title, own in score["groups"].items()}
    assert groups["by kind"] == ["none", "outside", "pair", "single"]
    assert len(groups["by machine"]) >= 2
    assert any("drifts" in name for name in groups["by repeatability"])
    assert max(case["grade"] for case in score["cases"]) >= 1
