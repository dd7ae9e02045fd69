"""
Records that fit with no others: a loose cable, a clipped channel, the wrong range.

One such record makes every cause fail, and asks for one that acts in that record alone. A record is odd where the tuned model, a
linear cause, two of them, or an element of unknown form leave no more than noise of all others and many times that of a channel of
this one. So is one that has drifted from its session as no other has, where each has a drift of its own, if that holds of it, too.
What shows in several records is the machine's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis import cross_validation
from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Entry, Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import CutvibError

ODD = (
    "{}: left out, for it does not fit with the others: {:.3g} times the noise of a channel is left by what leaves no more than "
    "noise of them; look for a loose cable, a clipped or wrong range, or measure it again"
)


def odd_records(nominal: Model, records: Records, none: Ranked, causes: Sequence[Ranked]) -> dict[int, float]:
    """Records to leave out, by their index in the campaign, and the χ² per datum that the others' model leaves of each."""
    most = int(SETTINGS.search_odd_share * len(records.entries))
    refined = [r for r in causes if r.refined]
    if most < 1:
        return {}
    tries = [none, *sorted(refined, key=lambda r: -r.fit.log_evidence)[:1]]
    few = records.coarse(SETTINGS.search_coarse_lines, 0.0)
    enough = next((r for r in tries if r.reduced < SETTINGS.search_enough), None)
    if enough is not None:
        strays = _strays(enough.fit)
        return _without_strays(nominal, few, enough.fit, strays) if 0 < len(strays) <= most else {}
    for r in tries:
        found = _without(nominal, few, r.fit, most)
        if found:
            return found
    return {}


def _strays(fitted: Fit) -> set[int]:
    """Records that have drifted from their session by far more than the size of such drifts, by their index in the campaign."""
    lay = fitted.spread.layout
    own = fitted.spread.offsets[lay.first_within : lay.first_within + lay.per_session * len(lay.records)]
    farthest = np.abs(own.reshape(len(lay.records), lay.per_session)).max(axis=1, initial=0.0)
    return {record for record, z in zip(lay.records, farthest, strict=True) if z > SETTINGS.search_stray}


def _without_strays(nominal: Model, few: Records, start: Fit, strays: set[int]) -> dict[int, float]:
    """Of records that strayed what the others' model leaves; none where it leaves too little, or the others are not explained."""
    others = tuple(e for e in few.entries if e.record not in strays)
    out = [e for e in few.entries if e.record in strays]
    if not all(_known_beside(e, others) for e in out):
        return {}
    kept = replace(few, entries=others)
    try:
        current = fit(nominal, kept, start.hypothesis, start.x, SETTINGS.search_later_steps)
    except CutvibError:
        return {}
    return _odd(nominal, kept, current, out) if current.reduced < SETTINGS.search_enough else {}


def _odd(nominal: Model, kept: Records, fitted: Fit, out: Sequence[Entry]) -> dict[int, float]:
    """What a fit to others leaves of records, many times the noise of each; none where it does not."""
    leaves = _left(nominal, kept, fitted)
    left = {e.record: leaves(e) for e in out}
    return left if min(left.values()) > SETTINGS.search_odd else {}


def _without(nominal: Model, few: Records, start: Fit, most: int) -> dict[int, float]:
    """Records without which a hypothesis leaves no more than noise, the worst first; none where the others are not explained."""
    out: list[Entry] = []
    try:
        # Of few lines the last may lie lower: discrepancies over another band are not those of the fit on all.
        kept, current = few, fit(nominal, few, start.hypothesis, start.x, SETTINGS.search_later_steps)
    except CutvibError:
        return {}
    while len(out) < most:
        worst = max(kept.entries, key=_left(nominal, kept, current))
        others = tuple(e for e in kept.entries if e is not worst)
        if not _known_beside(worst, others):
            return {}
        kept = replace(few, entries=others)
        out.append(worst)
        try:
            current = fit(nominal, kept, start.hypothesis, start.x, SETTINGS.search_later_steps)
        except CutvibError:
            return {}
        if current.reduced < SETTINGS.search_enough:
            return _odd(nominal, kept, current, out)
    return {}


def _known_beside(e: Entry, others: Sequence[Entry]) -> bool:
    """Whether its position and input, and its level, were measured in another record too."""
    place = any((x.position, x.input) == (e.position, e.input) for x in others)
    return place and (e.level is None or any(x.level is not None and x.level >= 0.9 * e.level for x in others))


def _left(nominal: Model, records: Records, fitted: Fit) -> Callable[[Entry], float]:
    """What gives the χ² per datum of a record's worst channel under a fit, drift and discrepancy of their sizes allowed."""
    problem = Problem(nominal, records.groups(), fitted.hypothesis)
    blow_at = problem.blow_at(fitted.x)

    def left(e: Entry) -> float:
        shown = cross_validation.predicted(e, fitted.model, blow_at, problem, fitted.x)
        # Of its worst channel: a cable is loose in one.
        return float(np.max(cross_validation.judged(e, shown, problem, fitted).chi2)) * fitted.spread.noise

    return left
