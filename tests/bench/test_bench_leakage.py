"""How fast the derivatives of a continuous recording are: in closed form with its leak, against differences of simulations."""

from time import perf_counter
from typing import Any

import numpy as np
import pytest

from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.records import Entry, Records
from cutvib_ss.diagnosis.simulation import SimulatedProblem
from cutvib_ss.measurement.records import History, Record
from cutvib_ss.measurement.replay import replay_of
from tests.unit.diagnosis_example import example_structure, measured

LEAST_RATIO = 5.0
FS, SAMPLES = 512.0, 32 * 512


def recorded() -> Entry:
    force = np.random.default_rng(4).standard_normal(SAMPLES)
    history = History(FS, force, np.zeros((2, SAMPLES)), ("y", "a"), "run 1")
    record = Record("r.csv", "timeseries", None, None, None, ("y", "a"), ("displacement", "acceleration"), (history,))
    replay = replay_of(record)
    freq = replay.lines * FS / replay.block
    keep = (freq > 5.0) & (freq < 120.0)
    return Entry(0, measured(example_structure(), None, freq[keep]), 1.0, False, replay.at(keep), None, "1")


@pytest.mark.benchmark(group="leakage")
def test_derivatives_with_their_leak_are_faster_than_simulated_differences(benchmark: Any) -> None:
    problem = SimulatedProblem(example_structure(), Records((recorded(),)).apart_groups(), Hypothesis())
    x = problem.start()
    (shown,) = problem.predictions(x)
    ours = benchmark(lambda: problem.jacobian(x, shown))
    start = perf_counter()
    theirs = np.array([problem._by_simulation(x, i, shown) for i in range(problem.n_tuning)])
    seconds = perf_counter() - start
    ratio = seconds / benchmark.stats.stats.min
    benchmark.extra_info["ratio to simulated differences"] = round(ratio, 1)
    print(
        f"\n{problem.n_tuning} values, {shown.data.shape[-1]} lines: {ratio:.1f} times faster than simulated differences"
    )
    assert ours.shape[0] >= len(theirs)
    assert ratio >= LEAST_RATIO
