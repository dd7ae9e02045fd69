"""
Which: every cause fitted together with the tuning, and the evidence for each.

Starts are first fitted on few lines with a noise widened by some percent of the response: sharp peaks then pull from afar, and
no start is lost in a side minimum of a precise measurement. The best are fitted again on all lines as measured. Linear causes
come first, all of them; causes that depend on the level follow where the level shows or no linear cause is enough; pairs follow
where no single cause is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import Candidate, candidates, nonlinear_candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import level_stands_out, levels_compared, motions
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.pairs import Second, fit_pairs
from cutvib_ss.diagnosis.ranking import (
    COARSE_ERROR,
    COARSE_LINES,
    ENOUGH,
    LATER_STEPS,
    LAW_STEPS,
    MOST_STEPS,
    ROUGH,
    Ranked,
    cost,
    first_steps,
    on_all_lines,
    ranked_by_gain,
    some,
)
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.unknown_element import UnknownElement, unknown_candidates
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Model
from cutvib_ss.results import FloatArray

REFINED = 3
"""Linear causes that are fitted again on all lines, at least."""
MOST_LAWS = 3
"""Of those that are simulated no more are fitted on all lines."""
CLIMBED = 3
"""Starts of a cause from which steps are taken: those that fit best as they stand."""
FIRST_STEPS = 3
"""Steps from each start."""
MOST_REFINED, MOST_STARTED = 6, 3
"""Of the causes that are simulated so many are looked at more closely, and so many fitted: those that promise most."""
CAUGHT = 5.0
"""Log evidence by which a cause has to lead before the model without one is tuned again from there."""
LEFT, LEFT_OF_GAP = 1.05, 2e-4
"""χ² a datum, and part of the gap's own, below which nothing more is tried beside the best cause: it saves time, no more."""
UNKNOWN_REFINED = 3
"""Unknown elements, alone and beside a cause, that are fitted on all lines."""
LEADS = 0.1
"""Part of the excess that a single cause has to take away before a second one is tried on top: else neither is known."""


def search(
    nominal: Model,
    records: Records,
    observed: Observations,
    leaves: Callable[[Ranked], float],
    workers: Workers,
    pairs: bool = True,
    laws: bool = True,
) -> tuple[Ranked, ...]:
    """
    Fit every cause, and pairs where no single one is enough.

    Parameters
    ----------
    nominal : Machine or Structure
        The nominal model.
    records : Records
        Records to fit on.
    observed : Observations
        The campaign they are of: its band and channels.
    leaves : callable
        Reduced χ² that a cause leaves on held-out records.
    workers : Workers
        Who fits.
    pairs : bool
        Whether two causes are tried where no single one is enough.
    laws : bool
        Whether causes that depend on the level are tried.

    Returns
    -------
    tuple of Ranked
        The tuned nominal model first, then the causes by evidence.
    """
    workers.say("tuning the nominal model")
    few = records.coarse(COARSE_LINES, COARSE_ERROR)
    scout = fit(nominal, few, Hypothesis(), None, LATER_STEPS, ROUGH)
    none = Ranked("none", fit(nominal, records, Hypothesis(), scout.x), True)
    linear = candidates(nominal, observed.band, observed.channels)
    workers.say(f"fitting {len(linear)} linear causes")
    rough = _rough(nominal, few, linear, workers)
    alone = {c.name: f.hypothesis.effects[0] for c, f in rough}
    ranked = on_all_lines(
        nominal,
        records,
        rough,
        REFINED,
        (cost(scout), none.fit.log_evidence),
        workers,
        near=none.fit if none.reduced < ENOUGH else None,
    )
    none = _not_caught(nominal, records, none, ranked)
    by_level = level_stands_out(records, none.fit.model)
    dependent: Sequence[Candidate] = ()
    motion: dict[str, float] = {}
    outlook = records.for_laws(COARSE_LINES, COARSE_ERROR) if laws else None
    compared = levels_compared(records, none.fit.model)
    if (
        outlook is not None
        and (by_level or not compared or not _enough(ranked, none, leaves))
        and none.reduced > ENOUGH
    ):
        moved = motions(none.fit.model, outlook)
        motion = {place: m.high for place, m in moved.items()}
        dependent = nonlinear_candidates(nominal, moved)
        if compared and not by_level:
            # Levels that agree leave only what depends on the sign of the motion, not on its size.
            dependent = [c for c in dependent if c.starts[0].scale_free]
        workers.say(f"fitting {len(dependent)} causes that depend on the level")
        rough = _rough_laws(nominal, outlook, dependent, motion, workers)
        ranked += on_all_lines(nominal, records, rough, 2, _rival(nominal, outlook, ranked), workers, MOST_LAWS)
    if pairs and none.reduced > ENOUGH and not _enough(ranked, none, leaves) and _gained(ranked, none) > LEADS:
        workers.say("fitting causes that act together")
        seconds = [*(Second(c, alone.get(c.name)) for c in linear), *(Second(c, None) for c in dependent)]
        ranked += fit_pairs(nominal, records, ranked, seconds, motion, workers)
    if none.reduced > ENOUGH and not _enough(ranked, none, leaves):
        workers.say("fitting elements of unknown form")
        ranked += _unknown(nominal, records, few, observed, ranked, workers)
    best: dict[str, Ranked] = {}
    for r in sorted(ranked, key=lambda r: -r.fit.log_evidence):
        best.setdefault(r.name, r)
    return (none, *best.values())


