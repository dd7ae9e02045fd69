"""Two causes at once, where no single one is enough: a second one on top of the best."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import Ranked, first_steps, on_all_lines, promising, refit, some, stepped
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.errors import CutvibError
from cutvib_ss.results import FloatArray

_KINDS = {True: "of linear causes", False: "with a restoring force"}
"""What the two families of pairs are called."""


class _Base(NamedTuple):
    """A cause to which a second one is added."""

    name: str
    hypothesis: Hypothesis
    x: FloatArray


class Second(NamedTuple):
    """A cause that may be added."""

    candidate: Candidate  # The cause
    alone: Effect | None  # Its values where it was fitted to few lines by itself

    def starts(self, by_simulation: bool) -> tuple[Effect, ...]:
        """Its starts."""
        starts = self.candidate.starts
        return starts if self.alone is None or not by_simulation else (starts[0], self.alone)


@dataclass(frozen=True)
class _Family:
    """Pairs of linear causes, or those of which one at least is simulated."""

    nominal: Model  # The nominal model
    # The same few lines with a widened noise, which pulls from afar, and as measured, where they tell what is alike
    # under it
    wide: Records
    sharp: Records
    linear: bool  # Which family it is
    motion: Mapping[str, float]  # Largest motion at each place, from which restoring forces get their size
    workers: Workers  # Process pool
    # Pairs that were tried; those of one kind are not tried the other way round
    seen: set[tuple[str, ...]] = field(default_factory=set)

    def around(self, bases: Sequence[_Base], seconds: Sequence[Second]) -> list[tuple[Candidate, Fit]]:
        """Pairs on top of each base, and of the best second cause that was found; best first, fitted to few lines as measured."""
        tried: list[tuple[Candidate, Fit]] = []
        for round_ in range(len(bases) + 1):
            if round_ == len(bases) and (
                not tried or (not self.linear and tried[0][1].reduced > SETTINGS.pairs_astray)
            ):
                break
            # Every round of simulations takes as long as a step of the search.
            if round_ and not self.linear and not self.workers.begin("fitting more pairs with a restoring force"):
                break
            base = bases[round_] if round_ < len(bases) else _second_of(*tried[0])
            try:
                tried += self._with_second(base, seconds)
            except CutvibError:
                # On few lines, or without the other, a restoring force may run away.
                continue
            tried.sort(key=lambda pair: pair[1].objective)
            if tried and not self.linear and _enough_on_few(tried):
                break
        return tried

    def _with_second(self, base: _Base, seconds: Sequence[Second]) -> list[tuple[Candidate, Fit]]:
        """The second causes that promise most on top of a first."""
        added: dict[str, tuple[Effect, ...]] = {}
        for second in seconds:
            name = second.candidate.name
            first, other = base.hypothesis, second.candidate.starts[0]
            # A restoring force and a linear cause are climbed from both sides: each alone stands in for the other.
            mixed = first.linear != other.linear
            names = (base.name, name) if mixed else tuple(sorted((base.name, name)))
            # Two restoring forces of one port were tried before: those of one kind are one of another form.
            alike = not first.linear and not other.linear and first.place == other.place
            if base.name == name or alike or names in self.seen or (first.linear and other.linear) != self.linear:
                continue
            self.seen.add(names)
            added[f"{base.name} + {name}"] = second.starts(by_simulation=not self.linear)
        if not added:
            return []
        most, steps = (
            (SETTINGS.pairs_seconds, SETTINGS.search_later_steps)
            if self.linear
            else (SETTINGS.pairs_law_seconds, SETTINGS.search_law_steps)
        )
        rough: dict[str, Fit] = {}
        for scan, fitted_on in self._views(base):
            ahead = promising(scan, list(added), list(added.values()), most, self.workers)
            new = [(name, s.hypothesis) for name, s in ahead if name not in rough and s.gain >= scan.least]
            rough.update(stepped(self.nominal, fitted_on, new, scan.warm, steps, self.workers))
        # As measured the steps of a restoring force are as expensive again: its two best are enough.
        best = sorted(rough.items(), key=lambda row: row[1].objective)[: len(rough) if self.linear else 2]
        step = partial(first_steps, self.nominal, self.sharp, steps=steps)
        fits = self.workers.map(step, [f.hypothesis for _, f in best], [f.x for _, f in best])
        found = [(Candidate(name, ()), f) for (name, _), f in zip(best, fits, strict=True) if f is not None]
        alone = None if self.linear or not found else step(base.hypothesis, base.x)
        # What the first does not gain by it is none of its own.
        return found if alone is None else [row for row in found if alone.objective - row[1].objective > 1.0]

    def _views(self, base: _Base) -> Iterator[tuple[Scan, Records]]:
        """Scans of second causes, and the records on which these take their first steps."""
        # What is small beside the widened noise shows as measured, once the first cause is right.
        scan = self._scan(self.wide, base, base.x)
        hidden = scan.leaves < SETTINGS.search_enough * scan.left.size
        if self.linear:
            if not hidden:
                yield scan, self.wide
            yield self._scan(self.sharp, base, base.x), self.sharp
        # Restoring forces, whose every scan is a simulation, are scanned once: as measured where the first cause leaves nothing in
        # the widened noise, and else from afar.
        elif hidden:
            yield self._scan(self.sharp, base, base.x), self.sharp
        # The tuning of a linear cause that lacks its restoring force leads away from both: that is scanned with nothing tuned.
        else:
            yield self._scan(self.wide, base, None) if base.hypothesis.linear else scan, self.wide

    def _scan(self, records: Records, base: _Base, x: FloatArray | None) -> Scan:
        """What is on top of a first cause, on a part of the records where it is simulated."""
        few = records if self.linear else some(records)
        return Scan(self.nominal, few, base.hypothesis, x, self.motion, apart=not self.linear)


def fit_pairs(
    nominal: Model,
    records: Records,
    ranked: Sequence[Ranked],
    seconds: Sequence[Second],
    motion: Mapping[str, float],
    workers: Workers,
    alike: bool = True,
    by_level: bool = False,
) -> list[Ranked]:
    """
    A second cause on top of the best single ones, two linear ones only where they may explain what is `alike` at all levels.

    Where the response changes `by_level`, which no two linear causes explain, those with a restoring force come first.
    It is tried on top of the one that was the best second, too: a cause that stood in for two may then give way.
    """
    best: dict[tuple[str, str], _Base] = {}
    singles = [r for r in ranked if r.refined and len(r.fit.hypothesis.causes) == 1]
    for r in sorted(singles, key=lambda r: -r.fit.log_evidence):
        key = (r.fit.hypothesis.effect, r.fit.hypothesis.place)
        best.setdefault(key, _Base(r.name, r.fit.hypothesis, r.fit.x))
    # A linear one far behind a restoring force is no part of a pair without it.
    bases = list(best.values())[: SETTINGS.pairs_first if alike else 1]
    first = max((r for r in ranked if r.refined), key=lambda r: r.fit.log_evidence).fit
    # Beside a restoring force that leaves noise, a second cause only relieves the tuning: its optimum is near.
    near = first if not first.hypothesis.linear and first.reduced < SETTINGS.search_enough else None
    seen: set[tuple[str, ...]] = set()
    out: list[Ranked] = []
    few: Records | None = None
    on_few: dict[str, float] = {}
    families = [(True, records.still.coarse), (False, records.for_laws)]
    for linear, of_lines in reversed(families) if by_level else families:
        wide, sharp = (
            of_lines(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error),
            of_lines(SETTINGS.search_coarse_lines, 0.0),
        )
        if wide is None or sharp is None:
            break
        if linear and not alike:
            continue
        if linear == by_level and not workers.begin(f"fitting pairs {_KINDS[linear]}", SETTINGS.search_work_pairs):
            break
        tried = _Family(nominal, wide, sharp, linear, motion, workers, seen).around(bases, seconds)
        # On few lines no single cause is a rival, for none is enough.
        fitted = on_all_lines(
            nominal, records, tried[:2], 1, (np.inf, first.log_evidence), workers, close=SETTINGS.pairs_close, near=near
        )
        out += [r for r in fitted if r.refined]
        if not linear:
            few, on_few = sharp, {c.name: f.objective for c, f in tried}
        if tried and _enough_on_few(tried):
            break
    # A cause that is far behind its pair on few records is not simulated on all.
    worth = partial(_may_stand_alone, nominal, few, on_few)
    return [*out, *by_themselves(nominal, records, out, ranked, worth=worth)]


def _may_stand_alone(
    nominal: Model, few: Records | None, on_few: Mapping[str, float], pair: Ranked, effect: Effect
) -> bool:
    """Whether a cause of a pair is not far behind the pair's objective on few records, the tuning free to give way."""
    if few is None or pair.name not in on_few:
        return True
    hypothesis, x = replace(pair.fit.hypothesis, effects=(effect,)), pair.fit.x[: pair.fit.first_effect]
    alone = first_steps(nominal, few, hypothesis, x, SETTINGS.search_law_steps)
    return alone is not None and alone.objective - on_few[pair.name] < SETTINGS.search_close


