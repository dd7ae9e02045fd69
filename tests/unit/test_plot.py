"""Pictures: they show the numbers they are given, with units, and open no window."""

import inspect
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from cutvib_ss import plot
from cutvib_ss.absorber import check_absorber
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.rail import mode_shapes
from cutvib_ss.parameters import table_7
from cutvib_ss.plot.diagnosis import error_over_noise
from cutvib_ss.plot.shapes import deflections
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes, track_modes
from tests.unit.diagnosis_example import example_diagnosis, example_structure
from tests.unit.test_blind_score import example_score

FREQ = np.arange(20.0, 400.0, 1.0)


def _labels(figure: Figure) -> set[str]:
    return {text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())} - {""}


@pytest.mark.parametrize("channels", [["tool_x"], ["tool_x", "tool_z"], None])
def test_the_names_in_a_comparison_are_not_cut_off(channels: list[str] | None) -> None:
    figure = plot.comparison_grid(example_diagnosis(lines=50, records=2).comparisons, channels)
    figure.canvas.draw()
    (legend,) = figure.legends
    box, paper = legend.get_window_extent(), figure.bbox
    assert paper.x0 <= box.x0
    assert box.x1 <= paper.x1
    assert box.y1 <= paper.y1


def test_bode_draws_modulus_and_phase_of_every_output_and_position() -> None:
    frf = frequency_response(published_machine(), [0.02, 0.5], FREQ)
    figure = plot.bode(frf)
    assert len(figure.axes) == 6
    upper, lower = figure.axes[1], figure.axes[4]
    assert np.array_equal(upper.lines[1].get_ydata(), np.abs(frf.data[1, 1, 0]))
    phase = np.asarray(lower.lines[1].get_ydata())
    there = np.isfinite(phase)
    assert np.allclose(phase[there], np.degrees(np.angle(frf.data[1, 1, 0]))[there])
    assert upper.get_yscale() == "log"
    assert _labels(figure) == {"accelerance [(m/s²)/N]", "phase [°]", "frequency [Hz]"}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["y/L = 0.02", "y/L = 0.5"]


def test_bode_of_a_structure_has_its_own_units_and_no_legend_of_positions() -> None:
    figure = plot.bode(frequency_response(example_structure(), None, FREQ))
    assert {"receptance [m/N]", "accelerance [(m/s²)/N]"} <= _labels(figure)
    assert not figure.legends


def test_pole_map_and_schedule_show_the_tracked_modes() -> None:
    machine = published_machine()
    tracked = track_modes(machine, np.linspace(0.1, 0.9, 17))
    poles = plot.pole_map(tracked, 300.0)
    drawn = [np.asarray(line.get_xdata()) for line in poles.lines if len(line.get_xdata()) == 17]
    assert len(drawn) == int(np.sum(tracked.natural_freq.min(axis=0) <= 300.0))
    assert np.array_equal(drawn[0], tracked.natural_freq[:, 0])
    frf = frequency_response(machine, tracked.positions, FREQ, outputs=("tool_x",))
    both = plot.schedule(tracked, frf)
    mesh = both.axes[1].collections[0]
    assert np.allclose(np.asarray(mesh.get_array()).ravel(), np.abs(frf.data[:, 0, 0]).T.ravel())
    assert {"position y/L [-]", "natural frequency [Hz]", "damping ratio [%]", "modulus [(m/s²)/N]"} <= _labels(both)
    assert len(plot.schedule(tracked).axes) == 2  # the frequencies and their colour bar


def test_absorber_effect_shows_both_responses_at_each_position() -> None:
    check = check_absorber(published_machine(), table_7())
    figure = plot.absorber_effect(check)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["y/L = 0.333", "y/L = 0.5"]
    assert np.array_equal(figure.axes[1].lines[1].get_ydata(), np.abs(check.frf_after.data[1, 0, 0]))


def test_comparison_grid_is_in_g_per_newton() -> None:
    comparisons = example_diagnosis(lines=200, records=2).comparisons
    figure = plot.comparison_grid(comparisons)
    assert len(figure.axes) == 6
    assert figure.axes[0].get_ylabel() == "y/L = 0.06\n[g/N]"
    lines = {line.get_label(): np.asarray(line.get_ydata()) for line in figure.axes[4].lines}
    assert np.allclose(lines["corrected model"] * 9.80665, np.abs(comparisons[1].corrected.data[0, 1, 0]))
    assert np.allclose(lines["noise of the measurement"] * 9.80665, np.sqrt(comparisons[1].measured.variance[0, 1, 0]))


