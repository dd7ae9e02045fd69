"""A value far out of its tolerance leaves no residual: causes that move it are tried nevertheless."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.scouting import tuned_away
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure

MACHINE = published_machine()
NAMES = [path[-1] for path, _ in tuning_paths(MACHINE)]


@pytest.mark.parametrize(
    ("name", "effect"),
    [
        ("l2", ParameterShift("tool", "l2", 1.0)),
        ("m2", AddedMass("tool", 0.1)),
        ("first_frequency", ParameterShift("rail", "first_frequency", 1.0)),
    ],
)
def test_a_cause_is_tried_where_its_value_is_tuned_far_away(name: str, effect: Effect) -> None:
    for size, tried in ((-4.4, True), (3.1, True), (2.9, False)):
        x = np.where([n == name for n in NAMES], size, 0.5)
        fitted: Any = SimpleNamespace(x=np.append(x, 9.0), n_tuning=x.size, calibrated_away=frozenset())
        assert tuned_away(MACHINE, cast(Fit, fitted), effect) is tried
        # What moves nothing of it is not.
        assert not tuned_away(MACHINE, cast(Fit, fitted), ToolContact("tool", 1e4, 1.0))


def test_an_error_of_a_channel_is_tried_where_its_gain_is_tuned_far_away() -> None:
    fitted: Any = SimpleNamespace(x=np.zeros(len(NAMES)), n_tuning=len(NAMES), calibrated_away=frozenset({"tool_x"}))
    for channel, tried in (("tool_x", True), ("tool_z", False)):
        assert tuned_away(MACHINE, cast(Fit, fitted), CalibrationError("measurement", channel, 1.1)) is tried
    assert not tuned_away(MACHINE, cast(Fit, fitted), ToolContact("tool", 1e4, 1.0))


def test_an_error_of_a_channel_is_tried_where_a_structures_matrix_is_tuned_far_away() -> None:
    """A free beam whose accelerometer reads 10 % too much was no gap: a mass and a stiffness 6 % off, and 1 % of calibration."""
    system = SecondOrder(np.eye(1), np.eye(1), 1e4 * np.eye(1), ("x",), {"x": np.ones(1)})
    beam = Structure(system, {"acc": Channel("x", "acceleration")}, "x")
    gain, spring = CalibrationError("measurement", "acc", 1.1), ToolContact("x", 10.0, 1.0)
    for size, tried in ((-3.2, True), (2.9, False)):
        x = np.array([size, *[0.0] * (len(tuning_paths(beam)) - 1)])
        fitted: Any = SimpleNamespace(x=x, n_tuning=x.size, calibrated_away=frozenset())
        assert tuned_away(beam, cast(Fit, fitted), gain) is tried
        assert not tuned_away(beam, cast(Fit, fitted), spring)


def test_channels_whose_gain_is_far_out_of_its_tolerance() -> None:
    hammered: Any = SimpleNamespace(gains={"tool_x": 3.1, "tool_z": 2.9})
    assert Fit.calibrated_away.fget(hammered) == {"tool_x"}  # type: ignore[attr-defined]
