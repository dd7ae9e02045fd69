"""A second cause has to leave noise on held-out records; two values of one place are one cause."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.held_out import HeldOut
from cutvib_ss.diagnosis.held_out_rules import judged_on_held_out
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.known_form import _by_one_name, of_known_form
from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.posterior import kind_of, that_drift_by_chance
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.ranking import Ranked, once
from cutvib_ss.diagnosis.search import _better, _without_the_other
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.standing import first_known, forces_come_close, is_enough, lacks_a_form, of_one_place
from cutvib_ss.diagnosis.unknown_element import UnknownChannelError, UnknownElement
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.results import FloatArray

MASS, CUBIC = AddedMass("tool", 0.1), CubicStiffness("joint2", 1e9)
UNKNOWN = UnknownElement("joint1", "joint1", 1e5, 10.0, 400.0)


@dataclass(frozen=True)
class OnlyEvidence:
    hypothesis: Hypothesis
    log_evidence: float
    of_no_size: tuple[Effect, ...] = ()
    tolerated: tuple[Effect, ...] = ()
    at_end: tuple[str, ...] = ()
    beyond_belief: bool = False
    nothing_when_used: tuple[Effect, ...] = ()
    tuned_away: bool = False
    tuned_out: bool = False
    stds_of_effects = Fit.stds_of_effects
    calibrated_away: frozenset[str] = frozenset()
    stds: Mapping[str, float] = field(default_factory=dict)
    reduced: float = 1.0
    errs: bool = False
    correlation: float = 10.0
    # One unknown in the middle of its prior, of which the data tell nothing
    x: FloatArray = field(default_factory=lambda: np.zeros(1))
    first_effect: int = 1
    shared_precision: FloatArray = field(default_factory=lambda: np.ones(1))
    covariance: FloatArray = field(default_factory=lambda: np.eye(1))

    @property
    def corrected(self) -> OnlyEvidence:
        return replace(self, of_no_size=self.nothing_when_used)

    @property
    def spread(self) -> OnlyEvidence:
        return self

    def is_large(self, name: str) -> bool:
        return self.errs and name == "cause"

    def largest(self, name: str) -> bool:
        return False


def ranked(name: str, evidence: float, *effects: Effect) -> Ranked:
    return Ranked(name, cast(Fit, OnlyEvidence(Hypothesis(effects), evidence)), True)


@dataclass(frozen=True)
class Leaves:
    """What a hypothesis leaves of held-out records."""

    reduced: float = 1.0
    against_stated: float = 1.0
    log_density: float = 0.0
    squares: float = 0.0
    records: tuple[Any, ...] = ()
    floor: float = 0.0
    unseen: bool = True


def held(**each: Leaves) -> Callable[[Ranked], HeldOut]:
    return lambda r: cast(HeldOut, each.get(r.name, Leaves()))


NONE = ranked("none", 0.0)
MAIN, OTHER, BOTH = ranked("main", 100.0, MASS), ranked("other", 10.0, CUBIC), ranked("both", 200.0, MASS, CUBIC)
BESIDE = ranked("beside", 150.0, MASS, UNKNOWN)
EVERY = [NONE, MAIN, OTHER, BOTH, BESIDE]
ODDS = {"none": 0.0, "main": 0.03, "other": 0.0, "both": 0.95, "beside": 0.02}
TUNED = Leaves(squares=1.0, log_density=-1000.0)


@pytest.mark.parametrize(
    ("left", "closed", "best"), [(1.05, 0.99, "both"), (1.3, 0.99, "main"), (1.3, 0.8, "beside"), (1.05, 0.8, "both")]
)
def test_a_second_cause_is_named_where_it_leaves_noise(left: float, closed: float, best: str) -> None:
    seen = held(none=TUNED, main=Leaves(squares=1.0 - closed), both=Leaves(reduced=left), beside=Leaves())
    found = judged_on_held_out(EVERY, ODDS, seen, 1.0)
    assert max(found, key=lambda name: found[name]) == best
    assert sum(found.values()) == pytest.approx(1.0)
    # Nothing is taken from what was not in question.
    assert found["other"] == 0.0


@pytest.mark.parametrize(("alone", "left", "best"), [(157.0, 1.3, "both"), (157.0, 20.0, "main"), (1.9, 1.3, "main")])
def test_a_second_cause_that_closes_nearly_all_that_the_first_leaves_is_named(
    alone: float, left: float, best: str
) -> None:
    """A mass on a lightly damped frame closes 97 % of the excess and leaves a hundred times the noise; a spring closes that."""
    seen = held(
        none=Leaves(squares=5900.0, log_density=-1e6),
        main=Leaves(squares=alone, against_stated=alone, log_density=-1e4),
        both=Leaves(squares=left, against_stated=left, reduced=max(left, 1.3), floor=1.0, log_density=-100.0),
        beside=Leaves(log_density=-2e4, floor=1.0),
    )
    found = judged_on_held_out(EVERY, ODDS, seen, 1.0)
    assert max(found, key=lambda name: found[name]) == best
    assert found["both"] <= SETTINGS.verdict_form


@pytest.mark.parametrize(("place", "closed", "kept"), [("tool", 0.8, 0.4), ("tool", 0.4, 1.0), ("head", 0.8, 1.0)])
def test_two_linear_causes_between_the_same_points_are_one_of_another_form(
    place: str, closed: float, kept: float
) -> None:
    """A panel that resonates twice was a resonator beside a mass, both on the head (1.00)."""
    both = ranked("both", 200.0, LocalResonator("tool", 0.2, 180.0, 0.02), AddedMass(place, 0.1))
    main = ranked("main", 100.0, LocalResonator("tool", 0.2, 180.0, 0.02))
    seen = held(none=TUNED, main=Leaves(squares=1.0 - closed, log_density=-10.0), both=Leaves())
    found = judged_on_held_out([NONE, main, both], {"none": 0.0, "main": 0.0, "both": 1.0}, seen, 1.0)
    assert found["both"] == pytest.approx(kept)
    assert found["main"] == pytest.approx(1.0 - kept)


@pytest.mark.parametrize(
    ("first", "errs", "closed", "kept"),
    [
        ("other", False, 0.92, SETTINGS.verdict_form),
        ("other", False, 0.9, 1.0),
        ("main", False, 0.92, 1.0),
        ("main", True, 0.92, SETTINGS.verdict_form),
        ("main", True, 0.9, 1.0),
    ],
)
def test_a_second_cause_may_be_the_form_of_a_first_that_closes_nearly_all(
    first: str, errs: bool, closed: float, kept: float
) -> None:
    """
    Friction whose bristles bend was friction together with a rail's twist, 1.00: friction alone closes 92 % of the excess.

    A guide of Hertzian contacts was a guide together with a resonator, 1.00, and still erred by 3 %.
    """
    both = Ranked("both", cast(Fit, replace(cast(OnlyEvidence, BOTH.fit), errs=errs)), True)
    leads = {"main": MAIN, "other": OTHER}
    leads[first] = ranked(first, 150.0, *leads[first].fit.hypothesis.effects)
    seen = held(none=TUNED, **{first: Leaves(squares=1.0 - closed, log_density=-100.0), "both": Leaves()})
    found = judged_on_held_out(
        [NONE, *leads.values(), both], {"none": 0.0, "main": 0.0, "other": 0.0, "both": 1.0}, seen, 1.0
    )
    assert found["both"] == pytest.approx(kept)
    assert found[first] == pytest.approx(1.0 - kept)


@pytest.mark.parametrize(
    ("alone", "beside", "kept"), [(True, True, 0.0), (False, False, 0.0), (True, False, 1.0), (False, True, 0.0)]
)
def test_a_second_force_of_a_port_is_there_where_the_error_of_the_first_goes_with_it(
    alone: bool, beside: bool, kept: float
) -> None:
    """Friction beside a softening spring was friction, 0.60, or something unknown: friction alone erred by 30 %, both by none."""
    forces = (DryFriction("joint2", 0.1), CUBIC)
    each = {
        name: replace(cast(OnlyEvidence, ranked(name, evidence, *effects).fit), errs=errs)
        for name, evidence, effects, errs in (
            ("friction", 100.0, forces[:1], alone),
            ("both", 200.0, forces, beside),
        )
    }
    every = [NONE, *(Ranked(name, cast(Fit, fit), True) for name, fit in each.items())]
    seen = held(none=TUNED, friction=Leaves(squares=0.08, log_density=-100.0), both=Leaves())
    found = judged_on_held_out(every, {"none": 0.0, "friction": 0.0, "both": 1.0}, seen, 1.0)
    assert found["both"] == pytest.approx(kept)
    assert found["friction"] == pytest.approx(1.0 - kept)


def test_a_second_cause_is_not_named_where_both_stand_only_by_an_error_of_the_model() -> None:
    strained = Ranked("both", cast(Fit, replace(cast(OnlyEvidence, BOTH.fit), beyond_belief=True)), True)
    seen = held(none=TUNED, main=Leaves(squares=0.01), both=Leaves(), beside=Leaves())
    found = judged_on_held_out([NONE, MAIN, OTHER, strained, BESIDE], ODDS, seen, 1.0)
    assert max(found, key=lambda name: found[name]) == "main"
    # The factor of a fit on the noise is such an error, too.
    widened = held(none=TUNED, main=Leaves(squares=0.01), both=Leaves(against_stated=2.5), beside=Leaves())
    found = judged_on_held_out(EVERY, ODDS, widened, 1.0)
    assert max(found, key=lambda name: found[name]) == "main"


@pytest.mark.parametrize(
    ("closed", "evidence", "kept"), [(0.9, 80.0, "both"), (0.3, 80.0, "unknown"), (0.9, 15.0, "unknown")]
)
def test_what_is_unknown_at_the_place_of_a_cause_that_closes_most_is_that_cause_in_another_form(
    closed: float, evidence: float, kept: str
) -> None:
    mass = AddedMass("joint1", 0.1)
    every = [
        NONE,
        ranked("mass", 10.0, mass),
        ranked("unknown", 90.0, UNKNOWN),
        ranked("both", evidence, mass, UNKNOWN),
        ranked("elsewhere", 80.0, MASS, UNKNOWN),
    ]
    odds = {"none": 0.0, "mass": 0.0, "unknown": 1.0, "both": 0.0, "elsewhere": 0.0}
    seen = held(none=TUNED, mass=Leaves(squares=1.0 - closed, log_density=-100.0), unknown=Leaves())
    assert judged_on_held_out(every, odds, seen, 1.0)[kept] == 1.0


@pytest.mark.parametrize(("chance", "kept"), [(1.0, 1.0), (0.2, 1.0), (0.01, 0.632), (1e-4, 0.558), (0.0, 0.556)])
def test_a_linear_answer_whose_drift_orders_with_the_level_gives_way(chance: float, kept: float) -> None:
    odds = {"none": 0.7, "main": 0.3, "other": 0.0}
    found = that_drift_by_chance([NONE, MAIN, OTHER], odds, lambda r: chance)
    assert found["none"] == pytest.approx(0.7 * kept, rel=0.01)
    assert found["main"] == pytest.approx(0.3 * kept, rel=0.01)
    # A restoring force says itself what the level does.
    assert that_drift_by_chance([NONE, OTHER], {"none": 0.0, "other": 1.0}, lambda r: 0.0)["other"] == 1.0


def test_the_best_known_cause_is_asked_for_what_its_tuning_hides_whatever_leads() -> None:
    """A tool contact beside a late channel was the contact beside something unknown, 1.00: the phase went into its calibration."""
    none, unknown = ranked("none", 0.0), ranked("unknown", 90.0, UNKNOWN)
    mass, spring = ranked("mass", 50.0, MASS), ranked("spring", 60.0, CUBIC)
    assert first_known([mass, unknown], none) is mass
    assert first_known([unknown], none) is none
    # What is simulated takes long: only where it is the answer, alone or in part.
    assert first_known([mass, spring, unknown], none) is unknown
    assert first_known([mass, spring], none) is spring
    both = ranked("spring + unknown", 95.0, CUBIC, UNKNOWN)
    assert first_known([mass, spring, unknown, both], none) is spring


def test_a_pair_is_one_hypothesis_whichever_cause_came_first() -> None:
    one, other = ranked("mass + cubic", 5.0, MASS, CUBIC), ranked("cubic + mass", 6.0, CUBIC, MASS)
    bound = replace(ranked("mass", 9.0, MASS), refined=False)
    fitted = ranked("mass", 1.0, MASS)
    assert once([one, bound, other, fitted]) == (other, fitted)


def test_a_cause_that_may_as_well_be_nothing_is_none() -> None:
    vague = Ranked("main", cast(Fit, OnlyEvidence(Hypothesis((MASS,)), 100.0, (MASS,))), True)
    beside = Ranked("both", cast(Fit, OnlyEvidence(Hypothesis((CUBIC, MASS)), 200.0, (MASS,))), True)
    seen = held(none=TUNED, main=Leaves(), other=Leaves(squares=0.01), both=Leaves())
    assert judged_on_held_out([NONE, vague, OTHER], {"none": 0.0, "main": 1.0, "other": 0.0}, seen, 1.0)["none"] == 1.0
    odds = {"none": 0.0, "main": 0.0, "other": 0.0, "both": 1.0}
    assert judged_on_held_out([NONE, vague, OTHER, beside], odds, seen, 1.0)["other"] == 1.0


def test_a_cause_that_is_nothing_without_its_discrepancy_is_not_named() -> None:
    """A gap-free plate: 222 nats for a contact of 18 N/m, known to 139 N/m, and its discrepancy."""
    fit = cast(Fit, replace(cast(OnlyEvidence, MAIN.fit), nothing_when_used=(MASS,)))
    got = judged_on_held_out(
        (NONE, replace(MAIN, fit=fit)),
        {"none": 0.0, "main": 1.0},
        held(none=Leaves(log_density=-5.0), main=Leaves()),
        1.0,
    )
    assert got["main"] == 0.0
    # The rest lies on something unknown.
    assert got["none"] == pytest.approx(0.5)


@pytest.mark.parametrize(("closed", "named"), [(0.99, "main"), (0.8, "beside")])
def test_the_second_of_two_causes_that_is_nothing_without_its_discrepancy_leaves_the_first(
    closed: float, named: str
) -> None:
    only_error = Ranked("both", cast(Fit, replace(cast(OnlyEvidence, BOTH.fit), nothing_when_used=(CUBIC,))), True)
    seen = held(none=TUNED, main=Leaves(squares=1.0 - closed), both=Leaves(), beside=Leaves())
    found = judged_on_held_out([NONE, MAIN, OTHER, only_error, BESIDE], ODDS, seen, 1.0)
    # Half of it goes to the first cause in any case; the shape that the residual has is not the second's.
    assert found["both"] == 0.0
    assert found[named] == pytest.approx({"main": 0.98, "beside": 0.495}[named])
    # The first cause is there either way: nothing of it is left to something unknown alone.
    assert sum(found.values()) == pytest.approx(1.0)


def test_a_second_cause_that_predicts_more_than_something_unknown_is_named_and_not_sure() -> None:
    seen = held(
        none=TUNED,
        main=Leaves(squares=0.2, log_density=-500.0),
        both=Leaves(reduced=1.3, log_density=-200.0),
        beside=Leaves(log_density=-300.0),
    )
    found = judged_on_held_out(EVERY, ODDS, seen, 1.0)
    assert found["both"] == pytest.approx(0.95 * SETTINGS.verdict_form)
    assert found["beside"] == pytest.approx(0.02 + 0.95 * (1 - SETTINGS.verdict_form))


def test_a_second_cause_that_leaves_noise_loses_once_what_its_form_is_doubted_for() -> None:
    """A twist of the rail beside a cross-axis sensitivity had 0.36, less than something unknown: doubted twice for one reason."""
    strained = Ranked("both", cast(Fit, replace(cast(OnlyEvidence, BOTH.fit), beyond_belief=True)), True)
    every, odds = [NONE, MAIN, OTHER, strained, BESIDE], {**ODDS, "main": 0.0, "both": 1.0, "beside": 0.0}
    seen = held(
        none=TUNED, main=Leaves(squares=0.2, log_density=-500.0), both=Leaves(), beside=Leaves(log_density=-300.0)
    )
    assert of_known_form(every, judged_on_held_out(every, odds, seen, 1.0), seen)["both"] == SETTINGS.verdict_form


def test_a_first_cause_that_closes_by_values_far_out_of_tolerance_is_not_enough() -> None:
    """A cubic joint beside supports that give: the joint alone closed all, with values eight tolerances off."""
    odds = {**ODDS, "main": 0.0, "both": 1.0, "beside": 0.0}
    seen = held(
        none=TUNED,
        main=Leaves(squares=0.01, log_density=-500.0),
        both=Leaves(reduced=1.3),
        beside=Leaves(log_density=-300.0),
    )
    for away, named in ((True, "both"), (False, "main")):
        main = Ranked("main", cast(Fit, replace(cast(OnlyEvidence, MAIN.fit), tuned_away=away)), True)
        found = judged_on_held_out([NONE, main, OTHER, BOTH, BESIDE], odds, seen, 1.0)
        assert max(found, key=lambda name: found[name]) == named


def test_what_is_improbable_is_not_judged_again() -> None:
    odds = {**ODDS, "both": 0.001, "main": 0.979}
    assert judged_on_held_out(EVERY, odds, held(none=TUNED, main=Leaves(), beside=Leaves()), 1.0) == odds


def test_a_model_alone_that_leaves_far_more_than_noise_gives_way_to_something_unknown() -> None:
    none, other = ranked("none", 50.0), ranked("unknown", 40.0, UNKNOWN)
    for left, best in ((1.2, "none"), (3.0, "unknown")):
        found = judged_on_held_out(
            [none, other], {"none": 0.7, "unknown": 0.3}, held(none=Leaves(against_stated=left), unknown=Leaves()), 1.0
        )
        assert max(found, key=lambda name: found[name]) == best
    # Without a fit of an unknown element, what it loses goes to no hypothesis: it is the probability of something unknown.
    alone = judged_on_held_out([none], {"none": 1.0}, held(none=Leaves(against_stated=3.0)), 1.0)
    assert alone == pytest.approx({"none": 1.0 - SETTINGS.verdict_form})


@pytest.mark.parametrize("cause", [MASS, UNKNOWN], ids=["known", "unknown"])
def test_a_cause_that_trails_on_held_out_records_is_not_sure(cause: Effect) -> None:
    # Evidence of 40 for the cause, at a temperature of 10: odds of e^4.
    main, odds = ranked("main", 40.0, cause), {"none": 1.0 / (1.0 + np.exp(4.0)), "main": 1.0 / (1.0 + np.exp(-4.0))}
    # Prediction speaks for it; against it, by less than evidence does; by more: the mean of the leads is -1.
    for density, probability in ((-990.0, odds["main"]), (-1020.0, 0.5), (-1060.0, 1.0 / (1.0 + np.exp(1.0)))):
        found = judged_on_held_out([NONE, main], odds, held(none=TUNED, main=Leaves(log_density=density)), 10.0)
        assert found["main"] == pytest.approx(probability)
        assert sum(found.values()) == pytest.approx(1.0)


def test_a_lead_beyond_what_a_probability_holds_is_held_against_prediction_as_well() -> None:
    """A cubic spring beside a delay led by 1074 nats and lost 323 in prediction: it passed all of its probability on."""
    main, odds = ranked("main", 1074.0, MASS), {"none": 0.0, "main": 1.0}
    found = judged_on_held_out([NONE, main], odds, held(none=TUNED, main=Leaves(log_density=-1323.0)), 1.0)
    assert found["main"] == pytest.approx(0.5)
    found = judged_on_held_out([NONE, main], odds, held(none=TUNED, main=Leaves(log_density=-2100.0)), 1.0)
    assert found["main"] == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("away", "still", "density", "kept"),
    [
        (False, False, -1001.0, 0.174),
        (True, False, -1001.0, 0.95),
        (True, False, -1004.0, 0.045),
        (True, True, -1001.0, 0.174),
    ],
)
def test_a_shift_that_predicts_what_a_value_out_of_tolerance_does_keeps_its_lead(away, still, density, kept) -> None:
    """But beside values that are as far out as before it has moved nothing into its place."""
    bare = Ranked("none", cast(Fit, OnlyEvidence(Hypothesis(), 0.0, tuned_away=away)), True)
    shift = Ranked(
        "main", cast(Fit, OnlyEvidence(Hypothesis((MASS,)), 8.0, stds={"0.mass": 0.1}, tuned_away=still)), True
    )
    seen = held(none=TUNED, main=Leaves(log_density=density))
    found = judged_on_held_out([bare, shift], {"none": 0.05, "main": 0.95}, seen, 1.0)
    assert found["main"] == pytest.approx(kept, abs=0.02)


@pytest.mark.parametrize(
    ("place", "density", "kept"), [("tool", -40.0, 0.5), ("tool", -20.0, 1.0), ("joint1", -40.0, 1.0)]
)
def test_an_unknown_element_shares_with_a_known_cause_of_its_place_that_predicts_more(
    place: str, density: float, kept: float
) -> None:
    here = ranked("unknown", 200.0, replace(UNKNOWN, place=place))
    odds = {"none": 0.0, "main": 0.0, "unknown": 1.0}
    seen = held(none=TUNED, main=Leaves(log_density=-30.0), unknown=Leaves(log_density=density))
    found = judged_on_held_out([NONE, MAIN, here], odds, seen, 1.0)
    assert found == pytest.approx({"none": 0.0, "main": 1.0 - kept, "unknown": kept})


def test_a_known_cause_beside_something_unknown_at_its_place_is_one_part_of_another_form() -> None:
    here = replace(UNKNOWN, place="tool", port="tool_x")
    named = {"none": (), "main": (MASS,), "unknown": (here,), "beside": (MASS, here)}
    every = [sized(name, 3e-5, 1e-3, *effects) for name, effects in named.items()]
    odds = {"none": 0.0, "main": 0.0, "unknown": 0.0, "beside": 1.0}
    for closed, left, kept, after in (
        (0.9, 3.0, 1.0, SETTINGS.verdict_form),
        (0.9, 1.2, SETTINGS.verdict_form, SETTINGS.verdict_form),
        (0.2, 3.0, 0.0, 1.0 - SETTINGS.verdict_form),
    ):
        main = Leaves(squares=1.0 - closed, against_stated=left)
        seen = held(none=TUNED, main=main, unknown=Leaves(), beside=Leaves())
        found = judged_on_held_out(every, odds, seen, 1.0)
        rest = "unknown" if closed < 0.5 else "beside"
        assert found == pytest.approx({"none": 0.0, "main": kept, "unknown": 0.0, "beside": 0.0} | {rest: 1.0 - kept})
        # It is not sure either way: of its own form it would need nothing beside it.
        assert of_known_form(every, found, seen)["main"] == pytest.approx(after)


@pytest.mark.parametrize("nowhere", ["main", "beside"])
def test_a_known_cause_of_no_size_is_no_part_of_what_is_unknown_beside_it(nowhere: str) -> None:
    """A gap-free chain of masses: a delay of (1.1 ± 1.3) µs beside an error of one channel was a delay, 1.00."""
    here = replace(UNKNOWN, place="tool", port="tool_x")
    named = {"none": (), "main": (MASS,), "unknown": (here,), "beside": (MASS, here)}
    every = [
        replace(r, fit=cast(Fit, replace(cast(OnlyEvidence, r.fit), of_no_size=(MASS,)))) if r.name == nowhere else r
        for r in (ranked(name, 10.0 * len(effects), *effects) for name, effects in named.items())
    ]
    odds = {"none": 0.0, "main": 0.0, "unknown": 0.0, "beside": 1.0}
    seen = held(none=TUNED, main=Leaves(squares=0.1), unknown=Leaves(), beside=Leaves())
    found = judged_on_held_out(every, odds, seen, 1.0)
    assert found["unknown"] == pytest.approx(1.0)
    # Nor is it a form of it: another cause is.
    other = ranked("other", 5.0, CUBIC)
    kept = of_known_form(
        [*every, other],
        {**found, "other": 0.0},
        held(none=TUNED, main=Leaves(squares=0.1), unknown=Leaves(), beside=Leaves(), other=Leaves(squares=0.5)),
    )
    assert kept["unknown"] == pytest.approx(SETTINGS.verdict_form)
    assert kept["other" if nowhere == "main" else "main"] == pytest.approx(1.0 - SETTINGS.verdict_form)


def test_a_known_cause_of_no_size_beside_something_unknown_elsewhere_is_none() -> None:
    unknown = ranked("unknown", 90.0, UNKNOWN)
    no_size = Ranked("beside", cast(Fit, replace(cast(OnlyEvidence, BESIDE.fit), of_no_size=(MASS,))), True)
    seen = held(none=TUNED, main=Leaves(squares=0.3), unknown=Leaves(), beside=Leaves(log_density=5.0))
    odds = {"none": 0.0, "main": 0.0, "unknown": 0.0, "beside": 1.0}
    assert judged_on_held_out([NONE, MAIN, unknown, no_size], odds, seen, 1.0)["unknown"] == pytest.approx(1.0)


@pytest.mark.parametrize(("channel", "kept"), [("tool_x", 1.0 - SETTINGS.verdict_form), ("tool_z", 1.0)])
def test_of_the_measurement_one_channel_is_one_part(channel: str, kept: float) -> None:
    gain = CalibrationError("measurement", "tool_x", 1.2)
    error = UnknownChannelError("measurement", channel, 0.3, 10.0, 400.0)
    every = [NONE, ranked("main", 100.0, gain), ranked("unknown", 20.0, error), ranked("beside", 200.0, gain, error)]
    odds = {"none": 0.0, "main": 0.0, "unknown": 0.0, "beside": 1.0}
    seen = held(
        none=TUNED, main=Leaves(squares=0.1, log_density=-9.0), unknown=Leaves(), beside=Leaves(log_density=1.0)
    )
    assert judged_on_held_out(every, odds, seen, 1.0)["beside"] == pytest.approx(kept)


@pytest.mark.parametrize(("closed", "kept"), [(0.99, 0.0), (0.8, SETTINGS.verdict_form)])
@pytest.mark.parametrize("second", ["both", "beside"])
def test_of_a_single_record_no_second_part_is_sure(second: str, closed: float, kept: float) -> None:
    """A resistor three times as large was a shift of the damping together with friction, 0.53: the shift closes all but 0.1 %."""
    odds = {"none": 0.0, "main": 0.0, "other": 0.0, "both": 0.0, "beside": 0.0, second: 1.0}
    both = Leaves(log_density=500.0, unseen=False)
    seen = held(none=TUNED, main=Leaves(squares=1.0 - closed, unseen=False), **{second: both})
    found = judged_on_held_out(EVERY, odds, seen, 1.0)
    assert found[second] == pytest.approx(kept)
    assert found["main"] == pytest.approx(1.0 - kept)


def test_what_was_fitted_to_a_record_predicts_nothing_of_it() -> None:
    main, odds = ranked("main", 40.0, MASS), {"none": 0.0, "main": 1.0}
    for unseen, kept in ((True, 0.5), (False, 1.0)):
        seen = held(none=TUNED, main=Leaves(log_density=-1020.0, unseen=unseen))
        assert judged_on_held_out([NONE, main], odds, seen, 10.0)["main"] == pytest.approx(kept)


@pytest.mark.parametrize("second", ["both", "beside"])
def test_a_second_part_that_predicts_less_than_the_first_alone_is_not_there(second: str) -> None:
    odds = {"none": 0.0, "main": 0.4, "other": 0.0, "both": 0.0, "beside": 0.0, second: 0.6}
    for density, best in ((-400.0, "main"), (-200.0, second)):
        seen = held(none=TUNED, main=Leaves(log_density=-300.0), **{second: Leaves(log_density=density)})
        found = judged_on_held_out(EVERY, odds, seen, 1.0)
        assert max(found, key=lambda name: found[name]) == best
        assert sum(found.values()) == pytest.approx(1.0)


def test_something_unknown_that_runs_away_is_not_shown() -> None:
    none, other = ranked("none", 0.0), ranked("unknown", 40.0, UNKNOWN)
    found = judged_on_held_out(
        [none, other], {"none": 0.3, "unknown": 0.7}, held(none=TUNED, unknown=Leaves(reduced=1e30)), 1.0
    )
    assert found == {"none": 0.3, "unknown": 0.0}


def test_two_channels_of_a_delay_are_one_cause() -> None:
    one, two = ChannelDelay("measurement", "tool_x", 1e-4), ChannelDelay("measurement", "tool_z", 2e-4)
    both = Hypothesis((one, two))
    assert (both.effect, both.place, kind_of(both)) == ("channel_delay", "measurement", "known")
    elsewhere = Hypothesis((MASS, replace(MASS, place="head")))
    assert (elsewhere.effect, kind_of(elsewhere)) == ("added_mass+added_mass", "sums")


@dataclass(frozen=True)
class WithSizes:
    hypothesis: Hypothesis
    log_evidence: float
    spread: Spread
    at_end: tuple[str, ...] = ()
    reduced: float = 1.0
    x: FloatArray = field(default_factory=lambda: np.zeros(20))
    n_tuning: int = 20
    of_no_size: tuple[Effect, ...] = ()
    tolerated: tuple[Effect, ...] = ()
    tuned_out = Fit.tuned_out
    tuned_as_a_whole = Fit.tuned_as_a_whole
    beyond_belief = Fit.beyond_belief
    stds: Mapping[str, float] = field(default_factory=dict)
    stds_of_effects = Fit.stds_of_effects


def sized(
    name: str,
    nominal: float,
    cause: float,
    *effects: Effect,
    at_end: tuple[str, ...] = (),
    tuned: float = 0.0,
    rest: float = 0.0,
) -> Ranked:
    """A fit of given discrepancies, of whose 20 tuned values one is `tuned` standard deviations out, and the others `rest`."""
    layout = Layout(1, (), (), (), (0,), ((0.0, 0.0),), 1)
    spread = Spread(layout, Sizes(nominal=nominal, cause=cause), np.zeros(0), np.eye(1))
    found = WithSizes(Hypothesis(effects), float(len(effects)), spread, at_end, x=np.array([tuned, *[rest] * 19]))
    return Ranked(name, cast(Fit, found), True)


def test_an_answer_that_needs_all_the_error_that_is_believed_is_not_sure() -> None:
    odds = {"none": 0.01, "mass": 0.99}
    none, fits, fails = sized("none", 0.03, 0.3), held(mass=Leaves()), held(mass=Leaves(against_stated=3.0))
    for mass, seen in (
        (sized("mass", 0.03, 0.3, MASS), fits),
        (sized("mass", 3e-5, 1e-3, MASS), fails),
        (sized("mass", 3e-5, 1e-3, CUBIC, at_end=("0.stiffness3",)), fits),
        (sized("mass", 3e-5, 1e-3, MASS, at_end=("0.mass",)), fits),
        (sized("mass", 3e-5, 1e-3, MASS, UNKNOWN, at_end=("0.mass",)), fits),
        (sized("mass", 3e-5, 1e-3, CUBIC, tuned=5.5), fits),
        (sized("mass", 3e-5, 1e-3, MASS, tuned=8.0, rest=2.7), fits),
    ):
        strained = of_known_form([none, mass], odds, seen)
        assert strained["mass"] == pytest.approx(0.99 * SETTINGS.verdict_form)
        assert sum(strained.values()) < 0.9
    # One of the two alone is what the discrepancy is for.
    for nominal, cause in ((0.03, 0.1), (0.01, 0.3), (3e-5, 1e-3)):
        assert of_known_form([none, sized("mass", nominal, cause, MASS)], odds, fits) == odds
    # So are values that tolerances, roughly stated, may hold.
    assert of_known_form([none, sized("mass", 3e-5, 1e-3, CUBIC, tuned=4.5)], odds, fits) == odds
    # What was not computed is not ruled out, where there is more than noise.
    for reduced, untried, kept in ((1.3, True, SETTINGS.verdict_form), (1.3, False, 1.0), (1.0, True, 1.0)):
        seen = held(mass=Leaves(reduced=reduced))
        found = of_known_form([none, sized("mass", 3e-5, 1e-3, CUBIC)], odds, seen, untried)
        assert found["mass"] == pytest.approx(0.99 * kept)
    # One level does not show the form of a restoring force that errs as far as is believed; of what is linear levels show nothing.
    for levels, cause, effect, kept in (
        ((3, 3, 3), 0.3, CUBIC, SETTINGS.verdict_form),
        ((3, 5, 3), 0.3, CUBIC, 1.0),
        ((3, 3, 3), 0.1, CUBIC, 1.0),
        ((3, 3, 3), 0.3, MASS, 1.0),
    ):
        records = tuple(SimpleNamespace(entry=SimpleNamespace(level_step=k), squares=0.0) for k in levels)
        both = Leaves(records=records)
        found = of_known_form([none, sized("mass", 3e-5, cause, effect)], odds, held(mass=both, none=both))
        assert found["mass"] == pytest.approx(0.99 * kept)
    # Something unknown has no form that could err.
    gap = held(none=Leaves(against_stated=5.0), mass=Leaves(against_stated=3.0))
    assert of_known_form([none, sized("mass", 0.03, 0.3, UNKNOWN)], odds, gap) == odds


@pytest.mark.parametrize(("error", "left", "told"), [(0.3, 0.02, False), (0.3, 0.2, True), (0.1, 0.02, True)])
def test_a_cause_that_errs_by_as_much_as_is_believed_may_sit_elsewhere(error: float, left: float, told: bool) -> None:
    """A resonator on the head was one on the tool (1.00), with an error of its own of 30 %, and on the head as good."""
    here, there = (sized(place, 3e-5, error, AddedMass(place, 0.1)) for place in ("tool", "head"))
    seen = held(none=Leaves(squares=1.0), tool=Leaves(squares=0.01), head=Leaves(squares=0.01 + left))
    found = of_known_form([sized("none", 0.03, 0.01), here, there], {"none": 0.0, "tool": 0.99, "head": 0.01}, seen)
    assert (found["tool"], found["head"]) == pytest.approx((0.99, 0.01) if told else (0.5, 0.5))


def test_no_cause_that_needs_values_out_of_any_tolerance_is_not_sure() -> None:
    """Slip in a frame was no gap, 0.84, with a mode's damping eight tolerances off."""
    for tuned, kept in ((4.5, 0.84), (5.5, 0.84 * SETTINGS.verdict_form)):
        none, mass = sized("none", 3e-5, 1e-3, tuned=tuned), sized("mass", 3e-5, 1e-3, MASS)
        found = of_known_form([none, mass], {"none": 0.84, "mass": 0.16}, held(mass=Leaves()))
        assert found["none"] == pytest.approx(kept)
        assert found["mass"] == 0.16


