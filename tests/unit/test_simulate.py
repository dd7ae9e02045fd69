"""`cutvib simulate`, the files of responses in time, and their picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.cli import main
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.interchange import read_time_response, write_time_response
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import write_machine
from cutvib_ss.plot import time_histories
from cutvib_ss.response.pulses import harmonic_force, pulse_train
from cutvib_ss.response.time_response import time_response
from cutvib_ss.results import MovingResponse
from tests.unit.diagnosis_example import example_structure

MACHINE = published_machine()


def _json(capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    text = capsys.readouterr().out
    found: dict[str, object] = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))
    return found


def test_a_run_from_rest_as_files_and_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = [
        "simulate",
        "--position",
        "0.4",
        "--duration",
        "0.1",
        "--fs",
        "8000",
        "--amplitude",
        "20",
        "--jitter",
        "0.02",
    ]
    files = [tmp_path / "a.csv", tmp_path / "a.svg"]
    assert main([*asked, "--out", str(files[0]), "--plot", str(files[1]), "--json", "-"]) == 0
    data = _json(capsys)
    force = pulse_train(8000.0, 0.1, amplitude=20.0, jitter=0.02)
    want = time_response(MACHINE, 0.4, force, 8000.0)
    assert data["schema"] == "cutvib-simulate/1"
    assert data["rms"] == pytest.approx(want.rms())
    assert data["peak_g"] == pytest.approx(want.in_g().peak())
    assert files[0].read_text().splitlines()[0] == "time [s],force [N],tool_x [m/s^2],tool_z [m/s^2],base_x [m/s^2]"
    back = read_time_response(files[0])
    assert np.array_equal(back.data, want.data)
    assert np.array_equal(back.force, force)
    assert back.fs == pytest.approx(8000.0)
    assert files[1].read_text().lstrip().startswith("<?xml")
    # What it wrote is a record: its force can be run again.
    assert main(["simulate", "--position", "0.4", "--force", str(files[0]), "--json", "-"]) == 0
    assert _json(capsys)["rms"] == pytest.approx(want.rms())


def test_the_steady_state_has_whole_periods_and_says_what_is_strong(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--output", "tool_x", "--output", "rail_left_force", "--output", "joint2"]
    assert main(["simulate", "--position", "0.5", "--steady", *asked, "--json", "-"]) == 0
    data = _json(capsys)
    assert data["fs_hz"] == 217 * 93
    assert data["duration_s"] == pytest.approx(1 / 217)
    assert data["units"] == ["m/s^2", "N", "rad"]
    assert data["peak_g"][1:] == [None, None]  # type: ignore[index]
    assert data["lines"][0][0]["freq_hz"] == pytest.approx(217.0)  # type: ignore[index]
    assert main(["simulate", "--position", "0.5", "--steady", *asked]) == 0
    assert "one period of the steady state" in capsys.readouterr().out


def test_harmonics_and_other_quantities(capsys: pytest.CaptureFixture[str]) -> None:
    lines = ["--harmonic", "217:30", "--harmonic", "434:10"]
    assert main(["simulate", "--position", "0.3", *lines, "--steady", "--quantity", "displacement", "--json", "-"]) == 0
    data = _json(capsys)
    fs = 217 * 93.0
    force = harmonic_force(fs, 1 / 217, [217.0, 434.0], [30.0, 10.0])
    want = time_response(MACHINE, 0.3, force, fs, quantity="displacement", start="periodic")
    assert data["rms"] == pytest.approx(want.rms())
    assert data["units"] == ["m"] * 3


def test_a_corrected_machine_and_another_structure(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_machine(CubicStiffness("joint2", 2e11).apply(MACHINE), tmp_path / "corrected.toml")
    rms = []
    for extra in ([], ["--machine", str(tmp_path / "corrected.toml")]):
        assert main(["simulate", "--position", "0.5", "--duration", "0.05", *extra, "--json", "-"]) == 0
        rms.append(_json(capsys)["rms"])
    assert rms[0] != pytest.approx(rms[1], rel=1e-3)
    write_machine(example_structure(), tmp_path / "two.toml")
    assert main(["simulate", "--machine", str(tmp_path / "two.toml"), "--duration", "0.05", "--json", "-"]) == 0
    assert _json(capsys)["position"] is None


def test_a_head_that_travels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["simulate", "--position", "0.3", "--to", "0.32", "--duration", "0.2", "--fs", "4000"]
    for suffix in (".npz", ".csv"):
        assert main([*asked, "--out", str(tmp_path / f"way{suffix}")]) == 0
        back = read_time_response(tmp_path / f"way{suffix}")
        assert isinstance(back, MovingResponse)
        assert back.path[0] == pytest.approx(0.3)
        assert back.path[-1] > 0.3
    assert "written" in capsys.readouterr().out


def test_a_recorded_travel_is_the_travel_that_was_recorded(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["simulate", "--duration", "0.2", "--fs", "4000", "--harmonic", "60:10"]
    asked = ["--position", "0.3", "--to", "0.32", "--speed", "0.5", "--acceleration", "20", "--jerk", "2000"]
    assert main([*common, *asked, "--out", str(tmp_path / "way.csv")]) == 0
    assert main([*common, "--travel", str(tmp_path / "way.csv"), "--out", str(tmp_path / "again.csv")]) == 0
    capsys.readouterr()
    first, again = (read_time_response(tmp_path / f"{name}.csv") for name in ("way", "again"))
    assert isinstance(first, MovingResponse)
    assert isinstance(again, MovingResponse)
    assert first.path[0] == pytest.approx(0.3)
    assert first.path[-1] == pytest.approx(0.32)
    assert np.abs(again.path - first.path).max() < 1e-6
    assert np.abs(again.data - first.data).max() < 1e-2 * np.abs(first.data).max()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time [s],y\n0,0.3\n", "has no column position"),
        ("time [s],position [y/L]\n0,a\n", "holds no number"),
        ("time [s],position [y/L]\n0,0.3\n1,0.4\n", "more than 5 instants"),
        ("time [s],position [y/L]\n" + "".join(f"{t},{0.3 + 0.2 * t}\n" for t in range(9)), "between 0 and 1"),
        ("", "its columns are none"),
    ],
)
def test_a_bad_travel_names_its_file(text: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "way.csv").write_text(text)
    assert main(["simulate", "--travel", str(tmp_path / "way.csv")]) == 2
    said = capsys.readouterr().err
    assert "way.csv" in said
    assert says in said


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--travel", __file__, "--position", "0.5"], "leave --position and --to out"),
        (["--to", "0.5"], "--position is missing"),
        (["--travel", "a.csv"], "a.csv"),
        ([], "--position is missing"),
        (["--position", "0.5", "--out", "a.uff"], "not written"),
        (["--position", "0.5", "--plot", "a.csv"], "no picture"),
        (["--position", "0.5", "--harmonic", "217"], "frequency and amplitude"),
        (["--position", "0.5", "--harmonic", "217:1", "--harmonic", "300:1", "--steady"], "multiples of the lowest"),
        (["--position", "0.5", "--jitter", "0.1", "--steady"], "no period"),
        (["--position", "0.5", "--rate", "0", "--steady"], "must be greater than 0"),
        (["--position", "0.5", "--duty", "0.01"], "no room"),
        (["--position", "0.5", "--to", "0.6", "--steady"], "no steady state"),
        (["--position", "0.5", "--force", "missing.csv"], "no such file"),
        (["--position", "0.5", "--output", "nose"], "no port"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_line(
    options: list[str], complaint: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert main(["simulate", *options]) == 2
    said = capsys.readouterr()
    assert complaint in said.err
    assert said.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_records_without_a_force_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "r.csv").write_text("time [s],tool_x [g]\n0,1\n0.1,2\n0.2,3\n")
    assert main(["simulate", "--position", "0.5", "--force", str(tmp_path / "r.csv")]) == 2
    assert "no channel `force`" in capsys.readouterr().err


def test_files_read_back_and_others_are_refused(tmp_path: Path) -> None:
    force = pulse_train(217 * 32.0, 1 / 217)
    made = time_response(MACHINE, 0.5, force, 217 * 32.0, start="periodic")
    write_time_response(made, tmp_path / "a.npz")
    back = read_time_response(tmp_path / "a.npz")
    assert back.periodic
    assert (back.position, back.outputs, back.units) == (0.5, made.outputs, made.units)
    assert np.array_equal(back.data, made.data)
    with pytest.raises(ParameterError, match="not written"):
        write_time_response(made, tmp_path / "a.mat")
    np.savez(tmp_path / "b.npz", data=np.zeros(3))
    (tmp_path / "b.csv").write_text("freq [Hz],a [m]\n1,2\n")
    (tmp_path / "c.csv").write_text("time [s],tool_x [m]\n0,2\n1,2\n")
    (tmp_path / "d.csv").write_text("time [s],force [N]\n0,2\n1,2,3\n")
    for name in ("b.npz", "b.csv", "c.csv", "d.csv", "none.csv"):
        with pytest.raises(DataFormatError, match=name):
            read_time_response(tmp_path / name)


def test_the_picture_shows_force_and_outputs() -> None:
    force = pulse_train(8000.0, 2.0)
    long = time_histories(time_response(MACHINE, 0.5, force, 8000.0, outputs=["tool_x", "joint2"]), title="Pulses")
    assert [a.get_ylabel() for a in long.axes[::3]] == ["force [N]", "tool_x [g]", "joint2 [rad]"]
    assert long.axes[2].get_xlim() == (0.0, 2000.0)
    period = pulse_train(217 * 32.0, 1 / 217)
    steady = time_histories(time_response(MACHINE, 0.5, period, 217 * 32.0, outputs=["tool_x"], start="periodic"))
    assert steady.axes[0].get_title(loc="left") == "one period"
