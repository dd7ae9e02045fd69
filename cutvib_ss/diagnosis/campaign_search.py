"""From a campaign to its observations, and all hypotheses on its records but those that fit with no others."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.blocks import longer_blocks
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.held_out import HeldOut
from cutvib_ss.diagnosis.lasting import with_lasting
from cutvib_ss.diagnosis.mean_delays import without_mean_delays
from cutvib_ss.diagnosis.modes_beyond import BEYOND
from cutvib_ss.diagnosis.observations import Observations, observe
from cutvib_ss.diagnosis.odd_records import ODD, odd_records
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Entry, Records, measured_at, session_of
from cutvib_ss.diagnosis.search import Linear, search, search_linear
from cutvib_ss.diagnosis.set_ups import placed_by, with_set_ups
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.small_sizes import SmallSize, small_sizes
from cutvib_ss.diagnosis.stopped import with_what_stops
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.measurement.records import Campaign


def observe_campaign(campaign: Campaign, nominal: Model, highest: float = math.inf) -> Observations:
    """The campaign's responses, with what drifts within a record."""
    observed = observe(campaign, nominal, highest)
    for _ in range(SETTINGS.record_late_passes):
        if observed.jitter is None:
            break
        campaign = without_mean_delays(nominal, campaign, observed, observed.jitter)
        observed = observe(campaign, nominal, highest)
    observed = with_what_stops(nominal, observed)
    return replace(observed, entries=with_set_ups(nominal, with_lasting(nominal, observed.entries)))


class Searched(NamedTuple):
    """What a search found, and on which records."""

    observed: Observations
    records: Records  # Of these, those to fit on
    judged: Callable[[Ranked], HeldOut]  # Any hypothesis on held-out records
    sizes: Callable[[Fit], Sequence[Sequence[SmallSize]]]  # Of linear causes beside any fit
    ranked: tuple[Ranked, ...]  # The tuned nominal model, then causes by evidence


def search_campaign(
    campaign: Campaign, nominal: Model, observed: Observations, hold_out: float | None, seed: int, workers: Workers
) -> Searched:
    """All hypotheses on all records but those that fit with no others."""
    linear = search_linear(nominal, _to_fit(observed), observed, workers)
    if linear.best.reduced > SETTINGS.verdict_misfit and (longer := longer_blocks(nominal, observed)) is not None:
        other = search_linear(nominal, _to_fit(longer), longer, workers)
        if other.best.fit.log_evidence > linear.best.fit.log_evidence:
            observed, linear = longer, other
    if (below := _below_modes_beyond(campaign, nominal, observed, linear)) is not None:
        observed = below
        linear = search_linear(nominal, _to_fit(observed), observed, workers)
    if (placed := _placed(nominal, observed, linear.best.fit)) is not None:
        other = search_linear(nominal, _to_fit(placed), placed, workers)
        if other.best.fit.log_evidence > linear.best.fit.log_evidence:
            observed, linear = placed, other
    odd = odd_records(nominal, linear.records, linear.none, linear.ranked)
    if odd:
        observed = without_odd(campaign, observed, odd)
        linear = search_linear(nominal, _to_fit(observed), observed, workers)
    folds = cross_validation.folds(observed, hold_out, seed)
    judgements: dict[str, HeldOut] = {}

    def judged(r: Ranked) -> HeldOut:
        # What was fitted on goes by the same name.
        if r.name not in judgements or judgements[r.name].ranked.fit is not r.fit:
            judgements[r.name] = HeldOut(
                r, cross_validation.judge(nominal, folds, r.fit, workers), all(f.held_out for f in folds)
            )
        return judgements[r.name]

    beside: list[tuple[Fit, Sequence[Sequence[SmallSize]]]] = []

    def sizes(fit: Fit) -> Sequence[Sequence[SmallSize]]:
        if not any(known is fit for known, _ in beside):
            beside.append((fit, small_sizes(nominal, fit, linear.records, observed)))
        return next(found for known, found in beside if known is fit)

    ranked = search(
        nominal, observed, linear, lambda r: judged(r).reduced, lambda r: judged(r).against_stated, sizes, workers
    )
    return Searched(observed, linear.records, judged, sizes, ranked)


def _placed(nominal: Model, observed: Observations, made: Fit) -> Observations | None:
    """The same with heads where a linear fit finds them, by steps; None where it leaves much, or leaves them where they are."""
    out = None
    if made.reduced > SETTINGS.search_small:
        # What it lacks would move them.
        return None
    for _ in range(SETTINGS.set_up_passes):
        if (entries := placed_by(made, observed.entries)) is None:
            break
        there = replace(observed, entries=entries)
        try:
            again = fit(nominal, _to_fit(there), made.hypothesis, made.x, near=made)
        except (CutvibError, np.linalg.LinAlgError):
            break
        if again.log_evidence <= made.log_evidence:
            break
        out, made = there, again
    return out


def _below_modes_beyond(
    campaign: Campaign, nominal: Model, observed: Observations, linear: Linear
) -> Observations | None:
    """The responses below a resonance that the model lacks and no linear cause explains; None where there is none."""
    if observed.beyond is None or nominal.highest_mode is None or linear.best.reduced <= SETTINGS.verdict_misfit:
        return None
    end = observed.beyond / SETTINGS.record_below_resonance
    if observed.band[1] <= end:
        return None
    below = observe_campaign(campaign, nominal, end)
    return replace(below, warnings=(*below.warnings, BEYOND.format(nominal.highest_mode[0], observed.beyond, end)))


def without_odd(campaign: Campaign, observed: Observations, odd: Mapping[int, float]) -> Observations:
    """The observations without records that fit with no others."""
    return observed.without(odd, tuple(ODD.format(campaign.records[i].name, left) for i, left in odd.items()))


def _to_fit(observed: Observations) -> Records:
    """The records that are not only for judging; all, where there are no others."""
    entries = tuple(e for e in observed.entries if not e.check) or observed.entries
    return Records(entries, moving=_may_move(entries))


def _may_move(entries: Sequence[Entry]) -> bool:
    """Whether a session holds several positions or inputs, or one of them twice at a level: between such records machines move."""
    sessions: dict[tuple[float | str, ...], list[tuple[tuple[float | None, str], int]]] = {}
    for e in entries:
        sessions.setdefault(session_of(e), []).append((measured_at(e), e.level_step))
    return any(len({at for at, _ in own}) > 1 or len(set(own)) < len(own) for own in sessions.values())
