"""Where something unknown sits: elements and restoring forces of unknown form at every site, alone and beside known causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.ranking import Ranked, cost, first_steps, refit
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import (
    ByLevel,
    UnknownPole,
    amplitude_ratios,
    of_other_amplitudes,
    unknown_candidates,
    unknown_poles,
)
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import FloatArray

ELEMENTS, FORCES = "fitting elements of unknown form", "fitting restoring forces of unknown form"
"""Steps that look for what has no known form."""


def unknown_elements(
    nominal: Model,
    records: Records,
    few: Records,
    observed: Observations,
    ranked: Sequence[Ranked],
    known: Sequence[Candidate],
    rival: Ranked | None,
    workers: Workers,
    beside: bool,
) -> list[Ranked]:
    """
    An unknown element at each site, alone and if asked beside the best linear cause; at the best site beside the best one there.

    With a rival that leaves noise only those that come close to it are fitted on all lines. Without one the known linear causes of
    the best site are fitted beside its tuning.
    """
    candidates = unknown_candidates(nominal, observed.band, observed.channels)
    alone = [Hypothesis((e,)) for c in candidates for e in c.starts]
    best = partial(best_unknown, nominal, records, few, workers=workers, reached=_reached(ranked))
    linear = [r for r in ranked if r.refined and r.fit.hypothesis.linear and len(r.fit.hypothesis.effects) == 1]
    found = best(alone, None, rival=rival)
    if not found:
        return found
    unknown = max(found, key=lambda r: r.fit.log_evidence)
    site = _unknown_of(unknown.fit)
    if rival is None:
        new = _known_there(nominal, records, unknown, [c for c in known if _may_be(c.starts[0], site)], linear, workers)
        linear, found = [*linear, *new], [*found, *new]
    if not linear:
        return found
    by_evidence = sorted(linear, key=lambda r: -r.fit.log_evidence)
    further = beside and unknown.reduced > SETTINGS.search_enough
    if further and workers.begin("fitting elements of unknown form beside a cause"):
        first = by_evidence[0].fit
        both = [_beside(first, h) for h in alone]
        found += best(both, first.x[: first.first_effect], beside=first)
    # A known cause of another form than the catalogue's is that cause and something unknown at its own place.
    there = next((r.fit for r in by_evidence if r.fit.hypothesis.place == site.place), None)
    if there is None:
        return found
    both = [_beside(there, h) for h in alone if _site(h) == site.site]
    if not any(r.fit.hypothesis.causes == both[0].causes for r in found):
        found += best(both, there.x[: there.first_effect], rival=rival)
    return found


def _may_be(known: Effect, unknown: Any) -> bool:
    """Whether a known cause sits where something unknown does, or is of its channel."""
    return known.place == unknown.place and getattr(known, "channel", unknown.port) in (unknown.port, "all")


def _known_there(
    nominal: Model,
    records: Records,
    unknown: Ranked,
    candidates: Sequence[Candidate],
    ranked: Sequence[Ranked],
    workers: Workers,
) -> list[Ranked]:
    """Known causes that sit where something unknown leads all of them: without its tuning they were lost on few lines."""
    best = max(ranked, key=lambda r: r.fit.log_evidence, default=None)
    fitted = {r.name for r in ranked}
    starts = [(c.name, e) for c in candidates if c.name not in fitted for e in c.starts]
    if not starts or (best and best.fit.log_evidence > unknown.fit.log_evidence):
        return []
    sharp = records.still.coarse(SETTINGS.search_coarse_lines, 0.0)
    steps = partial(first_steps, nominal, sharp)
    reached = best and steps(best.fit.hypothesis, best.fit.x, SETTINGS.search_start_steps)
    steps = partial(steps, rival=reached.objective if reached else np.inf)
    warm = unknown.fit.x[: unknown.fit.first_effect]
    steps = partial(steps, warm=warm, steps=SETTINGS.search_start_steps)
    tried = workers.map(steps, [Hypothesis((e,)) for _, e in starts])
    each = [(name, f) for (name, _), f in zip(starts, tried, strict=True) if f is not None]
    by_name = dict(sorted(each, key=lambda row: -cost(row[1])))
    close = sorted(by_name.items(), key=lambda row: cost(row[1]))[: SETTINGS.search_parts_leading]
    again = partial(refit, nominal, records, steps=SETTINGS.search_most_steps)
    fits = workers.map(again, [f.hypothesis for _, f in close], [f.x for _, f in close])
    return [Ranked(name, f, True) for (name, _), f in zip(close, fits, strict=True) if f is not None]


def _beside(known: Fit, unknown: Hypothesis) -> Hypothesis:
    """A known cause with something unknown beside it."""
    own = known.hypothesis
    return replace(own, effects=(*own.effects, *unknown.effects))


def best_unknown(
    nominal: Model,
    records: Records,
    few: Records,
    hypotheses: Sequence[Hypothesis],
    warm: FloatArray | None,
    workers: Workers,
    rival: Ranked | None = None,
    reached: float = np.inf,
    beside: Fit | None = None,
) -> list[Ranked]:
    """
    The best unknown elements, or restoring forces, on all lines: the best site with each amplitude, the next with its best.

    `reached` is the objective that some hypothesis has on all lines already. None is worth while `beside` a cause of which the best
    takes hardly any of the excess.
    """
    first, later = (
        partial(first_steps, nominal, few, steps=n) for n in (SETTINGS.search_start_steps, SETTINGS.search_later_steps)
    )
    there = None if rival is None else later(rival.fit.hypothesis, rival.fit.x)
    if there is not None:
        # What does not come close to the rival is left out below: of equal cost it has more unknowns, and a smaller objective.
        later = partial(later, rival=there.objective + SETTINGS.search_close)
    if beside is None:
        begun = workers.map(first, hypotheses, [warm] * len(hypotheses))
        ahead = sorted((f for f in begun if f is not None), key=cost)[: SETTINGS.search_unknown_climbed]
        tried = workers.map(later, [f.hypothesis for f in ahead], [f.x for f in ahead])
    else:
        # Near what the cause alone reaches first order tells, and that on many sites nothing is gained.
        promising = _promising(nominal, few, hypotheses, beside, workers)
        tried = workers.map(later, promising, [warm] * len(promising))
    at: dict[str, Fit] = {}
    for f in sorted((f for f in tried if f is not None), key=cost):
        at.setdefault(_unknown_of(f).site, f)
    sites = list(at.values())[: SETTINGS.search_unknown_refined]
    # Sites are told apart at one amplitude; each of the best then has its own.
    others = [
        (replace(f.hypothesis, effects=(*f.hypothesis.effects[:-1], e)), f.x[: f.first_effect])
        for f in sites
        for e in of_other_amplitudes(_unknown_of(f))
    ]
    resized = workers.map(later, [h for h, _ in others], [x for _, x in others])
    fits = sorted([*sites, *(f for f in resized if f is not None)], key=cost)
    if there is not None:
        # Few lines and a widened noise understate how far behind a cause that leaves noise they are.
        fits = [f for f in fits if cost(f) - cost(there) < SETTINGS.search_close]
    own = {_unknown_of(f).site: f for f in reversed(fits)}
    fewer = records.still.coarse(SETTINGS.fit_fewer_lines, 0.0)
    again = partial(_refitted, nominal, fewer, workers=workers)
    at_own = [f for f in fits if f is own[_unknown_of(f).site]]
    sharp = again(at_own[:1])
    alone = beside and refit(nominal, fewer, beside.hypothesis, beside.x, SETTINGS.search_most_steps)
    if not sharp or (alone and not _worth(sharp[0], alone)):
        return []
    sharp += again(at_own[1:], within=SETTINGS.search_close, reached=sharp[0].objective)
    site = _unknown_of(min(sharp, key=cost)).site
    sharp += again([f for f in fits if _unknown_of(f).site == site and f is not own[site]])
    sharp += [f for f in workers.map(partial(_with_poles, nominal, fewer), _best_at_each_site(sharp)) if f is not None]
    sharp.sort(key=cost)
    close = [f for f in sharp if cost(f) - cost(sharp[0]) < SETTINGS.search_close]
    return [Ranked(_name(f), f, True) for f in _refitted(nominal, records, close, workers, near=True, reached=reached)]


def _promising(
    nominal: Model, few: Records, hypotheses: Sequence[Hypothesis], beside: Fit, workers: Workers
) -> list[Hypothesis]:
    """Unknown elements beside a cause that promise most to first order; none where none is worth what it costs."""
    scan = Scan(nominal, few, beside.hypothesis, beside.x, {}, apart=False)
    ratios = amplitude_ratios()
    gains = workers.map(partial(scan.all_free, amplitudes=ratios), [h.effects[-1] for h in hypotheses])
    worth = any(gain >= scan.least and evidence > 0.0 for gain, evidence in gains)
    if np.isfinite(scan.least) and not worth:
        return []
    ordered = sorted(range(len(hypotheses)), key=lambda i: -gains[i][1])
    return [hypotheses[i] for i in ordered[: SETTINGS.search_unknown_climbed]]


def _worth(both: Fit, first: Fit) -> bool:
    """Whether a cause with another beside it takes away some of what it leaves alone, on the same lines."""
    return first.reduced - both.reduced > SETTINGS.search_leads * (first.reduced - 1.0)


def _reached(ranked: Sequence[Ranked]) -> float:
    """The least objective of hypotheses on all lines."""
    return min((r.fit.objective for r in ranked if r.refined), default=np.inf)


def _best_at_each_site(fits: Sequence[Fit]) -> list[Fit]:
    return list({_unknown_of(f).site: f for f in sorted(fits, key=cost, reverse=True)}.values())


def _with_poles(nominal: Model, records: Records, alone: Fit) -> Fit | None:
    """A fit with the pairs of poles beside its unknown element that evidence asks for; None where that is none."""
    best, element = alone, _unknown_of(alone)
    for _ in range(SETTINGS.unknown_poles):
        starts = unknown_poles(nominal, element)
        if not starts or best.reduced < SETTINGS.search_enough:
            break
        try:
            scan = Scan(nominal, records, best.hypothesis, best.x, {}, apart=False)
        except CutvibError:
            break
        promised = scan.promise(starts)
        if promised.gain < SETTINGS.search_leads * (best.reduced - 1.0) * best.count:
            break
        both = refit(nominal, records, promised.hypothesis, best.x[: best.first_effect], SETTINGS.search_most_steps)
        if both is None or both.log_evidence <= best.log_evidence:
            break
        best = both
    return None if best is alone else best


def _refitted(
    nominal: Model,
    records: Records,
    fits: Sequence[Fit],
    workers: Workers,
    near: bool = False,
    within: float = 0.0,
    reached: float = np.inf,
) -> list[Fit]:
    """Fits on other lines, the best first, from beside the others if they are near; those that run away are left out."""
    # What the first, or another hypothesis, has reached the others have to come up to, to within some of the objective.
    out: list[Fit] = []
    for some_of in (slice(1), slice(1, None)):
        rival = min([reached, *(f.objective for f in out)]) + within
        starts = fits[some_of]
        made = workers.map(
            partial(refit, nominal, records, rival=rival),
            [f.hypothesis for f in starts],
            [f.x for f in starts],
            [SETTINGS.search_most_steps] * len(starts),
            starts if near else [None] * len(starts),
        )
        out += [f for f in made if f is not None]
    return out


def _name(f: Fit) -> str:
    """What tells a fit with an unknown element from others."""
    names = []
    for e in f.hypothesis.effects:
        kind = "unknown by level" if isinstance(e, ByLevel) else e.effect
        size = f"{e.frequency:.3g} Hz" if isinstance(e, UnknownPole) else f"{getattr(e, 'scale', 0.0):.3g}"
        names.append(f"{kind} {getattr(e, 'site', e.place)} {size}")
    return " + ".join(names)


def _unknown_of(f: Fit) -> Any:
    """The unknown element of a fit with one."""
    return f.hypothesis.effects[-1]


def _site(h: Hypothesis) -> str:
    """Where the unknown element of a hypothesis with one sits."""
    element: Any = h.effects[-1]
    return str(element.site)


def unknown_by_level(
    nominal: Model,
    records: Records,
    few: Records,
    observed: Observations,
    none: Ranked,
    ranked: Sequence[Ranked],
    rival: Ranked | None,
    workers: Workers,
) -> list[Ranked]:
    """An unknown restoring force at each port, and an unknown error of each channel that depends on the level."""
    candidates = unknown_candidates(nominal, observed.band, observed.channels, by_level=True)
    alone = [Hypothesis(c.starts) for c in candidates]
    return best_unknown(nominal, records, few, alone, none.fit.x, workers, rival, _reached(ranked))
