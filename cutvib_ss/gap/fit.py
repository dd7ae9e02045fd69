"""
One hypothesis fitted to measured responses: effect, tuning within tolerance, and calibration, all at once.

The maximum of the posterior is found by Gauss-Newton steps with analytic derivatives, and the evidence is Laplace's around it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.gap.observations import Group
from cutvib_ss.gap.problem import Hypothesis, Problem, from_unknown
from cutvib_ss.results import FloatArray

FEW_STEPS = 10
"""A fit of no more steps is a scout: its covariance is that of the last step but one."""


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
    covariance : ndarray
        Posterior covariance of the unknowns.
    chi2 : float
        Weighted squares of what the data leave, without the priors.
    objective : float
        χ² with the priors' squares.
    log_evidence : float
        Logarithm of the Laplace evidence, up to a constant shared by all hypotheses on the same data.
    stds : mapping of str to float
        Standard deviation of each effect's parameter, in order ``<index>.<name>``.
    at_bound : bool
        Whether a parameter of the effect lies on the end of its range.
    """

    hypothesis: Hypothesis
    model: Model
    tuned: Model
    x: FloatArray
    covariance: FloatArray
    chi2: float
    objective: float
    log_evidence: float
    stds: Mapping[str, float]
    at_bound: bool


def fit(
    nominal: Model,
    groups: Sequence[Group],
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
    groups : sequence of Group
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
    problem = Problem(nominal, groups, hypothesis)
    precision = problem.prior_precision()
    x = problem.start(warm)
    predictions, residuals, chi2 = problem.residuals(x)
    objective = chi2 + float(precision @ x**2)
    damping = 1e-3
    matrix = np.zeros((problem.size, problem.size))
    low, high = problem.bounds()
    for _ in range(max_iterations):
        matrix, gradient = problem.normal(x, predictions, residuals)
        gradient = gradient - precision * x
        matrix = matrix + np.diag(precision)
        accepted, gain = False, 0.0
        for _ in range(8):
            trial = np.clip(x + _step(matrix, gradient, damping, x, low, high), low, high)
            try:
                trial_predictions, trial_residuals, trial_chi2 = problem.residuals(trial)
            except (CutvibError, np.linalg.LinAlgError):
                damping *= 10
                continue
            trial_objective = trial_chi2 + float(precision @ trial**2)
            if np.isfinite(trial_objective) and trial_objective < objective:
                accepted, gain = True, objective - trial_objective
                x, predictions, residuals = trial, trial_predictions, trial_residuals
                chi2, objective = trial_chi2, trial_objective
                damping = max(damping / 10, 1e-9)
                break
            damping *= 10
        if not accepted or gain < 1e-2 + tolerance * (objective - 0.9 * problem.count):
            break
    if max_iterations > FEW_STEPS:
        problem.forget_circles()
        predictions, residuals, chi2 = problem.residuals(x)
        objective = chi2 + float(precision @ x**2)
        matrix, _ = problem.normal(x, predictions, residuals)
        matrix = matrix + np.diag(precision)
    return _finished(problem, x, matrix, chi2, objective)


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


def _finished(problem: Problem, x: FloatArray, matrix: FloatArray, chi2: float, objective: float) -> Fit:
    # An even prior over a unit range knows a parameter to no better than its range.
    own = matrix.copy()
    index = np.arange(problem.first_effect, problem.size)
    own[index, index] += 12.0
    size = np.sqrt(np.diag(own))
    covariance = linalg.inv(own / np.outer(size, size)) / np.outer(size, size)
    _, log_det = np.linalg.slogdet(own)
    # Per parameter of the effect the Gaussian integral gains √(2π); the nuisances share theirs with every hypothesis.
    log_evidence = -0.5 * objective - 0.5 * float(log_det) + 0.5 * len(index) * float(np.log(2 * np.pi))
    stds = {}
    for i, (k, name, r) in enumerate(problem.parameters):
        j = problem.first_effect + i
        stds[f"{k}.{name}"] = abs(from_unknown(float(x[j]), r)[1]) * float(np.sqrt(covariance[j, j]))
    edges = x[index]
    return Fit(
        hypothesis=Hypothesis(problem.effects(x)),
        model=problem.applied(x),
        tuned=problem.tuned(x),
        x=x,
        covariance=covariance,
        chi2=chi2,
        objective=objective,
        log_evidence=log_evidence,
        stds=stds,
        at_bound=bool(np.any((edges <= 0.0) | (edges >= 1.0))),
    )
