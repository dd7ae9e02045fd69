"""
The place of a gap without a hypothesis: the one whose unknown dynamic stiffnesses explain the records best.

Every way in which a place can be at fault is fitted with the tuning around it (`cutvib_ss.diagnosis.projection`), from the model as
re-tuned and, unless that leaves many times the least of any, as given, for tuning without the element may have absorbed part of it.
What counts is what the functions leave for
each degree of freedom, and how well they do at positions that they were not fitted to: a place does not win by freedom.

Where the response changes with the level there are two views, which count alike. In one every record has functions of its own: what
a nonlinear force does to one record is one function there, exactly, and channels alone have to agree. Places in a row would all
do (what sits behind the base is one function whatever it is; a force channel's gain is as good as the tool), were it not for
shape: at the right place the function is smooth, elsewhere it has to undo the model's resonances. In the other view records of
one level share their functions: roughly right where the element's motion differs little between positions, and what tells
places apart by how they depend on position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.diagnosis.element_type import element_type_of, with_level
from cutvib_ss.diagnosis.findings import DynamicStiffness, PlaceScore
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.projection import Free, Outer
from cutvib_ss.diagnosis.records import Entry, Group, merged
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_stiffness import Rows, fitted_functions, rows_of, smoothing_cost, squares_left
from cutvib_ss.diagnosis.variants import Variant, variants
from cutvib_ss.effects.base import Model
from cutvib_ss.results import FloatArray
from cutvib_ss.results.arrays import optional_array

DISTURBANCE = "disturbance"
"""The way in which the measurement is at fault where tones or trigger jitter disturb the records, and nothing else is."""


@dataclass(frozen=True)
class Located:
    """Places by their residual with unknown dynamic stiffnesses."""

    scores: tuple[PlaceScore, ...] = ()  # Best first; empty where the residual is noise
    stiffness: tuple[DynamicStiffness, ...] = ()  # The functions at the likeliest

    @property
    def odds(self) -> dict[str, float]:
        """Probability of each place, most probable first; all on none where the residual is noise."""
        return {s.place: s.probability for s in self.scores} or {"none": 1.0}

    @property
    def best(self) -> str:
        """The likeliest place."""
        return next(iter(self.odds))


def at_measurement(located: Located) -> Located:
    """Places, where the measurement is disturbed and nothing else is at fault."""
    own = PlaceScore("measurement", DISTURBANCE, 1.0, SETTINGS.place_disturbed)
    others = [s for s in located.scores if s.place != "measurement"]
    share = sum(s.probability for s in others) or 1.0
    rest = tuple(replace(s, probability=(1.0 - SETTINGS.place_disturbed) * s.probability / share) for s in others)
    return replace(located, scores=(own, *rest))


def locate(nominal: Model, none: Fit, entries: Sequence[Entry], blow_at: float, by_level: bool) -> Located:
    """
    Compare all places of a model.

    The evidence of a line with n data, of which functions leave the mean square q a degree of freedom, is n ln(1 + q): the
    likelihood of errors with heavy tails, so that a line that no place explains does not decide. Probabilities go with
    e^(-w Σ n ln(1 + q)), q being of all records and, by a quarter, of those left out in folds; where records have functions of
    their own, of any functions and of smooth ones.
    """
    groups = merged(entries, apart=by_level)
    channels = tuple(dict.fromkeys(c for g in groups for c in g.channels))
    views = _views(none, [_few(g) for g in groups], blow_at, by_level)
    best: dict[str, tuple[float, Free]] = {}
    against: dict[str, float] = {}
    for rows, by_record, weight in views:
        outer = Outer(nominal, rows)
        by_place = _by_place(outer, nominal, channels, none.x, by_level)
        far = SETTINGS.place_far * min(_left(outer, found[0]) for found in by_place.values())
        for place, found in by_place.items():
            # What leaves many times the best is judged as its first step found it: no further ones make up for that.
            near = [free for free in found[: SETTINGS.place_climbed] if _left(outer, free) < far]
            fits = [outer.climb(free, SETTINGS.place_climbs) for free in near] or found[:1]
            judged = [(*_judged(outer, free, by_record), free) for free in fits]
            evidence, left, free = min(judged, key=lambda row: row[0])
            against[place] = against.get(place, 0.0) + weight * evidence
            best.setdefault(place, (left, free))
    told = np.array([against[place] for place in best])
    odds = np.exp(-SETTINGS.place_sharpness * (told - told.min()))
    share = (1.0 - SETTINGS.place_doubt) * odds / odds.sum() + SETTINGS.place_doubt / odds.size
    scores = [
        (PlaceScore(place, free.variant.name, left, float(p)), free)
        for (place, (left, free)), p in zip(best.items(), share, strict=True)
    ]
    scores.sort(key=lambda pair: -pair[0].probability)
    kept = [
        free
        for i, (s, free) in enumerate(scores[: SETTINGS.place_most_shown])
        if i == 0 or s.probability >= SETTINGS.place_shown
    ]
    stiffness = tuple(
        z for free in kept for z in _in_full(nominal, none, merged(entries, by_level), free, blow_at, by_level)
    )
    return Located(tuple(s for s, _ in scores), stiffness)


def _few(g: Group) -> Group:
    keep = slice(None, None, max(1, g.freq.size // SETTINGS.place_lines))
    return replace(g, freq=g.freq[keep], data=g.data[..., keep], variance=g.variance[..., keep])


def _views(none: Fit, groups: Sequence[Group], blow_at: float, by_level: bool) -> list[tuple[list[Rows], bool, float]]:
    """Records with who shares functions with whom, whether none does, and what that view counts."""

    def rows(sets: Sequence[np.ndarray]) -> list[Rows]:
        return [rows_of(none.tuned, g, s, blow_at) for g, s in zip(groups, sets, strict=True)]

    if not by_level:
        return [(rows([np.zeros(g.positions.size, dtype=int) for g in groups]), False, 1.0)]
    own = rows([np.arange(g.positions.size) for g in groups])
    shared = [_levels(g)[1] for g in groups]
    if all(np.unique(s).size == s.size for s in shared):
        return [(own, True, 1.0)]
    return [(own, True, SETTINGS.place_by_record), (rows(shared), False, 1.0 - SETTINGS.place_by_record)]


def _levels(g: Group) -> tuple[FloatArray, np.ndarray]:
    """Distinct levels of a group's rows, and which of them each row is at."""
    distinct, index = np.unique(optional_array([same[0].level for same in g.entries]), return_inverse=True)
    return distinct, index


