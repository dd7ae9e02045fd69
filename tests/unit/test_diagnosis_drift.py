"""Campaigns of the published machine that moves between sessions and lacks nothing: made by closed forms, not by directions."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.discrepancy import cause_weights, features
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.paths import value_at, with_values
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import MeasuredFrequencyResponse

MACHINE = published_machine()
FREQ = np.arange(16.0, 400.0, 8.0)
CHANNELS = ("tool_x", "base_x")
NOISE, DRIFT = 3e-3, 5e-3
"""Of the largest response, and of stiffnesses and gains; dampings move by ten times as much."""


def moved(rng: np.random.Generator) -> tuple[Machine, np.ndarray]:
    """The machine of one session, and the gain of each channel."""
    values = {}
    for path, times in (
        (("head", "k1"), 1.0),
        (("head", "k2"), 1.0),
        (("rail", "parameters", "first_frequency"), 0.5),
        (("head", "c1"), 10.0),
        (("head", "c2"), 10.0),
        (("rail", "parameters", "damping_ratio"), 10.0),
    ):
        values[path] = value_at(MACHINE, path) * (1.0 + times * DRIFT * rng.standard_normal())
    return with_values(MACHINE, values), 1.0 + DRIFT * rng.standard_normal(len(CHANNELS))


def campaign(
    folder: Path,
    sessions: dict[str | None, tuple[float, ...]],
    seed: int,
    fault: Callable[[Machine], Machine] = lambda model: model,
    noise_level: float = NOISE,
) -> Campaign:
    """Responses with noise of a known variance; without a name every position is a session of its own, with its own fault."""
    rng = np.random.default_rng(seed)
    records = []
    for name, positions in sessions.items():
        model, gain = moved(rng)
        model = fault(model)
        for y in positions:
            if name is None:
                model, gain = moved(rng)
                model = fault(model)
            data = frequency_response(model, [y], FREQ, outputs=CHANNELS).data * gain[:, None, None]
            std = noise_level * np.abs(data).max(axis=-1, keepdims=True) * np.ones(FREQ.size)
            noise = std * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
            frf = MeasuredFrequencyResponse(
                data + noise, FREQ, np.array([y]), CHANNELS, ("force",), ("acceleration",) * 2, variance=std**2, averages=4
            )  # fmt: skip
            records.append(
                Record(
                    f"r{len(records)}", "frf", y, None, None, CHANNELS, ("acceleration",) * 2, (), frf, 4, "multisine",
                    session=name,
                )
            )  # fmt: skip
    return Campaign("drift", folder, MACHINE, tuple(records))


def retuned(found: Campaign, machine: Machine) -> Fit:
    return fit(machine, Records(observe(found, machine).entries), Hypothesis())


@pytest.mark.parametrize(
    ("sessions", "count"),
    [
        ({None: (0.1, 0.3, 0.6, 0.9)}, 4),
        ({"Monday": (0.1, 0.5), "Tuesday": (0.5, 0.8)}, 2),
    ],
    ids=["positions", "stated"],
)
def test_a_machine_that_moves_between_sessions_has_no_gap(
    tmp_path: Path, sessions: dict[str | None, tuple[float, ...]], count: int
) -> None:
    measured = campaign(tmp_path, sessions, seed=6)
    steady = replace(MACHINE, tolerance=replace(MACHINE.tolerance, drift=1e-9))
    found = retuned(measured, MACHINE)
    assert len(found.spread.layout.sessions) == count
    assert 0.85 < found.reduced < 1.1
    # No tuning that all sessions share, and no smooth error of its stiffness, does that.
    together = retuned(measured, steady)
    assert together.reduced > 5.0
    diagnosis = diagnose(measured)
    assert diagnosis.verdict == "no_gap"
    assert diagnosis.causes[0].effect == diagnosis.where.place == "none"
    assert 0.9 < diagnosis.causes[0].reduced_chi2 < 1.1
    assert not diagnosis.where.level_dependent


def test_a_machine_that_moves_between_the_positions_of_a_session_has_no_gap(tmp_path: Path) -> None:
    """All of one day: each position's own drift is one within the session."""
    found = campaign(tmp_path, {None: (0.1, 0.3, 0.6, 0.9)}, seed=6)
    measured = replace(found, records=tuple(replace(r, session="Monday") for r in found.records))
    entries = observe(measured, MACHINE).entries
    still, moving = (fit(MACHINE, Records(entries, moving=m), Hypothesis()) for m in (False, True))
    assert still.reduced > 1.3
    assert moving.reduced < 1.1
    assert moving.log_evidence - still.log_evidence > 100.0
    diagnosis = diagnose(measured)
    assert diagnosis.verdict == "no_gap"
    assert 0.001 <= diagnosis.sizes["within"] <= 0.01