def _not_caught(nominal: Model, records: Records, none: Ranked, ranked: Sequence[Ranked]) -> Ranked:
    """The model without a cause, tuned from where the best cause has its tuning too: it may have been caught in a side minimum."""
    best = max(ranked, key=lambda r: r.fit.log_evidence).fit
    if best.log_evidence < none.fit.log_evidence + CAUGHT:
        return none
    again = fit(nominal, records, Hypothesis(), best.x[: best.first_effect])
    return Ranked(none.name, again, True) if again.objective < none.fit.objective else none


def _enough(ranked: Sequence[Ranked], none: Ranked, leaves: Callable[[Ranked], float]) -> bool:
    """Whether the best cause leaves so little that nothing more need be tried."""
    best = max(ranked, key=lambda r: r.fit.log_evidence)
    if best.fit.log_evidence <= none.fit.log_evidence or not best.refined:
        return False
    # A law's residual tells only beside what is not known of the force; a linear one leaves as much elsewhere.
    left = best.reduced if best.fit.hypothesis.linear else leaves(best)
    return left < LEFT + LEFT_OF_GAP * max(none.reduced - 1.0, 0.0)


def _unknown(
    nominal: Model,
    records: Records,
    few: Records,
    observed: Observations,
    ranked: Sequence[Ranked],
    workers: Workers,
) -> list[Ranked]:
    """An unknown element at each port, alone and beside the best linear cause."""
    alone = [Hypothesis(c.starts) for c in unknown_candidates(nominal, observed.band)]
    linear = [r for r in ranked if r.refined and r.fit.hypothesis.linear and len(r.fit.hypothesis.effects) == 1]
    beside: list[tuple[Hypothesis, FloatArray | None]] = [(h, None) for h in alone]
    if linear:
        best = max(linear, key=lambda r: r.fit.log_evidence)
        own = best.fit.hypothesis
        if own.effect != UnknownElement.effect:
            beside += [(replace(own, effects=(*own.effects, *h.effects)), best.fit.x) for h in alone]
    hypotheses, warm = [h for h, _ in beside], [x for _, x in beside]
    warm = [None if x is None else x[: linear[0].fit.first_effect] for x in warm]
    tried = workers.map(partial(first_steps, nominal, few, steps=LATER_STEPS), hypotheses, warm)
    out: list[Ranked] = []
    for count in (1, 2):
        found = [f for f in tried if f is not None and len(f.hypothesis.effects) == count]
        for f in sorted(found, key=cost)[:UNKNOWN_REFINED]:
            ports = [getattr(e, "port", e.place) + f" {getattr(e, 'scale', 0.0):.3g}" for e in f.hypothesis.effects]
            name = " + ".join(f"{e.effect} {p}" for e, p in zip(f.hypothesis.effects, ports, strict=True))
            again = fit(nominal, records, f.hypothesis, f.x, MOST_STEPS)
            out.append(Ranked(name, again, True))
    return out


def _gained(ranked: Sequence[Ranked], none: Ranked) -> float:
    """Part of the re-tuned model's excess that the best single cause takes away."""
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    return (none.reduced - best.reduced) / (none.reduced - 1.0)


def _rival(nominal: Model, outlook: Records, ranked: Sequence[Ranked]) -> tuple[float, float]:
    """The best linear cause on the records on which laws start: its objective there, its evidence on all."""
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    there = fit(nominal, outlook, best.fit.hypothesis, best.fit.x, LATER_STEPS, ROUGH)
    return cost(there), best.fit.log_evidence


def _rough(nominal: Model, few: Records, found: Sequence[Candidate], workers: Workers) -> list[tuple[Candidate, Fit]]:
    """Each candidate from the best of its starts, on few lines; best first."""
    scan = Scan(nominal, few, Hypothesis(), None, {}, apart=False)
    fits = workers.map(partial(_scouted, nominal, few, scan), found)
    pairs = [(c, f) for c, f in zip(found, fits, strict=True) if f is not None]
    return sorted(pairs, key=lambda pair: cost(pair[1]))


def _scouted(nominal: Model, few: Records, scan: Scan, candidate: Candidate) -> Fit | None:
    """A candidate from the best of its starts; None where the model takes none."""
    # All start from the untuned model: the tuning of a model that lacks the cause leads away.
    starts = [Hypothesis((e,)) for e in candidate.starts]
    if len(starts) > CLIMBED:
        starts.sort(key=lambda h: -scan.as_it_stands(h.effects[0]).gain)
    tries = [f for h in starts[:CLIMBED] if (f := first_steps(nominal, few, h, None, FIRST_STEPS)) is not None]
    if not tries:
        return None
    best = min(tries, key=cost)
    return fit(nominal, few, best.hypothesis, best.x, LATER_STEPS, ROUGH)


def _rough_laws(
    nominal: Model, outlook: Records, found: Sequence[Candidate], motion: Mapping[str, float], workers: Workers
) -> list[tuple[Candidate, Fit]]:
    """The same for laws, whose steps are expensive: each is scanned, and those that promise most take some."""
    scan = Scan(nominal, some(outlook), Hypothesis(), None, motion, apart=True)
    promising = ranked_by_gain(found, workers.map(scan.promise, [c.starts for c in found]))[:MOST_REFINED]
    refined = workers.map(scan.refined, [s for _, s in promising])
    promising = ranked_by_gain([c for c, _ in promising], refined)[:MOST_STARTED]
    tries = workers.map(
        partial(first_steps, nominal, outlook, warm=None, steps=LAW_STEPS), [s.hypothesis for _, s in promising]
    )
    out = [(c, f) for (c, _), f in zip(promising, tries, strict=True) if f is not None]
    return sorted(out, key=lambda pair: cost(pair[1]))
