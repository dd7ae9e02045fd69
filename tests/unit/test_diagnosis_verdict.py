"""Probabilities, ambiguity sets and verdicts; folds of leaving out; bands and levels."""

import dataclasses
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cutvib_ss.diagnosis import cross_validation, where
from cutvib_ss.diagnosis.compared_responses import _alike
from cutvib_ss.diagnosis.held_out import HeldOut, share
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.records import Group, merged
from cutvib_ss.diagnosis.result import Cause
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.verdict import ambiguity_set, verdict
from tests.unit.record_example import entry_of

FREQ = np.arange(10.0, 200.0, 0.5)


def entry(record, position=0.5, level=50.0, scale=1.0, check=False, seed=None):
    rng = np.random.default_rng(record if seed is None else seed)
    noise = (rng.standard_normal((2, FREQ.size)) + 1j * rng.standard_normal((2, FREQ.size))) / np.sqrt(2)
    data = scale * np.ones((2, FREQ.size)) + 0.1 * noise
    return entry_of(
        record, position, level, data, np.full((2, FREQ.size), 0.01), FREQ, ("tool_x", "base_x"),
        ("acceleration",) * 2, check=check,
    )  # fmt: skip


def as_shown(data):
    """A prediction of which nothing is uncertain."""
    return cross_validation.Shown(data, np.zeros(data.shape), None)


def test_levels_are_drawn_apart_where_the_cause_depends_on_them() -> None:
    """The mean of a quiet and a loud record is the response of no level, so a nonlinear law cannot be compared with it."""
    quiet, loud = (
        SimpleNamespace(position=0.5, input="force", level=level, record=k) for k, level in enumerate((15.0, 150.0))
    )
    assert _alike(quiet, False) == _alike(loud, False)
    assert _alike(quiet, True) != _alike(loud, True)
    unstated = [SimpleNamespace(position=0.5, input="force", level=float("nan"), record=k) for k in range(2)]
    assert _alike(unstated[0], True) != _alike(unstated[1], True)


def _held(squares: float, floor: float, reduced: float = 1.5) -> HeldOut:
    return cast(HeldOut, SimpleNamespace(squares=squares, floor=floor, reduced=reduced))


def test_the_share_of_a_poor_cause_is_not_flattered_by_its_own_noise() -> None:
    tuned, accepted, poor = _held(100.0, 40.0), _held(1.0, 1.0), _held(90.0, 90.0)
    assert share(tuned, accepted, accepted) == 1.0
    assert share(tuned, poor, accepted) == pytest.approx(10.0 / 99.0)


@pytest.mark.parametrize(("reduced", "closed"), [(1.03, 0.9), (1.5, 0.9e-3)])
def test_where_an_answer_leaves_noise_its_share_is_over_that_as_drawn(reduced: float, closed: float) -> None:
    """Noise of a line without a force came out twice as loud as it is on average."""
    tuned, accepted, first = _held(2.001, 1.0), _held(2.0, 1.0, reduced), _held(2.0001, 1.0)
    assert share(tuned, first, accepted) == pytest.approx(closed, rel=2e-3)


@pytest.mark.parametrize(
    ("rows", "expected", "members"),
    [
        ([("none", 0.97), ("added_mass", 0.03)], "no_gap", (0,)),
        ([("added_mass", 0.96), ("none", 0.04)], "explained", (0,)),
        ([("added_mass", 0.6), ("tool_contact", 0.38), ("unknown", 0.02)], "ambiguous", (0, 1)),
        ([("unknown", 0.9), ("added_mass", 0.1)], "unknown", (0, 1)),
    ],
)
def test_verdicts(rows, expected, members):
    causes = [Cause(effect, "tool", p) for effect, p in rows]
    assert verdict(causes) == expected
    assert ambiguity_set(causes) == members


def test_every_position_is_judged_once_and_never_fitted_in_its_turn():
    entries = tuple(entry(i, position=p) for i, p in enumerate(np.repeat([0.1, 0.2, 0.3, 0.4, 0.5], 2)))
    folds = cross_validation.folds(Observations(entries, (10.0, 200.0), ("tool_x",), "g/N", 9.8), None, 0)
    assert sorted(e.record for t in folds for e in t.judged) == list(range(10))
    for t in folds:
        assert {e.position for e in t.fitted}.isdisjoint({e.position for e in t.judged})
        assert t.fitted


