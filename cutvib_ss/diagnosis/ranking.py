"""What the search for one cause and for pairs share: few lines first, the best of them on all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.records import Entry, Records, measured_at
from cutvib_ss.diagnosis.scan import Scan, Scanned
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, Model, identifying_values
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import FloatArray

NameT = TypeVar("NameT")


@dataclass(frozen=True)
class Ranked:
    """A cause, fitted."""

    name: str  # Candidate's name; ``"none"`` without a cause; two names joined by ``" + "`` for a pair
    fit: Fit  # Its best fit
    refined: bool  # Whether it was fitted on all lines; if not, its evidence is a bound

    @property
    def reduced(self) -> float:
        """χ² per datum against the noise as stated."""
        return self.fit.reduced


def on_all_lines(
    nominal: Model,
    records: Records,
    rough: Sequence[tuple[Candidate, Fit]],
    least: int,
    rival: tuple[float, float],
    workers: Workers,
    most: int = SETTINGS.search_most_close,
    close: float = SETTINGS.search_close,
    near: Fit | None = None,
) -> list[Ranked]:
    """The best on few lines fitted on all; the others keep an estimate."""
    ahead = cost(rough[0][1]) if rough else 0.0
    chosen: list[tuple[Candidate, Fit]] = []
    left_out: list[tuple[Candidate, Fit]] = []
    for i, (candidate, start) in zip(numbered([f.hypothesis for _, f in rough]), rough, strict=True):
        behind = cost(start) - ahead
        wanted = (behind < close and i < most) or (behind < SETTINGS.search_far and i < least)
        hopeless = not start.hypothesis.linear and start.reduced > SETTINGS.search_hopeless and cost(start) > rival[0]
        promising = cost(start) - rival[0] < SETTINGS.search_close and wanted and not hopeless
        (chosen if promising else left_out).append((candidate, start))
    steps = [SETTINGS.search_most_steps if f.hypothesis.linear else SETTINGS.search_most_law_steps for _, f in chosen]
    fits: list[Fit | None] = []
    # The first is one for the others to come up to.
    for some_of in (slice(1), slice(1, None)):
        starts = [f for _, f in chosen[some_of]]
        reached = min((cost(f) for f in fits if f is not None), default=np.inf)
        again = partial(refit, nominal, records, near=near, rival=min(reached, -2.0 * rival[1]))
        fits += workers.map(again, [f.hypothesis for f in starts], [f.x for f in starts], steps[some_of])
    ranked = [Ranked(c.name, f, True) for (c, _), f in zip(chosen, fits, strict=True) if f is not None]
    best = max((r.fit.log_evidence for r in ranked), default=rival[1])
    # Few lines and a widened noise understate how far behind a cause is, by as much as for the rival.
    lead = rival[0] - ahead
    each = max(0.5, (best - rival[1]) / lead) if ranked and lead > 1.0 else 0.5
    front = ahead if ranked else rival[0]
    for candidate, start in left_out:
        bound = best - each * (cost(start) - front)
        ranked.append(Ranked(candidate.name, replace(start, log_evidence=bound), False))
    return ranked


def refit(
    nominal: Model,
    records: Records,
    hypothesis: Hypothesis,
    x: FloatArray,
    steps: int,
    near: Fit | None = None,
    rival: float = np.inf,
) -> Fit | None:
    """A fit on all lines; None where it runs away."""
    try:
        return fit(nominal, records, hypothesis, x, steps, near=near, rival=rival)
    except CutvibError:
        return None


def sharpened(nominal: Model, records: Records, ranked: Sequence[Ranked]) -> list[Ranked]:
    """Causes, of which the best is fitted on with derivatives of all blows, if it is a restoring force."""
    best = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence, default=None)
    if best is None or best.fit.derivatives != "of one blow":
        return list(ranked)
    near = replace(best.fit, derivatives="of all blows")
    again = refit(nominal, records, near.hypothesis, near.x, SETTINGS.search_most_law_steps, near=near)
    if again is None or again.log_evidence < best.fit.log_evidence:
        return list(ranked)
    return [replace(r, fit=again) if r is best else r for r in ranked]


def by_their_names(nominal: Model, records: Records, ranked: Sequence[Ranked]) -> list[Ranked]:
    """The causes, of which one that is another within the deviation of its fit goes by that one's name, if it is among the best."""
    fitted = {r.fit.hypothesis.causes for r in ranked if r.refined}
    least = max((r.fit.log_evidence for r in ranked if r.refined), default=0.0) - SETTINGS.search_close / 2.0
    out = []
    for r in ranked:
        effects, parts = r.fit.hypothesis.effects, r.name.split(" + ")
        aliases = tuple(e.alias(nominal, s) for e, s in zip(effects, r.fit.stds_of_effects, strict=True))
        channels = len(effects) > len(parts)
        if channels or aliases == effects or not r.refined or r.fit.log_evidence < least:
            out.append(r)
            continue
        hypothesis = replace(r.fit.hypothesis, effects=aliases)
        if hypothesis.causes not in fitted:
            steps = SETTINGS.search_most_steps if hypothesis.linear else SETTINGS.search_most_law_steps
            again = refit(nominal, records, hypothesis, r.fit.x[: r.fit.first_effect], steps)
            each = zip(parts, effects, aliases, strict=True)
            name = " + ".join(part if a is e else f"{a.effect} {a.place}" for part, e, a in each)
            out.append(r if again is None else Ranked(name, again, True))
    return out