def test_something_unknown_may_be_a_known_cause_in_another_form() -> None:
    none, near, far = sized("none", 3e-5, 1e-3), sized("near", 3e-5, 1e-3, MASS), sized("far", 3e-5, 1e-3, MASS)
    far = replace(far, fit=replace(cast(WithSizes, far.fit), log_evidence=-100.0))
    unknown = sized("unknown", 3e-5, 1e-3, UNKNOWN)
    kept = SETTINGS.verdict_form
    found = of_known_form([none, near, far, unknown], {"none": 0.0, "near": 0.0, "far": 0.0, "unknown": 1.0}, held())
    assert found == pytest.approx({"none": 0.0, "near": 1.0 - kept, "far": 0.0, "unknown": kept})
    # A cause of its place that leaves no more than the largest error of a cause, 0.3 squared, is the answer in another form.
    here = replace(
        near, fit=replace(cast(WithSizes, near.fit), hypothesis=Hypothesis((replace(MASS, place="joint1"),)))
    )
    odds = {"none": 0.0, "near": 0.0, "unknown": 1.0}
    for left, part in ((0.08, kept), (0.1, 1.0 - kept), (0.0, kept)):
        seen = held(none=TUNED, near=Leaves(squares=left), unknown=Leaves())
        assert of_known_form([none, here, unknown], odds, seen)["near"] == pytest.approx(part)
    # What it has already counts to that.
    odds = {"none": 0.0, "near": 0.5, "unknown": 0.5}
    seen = held(none=TUNED, near=Leaves(), unknown=Leaves())
    assert of_known_form([none, here, unknown], odds, seen)["near"] == pytest.approx(kept)
    odds = {"none": 0.0, "near": 0.7, "unknown": 0.3}
    assert of_known_form([none, here, unknown], odds, seen)["near"] == pytest.approx(0.7)
    odds = {"none": 0.0, "near": 0.0, "unknown": 1.0}
    # What leaves as much as no cause is none, whatever the element leaves.
    seen = held(none=TUNED, near=Leaves(squares=1.0), unknown=Leaves(squares=2.0))
    assert of_known_form([none, here, unknown], odds, seen)["near"] == pytest.approx(1.0 - kept)
    # Without a known cause to compare with it may be nothing, or stands alone where far more than noise is left without it.
    odds = {"none": 0.0, "unknown": 1.0}
    assert of_known_form([none, unknown], odds, held()) == pytest.approx({"none": 1.0 - kept, "unknown": kept})
    assert of_known_form([none, unknown], odds, held(none=Leaves(against_stated=5.0))) == odds


