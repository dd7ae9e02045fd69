"""`cutvib absorber`: designs over the whole rail, with tolerances, several absorbers, pictures and machines."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutvib_ss.absorber import AbsorberTolerance, MountedAbsorber, workspace_check
from cutvib_ss.cli import main
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import read_machine
from cutvib_ss.parameters import table_7
from cutvib_ss.response.frequency import frequency_response

COARSE = ["--position", "0.1", "--position", "0.3333", "--position", "0.5", "--tuning", "205:225:2"]


def _json(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> Any:
    assert main([*arguments, "--json", "-"]) == 0
    return json.loads(capsys.readouterr().out)


def test_the_optimum_is_better_than_the_grid_s_best_and_than_table_7(capsys: pytest.CaptureFixture[str]) -> None:
    data = _json(["absorber", "design", *COARSE], capsys)
    worst = data["optimum"]["worst_m_per_s2"]
    assert worst["after"] <= np.min(data["worst_m_per_s2_per_n"]) * (1 + 1e-9)
    assert worst["after"] < 0.3 * data["table_7"]["worst_m_per_s2"]["after"]
    assert worst["after"] == max(data["optimum"]["after_m_per_s2"])
    assert data["force"] == {"freq_hz": [217.0], "amplitude_n": [1.0]}
    [only] = data["front"]
    assert only.pop("grid_worst_m_per_s2_per_n") == data["worst_m_per_s2_per_n"]
    assert only == data["optimum"]


def test_two_absorbers_in_two_directions_are_saved_with_the_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = tmp_path / "two.toml"
    asked = [*COARSE, "--direction", "x", "--direction", "z", "--harmonics", "3", "--save-machine", str(saved)]
    data = _json(["absorber", "design", *asked, "--plot", str(tmp_path / "two.png")], capsys)
    absorbers = data["optimum"]["absorbers"]
    assert [a["port"] for a in absorbers] == ["tool_x", "tool_z"]
    assert sum(a["mass_kg"] for a in absorbers) == pytest.approx(0.08)
    force = data["force"]
    frf = frequency_response(read_machine(saved), [0.1, 0.3333, 0.5], force["freq_hz"], outputs=["tool_x"])  # type: ignore[arg-type]
    largest = (np.abs(frf.data[:, 0, 0]) * force["amplitude_n"]).max(axis=1)
    assert data["optimum"]["after_m_per_s2"] == pytest.approx(largest.tolist())
    assert (tmp_path / "two.png").stat().st_size > 1000


def test_several_masses_make_a_front_with_its_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    masses = ["--mass", "0.05", "--mass", "0.15", "--tolerance", "0.02", "--plot", str(tmp_path / "front.svg")]
    assert main(["absorber", "design", *COARSE, *masses, "--json", str(tmp_path / "front.json")]) == 0
    data = json.loads((tmp_path / "front.json").read_text())
    assert [f["mass_kg"] for f in data["front"]] == [0.05, 0.15]
    light, heavy = (f["worst_m_per_s2"]["toleranced"] for f in data["front"])
    assert heavy < light
    grids = [np.array(f["grid_worst_m_per_s2_per_n"]) for f in data["front"]]
    assert grids[0].min() > grids[1].min()
    assert (tmp_path / "front.svg").read_text().count("Table 7") == 1
    assert "in tolerance" in capsys.readouterr().out


def test_check_takes_a_place_a_direction_and_a_tolerance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--direction", "z", "--tolerance", "0.03", "--rate-tolerance", "0.005", "--save-machine"]
    data = _json(["absorber", "check", *asked, str(tmp_path / "z.toml")], capsys)
    box = AbsorberTolerance(frequency=0.03, rate=0.005)
    expected = workspace_check(
        published_machine(), [MountedAbsorber(table_7(), "tool_z")], np.arange(1, 50) / 50, tolerance=box
    )
    assert data["absorber"]["port"] == "tool_z"
    assert data["workspace"]["toleranced_m_per_s2_per_n"] == expected.toleranced.tolist()
    assert read_machine(tmp_path / "z.toml").attachments[0].port == "tool_z"
    assert main(["absorber", "check", "--tolerance", "0.03"]) == 0
    assert "At worst within tolerance" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["--place", "head", "--place", "tool", "--count", "3"], "--place is given 2 times for 3 absorbers"),
        (["--mass", "0.1", "--mass", "0.2", "--save-machine", "a.toml"], "name one mass"),
        (["--mass", "-1"], "mass"),
        (["--damping-ratio", "0"], "greater than 0"),
        (["--harmonics", "3", "--duty", "0.05"], "no room"),
        (["--tolerance", "1.5"], "fraction"),
        (["--plot", "picture.docx"], "no picture"),
    ],
)
def test_what_cannot_be_designed_is_refused_in_one_line(
    asked: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["absorber", "design", *COARSE, *asked]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert message in said.err
    assert len(said.err.splitlines()) == 1
