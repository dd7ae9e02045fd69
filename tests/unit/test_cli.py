"""The commands: their JSON as outside programs read it, their files, their help, their exit status."""

import contextlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.text import Text
from typer.main import get_command

from cutvib_ss.absorber import check_absorber
from cutvib_ss.cli import campaigns, main
from cutvib_ss.cli.app import app
from cutvib_ss.interchange import read_frf
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.parameters import table_7
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes
from tests.unit.diagnosis_example import example_diagnosis, example_structure

DEMO = Path(campaigns.__file__).parents[1] / "data" / "demo"
COMMANDS = [
    "demo", "diagnose", "fleet", "plan", "identify", "paper", "figures", "modes", "frf", "bode", "schedule", "simulate",
    "absorber check",
    "absorber design", "control design", "control check", "blind run", "blind score", "blind real", "blind ranks",
    "campaign init", "campaign show", "serve",
]  # fmt: skip


def _json(text: str) -> Any:
    def refuse(constant: str) -> None:
        pytest.fail(f"{constant} in JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("command", [*COMMANDS, "absorber", "campaign", "control", "blind"])
def test_help_of_each_command_has_an_example(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*command.split(), "--help"]) == 0
    said = capsys.readouterr()
    assert f"Example: cutvib {command}" in " ".join(said.out.split())
    assert said.err == ""


def test_help_shows_its_units() -> None:
    """`[s]` alone is markup, which strikes out what follows and is not shown."""
    tree = get_command(app)
    shown = 0
    for name in COMMANDS:
        command: Any = tree
        for part in name.split():
            command = command.commands[part]
        for text in (getattr(p, "help", None) or "" for p in command.params):
            assert Text.from_markup(text).plain == text.replace("\\[", "["), (name, text)
            shown += "[" in text
    assert shown > 20


def test_help_lists_these_commands_and_no_others(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    listed = {
        line.split()[1] for line in capsys.readouterr().out.splitlines() if line.startswith("│ ") and line[2] != " "
    }
    assert listed - {"--version", "--help", "--install-completion", "--show-completion"} == {
        command.split()[0] for command in COMMANDS
    }
    assert main(["absorber"]) == 0
    assert "design" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        (["cutvib", "camp"], "campaign"),
        (["cutvib", "diagnose", "--sa"], "--save-machine"),
        (["cutvib", "frf", "--form", "mob"], "mobility"),
    ],
)
def test_the_shell_completes_commands_options_and_choices(
    typed: list[str], completed: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_CUTVIB_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", " ".join(typed))
    monkeypatch.setenv("COMP_CWORD", str(len(typed) - 1))
    with contextlib.suppress(SystemExit):
        main([])
    assert capsys.readouterr().out.split() == [completed]


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("cutvib ")


def test_modes_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["modes", "--position", "0.5", "--json", "-"]) == 0
    data = _json(capsys.readouterr().out)
    expected = modes(published_machine(), 0.5)
    assert data["schema"] == "cutvib-modes/1"
    assert data["position"] == 0.5
    assert data["natural_freq_hz"] == expected.natural_freq.tolist()
    assert data["damping_ratio"] == expected.damping_ratio.tolist()
    assert [complex(*p) for p in data["poles"]] == expected.poles.tolist()
    assert all(im > 0 for _, im in data["poles"])
    assert np.array(data["mode_shapes"]).shape == (len(data["dofs"]), 6)


def test_modes_of_a_structure_have_no_position(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_machine(example_structure(), tmp_path / "two.toml")
    assert main(["modes", "--machine", str(tmp_path / "two.toml"), "--json", "-"]) == 0
    data = _json(capsys.readouterr().out)
    assert data["position"] is None
    assert len(data["poles"]) == 2


def test_modes_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["modes", "--position", "0.3333"]) == 0
    said = capsys.readouterr()
    assert "frequency [Hz]" in said.out
    assert "107.9" in said.out
    assert said.err == ""


def test_frf_as_csv_on_standard_output_and_as_a_file_are_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["frf", "--position", "0.5", "--position", "0.25", "--freq", "100:120:0.5", "--form", "mobility"]
    assert main(asked) == 0
    printed = capsys.readouterr().out
    assert main([*asked, "--out", str(tmp_path / "frf.csv")]) == 0
    assert (tmp_path / "frf.csv").read_text() == printed
    assert "Largest response" in capsys.readouterr().out
    back = read_frf(tmp_path / "frf.csv")
    expected = frequency_response(published_machine(), [0.5, 0.25], 100 + 0.5 * np.arange(41), form="mobility")
    assert np.array_equal(back.data, expected.data)
    assert np.array_equal(back.freq, expected.freq)
    assert printed.splitlines()[0].startswith("position,freq [Hz],tool_x re [m/s/N],tool_x im [m/s/N],")