@pytest.mark.parametrize(("left", "kept"), [(1.05, SETTINGS.verdict_form), (1.3, 1.0)])
def test_something_unknown_beside_a_cause_may_be_a_second_known_one_that_leaves_noise(left: float, kept: float) -> None:
    pair, other = sized("pair", 3e-5, 1e-3, MASS, CUBIC), sized("other", 3e-5, 1e-3, CUBIC, replace(MASS, place="head"))
    beside, main = sized("beside", 3e-5, 1e-3, MASS, UNKNOWN), sized("main", 3e-5, 1e-3, MASS)
    odds = {"beside": 1.0, "pair": 0.0, "other": 0.0, "main": 0.0}
    found = of_known_form([main, pair, other, beside], odds, held(pair=Leaves(reduced=left), beside=Leaves()))
    assert found == pytest.approx({"beside": kept, "pair": 1.0 - kept, "other": 0.0, "main": 0.0})


@pytest.mark.parametrize(
    ("alone", "beside", "other", "kept"),
    [
        (0.3, 0.3, 0.0, 0.6),
        (0.25, 0.35, 0.0, 0.0),  # The likelier has both
        (0.45, 0.15, 0.0, 0.45),  # It comes first as it is
        (0.3, 0.05, 0.2, 0.3),  # Something unknown is likelier
        (0.3, 0.3, 0.4, 0.6),  # Another cause would come first
        (0.2, 0.1, 0.5, 0.2),
    ],
)
def test_something_unknown_is_no_likelier_than_a_cause_that_stands_alone_and_beside_it(
    alone: float, beside: float, other: float, kept: float
) -> None:
    main, both = sized("main", 3e-5, 1e-3, MASS), sized("both", 3e-5, 1e-3, MASS, UNKNOWN)
    spring = sized("spring", 3e-5, 1e-3, CUBIC)
    # What is missing to one lies on something unknown.
    odds = {"main": alone, "both": beside, "spring": other}
    found = _by_one_name_of([main, both, spring], odds)
    assert found["main"] == pytest.approx(kept)
    assert found["main"] + found["both"] == pytest.approx(alone + beside)
    assert found["spring"] == other


