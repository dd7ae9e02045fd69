"""Causes that differ in their form alone: when records tell them apart, and what they share when none does."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cutvib_ss.diagnosis import ranking
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.known_form import _among_kindred
from cutvib_ss.diagnosis.ranking import Ranked, in_kindred_form
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.joint_slip import JointSlip

FRICTION = DryFriction("joint2", 2.0, 1e4, 0.2)
SLIP = JointSlip("joint2", 1e4, 2.0, 0.5)
MASS = AddedMass("tool", 0.1)
NEAR, FAR = 3e-4, 4e-3  # Motions of 1.5 and of 20 times that at which they slide


@dataclass(frozen=True)
class Fitted:
    """What a fit is asked for here."""

    hypothesis: Hypothesis
    log_evidence: float
    error: float
    stds_of_effects: tuple[dict[str, float], ...]
    x: np.ndarray = field(default_factory=lambda: np.arange(4.0))
    first_effect: int = 3

    @property
    def spread(self) -> SimpleNamespace:
        return SimpleNamespace(sizes=SimpleNamespace(cause=self.error))


def fitted(
    name: str,
    evidence: float,
    *effects: Effect,
    error: float = 0.1,
    motion: float = NEAR,
    stds: dict[str, float] | None = None,
    place: str = "joint2",
) -> Ranked:
    each = tuple(stds or {} for _ in effects)
    made = Fitted(Hypothesis(effects, {place: motion}), evidence, error, each)
    return Ranked(name, cast(Fit, made), True)


# --- effects ----------------------------------------------------------------------------------------------------------


def test_friction_over_a_knee_and_slip_are_each_other_s() -> None:
    slip, friction = FRICTION.kindred({}), SLIP.kindred({})
    assert slip == JointSlip("joint2", 1e4, 2.0, 0.5)
    assert friction == FRICTION
    assert slip.kindred({}) == FRICTION
    # As stiff while they stick, sliding at as much in all, and over as far.
    own, other = (e.restoring_force()(**e._parameters()).sliders() for e in (FRICTION, SLIP))
    assert own.sum(axis=0) == pytest.approx(other.sum(axis=0))
    spread = [float(np.std(s[:, 1] / s[:, 0])) for s in (own, other)]
    assert spread[0] == pytest.approx(spread[1], rel=0.25)


@pytest.mark.parametrize(
    ("effect", "stds"),
    [
        (DryFriction("joint2", 2.0), {}),
        (DryFriction("joint2", 2.0, 1e4), {}),
        (replace(FRICTION, sticking_stiffness=math.inf), {}),
        (FRICTION, {"knee": 0.4}),
        (SLIP, {"spread": 0.6}),
        (CubicStiffness("joint2", 1e9), {}),
        (MASS, {}),
    ],
)
def test_what_yields_at_once_goes_by_one_name(effect: Effect, stds: dict[str, float]) -> None:
    assert effect.kindred(stds) is None


def test_the_farther_it_slides_the_less_it_is_slip_within_a_joint() -> None:
    assert FRICTION.odds_to_kindred(NEAR) == pytest.approx(1.5)
    assert SLIP.odds_to_kindred(FAR) == pytest.approx(1 / 20)


# --- probabilities ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("motion", "errors", "kept"),
    [(NEAR, (0.1, 0.1), 0.4), (FAR, (0.1, 0.1), 1 / 21), (NEAR, (0.01, 0.03), 1.0), (NEAR, (0.3, 0.1), 0.4)],
)
def test_the_nearer_of_two_wrong_forms_is_not_the_cause(
    motion: float, errors: tuple[float, float], kept: float
) -> None:
    """Friction of Bouc and Wen beside a mass was slip with 1.00: its loop is nearer to that of contacts evenly spread."""
    slip = fitted("slip", 70.0, MASS, SLIP, error=errors[0], motion=motion)
    friction = fitted("friction", 0.0, MASS, FRICTION, error=errors[1], motion=motion)
    odds = {"slip": 0.9, "friction": 0.0, "other": 0.1}
    _among_kindred([slip, friction], [slip, friction], odds)
    assert odds["slip"] == pytest.approx(0.9 * kept)
    assert odds["friction"] == pytest.approx(0.9 * (1.0 - kept))
    assert odds["other"] == 0.1


def test_a_cause_without_a_kindred_fit_keeps_what_it_has() -> None:
    slip, at_another = fitted("slip", 0.0, SLIP), fitted("friction", 0.0, replace(FRICTION, place="joint1"))
    odds = {"slip": 1.0, "friction": 0.0}
    _among_kindred([slip], [slip, at_another], odds)
    assert odds == {"slip": 1.0, "friction": 0.0}


# --- search -----------------------------------------------------------------------------------------------------------


def test_the_best_is_fitted_in_its_other_form_from_where_it_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def refit(
        nominal: object, records: object, hypothesis: Hypothesis, x: np.ndarray, steps: int, near: object
    ) -> object:
        asked.append((hypothesis.effects, x.tolist(), near))
        return near

    monkeypatch.setattr(ranking, "refit", refit)
    best = fitted("added_mass tool + joint_slip joint2", 0.0, MASS, SLIP)
    [again] = in_kindred_form(cast(Model, None), cast(Records, None), best)
    assert again.name == "added_mass tool + dry_friction joint2"
    assert asked == [((MASS, FRICTION), [0.0, 1.0, 2.0], best.fit)]
    for other in (fitted("added_mass tool", 0.0, MASS), fitted("none", 0.0), replace(best, refined=False)):
        assert in_kindred_form(cast(Model, None), cast(Records, None), other) == []


def test_what_leads_in_its_other_form_is_fitted_in_the_first_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A lap joint of twelve sliders was friction: slip stood 31 nats below what a start beside friction leads to."""
    reached = iter([20.0, 50.0, 50.0])
    asked = []

    def refit(nominal: object, records: object, hypothesis: Hypothesis, x: np.ndarray, steps: int, near: Fit) -> object:
        asked.append(hypothesis.effect)
        return replace(near, hypothesis=hypothesis, log_evidence=next(reached), x=x)

    monkeypatch.setattr(ranking, "refit", refit)
    best = fitted("joint_slip joint2", 0.0, SLIP)
    found = in_kindred_form(cast(Model, None), cast(Records, None), best)
    # The last leads no more.
    assert asked == ["dry_friction", "joint_slip", "dry_friction"]
    assert [r.name for r in found] == ["dry_friction joint2", "joint_slip joint2", "dry_friction joint2"]
