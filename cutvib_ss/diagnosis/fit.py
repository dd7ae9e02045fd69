"""
One hypothesis fitted to measured responses: effect, tuning within tolerance, and calibration, all at once.

The maximum of the posterior is found by Gauss-Newton steps with analytic derivatives, and the evidence is Laplace's around it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.discrepancy import weights
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.likelihood import Directions, Known, Quadratic, Sizes, solved
from cutvib_ss.diagnosis.prediction import Predicted
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import By, Records, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.unknowns import from_unknown
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError, DiagnosisError
from cutvib_ss.results import ComplexArray, FloatArray

FROM_AFAR: tuple[By | None, ...] = (None, "session")


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis."""

    hypothesis: Hypothesis  # With its effects at their fitted values
    model: Model  # Tuned, with the effects
    tuned: Model  # The tuning alone
    x: FloatArray  # Fitted unknowns: tuning, calibration, instant of the blow, effects (transformed)
    first_effect: int  # Where the effects' unknowns begin
    covariance: FloatArray  # Posterior covariance of the unknowns
    # Weighted squares of the residuals, drift and discrepancy integrated out, the scatter of merged records included
    chi2: float
    count: int  # Real data
    objective: float  # χ² with the priors' squares and the determinants: comparable between hypotheses
    log_evidence: float  # Logarithm of the Laplace evidence, up to a constant shared by all hypotheses on the same data
    stds: Mapping[str, float]  # Standard deviation of each effect's parameter, in order ``<index>.<name>``
    # Parameters of the effects that lie at an end of their range, ``<index>.<name>``, where other values lie beyond
    at_end: tuple[str, ...]
    correlation: float  # Number of residuals that tell the same thing; 1 where they are white
    spread: Spread  # Drift and discrepancy: their sizes, and what the records say of them

    @property
    def reduced(self) -> float:
        """χ² a datum against the noise as stated, drift and discrepancy integrated out."""
        return self.chi2 * self.spread.sizes.noise / self.count


def fit(
    nominal: Model,
    records: Records,
    hypothesis: Hypothesis,
    warm: FloatArray | None = None,
    max_iterations: int = 40,
    tolerance: float = 1e-5,
    near: Fit | None = None,
) -> Fit:
    """
    Maximum of the posterior of a hypothesis, and its evidence.

    Levenberg-Marquardt on the normal equations: 40 unknowns against 10⁴ to 10⁵ data make their forming the only cost, and a
    general least squares solver's factorisation of the full Jacobian twenty times more expensive. Effects' unknowns are kept
    within their ranges by projection. Evidence: χ²/2 + Σ prior²/2 + ½ ln det(JᵀWJ + P), the even priors being one in unit
    coordinates.
    """
    problems = _problems(nominal, records, hypothesis)
    problem = problems[0]
    beside = _beside(problem, records)
    # Beside a widened noise drift and discrepancy are nothing.
    search = _Search(problems, problem.start(warm), not records.widened, beside, near)
    if warm is not None and near is None:
        # Few lines with a widened noise may have led away from a model that is right as it was given.
        search.try_from(problem.start(None))
    if hypothesis.linear and not records.rough and near is None:
        search.start_from(_from_afar(nominal, records, hypothesis, search))
        if not problem.apart and max_iterations > SETTINGS.fit_scout_steps:
            search.continue_from(_on_fewer_lines(nominal, records, hypothesis, search, max_iterations, tolerance))
    if not hypothesis.linear and search.spread and max_iterations > SETTINGS.fit_scout_steps:
        # The residual of a law far from its optimum would pass for a large discrepancy, in whose side minima the steps end.
        plain = _Search(problems, search.at.x, False, search.beside)
        plain.climb(max_iterations, tolerance)
        search.start_from(plain)
    # From beside the optimum once is enough.
    redrawn = not problem.apart and near is None
    passes = SETTINGS.fit_passes if redrawn and max_iterations > SETTINGS.fit_scout_steps else 1
    for _ in range(passes):
        before = search.at.objective
        search.climb(max_iterations, tolerance)
        if passes > 1:
            # The circles were drawn for the first model of the pass; drawn anew they may show that it goes on.
            search.redraw()
        if before - search.at.objective < 1.0:
            break
    search.resize()
    if search.at.quadratic is None or not np.isfinite(search.at.objective):
        raise DiagnosisError(f"{hypothesis.effect} at {hypothesis.place} runs away from where it starts")
    return _finished(problem, search, search.at.quadratic)


