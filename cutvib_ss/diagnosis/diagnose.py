"""The diagnosis: a campaign and a nominal model in; where, which and how far out."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from threadpoolctl import threadpool_limits

from cutvib_ss.diagnosis import answer, cross_validation, where
from cutvib_ss.diagnosis.answer import Shown
from cutvib_ss.diagnosis.campaign_search import Searched, observe_campaign, search_campaign, without_odd
from cutvib_ss.diagnosis.candidate_evidence import at_their_ends, evidence_of, of_held_force, out_of_tolerance
from cutvib_ss.diagnosis.compared_responses import compared_responses
from cutvib_ss.diagnosis.detail import found
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.held_out_rules import judged_on_held_out
from cutvib_ss.diagnosis.hypotheses import considered
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.known_form import of_known_form
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.limits import limits
from cutvib_ss.diagnosis.linearity import chance_of_order, confounded, level_stands_out
from cutvib_ss.diagnosis.next_test import next_test
from cutvib_ss.diagnosis.odd_records import odd_records
from cutvib_ss.diagnosis.place import Located, at_measurement, locate
from cutvib_ss.diagnosis.posterior import (
    Counts,
    kind_of,
    probabilities,
    temperature,
    that_are_means,
    that_drift_by_chance,
    that_may_hide,
)
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.repeatability import repeatability
from cutvib_ss.diagnosis.result import Cause, Diagnosis, NextTest, Where
from cutvib_ss.diagnosis.set_ups import misaimed, words_on_aim
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import ByLevel, unknown_places
from cutvib_ss.diagnosis.unknown_search import ELEMENTS, FORCES
from cutvib_ss.diagnosis.verdict import ambiguity_set, place_set, verdict
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model
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

LEFT_OUT = "as much was computed as may be, and left out were: {}; for these ask for more effort (--effort 4)"


def diagnose(
    campaign: Campaign,
    machine: Model | None = None,
    *,
    hold_out: float | None = None,
    seed: int = 0,
    jobs: int = 1,
    effort: float = 1.0,
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
    effort : float
        How much may be computed before what can be done without is left out: elements of unknown form, and causes that act
        together. A multiple of what that is by default; ``math.inf`` for no limit. A warning says what was left out.
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
    if not isinstance(campaign, Campaign):
        raise ParameterError(
            f"campaign is a {type(campaign).__name__}; read a folder with cutvib_ss.read_campaign first"
        )
    if hold_out is not None and not 0.0 < hold_out < 1.0:
        raise ParameterError(f"hold_out = {hold_out} is a fraction: it must lie between 0 and 1")
    if jobs < 1:
        raise ParameterError(f"jobs = {jobs} must be at least 1")
    if not effort > 0.0:
        raise ParameterError(f"effort = {effort} must be above 0")
    nominal: Model = campaign.machine if machine is None else machine
    if not campaign.records:
        raise DiagnosisError("the campaign holds no records")
    # Small matrices in many threads wait for each other.
    with threadpool_limits(1), Workers(jobs, progress, effort * SETTINGS.search_work) as workers:
        return _diagnosed(campaign, nominal, hold_out, seed, workers)


def _diagnosed(campaign: Campaign, nominal: Model, hold_out: float | None, seed: int, workers: Workers) -> Diagnosis:
    searched = search_campaign(campaign, nominal, observe_campaign(campaign, nominal), hold_out, seed, workers)
    linear = [r for r in searched.ranked[1:] if r.fit.hypothesis.linear]
    # Where some cause, a restoring force too, leaves noise of all records, none is odd.
    explained = any(r.refined and r.reduced < SETTINGS.search_enough for r in searched.ranked)
    odd = {} if explained else odd_records(nominal, searched.records, searched.ranked[0], linear)
    if odd:
        # No single known cause left noise of the others, but two together do, or something unknown.
        without = without_odd(campaign, searched.observed, odd)
        searched = search_campaign(campaign, nominal, without, hold_out, seed, workers)
    observed, records, ranked = searched.observed, searched.records, searched.ranked
    none, fitted = ranked[0], list(records.entries)
    problem = Problem(nominal, records.merged, Hypothesis())
    workers.say("judging causes on held-out records")
    counts, variants = _considered(nominal, searched)
    odds = _odds(searched, counts, variants, not workers.left_out.keys().isdisjoint((ELEMENTS, FORCES)))
    # A right model would have left more than noise, and does not without what disturbs the records.
    # Nor would it have fitted, had the force not been off alike in all set-ups.
    disturbed = 1.0 + observed.disturbed > SETTINGS.search_enough or misaimed(none.fit) is not None
    measured = disturbed and odds[none.name] >= SETTINGS.verdict_half
    if measured:
        odds = {**odds, none.name: (1.0 - SETTINGS.place_disturbed) * odds[none.name]}
    shown = _shown(nominal, searched, odds)
    odds, hidden = _hidden(searched, odds, counts)
    by_level, located = _located(nominal, searched, problem, odds, workers)
    if measured:
        located = at_measurement(located)
    elsewhere = located.best if located.best != "none" else shown.first.fit.hypothesis.places
    rest = Cause("unknown", elsewhere, max(1.0 - sum(odds.values()) - sum(hidden.values()), 0.0))
    rows = answer.causes(shown, odds, hidden, rest, observed.per_unit)
    interval = cross_validation.shrinkage_interval(shown.before, shown.after.records, seed)
    result = verdict(rows, interval[0] > 0.0, bool(shown.first.fit.at_end))
    chosen = none.fit if result == "no_gap" else shown.first.fit
    workers.say("computing what the result means")
    places = answer.places(ranked, odds, hidden, rest)
    bands_hz = _bands(problem, none.fit, chosen.spread.sizes)
    return Diagnosis(
        verdict=result,
        gap=answer.figures(observed, shown, result, seed),
        where=Where(
            place="none" if result == "no_gap" else places[0][0] if places[0][0] != "none" else places[1][0],
            places=places,
            bands_hz=bands_hz,
            by_position=where.by_position(shown.tuned.records, observed.per_unit, shown.after.records),
            by_channel=where.by_channel(shown.tuned.records, observed.channels, observed.per_unit, shown.after.records),
            level_dependent=by_level,
            place_set=place_set(places),
        ),
        causes=rows,
        ambiguity_set=ambiguity_set(rows),
        next_test=_next_test(searched, odds) if result == "ambiguous" else None,
        title=campaign.title,
        warnings=(
            *campaign.warnings,
            *observed.warnings,
            *([LEFT_OUT.format("; ".join(workers.left_out))] if workers.left_out else []),
            *([CONFOUNDED] if confounded(records) else []),
            *([ORDERED] if _ordered(chosen, records) else []),
            *at_their_ends(chosen),
            *out_of_tolerance(nominal, chosen),
            *of_held_force(chosen, fitted),
            *words_on_aim(chosen),
        ),
        nominal=nominal,
        corrected_machine=chosen.corrected.model,
        comparisons=compared_responses(nominal, none.fit.corrected, chosen.corrected, fitted),
        evidence=tuple(evidence_of(r, shown.held[r.name].records if r.name in shown.held else ()) for r in ranked),
        reduced_chi2=max(ranked, key=lambda r: r.fit.log_evidence).reduced,
        data_count=problem.count,
        sizes=answer.sizes(chosen),
        limits=limits(nominal, chosen, searched.sizes(chosen), counts),
        repeatability=repeatability(fitted),
        findings=found(nominal, chosen.corrected, records, result, observed, bands_hz, located, shown.sides, seed),
    )


def _considered(nominal: Model, searched: Searched) -> tuple[Counts, dict[tuple[str, str], int]]:
    """How many causes and places share the priors, and how many variants each cause has."""
    observed = searched.observed
    known = considered(nominal, observed.band, observed.channels)
    # At each site an element of every amplitude, and where the level matters as many that depend on it.
    kinds = {isinstance(e, ByLevel) for r in searched.ranked for e in r.fit.hypothesis.effects}
    sites = [place for each in {False, *kinds} for place in unknown_places(nominal, observed.channels, each)]
    unknown = {("unknown", p): len(SETTINGS.unknown_amplitudes) * sites.count(p) for p in sites}
    return Counts(len(known), len(set(sites))), {**known, **unknown}


def _odds(searched: Searched, counts: Counts, variants: dict[tuple[str, str], int], untried: bool) -> dict[str, float]:
    """Probability of every hypothesis by name, each held against records that its fit has not seen."""
    ranked, judged = searched.ranked, searched.judged
    heat = temperature(judged(max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)))
    odds = judged_on_held_out(ranked, probabilities(ranked, counts, variants, heat), judged, heat)
    odds = of_known_form(ranked, odds, judged, untried)
    odds = that_are_means(ranked, odds, judged, searched.observed.changes)
    return that_drift_by_chance(ranked, odds, lambda r: chance_of_order(r.fit.spread, searched.records))


def _hidden(
    searched: Searched, odds: dict[str, float], counts: Counts
) -> tuple[dict[str, float], dict[tuple[str, str], float]]:
    """Probabilities where causes may be too small to be seen, and theirs by effect and place: none where something is."""
    none = searched.ranked[0]
    if odds[none.name] < SETTINGS.verdict_half:
        return odds, {}
    known: dict[tuple[str, str], float] = {}
    for r in searched.ranked[1:]:
        key = (r.fit.hypothesis.effect, r.fit.hypothesis.place)
        known[key] = known.get(key, 0.0) + odds[r.name]
    each: dict[tuple[str, str], list[float]] = {}
    for shapes in searched.sizes(none.fit):
        each.setdefault(shapes[0].cause, []).append(sum(s.evidence for s in shapes) / len(shapes))
    evidence = {cause: sum(of_variants) / len(of_variants) for cause, of_variants in each.items()}
    return that_may_hide(odds, none.name, known, evidence, counts)


def _shown(nominal: Model, searched: Searched, odds: Mapping[str, float]) -> Shown:
    """The answer and its rivals on held-out records."""
    none, *causes = searched.ranked
    judged = searched.judged
    by_odds = sorted(causes, key=lambda r: -odds[r.name])
    likeliest = by_odds[0]
    held = {none.name: judged(none)}
    no_gap = odds[none.name] > SETTINGS.verdict_sure
    for r in by_odds[: 1 if no_gap else SETTINGS.verdict_judged]:
        if odds[r.name] >= SETTINGS.verdict_hardly or (r is likeliest and not no_gap):
            held[r.name] = judged(r)
    if no_gap:
        other = next((r for r in by_odds if r.name in held), None)
    else:
        nameless = kind_of(likeliest.fit.hypothesis) == "unknown"
        rivals = (r for r in by_odds if r.refined and not _same_cause(r, likeliest))
        # Beside something unknown the likeliest that has a name, however improbable; else what has any probability.
        other = next((r for r in rivals if nameless or r.name in held), None)
        if other is not None:
            held[other.name] = judged(other)
    first = none if odds[none.name] >= odds[likeliest.name] else likeliest
    return Shown(
        none=none,
        causes=tuple(by_odds),
        first=first,
        second=other if first is likeliest or no_gap else likeliest,
        before=cross_validation.judge_as_given(nominal, searched.observed, none.fit),
        held=held,
    )


def _located(
    nominal: Model, searched: Searched, problem: Problem, odds: Mapping[str, float], workers: Workers
) -> tuple[bool, Located]:
    """Whether the level matters, and where the fault lies without a hypothesis."""
    records, none = searched.records, searched.ranked[0]
    fitted, blow_at = list(records.entries), problem.blow_at(none.fit.x)
    levels = where.level_dependence(fitted, none.fit.model, blow_at)
    by_level = bool(levels > SETTINGS.level_excess) or level_stands_out(records, none.fit.model, blow_at)
    # Where drift may have taken up what depends on the level, odds tell whether there is a fault at all.
    if none.reduced <= SETTINGS.search_enough and (not by_level or odds[none.name] >= SETTINGS.verdict_half):
        return by_level, Located()
    workers.say("locating the fault without a hypothesis")
    return by_level, locate(nominal, none.fit, fitted, blow_at, by_level)


def _next_test(searched: Searched, odds: Mapping[str, float]) -> NextTest | None:
    """The record that would tell the likeliest hypotheses apart best."""
    remaining = [r for r in searched.ranked if odds[r.name] > 0.02][:4]
    if len(remaining) < 2:
        return None
    told = [f"{r.fit.hypothesis.effect} at {r.fit.hypothesis.place}" for r in remaining]
    entries = list(searched.records.entries)
    return next_test([r.fit.model for r in remaining], told, entries, [odds[r.name] for r in remaining])


def _ordered(fit: Fit, records: Records) -> bool:
    """Whether a linear answer leaves drift that goes with the level."""
    return fit.hypothesis.linear and chance_of_order(fit.spread, records) < SETTINGS.level_drift


def _same_cause(one: Ranked, two: Ranked) -> bool:
    """Whether two candidates are variants of one cause."""
    a, b = one.fit.hypothesis, two.fit.hypothesis
    return (a.effect, a.place) == (b.effect, b.place)


def _bands(problem: Problem, none: Fit, sizes: Sizes) -> tuple[tuple[float, float], ...]:
    predictions, residuals, _ = problem.residuals(none.x)
    drifts = where.drift_squares(problem, none.x, predictions, sizes)
    return where.bands(list(zip(problem.groups, residuals, strict=True)), SETTINGS.band_width, drifts)