def _by_one_name_of(every: Sequence[Ranked], odds: Mapping[str, float]) -> dict[str, float]:
    out = dict(odds)
    _by_one_name(every, out)
    return out


def test_a_cause_that_stands_in_for_others_is_not_enough() -> None:
    none = sized("none", 3e-5, 1e-3)
    for found, enough in (
        (sized("mass", 3e-5, 1e-3, MASS), True),
        (sized("mass", 0.03, 0.3, MASS), False),
        (sized("mass", 3e-5, 1e-3, MASS, tuned=5.5), True),
        (sized("mass", 3e-5, 1e-3, CUBIC, tuned=5.5), False),
    ):
        assert is_enough([found], none, lambda r: 1.0) is enough


def test_a_cause_within_the_tolerance_of_its_part_leaves_most_to_the_model_without_it() -> None:
    none, mass = ranked("none", 0.0), ranked("mass", 40.0, MASS)
    within = replace(mass, fit=replace(cast(OnlyEvidence, mass.fit), tolerated=(MASS,)))
    odds, seen = {"none": 0.0, "mass": 1.0}, held(none=TUNED, mass=Leaves(log_density=40.0))
    assert judged_on_held_out([none, mass], odds, seen, 1.0)["mass"] == pytest.approx(1.0)
    found = judged_on_held_out([none, within], odds, seen, 1.0)
    assert found == pytest.approx({"none": SETTINGS.verdict_form, "mass": 1.0 - SETTINGS.verdict_form})


