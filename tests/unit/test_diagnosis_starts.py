"""Starts of a fit: a structure's stiffness is looked through where its resonances are narrower than its tolerance."""

import numpy as np

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.starts import at_stiffnesses
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import value_at, with_value
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

FREQ = np.arange(5.0, 120.0, 0.25)
STIFFNESS = ("scales", 2)
OFF = -1.5  # In tolerances


def chain(ratio: float) -> Structure:
    """Three masses on springs, their damping in proportion to the stiffness."""
    stiffness = 4e4 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    damping = 2.0 * ratio / (2 * np.pi * 20.0) * stiffness
    system = SecondOrder(np.eye(3), damping, stiffness, ("a", "b", "c"), {"tip": [0.0, 0.0, 1.0]})
    return Structure(system, {"y": Channel("tip", "acceleration")}, "tip")


def measured(nominal: Structure, noise: float = 1e-3) -> Records:
    """Records of the same structure, softer by one and a half tolerances."""
    softer = with_value(nominal, STIFFNESS, value_at(nominal, STIFFNESS) * np.exp(OFF * nominal.tolerance.stiffness))
    data = frequency_response(softer, None, FREQ).data[0, :, 0]
    rng = np.random.default_rng(1)
    std = noise * np.abs(data).mean()
    shown = data + std / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
    entry = entry_of(0, None, 1.0, shown, np.full(data.shape, std**2), FREQ, ("y",), ("acceleration",))
    return Records((entry,))


def looked(nominal: Structure, records: Records) -> tuple[Problem, np.ndarray]:
    few = records.coarse(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error)
    problem = problem_for(nominal, few, Hypothesis())
    return problem, at_stiffnesses(problem, problem.start())


def test_the_stiffness_of_a_lightly_damped_structure_is_found() -> None:
    nominal = chain(0.001)
    records = measured(nominal)
    problem, start = looked(nominal, records)
    index = [path for path, _ in problem.tuning].index(STIFFNESS)
    assert abs(start[index] - OFF) < 0.2
    # Nothing else has moved.
    assert np.count_nonzero(start) == 1
    made = fit(nominal, records, Hypothesis(), start)
    assert made.reduced < 1.2
    # From the nominal stiffness it ends elsewhere.
    assert fit(nominal, records, Hypothesis()).reduced > 2.0


def test_where_resonances_are_wide_either_start_leads_there() -> None:
    nominal = chain(0.05)
    records = measured(nominal)
    _, start = looked(nominal, records)
    given, found = fit(nominal, records, Hypothesis()), fit(nominal, records, Hypothesis(), start)
    assert abs(given.objective - found.objective) < 1.0


def test_a_machine_without_one_stiffness_starts_where_it_is() -> None:
    machine = published_machine()
    data = frequency_response(machine, [0.3], FREQ, outputs=["tool_x"]).data[0, :, 0]
    entry = entry_of(0, 0.3, 1.0, data, 1e-6 * np.abs(data) ** 2, FREQ, ("tool_x",), ("acceleration",))
    problem = problem_for(machine, Records((entry,)), Hypothesis())
    assert not at_stiffnesses(problem, problem.start()).any()
