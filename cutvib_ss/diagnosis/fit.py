"""
One hypothesis fitted to measured responses: effect, tuning within tolerance, and calibration, all at once.

The maximum of the posterior is found by Gauss-Newton steps with analytic derivatives, and the evidence is Laplace's around it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.climb import Beside, Climb
from cutvib_ss.diagnosis.closest import closest_by_quadratic, closest_simulated
from cutvib_ss.diagnosis.drifted import problems_of
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.level_trend import evidence_of_trend
from cutvib_ss.diagnosis.likelihood import EVEN, Quadratic, solved
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.problem import Derivatives, Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.starts import at_instants
from cutvib_ss.diagnosis.unknowns import from_unknown
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.errors import CutvibError, DiagnosisError
from cutvib_ss.results import FloatArray


@dataclass(frozen=True)
class Fit:
    """A fitted hypothesis."""

    hypothesis: Hypothesis  # With its effects at their fitted values
    model: Model  # Tuned, with the effects
    tuned: Model  # The tuning alone
    x: FloatArray  # Fitted unknowns: tuning, calibration, instant of the blow, effects (transformed)
    n_tuning: int  # How many of them are tuned values
    first_effect: int  # Where the effects' unknowns begin
    covariance: FloatArray  # Posterior covariance of the unknowns
    # Weighted squares of the residuals, drift and discrepancy integrated out, the scatter of merged records included
    chi2: float
    count: int  # Real data
    objective: float  # χ² with the priors' squares and the determinants: comparable between hypotheses
    log_evidence: float  # Logarithm of the Laplace evidence, up to a constant shared by all hypotheses on the same data
    stds: Mapping[str, float]  # Standard deviation of each effect's parameter, in order ``<index>.<name>``
    stds_beside: Mapping[str, float]  # The same with errors of single parts of a structure as they are
    # Parameters of the effects that lie at an end of their range, ``<index>.<name>``, where other values lie beyond
    at_end: tuple[str, ...]
    correlation: float  # Number of residuals that tell the same thing; 1 where they are white
    spread: Spread  # Drift and discrepancy: their sizes, and what the records say of them
    shared_precision: FloatArray  # Of the priors of the unknowns that all hypotheses share, those before the effects'
    # Unknowns that are the constant part of each channel's calibration error, real and imaginary, in tolerances
    constant: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    derivatives: Derivatives = "no"  # By simulation beside a restoring force; those of fits near it are as good
    # The same at unknowns of the model that is closest to the records without the discrepancy inferred beside it
    closest: Fit | None = None

    @property
    def corrected(self) -> Fit:
        """At the values with which its model is used, for nobody adds the discrepancy then."""
        return self if self.closest is None else self.closest

    @property
    def reduced(self) -> float:
        """χ² per datum against the noise as stated, drift and discrepancy integrated out."""
        return self.chi2 * self.spread.sizes.noise / self.count

    @property
    def stds_of_effects(self) -> tuple[Mapping[str, float], ...]:
        """Of each effect the standard deviations of its parameters."""
        return tuple(
            {name.partition(".")[2]: std for name, std in self.stds.items() if name.startswith(f"{k}.")}
            for k in range(len(self.hypothesis.effects))
        )

    @property
    def of_no_size(self) -> tuple[Effect, ...]:
        """
        Effects of which the size's interval holds nothing: only an error of theirs, the discrepancy, may be what is seen.

        What errors of single parts may take up in its place is for the evidence to weigh: they are taken as they are.
        """
        out = []
        for k, e in enumerate(self.hypothesis.effects):
            sizes = [(abs(size), self.stds_beside.get(f"{k}.{name}", 0.0)) for name, size in e.by_size().items()]
            if sizes and all(size < SETTINGS.verdict_size * std for size, std in sizes):
                out.append(e)
        return tuple(out)

    @property
    def tolerated(self) -> tuple[Effect, ...]:
        """Effects no larger than the part or channel that they sit on may differ by itself, within its tolerance."""
        return tuple(e for e in self.hypothesis.effects if e.tolerated(self.tuned))

    @property
    def tuned_away(self) -> bool:
        """Whether some tuned value lies far out of its tolerance."""
        return bool(np.any(np.abs(self.x[: self.n_tuning]) > SETTINGS.fit_tuned_away))

    @property
    def tuned_out(self) -> bool:
        """Whether some tuned value lies out of any tolerance."""
        return bool(np.any(np.abs(self.x[: self.n_tuning]) > SETTINGS.fit_strained))

    @property
    def tuned_as_a_whole(self) -> bool:
        """Whether tuned values lie far out of their tolerances all together, by their root mean square."""
        return bool(self.n_tuning and np.mean(self.x[: self.n_tuning] ** 2) > SETTINGS.fit_tuned_away**2)

    @property
    def taken_up(self) -> bool:
        """Whether drift or errors of single parts, the largest of their priors, may have taken up what a cause does."""
        return self.spread.largest("drift") or self.spread.largest("parts")

    @property
    def gains(self) -> dict[str, float]:
        """Of each channel the constant part of its calibration error, the larger of real and imaginary, in tolerances."""
        return {c: float(np.abs(self.x[list(own)]).max()) for c, own in self.constant.items()}

    @property
    def calibrated_away(self) -> frozenset[str]:
        """Channels whose gain or phase lies far out of its tolerance."""
        return frozenset(c for c, size in self.gains.items() if size > SETTINGS.fit_tuned_away)

    @property
    def beyond_belief(self) -> bool:
        """
        Whether it stands only because the model errs by more than is believed.

        The discrepancies of both the nominal model and a cause are the largest of their priors, or all tuned values are far out of
        their tolerances, or beside a restoring force, which takes no other linear cause up, one is out of any tolerance.
        """
        strained = self.tuned_as_a_whole or (self.tuned_out and not self.hypothesis.linear)
        return self.spread.at_largest or strained


def fit(
    nominal: Model,
    records: Records,
    hypothesis: Hypothesis,
    warm: FloatArray | None = None,
    max_iterations: int = 40,
    tolerance: float = 1e-5,
    near: Fit | None = None,
    rival: float = np.inf,
) -> Fit:
    """
    Maximum of the posterior of a hypothesis, and its evidence.

    A climb whose pace does not lead to the objective of a `rival` on the same records ends where it is.

    Levenberg-Marquardt on the normal equations: 40 unknowns against 10⁴ to 10⁵ data make their forming the only cost, and a
    general least squares solver's factorisation of the full Jacobian twenty times more expensive. Effects' unknowns are kept
    within their ranges by projection. Evidence: χ²/2 + Σ prior²/2 + ½ ln det(JᵀWJ + P), the even priors being one in unit
    coordinates.
    """
    search, alone = _started(nominal, records, hypothesis, warm, max_iterations, tolerance, near, rival)
    problem = search.drifted.problems[0]
    # From beside the optimum once is enough.
    redrawn = not problem.apart and near is None
    passes = SETTINGS.fit_passes if redrawn and max_iterations > SETTINGS.fit_scout_steps else 1
    if not hypothesis.linear and search.spread and max_iterations > SETTINGS.fit_scout_steps:
        known = near is not None and near.hypothesis.causes == hypothesis.causes
        for own in search.drifted.problems:
            own.by_simulation = _derivatives(hypothesis, near)
        search.take_form(near.spread.layout.form if near is not None and known else None)
    for _ in range(passes):
        before = search.at.objective
        search.climb(max_iterations, tolerance)
        if passes > 1:
            # The circles were drawn for the first model of the pass; drawn anew they may show that it goes on.
            search.redraw()
        if before - search.at.objective < 1.0:
            break
    search.resize()
    quadratic = search.quadratic
    if search.at.quadratic is None or quadratic is None or not np.isfinite(search.at.objective):
        raise DiagnosisError(f"{hypothesis.effect} at {hypothesis.place} runs away from where it starts")
    made = _finished(problem, search, quadratic)
    made = replace(made, log_evidence=made.log_evidence + evidence_of_trend(made.spread, records))
    closest = search.at.x
    if hypothesis.linear:
        closest = closest_by_quadratic(search, search.at.quadratic, made.spread.offsets)
    elif search.spread and alone is not None and not search.beaten:
        closest = closest_simulated(search, alone, max_iterations, tolerance)
    return made if np.array_equal(closest, made.x) else _with_closest(made, problem, closest)


def led_by_the_model(nominal: Model, records: Records, made: Fit) -> Fit:
    """
    A linear fit, or one from where its model alone comes closest to the records, where that is better.

    Far from the optimum (at another instant of the blow) a discrepancy takes up what the model leaves, and the steps end there.
    Where the model by itself leaves little it needs none.
    """
    if made.spread.sizes.nominal <= SETTINGS.sizes["nominal"][0][0]:
        return made

    def alone(on: Records, x: FloatArray) -> Climb:
        problems = problems_of(nominal, on, made.hypothesis, False)
        climb = Climb(problems, x, False, _beside(problems[0], on))
        climb.climb(SETTINGS.search_most_steps, SETTINGS.search_coarse_gain)
        return climb

    few = records.coarse(SETTINGS.search_coarse_lines, 0.0)
    try:
        starts = at_instants(problem_for(nominal, few, made.hypothesis), made.corrected.x, SETTINGS.fit_instants)
        best = min((alone(few, x) for x in starts), key=lambda climb: climb.at.objective)
        closest = alone(records, best.at.x)
        if closest.at.chi2 > SETTINGS.verdict_misfit * closest.count:
            return made
        again = fit(nominal, records, made.hypothesis, closest.at.x)
    except (CutvibError, np.linalg.LinAlgError):
        # Without a discrepancy it may run away, where the model is far off.
        return made
    return again if again.log_evidence > made.log_evidence else made


def _started(
    nominal: Model,
    records: Records,
    hypothesis: Hypothesis,
    warm: FloatArray | None,
    steps: int,
    tolerance: float,
    near: Fit | None,
    rival: float,
) -> tuple[Climb, FloatArray | None]:
    """Where the climb begins; beside a restoring force also unknowns of the model by itself, without a discrepancy."""
    # Beside a widened noise drift and discrepancy are nothing.
    spread = not records.widened
    problems = problems_of(nominal, records, hypothesis, spread)
    problem = problems[0]
    search = Climb(
        problems, problem.start(warm), spread, _beside(problem, records), None if near is None else near.spread, rival
    )
    if warm is not None and near is None:
        # Few lines with a widened noise may have led away from a model that is right as it was given.
        search.try_from(problem.start(None))
    if hypothesis.linear and not records.rough and near is None:
        search.start_from(_from_afar(nominal, records, hypothesis, search))
        if not problem.apart and steps > SETTINGS.fit_scout_steps:
            search.continue_from(_on_fewer_lines(nominal, records, hypothesis, search, steps, tolerance))
    alone = None
    if near is not None and near.hypothesis.causes == hypothesis.causes and not hypothesis.linear:
        alone = problem_for(nominal, records, near.corrected.hypothesis).start(near.corrected.x)
    if not hypothesis.linear and search.spread and steps > SETTINGS.fit_scout_steps:
        # The residual of a restoring force far from its optimum would pass for a large discrepancy, in whose side minima the steps
        # end. Neighbouring lines tell much the same.
        few = records.coarse(SETTINGS.fit_fewer_lines, 0.0)
        fewer = problems_of(nominal, few, hypothesis, False)
        plain = Climb(fewer, search.at.x, False, _beside(fewer[0], few))
        plain.climb(steps, tolerance)
        if near is None and hypothesis.touches and not records.leaking:
            plain = _by_simulation(fewer, few, plain, steps, tolerance)
        search.start_from(plain)
        alone = plain.at.x
    return search, alone


def _by_simulation(problems: Sequence[Problem], records: Records, start: Climb, steps: int, tolerance: float) -> Climb:
    """The same climb with all derivatives by simulation, from where those of the equivalent stiffness lead no further."""
    # That of a clearance changes with what is tuned by as much as with the gap: the steps end beside the valley of the two.
    for problem in problems:
        problem.by_simulation = "of all blows"
    search = Climb(problems, start.at.x, False, _beside(problems[0], records))
    search.climb(steps, tolerance)
    return search


def _derivatives(hypothesis: Hypothesis, near: Fit | None) -> Derivatives:
    """How derivatives are taken: restoring forces at two ports would take ten times as long as at one."""
    if not hypothesis.at_one_port:
        return "no"
    return "of one blow" if near is None or near.derivatives == "no" else near.derivatives


def _beside(problem: Problem, records: Records) -> Beside:
    known = all(e.estimator.scatter_seen for e in records.entries)
    if problem.apart or records.moving:
        return Beside(0.0, 0, known)
    total = sum(e.count for e in records.entries)
    return Beside(records.scatter, total - problem.count, known)


def _from_afar(nominal: Model, records: Records, hypothesis: Hypothesis, start: Climb) -> Climb:
    """Unknowns and drifts on few lines with a widened noise."""
    # A session that drifts by more than a resonance is wide is caught in a side minimum when the noise is small.
    few = records.coarse(SETTINGS.fit_start_lines, SETTINGS.fit_start_error)
    problems = problems_of(nominal, few, hypothesis, True)
    search = Climb(problems, start.at.x, True, _beside(problems[0], few))
    search.climb(SETTINGS.fit_scout_steps, SETTINGS.fit_start_gain)
    return search


def _on_fewer_lines(
    nominal: Model, records: Records, hypothesis: Hypothesis, start: Climb, steps: int, tolerance: float
) -> Climb:
    """The same fit on some of the lines, as measured: neighbours tell much the same of the unknowns, and cost as much."""
    few = records.coarse(SETTINGS.fit_fewer_lines, 0.0)
    problems = problems_of(nominal, few, hypothesis, True)
    search = Climb(problems, start.at.x, True, _beside(problems[0], few))
    search.start_from(start)
    search.climb(steps, tolerance)
    return search


def _finished(problem: Problem, search: Climb, quadratic: Quadratic) -> Fit:
    x = search.at.x
    index, even = np.arange(problem.first_effect, problem.size), np.flatnonzero(problem.even)
    unit = quadratic.layout.scale(search.sizes)[: problem.size]
    own, pull = quadratic.system(search.sizes)
    # An even prior over a unit range knows a parameter to no better than its range.
    own[even, even] += EVEN
    size = np.sqrt(np.diag(own))
    unique = own / np.outer(size, size) + SETTINGS.likelihood_precision_floor * np.eye(size.size)
    covariance = linalg.inv(unique) / np.outer(size, size)
    parts = [*problem.parts.matrices, *problem.parts.losses]
    free = np.setdiff1d(np.arange(size.size), parts)
    beside = np.diag(linalg.inv(unique[np.ix_(free, free)])) / size[free] ** 2 if parts else np.diag(covariance)
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
        reduced = search.at.chi2 * search.sizes.noise / search.count
        assert search.at.directions is not None
        correlation = search.at.directions.correlation(search.at.residuals, step * scale, reduced)
    stds, stds_beside, of_priors = {}, {}, 0.0
    for i, (k, name, r) in enumerate(problem.parameters):
        j = problem.first_effect + i
        value, slope = from_unknown(float(x[j]), r)
        stds[f"{k}.{name}"] = std = abs(slope) * float(np.sqrt(covariance[j, j]))
        stds_beside[f"{k}.{name}"] = abs(slope) * float(np.sqrt(beside[np.searchsorted(free, j)]))
        if r.scale in ("asinh", "ratio"):
            # Its prior is not even in the coordinate in which it was fitted.
            of_priors += float(np.log(max(abs(slope) * r.density(value, std), 1e-300)))
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
        n_tuning=problem.n_tuning,
        first_effect=problem.first_effect,
        covariance=covariance[: problem.size, : problem.size] * np.outer(unit, unit),
        chi2=search.at.chi2,
        count=search.count,
        objective=search.at.objective,
        # Per parameter of the effect the Gaussian integral gains √(2π); the nuisances share theirs with every hypothesis.
        log_evidence=quadratic.summed(search.sizes, search.known) + of_priors,
        shared_precision=(quadratic.precision / unit**2)[: problem.first_effect],
        stds=stds,
        stds_beside=stds_beside,
        at_end=at_end,
        correlation=correlation,
        constant=problem.constant_gains,
        derivatives=problem.by_simulation,
        spread=Spread(quadratic.layout, search.sizes, offsets, own),
    )


def _with_closest(made: Fit, problem: Problem, x: FloatArray) -> Fit:
    """A fit that knows at which unknowns its model is closest to the records by itself."""
    try:
        return replace(
            made,
            closest=replace(
                made,
                hypothesis=replace(problem.hypothesis, effects=problem.effects(x)),
                model=problem.applied(x),
                tuned=problem.tuned(x),
                x=x,
            ),
        )
    except CutvibError:
        return made
