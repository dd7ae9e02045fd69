"""
Which: every cause fitted together with the tuning, and the evidence for each.

Starts are first fitted on few lines with a noise widened by some percent of the response: sharp peaks then pull from afar, and
no start is lost in a side minimum of a precise measurement. The best are fitted again on all lines as measured. Linear causes
come first, all of them; causes that depend on the level follow where the level shows or no linear cause is enough; pairs follow
where no single cause is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, TypeVar

import numpy as np

from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.gap.fit import Fit, fit
from cutvib_ss.gap.hypotheses import Candidate, candidates, nonlinear_candidates
from cutvib_ss.gap.hypothesis import Hypothesis
from cutvib_ss.gap.levels import level_stands_out, levels_compared, motions
from cutvib_ss.gap.observations import Observations
from cutvib_ss.gap.records import Records
from cutvib_ss.gap.scan import Scan, Scanned
from cutvib_ss.gap.verdict import sufficient
from cutvib_ss.gap.workers import Workers
from cutvib_ss.results import FloatArray

COARSE_LINES = 120
"""Lines of a group on which starts are fitted."""
COARSE_ERROR = 0.03
"""Relative error by which the noise is widened there."""
REFINED = 3
"""Causes that are fitted again on all lines, at least …"""
CLOSE = 60.0
"""… and all whose objective on few lines lies within this of the best …"""
FAR = 400.0
"""What lies further behind on few lines is not fitted again at all."""
MOST_LAWS = 3
"""Of those that are simulated no more are fitted on all lines."""
MOST = 5
"""… but no more than this: where so many are alike on few lines, none of them is the cause."""
CLIMBED = 3
"""Starts of a cause from which steps are taken: those that fit best as they stand."""
FIRST_STEPS, LATER_STEPS = 3, 10
"""Steps from each start, and from the best of them."""
MOST_REFINED, MOST_STARTED = 6, 3
"""Of the causes that are simulated so many are looked at more closely, and so many fitted: those that promise most …"""
LAW_STEPS = 6
"""… in so many steps."""
SCANNED = 5
"""Records that are all scanned."""
HOPELESS = 3.0
"""Reduced χ² on few lines, with their widened noise, from which a cause that is simulated is not worth the fit on all."""
ASTRAY = 10.0
"""The same on few lines as measured, from which no pair with a law is looked for further."""
MOST_STEPS, MOST_LAW_STEPS = 40, 15
"""Steps on all lines: those of a law are dear, and the last of many gain little."""
PAIRS_CLOSE = 15.0
"""As CLOSE, for pairs."""
ROUGH = 1e-2
"""Relative gain at which steps on few lines end."""
CAUGHT = 5.0
"""Log evidence by which a cause has to lead before the model without one is tuned again from there."""
ENOUGH = 1.1
"""Reduced χ² below which the re-tuned model needs no cause, if the level does not show either."""
LEADS = 0.1
"""Part of the excess that a single cause has to take away before a second one is tried on top: else neither is known."""
PAIRED = 2
"""Single causes to which a second one is added."""
SECONDS, LAW_SECONDS = 9, 3
"""Second causes that are fitted on each of them, unless one on the first leaves no more than noise: those that promise most. So
many where one of the two is simulated."""


NameT = TypeVar("NameT")


@dataclass(frozen=True)
class Ranked:
    """
    A cause, fitted.

    Parameters
    ----------
    name : str
        Candidate's name; ``"none"`` without a cause; two names joined by ``" + "`` for a pair.
    fit : Fit
        Its best fit.
    refined : bool
        Whether it was fitted on all lines; if not, its evidence is a bound.
    """

    name: str
    fit: Fit
    refined: bool

    @property
    def reduced(self) -> float:
        """χ² a degree of freedom of what it was fitted to."""
        return self.fit.chi2 / self.fit.count


def search(
    nominal: Model,
    records: Records,
    observed: Observations,
    leaves: Callable[[Ranked], float],
    workers: Workers,
    pairs: bool = True,
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

    Returns
    -------
    tuple of Ranked
        The tuned nominal model first, then the causes by evidence.
    """
    few = records.coarse(COARSE_LINES, COARSE_ERROR)
    scout = fit(nominal, few, Hypothesis(), None, LATER_STEPS, ROUGH)
    none = Ranked("none", fit(nominal, records, Hypothesis(), scout.x), True)
    linear = candidates(nominal, observed.band, observed.channels)
    rough = _rough(nominal, few, linear, workers)
    alone = {c.name: f.hypothesis.effects[0] for c, f in rough}
    ranked = _refined(nominal, records, rough, REFINED, (scout.objective, none.fit.log_evidence), workers)
    none = _not_caught(nominal, records, none, ranked)
    by_level = level_stands_out(records)
    laws: Sequence[Candidate] = ()
    motion: dict[str, float] = {}
    outlook = records.for_laws(COARSE_LINES, COARSE_ERROR)
    compared = levels_compared(records)
    if (
        outlook is not None
        and (by_level or not compared or not _enough(ranked, none, leaves))
        and none.reduced > ENOUGH
    ):
        moved = motions(none.fit.model, outlook)
        motion = {place: m.high for place, m in moved.items()}
        laws = nonlinear_candidates(nominal, moved)
        if compared and not by_level:
            # Levels that agree leave only what depends on the sign of the motion, not on its size.
            laws = [c for c in laws if c.starts[0].scale_free]
        rough = _rough_laws(nominal, outlook, laws, motion, workers)
        ranked += _refined(nominal, records, rough, 2, _rival(nominal, outlook, ranked), workers, MOST_LAWS)
    if pairs and none.reduced > ENOUGH and not _enough(ranked, none, leaves) and _gained(ranked, none) > LEADS:
        seconds = [*(_Second(c, alone.get(c.name)) for c in linear), *(_Second(c, None) for c in laws)]
        ranked += _pairs(nominal, records, few, outlook, ranked, seconds, motion, workers)
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
    """Whether the best cause leaves no more than a right one would."""
    best = max(ranked, key=lambda r: r.fit.log_evidence)
    if best.fit.log_evidence <= none.fit.log_evidence:
        return False
    # What a law leaves tells only beside what is not known of the force; a linear one leaves as much elsewhere.
    left = best.reduced if best.fit.hypothesis.linear else leaves(best)
    return sufficient(left, none.reduced)