def test_frf_as_json_and_of_any_port(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--position", "0.5", "--freq", "200:210:5", "--output", "rail(0.25)", "--form", "receptance"]
    assert main(["frf", *asked, "--json", "-"]) == 0
    data = _json(capsys.readouterr().out)
    expected = frequency_response(
        published_machine(), [0.5], [200.0, 205.0, 210.0], form="receptance", outputs=["rail(0.25)"]
    )
    assert (data["schema"], data["units"], data["outputs"]) == ("cutvib-frf/1", ["m/N"], ["rail(0.25)"])
    assert np.array_equal(np.array(data["re"]) + 1j * np.array(data["im"]), expected.data)


@pytest.mark.parametrize("suffix", [".uff", ".mat", ".npz"])
def test_frf_writes_each_format(tmp_path: Path, suffix: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["frf", "--position", "0.5", "--freq", "10:20:1", "--out", str(tmp_path / f"a{suffix}")]) == 0
    assert [p.name for p in tmp_path.iterdir()] == [f"a{suffix}"]


def test_bode_draws_and_tells(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["bode", "--position", "0.5", "--freq", "100:300:1", "--out", str(tmp_path / "b.png"), "--json", "-"]
    assert main(asked) == 0
    data = _json(capsys.readouterr().out)
    frf = frequency_response(published_machine(), [0.5], np.arange(100.0, 300.5))
    assert np.allclose(data["magnitude"], np.abs(frf.data), rtol=1e-14)
    assert (tmp_path / "b.png").read_bytes().startswith(b"\x89PNG")


def test_schedule_follows_every_mode_over_the_rail(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures = [tmp_path / "s.svg", tmp_path / "p.png"]
    asked = [
        "schedule",
        "--positions",
        "9",
        "--freq",
        "20:300:2",
        "--out",
        str(pictures[0]),
        "--poles",
        str(pictures[1]),
    ]
    assert main([*asked, "--json", str(tmp_path / "s.json")]) == 0
    data = _json((tmp_path / "s.json").read_text())
    assert data["positions"] == pytest.approx(np.arange(1, 10) / 10)
    middle = modes(published_machine(), 0.5).natural_freq
    assert sorted(data["natural_freq_hz"][4]) == pytest.approx(middle.tolist())
    assert all(p.stat().st_size > 1000 for p in pictures)
    assert "Modes over 9 positions" in capsys.readouterr().out


def test_paper_has_every_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["paper", "--json", "-"]) == 0
    data = _json(capsys.readouterr().out)
    assert data["schema"] == "cutvib-paper/1"
    assert {"1", "3", "5", "6", "7"} <= set(data["tables"])
    assert all(set(row) == {"name", "printed", "computed", "note"} for rows in data["tables"].values() for row in rows)
    sixth = data["tables"]["6"]
    assert len(sixth) == 12
    assert all(abs(row["computed"] / row["printed"] - 1) < 0.002 for row in sixth)


def test_absorber_check_says_what_check_absorber_computes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["absorber", "check", "--out", str(tmp_path / "a.png"), "--json", "-"]) == 0
    data = _json(capsys.readouterr().out)
    expected = check_absorber(published_machine(), table_7())
    assert data["absorber"]["stiffness_n_per_m"] == pytest.approx(141_946, rel=1e-4)
    assert data["reduction"] == expected.reduction.tolist()
    assert len(data["workspace"]["positions"]) == 49
    assert min(data["workspace"]["reduction"]) > 0.5
    assert (tmp_path / "a.png").stat().st_size > 1000


def test_absorber_design_finds_the_best_of_its_grid(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["absorber", "design", "--tuning", "205:225:5", "--damping-ratio", "0.02", "--damping-ratio", "0.04"]
    assert main([*asked, "--json", "-"]) == 0
    data = _json(capsys.readouterr().out)
    worst = np.array(data["worst_m_per_s2_per_n"])
    i, j = np.unravel_index(worst.argmin(), worst.shape)
    assert worst.shape == (5, 2)
    assert data["best"]["frequency_hz"] == data["tuning_hz"][i]
    assert data["best"]["damping_ratio"] == data["damping_ratio"][j]
    assert main(asked) == 0
    assert "Best: " in capsys.readouterr().out


def test_identify_fits_the_demo_and_saves_the_machine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    saved = tmp_path / "fitted.toml"
    assert main(["identify", str(DEMO), "--json", "-", "--save-machine", str(saved)]) == 0
    said = capsys.readouterr()
    data = _json(said.out)
    assert data["schema"] == "cutvib-identify/1"
    assert data["record"] == "records/p1.tdms"
    assert tuple(e["name"] for e in data["parameters"]) == HEAD_PARAMETERS
    assert set(data["head"]) >= {"m1_kg", "l1_m", "theta01_rad", "k1_n_m_per_rad", "c1_n_m_s_per_rad"}
    machine = read_machine(saved)
    assert machine.head.k2 == pytest.approx(data["head"]["k2_n_m_per_rad"])  # type: ignore[union-attr]


@pytest.fixture
def diagnosed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """The diagnosing code replaced by an example; the arguments it was called with."""
    asked: list[tuple[Any, ...]] = []

    def example(*arguments: Any) -> Any:
        asked.append(arguments)
        return example_diagnosis(lines=60, records=1)

    monkeypatch.setattr(campaigns, "diagnosis_of", example)
    return asked


def test_diagnose_writes_json_report_and_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], diagnosed: list[tuple[Any, ...]]
) -> None:
    files = {name: tmp_path / name for name in ("out.json", "out.html", "out.toml")}
    asked = ["diagnose", str(DEMO), "--hold-out", "0.4", "--seed", "3", "--jobs", "2", "--json", str(files["out.json"])]
    with pytest.MonkeyPatch.context() as patch:
        # What the example found is in a slot, not among the effects of the catalogue, and cannot be written as such.
        patch.setattr("cutvib_ss.model_files.write_machine", lambda model, path: Path(path).write_text("machine"))
        status = main([*asked, "--report", str(files["out.html"]), "--save-machine", str(files["out.toml"])])
    assert status == 0
    assert diagnosed == [(DEMO, None, 0.4, 3, 2, None, (), 1.0)]
    data = _json(files["out.json"].read_text())
    assert data["schema"] == "cutvib-diagnosis/1"
    assert data["causes"][1]["parameters"]["damping"]["std"] is None
    assert sum(cause["probability"] for cause in data["causes"]) == pytest.approx(1.0)
    assert "support_compliance" in files["out.html"].read_text()
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(files)
    said = capsys.readouterr()
    assert "the supports under the rail's ends give" in said.out
    assert "k_left (1.310 ± 0.024)·10⁷ N/m" in " ".join(said.out.split())
    assert "left [g/N]" in said.out
    assert "note: records/p2.tdms: blow 2" in said.err