def _problems(nominal: Model, records: Records, hypothesis: Hypothesis) -> tuple[Problem, ...]:
    """
    The same problem with groups of all records, of one session, and, where the machine moves, of one record.

    Without drift the sessions need not be told apart, and many positions are predicted at once.
    """
    kinds: list[By] = ["session"] if not records.widened else []
    kinds += ["record"] if records.moving and not records.widened else []
    return tuple(problem_for(nominal, records, hypothesis, by=by) for by in (None, *kinds))


class _Beside(NamedTuple):
    """Scatter of records about what they are merged into, its number of real data, and whether any noise was seen to scatter."""

    squares: float
    data: int
    known: bool


def _beside(problem: Problem, records: Records) -> _Beside:
    known = all(e.estimator.scatter_seen for e in records.entries)
    if problem.apart or records.moving:
        return _Beside(0.0, 0, known)
    total = sum(2 * int(np.count_nonzero(np.isfinite(e.variance))) for e in records.entries)
    return _Beside(records.scatter, total - problem.count, known)


def _from_afar(nominal: Model, records: Records, hypothesis: Hypothesis, start: _Search) -> _Search:
    """
    Unknowns and drifts on few lines with a widened noise.

    A session that drifts by more than a resonance is wide is caught in a side minimum when the noise is small.
    """
    few = records.coarse(SETTINGS.fit_start_lines, SETTINGS.fit_start_error)
    problems = tuple(problem_for(nominal, few, hypothesis, by=by) for by in FROM_AFAR)
    search = _Search(problems, start.at.x, True, _beside(problems[0], few))
    search.climb(SETTINGS.fit_scout_steps, SETTINGS.fit_start_gain)
    return search


def _on_fewer_lines(
    nominal: Model, records: Records, hypothesis: Hypothesis, start: _Search, steps: int, tolerance: float
) -> _Search:
    """The same fit on some of the lines, as measured: neighbours tell much the same of the unknowns, and cost as much."""
    few = records.coarse(SETTINGS.fit_fewer_lines, 0.0)
    problems = _problems(nominal, few, hypothesis)
    search = _Search(problems, start.at.x, True, _beside(problems[0], few))
    search.start_from(start)
    search.climb(steps, tolerance)
    return search


@dataclass
class _At:
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
    factor: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))