def _gained(ranked: Sequence[Ranked], none: Ranked) -> float:
    """Part of the re-tuned model's excess that the best single cause takes away."""
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    return (none.reduced - best.reduced) / (none.reduced - 1.0)


def _refined(
    nominal: Model,
    records: Records,
    rough: Sequence[tuple[Candidate, Fit]],
    least: int,
    rival: tuple[float, float],
    workers: Workers,
    most: int = MOST,
    close: float = CLOSE,
) -> list[Ranked]:
    """
    The best on few lines fitted on all; the others keep an estimate.

    ``rival`` is the objective of another cause, or none, on the same few lines, and its evidence on all: what stays far behind it
    there is not worth the dearer fit.
    """
    ahead = rough[0][1].objective if rough else 0.0
    chosen: list[tuple[Candidate, Fit]] = []
    left_out: list[tuple[Candidate, Fit]] = []
    for i, (candidate, start) in enumerate(rough):
        behind = start.objective - ahead
        wanted = (behind < close and i < most) or (behind < FAR and i < least)
        hopeless = not start.hypothesis.linear and start.chi2 > HOPELESS * start.count
        near = start.objective - rival[0] < CLOSE and wanted and not hopeless
        (chosen if near else left_out).append((candidate, start))
    steps = [MOST_STEPS if f.hypothesis.linear else MOST_LAW_STEPS for _, f in chosen]
    starts = [f for _, f in chosen]
    fits = workers.map(partial(fit, nominal, records), [f.hypothesis for f in starts], [f.x for f in starts], steps)
    ranked = [Ranked(c.name, f, True) for (c, _), f in zip(chosen, fits, strict=True)]
    best = max((r.fit.log_evidence for r in ranked), default=rival[1])
    # Few lines and a widened noise understate how far behind a cause is, by as much as for the rival.
    lead = rival[0] - ahead
    each = max(0.5, (best - rival[1]) / lead) if ranked and lead > 1.0 else 0.5
    front = ahead if ranked else rival[0]
    for candidate, start in left_out:
        bound = best - each * (start.objective - front)
        ranked.append(Ranked(candidate.name, replace(start, log_evidence=bound), False))
    return ranked


def _rival(nominal: Model, outlook: Records, ranked: Sequence[Ranked]) -> tuple[float, float]:
    """The best linear cause on the records on which laws start: its objective there, its evidence on all."""
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence)
    there = fit(nominal, outlook, best.fit.hypothesis, best.fit.x, LATER_STEPS, ROUGH)
    return there.objective, best.fit.log_evidence