def _enough_on_few(tried: Sequence[tuple[Candidate, Fit]]) -> bool:
    """Whether the best of some fits leaves no more than noise."""
    best = tried[0][1]
    return best.reduced < SETTINGS.search_enough


def _second_of(pair: Candidate, fitted: Fit) -> _Base:
    """The second cause of a pair, as a first one."""
    alone = replace(fitted.hypothesis, effects=fitted.hypothesis.effects[-1:])
    return _Base(pair.name.split(" + ")[-1], alone, fitted.x[: fitted.first_effect])


def by_themselves(
    nominal: Model,
    records: Records,
    pairs: Sequence[Ranked],
    ranked: Sequence[Ranked],
    few: Mapping[str, float] | None = None,
    worth: Callable[[Ranked, Effect], bool] = lambda pair, effect: True,
) -> list[Ranked]:
    """
    Each cause of the best pair by itself, from its values there: of linear causes, of restoring forces, and of one of each.

    Where both were fitted to few lines, only that which left less there, by their names; and only what is worth it.
    """
    own = {
        r.fit.hypothesis.causes: r.fit.objective for r in sorted(ranked, key=lambda r: -r.fit.objective) if r.refined
    }
    # The own fit of such a cause may have been caught in a side minimum, or never begun.
    out = []
    for kinds in ({True}, {False}, {True, False}):
        found = [r for r in pairs if {e.linear for e in r.fit.hypothesis.effects} == kinds]
        if not found:
            continue
        best = max(found, key=lambda r: r.fit.log_evidence)
        parts = list(zip(best.name.split(" + "), best.fit.hypothesis.effects, strict=True))
        if few is not None and all(name in few for name, _ in parts):
            parts = [min(parts, key=lambda part: few[part[0]])]
        for name, effect in parts:
            if not worth(best, effect):
                continue
            steps = SETTINGS.search_most_steps if effect.linear else SETTINGS.search_most_law_steps
            # A restoring force's range goes by the motion that the pair's hypothesis holds.
            hypothesis = replace(best.fit.hypothesis, effects=(effect,))
            # It is of use if it leads to more than its own fit did.
            rival = own.get(hypothesis.causes, np.inf)
            alone = refit(nominal, records, hypothesis, best.fit.x[: best.fit.first_effect], steps, best.fit, rival)
            # Without the other it may run away.
            if alone is not None:
                out.append(Ranked(name, alone, True))
    return out
