"""
One hypothesis fitted to measured responses: effect, tuning within tolerance, and calibration, all at once.

The maximum of the posterior is found by Gauss-Newton steps with analytic derivatives, and the evidence is Laplace's around it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError, DiagnosisError
from cutvib_ss.gap.hypothesis import Hypothesis
from cutvib_ss.gap.problem import Problem
from cutvib_ss.gap.records import Records
from cutvib_ss.gap.simulation import SimulatedProblem, problem_for
from cutvib_ss.gap.unknowns import from_unknown
from cutvib_ss.results import FloatArray

FEW_STEPS = 10
"""A fit of no more steps is a scout: it climbs once."""
GAIN = 0.1
"""Gain of the objective at which steps end: a twentieth of what tells two causes apart by a factor of e."""
PASSES = 4
"""Times that any other fit climbs at most."""


@dataclass(frozen=True)
class Fit:
    """
    A fitted hypothesis.

    Parameters
    ----------
    hypothesis : Hypothesis
        With its effects at their fitted values.
    model : Machine or Structure
        Tuned, with the effects.
    tuned : Machine or Structure
        The tuning alone.
    x : ndarray
        Fitted unknowns: tuning, calibration, instant of the blow, effects (transformed).
    first_effect : int
        Where the effects' unknowns begin.
    covariance : ndarray
        Posterior covariance of the unknowns.
    chi2 : float
        Weighted squares of what the data leave, without the priors.
    aside : float
        Scatter of levels about their mean in that, where records stay apart; zero where they are merged.
    count : int
        Real data.
    objective : float
        χ² with the priors' squares, less the scatter of levels about their mean where records stay apart: comparable between
        hypotheses.
    log_evidence : float
        Logarithm of the Laplace evidence, up to a constant shared by all hypotheses on the same data.
    stds : mapping of str to float
        Standard deviation of each effect's parameter, in order ``<index>.<name>``.
    at_end : tuple of str
        Parameters of the effects that lie at an end of their range, ``<index>.<name>``, where other values lie beyond.
    """

    hypothesis: Hypothesis
    model: Model
    tuned: Model
    x: FloatArray
    first_effect: int
    covariance: FloatArray
    chi2: float
    aside: float
    count: int
    objective: float
    log_evidence: float
    stds: Mapping[str, float]
    at_end: tuple[str, ...]


def fit(
    nominal: Model,
    records: Records,
    hypothesis: Hypothesis,
    warm: FloatArray | None = None,
    max_iterations: int = 40,
    tolerance: float = 1e-5,
) -> Fit:
    """
    Maximum of the posterior of a hypothesis, and its evidence.

    Parameters
    ----------
    nominal : Machine or Structure
        The nominal model.
    records : Records
        Measured responses.
    hypothesis : Hypothesis
        What is fitted; its effects' values are the start.
    warm : ndarray, optional
        Unknowns of a fit without effects, to start from.
    max_iterations : int
        Most steps taken.
    tolerance : float
        Relative gain of the objective at which steps end.

    Returns
    -------
    Fit
        The fit.

    Notes
    -----
    Levenberg-Marquardt on the normal equations: 40 unknowns against 10⁴ to 10⁵ data make their forming the only cost, and a
    general least squares solver's factorisation of the full Jacobian twenty times dearer. Effects' unknowns are kept
    within their ranges by projection. Evidence: χ²/2 + Σ prior²/2 + ½ ln det(JᵀWJ + P), the even priors being one in unit
    coordinates.
    """
    problem = problem_for(nominal, records, hypothesis)
    search = _Search(problem, problem.start(warm))
    redrawn = not isinstance(problem, SimulatedProblem)
    passes = PASSES if redrawn and max_iterations > FEW_STEPS else 1
    for _ in range(passes):
        before = search.objective
        search.climb(max_iterations, tolerance)
        if passes > 1:
            # The circles were drawn for the first model of the pass; drawn anew they may show that it goes on.
            search.redraw()
        if before - search.objective < 1.0:
            break
    # A scout's evidence is a bound: the matrix of its last step will do.
    if max_iterations > FEW_STEPS or search.matrix is None:
        matrix, _ = problem.normal(search.x, search.predictions, search.residuals)
    else:
        matrix = search.matrix
    if not np.isfinite(matrix).all() or not np.isfinite(search.objective):
        raise DiagnosisError(f"{hypothesis.effect} at {hypothesis.place} runs away from where it starts")
    # Records apart hold the scatter of their levels too, which merging has put aside.
    aside = records.scatter if isinstance(problem, SimulatedProblem) else 0.0
    return _finished(problem, search, matrix + np.diag(search.precision), aside)


class _Search:
    """Levenberg-Marquardt within bounds, from one point."""

    def __init__(self, problem: Problem, x: FloatArray) -> None:
        self.problem, self.x = problem, x
        self.precision = problem.prior_precision()
        self.low, self.high = problem.bounds()
        self.matrix: FloatArray | None = None
        self.redraw()

    def redraw(self) -> None:
        """Evaluate where it stands, with new circles around the slow poles."""
        self.problem.forget_circles()
        self.predictions, self.residuals, self.chi2 = self.problem.residuals(self.x)
        self.objective = self.chi2 + float(self.precision @ self.x**2)

    def climb(self, max_iterations: int, tolerance: float) -> None:
        """Steps until they gain little."""
        damping = 1e-3
        for _ in range(max_iterations):
            before = self.objective
            damping = self._step(damping)
            gain = before - self.objective
            if gain < GAIN + tolerance * max(self.objective - 0.9 * self.problem.count, 0.0):
                break

    def _step(self, damping: float) -> float:
        """One step, damped until it gains; the damping that served, eased."""
        matrix, gradient = self.problem.normal(self.x, self.predictions, self.residuals)
        self.matrix = matrix
        if not (np.isfinite(matrix).all() and np.isfinite(gradient).all()):
            # A law has run away: nothing leads on from here.
            return damping
        matrix, gradient = matrix + np.diag(self.precision), gradient - self.precision * self.x
        for _ in range(8):
            step = _step(matrix, gradient, damping, self.x, self.low, self.high)
            trial = np.clip(self.x + step, self.low, self.high)
            try:
                predictions, residuals, chi2 = self.problem.residuals(trial)
            except (CutvibError, np.linalg.LinAlgError):
                damping *= 10
                continue
            objective = chi2 + float(self.precision @ trial**2)
            if np.isfinite(objective) and objective < self.objective:
                self.x, self.predictions, self.residuals = trial, predictions, residuals
                self.chi2, self.objective = chi2, objective
                return max(damping / 10, 1e-9)
            damping *= 10
        return damping


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


def _finished(problem: Problem, search: _Search, matrix: FloatArray, aside: float) -> Fit:
    x = search.x
    # An even prior over a unit range knows a parameter to no better than its range.
    own = matrix.copy()
    index = np.arange(problem.first_effect, problem.size)
    own[index, index] += 12.0
    size = np.sqrt(np.diag(own))
    covariance = linalg.inv(own / np.outer(size, size)) / np.outer(size, size)
    _, log_det = np.linalg.slogdet(own)
    # Per parameter of the effect the Gaussian integral gains √(2π); the nuisances share theirs with every hypothesis.
    log_evidence = (
        -0.5 * (search.objective - aside) - 0.5 * float(log_det) + 0.5 * len(index) * float(np.log(2 * np.pi))
    )
    stds = {}
    for i, (k, name, r) in enumerate(problem.parameters):
        j = problem.first_effect + i
        stds[f"{k}.{name}"] = abs(from_unknown(float(x[j]), r)[1]) * float(np.sqrt(covariance[j, j]))
    at_end = tuple(
        f"{k}.{name}"
        for (k, name, r), value in zip(problem.parameters, x[index], strict=True)
        if not r.limits and (value >= 1.0 or (value <= 0.0 and r.low != r.minimum))
    )
    return Fit(
        hypothesis=replace(problem.hypothesis, effects=problem.effects(x)),
        model=problem.applied(x),
        tuned=problem.tuned(x),
        x=x,
        first_effect=problem.first_effect,
        covariance=covariance,
        chi2=search.chi2,
        aside=aside,
        count=problem.count,
        objective=search.objective - aside,
        log_evidence=log_evidence,
        stds=stds,
        at_end=at_end,
    )