def test_diagnose_gives_nothing_but_json_on_standard_output(
    capsys: pytest.CaptureFixture[str], diagnosed: list[tuple[Any, ...]]
) -> None:
    assert main(["diagnose", str(DEMO), "--json", "-"]) == 0
    assert _json(capsys.readouterr().out)["verdict"] == "explained"


def test_all_outputs_come_to_be_or_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], diagnosed: list[tuple[Any, ...]]
) -> None:
    asked = ["diagnose", str(DEMO), "--json", str(tmp_path / "a.json"), "--save-machine", str(tmp_path / "a.toml")]
    assert main(asked) == 2  # the example's machine has no words in machine.toml
    assert list(tmp_path.iterdir()) == []
    assert "machine.toml" in capsys.readouterr().err


def test_a_fault_of_the_program_is_status_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(*arguments: Any) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(campaigns, "diagnosis_of", broken)
    assert main(["diagnose", str(DEMO)]) == 1
    assert "fault of the program" in capsys.readouterr().err


def test_a_process_ends_with_the_status_and_one_line() -> None:
    code = "import sys; from cutvib_ss.cli import main; sys.exit(main())"
    ended = subprocess.run(
        [sys.executable, "-c", code, "modes", "--position", "0"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert ended.returncode == 2
    assert ended.stdout == ""
    assert len(ended.stderr.splitlines()) == 1
    assert "Traceback" not in ended.stderr


def test_a_hammer_on_the_rail_and_positions_by_the_paper_s_names(capsys: pytest.CaptureFixture[str]) -> None:
    asked = [
        "frf",
        "--position",
        "cc",
        "--freq",
        "20:30:5",
        "--input",
        "rail@0.25",
        "--output",
        "rail@0.4",
        "--json",
        "-",
    ]
    assert main(asked) == 0
    told = _json(capsys.readouterr().out)
    assert told["positions"] == [1 / 3]
    assert (told["inputs"], told["units"]) == (["rail@0.25"], ["m/s^2/N"])
    frf = frequency_response(published_machine(), 1 / 3, [20.0, 25.0, 30.0], inputs="rail(0.25)", outputs="rail(0.4)")
    assert np.allclose(np.array(told["re"]) + 1j * np.array(told["im"]), frf.data, rtol=1e-12)
    # Reciprocity: hammer and accelerometer may change places.
    back = frequency_response(published_machine(), 1 / 3, [20.0, 25.0, 30.0], inputs="rail@0.4", outputs="rail@0.25")
    assert np.allclose(frf.data, back.data, rtol=1e-9)
    assert main(["modes", "--position", "FC", "--json", "-"]) == 0
    assert _json(capsys.readouterr().out)["position"] == 0.5


@pytest.mark.parametrize("wrong", ["nowhere", "1.5", "0"])
def test_an_impossible_position_is_refused_with_the_names(wrong: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["modes", "--position", wrong]) == 2
    said = capsys.readouterr().err
    assert "FC, CC, BC" in said if wrong == "nowhere" else "between 0 and 1" in said


def test_modes_are_drawn_and_move(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("shapes.png", "poles.svg", "mode.gif")]
    asked = ["--plot", str(files[0]), "--poles", str(files[1]), "--animate", str(files[2]), "--mode", "3"]
    assert main(["modes", "--position", "0.5", *asked]) == 0
    assert [f.read_bytes()[:5] for f in files] == [b"\x89PNG\r", b"<?xml", b"GIF89"]
