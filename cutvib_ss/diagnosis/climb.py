"""
The climb to the maximum of a hypothesis' posterior: Levenberg-Marquardt within bounds, drift and discrepancy integrated out.

What drifts by more than its direction tells is followed: sessions, and records beside them, have values of their own then.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.diagnosis.curvature import curvature_of
from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.drifted import Drifted
from cutvib_ss.diagnosis.form_errors import Form, that_tell
from cutvib_ss.diagnosis.layout import Layout, Sizes, deviations
from cutvib_ss.diagnosis.likelihood import Known, Quadratic, solved
from cutvib_ss.diagnosis.marginal import Marginal
from cutvib_ss.diagnosis.prediction import Predicted
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.steps import Trail, bounded_step
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import ComplexArray, FloatArray


class Beside(NamedTuple):
    """Scatter of records about what they are merged into, its number of real data, and whether any noise was seen to scatter."""

    squares: float
    data: int
    known: bool


@dataclass
class At:
    """The objective at some unknowns and drifts of sessions, and what a step from there needs."""

    problem: Problem
    x: FloatArray
    drift: FloatArray
    each: list[FloatArray]
    predictions: Sequence[Predicted]
    residuals: list[ComplexArray]
    squares: float
    chi2: float
    objective: float
    quadratic: Quadratic | None = None
    directions: Directions | None = None  # Behind the quadratic
    # The same with derivatives of what the discrepancy takes up at some sizes
    curved: tuple[Sizes, Quadratic] | None = None


class Climb:
    """Steps from one point, on the same problem with coarser to finer groups."""

    def __init__(
        self,
        problems: Sequence[Problem],
        x: FloatArray,
        spread: bool,
        beside: Beside,
        near: Spread | None = None,
        rival: float = np.inf,
    ) -> None:
        self.drifted = Drifted(problems)
        problem = self.drifted.whole
        self.problem, self.spread, self.beside, self.rival = problem, spread, beside, rival
        self.sizes = Sizes() if near is None else near.sizes
        self.is_rough = problem.apart or bool(problem.drifting_within)
        alone = len(problem.drifting_within) == len(problem.sessions)
        within = self.sizes.within if near is not None and alone else None
        self.known = Known(problem.nominal.tolerance.drift, beside.known, within)
        self.count = problem.count + beside.data
        self.precision = problem.prior_precision()
        self.parts = np.array(problem.parts.all, dtype=np.intp)
        self.low, self.high = problem.bounds()
        self.form: tuple[Form, Mapping[int, ComplexArray]] = ((), {})
        self.may_curve = spread and not problem.apart
        """Whether steps may follow what the discrepancy takes up: by simulation second derivatives would take too long."""
        self.is_curved = False
        still = self.drifted.none
        drift = self.drifted.of(near) if near is not None and spread else still
        # Drifts of another fit, to first order, may lead nowhere, or be more than the model takes.
        starts = [drift]
        if np.any(drift) and (moved := self._squares(x, drift)) > self._squares(x, still):
            starts = [still, drift] if np.isfinite(moved) else [still]
        self.at = min((self.evaluated(x, d) for d in starts), key=lambda at: at.objective)

    @property
    def beaten(self) -> bool:
        """Whether it stands farther behind its rival than what is fitted on all lines may."""
        return self.at.objective - self.rival > SETTINGS.search_close

    def start_from(self, other: Climb) -> None:
        """Go on from where another search of the same sessions stands."""
        if other.problem.sessions == self.problem.sessions:
            drift = np.zeros_like(self.at.drift)
            drift[: len(other.at.drift)] = other.at.drift
            there = self.evaluated(other.at.x, drift)
            if np.isfinite(there.objective) and there.objective < self.at.objective:
                self.at = there

    def continue_from(self, other: Climb) -> None:
        """The same with the sizes of drift and discrepancy found there."""
        self.sizes = other.sizes
        if self.at.quadratic is not None:
            self._weigh(self.at)
        self.start_from(other)

    def try_from(self, x: FloatArray) -> None:
        """Start from other unknowns if they are better."""
        try:
            there = self.evaluated(x, np.zeros_like(self.at.drift))
        except CutvibError:
            return
        if there.objective < self.at.objective:
            self.at = there

    def take_form(self, form: Form | None = None) -> None:
        """Take errors of a restoring force's form into the discrepancy: given ones, or those where it stands."""
        problem, x, predictions = self.at.problem, self.at.x, self.at.predictions
        given = problem.form_at(predictions) if form is None else form
        errors = problem.form_errors(x, predictions, given)
        if form is None:
            given, errors = that_tell(given, errors, [p.group for p in predictions])
        self.form = (given, errors)
        self.at = self.evaluated(self.at.x, self.at.drift)

    def redraw(self) -> None:
        """Evaluate where it stands, with new circles around the slow poles."""
        for problem in self.drifted.problems:
            problem.forget_circles()
        self.at = self.evaluated(self.at.x, self.at.drift)

    # Models that run away overflow.
    @np.errstate(over="ignore", invalid="ignore")
    def evaluated(self, x: FloatArray, drift: FloatArray) -> At:
        """The objective at some unknowns; without drift and discrepancy it needs no derivatives."""
        problem, each = self.drifted.at(x, drift)
        predictions, residuals, squares = problem.residuals(each)
        squares += self.beside.squares
        at = At(problem, x, drift, each, predictions, residuals, squares, squares, squares + self._prior(x))
        if squares > SETTINGS.fit_run_away * self.count:
            # What drift and discrepancy leave of such squares is rounding error.
            at.objective = np.inf
        elif self.spread and np.isfinite(squares):
            self._linearise(at)
        return at

    def _squares(self, x: FloatArray, drift: FloatArray) -> float:
        """Squares of the residuals alone."""
        problem, each = self.drifted.at(x, drift)
        try:
            return problem.residuals(each)[2]
        except CutvibError:
            return np.inf

    def towards(self, x: FloatArray) -> FloatArray:
        """Unknowns on the way to others that leave less of the residual than those where it stands, its drift kept."""
        least, here = self.at.squares - self.beside.squares, self.at.x
        for part in (1.0, 0.5, 0.25):
            there = np.clip(here + part * (x - here), self.low, self.high)
            problem, each = self.drifted.at(there, self.at.drift)
            try:
                if problem.residuals(each)[2] < least:
                    return there
            except (CutvibError, np.linalg.LinAlgError):
                continue
        return here

    def _linearise(self, at: At) -> None:
        """The quadratic there; none where the model has run away."""
        if at.squares > SETTINGS.fit_run_away * self.count:
            return
        directions = Directions(at.problem, at.each, at.predictions, self.spread, form=self.form)
        matrix, gradient = directions.normal(at.residuals)
        if not (np.isfinite(matrix).all() and np.isfinite(gradient).all()):
            return
        at.directions, at.quadratic = directions, self._about(at, directions.layout, matrix, gradient)
        self._weigh(at)

    def _about(self, at: At, lay: Layout, matrix: FloatArray, gradient: FloatArray) -> Quadratic:
        """The quadratic about a point by the normal matrix and gradient there."""
        x = at.x
        pull = gradient[: x.size] - self.precision * x
        free = ~(((x <= self.low) & (pull < 0)) | ((x >= self.high) & (pull > 0)))
        offsets = lay.placed(at.drift)
        return Quadratic(
            lay, matrix, gradient, at.squares, x, self.precision, free, self.problem.even, offsets, self.count
        )

    @property
    def quadratic(self) -> Quadratic | None:
        """The quadratic where it stands, once it is curved by derivatives of all that the model and its discrepancy predict."""
        at = self.at
        if not self.is_curved or at.quadratic is None:
            return at.quadratic
        assert at.directions is not None
        if at.curved is None or at.curved[0] != self.sizes:
            lay, n = at.directions.layout, at.x.size
            matrix, gradient = at.quadratic.system(self.sizes)
            taken = np.zeros(lay.size)
            taken[n:] = solved(matrix[n:, n:], gradient[n:]) * lay.scale(self.sizes)[n:]
            normal = None
            # A value at the end of what its model takes goes no further.
            with contextlib.suppress(CutvibError):
                added = curvature_of(at.directions, at.each, taken)
                normal = None if added is None else at.directions.normal(at.residuals, added)
            at.curved = self.sizes, at.quadratic if normal is None else self._about(at, lay, *normal)
        return at.curved[1]

    def _weigh(self, at: At) -> None:
        """The objective with drift and discrepancy of the present sizes integrated out."""
        assert at.quadratic is not None
        marginal = Marginal(*at.quadratic.system(self.sizes), np.arange(at.x.size))
        prior = self._prior(at.x)
        at.chi2 = at.quadratic.at(self.sizes) - prior - marginal.taken
        # What errors of parts take has to pay, as what drifts and discrepancies do, where their size moves with the evidence.
        paid = marginal.log_determinant + marginal.of_own(self.parts) if self.spread else 0.0
        at.objective = at.chi2 + paid + self.count * float(np.log(self.sizes.noise)) + prior

    def _prior(self, x: FloatArray) -> float:
        """Squares of the priors of the unknowns."""
        return float(self.precision @ (x / self._unit) ** 2)

    @property
    def _unit(self) -> FloatArray:
        """Standard deviation of each unknown's prior, in its unit: errors of parts have a size."""
        return deviations(self.problem.parts, self.precision.size, self.sizes)

    def resize(self) -> None:
        """The sizes of drift and discrepancy that suit where it stands."""
        if self.at.quadratic is None:
            self._linearise(self.at)
        q = self.quadratic
        if q is not None and q.layout.size > q.x.size:
            self.sizes = q.climbed(self.sizes, self.known)
            self._weigh(self.at)

    def climb(self, max_iterations: int, tolerance: float) -> None:
        """Steps until they gain little."""
        damping, trail, pace, gained = SETTINGS.fit_damping, Trail(), np.inf, 0.0
        for k in range(max_iterations):
            if self.at.quadratic is None:
                self._linearise(self.at)
            if k < 2 or k % 3 == 0:
                self.resize()
            if (quadratic := self.quadratic) is None:
                break
            before = self.at.objective
            # What each of the steps left has to gain to lead to what has been found already.
            needed = (before - self.rival) / (max_iterations - k)
            damping = self._step(damping, quadratic, trail, max(SETTINGS.fit_gain, needed))
            gain = before - self.at.objective
            # A residual of many times the noise needs no exact optimum.
            far = self.at.chi2 * self.sizes.noise > SETTINGS.fit_hopeless * self.count
            least = max(tolerance, SETTINGS.fit_hopeless_gain) if far else tolerance
            # Beside the drift of single records, or simulated, the objective is far from its quadratic for many small steps.
            rough = SETTINGS.fit_rough_gain * gained if self.spread and self.is_rough else 0.0
            if gain < max(SETTINGS.fit_gain + least * max(self.at.objective - 0.9 * self.count, 0.0), rough):
                if self.is_curved or not self.may_curve or far or max_iterations <= SETTINGS.fit_scout_steps:
                    break
                self.is_curved, damping, trail, pace = True, SETTINGS.fit_damping, Trail(), np.inf
                if self.quadratic is self.at.quadratic:
                    break
                continue
            gained += gain
            if max(gain, pace) < needed:
                break
            pace = gain

    def _step(self, damping: float, quadratic: Quadratic, trail: Trail, worth: float) -> float:
        """One step: to where the last ones lead, or damped until it gains or is not worth trying; the damping of the next."""
        n, x, drift = self.at.x.size, self.at.x, self.at.drift
        matrix, gradient = quadratic.system(self.sizes)
        beside = np.full(matrix.shape[0] - n, np.inf)
        unit = self._unit
        low, high = np.concatenate([self.low / unit, -beside]), np.concatenate([self.high / unit, beside])
        start = np.concatenate([x / unit, np.zeros(beside.size)])
        weight = np.concatenate([np.sqrt(np.diag(matrix)[:n]) / unit, np.full(drift.size, 1.0 / self.sizes.drift)])
        here, tried = np.concatenate([x, drift.ravel()]), damping
        # What the directions take already is not gained again, but for drift that is still to be followed. Of a restoring force,
        # whose derivatives are those of an equivalent stiffness, no step is given up for what it promises.
        kept = np.arange(matrix.shape[0]) if self.problem.apart else self._followed(quadratic.layout)
        marginal = Marginal(matrix, gradient, kept)
        damped = np.ones(gradient.size)
        if self.is_curved:
            # What directions left of their share, the unknowns would have to take.
            damped = np.zeros(gradient.size)
            damped[kept] = marginal.diagonal / np.diag(matrix)[kept]
        for harder in (1e1, 1e2, 1e3, 1e4):
            step = bounded_step(matrix, gradient, tried * damped, start, low, high)
            # Not even the quadratic gains by it what is needed; of a whole step it may promise too little.
            promised = marginal.gain(step[kept])
            if promised < (worth if tried > damping else SETTINGS.fit_promise * worth):
                break
            moved = x + unit * step[:n]
            there = np.concatenate([moved, self._drifted(step[n:]).ravel()])
            # Derivatives that follow the discrepancy leave nothing to extrapolate.
            ahead = trail.ahead(here, there - here, weight) if tried == damping and not self.is_curved else None
            if ahead is not None:
                if self._moved_to(ahead):
                    trail.add(here, there - here)
                    return damping
                trail.forget()
            # Drift that is followed to where its directions lead may leave more than they said.
            if self._moved_to(there) or (self.is_curved and self._moved_to(np.concatenate([moved, here[n:]]))):
                if tried == damping:
                    return max(damping / 10, 1e-9)
                # Not as far as the quadratic says: the next ones will shrink likewise.
                trail.add(here, there - here)
                return tried
            # Far below where damping begins all steps are alike.
            tried = max(tried, SETTINGS.fit_damping) * harder
        return tried

    def _moved_to(self, there: FloatArray) -> bool:
        """Whether unknowns and drifts gained, and are where it stands now."""
        n = self.at.x.size
        try:
            x, drift = np.clip(there[:n], self.low, self.high), there[n:].reshape(self.at.drift.shape)
            trial = self.evaluated(x, drift)
        except (CutvibError, np.linalg.LinAlgError):
            return False
        gains = bool(np.isfinite(trial.objective) and trial.objective < self.at.objective)
        if gains:
            self.at = trial
        return gains

    def _followed(self, lay: Layout) -> NDArray[np.intp]:
        """Columns of the unknowns, and of the drift that is followed."""
        rows = np.flatnonzero(self.drifted.sizes(self.sizes)[:, 0] > SETTINGS.predictive_small_drift)
        first = lay.unknowns + lay.per_session * rows if lay.sessions else rows[:0]
        return np.concatenate([np.arange(lay.unknowns), (first[:, None] + np.arange(self.at.drift.shape[1])).ravel()])

    def _drifted(self, step: FloatArray) -> FloatArray:
        """Drifts of the sessions after a step in all directions, kept within what their size allows."""
        lay = self.at.quadratic.layout if self.at.quadratic is not None else None
        if lay is None or not lay.sessions:
            return self.at.drift
        own = step[: lay.first_nominal - lay.unknowns].reshape(len(self.at.drift), -1)[:, : self.at.drift.shape[1]]
        size = self.drifted.sizes(self.sizes)
        # Sizes that have shrunk since leave what has drifted where it is, to come back by steps.
        most = np.maximum(SETTINGS.likelihood_farthest_drift * size, np.abs(self.at.drift))
        followed = np.clip(self.at.drift + size * own, -most, most)
        # What is small moves a response in proportion, as its directions say.
        return np.where(size > SETTINGS.predictive_small_drift, followed, 0.0)
