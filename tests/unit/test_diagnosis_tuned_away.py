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


def test_channels_whose_gain_is_far_out_of_its_tolerance() -> None:
    hammered: Any = SimpleNamespace(gains={"tool_x": 3.1, "tool_z": 2.9})
    assert Fit.calibrated_away.fget(hammered) == {"tool_x"}  # type: ignore[attr-defined]