def leaves_noise(r: Ranked) -> bool:
    """Whether a restoring force leaves noise without an error of its own that is larger than most."""
    return r.reduced <= SETTINGS.search_enough and not r.fit.spread.is_large("cause")


def in_further_form(nominal: Model, records: Records, best: Ranked) -> list[Ranked]:
    """A hypothesis with its causes in their more general forms; none where they have none."""
    motions = best.fit.hypothesis.motions
    forms = [e.further(motions[e.place]) if e.place in motions else None for e in best.fit.hypothesis.effects]
    return _in_form(nominal, records, best, [f or e for f, e in zip(forms, best.fit.hypothesis.effects, strict=True)])


def rival_in_further_form(
    nominal: Model,
    records: Records,
    few: Records,
    best: Ranked,
    rough: Sequence[tuple[Candidate, Fit]],
    workers: Workers,
) -> list[Ranked]:
    """Another restoring force that in its further form leads the best one in its own on few lines, fitted on all."""
    motions, tried = best.fit.hypothesis.motions, dict[tuple[tuple[str, str], ...], tuple[Candidate, Hypothesis, Fit]]()
    for c, f in rough:
        [e] = f.hypothesis.effects
        further = e.further(motions[e.place]) if e.place in motions else None
        if further is not None:
            tried.setdefault(f.hypothesis.causes, (c, Hypothesis((further,), motions), f))
    own = tried.pop(best.fit.hypothesis.causes, None)
    if own is None or not tried:
        return []
    chosen = [own, *list(tried.values())[: SETTINGS.search_laws_started]]
    again = partial(refit, nominal, few, steps=SETTINGS.search_later_steps)
    fits = workers.map(again, [h for _, h, _ in chosen], [f.x[: f.first_effect] for _, _, f in chosen])
    found = [(c.name, f) for (c, _, _), f in zip(chosen, fits, strict=True) if f is not None]
    name, f = min(found, key=lambda row: cost(row[1]), default=(best.name, best.fit))
    if f.hypothesis.causes == best.fit.hypothesis.causes:
        return []
    made = refit(nominal, records, f.hypothesis, f.x, SETTINGS.search_most_law_steps)
    return [] if made is None else [Ranked(name, made, True)]


def in_kindred_form(nominal: Model, records: Records, best: Ranked) -> list[Ranked]:
    """The best hypothesis with what records may not tell from its causes, from where it stands; none where there is no such."""
    each = zip(best.fit.hypothesis.effects, best.fit.stds_of_effects, strict=True)
    found = _in_form(nominal, records, best, [e.kindred(std) or e for e, std in each])
    # Where that leads, the first form may do better from there, too.
    further = [r for r in found if r.fit.log_evidence > best.fit.log_evidence + SETTINGS.search_caught]
    return [*found, *(again for r in further for again in in_kindred_form(nominal, records, r))]


def _in_form(nominal: Model, records: Records, best: Ranked, forms: Sequence[Effect]) -> list[Ranked]:
    """A hypothesis with its causes in other forms, fitted from where it stands; none where they are its own."""
    effects, names = best.fit.hypothesis.effects, best.name.split(" + ")
    if not best.refined or tuple(forms) == effects or len(names) != len(effects):
        return []
    hypothesis = replace(best.fit.hypothesis, effects=tuple(forms))
    steps, x = SETTINGS.search_most_law_steps, best.fit.x[: best.fit.first_effect]
    again = refit(nominal, records, hypothesis, x, steps, near=best.fit)
    each = zip(names, effects, forms, strict=True)
    # Named as candidates are: what is fitted better of a name stands for it.
    name = " + ".join(n if a is e else n.replace(e.effect, a.effect) for n, e, a in each)
    return [] if again is None else [Ranked(name, again, True)]


def once(ranked: Sequence[Ranked]) -> tuple[Ranked, ...]:
    """Every hypothesis by its best fit, best first: two causes are one pair, whichever of them was found first."""
    best: dict[frozenset[str], Ranked] = {}
    for r in sorted(ranked, key=lambda r: (not r.refined, -r.fit.log_evidence)):
        best.setdefault(frozenset(r.name.split(" + ")), r)
    return tuple(sorted(best.values(), key=lambda r: -r.fit.log_evidence))


