"""Figs. 15 to 20: the curves behind them, and `cutvib figures`."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.cli import main
from cutvib_ss.model.machine import published_machine
from cutvib_ss.paper import PaperCurves, paper_curves
from cutvib_ss.plot.paper import figure_18, figure_19
from cutvib_ss.response.modes import modes


@pytest.fixture(scope="module")
def curves() -> PaperCurves:
    return paper_curves()


def test_the_command_writes_each_figure_under_its_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["figures", "--out", str(tmp_path / "new"), "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["schema"] == "cutvib-figures/1"
    names = [f"figure_{n}" for n in range(15, 21)]
    assert list(told["figures"]) == names
    for name in names:
        assert (tmp_path / "new" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_an_impossible_folder_or_format_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").touch()
    assert main(["figures", "--out", str(tmp_path / "file" / "b")]) == 2
    assert "cannot be made a folder" in capsys.readouterr().err
    assert main(["figures", "--out", str(tmp_path), "--format", "bmp"]) == 2
    assert ".png, .svg, .pdf" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_figure_17_has_r_half_waves(curves: PaperCurves) -> None:
    for r in range(4):
        inner = curves.shapes[1:-1, r]
        signs = np.sign(inner[np.abs(inner) > 1e-9])
        assert int((np.diff(signs) != 0).sum()) == r
    assert np.abs(curves.shapes[[0, -1]]).max() < 1e-12


def test_figure_18_leaves_out_what_is_not_excited(curves: PaperCurves) -> None:
    assert curves.modal["FC"].outputs == ("eta1", "eta3")
    assert curves.modal["CC"].outputs == ("eta1", "eta2", "eta4")
    figure = figure_18(curves)
    # No phases of nothing: as many curves as coordinates that answer, and the tool's frequency.
    assert [len(axes.lines) for axes in figure.axes] == [3, 4, 3, 4]


def test_figure_19_has_five_peaks_up_to_600_hz(curves: PaperCurves) -> None:
    size = np.abs(curves.base.data[0, 0, 0])
    peaks = curves.base.freq[signal.find_peaks(size, prominence=1e-3 * size.max())[0]]
    natural = modes(published_machine(), 1 / 3).natural_freq
    # All but the rail's third mode, whose node is under the head (285.3 Hz, the fourth of the coupled machine).
    assert peaks == pytest.approx(np.delete(natural, 3), rel=0.02)
    assert curves.base.freq[-1] == 600.0
    assert len(figure_19(curves).axes[0].texts) == 5


def test_figure_20_has_the_lateral_position_too(curves: PaperCurves) -> None:
    assert curves.absorber.positions.tolist() == [1 / 3, 0.98]
    assert (curves.absorber.reduction > 0.5).all()
