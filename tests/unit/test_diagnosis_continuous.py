"""Continuous recordings: cut out of a motion that had begun before, under a constant force that nobody recorded."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import Observations, observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances

MASS, DAMPING, FRICTION, OFFSET = 95.0, 200.0, 20.0, -8.0
FS, SAMPLES, BLOCK = 500.0, 4096, 2.048
NOISE = 1e-7
CARRIAGE = Structure(
    SecondOrder(np.array([[MASS]]), np.array([[DAMPING]]), np.zeros((1, 1)), ("x",), {"carriage": np.ones(1)}),
    {"y": Channel("carriage", "displacement")},
    "carriage",
    tolerance=StructureTolerances(0.02, 0.2, 0.02, 0.01),
)
LAW = Hypothesis((DryFriction("carriage", 15.0, 1e6),), {"carriage": 0.05})


@cache
def observed() -> Observations:
    """Three pieces of one long motion under a multisine, Runge-Kutta; friction sets in within 0.2 mm/s."""
    rng = np.random.default_rng(3)
    count, fine = 3 * SAMPLES + 2000, 4
    t = np.arange(count * fine) / (FS * fine)
    lines, phases = np.arange(0.5, 8.0, 0.25), rng.uniform(0, 2 * np.pi, 30)
    force = sum(25.0 * np.sin(2 * np.pi * f * t + p) for f, p in zip(lines, phases, strict=True))
    y, v, h, out = 0.1, 0.0, 1.0 / (FS * fine), np.empty(t.size)

    def rate(v: float, f: float) -> float:
        return (f + OFFSET - DAMPING * v - FRICTION * np.tanh(v / 2e-4)) / MASS

    for k, f in enumerate(force):
        out[k] = y
        middle = v + 0.5 * h * rate(v, f)
        after = v + h * rate(middle, f)
        y, v = y + 0.5 * h * (v + after), after
    out = out[::fine] + NOISE * rng.standard_normal(count)
    pieces = [slice(2000 + k * SAMPLES, 2000 + (k + 1) * SAMPLES) for k in range(3)]
    records = [
        Record(
            f"r{k}", "timeseries", None, None, None, ("y",), ("displacement",),
            (History(FS, force[::fine][cut], out[None, cut], ("y",)),), block=BLOCK,
        )
        for k, cut in enumerate(pieces)
    ]  # fmt: skip
    return observe(Campaign("", Path(), CARRIAGE, tuple(records), ()), CARRIAGE)


def test_what_had_begun_before_is_run_in() -> None:
    for e in observed().entries:
        assert e.replay is not None
        assert e.replay.begin == round(BLOCK * FS) // 2
        # The estimator that is replayed shows of what was measured what was estimated.
        shown = e.replay.data(list(e.replay.measured))
        assert np.abs(shown - e.data).max() < 1e-12 * np.abs(e.data).max()


def test_lines_that_are_noise_are_left_out() -> None:
    assert all(7.0 < e.freq[-1] < 60.0 for e in observed().entries)


def test_a_constant_force_leads_where_its_difference_does() -> None:
    problem = problem_for(CARRIAGE, Records(observed().entries), LAW)
    x = problem.start()
    predictions, left, _ = problem.residuals(x)
    rows = Directions(problem, x, predictions, spread=False).flat()
    moved = x.copy()
    moved[problem.first_effect - 1] = 0.02
    assert problem.offset_of(moved) == pytest.approx(0.02 * problem.force_offset)
    changes = [a - b for a, b in zip(left, problem.residuals(moved)[1], strict=True)]
    change = np.concatenate([part.ravel() for c in changes for part in (c.real, c.imag)])
    row = rows[problem.first_effect - 1]
    assert change @ row > 0.999 * np.linalg.norm(change) * np.linalg.norm(row)


def test_the_constant_force_is_found_beside_the_friction() -> None:
    records = Records(observed().entries)
    found = fit(CARRIAGE, records, LAW)
    problem = problem_for(CARRIAGE, records, found.hypothesis)
    assert problem.offset_of(found.x) == pytest.approx(OFFSET, rel=0.2)
    assert found.hypothesis.effects[0].torque == pytest.approx(FRICTION, rel=0.05)
    assert found.log_evidence > fit(CARRIAGE, records, Hypothesis()).log_evidence + 100.0


def test_a_linear_cause_knows_no_constant_force() -> None:
    assert problem_for(CARRIAGE, Records(observed().entries), Hypothesis(), apart=True).force_offset == 0.0


def test_what_leaks_is_differentiated_with_its_leak() -> None:
    # A stiff axis under a slow motion: what leaks is as large as the response at its upper lines.
    stiff = replace(CARRIAGE, system=replace(CARRIAGE.system, stiffness=np.array([[MASS * (2 * np.pi * 3.0) ** 2]])))
    spring = Hypothesis((ToolContact("carriage", 5e3, 10.0),))
    problem = problem_for(stiff, Records(observed().entries), spring)
    x = problem.start()
    predictions, _, _ = problem.residuals(x)
    rows = Directions(problem, x, predictions, spread=False).flat()
    for i in (0, 2, problem.first_effect):  # mass, stiffness, the spring
        ends = []
        # A contact's range is a hundred times what holds the carriage.
        size = 1e-3 if i < problem.first_effect else 2e-5
        for step in (size, -size):
            moved = x.copy()
            moved[i] += step
            ends.append(np.concatenate([p.ravel() for r in problem.residuals(moved)[1] for p in (r.real, r.imag)]))
        change = (ends[1] - ends[0]) / (2 * size)
        assert np.linalg.norm(change - rows[i]) < 0.02 * np.linalg.norm(change)


def test_starts_of_restoring_forces_see_the_loudest_blocks_alone() -> None:
    records = Records(observed().entries)
    few = records.for_laws(1000, 0.0)
    assert few is not None
    (short,) = few.entries
    whole = next(e for e in records.entries if e.record == short.record)
    assert short.replay is not None
    assert whole.replay is not None
    (force,), (of_all,), hop = short.replay.forces, whole.replay.forces, round(BLOCK * FS) // 2
    assert force.size == short.replay.begin + 3 * hop
    begin = next(
        k for k in range(0, of_all.size - force.size + 1, hop) if np.array_equal(of_all[k : k + force.size], force)
    )
    # The record has no louder two blocks.
    window = np.hanning(2 * hop)
    each = [
        np.sum((window * of_all[k : k + 2 * hop]) ** 2)
        for k in range(whole.replay.begin, of_all.size - 2 * hop + 1, hop)
    ]
    loud = np.add(each[:-1], each[1:])
    assert loud[begin // hop] > 0.98 * loud.max()
    # They show the same motion, with as much more noise as they have less power.
    assert np.abs(short.replay.data(list(short.replay.measured)) - short.data).max() < 1e-12 * np.abs(short.data).max()
    np.testing.assert_allclose(short.variance, whole.replay.power / short.replay.power * whole.variance)
