"""
How far: the residual on held-out records of a fit on the others.

Positions are left out in folds (where there are none, levels, then records); records marked ``use = "check"`` are only judged.
Tuning, calibration and the cause are fitted on the rest, and every record is judged at its own level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.discrepancy import pivots_beside
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hit_errors import taken_at
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.prediction import Predicted, Prediction
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Entry, Group, Records, merged, session_of
from cutvib_ss.diagnosis.residual_modes import residual_modes
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulated import Simulated, simulated
from cutvib_ss.diagnosis.simulation import SimulatedProblem, problem_for
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class Fold:
    """One fold of the cross-validation."""

    fitted: tuple[Entry, ...]  # Records to fit on, and records to judge on
    judged: tuple[Entry, ...]

    @property
    def held_out(self) -> bool:
        """Whether what is judged was not fitted: a single record is judged on itself, for want of another."""
        return self.fitted is not self.judged


@dataclass(frozen=True)
class Judged:
    """One held-out record."""

    entry: Entry  # The record
    predicted: ComplexArray  # What was predicted of it
    chi2: FloatArray  # χ² a degree of freedom, by channel
    floor: float = 0.0  # Mean square of the error of a right model, by noise and drift, over channels and lines
    log_density: float = float("nan")  # Log predictive density, up to a constant of the data

    @cached_property
    def residual(self) -> ComplexArray:
        """What the prediction leaves, shape (channel, frequency), SI."""
        return np.asarray(self.entry.data - self.predicted)

    @cached_property
    def error(self) -> FloatArray:
        """Mean modulus of the error over the band, by channel, SI."""
        return np.asarray(np.abs(self.residual).mean(axis=1))

    @cached_property
    def noise(self) -> FloatArray:
        """Mean modulus of the error by noise alone: E|n| of complex Gaussian noise of variance v is √(πv)/2."""
        return np.asarray((np.sqrt(np.pi * self.entry.variance) / 2).mean(axis=1))

    @property
    def squares(self) -> float:
        """Mean square of the error over channels and lines."""
        return float(np.mean(np.abs(self.residual) ** 2))


def folds(observations: Observations, fraction: float | None, seed: int) -> tuple[Fold, ...]:
    """Folds of the cross-validation."""
    entries = observations.entries
    if any(e.check for e in entries):
        return (Fold(tuple(e for e in entries if not e.check), tuple(e for e in entries if e.check)),)
    keys = [_key(e, entries) for e in entries]
    distinct = sorted(set(keys))
    if len(distinct) == 1:
        return (Fold(entries, entries),)
    out_at_once = max(1, round((1 / 3 if fraction is None else fraction) * len(distinct)))
    n_folds = -(-len(distinct) // min(out_at_once, len(distinct) - 1))
    order = np.random.default_rng(seed).permutation(len(distinct))
    # Dealt like cards, so that a fold does not lose a whole side of the rail.
    fold_of = {distinct[k]: i % n_folds for i, k in enumerate(order)}
    made = []
    for k_fold in range(n_folds):
        judged = tuple(e for e, k in zip(entries, keys, strict=True) if fold_of[k] == k_fold)
        fitted = tuple(e for e, k in zip(entries, keys, strict=True) if fold_of[k] != k_fold)
        made.append(Fold(fitted, judged))
    return tuple(made)


def _key(e: Entry, entries: Sequence[Entry]) -> float:
    if e.position is not None and len({x.position for x in entries}) > 1:
        return e.position
    if len({x.level for x in entries if x.level is not None}) > 1:
        # Records that state no level are one more.
        return -1.0 if e.level is None else e.level
    return float(e.record)


def judge(nominal: Model, folds: Sequence[Fold], start: Fit, workers: Workers) -> tuple[Judged, ...]:
    """Errors of a hypothesis on held-out records."""
    out = workers.map(partial(_one_fold, nominal, start), folds)
    return tuple(sorted((j for fold in out for j in fold), key=lambda j: j.entry.record))


# A prediction of a model that runs away overflows, and counts as one that fails.
@np.errstate(over="ignore", invalid="ignore")
def _one_fold(nominal: Model, start: Fit, fold: Fold) -> list[Judged]:
    records = Records(fold.fitted, moving=bool(start.spread.layout.records))
    steps = SETTINGS.held_out_steps if start.hypothesis.linear else SETTINGS.held_out_law_steps
    try:
        again = fit(nominal, records, start.hypothesis, start.x, steps, SETTINGS.held_out_gain, near=start)
    except CutvibError:
        return [_not_predicted(e) for e in fold.judged]
    problem = problem_for(nominal, records, again.hypothesis)
    problem.by_simulation = start.derivatives
    others = {simulate: _other_way(nominal, records, problem, simulate) for simulate in {e.leaks for e in fold.judged}}
    return [_judged_by(others[e.leaks], again, e) for e in fold.judged]


def _other_way(nominal: Model, records: Records, problem: Problem, simulate: bool) -> Problem:
    """The problem that predicts a record as it has to be, simulated or in closed form, which a fit of all need not be."""
    if not problem.hypothesis.linear or simulate == isinstance(problem, SimulatedProblem):
        return problem
    other = (
        problem_for(nominal, records, problem.hypothesis, apart=True)
        if simulate
        else Problem(nominal, records.groups(), problem.hypothesis)
    )
    other.drifting_within = problem.drifting_within
    return other if (other.size, other.channels) == (problem.size, problem.channels) else problem


def _judged_by(problem: Problem, fitted: Fit, e: Entry) -> Judged:
    """A held-out record against a fit."""
    try:
        shown = predicted(e, _model_for(e, problem, fitted.x), problem.blow_at(fitted.x), problem, fitted.x)
        if not np.max(np.abs(shown.data - e.data) * np.sqrt(e.precision)) < np.sqrt(SETTINGS.fit_run_away):
            return _not_predicted(e)
        record = judged(e, shown, problem, fitted)
        if fitted.closest is None:
            return record
        x = fitted.corrected.x
        return replace(record, predicted=predicted(e, _model_for(e, problem, x), problem.blow_at(x), problem, x).data)
    except CutvibError:
        return _not_predicted(e)


def _not_predicted(e: Entry) -> Judged:
    """A record under a restoring force that lets it run away: as if no motion were predicted."""
    chi2 = np.mean(np.abs(e.data) ** 2 / e.variance, axis=1)
    return Judged(e, np.zeros_like(e.data), chi2, float(e.variance.mean()), -float(np.sum(chi2)) * e.freq.size)


def _model_for(e: Entry, problem: Problem, x: FloatArray) -> Model:
    return problem.model_of(x, e.group)


def judge_as_given(nominal: Model, observations: Observations, start: Fit) -> tuple[Judged, ...]:
    """Errors of the nominal model as given, nothing tuned or calibrated."""
    problem = Problem(nominal, merged(observations.entries), Hypothesis())
    blow_at = problem.blow_at(start.x) if start.x.size == problem.size else 0.0
    entries = [e for e in observations.entries if e.check] or list(observations.entries)
    return tuple(judged(e, predicted(e, nominal, blow_at)) for e in entries)


class Shown(NamedTuple):
    """What a model predicts of a record."""

    data: ComplexArray  # The prediction
    variance: FloatArray  # Its own E|Δ|², of a restoring force whose record does not tell the force on which it depends; else zero
    seen: Predicted  # The model seen through the record's estimator, calibration errors apart


def predicted(
    e: Entry,
    model: Model,
    blow_at: float,
    problem: Problem | None = None,
    x: FloatArray | None = None,
) -> Shown:
    """What a model predicts of a record."""
    group = e.group
    # What depends on the level, or leaks, is simulated with the record's own force.
    simulate = e.leaks or (bool(model.nonlinear) and (e.replay is not None or e.sine is not None))
    if simulate and e.replay is not None and e.replay.assumed and bool(model.nonlinear):
        error: ComplexArray = np.ones(e.data.shape, dtype=np.complex128)
        if problem is not None and x is not None:
            error = problem.calibration_of(e.channels, e.freq, x)
        fitted = np.zeros(1) if problem is None or x is None else problem.force_unknowns(x)
        return _by_its_force(model, group, error, float(np.mean(fitted)) if fitted.size else 0.0)
    offset = 0.0 if problem is None or x is None else problem.offset_of(x)
    seen: Predicted = simulated(model, group, offset=offset) if simulate else Prediction(model, group, blow_at)
    shown = seen.data if problem is None or x is None else problem.shown(seen, x)
    return Shown(np.asarray(shown[0]), np.zeros(e.data.shape), seen)


def _by_its_force(model: Model, group: Group, error: ComplexArray, mean: float) -> Shown:
    """Show a record whose force is guessed, its force scale found from all its data about the mean of those that were fitted."""
    ((entry,),) = group.entries
    replay = entry.replay
    assert replay is not None
    weight = np.sqrt(2.0 / group.variance[0])
    x = mean

    def shown(x: float, longer: float = 1.0) -> ComplexArray:
        behind = group if longer == 1.0 else replace(group, entries=((replace(entry, replay=replay.longer(longer)),),))
        data: ComplexArray = (
            simulated(model, behind, force_scale=np.exp([SETTINGS.simulation_force_scale * x])).data[0] * error
        )
        return data

    here = shown(x)
    seen = simulated(model, group, force_scale=np.exp([SETTINGS.simulation_force_scale * x]))
    slope = np.zeros(here.shape, dtype=np.complex128)
    for _ in range(SETTINGS.held_out_force_steps):
        slope = (shown(x + SETTINGS.simulation_force_scale_step) - here) / SETTINGS.simulation_force_scale_step
        left, along = (group.data[0] - here) * weight, slope * weight
        x += float((np.vdot(along, left).real - (x - mean)) / (1.0 + np.vdot(along, along).real))
        x = float(np.clip(x, -SETTINGS.fit_within, SETTINGS.fit_within))
        here = shown(x)
    # Blows may also differ among themselves, and be shorter or longer than guessed: the prediction is uncertain by how that moves
    # it beyond what another force scale would do.
    others = [
        shown(x + SETTINGS.held_out_blows_differ),
        shown(x - SETTINGS.held_out_blows_differ),
        shown(x, 1.0 + SETTINGS.held_out_length_differs),
        shown(x, 1.0 - SETTINGS.held_out_length_differs),
    ]
    along = slope * weight
    spread = []
    for other in others:
        moved = (other - here) * weight
        moved = moved - along * (np.vdot(along, moved).real / (1.0 + np.vdot(along, along).real))
        # Lines that tell nothing have no weight, and need no variance.
        spread.append(np.abs(np.divide(moved, weight, out=np.zeros_like(moved), where=weight > 0.0)) ** 2)
    variance = np.asarray(np.mean(spread, axis=0))
    less_known = replace(group, variance=group.variance + variance)
    return Shown(here, variance, replace(seen, group=less_known))


def judged(e: Entry, shown: Shown, problem: Problem | None = None, fitted: Fit | None = None) -> Judged:
    """A record against a prediction."""
    total = e.variance + shown.variance
    told = np.count_nonzero(e.precision, axis=1)
    if problem is None or fitted is None or isinstance(shown.seen, Simulated) != isinstance(problem, SimulatedProblem):
        power = np.where(e.precision > 0.0, np.abs(e.data - shown.data) ** 2 / total, 0.0).sum(axis=1)
        chi2, drifts, density = power / np.maximum(told, 1), 0.0, -float(np.sum(power))
    else:

        def show(x: FloatArray, e: Entry = e, here: Shown | None = shown) -> tuple[Predicted, ComplexArray]:
            if here is None or not np.array_equal(x, fitted.x):
                here = predicted(e, _model_for(e, problem, x), problem.blow_at(x), problem, x)
            weight = np.where(e.precision > 0.0, np.sqrt(2.0 / (e.variance + shown.variance)), 0.0)
            return here.seen, (e.data - here.data) * weight

        wider = e.showing(e.data, e.variance + (SETTINGS.fit_start_error * np.abs(e.data)) ** 2)
        afar = partial(show, e=wider, here=None)
        modes = residual_modes(problem.nominal, [e.group], problem.band[1])
        chi2, drifts, density = fitted.spread.left(
            problem,
            fitted.x,
            session_of(e),
            e.record,
            show,
            afar,
            taken_at(e.hits, e.placed),
            modes,
            pivots_beside(fitted.spread.layout.pivots, e.group, problem),
        )
        chi2 = chi2 * e.freq.size / np.maximum(told, 1)
        total = fitted.spread.noise * total
    # A prediction that is uncertain by itself pays for it.
    density -= float(np.sum(np.log1p(shown.variance / e.variance)))
    return Judged(e, shown.data, chi2, float(total.mean() + drifts), density)


def mean_error(records: Sequence[Judged]) -> float:
    """Mean error over records and channels."""
    return float(np.mean([j.error.mean() for j in records]))


def reduced_chi2(records: Sequence[Judged]) -> float:
    """χ² a degree of freedom over records and channels."""
    return float(np.mean([j.chi2.mean() for j in records]))


def shrinkage_interval(before: Sequence[Judged], after: Sequence[Judged], seed: int) -> tuple[float, float]:
    """95 % interval of 1 - after/before, by bootstrap over records."""
    b = np.array([j.error.mean() for j in before])
    a = np.array([j.error.mean() for j in after])
    pick = np.random.default_rng(seed).integers(0, b.size, (SETTINGS.held_out_bootstraps, b.size))
    values = 1.0 - a[pick].mean(axis=1) / b[pick].mean(axis=1)
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)