def test_error_over_noise_is_one_for_the_right_model_and_grows_with_the_error() -> None:
    comparison = example_diagnosis(records=1).comparisons[0]
    edges = np.array([15.0, 200.0, 240.0, 450.0])
    right = error_over_noise([comparison], "corrected", "tool_x", edges)
    wrong = error_over_noise([comparison], "nominal", "tool_x", edges)
    assert np.all(np.abs(right - 1.0) < 0.2)
    assert wrong[1] > 20.0
    assert np.isnan(error_over_noise([comparison], "nominal", "absent", edges)).all()


def test_error_map_has_a_panel_a_channel_and_a_row_a_position() -> None:
    figure = plot.error_map(example_diagnosis(lines=200).comparisons)
    panels = figure.axes[:3]
    assert [axes.get_title(loc="left") for axes in panels] == ["tool_x", "tool_z", "base_x"]
    assert [text.get_text() for text in panels[0].get_yticklabels()] == ["0.06", "0.27", "0.46", "0.68", "0.9"]


def test_cause_bars_sum_up_those_that_are_not_shown() -> None:
    causes = example_diagnosis(lines=20, records=1).causes
    figure = plot.cause_bars(causes, [c.effect for c in causes], highest=3)
    widths = [bar.get_width() for bar in figure.axes[0].patches]
    assert widths[:3] == [c.probability for c in causes[:3]]
    assert sum(widths) == pytest.approx(1.0)
    assert figure.axes[0].get_yticklabels()[3].get_text() == "4 more"


