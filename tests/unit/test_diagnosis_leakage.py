"""Changes of a model as windowed blocks of a continuous recording show them, against simulated recordings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.leakage import Leakage
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from tests.unit.diagnosis_example import example_structure

FS, BLOCK = 512.0, 512


def recorded() -> Replay:
    force = np.random.default_rng(4).standard_normal(16 * BLOCK)
    lines = np.arange(20, 111)
    return Replay((force,), FS, lines, BLOCK, BLOCK // 2, begin=BLOCK // 2)


def shown(structure: Structure, replay: Replay) -> np.ndarray:
    """Displacement at the drive, simulated on a grid eight times as fine as the recording, as its estimator shows it."""
    system, fine = structure.scaled, 8
    n = len(system.mass)
    inverse = np.linalg.inv(system.mass)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ system.stiffness, -inverse @ system.damping]])
    b = np.concatenate([np.zeros(n), inverse @ system.ports["drive"]])[:, None]
    c = np.concatenate([system.ports["drive"], np.zeros(n)])[None]
    force = signal.resample(replay.forces[0], fine * replay.forces[0].size)
    time = np.arange(force.size) / (fine * FS)
    _, response, _ = signal.lsim((a, b, c, np.zeros((1, 1))), force, time)
    return replay.data([np.asarray(response)[None, ::fine]])[0]


@pytest.mark.parametrize("matrix", [0, 1, 2])
def test_a_change_leaks_as_a_simulated_one_does(matrix: int) -> None:
    structure, replay, h = example_structure(), recorded(), 1e-4

    def scaled(factor: float) -> Structure:
        return replace(structure, scales=tuple(factor if k == matrix else 1.0 for k in range(3)))

    freq = replay.lines * FS / BLOCK
    plain = [frequency_response(scaled(1 + d), None, freq).data[0, 0, 0] for d in (h, -h)]
    leaked = [shown(scaled(1 + d), replay) for d in (h, -h)]
    closed, simulated = ((up - down) / (2 * h) for up, down in (plain, leaked))
    found = closed + Leakage(structure, np.nan, replay, freq).of(closed)
    size = np.linalg.norm(simulated)
    assert np.linalg.norm(found - simulated) < 0.03 * size
    # Half a second is short beside these modes: without leakage nothing would be right.
    assert np.linalg.norm(closed - simulated) > 0.3 * size