def cost(fitted: Fit) -> float:
    """Twice the negative log evidence: what a χ² is worth once the freedom that it took is paid for."""
    return -2.0 * fitted.log_evidence


def some(outlook: Records) -> Records:
    """One record of each position and level, and every other of many, like the black squares of a board of the two."""
    of_place: dict[tuple[float | None, str], list[Entry]] = {}
    for e in sorted(outlook.entries, key=lambda e: e.driven or 0.0):
        same = of_place.setdefault(measured_at(e), [])
        # Another session at a level tells of drift only.
        if not same or e.driven is None or e.driven > SETTINGS.level_apart * (same[-1].driven or 0.0):
            same.append(e)
    squares = [(i + k, e) for i, same in enumerate(of_place.values()) for k, e in enumerate(same)]
    alternate = len(squares) > SETTINGS.scan_records
    return replace(outlook, entries=tuple(e for k, e in squares if not alternate or k % 2 == 0))


def numbered(ranked: Sequence[Hypothesis]) -> list[int]:
    """Number of each of some ranked hypotheses, the forms of a restoring force counting as one."""
    # Of a contact beside a spring and within it the wrong one may seem to promise more.
    keys = [
        i if h.linear else tuple((e.effect, e.place, *identifying_values(e)) for e in h.effects)
        for i, h in enumerate(ranked)
    ]
    numbers = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return [numbers[key] for key in keys]


def first_with_forms(ranked: Sequence[tuple[NameT, Scanned]], most: int) -> list[tuple[NameT, Scanned]]:
    """The first of some ranked causes, with all of their forms."""
    return [row for i, row in zip(numbered([s.hypothesis for _, s in ranked]), ranked, strict=True) if i < most]


def promising(
    scan: Scan, names: Sequence[NameT], starts: Sequence[Sequence[Effect]], most: int, workers: Workers
) -> list[tuple[NameT, Scanned]]:
    """Causes that promise most on top of a fit, with their forms, each where it explains most; best first."""
    scanned = _by_gain(names, workers.map(scan.promise, starts))
    ahead = first_with_forms(scanned, most)
    return _by_gain([name for name, _ in ahead], workers.map(scan.refined, [s for _, s in ahead]))


def nearest_in_shape(
    scan: Scan, names: Sequence[NameT], starts: Sequence[Sequence[Effect]], most: int, workers: Workers
) -> list[tuple[NameT, Scanned]]:
    """Causes, with their forms, of which some start is nearest to what was measured, each from there; nearest first."""
    found = sorted(zip(names, workers.map(scan.nearest, starts), strict=True), key=lambda row: row[1][0])
    return first_with_forms([(name, s) for name, (_, s) in found], most)


def _by_gain(names: Sequence[NameT], scanned: Sequence[Scanned]) -> list[tuple[NameT, Scanned]]:
    """Names with what was scanned of them, best first."""
    return sorted(zip(names, scanned, strict=True), key=lambda row: -row[1].gain)


def stepped(
    nominal: Model,
    records: Records,
    named: Sequence[tuple[NameT, Hypothesis]],
    warm: FloatArray | None,
    steps: int,
    workers: Workers,
) -> list[tuple[NameT, Fit]]:
    """Causes after their first steps, without those that run away."""
    step = partial(first_steps, nominal, records, warm=warm, steps=steps)
    fits = workers.map(step, [hypothesis for _, hypothesis in named])
    return [(name, f) for (name, _), f in zip(named, fits, strict=True) if f is not None]


def first_steps(
    nominal: Model,
    records: Records,
    hypothesis: Hypothesis,
    warm: FloatArray | None,
    steps: int,
    rival: float = np.inf,
) -> Fit | None:
    """A few steps on few lines, as long as their pace leads to the objective of a rival."""
    try:
        return fit(nominal, records, hypothesis, warm, steps, SETTINGS.search_coarse_gain, rival=rival)
    except CutvibError:
        return None


def acts_linearly(made: Fit) -> bool:
    """Whether a restoring force is one spring and damper at all amplitudes up to the largest: slip that never slips."""
    omega = 2 * np.pi * SETTINGS.simulation_hysteresis_at
    for element in made.model.nonlinear:
        motion = made.hypothesis.motions.get(element.port)
        if motion and not element.restoring_force.scale_free:
            amplitudes = motion * np.array([SETTINGS.search_least_amplitude, 1.0])
            weak, strong = element.restoring_force.describing_function(amplitudes, omega)
            if abs(strong - weak) < SETTINGS.search_level_change * max(abs(strong), abs(weak)):
                return True
    return False