class _Search:
    """Levenberg-Marquardt within bounds, from one point; drift and discrepancy are integrated out."""

    def __init__(
        self,
        problems: Sequence[Problem],
        x: FloatArray,
        spread: bool,
        beside: _Beside,
        near: Fit | None = None,
    ) -> None:
        problem = problems[-1]
        self.problem, self.spread, self.beside = problem, spread, beside
        # Sessions in another order would have other columns.
        self.problems = [p if p.sessions == problem.sessions else problem for p in problems]
        self.sizes = Sizes() if near is None else near.spread.sizes
        self.known = Known(problem.nominal.tolerance.drift, beside.known)
        self.count = problem.count + beside.data
        self.precision = problem.prior_precision()
        self.low, self.high = problem.bounds()
        weight, _ = weights(problem)
        self.drifting = np.flatnonzero(weight)
        self.weight = weight[self.drifting]
        self.n_sessions = len(problem.sessions)
        # Of the sessions, then of the records that drift beside them.
        drift = np.zeros((self.n_sessions + len(problem.drifting_within), self.drifting.size))
        if near is not None and spread:
            drift = near.spread.drifts(problem.sessions, problem.drifting_within, self.drifting.size)
        try:
            self.at = self.evaluated(x, drift)
        except CutvibError:
            # Drifts of another fit, to first order, may be more than the model takes.
            self.at = self.evaluated(x, np.zeros_like(drift))

    def start_from(self, other: _Search) -> None:
        """Go on from where another search of the same sessions stands."""
        if other.problem.sessions == self.problem.sessions:
            drift = np.zeros_like(self.at.drift)
            drift[: len(other.at.drift)] = other.at.drift
            there = self.evaluated(other.at.x, drift)
            if np.isfinite(there.objective) and there.objective < self.at.objective:
                self.at = there

    def continue_from(self, other: _Search) -> None:
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

    def redraw(self) -> None:
        """Evaluate where it stands, with new circles around the slow poles."""
        for problem in self.problems:
            problem.forget_circles()
        self.at = self.evaluated(self.at.x, self.at.drift)

    def evaluated(self, x: FloatArray, drift: FloatArray) -> _At:
        """The objective at some unknowns; without drift and discrepancy it needs no derivatives."""
        n, moves = self.n_sessions, int(np.any(drift)) + int(np.any(drift[self.n_sessions :]))
        problem = self.problems[min(moves, len(self.problems) - 1)]
        each = [x] * len(problem.groups)
        if moves:
            each = []
            for g in problem.groups:
                own, entry = x.copy(), g.entries[0][0]
                moved = drift[problem.sessions.index(session_of(entry))].copy()
                if moves > 1:
                    moved += drift[n + problem.drifting_within.index(entry.record)]
                own[self.drifting] += self.weight * moved
                each.append(own)
        predictions, residuals, squares = problem.residuals(each)
        squares += self.beside.squares
        at = _At(
            problem, x, drift, each, predictions, residuals, squares, squares, squares + float(self.precision @ x**2)
        )
        if squares > SETTINGS.fit_run_away * self.count:
            # What drift and discrepancy leave of such squares is rounding error.
            at.objective = np.inf
        elif self.spread and np.isfinite(squares):
            self._linearise(at)
        return at

    def _linearise(self, at: _At) -> None:
        """The quadratic there; none where the model has run away."""
        if at.squares > SETTINGS.fit_run_away * self.count:
            return
        x = at.x
        directions = Directions(at.problem, at.each, at.predictions, self.spread)
        matrix, gradient = directions.normal(at.residuals)
        if not (np.isfinite(matrix).all() and np.isfinite(gradient).all()):
            return
        pull = gradient[: x.size] - self.precision * x
        free = ~(((x <= self.low) & (pull < 0)) | ((x >= self.high) & (pull > 0)))
        lay = directions.layout
        offsets = np.zeros(lay.size)
        for k, drift in enumerate(at.drift if self.spread else ()):
            first = lay.unknowns + k * lay.per_session
            offsets[first : first + drift.size] = drift
        at.quadratic = Quadratic(
            lay, matrix, gradient, at.squares, x, self.precision, free, self.problem.even, offsets, self.count
        )
        self._weigh(at)

    def _weigh(self, at: _At) -> None:
        """The objective with drift and discrepancy of the present sizes integrated out."""
        assert at.quadratic is not None
        n = at.x.size
        matrix, gradient = at.quadratic.system(self.sizes)
        at.factor = linalg.cholesky(matrix[n:, n:], lower=True, check_finite=False)
        taken = linalg.solve_triangular(at.factor, gradient[n:], lower=True, check_finite=False)
        log_det = 2.0 * float(np.sum(np.log(np.diag(at.factor)))) + self.count * float(np.log(self.sizes.noise))
        prior = float(self.precision @ at.x**2)
        at.chi2 = at.quadratic.at(self.sizes) - prior - float(taken @ taken)
        at.objective = at.chi2 + log_det + prior

    def resize(self) -> None:
        """The sizes of drift and discrepancy that suit where it stands."""
        if self.at.quadratic is None:
            self._linearise(self.at)
        q = self.at.quadratic
        if q is not None and q.layout.size > q.x.size:
            self.sizes = q.climbed(self.sizes, self.known)
            self._weigh(self.at)

    def climb(self, max_iterations: int, tolerance: float) -> None:
        """Steps until they gain little."""
        damping = 1e-3
        for k in range(max_iterations):
            if self.at.quadratic is None:
                self._linearise(self.at)
            if k < 2 or k % 3 == 0:
                self.resize()
            if self.at.quadratic is None:
                break
            before = self.at.objective
            damping = self._step(damping, self.at.quadratic)
            gain = before - self.at.objective
            # A residual of many times the noise needs no exact optimum.
            far = self.at.chi2 * self.sizes.noise > SETTINGS.fit_hopeless * self.count
            least = max(tolerance, SETTINGS.fit_hopeless_gain) if far else tolerance
            if gain < SETTINGS.fit_gain + least * max(self.at.objective - 0.9 * self.count, 0.0):
                break

    def _step(self, damping: float, quadratic: Quadratic) -> float:
        """One step, damped until it gains; the damping that served, eased."""
        n, x = self.at.x.size, self.at.x
        matrix, gradient = quadratic.system(self.sizes)
        beside = np.full(matrix.shape[0] - n, np.inf)
        low, high = np.concatenate([self.low, -beside]), np.concatenate([self.high, beside])
        start = np.concatenate([x, np.zeros(beside.size)])
        for _ in range(8):
            step = np.clip(start + _step(matrix, gradient, damping, start, low, high), low, high) - start
            try:
                trial = self.evaluated(x + step[:n], self._drifted(step[n:]))
            except (CutvibError, np.linalg.LinAlgError):
                damping *= 10
                continue
            if np.isfinite(trial.objective) and trial.objective < self.at.objective:
                self.at = trial
                return max(damping / 10, 1e-9)
            damping *= 10
        return damping

    def _drifted(self, step: FloatArray) -> FloatArray:
        """Drifts of the sessions after a step in all directions, kept within what their size allows."""
        lay = self.at.quadratic.layout if self.at.quadratic is not None else None
        if lay is None or not lay.sessions:
            return self.at.drift
        own = step[: lay.first_nominal - lay.unknowns].reshape(len(self.at.drift), -1)[:, : self.drifting.size]
        size = np.repeat([self.sizes.drift, self.sizes.within], [self.n_sessions, len(own) - self.n_sessions])[:, None]
        most = SETTINGS.likelihood_farthest_drift * size
        followed = np.clip(self.at.drift + size * own, -most, most)
        # What is small moves a response in proportion, as its directions say.
        return np.where(size > SETTINGS.predictive_small_drift, followed, 0.0)


