"""Linear causes followed from record to record, of a machine that may move within its sessions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from cutvib_ss.diagnosis.ranking import Ranked, refit
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model


def moving(
    nominal: Model, records: Records, reached: Ranked, ranked: Sequence[Ranked], workers: Workers
) -> list[Ranked]:
    """The best linear causes fitted to every record by itself, as long as they lead to what another hypothesis has reached."""
    workers.say("following linear causes from record to record")
    # Where the machine moves within its sessions, fits that do not follow it are in no order, and few were fitted on all lines.
    moves = reached.fit.hypothesis.linear and _is_moving(reached)
    known = ranked if moves else [r for r in ranked if r.refined]
    count = SETTINGS.search_scouted if moves else SETTINGS.search_moving
    best = sorted(known, key=lambda r: -r.fit.log_evidence)[:count]
    # Beside a restoring force few steps tell whether a linear cause leads there, beside drift alone it may take many.
    alone = reached.fit.hypothesis.linear
    steps = SETTINGS.search_most_steps if alone else SETTINGS.search_later_steps
    rival, again = np.inf if alone else reached.fit.objective, []
    # What the best reaches the others have to come up to.
    for some_of in (slice(1), slice(1, SETTINGS.search_moving), slice(SETTINGS.search_moving, None)):
        if len(best) > SETTINGS.search_moving == some_of.start and not workers.begin("following more linear causes"):
            best = best[: SETTINGS.search_moving]
            break
        follow = partial(followed, nominal, records, steps=steps, rival=rival)
        again += [r for r in workers.map(follow, best[some_of]) if r.refined]
        rival = min([reached.fit.objective, *(r.fit.objective for r in again)])
    return [*again, *(r for r in ranked if r not in best)]


def followed(
    nominal: Model, records: Records, r: Ranked, steps: int = SETTINGS.search_most_steps, rival: float = np.inf
) -> Ranked:
    """A linear fit with every record drifting by itself; as it is where that runs away."""
    again = refit(nominal, records, r.fit.hypothesis, r.fit.x, steps, near=r.fit, rival=rival)
    if again is None:
        return r
    near = Ranked(r.name, again, True)
    if not _moves(near):
        return near
    # Resonances that move by more than they are wide are followed from afar.
    afar = refit(nominal, records, r.fit.hypothesis, r.fit.x, steps, rival=rival)
    return near if afar is None or afar.log_evidence < again.log_evidence else replace(near, fit=afar)


def _moves(r: Ranked) -> bool:
    """Whether a linear fit that was followed leaves far more than noise, on a machine that moves within its sessions."""
    return r.fit.hypothesis.linear and _is_moving(r) and r.reduced > SETTINGS.search_small


def _is_moving(r: Ranked) -> bool:
    """Whether a fit that was followed moves within its sessions."""
    return r.fit.spread.sizes.within > SETTINGS.sizes["within"][0][0]
