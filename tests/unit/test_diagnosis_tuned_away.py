"""A value far out of its tolerance leaves no residual: causes that move it are tried nevertheless."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.scouting import _tuned_away
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect
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
        fitted: Any = SimpleNamespace(x=np.append(x, 9.0), n_tuning=x.size)
        assert _tuned_away(MACHINE, cast(Fit, fitted), effect) is tried
        # What moves nothing of it is not.
        assert not _tuned_away(MACHINE, cast(Fit, fitted), ToolContact("tool", 1e4, 1.0))