def test_a_model_that_leaves_far_more_than_noise_is_no_answer_even_without_another() -> None:
    none = ranked("none", 0.0)
    found = judged_on_held_out([none], {"none": 1.0}, held(none=Leaves(against_stated=50.0)), 1.0)
    assert found == pytest.approx({"none": 1.0 - SETTINGS.verdict_form})


def test_a_white_residual_is_noise_larger_than_stated() -> None:
    """A plate under random force was something unknown, 1.00, which left as much as the model without it."""
    white = replace(NONE, fit=replace(cast(OnlyEvidence, NONE.fit), correlation=1.0))
    unknown = ranked("unknown", 10.0, UNKNOWN)
    odds, seen = {"none": 0.5, "unknown": 0.5}, held(none=Leaves(against_stated=4.0), unknown=Leaves(log_density=1.0))
    assert judged_on_held_out([white, unknown], odds, seen, 1.0) == pytest.approx(odds)
    assert judged_on_held_out([NONE, unknown], odds, seen, 1.0)["none"] == 0.0


def test_a_cause_that_leaves_a_larger_error_than_none_is_not_sure() -> None:
    none, mass = sized("none", 3e-5, 1e-3), sized("mass", 3e-5, 1e-3, MASS)
    bare = Leaves(records=tuple(SimpleNamespace(squares=s) for s in (1.0, 1.2, 0.9, 1.1)))
    for sizes, kept in (((1.1, 1.1, 0.9, 1.1), 1.0), ((0.2,) * 4, 1.0), ((1.5, 1.6, 1.4, 1.5), SETTINGS.verdict_form)):
        left = Leaves(records=tuple(SimpleNamespace(squares=s) for s in sizes))
        odds = of_known_form([none, mass], {"none": 0.0, "mass": 1.0}, held(none=bare, mass=left))
        assert odds["mass"] == pytest.approx(kept)
    # Of a single record, which it was fitted to, a cause leaves less.
    one = tuple(SimpleNamespace(squares=s) for s in (1.0, 1.1))
    seen = held(none=Leaves(records=one[:1], unseen=False), mass=Leaves(records=one[1:], unseen=False))
    assert of_known_form([none, mass], {"none": 0.0, "mass": 1.0}, seen)["mass"] == SETTINGS.verdict_form
    # A model that leaves far more than noise is no better for a smaller error.
    worse = held(none=replace(bare, reduced=9.0), mass=Leaves(records=left.records))
    assert of_known_form([none, mass], {"none": 0.0, "mass": 1.0}, worse)["mass"] == 1.0


