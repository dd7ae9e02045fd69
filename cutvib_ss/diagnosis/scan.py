"""
What one more cause could explain of a fit's residual, before anything is fitted.

The directions of the fit's unknowns are projected out of the residual, to first order about the drift that the fit found of each
session. For a linear cause one change of the prediction tells the rest. A restoring force is tried at many values and refined
without derivatives: with clearance or friction the response to a blow depends on its parameters roughly, and Gauss-Newton steps
from afar are caught at once, while the residual's squares fall evenly to where the truth is.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy import optimize

from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.drifted import Drifted, problems_of
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.likelihood import EVEN, Factored
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import By, Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.unknowns import to_unknown
from cutvib_ss.effects.base import Effect, Model, parameter_fields
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import ComplexArray, FloatArray


class Scanned(NamedTuple):
    """A cause on top of a fit, tried and not fitted."""

    gain: float  # χ² that it would take away
    hypothesis: Hypothesis  # Both together, the cause where it did best


class Change(NamedTuple):
    """What a cause changes of the weighted prediction, the directions of the fit's unknowns projected out."""

    along: float  # Its product with the residual; minus infinity where the model cannot take the cause
    squares: float
    moved_by: float  # Squares before the projection
    squares_of_all: float  # Squares that all lines would have, of which those at hand are a part


