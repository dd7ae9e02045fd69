"""`cutvib schedule`: pictures over the whole rail, and the table of plants with its error."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import io

from cutvib_ss import plot
from cutvib_ss.cli import main
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response

FEW = ["schedule", "--positions", "9", "--freq", "20:300:20"]


def test_the_table_is_written_and_its_error_is_within_its_bound(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = {name: tmp_path / name for name in ("s.png", "bode.png", "error.png", "plants.mat", "s.json")}
    asked = ["--out", str(files["s.png"]), "--bode", str(files["bode.png"]), "--error", str(files["error.png"])]
    asked += ["--table", str(files["plants.mat"]), "--grid", "17", "--output", "tool_x", "--output", "tool_z"]
    assert main([*FEW, *asked, "--json", str(files["s.json"])]) == 0
    table = json.loads(files["s.json"].read_text())["table"]
    assert 0.0 < table["largest_error"] < table["largest_bound"] < table["largest_response"]
    assert table["interpolation"] == "cubic"
    back = io.loadmat(files["plants.mat"], simplify_cells=True)
    assert back["A"].shape == (12, 12, 17)
    assert list(back["outputs"]) == ["tool_x", "tool_z"]
    assert all(file.stat().st_size > 1000 for file in files.values())
    assert "Table of 17 plants, cubic between them" in capsys.readouterr().out


def test_a_table_of_another_format_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--out", str(tmp_path / "s.png"), "--table", str(tmp_path / "plants.csv")]
    assert main([*FEW, *asked]) == 2
    assert "holds no plants" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_bode_map_shows_modulus_and_phase_of_each_output() -> None:
    frf = frequency_response(published_machine(), [0.2, 0.5, 0.8], np.arange(20.0, 300.0, 10.0))
    figure = plot.bode_map(frf)
    panels = figure.axes[:6]
    assert [axes.get_title(loc="left") for axes in panels[:3]] == [f"{name} / force" for name in frf.outputs]
    modulus, phase = (np.asarray(panels[k].collections[0].get_array()) for k in (1, 4))
    assert np.allclose(modulus.ravel(), np.abs(frf.data[:, 1, 0]).T.ravel())
    assert np.allclose(phase.ravel(), np.degrees(np.angle(frf.data[:, 1, 0])).T.ravel())


def test_the_error_s_picture_shows_the_largest_over_positions() -> None:
    values = np.abs(np.random.default_rng(0).standard_normal((3, 4, 5)))
    values[2, 0, 0] = np.inf
    figure = plot.interpolation_error(np.arange(1.0, 6.0), *values, "m/N")
    response, bound, error = (np.asarray(line.get_ydata()) for line in figure.lines)
    assert np.array_equal(response, values[0].max(axis=0))
    assert np.array_equal(error, values[1].max(axis=0))
    assert np.isnan(bound[0])
    assert np.array_equal(bound[1:], values[2, :, 1:].max(axis=0))