@pytest.mark.parametrize(("predicted", "kept"), [(72.0, 0.6), (1.0, 0.93)])
def test_a_cause_is_not_sure_where_another_leads_in_prediction_by_more_than_it_lags(
    predicted: float, kept: float
) -> None:
    near = ranked("near", 98.0, UNKNOWN)
    seen = held(none=TUNED, near=Leaves(log_density=predicted))
    found = judged_on_held_out([NONE, MAIN, near], {"none": 0.0, "main": 0.93, "near": 0.07}, seen, 1.0)
    assert found["main"] == pytest.approx(kept)
    assert sum(found.values()) == pytest.approx(1.0)


def test_what_lags_far_in_evidence_does_not_unsettle_a_cause_by_its_prediction() -> None:
    far = ranked("far", 20.0, UNKNOWN)
    seen = held(none=TUNED, far=Leaves(log_density=50.0))
    found = judged_on_held_out([NONE, MAIN, far], {"none": 0.0, "main": 0.98, "far": 0.02}, seen, 1.0)
    assert found["main"] == pytest.approx(0.98)


@pytest.mark.parametrize(("evidence", "lacks"), [(106.0, True), (104.0, False), (90.0, False)])
def test_a_form_is_missing_where_something_unknown_leads_all_known_causes(evidence: float, lacks: bool) -> None:
    assert lacks_a_form([MAIN, OTHER, ranked("unknown", evidence, UNKNOWN)]) == lacks
    # What was not fitted on all lines leads nothing.
    assert not lacks_a_form([MAIN, replace(ranked("unknown", evidence, UNKNOWN), refined=False)])