class Scan:
    """One more cause on top of a fit, on lines that are a part of all."""

    def __init__(
        self,
        nominal: Model,
        records: Records,
        hypothesis: Hypothesis,
        x: FloatArray | None,
        motion: Mapping[str, float],
        apart: bool,
        part: float = 1.0,
        tuned: FloatArray | None = None,
    ) -> None:
        self.nominal, self.records, self.motion, self.apart = nominal, records, motion, apart
        # Unknowns of a fit that is taken as it is, of other records.
        self.warm = tuned
        self.underneath: Fit | None = None
        if x is not None:
            there = self.underneath = fit(nominal, records, hypothesis, x, SETTINGS.scan_steps, SETTINGS.scan_gain)
            hypothesis = there.hypothesis
            self.warm = there.x[: there.first_effect]
        self.effects = hypothesis.effects
        drifted = Drifted(problems_of(nominal, records, hypothesis, self.underneath is not None, apart))
        x, drift, sizes = drifted.problems[0].start(tuned), drifted.none, Sizes()
        if self.underneath is not None:
            x, sizes = self.underneath.x, self.underneath.spread.sizes
            # What is small moves a response in proportion, as its directions say; of a fit that leaves more than noise it has taken
            # up what a cause would do.
            small = drifted.sizes(sizes) <= SETTINGS.predictive_small_drift
            if self.underneath.reduced < SETTINGS.search_enough:
                drift = np.where(small, 0.0, drifted.of(self.underneath.spread))
        self.problem, each = drifted.at(x, drift)
        problem = self.problem
        self.by: By | None = None
        if drift.any():
            self.by = "record" if drift[drifted.n_sessions :].any() else "session"
        self.drifts = [own[: problem.n_tuning] - x[: problem.n_tuning] for own in each] if drift.any() else []
        predictions, residuals, _ = problem.residuals(each)
        directions = Directions(problem, each, predictions, spread=not records.widened)
        lay = directions.layout
        self.sizes, scale = sizes, lay.scale(sizes)
        self.rows = scale[:, None] * directions.flat()
        self.left = _flat(residuals)
        precision = np.concatenate([problem.prior_precision(), np.ones(lay.size - problem.size)])
        told, prior = self.rows @ self.rows.T, np.diag(precision + 1e-9)
        self.normal = Factored(told + prior)
        # Of noise more lines tell more, of drift they do not.
        self.part, self.normal_of_all = part, self.normal if part == 1.0 else Factored(told / part + prior)
        # Where the fit was drawn away from the priors' middle to make up for what it lacks, it gains by going back.
        here = lay.placed(drift) / scale
        here[: x.size] = x / scale[: x.size]
        self.strain = precision * here
        self.strained = float(self.strain @ here)
        self.of_left = self.rows @ self.left
        self.leaves = self._freed(self.left)

    @property
    def is_far(self) -> bool:
        """Whether the fit underneath leaves more than first order tells of."""
        return self.leaves > SETTINGS.search_first_order * self.left.size

    @property
    def least(self) -> float:
        """χ² that a cause has to take away to be worth trying: some of the excess, where first order tells that."""
        if self.underneath is None or self.is_far:
            return -np.inf
        return SETTINGS.search_leads * max(self.leaves - self.left.size, 0.0)

    def promise(self, starts: Sequence[Effect]) -> Scanned:
        """The best of a cause's starts."""
        if starts[0].linear:
            gain, best = max(((g, h) for h, _, g in self._of_starts(starts)), key=lambda row: row[0])
            return Scanned(gain, best)
        tried = [self.as_it_stands(e) for e in starts]
        # Where several parameters scale together, as those of friction do, the first start's shape stands for all.
        tried += map(self._in_proportion, _shapes(starts) if len(starts[0].strength) == 1 else starts[:1])
        return max(tried, key=lambda s: s.gain)

    def nearest(self, starts: Sequence[Effect]) -> tuple[float, Scanned]:
        """
        The start whose responses are nearest in shape to those measured, and how near: nought where they are the same, to two.

        Mean of |A - B|² / (|A|² + |B|²) over the lines, which no line dominates and a resonance that lies elsewhere only bounds.
        """
        tried = ((self._differs(*self.with_cause(e)[1:]), e) for e in starts)
        differs, effect = min(tried, key=lambda row: row[0])
        return differs, Scanned(-np.inf, self.with_cause(effect)[0])

    def each(self, starts: Sequence[Effect]) -> list[tuple[float, float]]:
        """χ² that each start of a linear cause would take away: as it stands, and scaled as it is best."""
        return [found[1:] for found in self._of_starts(starts)]

    def all_free(self, effect: Effect, amplitudes: Sequence[float] = (1.0,)) -> tuple[float, float]:
        """
        χ² that a linear cause would take away to first order, all of its parameters free, and twice the log evidence that it gains.

        Normal priors are tried with each of the standard deviations given; that of most evidence counts.
        """
        _, problem, x = self.with_cause(effect)
        try:
            each = problem.each(self._each(x))
            directions = Directions(problem, each, problem.predictions(each), spread=not self.records.widened)
        except (CutvibError, np.linalg.LinAlgError):
            return -np.inf, -np.inf
        own = [problem.first_effect + i for i, p in enumerate(problem.parameters) if p[0] == len(self.effects)]
        rows = directions.layout.scale(self.sizes)[own, None] * directions.flat()[own]
        seen = self.rows @ rows.T
        pulled = self.normal.solved(seen)
        along = rows @ self.left + pulled.T @ (self.strain - self.of_left)
        matrix = rows @ rows.T - seen.T @ pulled
        scaled = ~problem.even[own]
        precision = np.where(scaled, 1.0, EVEN)
        found = []
        for amplitude in amplitudes:
            size = np.where(scaled, amplitude, 1.0)
            whole = size[:, None] * matrix * size + np.diag(precision)
            gain = float((size * along) @ np.linalg.solve(whole, size * along))
            found.append((gain, gain - float(np.linalg.slogdet(whole)[1] - np.log(precision).sum())))
        return max(found, key=lambda row: row[1])

    def refined(self, best: Scanned) -> Scanned:
        """A restoring force with its parameters where it explains most."""
        if best.hypothesis.effects[-1].linear or not np.isfinite(best.gain):
            return best
        _, problem, x = self.with_cause(best.hypothesis.effects[-1])
        own = np.flatnonzero([p[0] == len(self.effects) for p in problem.parameters]) + problem.first_effect

        def loss(values: FloatArray) -> float:
            trial = x.copy()
            trial[own] = values
            gain = self._gain_at(problem, trial)
            return -gain if np.isfinite(gain) else 1e300

        start = x[own]
        step = np.where(start + SETTINGS.scan_simplex <= 1.0, SETTINGS.scan_simplex, -SETTINGS.scan_simplex)
        found = optimize.minimize(
            loss,
            start,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * own.size,
            options={
                "initial_simplex": np.vstack([start, start + np.diag(step)]),
                "maxfev": SETTINGS.scan_evaluations * own.size,
                "xatol": 1e-4,
                "fatol": 0.1,
            },
        )
        if -found.fun <= best.gain:
            return best
        x[own] = found.x
        effects = problem.effects(x)
        both = Hypothesis((*self.effects, *effects[len(self.effects) :]), self.motion)
        return Scanned(float(-found.fun), both)

    def with_cause(self, effect: Effect) -> tuple[Hypothesis, Problem, FloatArray]:
        """The fit underneath with a cause at its start: both, their problem, and its unknowns."""
        both = Hypothesis((*self.effects, effect), self.motion)
        problem = problem_for(self.nominal, self.records, both, self.apart, self.by)
        problem.share(self.problem)
        return both, problem, problem.start(self.warm)

    def _each(self, x: FloatArray) -> FloatArray | list[FloatArray]:
        """Unknowns of each group, drifted as in the fit underneath."""
        if not self.drifts:
            return x
        each = [x.copy() for _ in self.drifts]
        for own, drift in zip(each, self.drifts, strict=True):
            own[: drift.size] += drift
        return each

    def _freed(self, residual: FloatArray) -> float:
        """Squares of a residual, and of the priors, that the fit's unknowns cannot take up."""
        pulled = self.rows @ residual - self.strain
        return float(residual @ residual + self.strained - pulled @ self.normal.solved(pulled))

    def _gain_at(self, problem: Problem, x: FloatArray) -> float:
        try:
            residual = _flat(problem.residuals(self._each(x))[1])
        except (CutvibError, np.linalg.LinAlgError):
            return -np.inf
        # A force that lets the motion run away leaves more than a number holds.
        with np.errstate(over="ignore", invalid="ignore"):
            gain = self.leaves - self._freed(residual) if np.isfinite(residual).all() else -np.inf
        return gain if np.isfinite(gain) else -np.inf

    def _differs(self, problem: Problem, x: FloatArray) -> float:
        """Mean difference in shape of a prediction, over the lines; two where the model cannot take the cause."""
        try:
            residuals = problem.residuals(self._each(x))[1]
        except (CutvibError, np.linalg.LinAlgError):
            return 2.0
        total, count = 0.0, 0
        with np.errstate(over="ignore", invalid="ignore"):
            for g, r in zip(problem.groups, residuals, strict=True):
                measured = g.data * g.weight
                # Noise alone has squares of two.
                size = np.abs(measured) ** 2 + np.abs(measured - r) ** 2 + 2.0
                each = np.abs(r) ** 2 / size
                total += float(np.sum(np.where(np.isfinite(each), each, 2.0)))
                count += r.size
        return total / count

    def as_it_stands(self, effect: Effect) -> Scanned:
        """A cause at its start, the fit's unknowns free to give way."""
        both, problem, x = self.with_cause(effect)
        return Scanned(self._gain_at(problem, x), both)

    def faint(self, starts: Sequence[Effect]) -> list[Hypothesis]:
        """A restoring force in each of its shapes, so weak that it changes in proportion to it; none where it never does."""
        weak = [(e, self._weak(e)) for e in _shapes(starts)]
        return [
            Hypothesis((*self.effects, _times(e, factor)), self.motion) for e, (factor, _, size) in weak if size > 0.0
        ]

    def _weak(self, effect: Effect) -> tuple[float, float, float]:
        """A factor below which a restoring force changes in proportion to it, the change times the residual, and its squares."""
        _, problem, x = self.with_cause(effect)
        values = {name: float(getattr(effect, name)) for name in effect.strength}
        factor = 1.0
        for _ in range(SETTINGS.scan_weaker):
            for i, (k, name, r) in enumerate(problem.parameters):
                if k == len(self.effects) and name in values:
                    x[problem.first_effect + i] = to_unknown(factor * values[name], r)
            along, size, moved_by, _ = self.change(problem, x)
            if moved_by <= SETTINGS.scan_in_proportion * self.left.size:
                break
            factor *= np.sqrt(0.5 * SETTINGS.scan_in_proportion * self.left.size / moved_by)
        return factor, along, size

    def _in_proportion(self, weakest: Effect) -> Scanned:
        """A restoring force between and below its starts: what little of it changes, at its best scale, turned round if need be."""
        factor, along, size = self._weak(weakest)
        scale = along / size if size > 0.0 else 0.0
        nothing = Scanned(-np.inf, Hypothesis((*self.effects, weakest), self.motion))
        if not 0.0 < factor * abs(scale) < SETTINGS.scan_extrapolated:
            return nothing
        try:
            return self.as_it_stands(_times(weakest, factor * scale))
        except CutvibError:
            # Its parameter cannot be negative.
            return nothing

    def _of_starts(self, starts: Sequence[Effect]) -> list[tuple[Hypothesis, float, float]]:
        """χ² that a linear cause would take away at each start: as it stands, and with its change scaled as it is best."""
        tried = [self.with_cause(e) for e in starts]
        changes = self._changes([(problem, x) for _, problem, x in tried])
        out = []
        for (both, problem, x), (along, size, moved_by, _) in zip(tried, changes, strict=True):
            stands, gain = 2.0 * along - size, along * abs(along) / size if size > 0.0 else along
            if moved_by <= SETTINGS.scan_nothing * self.left.size and gain != -np.inf:
                gain = self._off_start(problem, x)
            out.append((both, stands, gain))
        return out

    def _off_start(self, problem: Problem, x: FloatArray) -> float:
        """χ² that a cause would take away whose start does nothing yet: each parameter is moved off it, and may go either way."""
        there = []
        for i in range(problem.size - sum(p[0] == len(self.effects) for p in problem.parameters), problem.size):
            moved = x.copy()
            moved[i] += SETTINGS.scan_nudge if x[i] + SETTINGS.scan_nudge <= 1.0 else -SETTINGS.scan_nudge
            there.append((problem, moved))
        gains = (c.along**2 / c.squares if c.squares > 0.0 else c.along for c in self._changes(there))
        return max((gain for gain in gains if np.isfinite(gain)), default=-np.inf)

    def change(self, problem: Problem, x: FloatArray) -> Change:
        """Of the prediction at some unknowns, from that of the fit."""
        return self._changes([(problem, x)])[0]

    def _changes(self, there: Sequence[tuple[Problem, FloatArray]]) -> list[Change]:
        """The same of several, which are projected together: there are far more data than directions."""
        found, out = [], [Change(-np.inf, 0.0, 0.0, 0.0)] * len(there)
        for i, (problem, x) in enumerate(there):
            if (like := _most_alike([other for _, other in there[:i]], x)) is not None:
                # Its slow poles are nearer than those without the cause.
                problem.share(there[like][0])
            try:
                change = self.left - _flat(problem.residuals(self._each(x))[1])
            except (CutvibError, np.linalg.LinAlgError):
                continue
            # A force that lets the motion run away changes more than the squares of a number hold.
            if np.abs(change).max() < np.sqrt(SETTINGS.fit_run_away * change.size):
                found.append((i, change))
        if found:
            changes = np.array([change for _, change in found])
            seen = self.rows @ changes.T
            for (i, change), own in zip(found, seen.T, strict=True):
                pulled, whole = self.normal.solved(own), float(change @ change)
                along = float(change @ self.left + pulled @ (self.strain - self.of_left))
                size = whole - float(pulled @ own)
                of_all = (whole - float(self.normal_of_all.solved(own) @ own) / self.part) / self.part
                # All lines tell no less than a part of them does, whatever rounding leaves of the difference.
                out[i] = Change(along, size, whole, max(of_all, size)) if size > 0.0 else Change(0.0, 0.0, whole, 0.0)
        return out