def _rough(nominal: Model, few: Records, found: Sequence[Candidate], workers: Workers) -> list[tuple[Candidate, Fit]]:
    """Each candidate from the best of its starts, on few lines; best first."""
    scan = Scan(nominal, few, Hypothesis(), None, {}, apart=False)
    each = workers.map(partial(_scouted, nominal, few, scan), found)
    return sorted((row for rows in each for row in rows), key=lambda pair: pair[1].objective)


def _scouted(nominal: Model, few: Records, scan: Scan, candidate: Candidate) -> list[tuple[Candidate, Fit]]:
    """A candidate from the best of its starts, and its other conventions from there; nothing where the model takes none."""
    # All start from the untuned model: the tuning of a model that lacks the cause leads away.
    starts = [Hypothesis((e,)) for e in candidate.starts]
    if len(starts) > CLIMBED:
        starts.sort(key=lambda h: -scan.as_it_stands(h.effects[0]).gain)
    tries = [f for h in starts[:CLIMBED] if (f := _started(nominal, few, h, None, FIRST_STEPS)) is not None]
    if not tries:
        return []
    best = min(tries, key=lambda f: f.objective)
    out = [(candidate, fit(nominal, few, best.hypothesis, best.x, LATER_STEPS, ROUGH))]
    [(_, first)] = out
    for i, other in enumerate(first.hypothesis.effects[0].conventions):
        again = fit(nominal, few, Hypothesis((other,)), first.x, LATER_STEPS, ROUGH)
        out.append((Candidate(f"{candidate.name}, convention {i + 2}", (other,)), again))
    return out


def _rough_laws(
    nominal: Model, outlook: Records, found: Sequence[Candidate], motion: Mapping[str, float], workers: Workers
) -> list[tuple[Candidate, Fit]]:
    """The same for laws, whose steps are dear: each is scanned, and those that promise most take some."""
    scan = Scan(nominal, _some(outlook), Hypothesis(), None, motion, apart=True)
    promising = _ranked_by_gain(found, workers.map(scan.promise, [c.starts for c in found]))[:MOST_REFINED]
    refined = workers.map(scan.refined, [s for _, s in promising])
    promising = _ranked_by_gain([c for c, _ in promising], refined)[:MOST_STARTED]
    tries = workers.map(
        partial(_started, nominal, outlook, warm=None, steps=LAW_STEPS), [s.hypothesis for _, s in promising]
    )
    out = [(c, f) for (c, _), f in zip(promising, tries, strict=True) if f is not None]
    return sorted(out, key=lambda pair: pair[1].objective)


def _some(outlook: Records) -> Records:
    """Every other of many records: of three positions at three levels the corners and the middle."""
    return Records(outlook.entries[:: 2 if len(outlook.entries) > SCANNED else 1], outlook.rough)


def _ranked_by_gain(names: Sequence[NameT], scanned: Sequence[Scanned]) -> list[tuple[NameT, Scanned]]:
    return sorted(zip(names, scanned, strict=True), key=lambda row: -row[1].gain)


def _started(
    nominal: Model, records: Records, hypothesis: Hypothesis, warm: FloatArray | None, steps: int
) -> Fit | None:
    """A few steps; None where the model cannot take the effect, or runs away with it."""
    try:
        return fit(nominal, records, hypothesis, warm, steps, ROUGH)
    except CutvibError:
        return None


class _Base(NamedTuple):
    """A cause to which a second one is added."""

    name: str
    hypothesis: Hypothesis
    x: FloatArray


class _Second(NamedTuple):
    """A cause that may be added, and its values where it was fitted to few lines by itself."""

    candidate: Candidate
    alone: Effect | None

    def starts(self, by_simulation: bool) -> tuple[Effect, ...]:
        """Its starts: where each is a simulation, of a linear cause only the first and where it did best by itself."""
        starts = self.candidate.starts
        return starts if self.alone is None or not by_simulation else (starts[0], self.alone)


