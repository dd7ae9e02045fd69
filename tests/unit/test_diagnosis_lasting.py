"""Blows whose force goes on acting: the closed form of a tail holds it to its pulse, a simulation does not."""

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.cross_validation import predicted
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.lasting import with_lasting
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.measurement.records import Campaign, History, Record
from tests.unit.diagnosis_example import example_structure

FS, NOISE = 2048.0, 2e-7
STRUCTURE = example_structure()


def struck(corner: float) -> Campaign:
    """Two records of blows; the force is what a sensor with a time constant shows of a push, and acts as it is recorded."""
    rng = np.random.default_rng(1)
    time = np.arange(4096) / FS
    system = STRUCTURE.scaled
    inverse = np.linalg.inv(system.mass)
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ system.stiffness, -inverse @ system.damping]])
    b = np.concatenate([np.zeros(2), inverse @ system.ports["drive"]])[:, None]
    plant = (a, b, np.eye(1, 4), np.zeros((1, 1)))
    records = []
    for name, peak in (("r1.csv", 50.0), ("r2.csv", 150.0)):
        histories = []
        for k in range(3):
            size = peak * (1.0 + 0.1 * rng.standard_normal())
            force = size * np.sin(np.pi * np.clip((time - 0.1) / 6e-3, 0.0, 1.0))
            area, after = size * 6e-3 * 2 / np.pi, np.maximum(time - 0.106, 0.0)
            force -= 2 * np.pi * corner * area * np.exp(-2 * np.pi * corner * after) * (time > 0.106)
            motion = np.asarray(signal.lsim(plant, force, time)[1])[None]
            motion = motion + NOISE * rng.standard_normal(motion.shape)
            histories.append(
                History(FS, force + 1e-3 * rng.standard_normal(force.size), motion, ("y",), f"blow {k + 1}")
            )
        records.append(
            Record(name, "impact", None, peak, None, ("y",), ("displacement",), tuple(histories), averages=3)
        )
    return Campaign("blows", Path("."), STRUCTURE, tuple(records))


@pytest.mark.parametrize("corner", [0.0, 0.5])
def test_a_force_that_swings_back_is_simulated(corner: float) -> None:
    records = Records(with_lasting(STRUCTURE, observe(struck(corner), STRUCTURE).entries))
    assert [e.replay is not None and e.replay.lasting for e in records.entries] == [corner > 0.0] * 2
    assert records.leaking == (corner > 0.0)
    found = fit(STRUCTURE, records, Hypothesis())
    assert found.reduced == pytest.approx(1.0, abs=0.1)
    assert np.abs(found.x[: found.n_tuning]).max() < 0.5
    # So are those that are held out: judged by the closed form they left 13 times the noise, and a gap-free machine was unknown.
    problem = problem_for(STRUCTURE, records, Hypothesis())
    judged = [
        cross_validation.judged(e, predicted(e, found.model, 0.0, problem, found.x), problem, found)
        for e in records.entries
    ]
    assert cross_validation.reduced_chi2(judged) == pytest.approx(1.0, abs=0.15)
