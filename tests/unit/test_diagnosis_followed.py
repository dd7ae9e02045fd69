"""Machines that move from record to record by more than their resonances are wide."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.following import _moves, followed, moving
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.ranking import Ranked, refit
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit.record_example import entry_of

FREQ = np.linspace(20.0, 400.0, 200)
MACHINE = published_machine()


def records(moves: float) -> Records:
    """Two sessions of three records, with noise of 0.03 %; stiffnesses move from one record to the next."""
    rng, entries = np.random.default_rng(3), []
    for i, position in enumerate((0.2, 0.45)):
        for j, level in enumerate((10.0, 30.0, 100.0)):
            k1, k2, first = 1.0 + moves * rng.standard_normal(3)
            true = MACHINE.replace(
                k1=k1 * MACHINE.head.k1,
                k2=k2 * MACHINE.head.k2,
                first_frequency=first * MACHINE.rail.parameters.first_frequency,
            )
            data = frequency_response(true, [position], FREQ, outputs=["tool_x"]).data[0, :, 0]
            size = 3e-4 * np.abs(data)
            noise = size / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
            entries.append(
                entry_of(3 * i + j, position, level, data + noise, size**2, FREQ, ("tool_x",), ("acceleration",),
                      blow_at=0.0, session=str(i))
            )  # fmt: skip
    return Records(tuple(entries))


def test_a_machine_that_moves_far_is_followed_from_afar() -> None:
    own = records(0.03)
    merged = fit(MACHINE, own, Hypothesis())
    moving = replace(own, moving=True)
    beside = refit(MACHINE, moving, Hypothesis(), merged.x, SETTINGS.search_most_steps, near=merged)
    assert beside is not None
    # Beside the merged fit drifts end in a side minimum.
    assert beside.reduced > 10.0
    found = followed(MACHINE, moving, Ranked("none", merged, False))
    assert found.reduced < 1.1
    assert found.refined
    assert not _moves(found)
    assert _moves(Ranked("none", beside, True))


@pytest.mark.parametrize(
    ("within", "linear", "limit", "followed"),
    [(3e-3, True, 1.0, 9), (3e-3, True, -1.0, 3), (1e-6, True, -1.0, 2), (3e-3, False, 1.0, 2)],
)
def test_on_a_machine_that_moves_within_its_sessions_causes_are_followed_that_few_lines_alone_know(
    monkeypatch: pytest.MonkeyPatch, within: float, linear: bool, limit: float, followed: int
) -> None:
    """A joint that relaxes, on a machine that warms, was the fifth on few lines, and followed leads by 459 nats."""
    hypothesis = Hypothesis() if linear else Hypothesis((CubicStiffness("joint2", 1e9),))

    def ranked(name: str, evidence: float, refined: bool) -> Ranked:
        spread = SimpleNamespace(sizes=Sizes(within=within))
        found = SimpleNamespace(hypothesis=hypothesis, spread=spread, log_evidence=evidence, objective=0.0, reduced=1.1)
        return Ranked(name, cast(Fit, found), refined)

    known = [ranked(str(k), -float(k), k < 2) for k in range(12)]
    asked: list[str] = []

    def follow(nominal: object, records: object, r: Ranked, **rest: object) -> Ranked:
        asked.append(r.name)
        return r

    monkeypatch.setattr("cutvib_ss.diagnosis.following.followed", follow)
    workers = Workers(1, None, limit)
    out = moving(MACHINE, records(0.0), ranked("none", 0.0, True), known, workers)
    assert asked == [str(k) for k in range(followed)]
    assert list(workers.left_out) == (["following more linear causes"] if followed == 3 else [])
    assert {r.name for r in out} >= {str(k) for k in range(followed, 12)}