def _step(
    matrix: FloatArray, gradient: FloatArray, damping: float, x: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """A damped step that leaves alone the unknowns that a bound holds."""
    held = ((x <= low) & (gradient < 0)) | ((x >= high) & (gradient > 0))
    free = ~held
    inner = matrix[np.ix_(free, free)]
    # Unknowns of unlike size: equilibrated, the system is as well conditioned as its physics.
    size = np.sqrt(np.diag(inner) + 1e-12)
    scaled = inner / np.outer(size, size) + damping * np.eye(size.size)
    step = np.zeros(x.size)
    step[free] = linalg.solve(scaled, gradient[free] / size, assume_a="sym") / size
    return step


def _finished(problem: Problem, search: _Search, quadratic: Quadratic) -> Fit:
    x = search.at.x
    index, even = np.arange(problem.first_effect, problem.size), np.flatnonzero(problem.even)
    own, pull = quadratic.system(search.sizes)
    # An even prior over a unit range knows a parameter to no better than its range.
    own[even, even] += 12.0
    size = np.sqrt(np.diag(own))
    covariance = linalg.inv(own / np.outer(size, size)) / np.outer(size, size)
    offsets = np.zeros(own.shape[0])
    if own.shape[0] > problem.size:
        inner = slice(problem.size, None)
        offsets[inner] = quadratic.offsets[inner] / quadratic.layout.scale(search.sizes)[inner]
        offsets[inner] += solved(own[inner, inner], pull[inner])
    correlation = 1.0
    if search.spread:
        step = np.zeros(own.shape[0])
        step[problem.size :] = offsets[problem.size :]
        scale = quadratic.layout.scale(search.sizes)
        step[problem.size :] -= quadratic.offsets[problem.size :] / scale[problem.size :]
        directions = Directions(search.at.problem, search.at.each, search.at.predictions, like=quadratic.layout)
        correlation = directions.correlation(search.at.residuals, step * scale)
    stds = {}
    for i, (k, name, r) in enumerate(problem.parameters):
        j = problem.first_effect + i
        stds[f"{k}.{name}"] = abs(from_unknown(float(x[j]), r)[1]) * float(np.sqrt(covariance[j, j]))
    at_end = tuple(
        f"{k}.{name}"
        for (k, name, r), value in zip(problem.parameters, x[index], strict=True)
        if not r.limits and r.scale != "normal" and (value >= 1.0 or (value <= 0.0 and r.low != r.minimum))
    )
    return Fit(
        hypothesis=replace(problem.hypothesis, effects=problem.effects(x)),
        model=problem.applied(x),
        tuned=problem.tuned(x),
        x=x,
        first_effect=problem.first_effect,
        covariance=covariance[: problem.size, : problem.size],
        chi2=search.at.chi2,
        count=search.count,
        objective=search.at.objective,
        # Per parameter of the effect the Gaussian integral gains √(2π); the nuisances share theirs with every hypothesis.
        log_evidence=quadratic.summed(search.sizes, search.known),
        stds=stds,
        at_end=at_end,
        correlation=correlation,
        spread=Spread(quadratic.layout, search.sizes, offsets, own),
    )
