"""
Simulation-based calibration: where true values lie in the posterior of the true hypothesis.

The rig draws a machine within its tolerances, a cause in the catalogue's form, and how it is measured; the true cause is fitted,
from its true values. If likelihood, priors and Laplace's approximation are right, the posterior probability below a true value is
uniform over many draws (Talts, Betancourt, Simpson, Vehtari and Gelman 2018, "Validating Bayesian inference algorithms with
simulation-based calibration", arXiv 1804.06788). Whether the right cause is found among all, and with which probability, is for the
trial to say (`score`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from cutvib_ss.diagnosis.campaign_search import observe_campaign
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.unknowns import to_unknown
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.model.paths import value_at
from cutvib_ss.results import FloatArray
from cutvib_ss.validation.rig import Case, draw_case, write_campaign
from cutvib_ss.validation.rig.causes import FORMS
from cutvib_ss.validation.rig.motion import NotConvergedError
from cutvib_ss.validation.rig.structure import Rig
from cutvib_ss.validation.statistics import Estimate, proportion
from cutvib_ss.validation.trial import REDRAWS

CENTRAL = (0.5, 0.9)
"""Central intervals whose coverage is counted."""

LINEAR = tuple(cause for cause in FORMS if EFFECTS[cause].linear)
"""Causes that are drawn by default: those whose fit takes seconds."""


@dataclass(frozen=True)
class Rank:
    """A true value in its posterior."""

    cause: str  # The cause that was drawn
    parameter: str  # Parameter of the cause, or value of the nominal model
    tuned: bool  # Whether it is one of the nominal model, within its tolerance
    posterior: float  # Posterior probability below the true value
    stated: float  # The same about the value that is stated: that of the closest model without its discrepancy


@dataclass(frozen=True)
class Coverage:
    """How often intervals hold the truth, of some values."""

    name: str  # Cause, or what the values have in common
    values: int  # How many there are
    posterior: tuple[Estimate, ...]  # Part of them within each of `CENTRAL`
    stated: tuple[Estimate, ...]


def draw_ranks(
    cases: int,
    seed: int,
    causes: Sequence[str] = LINEAR,
    severity: tuple[float, float] = (0.3, 2.0),
    small: Mapping[str, Any] | None = None,
    jobs: int = 1,
) -> tuple[Rank, ...]:
    """
    Draw cases, causes in turn, and fit each one's true cause.

    Parameters
    ----------
    cases : int
        How many.
    seed : int
        Of all of them.
    causes : sequence of str
        Effect ids, by default all linear ones that the rig has in several forms.
    severity : (float, float)
        Range of severities, drawn evenly in their logarithm.
    small : mapping, optional
        Conditions of the measurement to fix instead of drawing them.
    jobs : int
        Cases at a time.

    Returns
    -------
    tuple of Rank
        Of every parameter of the causes and every tuned value.

    Raises
    ------
    ParameterError
        If a cause is not known, there are no cases, or the rig can integrate the motion of no machine with a cause.
    """
    if cases < 1:
        raise ParameterError(f"{cases} cases: there must be at least one")
    if unknown := [c for c in causes if c not in FORMS]:
        raise ParameterError(f"cause {unknown[0]!r}: known are {', '.join(FORMS)}")
    seeds = np.random.SeedSequence(seed).generate_state(cases, np.uint32).tolist()
    of_case = partial(_ranks_of_case, severity=severity, small=small)
    with Workers(jobs) as workers:
        found = workers.map(of_case, seeds, [causes[k % len(causes)] for k in range(cases)])
    return tuple(rank for own in found for rank in own)


def coverage(ranks: Sequence[Rank]) -> tuple[Coverage, ...]:
    """How often intervals hold the truth: of all parameters of causes, of all tuned values, and of each cause."""
    groups = {
        "parameters of causes": [r for r in ranks if not r.tuned],
        "tuned values": [r for r in ranks if r.tuned],
    }
    groups |= {
        cause: [r for r in ranks if r.cause == cause and not r.tuned] for cause in dict.fromkeys(r.cause for r in ranks)
    }
    return tuple(_coverage(name, own) for name, own in groups.items())


def _coverage(name: str, ranks: Sequence[Rank]) -> Coverage:
    def within(values: Sequence[float]) -> tuple[Estimate, ...]:
        return tuple(proportion([abs(2.0 * v - 1.0) <= part for v in values]) for part in CENTRAL)

    return Coverage(name, len(ranks), within([r.posterior for r in ranks]), within([r.stated for r in ranks]))


def to_dict(ranks: Sequence[Rank]) -> dict[str, Any]:
    """Ranks and coverage as plain data."""

    def parts(estimates: Sequence[Estimate]) -> list[dict[str, float]]:
        return [
            {"central": part, "covered": e.value, "low": e.low, "high": e.high}
            for part, e in zip(CENTRAL, estimates, strict=True)
        ]

    rows = [
        {"name": c.name, "values": c.values, "posterior": parts(c.posterior), "stated": parts(c.stated)}
        for c in coverage(ranks)
    ]
    each = [
        {"cause": r.cause, "parameter": r.parameter, "tuned": r.tuned, "posterior": r.posterior, "stated": r.stated}
        for r in ranks
    ]
    return {"schema": "cutvib-ranks/1", "coverage": rows, "ranks": each}


def _ranks_of_case(
    seed: int, cause: str, severity: tuple[float, float], small: Mapping[str, Any] | None
) -> tuple[Rank, ...]:
    with tempfile.TemporaryDirectory(prefix="cutvib-") as folder:
        case = _written(seed, cause, severity, small, Path(folder))
        campaign = read_campaign(Path(folder))
        nominal: Model = campaign.machine
        observed = observe_campaign(campaign, nominal)
    (fault,) = case.faults
    records = Records(observed.entries)
    variants = _variants(nominal, observed.band, observed.channels, cause, fault.place, fault.parameters)
    made = max((fit(nominal, records, Hypothesis((e,))) for e in variants), key=lambda f: f.log_evidence)
    problem = Problem(nominal, records.merged, made.hypothesis)
    true = {
        made.first_effect + i: (name, False, to_unknown(float(fault.parameters[name]), r))
        for i, (_, name, r) in enumerate(problem.parameters)
        if name in fault.parameters
    }
    if isinstance(case.plain, Rig):
        for k, (path, tolerance) in enumerate(problem.tuning):
            if isinstance(path[-1], str):
                name = path[-1]
                true[k] = name, True, float(np.log(case.plain.value(name) / value_at(nominal, path))) / tolerance
    return tuple(
        Rank(cause, name, tuned, _below(value, made, made.x, k), _below(value, made, made.corrected.x, k))
        for k, (name, tuned, value) in true.items()
    )


def _written(
    seed: int, cause: str, severity: tuple[float, float], small: Mapping[str, Any] | None, folder: Path
) -> Case:
    """A case and its campaign; drawn anew with the next seed, as in a trial, where the rig's integrator refuses a motion."""
    for again in range(REDRAWS + 1):
        case = draw_case(seed + again, "single", cause, severity, small, form=FORMS[cause][0].name)
        try:
            write_campaign(case, folder)
        except NotConvergedError as error:
            refused = error
        else:
            return case
    raise ParameterError(f"{cause}: the rig could integrate none of {REDRAWS + 1} draws ({refused})")


def _below(true: float, made: Fit, x: FloatArray, k: int) -> float:
    """Posterior probability below the true value of an unknown."""
    return float(stats.norm.cdf((true - x[k]) / np.sqrt(made.covariance[k, k])))


def _variants(
    nominal: Model,
    band: tuple[float, float],
    channels: Sequence[str],
    cause: str,
    place: str,
    true: Mapping[str, object],
) -> tuple[Effect, ...]:
    """The cause at its true values, once for each choice that its label leaves open."""
    kind = EFFECTS[cause]
    known = {f.name: true[f.name] for f in fields(kind) if f.name in true}
    starts = [e for c in candidates(nominal, band, channels) for e in c.starts if (e.effect, e.place) == (cause, place)]
    return tuple(dict.fromkeys(e.changed(known) for e in starts)) or (kind(place, **known),)