def test_a_machine_that_moves_between_two_records_of_one_position_has_no_gap(tmp_path: Path) -> None:
    """Measured twice without a word of sessions: what is of one position is of one session."""
    measured = campaign(tmp_path, {None: (0.1, 0.1, 0.6, 0.6)}, seed=6)
    assert fit(MACHINE, Records(observe(measured, MACHINE).entries), Hypothesis()).reduced > 1.3
    diagnosis = diagnose(measured)
    assert diagnosis.verdict == "no_gap"
    assert diagnosis.sizes["within"] >= 0.001


@pytest.mark.slow
def test_a_cause_is_found_on_a_machine_that_moves_between_the_positions_of_a_session(tmp_path: Path) -> None:
    found = campaign(tmp_path, {None: (0.1, 0.3, 0.6, 0.9)}, 6, ToolContact("tool", 5e5, 20.0).apply)
    measured = replace(found, records=tuple(replace(r, session="Monday") for r in found.records))
    diagnosis = diagnose(measured)
    assert (diagnosis.verdict, diagnosis.causes[0].effect) == ("explained", "tool_contact")


def test_what_stands_beside_a_cause_along_the_rail_has_no_error_that_varies_over_the_position(tmp_path: Path) -> None:
    """Else a joint's damper that drifts between sessions, one at each position, would be an error of a pair's form."""
    records = Records(observe(campaign(tmp_path, {None: (0.1, 0.4, 0.8)}, 6), MACHINE).entries)
    ends, damper = EndFixity("rail_ends", k_left=1e3, k_right=1e3), ParameterShift("joint2", "c2", 1.1)
    for causes, count, err in (
        ((ends,), 3, [True] * 2),
        ((damper,), 1, [True]),
        ((damper, ends), 3, [False, True, True]),
    ):
        problem = Problem(MACHINE, records.merged, Hypothesis(causes))
        (group,) = problem.groups
        assert len({float(features(group, row, problem)[1][0]) for row in range(3)}) == count
        assert (cause_weights(problem, problem.start()) != 0.0).tolist() == err


def test_the_fault_drifts_like_the_machine(tmp_path: Path) -> None:
    """A spring at the tool that is another one in each session, by as much as the machine's own: a cause of the catalogue."""
    rng = np.random.default_rng(4)
    spring = ToolContact("tool", 5e5, 20.0)

    def fault(model: Machine) -> Machine:
        return replace(spring, stiffness=spring.stiffness * (1.0 + 4 * DRIFT * rng.standard_normal())).apply(model)

    measured = campaign(tmp_path, {None: (0.1, 0.3, 0.6, 0.9)}, 6, fault, 2e-4)
    found = fit(MACHINE, Records(observe(measured, MACHINE).entries), Hypothesis((spring,)))
    (effect,) = found.hypothesis.effects
    assert isinstance(effect, ToolContact)
    assert effect.stiffness == pytest.approx(spring.stiffness, rel=6 * DRIFT)
    assert found.reduced < 1.1
    assert found.spread.sizes.cause < 0.1