@pytest.mark.parametrize(("evidence", "close"), [(-90.0, True), (-110.0, False)])
def test_no_unknown_force_is_fitted_where_linear_causes_lead_all_known_ones_by_far(
    evidence: float, close: bool
) -> None:
    force = ranked("force", evidence, CUBIC)
    assert forces_come_close([NONE, MAIN, force]) == close
    # What was fitted on few lines alone has a bound of its evidence.
    assert forces_come_close([NONE, MAIN, replace(force, refined=False)]) == close
    assert forces_come_close([NONE, MAIN])


def test_what_has_passed_all_of_its_probability_on_has_none_to_share() -> None:
    nothing = Ranked("nothing", cast(Fit, replace(cast(OnlyEvidence, MAIN.fit), of_no_size=(MASS,))), True)
    near = ranked("near", 98.0, UNKNOWN)
    seen = held(none=TUNED, near=Leaves(log_density=50.0))
    found = judged_on_held_out([NONE, nothing, near], {"none": 0.0, "nothing": 0.9, "near": 0.1}, seen, 1.0)
    assert found["nothing"] == 0.0
    assert sum(found.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("fitted", "held_out", "effects", "one"),
    [
        (1.0, 1.0, (UNKNOWN,), True),
        (1.0, 1.0, (AddedMass("joint1", 0.1), UNKNOWN), True),
        (1.0, 1.0, (MASS, UNKNOWN), False),
        (1.0, 1.0, (MASS,), False),
        (1.2, 1.0, (UNKNOWN,), False),
        (1.0, 1.2, (UNKNOWN,), False),
    ],
)
def test_one_faulty_place_explains_all_where_something_unknown_there_leaves_noise(
    fitted: float, held_out: float, effects: tuple[Effect, ...], one: bool
) -> None:
    fit = replace(cast(OnlyEvidence, ranked("found", 90.0, *effects).fit), reduced=fitted)
    found = Ranked("found", cast(Fit, fit), True)
    assert of_one_place([MAIN, found], lambda r: held_out) is one
    assert not of_one_place([MAIN, replace(found, refined=False)], lambda r: held_out)
    # Beside tuning or gains far out of their tolerance the fault is not there alone.
    for strained in (replace(fit, tuned_away=True), replace(fit, calibrated_away=frozenset({"tool_x"}))):
        assert not of_one_place([MAIN, Ranked("found", cast(Fit, strained), True)], lambda r: held_out)