def _by_place(
    outer: Outer, nominal: Model, channels: Sequence[str], tuned: FloatArray, by_level: bool
) -> dict[str, list[Free]]:
    """Each place's variants of a fault after a first step from the re-tuned model, the near ones also from that as given."""
    # With a gain of its own in every record a lone channel shows anything.
    lone = by_level and len(channels) < 2
    tried = [v for v in variants(nominal, channels) if not (lone and v.place == "measurement")]
    found = [_first_step(outer, v, tuned) for v in tried]
    far = SETTINGS.place_far * min(_left(outer, f) for f in found)
    found += [_first_step(outer, f.variant, np.zeros(tuned.size)) for f in found if _left(outer, f) < far]
    out: dict[str, list[Free]] = {}
    for free in sorted(found, key=lambda f: _left(outer, f)):
        out.setdefault(free.variant.place, []).append(free)
    # In the order of the catalogue.
    return {v.place: out[v.place] for v in tried}


def _first_step(outer: Outer, variant: Variant, x: FloatArray) -> Free:
    """A variant after one step from a tuning, from the best of its shapes."""
    starts = [outer.at(variant, x, shape) for shape in variant.starts or (0.0,)]
    return outer.climb(min(starts, key=lambda f: f.objective), 1)


def _left(outer: Outer, free: Free) -> float:
    """Objective for each of the real data beyond the real unknowns."""
    count = sum(
        r.group.data.size - r.count * r.group.freq.size * f.shape[1]
        for r, f in zip(outer.rows, free.functions, strict=True)
    )
    return free.objective / (2.0 * float(max(count, 1)))


def _judged(outer: Outer, free: Free, by_record: bool) -> tuple[float, float]:
    """Evidence against a place, and the mean square of the residual that counts most: of records left out, where there are any."""
    against, means = 0.0, []
    parts = zip(outer.rows, outer.modifications(free.variant, free.x, free.shape), outer.gains(free.x), strict=True)
    for i, (rows, m, gain) in enumerate(parts):
        per_line = rows.group.data.size / rows.group.freq.size
        functions, squares = fitted_functions(rows, m, gain, rows.weight, free.functions[i])
        left = squares.sum(axis=0) / max(per_line - rows.count * m.functions, 1e-3)
        other, share = left, SETTINGS.place_held_out
        places = np.unique(rows.group.positions)
        if by_record:
            other, share = (
                (squares + smoothing_cost(rows, m, gain, functions)).sum(axis=0) / per_line,
                SETTINGS.place_smooth,
            )
        elif places.size > 1:
            other, folds = np.zeros(left.size), min(SETTINGS.place_folds, places.size)
            for k in range(folds):
                off = np.isin(rows.group.positions, places[k::folds])
                again, _ = fitted_functions(rows, m, gain, rows.but(off), functions)
                other = other + squares_left(rows, m, gain, again, rows.but(~off)).sum(axis=0) / per_line
        against += per_line * float(np.sum((1.0 - share) * np.log1p(left) + share * np.log1p(other)))
        means.append(left if by_record else other)
    return against, float(np.median(np.concatenate(means)))


def _in_full(
    nominal: Model, none: Fit, groups: Sequence[Group], free: Free, blow_at: float, by_level: bool
) -> list[DynamicStiffness]:
    """A place's functions on all lines of the largest group, level by level where levels differ."""
    group = max(groups, key=lambda g: g.data.size)
    levels = optional_array([same[0].level for same in group.entries])
    distinct = np.unique(levels[np.isfinite(levels)])
    apart = by_level and distinct.size > 1 and bool(np.isfinite(levels).all())
    sets = np.searchsorted(distinct, levels) if apart else np.zeros(levels.size, dtype=int)
    rows = rows_of(none.tuned, group, sets, blow_at)
    outer = Outer(nominal, [rows])
    [m], [gain] = outer.modifications(free.variant, free.x, free.shape), outer.gains(free.x)
    value, left = fitted_functions(rows, m, gain, rows.weight)
    freedom = max(group.data.size // group.freq.size - rows.count * m.functions, 1)
    # Where even the best function leaves more than noise, its uncertainty grows in proportion.
    [std] = outer.deviation(replace(free, functions=(value,)))
    std = std * np.sqrt(np.maximum(left.sum(axis=0) / freedom, 1.0))
    out = []
    for k, label in enumerate(free.variant.labels):
        z, spread = value[:, k], std[:, k]
        middle = z.shape[0] // 2
        out.append(
            DynamicStiffness(
                place=free.variant.place,
                variant=free.variant.name,
                label=label,
                quantity=free.variant.kind,
                unit=free.variant.unit,
                shape=free.shape if free.variant.starts else None,
                freq=group.freq,
                levels=tuple(float(v) for v in distinct) if apart else (None,),
                value=z,
                std=spread,
                element_type=element_type_of(free.variant.kind, group.freq, z[middle], spread[middle]),
                with_level=with_level(group.freq, distinct, z, spread) if apart else "",
            )
        )
    return out
