"""Where something unknown sits: elements and restoring forces of unknown form at every site, alone and beside known causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.ranking import Ranked, cost, first_steps, refit
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import (
    ByLevel,
    UnknownPole,
    of_other_amplitudes,
    unknown_candidates,
    unknown_poles,
)
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import FloatArray


def unknown_elements(
    nominal: Model,
    records: Records,
    few: Records,
    observed: Observations,
    ranked: Sequence[Ranked],
    rival: Ranked | None,
    workers: Workers,
    beside: bool,
) -> list[Ranked]:
    """
    An unknown element at each site, alone and if asked beside the best linear cause; at the best site beside the best one there.

    With a rival that leaves noise only those that come close to it are fitted on all lines.
    """
    candidates = unknown_candidates(nominal, observed.band, observed.channels)
    alone = [Hypothesis((e,)) for c in candidates for e in c.starts]
    best = partial(best_unknown, nominal, records, few, workers=workers, reached=_reached(ranked))
    linear = [r for r in ranked if r.refined and r.fit.hypothesis.linear and len(r.fit.hypothesis.effects) == 1]
    found = best(alone, None, rival=rival)
    if not linear or not found:
        return found
    by_evidence = sorted(linear, key=lambda r: -r.fit.log_evidence)
    site = _unknown_of(max(found, key=lambda r: r.fit.log_evidence).fit)
    if beside:
        first = by_evidence[0].fit
        both = [_beside(first, h) for h in alone]
        found += best(both, first.x[: first.first_effect])
    # A known cause of another form than the catalogue's is that cause and something unknown at its own place.
    there = next((r.fit for r in by_evidence if r.fit.hypothesis.place == site.place), None)
    if there is None:
        return found
    both = [_beside(there, h) for h in alone if _site(h) == site.site]
    if not any(r.fit.hypothesis.causes == both[0].causes for r in found):
        found += best(both, there.x[: there.first_effect], rival=rival)
    return found


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
) -> list[Ranked]:
    """
    The best unknown elements, or restoring forces, on all lines: the best site with each amplitude, the next with its best.

    `reached` is the objective that some hypothesis has on all lines already.
    """
    steps = partial(first_steps, nominal, few, steps=SETTINGS.search_later_steps)
    there = None if rival is None else steps(rival.fit.hypothesis, rival.fit.x)
    if there is not None:
        # What does not come close to the rival is left out below: of equal cost it has more unknowns, and a smaller objective.
        steps = partial(steps, rival=there.objective + SETTINGS.search_close)
    tried = workers.map(steps, hypotheses, [warm] * len(hypotheses))
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
    resized = workers.map(steps, [h for h, _ in others], [x for _, x in others])
    fits = sorted([*sites, *(f for f in resized if f is not None)], key=cost)
    if there is not None:
        # Few lines and a widened noise understate how far behind a cause that leaves noise they are.
        fits = [f for f in fits if cost(f) - cost(there) < SETTINGS.search_close]
    own = {_unknown_of(f).site: f for f in reversed(fits)}
    fewer = records.still.coarse(SETTINGS.fit_fewer_lines, 0.0)
    again = partial(_refitted, nominal, fewer, workers=workers)
    sharp = again([f for f in fits if f is own[_unknown_of(f).site]], within=SETTINGS.search_close)
    if not sharp:
        return []
    site = _unknown_of(min(sharp, key=cost)).site
    sharp += again([f for f in fits if _unknown_of(f).site == site and f is not own[site]])
    sharp += [f for f in workers.map(partial(_with_poles, nominal, fewer), _best_at_each_site(sharp)) if f is not None]
    sharp.sort(key=cost)
    close = [f for f in sharp if cost(f) - cost(sharp[0]) < SETTINGS.search_close]
    return [Ranked(_name(f), f, True) for f in _refitted(nominal, records, close, workers, near=True, reached=reached)]


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
    workers: Workers,
) -> list[Ranked]:
    """An unknown restoring force at each port, and an unknown error of each channel that depends on the level."""
    candidates = unknown_candidates(nominal, observed.band, observed.channels, by_level=True)
    alone = [Hypothesis(c.starts) for c in candidates]
    return best_unknown(nominal, records, few, alone, none.fit.x, workers, reached=_reached(ranked))
