"""The diagnosis: a campaign and a nominal model in; where, which and how far out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from typing import NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

from cutvib_ss.diagnosis import cross_validation, where
from cutvib_ss.diagnosis.candidate_evidence import at_their_ends, evidence_of
from cutvib_ss.diagnosis.compared_responses import compared_responses
from cutvib_ss.diagnosis.detail import found
from cutvib_ss.diagnosis.directions import Sizes
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.held_out import HeldOut, share
from cutvib_ss.diagnosis.hypotheses import considered
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.limits import limits
from cutvib_ss.diagnosis.linearity import chance_of_order, confounded, level_stands_out
from cutvib_ss.diagnosis.mains_interference import mains, with_mains_interference
from cutvib_ss.diagnosis.metrics import Sides
from cutvib_ss.diagnosis.next_test import next_test
from cutvib_ss.diagnosis.observations import Observations, observe
from cutvib_ss.diagnosis.odd_records import ODD, odd_records
from cutvib_ss.diagnosis.place import Located, locate
from cutvib_ss.diagnosis.posterior import (
    Counts,
    judged_on_held_out,
    kind_of,
    of_known_form,
    probabilities,
    temperature,
    that_drift_by_chance,
)
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.repeatability import repeatability
from cutvib_ss.diagnosis.result import Cause, Diagnosis, FittedParameter, GapFigures, Where
from cutvib_ss.diagnosis.search import search, search_linear
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import ByLevel, unknown_places
from cutvib_ss.diagnosis.verdict import ambiguity_set, place_set, verdict
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model, parameter_fields
from cutvib_ss.errors import DiagnosisError, ParameterError
from cutvib_ss.measurement.records import Campaign

CONFOUNDED = (
    "every session has a level of its own: drift between sessions and a cause that depends on the level are confounded; "
    "measure two levels in one session, and state it (session)"
)
ORDERED = (
    "what drifts within the sessions goes with the level: a restoring force does that, or a machine that warms while each session "
    "is measured from soft to hard; measure one from hard to soft"
)
MAINS_INTERFERENCE = "the re-tuned model's residual lies on multiples of {:g} Hz: mains interference in the measurement"


def diagnose(
    campaign: Campaign,
    machine: Model | None = None,
    *,
    hold_out: float | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """
    Where the sim-to-real gap lies, which unmodelled effect causes it, and how far it shrinks once that is added.

    Parameters
    ----------
    campaign : Campaign
        The measurement.
    machine : Machine or Structure, optional
        The nominal model; by default the campaign's own.
    hold_out : float, optional
        Part of the positions left out in a fold, between 0 and 1; a third by default.
    seed : int
        Of the order in which positions are left out, and of the bootstrap.
    jobs : int
        Processes, among which independent fits are spread; the result does not depend on their number. With more than one a
        script needs its ``if __name__ == "__main__":``, since they are spawned.
    progress : callable, optional
        Is called with a line that says what is being done; what follows a colon in it is how far that has come.

    Returns
    -------
    Diagnosis
        The diagnosis, whatever it is.

    Raises
    ------
    DiagnosisError
        If the campaign cannot carry one.
    ParameterError
        If an argument is impossible.

    Notes
    -----
    Linear causes are fitted in the frequency domain, those that depend on the level by simulation in time.
    """
    if hold_out is not None and not 0.0 < hold_out < 1.0:
        raise ParameterError(f"hold_out = {hold_out} is a fraction: it must lie between 0 and 1")
    if jobs < 1:
        raise ParameterError(f"jobs = {jobs} must be at least 1")
    nominal: Model = campaign.machine if machine is None else machine
    if not campaign.records:
        raise DiagnosisError("the campaign holds no records")
    # Small matrices in many threads wait for each other.
    with threadpool_limits(1), Workers(jobs, progress) as workers:
        return _diagnosed(campaign, nominal, hold_out, seed, workers)


class _Searched(NamedTuple):
    """What a search found, and on which records."""

    observed: Observations
    records: Records  # Of these, those to fit on
    judged: Callable[[Ranked], HeldOut]  # Any hypothesis on held-out records
    ranked: tuple[Ranked, ...]  # The tuned nominal model, then causes by evidence


def _searched(
    campaign: Campaign, nominal: Model, observed: Observations, hold_out: float | None, seed: int, workers: Workers
) -> _Searched:
    """All hypotheses on all records but those that fit with no others."""
    linear = search_linear(nominal, _to_fit(observed), observed, workers)
    odd = odd_records(nominal, linear.records, linear.none, linear.ranked)
    if odd:
        observed = _without(campaign, observed, odd)
        linear = search_linear(nominal, _to_fit(observed), observed, workers)
    folds = cross_validation.folds(observed, hold_out, seed)
    judgements: dict[str, HeldOut] = {}

    def judged(r: Ranked) -> HeldOut:
        if r.name not in judgements:
            judgements[r.name] = HeldOut(r, cross_validation.judge(nominal, folds, r.fit, workers))
        return judgements[r.name]

    ranked = search(nominal, observed, linear, lambda r: judged(r).reduced, lambda r: judged(r).against_stated, workers)
    return _Searched(observed, linear.records, judged, ranked)


def _without(campaign: Campaign, observed: Observations, odd: Mapping[int, float]) -> Observations:
    """The observations without records that fit with no others."""
    return observed.without(odd, tuple(ODD.format(campaign.records[i].name, left) for i, left in odd.items()))


def _diagnosed(campaign: Campaign, nominal: Model, hold_out: float | None, seed: int, workers: Workers) -> Diagnosis:
    searched = _searched(campaign, nominal, observe(campaign, nominal), hold_out, seed, workers)
    linear = [r for r in searched.ranked[1:] if r.fit.hypothesis.linear]
    odd = odd_records(nominal, searched.records, searched.ranked[0], linear)
    if odd:
        # No single known cause left noise of the others, but two together do, or something unknown.
        searched = _searched(campaign, nominal, _without(campaign, searched.observed, odd), hold_out, seed, workers)
    observed, records, judged, ranked = searched
    fitted = list(records.entries)
    none, causes = ranked[0], ranked[1:]
    problem = Problem(nominal, records.merged, Hypothesis())
    known = considered(nominal, observed.band, observed.channels)
    # At each site an element of every amplitude, and where the level matters as many that depend on it.
    kinds = {isinstance(e, ByLevel) for r in ranked for e in r.fit.hypothesis.effects}
    sites = [place for each in {False, *kinds} for place in unknown_places(nominal, observed.channels, each)]
    variants = {**known, **{("unknown", p): len(SETTINGS.unknown_amplitudes) * sites.count(p) for p in sites}}
    counts = Counts(len(known), len(set(sites)))
    workers.say("judging causes on held-out records")
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    heat = temperature(judged(best))
    odds = judged_on_held_out(ranked, probabilities(ranked, counts, variants, heat), judged, heat)
    odds = of_known_form(ranked, odds, judged)
    odds = that_drift_by_chance(ranked, odds, lambda r: chance_of_order(r.fit.spread, records))
    shown = sorted(causes, key=lambda r: -odds[r.name])
    before = cross_validation.judge_as_given(nominal, observed, none.fit)
    tuned = judged(none)
    held = {"none": tuned}
    no_gap = odds["none"] > SETTINGS.verdict_sure
    for r in shown[: 1 if no_gap else SETTINGS.verdict_judged]:
        if odds[r.name] > 1e-3 or (r is shown[0] and not no_gap):
            held[r.name] = judged(r)
    nameless = kind_of(shown[0].fit.hypothesis) == "unknown"
    other = next(
        (
            r
            for r in shown
            if not _same_cause(r, shown[0]) and (nameless or r.name in held or r.fit.hypothesis.linear) and r.refined
        ),
        None,
    )
    if no_gap:
        other = next((r for r in shown if r.name in held), None)
    elif other is not None and other.name not in held:
        # However improbable, so that the reader sees what the choice is worth.
        held[other.name] = judged(other)
    first = none if odds["none"] >= max(odds[r.name] for r in causes) else shown[0]
    after = held[first.name]
    tuned_blow = problem.blow_at(none.fit.x)
    levels = where.level_dependence(fitted, none.fit.model, tuned_blow)
    by_level = bool(levels > SETTINGS.level_excess) or level_stands_out(records, none.fit.model, tuned_blow)
    located, interference = Located(), None
    if by_level or none.reduced > SETTINGS.search_enough:
        workers.say("locating the fault without a hypothesis")
        located = locate(nominal, none.fit, fitted, tuned_blow, by_level)
        interference = mains(nominal, none.fit, records)
        located = located if interference is None else with_mains_interference(located, interference)
    elsewhere = located.best if located.best != "none" else first.fit.hypothesis.place
    rest = Cause("unknown", elsewhere, max(1.0 - sum(odds.values()), 0.0))
    rows = _causes(none, shown, odds, rest, held, before, observed, after)
    interval = cross_validation.shrinkage_interval(before, after.records, seed)
    result = verdict(rows, interval[0] > 0.0, bool(first.fit.at_end))
    chosen = none.fit if result == "no_gap" else after.ranked.fit
    figures = _figures(observed, before, tuned, held[none.name] if result == "no_gap" else after, seed)
    remaining = [r for r in ranked if odds[r.name] > 0.02][:4]
    test = None
    if result == "ambiguous" and len(remaining) > 1:
        told = [f"{r.fit.hypothesis.effect} at {r.fit.hypothesis.place}" for r in remaining]
        test = next_test([r.fit.model for r in remaining], told, fitted, [odds[r.name] for r in remaining])
    workers.say("computing what the result means")
    places = _places(ranked, odds, rest)
    bands_hz = _bands(problem, none.fit, chosen.spread.sizes)
    second = other if first is shown[0] or no_gap else shown[0]
    sides = Sides(before, tuned.records, after.records, None if second is None else held[second.name].records)
    return Diagnosis(
        verdict=result,
        gap=figures,
        where=Where(
            place="none" if result == "no_gap" else places[0][0] if places[0][0] != "none" else places[1][0],
            places=places,
            bands_hz=bands_hz,
            by_position=where.by_position(tuned.records, observed.per_unit, after.records),
            by_channel=where.by_channel(tuned.records, observed.channels, observed.per_unit, after.records),
            level_dependent=by_level,
            place_set=place_set(places),
        ),
        causes=rows,
        ambiguity_set=ambiguity_set(rows),
        next_test=test,
        title=campaign.title,
        warnings=(
            *campaign.warnings,
            *observed.warnings,
            *([CONFOUNDED] if confounded(records) else []),
            *([ORDERED] if _ordered(chosen, records) else []),
            *([] if interference is None else [MAINS_INTERFERENCE.format(interference)]),
            *at_their_ends(chosen),
        ),
        nominal=nominal,
        corrected_machine=chosen.corrected.model,
        comparisons=compared_responses(nominal, none.fit.corrected, chosen.corrected, fitted),
        evidence=tuple(evidence_of(r, held[r.name].records if r.name in held else ()) for r in ranked),
        reduced_chi2=max(ranked, key=lambda r: r.fit.log_evidence).reduced,
        data_count=problem.count,
        sizes=_sizes(chosen),
        limits=limits(nominal, chosen, records, observed, counts),
        repeatability=repeatability(fitted),
        findings=found(nominal, chosen.corrected, records, result, observed, bands_hz, located, sides, seed),
    )


def _ordered(fit: Fit, records: Records) -> bool:
    """Whether a linear answer leaves drift that goes with the level."""
    return fit.hypothesis.linear and chance_of_order(fit.spread, records) < SETTINGS.level_drift


def _to_fit(observed: Observations) -> Records:
    """The records that are not only for judging; all, where there are no others."""
    return Records(tuple(e for e in observed.entries if not e.check) or observed.entries)


def _same_cause(one: Ranked, two: Ranked) -> bool:
    """Whether two candidates are variants of one cause."""
    a, b = one.fit.hypothesis, two.fit.hypothesis
    return (a.effect, a.place) == (b.effect, b.place)


def _causes(
    none: Ranked,
    shown: Sequence[Ranked],
    odds: dict[str, float],
    rest: Cause,
    held: dict[str, HeldOut],
    before: Sequence[cross_validation.Judged],
    observed: Observations,
    accepted: HeldOut,
) -> tuple[Cause, ...]:
    """All hypotheses as rows, variants of one cause together, and "unknown"."""
    start = cross_validation.mean_error(before)
    rows: dict[tuple[str, str], Cause] = {}
    for r in (none, *shown):
        key = (r.fit.hypothesis.effect, r.fit.hypothesis.place)
        if key in rows:
            # A variant (another channel, another parameter) of a cause that stands there with its best one.
            rows[key] = replace(rows[key], probability=rows[key].probability + odds[r.name])
            continue
        after = cross_validation.mean_error(held[r.name].records) if r.name in held else float("nan")
        rows[key] = Cause(
            effect=key[0],
            place=key[1],
            probability=odds[r.name],
            parameters=_parameters(r.fit.corrected),
            after=after / observed.per_unit,
            shrinkage=1.0 - after / start,
            reduced_chi2=held[r.name].reduced if r.name in held else float("nan"),
            share=float("nan")
            if key[0] in ("none", "unknown")
            else share(held.get("none"), held.get(r.name), accepted),
        )
    unknown = [c for c in rows.values() if c.effect == "unknown"]
    # One row for an unknown element, at the place where it is likeliest; what no hypothesis holds is unknown too.
    unknown.append(rest)
    best = max(unknown, key=lambda c: c.probability)
    out = [c for c in rows.values() if c.effect != "unknown"]
    out.append(replace(best, probability=sum(c.probability for c in unknown), parameters={}))
    return tuple(sorted(out, key=lambda c: -c.probability))


def _parameters(fit: Fit) -> dict[str, FittedParameter]:
    out: dict[str, FittedParameter] = {}
    causes = fit.hypothesis.causes
    for k, e in enumerate(fit.hypothesis.effects):
        before = [x for x in fit.hypothesis.effects[:k] if (x.effect, x.place) == (e.effect, e.place)]
        again = f"_{len(before) + 1}" if before else ""
        for f in parameter_fields(type(e)):
            if f"{k}.{f.name}" not in fit.stds:
                continue
            name = (f.name if len(causes) == 1 else f"{e.effect}.{f.name}") + again
            out[name] = FittedParameter(
                float(getattr(e, f.name)), float(fit.stds[f"{k}.{f.name}"]), f.metadata["range"].unit
            )
        continuous = {f.name for f in parameter_fields(type(e))}
        for f in fields(e):
            if f.name not in continuous | {"place"}:
                out[f.name + again] = FittedParameter(getattr(e, f.name), 0.0, f.metadata.get("unit", ""))
    return out


def _figures(
    observed: Observations,
    before: Sequence[cross_validation.Judged],
    tuned: HeldOut,
    after: HeldOut,
    seed: int,
) -> GapFigures:
    unit = observed.per_unit
    start, end = cross_validation.mean_error(before), cross_validation.mean_error(after.records)
    return GapFigures(
        unit=observed.unit,
        before=start / unit,
        tuned=cross_validation.mean_error(tuned.records) / unit,
        after=end / unit,
        noise_floor=float(np.mean([j.noise.mean() for j in before])) / unit,
        band_hz=observed.band,
        shrinkage=1.0 - end / start,
        shrinkage_interval=cross_validation.shrinkage_interval(before, after.records, seed),
    )


def _places(ranked: Sequence[Ranked], odds: dict[str, float], rest: Cause) -> tuple[tuple[str, float], ...]:
    """Probability of each place, or places of a sum: that of the hypotheses there, and of what none of them holds."""
    total: dict[str, float] = {"none": odds["none"]}
    for r in ranked[1:]:
        place = r.fit.hypothesis.place
        total[place] = total.get(place, 0.0) + odds[r.name]
    total[rest.place] = total.get(rest.place, 0.0) + rest.probability
    return tuple(sorted(total.items(), key=lambda item: -item[1]))


def _sizes(chosen: Fit) -> dict[str, float]:
    """Sizes in the likelihood of a fit; that of drift within sessions only where records were followed."""
    moving = bool(chosen.spread.layout.records)
    return {name: v for name, v in vars(chosen.spread.sizes).items() if moving or name != "within"}


def _bands(problem: Problem, none: Fit, sizes: Sizes) -> tuple[tuple[float, float], ...]:
    predictions, residuals, _ = problem.residuals(none.x)
    drifts = where.drift_squares(problem, none.x, predictions, sizes)
    return where.bands(list(zip(problem.groups, residuals, strict=True)), SETTINGS.band_width, drifts)