def _times(effect: Effect, factor: float) -> Effect:
    """A restoring force times a factor."""
    return effect.changed({name: factor * float(getattr(effect, name)) for name in effect.strength})


def _shapes(starts: Sequence[Effect]) -> list[Effect]:
    """The weakest start of each shape that a restoring force's strength does not change; some of many."""
    found: dict[tuple[object, ...], Effect] = {}
    names = starts[0].strength
    if not names:
        return []
    for e in sorted(starts, key=lambda e: abs(float(getattr(e, names[0])))):
        sizes = np.array([float(getattr(e, name)) for name in names])
        rest = tuple(getattr(e, f.name) for f in parameter_fields(type(e)) if f.name not in names)
        found.setdefault((*np.round(np.log(np.abs(sizes / sizes[0])), 3).tolist(), *rest), e)
    each = list(found.values())
    return [each[i] for i in np.unique(np.linspace(0, len(each) - 1, SETTINGS.scan_shapes).round().astype(int))]


def _most_alike(others: Sequence[FloatArray], x: FloatArray) -> int | None:
    """Index of the unknowns that differ least from some; none of another number of parameters."""
    same = [k for k, other in enumerate(others) if other.size == x.size]
    if not same:
        return None
    return same[int(np.argmin(np.sum((np.array([others[k] for k in same]) - x) ** 2, axis=1)))]


def _flat(residuals: Sequence[ComplexArray]) -> FloatArray:
    return np.concatenate([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in residuals])
