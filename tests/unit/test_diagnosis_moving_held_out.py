"""A loud record of a machine that moves between records, predicted from quiet ones: its drift is more than first order tells."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.cross_validation import Fold
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import StructureTolerances
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

FREQ = np.arange(10.0, 120.0, 0.5)
W1 = 2 * np.pi * 40.0
NOISE = {20.0: 1e-3, 100.0: 1e-4}
"""Of the largest response, by level [N]."""


def chain(**tolerances) -> Structure:
    """Two masses of 1 kg between springs to ground, 0.5 % of damping in the first mode."""
    stiffness = W1**2 * np.array([[2.0, -1.0], [-1.0, 2.0]])
    ports = {"p1": np.array([1.0, 0.0]), "p2": np.array([0.0, 1.0])}
    system = SecondOrder(np.eye(2), 0.01 * stiffness / W1, stiffness, ("q1", "q2"), ports)
    return Structure(system, {"y2": Channel("p2", "acceleration")}, "p1", tolerance=StructureTolerances(**tolerances))


def records(rng: np.random.Generator):
    """Two sessions of two levels; the machine moves by a percent between sessions, by 0.4 % between records."""
    out = []
    for session in ("monday", "tuesday"):
        moved = 0.01 * rng.standard_normal()
        for level in NOISE:
            k = float(np.exp(moved + 0.004 * rng.standard_normal()))
            machine = replace(chain(), scales=(1.0, 1.0, k))
            data = frequency_response(machine, None, FREQ).data[0, :, 0]
            variance = np.full(data.shape, (NOISE[level] * np.abs(data).max()) ** 2)
            noise = rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)
            out.append(
                entry_of(
                    len(out), None, level, data + np.sqrt(variance / 2) * noise, variance, FREQ, ("y2",),
                    ("acceleration",), session=session,
                )
            )  # fmt: skip
    return out


@pytest.mark.parametrize("seed", range(3))
def test_a_loud_record_is_predicted_from_quiet_ones_of_a_machine_that_moves(seed, monkeypatch):
    entries = records(np.random.default_rng(seed))
    nominal = chain(drift=0.01)
    quiet, loud = (tuple(e for e in entries if e.level == level) for level in NOISE)
    together = fit(nominal, Records(tuple(entries), moving=True), Hypothesis())
    assert together.reduced < 1.3
    with Workers() as workers:
        judged = cross_validation.judge(nominal, (Fold(quiet, loud),), together, workers)
        assert cross_validation.reduced_chi2(judged) < 1.5
        # To first order it is predicted by nothing that is known.
        monkeypatch.setattr("cutvib_ss.diagnosis.predictive.SETTINGS", replace(SETTINGS, predictive_iterations=0))
        judged = cross_validation.judge(nominal, (Fold(quiet, loud),), together, workers)
        assert cross_validation.reduced_chi2(judged) > 5.0