def test_levels_are_left_out_where_there_is_one_position():
    entries = tuple(entry(i, level=level) for i, level in enumerate([10.0, 10.0, 50.0, 150.0]))
    folds = cross_validation.folds(Observations(entries, (10.0, 200.0), ("tool_x",), "g/N", 9.8), None, 0)
    for t in folds:
        assert {e.level for e in t.fitted}.isdisjoint({e.level for e in t.judged})


def test_records_marked_for_checking_are_only_judged():
    entries = (entry(0), entry(1, position=0.3), entry(2, position=0.2, check=True))
    (fold,) = cross_validation.folds(Observations(entries, (10.0, 200.0), ("tool_x",), "g/N", 9.8), None, 0)
    assert [e.record for e in fold.judged] == [2]
    assert [e.record for e in fold.fitted] == [0, 1]


def test_judging_noise_gives_one():
    e = entry(0)
    result = cross_validation.judged(e, as_shown(np.ones((2, FREQ.size), complex)))
    assert result.chi2 == pytest.approx([1.0, 1.0], abs=0.15)
    np.testing.assert_allclose(result.error, result.noise, rtol=0.08)
    # A prediction as uncertain as the record is noisy halves what is left, and moves no error.
    doubtful = cross_validation.judged(e, as_shown(np.ones((2, FREQ.size), complex))._replace(variance=e.variance))
    np.testing.assert_allclose(doubtful.chi2, result.chi2 / 2)
    np.testing.assert_array_equal(doubtful.error, result.error)


def test_interval_of_shrinkage_holds_its_value():
    before = [cross_validation.judged(entry(i, scale=3.0), as_shown(np.ones((2, FREQ.size)))) for i in range(6)]
    after = [cross_validation.judged(entry(i), as_shown(np.ones((2, FREQ.size)))) for i in range(6)]
    value = 1 - cross_validation.mean_error(after) / cross_validation.mean_error(before)
    low, high = cross_validation.shrinkage_interval(before, after, 0)
    assert low <= value <= high
    assert 0.9 < low < high < 1.0


def test_merging_weighs_by_precision():
    a, b = entry(0), entry(1, scale=2.0)
    b = b.showing(b.data, b.variance / 9)
    (group,) = merged([a, b])
    assert group.data.mean() == pytest.approx(1.9, abs=0.02)
    np.testing.assert_allclose(group.variance, 0.001)


def test_levels_that_agree_and_levels_that_do_not():
    alike = [entry(i, level=10.0 * (i + 1)) for i in range(3)]
    assert where.level_dependence(alike) == pytest.approx(1.0, abs=0.1)
    apart = [entry(i, level=10.0 * (i + 1), scale=1.0 + 0.1 * i) for i in range(3)]
    assert where.level_dependence(apart) > SETTINGS.level_excess
    assert np.isnan(where.level_dependence([entry(0)]))
    # What differs at one level is no matter of the level.
    assert np.isnan(where.level_dependence([entry(i, level=10.0 + 0.3 * i, scale=1.0 + 0.1 * i) for i in range(3)]))
    # Two sessions between which the machine has moved are not two levels.
    moved = [entry(i, level=10.0 * (i % 2 + 1), scale=1.0 + 0.1 * (i // 2)) for i in range(4)]
    assert where.level_dependence(moved) > SETTINGS.level_excess
    named = [dataclasses.replace(e, session=("first", "second")[e.record // 2]) for e in moved]
    assert where.level_dependence(named) == pytest.approx(1.0, abs=0.1)


def test_a_band_that_stands_out_is_found():
    rng = np.random.default_rng(3)
    residual = rng.standard_normal((4, 3, FREQ.size)) + 1j * rng.standard_normal((4, 3, FREQ.size))
    g = Group(
        np.linspace(0.1, 0.9, 4), FREQ, ("tool_x", "tool_z", "base_x"), ("acceleration",) * 3,
        residual, np.ones(residual.shape), np.full(4, np.inf), np.full(4, np.nan), np.zeros(4),
    )  # fmt: skip
    assert where.bands([(g, residual)], 5.0) == ()
    loud = residual * np.where((FREQ > 80) & (FREQ < 100), 4.0, 1.0)
    ((low, high),) = where.bands([(g, loud)], 5.0)
    assert low == pytest.approx(80, abs=4)
    assert high == pytest.approx(100, abs=4)
