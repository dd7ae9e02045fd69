"""Two causes at once: what promises most on top of the first, and how far behind what was not fitted is put."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cutvib_ss.diagnosis import pairs
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import Candidate, candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import Ranked, cost, on_all_lines
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.paths import with_values
from tests.unit.record_example import entry_of

FREQ = np.arange(18.0, 400.0, 2.0)
S = 2j * np.pi * FREQ
CHANNELS = ("tool_x", "tool_z", "base_x")
MACHINE = published_machine()
OFF = with_values(MACHINE, {("head", "k2"): 1.01 * MACHINE.head.k2})
MASS, DELAY = AddedMass("tool", 0.1), ChannelDelay("measurement", "tool_x", 1e-4)
CUBIC, FRICTION = CubicStiffness("joint2", 1e9), DryFriction("joint2", 0.1)
BLOCK = 3.0
"""Of it the slowest modes leave a ten-thousandth: too little to see, enough to be reckoned with."""


def clamped_and_crossed(fraction=0.16):
    """Dense responses of a machine with stiff ends, read by sensors of which one is askew."""
    rng, machine = np.random.default_rng(3), EndFixity("rail_ends", 4.4e4, 1.1e5).apply(MACHINE)
    out = []
    for k, y in enumerate((0.1, 0.3, 0.5, 0.8)):
        system = machine.second_order(y)
        load = np.broadcast_to(system.port("tool_x")[:, None], (FREQ.size, len(system.dofs), 1))
        reads = np.array([system.port(p) for p in ("tool_x", "tool_z", "base")])
        data = (reads @ np.linalg.solve(system.dynamic_stiffness(S), load)[..., 0].T) * S**2
        data[1] += fraction * data[0]
        noise = 1e-3 * np.abs(data).max(axis=1, keepdims=True) * np.ones(FREQ.size)
        data = data + noise * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
        out.append(
            entry_of(k, y, None, data, noise**2, FREQ, CHANNELS, ("acceleration",) * 3, block=BLOCK, blow_at=0.05)
        )
    return Records(tuple(out))


@pytest.fixture(scope="module")
def records():
    return clamped_and_crossed()


@pytest.fixture(scope="module")
def first(records):
    return fit(OFF, records, Hypothesis((EndFixity("rail_ends", 5e4, 9e4),)))


def test_a_cause_that_does_nothing_at_its_start_promises_most_all_the_same(records, first):
    # The tuning stands in for what lacks, and the circles around the slow poles are not those of the fit.
    assert first.reduced > 1.4
    scan = Scan(OFF, records, first.hypothesis, first.x, {}, apart=False)
    gains = {c.name: scan.promise(c.starts).gain for c in candidates(OFF, (18.0, 400.0), CHANNELS)}
    assert max(gains, key=lambda name: gains[name]) == "cross_axis"
    assert gains["cross_axis"] > 1.5 * sorted(gains.values())[-2]


def test_a_second_cause_has_to_promise_some_of_what_the_first_leaves(records, first):
    scan = Scan(OFF, records, first.hypothesis, first.x, {}, apart=False)
    gains = {c.name: scan.promise(c.starts).gain for c in candidates(OFF, (18.0, 400.0), CHANNELS)}
    tried = [name for name, gain in gains.items() if gain >= scan.least]
    assert "cross_axis" in tried
    assert len(tried) < len(gains) / 2
    # Of a model that nothing is fitted to first order tells too little to leave any out, and what leaves noise asks for nothing.
    assert Scan(OFF, records, first.hypothesis, None, {}, apart=False).least == -np.inf
    exact = clamped_and_crossed(0.0)
    right = fit(OFF, exact, first.hypothesis)
    assert Scan(OFF, exact, right.hypothesis, right.x, {}, apart=False).least < 0.02 * exact.entries[0].count


def test_a_strained_tuning_counts_its_way_back():
    # So little askew that no unknown is held by an end of its range: freed, those would gain too.
    records = clamped_and_crossed(0.02)
    first = fit(OFF, records, Hypothesis((EndFixity("rail_ends", 5e4, 9e4),)))
    assert np.all(np.abs(first.x[: first.first_effect]) < SETTINGS.fit_within)
    scan = Scan(OFF, records, first.hypothesis, first.x, {}, apart=False)
    # At the best fit its own unknowns gain nothing, the priors counted; drift and discrepancy have taken their part in both.
    best = scan.underneath
    strain = float(best.x[: best.first_effect] @ best.x[: best.first_effect])
    assert strain > 3.0
    assert scan.leaves == pytest.approx(best.chi2 + strain, abs=0.3 * strain)


def test_causes_that_are_not_fitted_stay_as_far_behind_as_they_were(records, first):
    law = Hypothesis((BilinearStiffness("joint1", 0.1),), {"joint1": 1e-5})
    behind = [
        replace(first, hypothesis=law, log_evidence=first.log_evidence - d / 2, chi2=1e9) for d in (1500.0, 1500.5)
    ]
    rough = [(Candidate(f"law {k}", ()), f) for k, f in enumerate(behind)]
    out = on_all_lines(OFF, records, rough, 2, (cost(first), first.log_evidence), Workers())
    assert not any(r.refined for r in out)
    assert [r.fit.log_evidence - first.log_evidence for r in out] == pytest.approx([-750.0, -750.25])


@pytest.mark.parametrize(
    "effects", [(MASS, CUBIC), (MASS, DELAY), (CUBIC, FRICTION)], ids=["one of each", "linear", "restoring forces"]
)
def test_each_part_of_the_best_pair_is_fitted_by_itself(
    effects: tuple[Effect, Effect], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cubic spring that was found beside a mass only was that pair, 1.00: it had no fit of its own to speak against the mass."""
    asked = []

    def refit(
        nominal: object, records: object, hypothesis: Hypothesis, x: object, steps: int, near: object, rival: float
    ) -> None:
        asked.append((*hypothesis.effects, steps, near, rival))

    monkeypatch.setattr(pairs, "refit", refit)
    best = SimpleNamespace(
        hypothesis=Hypothesis(effects), x=np.zeros(3), first_effect=2, objective=10.0, log_evidence=-5.0
    )
    alone = SimpleNamespace(hypothesis=Hypothesis(effects[:1]), objective=30.0)
    ranked = [Ranked("pair", cast(Fit, best), True), Ranked("single", cast(Fit, alone), True)]
    pairs.by_themselves(cast(Model, None), cast(Records, None), [replace(ranked[0], name="one + other")], ranked[1:])
    steps = [SETTINGS.search_most_steps if e.linear else SETTINGS.search_most_law_steps for e in effects]
    # They start with the pair's drift and discrepancy.
    assert asked == [(effects[0], steps[0], best, 30.0), (effects[1], steps[1], best, np.inf)]
