"""
Which: every cause fitted together with the tuning, and the evidence for each.

Starts are first fitted on few lines with a noise widened by some percent of the response: sharp peaks then pull from afar, and no
start is lost in a side minimum of a precise measurement. The best are fitted again on all lines as measured. Linear causes come
first; causes that depend on the level where the level shows or no linear cause is enough; then elements of unknown form and pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.fit import Fit, fit, led_by_the_model
from cutvib_ss.diagnosis.following import followed, moving
from cutvib_ss.diagnosis.hypotheses import Candidate, candidates, nonlinear_candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import (
    chance_of_order,
    drift_for_levels,
    drift_of_any_order,
    level_stands_out,
    levels_compared,
    motions,
)
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.pairs import Second, by_themselves, fit_pairs
from cutvib_ss.diagnosis.ranking import (
    Ranked,
    acts_linearly,
    by_their_names,
    cost,
    first_steps,
    in_further_form,
    in_kindred_form,
    leaves_noise,
    on_all_lines,
    once,
    refit,
    rival_in_further_form,
    sharpened,
)
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scouting import (
    beside_parts,
    beside_tuned,
    relieved,
    scouted,
    scouted_laws,
    springs_with_dampers,
    tuned_away,
    tuned_scout,
)
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.small_sizes import SmallSize
from cutvib_ss.diagnosis.standing import (
    best_of,
    first_known,
    forces_come_close,
    is_enough,
    lacks_a_form,
    leaves_noise_alone,
    linear_of,
    of_one_place,
    shows_gap,
    taken_away,
)
from cutvib_ss.diagnosis.starts import at_instants
from cutvib_ss.diagnosis.unknown_search import ELEMENTS, FORCES, unknown_by_level, unknown_elements
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, Model, identifying_values
from cutvib_ss.results import FloatArray


class Linear(NamedTuple):
    """The first part of a search: the tuned nominal model, and causes that are the same at every level."""

    records: Records  # On which they were fitted
    few: Records  # The same on few lines with a widened noise
    none: Ranked  # The tuned nominal model
    ranked: list[Ranked]  # Causes
    candidates: Sequence[Candidate]  # All that there are
    alone: Mapping[str, Effect]  # Values of those that were fitted on few lines
    leads: float  # Part of the tuned model's excess that the best of them takes away there

    @property
    def best(self) -> Ranked:
        """The best cause fitted on all lines; without one, the tuned model."""
        return best_of(self.ranked, self.none)


def search_linear(nominal: Model, records: Records, observed: Observations, workers: Workers) -> Linear:
    """Tune the nominal model, and fit the linear causes that promise most."""
    workers.say("tuning the nominal model")
    few = records.still.coarse(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error)
    scout = tuned_scout(nominal, few)
    tuned = led_by_the_model(nominal, records, fit(nominal, records, Hypothesis(), scout.x))
    none = _other_instants(nominal, records, Ranked("none", tuned, True))
    linear = candidates(nominal, observed.band, observed.channels)
    workers.say(f"fitting {len(linear)} linear causes")
    if leaves_noise_alone(none):
        ranked = by_their_names(nominal, records, beside_tuned(nominal, records, none, linear, workers))
        return Linear(records, few, none, ranked, linear, {}, 0.0)
    rough = scouted(nominal, records, few, linear, none, workers)
    alone = {c.name: f.hypothesis.effects[0] for c, f in rough}
    ranked = on_all_lines(
        nominal,
        records,
        rough,
        SETTINGS.search_linear_refined,
        (cost(scout), none.fit.log_evidence),
        workers,
        near=_beside(none.fit),
    )
    if not level_stands_out(records, none.fit.model):
        # No errors of parts explain what depends on the level.
        ranked = beside_parts(nominal, records, few, rough, ranked, workers)
    if none.reduced < SETTINGS.search_enough:
        # What the tuned model takes up far out of its tolerance leads nowhere on few lines.
        missed = [c for c in linear if tuned_away(nominal, none.fit, c.starts[0])]
        ranked = _better(ranked, beside_tuned(nominal, records, none, missed, workers))
    ranked = by_their_names(nominal, records, ranked)
    best = best_of(ranked, none)
    ranked = [_other_instants(nominal, records, r) if r is best else r for r in ranked]
    none = _not_caught(nominal, records, none, ranked)
    leads = taken_away(scout, rough[0][1]) if rough else 0.0
    return Linear(records, few, none, ranked, linear, alone, leads)


def search(
    nominal: Model,
    observed: Observations,
    first: Linear,
    leaves: Callable[[Ranked], float],
    against_stated: Callable[[Ranked], float],
    sizes: Callable[[Fit], Sequence[Sequence[SmallSize]]],
    workers: Workers,
    pairs: bool = True,
    laws: bool = True,
) -> tuple[Ranked, ...]:
    """Go on to restoring forces, pairs and unknown elements: the tuned nominal model first, then causes by evidence."""
    records, few, none, ranked, linear, alone, leads = first
    by_level = level_stands_out(records, none.fit.model)
    apart = by_level or level_stands_out(records)
    follow = apart and not records.moving
    if follow:
        # Levels of a session that differ since the machine moved would pass for a cause that depends on the level, and what blocks
        # cut off of blows at unlike instants, once merged, for noise.
        records = replace(records, moving=True)
        workers.say("following the machine from record to record")
        none = followed(nominal, records, none)
    # Drift from record to record, or of sessions where each has a level of its own, may take all up that a restoring force does.
    any_order = by_level and drift_of_any_order(none.fit, records)
    by_order = by_level and chance_of_order(none.fit.spread, records) < SETTINGS.level_drift
    ordered = any_order or by_order or drift_for_levels(none.fit, records)
    # Where the re-tuned model leaves less than the noise itself, a widened noise would hide all that is left.
    small = none.reduced < SETTINGS.search_small and not any_order
    error = 0.0 if small else SETTINGS.search_coarse_error
    outlook = records.for_laws(SETTINGS.search_coarse_lines, error) if laws else None
    # Restoring forces first, where they are tried in any case: what they reach the linear causes have to come up to.
    later = by_level and outlook is not None and none.reduced > SETTINGS.search_enough
    unfollowed = ranked if later else []
    ranked = [] if later else moving(nominal, records, none, ranked, workers) if follow else ranked
    compared = levels_compared(records, none.fit.model)
    likely = shows_gap(ranked, none) and (by_level or not compared or not is_enough(ranked, none, leaves))
    forces = None if outlook is None else _restoring_forces(nominal, none, outlook, small, compared and not by_level)
    # Or scatter of many blocks does, where no other level tells: what a restoring force does has passed for noise.
    hidden = not (likely or ordered or compared) and any(e.continuous for e in records.entries)
    tried = forces if likely or ordered or hidden else None
    if tried is not None:
        # What is still to be followed reaches as much at the least.
        ranked = _with(nominal, records, tried, ranked, best_of([*ranked, *unfollowed], none), workers, leading=hidden)
    if later:
        ranked += moving(nominal, records, best_of(ranked, none), unfollowed, workers) if follow else unfollowed
    if not shows_gap(ranked, none):
        ranked += _favoured(nominal, records, none.fit, ranked, sizes(none.fit), workers)
    left = not is_enough(ranked, none, leaves)
    if left and not best_of(ranked, none).fit.hypothesis.linear and workers.begin("following all blows"):
        ranked = sharpened(nominal, records, ranked)
        left = not is_enough(ranked, none, leaves)
    best = best_of(ranked, none)
    by_law, taken = not best.fit.hypothesis.linear, taken_away(none.fit, best.fit)
    # What changes with the level no element that is the same at all explains, nor do two.
    alike = not (
        by_level and by_law and taken_away(best_of(linear_of(ranked), none).fit, best.fit) > SETTINGS.search_by_law
    )
    # A restoring force that leaves nothing at any level needs no element that is the same at all.
    # What drift takes up of each record by itself may fail at records that were held out.
    stands_out = shows_gap(ranked, none) or against_stated(none) > SETTINGS.verdict_misfit
    # A residual that is not white is no noise, however small it is.
    lacks = (stands_out or none.fit.correlation > 1.0) and (left or not by_law)
    # A known cause that leaves nothing needs none of unknown form beside it, but has to do better than any.
    few = records.still.coarse(SETTINGS.search_coarse_lines, 0.0) if small and left else few
    noise = lacks and best.reduced < SETTINGS.search_enough and (not by_law or leaves(best) <= SETTINGS.verdict_misfit)
    rival = best if noise else None
    if lacks and alike and workers.begin(ELEMENTS):
        beside = rival is None and stands_out
        sums = unknown_elements(nominal, records, few, observed, ranked, linear, rival, workers, beside)
        parts = _without_the_other(nominal, records, sums, ranked)
        ranked += [*sums, *parts]
        left = left and not is_enough(parts, none, leaves)
    if (
        pairs
        and left
        and shows_gap(ranked, none)
        and not of_one_place(ranked, leaves)
        # Far from all causes the fits on all lines may stop anywhere, those with a widened noise do not.
        and max(leads, taken) > SETTINGS.search_leads
        # Those that are in the catalogue come before restoring forces of unknown form.
        and workers.begin("fitting causes that act together", SETTINGS.search_work_pairs)
    ):
        known = [r for r in ranked if "unknown" not in dict(r.fit.hypothesis.causes)]
        seconds = [Second(c, alone.get(c.name)) for c in linear]
        # At one level little tells a restoring force beside a linear cause from a second linear one.
        told = compared or by_level or ordered or not best_of(ranked, none).fit.hypothesis.linear
        seconds += [Second(c, None) for c in (tried.candidates if tried and told else ())]
        both = fit_pairs(
            nominal,
            records,
            known,
            seconds,
            tried.motion if tried else {},
            workers,
            alike,
            by_level and told and bool(tried),
        )
        ranked += [r for r in both if not acts_linearly(r.fit)]
        left = not is_enough(ranked, none, leaves)
    by_force = lacks and left and tried is not None and forces_come_close([none, *ranked])
    if by_force and not of_one_place(ranked, leaves) and workers.begin(FORCES):
        ranked += unknown_by_level(nominal, records, few, observed, none, ranked, rival, workers)
    if shows_gap(ranked, none):
        best, single = best_of(ranked, none), first_known(ranked, none)
        found = relieved(nominal, records, single, linear, workers)
        parts = _without_the_other(nominal, records, found, ranked)
        # Where something else leads, a pair has to lead it.
        ranked += [r for r in [*found, *parts] if single is best or r.fit.log_evidence > best.fit.log_evidence]
    if forces is not None and tried is None and compared and lacks_a_form(ranked):
        # What depends on the sign of the motion alone is alike at all levels, and no linear cause.
        ranked = _with(nominal, records, forces, ranked, best_of(ranked, none), workers)
    ranked += in_kindred_form(nominal, records, best_of(ranked, none))
    return (none, *once(ranked))


class _RestoringForces(NamedTuple):
    """Restoring forces that may be tried, and on what they start."""

    outlook: Records  # Few records that show what depends on the level
    candidates: Sequence[Candidate]
    motion: Mapping[str, float]  # Largest of each place
    warm: FloatArray | None  # Unknowns beside which even faint ones are looked for
    left: bool  # Whether the re-tuned model leaves more than noise


def _restoring_forces(
    nominal: Model, none: Ranked, outlook: Records, small: bool, alike: bool
) -> _RestoringForces | None:
    """Those of a model, None where it has none; of levels that agree what depends on the sign of the motion, not on its size."""
    moved = motions(none.fit.model, outlook)
    found = [c for c in nonlinear_candidates(nominal, moved) if c.starts[0].scale_free or not alike]
    motion = {place: m.high for place, m in moved.items()}
    warm, left = none.fit.x if small else None, none.reduced > SETTINGS.search_enough
    return _RestoringForces(outlook, found, motion, warm, left) if found else None


def _with(
    nominal: Model,
    records: Records,
    forces: _RestoringForces,
    ranked: Sequence[Ranked],
    best: Ranked,
    workers: Workers,
    leading: bool = False,
) -> list[Ranked]:
    """Causes, and restoring forces that come close to the best of them, or lead it already on few records."""
    workers.say(f"fitting {len(forces.candidates)} causes that depend on the level")
    rough = scouted_laws(nominal, forces.outlook, forces.candidates, forces.motion, forces.warm, workers, forces.left)
    rival = _rival(nominal, forces.outlook, best)
    if leading:
        rough = [(c, f) for c, f in rough if cost(f) < rival[0]]
    new = on_all_lines(nominal, records, rough, 2, rival, workers, SETTINGS.search_laws_refined)
    # What is a linear element wherever anything moves leads linear causes by how it is predicted.
    new = [r for r in new if not acts_linearly(r.fit)]
    found = [r for r in new if r.refined]
    ahead = max(found, key=lambda r: r.fit.log_evidence, default=None)
    if ahead is not None and not leaves_noise(ahead):
        pairs = springs_with_dampers(nominal, forces.outlook, rough, forces.candidates, forces.motion, workers)
        rival = (np.inf, ahead.fit.log_evidence)
        both = on_all_lines(nominal, records, pairs, 1, rival, workers, close=SETTINGS.pairs_close)
        both = [r for r in both if r.refined]
        new += [*both, *by_themselves(nominal, records, both, found, {c.name: cost(f) for c, f in rough})]
        further = in_further_form(nominal, records, ahead)
        if not any(leaves_noise(r) for r in further):
            further += rival_in_further_form(nominal, records, forces.outlook, ahead, rough, workers)
        new += further
    return by_their_names(nominal, records, [*ranked, *new])


def _favoured(
    nominal: Model,
    records: Records,
    none: Fit,
    ranked: Sequence[Ranked],
    sizes: Sequence[Sequence[SmallSize]],
    workers: Workers,
) -> list[Ranked]:
    """Causes for which the tuned model's residual speaks, to first order, and that few lines with a widened noise did not show."""
    fitted = {_told_apart(r.fit.hypothesis.effects[0]) for r in ranked if r.refined}
    best = [max(shapes, key=lambda s: s.evidence) for shapes in sizes]
    missed = {
        s.run.name: effect
        for s in best
        if s.evidence > 1.0 and _told_apart(s.run.effect) not in fitted and (effect := s.weak) is not None
    }
    again = partial(refit, nominal, records, x=none.x, steps=SETTINGS.search_most_steps, near=none)
    fits = workers.map(again, [Hypothesis((effect,)) for effect in missed.values()])
    return [Ranked(name, f, True) for name, f in zip(missed, fits, strict=True) if f is not None]