def test_of_two_fits_of_a_cause_the_better_one_stays() -> None:
    rough, worse, best = replace(MAIN, refined=False), ranked("main", 90.0, MASS), ranked("main", 110.0, MASS)
    assert _better([rough, OTHER], [worse]) == [worse, OTHER]
    assert _better([MAIN, OTHER], [worse]) == [MAIN, OTHER]
    assert _better([MAIN, OTHER], [best]) == [best, OTHER]
    assert _better([OTHER], [best]) == [OTHER, best]


def test_what_leads_a_cause_beside_another_starts_it_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A resonator caught at 18 Hz and 0.8 kg was found at 101 Hz beside something unknown, and nothing came of it."""
    asked: list[tuple[str, str]] = []

    def by_themselves(
        nominal: object, records: object, sums: Sequence[Ranked], found: Sequence[Ranked], worth: Callable[..., bool]
    ) -> list[Ranked]:
        assert [r.name for r in found] == ["main", "other"]
        worthy = [e for r in sums for e in r.fit.hypothesis.effects if worth(r, e)]
        asked.extend((sums[0].name, e.effect) for e in worthy)
        return [ranked("main 0", 150.0, e) for e in worthy]

    monkeypatch.setattr("cutvib_ss.diagnosis.search.by_themselves", by_themselves)
    nothing: Any = None
    shift = ranked("other", 10.0, CalibrationError("measurement", "tool_x", 1.1))
    # It goes by the name of its own fit.
    assert [r.name for r in _without_the_other(nothing, nothing, [BESIDE], [MAIN, shift])] == ["main"]
    assert asked == [("beside", "added_mass")]
    # Not where its own fit is as good, where nothing was found, or beside a restoring force, each try of which is a simulation.
    close = replace(MAIN, fit=ranked("main", 149.0, MASS).fit)
    assert not _without_the_other(nothing, nothing, [BESIDE], [close, shift])
    assert not _without_the_other(nothing, nothing, [], [MAIN, shift])
    assert not _without_the_other(nothing, nothing, [BOTH], [MAIN, shift])


def test_where_nothing_is_believed_the_nearest_known_cause_may_be_it_in_another_form() -> None:
    none, near = sized("none", 3e-5, 1e-3), sized("near", 3e-5, 1e-3, MASS)
    far = replace(
        sized("far", 3e-5, 1e-3, CUBIC), fit=replace(near.fit, hypothesis=Hypothesis((CUBIC,)), log_evidence=-9.0)
    )
    kept = SETTINGS.verdict_form
    found = of_known_form([none, near, far], {"none": 0.0, "near": 0.0, "far": 0.0}, held())
    assert found == pytest.approx({"none": 0.0, "near": 1.0 - kept, "far": 0.0})
    # What an answer of its own has lost is shared already.
    odds = {"none": 0.0, "near": 0.5, "far": 0.0}
    assert of_known_form([none, near, far], odds, held()) == odds