def _pairs(
    nominal: Model,
    records: Records,
    few: Records,
    outlook: Records | None,
    ranked: Sequence[Ranked],
    seconds: Sequence[_Second],
    motion: Mapping[str, float],
    workers: Workers,
) -> list[Ranked]:
    """
    A second cause on top of the best single ones, and of the one that was the best second: a cause that stood in for two may then
    give way.
    """
    best: dict[tuple[str, str], _Base] = {}
    for r in sorted((r for r in ranked if r.refined), key=lambda r: -r.fit.log_evidence):
        key = (r.fit.hypothesis.effect, r.fit.hypothesis.place)
        best.setdefault(key, _Base(r.name, r.fit.hypothesis, r.fit.x))
    seen: set[frozenset[str]] = set()
    out: list[Ranked] = []
    for family in (few,) if outlook is None else (few, outlook):
        # The widened noise pulls from afar; as measured, the same lines tell what is alike under it.
        sharp = records.coarse(COARSE_LINES, 0.0) if family is few else records.for_laws(COARSE_LINES, 0.0)
        assert sharp is not None
        bases = list(best.values())[:PAIRED]
        tried: list[tuple[Candidate, Fit]] = []
        for turn in range(len(bases) + 1):
            if turn == len(bases) and family is outlook and tried[0][1].chi2 > ASTRAY * tried[0][1].count:
                break
            base = bases[turn] if turn < len(bases) else _second_of(*tried[0])
            tried += _with_second(nominal, family, sharp, base, seconds, motion, seen, workers, family is few)
            tried.sort(key=lambda pair: pair[1].objective)
            if not tried or (family is outlook and _enough_on_few(tried[0][1])):
                break
        # No single cause is a rival here: none is enough.
        nobody = (np.inf, -np.inf)
        out += [r for r in _refined(nominal, records, tried[:2], 1, nobody, workers, close=PAIRS_CLOSE) if r.refined]
        if tried and _enough_on_few(tried[0][1]):
            break
    return [*out, *_alone(nominal, records, out)]


def _enough_on_few(fitted: Fit) -> bool:
    return fitted.chi2 < ENOUGH * fitted.count


def _second_of(pair: Candidate, fitted: Fit) -> _Base:
    """The second cause of a pair, as a first one."""
    alone = replace(fitted.hypothesis, effects=fitted.hypothesis.effects[-1:])
    return _Base(pair.name.split(" + ")[-1], alone, fitted.x[: fitted.first_effect])


def _with_second(
    nominal: Model,
    family: Records,
    sharp: Records,
    base: _Base,
    seconds: Sequence[_Second],
    motion: Mapping[str, float],
    seen: set[frozenset[str]],
    workers: Workers,
    linear: bool,
) -> list[tuple[Candidate, Fit]]:
    """The second causes that promise most on top of a first, each pair fitted to few lines as measured."""
    # The tuning of a linear cause that lacks its law leads away from both: the law is scanned with nothing tuned.
    x = None if base.hypothesis.linear and not linear else base.x
    added: dict[str, tuple[Effect, ...]] = {}
    for second in seconds:
        name = second.candidate.name
        names = frozenset((base.name, name))
        both = base.hypothesis.linear and second.candidate.starts[0].linear
        if len(names) == 1 or names in seen or both != linear:
            continue
        seen.add(names)
        added[f"{base.name} + {name}"] = second.starts(by_simulation=not linear)
    if not added:
        return []
    most, steps = (SECONDS, LATER_STEPS) if linear else (LAW_SECONDS, LAW_STEPS)
    rough: dict[str, Fit] = {}
    # What is small beside the widened noise shows as measured, once the first cause is right; laws are scanned from afar only.
    for seen_on in (family, sharp) if linear else (_some(family),):
        scan = Scan(nominal, seen_on, base.hypothesis, x, motion, apart=not linear)
        promising = _ranked_by_gain(list(added), workers.map(scan.promise, added.values()))[:most]
        new = [(name, s) for name, s in promising if name not in rough]
        hypotheses = [s.hypothesis for s in workers.map(scan.refined, [s for _, s in new])]
        fits = workers.map(partial(_started, nominal, family, warm=scan.warm, steps=steps), hypotheses)
        rough.update((name, f) for (name, _), f in zip(new, fits, strict=True) if f is not None)
    # As measured the steps of a law are as dear again: its two best are enough.
    ahead = sorted(rough.items(), key=lambda row: row[1].objective)[: len(rough) if linear else 2]
    fits = workers.map(
        partial(_started, nominal, sharp, steps=steps), [f.hypothesis for _, f in ahead], [f.x for _, f in ahead]
    )
    return [(Candidate(name, ()), f) for (name, _), f in zip(ahead, fits, strict=True) if f is not None]


def _alone(nominal: Model, records: Records, pairs: Sequence[Ranked]) -> list[Ranked]:
    """Each cause of the best linear pair by itself, from its values there: its own fit may have been caught in a side minimum."""
    linear = [r for r in pairs if r.fit.hypothesis.linear]
    if not linear:
        return []
    best = max(linear, key=lambda r: r.fit.log_evidence)
    out = []
    for name, effect in zip(best.name.split(" + "), best.fit.hypothesis.effects, strict=True):
        out.append(
            Ranked(name, fit(nominal, records, Hypothesis((effect,)), best.fit.x[: best.fit.first_effect]), True)
        )
    return out