def _without_the_other(
    nominal: Model, records: Records, sums: Sequence[Ranked], ranked: Sequence[Ranked]
) -> list[Ranked]:
    """Linear causes by themselves from their values in a sum that leads them: their own fits may be caught in side minima."""
    own = {r.fit.hypothesis.causes: r for r in sorted(ranked, key=lambda r: r.fit.log_evidence) if r.refined}
    linear = [r for r in sums if r.refined and r.fit.hypothesis.linear and len(r.fit.hypothesis.effects) == 2]
    best = max(linear, key=lambda r: r.fit.log_evidence, default=None)
    if best is None:
        return []

    def worth(_: Ranked, effect: Effect) -> bool:
        first = own.get(((effect.effect, effect.place),)) if effect.effect != "unknown" else None
        return first is not None and first.fit.log_evidence + SETTINGS.search_caught < best.fit.log_evidence

    found = by_themselves(nominal, records, [best], ranked, worth=worth)
    return [replace(r, name=own[r.fit.hypothesis.causes].name) for r in found]


def _better(ranked: Sequence[Ranked], again: Sequence[Ranked]) -> list[Ranked]:
    """Causes, of which some were fitted again: each by its better fit."""
    each = {r.name: r for r in ranked}
    for r in again:
        old = each.get(r.name)
        each[r.name] = old if old and old.refined and old.fit.log_evidence > r.fit.log_evidence else r
    return list(each.values())