@pytest.mark.parametrize(("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_save_writes_each_format_alike_every_time(tmp_path: Path, suffix: str, start: bytes) -> None:
    figures = [plot.bode(frequency_response(published_machine(), [0.5], FREQ, outputs=("tool_x",))) for _ in range(2)]
    for k, figure in enumerate(figures):
        plot.save(figure, tmp_path / f"{k}{suffix}")
    first, second = ((tmp_path / f"{k}{suffix}").read_bytes() for k in range(2))
    assert first.startswith(start)
    assert first == second


def test_save_refuses_what_is_no_picture_or_has_no_folder(tmp_path: Path) -> None:
    figure = plot.cause_bars([], [])
    with pytest.raises(ParameterError, match="no picture"):
        plot.save(figure, tmp_path / "a.docx")
    with pytest.raises(DataFormatError, match="no folder"):
        plot.save(figure, tmp_path / "absent" / "a.png")


def test_png_is_a_picture_with_a_palette(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(plot.png(plot.error_map(example_diagnosis(lines=50, records=1).comparisons), dpi=50))
    with Image.open(path) as image:
        assert image.mode == "P"
        assert image.size[0] == 480


def test_drawing_leaves_no_figure_with_pyplot() -> None:
    plot.error_map(example_diagnosis(lines=50, records=1).comparisons)
    pyplot = sys.modules.get("matplotlib.pyplot")  # python-control imports it
    assert pyplot is None or pyplot.get_fignums() == []


def test_the_s_plane_shows_every_pole_with_lines_of_damping_and_the_tool_s_frequency() -> None:
    found = modes(published_machine(), 0.5)
    figure = Figure()
    ax = figure.subplots()
    assert plot.s_plane(found, ax=ax) is ax
    [points] = [line for line in ax.lines if line.get_marker() == "x"]
    assert np.allclose(np.asarray(points.get_xdata()), found.poles.real)
    assert np.allclose(np.asarray(points.get_ydata()) * 2 * np.pi, found.poles.imag)
    for line in ax.lines[:6]:
        x, y = np.asarray(line.get_xdata())[1], np.asarray(line.get_ydata())[1] * 2 * np.pi
        assert -x / np.hypot(x, y) == pytest.approx(float(_nearest_ratio(-x / np.hypot(x, y))), rel=1e-9)
    texts = [t.get_text() for t in ax.texts]
    assert {"1 %", "10 %", "217 Hz"} <= set(texts)


def _nearest_ratio(value: float) -> float:
    return min((0.005, 0.01, 0.02, 0.03, 0.05, 0.1), key=lambda r: abs(r - value))


def test_poles_over_position_take_two_axes_and_mark_the_tool() -> None:
    tracked = track_modes(published_machine(), np.linspace(0.1, 0.9, 9))
    panels = plot.poles_over_position(tracked, ax=Figure().subplots(1, 2))
    assert np.array_equal(np.asarray(panels[0].lines[1].get_ydata()), tracked.natural_freq[:, 1])
    assert np.asarray(panels[0].lines[-1].get_ydata()).tolist() == [217.0, 217.0]


def test_nyquist_and_magnitude_draw_on_the_axes_they_are_given() -> None:
    frf = frequency_response(published_machine(), [0.2, 0.5], np.arange(150.0, 300.5, 0.5), outputs="tool_x")
    ax = Figure().subplots()
    assert plot.nyquist(frf, ax=ax) is ax
    assert np.array_equal(np.asarray(ax.lines[0].get_xdata()), frf.data[0, 0, 0].real)
    marked = [line for line in ax.lines if line.get_marker() == "o" and len(line.get_xdata()) == 1]  # type: ignore[arg-type]
    assert marked[1].get_ydata()[0] == frf.data[1, 0, 0, 134].imag  # type: ignore[index]
    ax = Figure().subplots()
    assert plot.magnitude(frf, ax=ax) is ax
    assert np.array_equal(np.asarray(ax.lines[1].get_ydata()), np.abs(frf.data[1, 0, 0]))


def test_a_drawn_mode_is_the_rail_s_deflection_and_the_head_s_motion() -> None:
    machine = published_machine()
    found = modes(machine, 0.3)
    along, head = deflections(machine, found, 1)
    # Modal coordinates and mode shapes of the rail, by Eq. 7.
    shapes = mode_shapes(machine.rail.parameters, np.linspace(0.0, 1.0, 201))
    assert np.allclose(along, shapes @ found.mode_shapes[:4, 1], atol=1e-12)
    assert head[0, 0] == pytest.approx(along[60], rel=1e-9)
    figure = plot.mode_shapes(machine, found, highest=300.0)
    assert len(figure.axes) == 2 * int((found.natural_freq <= 300.0).sum())


def test_a_mode_moves_in_a_gif_and_impossible_ones_are_refused(tmp_path: Path) -> None:
    machine = published_machine()
    found = modes(machine, 0.5)
    plot.animate_mode(machine, found, 3, tmp_path / "mode.gif", frames=6, dpi=40.0)
    with Image.open(tmp_path / "mode.gif") as picture:
        assert picture.n_frames == 6  # type: ignore[attr-defined]
    with pytest.raises(ParameterError, match="modes 1 to 6"):
        plot.animate_mode(machine, found, 7, tmp_path / "seven.gif")
    with pytest.raises(ParameterError, match=r"\.gif"):
        plot.animate_mode(machine, found, 1, tmp_path / "one.png")


def test_a_result_without_a_picture_says_so() -> None:
    with pytest.raises(ParameterError, match="no picture of a int"):
        plot.draw(3)


def _pictures() -> dict[str, tuple[int, int, Callable[..., object]]]:
    """Plot functions of several panels, or that make their own figure: rows, columns, and the call."""
    machine = published_machine()
    frf = frequency_response(machine, [0.2, 0.5], FREQ)
    tracked = track_modes(machine, np.linspace(0.1, 0.9, 9))
    found = modes(machine, 0.3)
    check = check_absorber(machine, table_7())
    diagnosis = example_diagnosis(lines=40, records=2)
    score = example_score(30)
    return {
        "bode": (2, 3, partial(plot.bode, frf)),
        "bode_map": (2, 3, partial(plot.bode_map, frf)),
        "schedule": (1, 2, partial(plot.schedule, tracked, frf)),
        "absorber_effect": (1, 2, partial(plot.absorber_effect, check)),
        "comparison_grid": (2, 3, partial(plot.comparison_grid, diagnosis.comparisons)),
        "error_map": (3, 1, partial(plot.error_map, diagnosis.comparisons)),
        "cause_bars": (1, 1, partial(plot.cause_bars, diagnosis.causes, [c.effect for c in diagnosis.causes])),
        "mode_shapes": (6, 2, partial(plot.mode_shapes, machine, found)),
        "reliability_diagram": (2, 1, partial(plot.reliability_diagram, score)),
        "risk_curve": (1, 1, partial(plot.risk_curve, score)),
        "severity_curve": (1, 1, partial(plot.severity_curve, score)),
        "shrinkage_scatter": (1, 1, partial(plot.shrinkage_scatter, score)),
        "confusion_map": (1, 1, partial(plot.confusion_map, score.causes, "Causes")),
    }


def test_pictures_are_drawn_on_the_axes_that_are_given_and_return_them() -> None:
    for name, (rows, columns, draw) in _pictures().items():
        figure = Figure()
        ax = figure.subplots(rows, columns)
        assert draw(ax=ax) is ax, name
        panels = np.asarray(ax, dtype=object).ravel()
        assert all(a.has_data() for a in panels), name
        assert not figure.legends, f"{name}: the figure is another's"
        with pytest.raises(ParameterError, match=f"this picture needs {rows * columns}, in {rows} rows of {columns}"):
            draw(ax=np.append(panels, panels[:1]))


def test_every_picture_takes_axes_and_shows_nothing() -> None:
    for name in set(plot.__all__) - {"animate_mode", "draw", "png", "save"}:
        assert "ax" in inspect.signature(getattr(plot, name)).parameters, name
