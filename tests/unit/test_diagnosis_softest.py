"""What restoring forces are scanned beside where the model tuned to all levels leads astray: the model tuned to the softest."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scouting import _tuned_to_the_softest
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import with_values
from tests.unit.test_diagnosis_work import MACHINE, records

OFF = {("head", "k2"): 1.02 * MACHINE.head.k2}


def _at_levels(softer: Machine, harder: Machine) -> Records:
    """Two records of a machine at 50 N, and two of what it is at 200 N."""
    soft, hard = records(softer).entries, records(harder).entries
    return Records((*soft, *(replace(e, record=e.record + 2, level=200.0) for e in hard)))


def test_the_tuning_is_that_of_the_softest_level() -> None:
    """Stiffer by 2 % than stated, and by 10 % more where it is driven four times as hard."""
    true = with_values(MACHINE, OFF)
    measured = _at_levels(true, with_values(true, {("head", "k2"): 1.1 * true.head.k2}))
    x = _tuned_to_the_softest(MACHINE, measured)
    assert x is not None
    alone = _tuned_to_the_softest(MACHINE, _at_levels(true, true))
    assert alone is not None
    # Whatever the harder records are.
    np.testing.assert_array_equal(x, alone)
    [(at, tolerance)] = [(i, t) for i, (path, t) in enumerate(tuning_paths(MACHINE)) if path == ("head", "k2")]
    assert x[at] == pytest.approx(np.log(1.02) / tolerance, abs=1.0)


def test_one_level_has_no_softest() -> None:
    assert _tuned_to_the_softest(MACHINE, records(MACHINE)) is None


def test_a_tuning_that_leaves_much_is_none() -> None:
    far = RailAddedMass("rail", 0.37, 15.0, 0.0).apply(MACHINE)
    assert _tuned_to_the_softest(MACHINE, _at_levels(far, MACHINE)) is None
