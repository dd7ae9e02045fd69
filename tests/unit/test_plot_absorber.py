"""Pictures of absorbers show the figures of the study, the checks and the designs."""

import numpy as np
import pytest

from cutvib_ss import plot
from cutvib_ss.absorber import AbsorberTolerance, MountedAbsorber, mass_front, parametric_study, workspace_check
from cutvib_ss.model.machine import published_machine
from cutvib_ss.parameters import table_7

MACHINE = published_machine()
PLACES = [0.1, 0.3, 0.5, 0.9]
BOX = AbsorberTolerance()
CHECK = workspace_check(MACHINE, [MountedAbsorber(table_7())], PLACES, tolerance=BOX)


def test_the_study_is_a_map_with_the_best_marked() -> None:
    study = parametric_study(MACHINE, PLACES, tuning=[210.0, 214.0, 218.0], damping_ratio=[0.01, 0.02])
    figure = plot.absorber_study(study, {"Table 7": table_7()})
    axes = figure
    assert np.allclose(np.asarray(axes.collections[0].get_array()).ravel(), study.worst.T.ravel())
    assert [line.get_label() for line in axes.lines] == ["best of the grid", "Table 7"]
    assert axes.lines[0].get_xdata() == pytest.approx([study.best.frequency])


def test_over_the_rail_the_worst_in_tolerance_is_above_the_design() -> None:
    figure = plot.absorbers_over_the_rail({"Table 7": CHECK})
    before, exact, toleranced = (np.asarray(line.get_ydata()) for line in figure.lines[:3])
    assert np.array_equal(before, CHECK.before)
    assert np.array_equal(exact, CHECK.exact)
    assert (toleranced > exact).all()
    assert figure.get_ylabel() == "accelerance of tool_x at 217 Hz [(m/s²)/N]"


def test_the_front_is_mass_against_the_worst() -> None:
    front = mass_front(MACHINE, [0.05, 0.1], positions=PLACES, tolerance=BOX)
    figure = plot.absorber_front({"tool X": front}, {"Table 7": CHECK})
    line = figure.lines[0]
    assert np.asarray(line.get_xdata()) == pytest.approx([0.05, 0.1])
    assert np.asarray(line.get_ydata()) == pytest.approx([d.check.toleranced.max() for d in front])
    assert "Table 7" in [text.get_text() for text in figure.get_figure(root=True).legends[0].get_texts()]
