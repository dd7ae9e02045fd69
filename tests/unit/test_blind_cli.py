"""The commands of the sealed trial: their files, their exit status, their words."""

import json
from pathlib import Path

import pytest

from cutvib_ss.cli import main
from cutvib_ss.errors import ParameterError
from cutvib_ss.validation import trial as trials
from cutvib_ss.validation.workers import spread
from tests.unit.blind_example import TOOLS

RUN = ["blind", "run", "--cases", "6", "--seed", "5", "--mix", "none=4,outside=1"]


@pytest.fixture(autouse=True)
def tiny(monkeypatch: pytest.MonkeyPatch) -> None:
    """The tiny rig and the fake diagnosis in place of the package's own."""
    monkeypatch.setattr(trials, "package_tools", lambda: TOOLS)
    for module in ("cutvib_ss.validation.seal", "tests.unit.blind_example"):
        monkeypatch.setattr(f"{module}.code_hash", lambda: "c" * 64)


def test_run_and_score(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "trial"
    assert main([*RUN, "--out", str(out), "--jobs", "2"]) == 0
    said = capsys.readouterr()
    assert "6 cases diagnosed" in said.out
    assert "diagnoses: 6 of 6" in said.err
    targets = [tmp_path / name for name in ("s.json", "s.html", "s.md")]
    score = ["blind", "score", str(out), "--json", str(targets[0])]
    assert main([*score, "--report", str(targets[1]), "--report", str(targets[2])]) == 0
    said = capsys.readouterr().out
    assert "right cause first, gap ≥ 2 σ" in said
    assert "By cause" in said
    data = json.loads(targets[0].read_text())
    assert data["trial"]["kinds"] == {"none": 4, "outside": 1, "single": 1}
    false_alarm = next(r for r in data["rows"] if r["key"] == "false_alarm")
    assert (false_alarm["value"], false_alarm["cases"], false_alarm["met"]) == (0.0, 4, True)
    # The fake diagnosis sees no gap anywhere, and is sure of it.
    assert len(data["sure_and_wrong"]) == 2
    assert 'id="charts-data"' in targets[1].read_text()
    assert targets[2].read_text().startswith("## Figures")
    # The second opening finds the first, and the score is the same.
    assert main([*score[:-1], "-"]) == 0
    assert json.loads(capsys.readouterr().out) == data


def test_trials_of_one_code_are_scored_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    again = [*RUN[: RUN.index("--seed")], "--seed", "2", *RUN[RUN.index("--seed") + 2 :]]
    assert main([*RUN, "--out", str(one)]) == main([*again, "--out", str(two)]) == 0
    capsys.readouterr()
    together = ["blind", "score", str(one), str(two), "--json", "-"]
    assert main(together) == 2
    assert "not open" in capsys.readouterr().err
    counts = []
    for trial in (one, two):
        assert main(["blind", "score", str(trial), "--json", "-"]) == 0
        counts.append(len(json.loads(capsys.readouterr().out)["cases"]))
    assert main(together) == 0
    found = json.loads(capsys.readouterr().out)
    assert len(found["cases"]) == sum(counts)
    assert [found["trial"]["settings"]["seed"], found["trial"]["with"][0]["settings"]["seed"]] == [5, 2]
    commitment = json.loads((two / "commitment.json").read_text())
    commitment["code_sha256"] = "0" * 64
    (two / "commitment.json").write_text(json.dumps(commitment))
    assert main(together) == 2
    assert "other code" in capsys.readouterr().err


def test_json_on_standard_output_is_all_there_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "trial"
    assert main([*RUN, "--out", str(out)]) == 0
    capsys.readouterr()
    assert main(["blind", "score", str(out), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["schema"] == "cutvib-blind-score/1"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "--cases", "0", "--seed", "1", "--out", "{}"], "at least one case"),
        (["run", "--cases", "4", "--seed", "1", "--out", "{}", "--mix", "all"], "KIND=NUMBER"),
        (["run", "--cases", "4", "--seed", "1", "--out", "{}", "--severity", "weak"], "LO:HI"),
        (["run", "--cases", "4", "--seed", "1", "--out", "{}/file"], "not empty"),
        (["run", "--cases", "4", "--out", "{}"], "--seed"),
        (["score", "{}"], "no sealed trial"),
        (["score", "{}", "--report", "{}/score.pdf"], "ends in .html"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert main(["blind", *(a.format(tmp_path) for a in arguments)]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert {p.name for p in tmp_path.iterdir()} == {"file"}


def test_code_that_changed_is_exit_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "trial"
    assert main([*RUN, "--out", str(out)]) == 0
    monkeypatch.setattr("cutvib_ss.validation.seal.code_hash", lambda: "d" * 64)
    capsys.readouterr()
    assert main(["blind", "score", str(out)]) == 2
    assert "code has changed since the labels were sealed" in capsys.readouterr().err


# --- a cluster --------------------------------------------------------------------------------------------------------


def double(x: int) -> int:
    return 2 * x


def number(x: int) -> int:
    return x


@pytest.mark.filterwarnings("ignore")
def test_a_dask_scheduler_spreads_the_tasks() -> None:
    distributed = pytest.importorskip("distributed")
    from functools import partial

    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None, protocol="tcp", host="127.0.0.1"
    ) as cluster:
        tasks = [(str(k), partial(number, k)) for k in range(9)]
        found = dict(spread(double, tasks, 2, cluster.scheduler_address))
    assert found == {str(k): 2 * k for k in range(9)}


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_is_not_there() -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ParameterError, match="no Dask scheduler answers"):
        dict(spread(double, [], 1, "nonsense://nowhere"))