def _told_apart(effect: Effect) -> tuple[object, ...]:
    """Effect, place, and what is discrete and named of a cause."""
    return effect.effect, effect.place, *identifying_values(effect)


def _beside(none: Fit) -> Fit | None:
    """The tuned model where it leaves noise, for causes to start beside; not where it may have taken up what a cause does."""
    return none if none.reduced < SETTINGS.search_enough and not none.taken_up else None


def _other_instants(nominal: Model, records: Records, r: Ranked) -> Ranked:
    """A fit, or the same with the blow up to a period of the slowest mode earlier or later where that is better."""
    sharp = records.coarse(SETTINGS.search_coarse_lines, 0.0)
    starts = at_instants(problem_for(nominal, sharp, r.fit.hypothesis), r.fit.x, SETTINGS.search_instants)
    if len(starts) == 1:
        return r
    tries: list[tuple[float, Fit | None]] = []
    for x in starts:
        reached = min((objective for objective, _ in tries), default=np.inf)
        tried = first_steps(nominal, sharp, r.fit.hypothesis, x, SETTINGS.search_later_steps, reached)
        tries.append((np.inf if tried is None else tried.objective, tried))
    best = min(tries, key=lambda row: row[0])[1]
    if best is None or best is tries[0][1]:
        return r
    again = refit(nominal, records, r.fit.hypothesis, best.x, SETTINGS.search_most_steps)
    return replace(r, fit=again) if again is not None and again.objective < r.fit.objective else r


def _not_caught(nominal: Model, records: Records, none: Ranked, ranked: Sequence[Ranked]) -> Ranked:
    """The model without a cause, tuned from where the best cause has its tuning too: it may have been caught in a side minimum."""
    best = best_of(ranked, none).fit
    if best.log_evidence < none.fit.log_evidence + SETTINGS.search_caught or none.reduced > SETTINGS.fit_hopeless:
        return none
    again = fit(nominal, records, Hypothesis(), best.x[: best.first_effect])
    return Ranked(none.name, again, True) if again.objective < none.fit.objective else none


def _rival(nominal: Model, outlook: Records, best: Ranked) -> tuple[float, float]:
    """The best linear cause on the records on which restoring forces start: its objective there, its evidence on all."""
    # Simulated as those are: where blocks leak, the closed form would leave more than there is.
    there = fit(
        nominal,
        replace(outlook, rough=False),
        best.fit.hypothesis,
        best.fit.x,
        SETTINGS.search_later_steps,
        SETTINGS.search_coarse_gain,
    )
    return cost(there), best.fit.log_evidence
