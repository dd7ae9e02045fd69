"""
First fits of a search, on few lines with a widened noise: linear causes from the best of their starts, scanned restoring forces.

Sharp peaks then pull from afar, and no start is lost in a side minimum of a precise measurement.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.linearity import level_stands_out
from cutvib_ss.diagnosis.metrics import ALL
from cutvib_ss.diagnosis.posterior import kind_of
from cutvib_ss.diagnosis.ranking import (
    Ranked,
    cost,
    first_steps,
    first_with_forms,
    nearest_in_shape,
    promising,
    refit,
    some,
    stepped,
)
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.scan import Scan
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulation import problem_for
from cutvib_ss.diagnosis.small_sizes import scan_beside, weak
from cutvib_ss.diagnosis.starts import at_stiffnesses
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.base import Effect, Model, channels_of
from cutvib_ss.effects.catalogue import is_alias
from cutvib_ss.effects.law_element import LawElement
from cutvib_ss.errors import CutvibError, ParameterError
from cutvib_ss.model.paths import value_at
from cutvib_ss.results import FloatArray

_GAIN = ("gain", "phase")
"""Values of a channel in the measurement chain that its calibration error moves."""


def tuned_scout(nominal: Model, few: Records) -> Fit:
    """The model without a cause on few lines, from its stiffness as given, or as looked through where that leads elsewhere."""
    problem = problem_for(nominal, few, Hypothesis())
    near = at_stiffnesses(problem, problem.start())
    start = partial(
        fit,
        nominal,
        few,
        Hypothesis(),
        max_iterations=SETTINGS.search_later_steps,
        tolerance=SETTINGS.search_coarse_gain,
    )
    given = start()
    if not near.any():
        return given
    looked = start(near)
    return looked if looked.log_evidence > given.log_evidence + SETTINGS.search_caught else given


def beside_tuned(
    nominal: Model, records: Records, accepted: Ranked, found: Sequence[Candidate], workers: Workers
) -> list[Ranked]:
    """The linear causes that the residual of a fit speaks for most, fitted beside it on all lines: it leaves only noise."""
    # What is small beside the noise is smaller still beside a widened one, and its optimum is near.
    there, under = accepted.fit, accepted.fit.hypothesis
    scan = scan_beside(nominal, records, there)
    tried = workers.map(scan.each, [c.starts for c in found])
    best = [max((gain, -k) for k, (_, gain) in enumerate(rows)) for rows in tried]
    chosen = sorted(range(len(found)), key=lambda i: -best[i][0])[: SETTINGS.search_most_close]
    starts = [_from_tuning(nominal, scan, there, found[i].starts[-best[i][1]]) for i in chosen]
    again = partial(refit, nominal, records, steps=SETTINGS.search_most_steps, near=there)
    # What cannot be weak starts far off, and has to lead back to what the fit leaves; second causes, to what the first does.
    rival, fits = there.objective, []
    for some_of in (slice(1), slice(1, None)):
        hypotheses = [replace(under, effects=(*under.effects, e)) for e, _ in starts[some_of]]
        fits += workers.map(partial(again, rival=rival), hypotheses, [x for _, x in starts[some_of]])
        rival = min([rival, *(f.objective for f in fits if f is not None and under.effects)])
    names = [f"{accepted.name} + {found[i].name}" if under.effects else found[i].name for i in chosen]
    return [Ranked(name, f, True) for name, f in zip(names, fits, strict=True) if f is not None]


def relieved(
    nominal: Model, records: Records, best: Ranked, linear: Sequence[Candidate], workers: Workers
) -> list[Ranked]:
    """
    The best cause beside linear ones that no residual shows.

    Those are what moves a value that its fit has far out of its tolerance, and, beside a linear cause, all others where it leaves
    noise by an error of its own that is larger than most: that may be a second cause.
    """
    if kind_of(best.fit.hypothesis) != "known":
        return []
    first = dict(best.fit.hypothesis.causes)
    others = [c for c in linear if first.get(c.starts[0].effect) != c.starts[0].place]
    # As a lever's length the first cause's own form may appear, and as a damping what rubs: beside a linear cause nothing does.
    moved = [c for c in others if tuned_away(nominal, best.fit, c.starts[0])]
    moved = [c for c in moved if not _is_alias(c, beside_linear=best.fit.hypothesis.linear)]
    named = [c for c in others if not _is_alias(c)]
    errs, enough = best.fit.spread.is_large("cause"), best.reduced < SETTINGS.search_enough
    if not best.fit.hypothesis.linear:
        # For the form of a restoring force that errs tuning and gains may make up.
        return _in_place_of_tuning(nominal, records, best, moved, workers) if enough and not errs else []
    in_error = errs and enough
    missed = [*named, *(c for c in moved if c not in named)] if in_error else moved
    if not missed:
        return []
    found = beside_tuned(nominal, records, best, missed, workers)
    leading = max(found, key=lambda r: r.fit.log_evidence, default=None)
    if leading is None or leading.fit.log_evidence < best.fit.log_evidence + SETTINGS.search_caught:
        return found
    if in_error and len({place for _, place in leading.fit.hypothesis.causes}) == 1:
        # What makes up for an error best at the cause's own place is the cause in another form.
        shifted = {f"{best.name} + {c.name}" for c in moved}
        return [r for r in found if r.name in shifted]
    # It began so weak that the first fit's error, which becomes smaller step by step, has held most of it.
    further = refit(nominal, records, leading.fit.hypothesis, leading.fit.x, SETTINGS.search_most_steps)
    if further is None or further.log_evidence < leading.fit.log_evidence:
        return found
    return [replace(r, fit=further) if r is leading else r for r in found]


def _is_alias(c: Candidate, beside_linear: bool = False) -> bool:
    """Whether another cause, or a first one's form, may appear as this one."""
    return is_alias(c.starts[0].effect, vars(c.starts[0]), beside_linear)


def _in_place_of_tuning(
    nominal: Model, records: Records, best: Ranked, moved: Sequence[Candidate], workers: Workers
) -> list[Ranked]:
    """A restoring force beside linear causes that take over what its fit has far out of its tolerance, the farthest first."""
    there = best.fit
    # At its own place it is the force's form.
    elsewhere = [c for c in moved if c.starts[0].place != there.hypothesis.place]
    taken = [(c, started) for c in elsewhere if (started := _taking_over(nominal, there, c.starts[0])) is not None]
    chosen = sorted(taken, key=lambda row: float(np.sum(row[1][1] ** 2)))[: SETTINGS.pairs_law_seconds]
    again = partial(refit, nominal, records, steps=SETTINGS.search_most_law_steps, near=there, rival=there.objective)
    hypotheses = [replace(there.hypothesis, effects=(*there.hypothesis.effects, e)) for _, (e, _) in chosen]
    fits = workers.map(again, hypotheses, [x for _, (_, x) in chosen])
    return [Ranked(f"{best.name} + {c.name}", f, True) for (c, _), f in zip(chosen, fits, strict=True) if f is not None]


def _from_tuning(nominal: Model, scan: Scan, there: Fit, effect: Effect) -> tuple[Effect, FloatArray]:
    """A cause as it starts beside a fit, and the tuning there: with all of what a value is far out of its tolerance by, or weak."""
    taken = _taking_over(nominal, there, effect)
    return (weak(nominal, scan, effect), there.x[: there.first_effect].copy()) if taken is None else taken


def _taking_over(nominal: Model, there: Fit, effect: Effect) -> tuple[Effect, FloatArray] | None:
    """A cause with all that a value or gain of a fit is far out of its tolerance by, and the tuning with that in its middle."""
    x = there.x[: there.first_effect].copy()
    values = {path: (i, tolerance) for i, (path, tolerance) in enumerate(tuning_paths(nominal))}
    for c, own in there.constant.items():
        # To first order the real part of an error is that of the gain's logarithm, the imaginary one the phase.
        values |= {
            ("chain", "channels", c, n): (i, nominal.tolerance.calibration) for n, i in zip(_GAIN, own, strict=True)
        }
    applied = effect.apply(nominal)
    moved = [(name, *own) for name, carried in effect.moved_by(nominal, applied).items() for own in carried]
    for name, path, slope in moved:
        i, tolerance = values.get(path, (None, 0.0))
        if i is None or slope == 0.0 or abs(x[i]) <= SETTINGS.fit_tuned_away:
            continue
        given = value_at(nominal, path)
        tuned = given + tolerance * x[i] if path[-1] == "phase" else given * np.exp(tolerance * x[i])
        size = float(getattr(effect, name)) + (tuned - value_at(applied, path)) / slope
        with suppress(ParameterError):
            # Along the valley from one to the other the steps would be small.
            taken = effect.changed({name: size})
            x[i] = 0.0
            return taken, x
    return None


def scouted(
    nominal: Model, records: Records, few: Records, found: Sequence[Candidate], none: Ranked, workers: Workers
) -> list[tuple[Candidate, Fit]]:
    """The candidates that promise most, each from the best of its starts, on few lines; best first."""
    # The tuning of a model that lacks the cause leads away from a large one, and may take up nearly all of one that is not small:
    # it is scanned for from the untuned model. Of a small one the tuned model's residual tells.
    scans = []
    # Where the residual is far from all that first order tells of, all are fitted.
    if none.reduced < SETTINGS.search_first_order:
        sharp = records.coarse(SETTINGS.search_coarse_lines, 0.0)
        scans.append(Scan(nominal, sharp, Hypothesis(), none.fit.x, {}, apart=False))
    # The fits start from the untuned model, too: the order of starts is that of the last scan.
    scans.append(Scan(nominal, few, Hypothesis(), None, {}, apart=False))
    count = SETTINGS.search_scouted if none.reduced < SETTINGS.search_first_order else len(found)
    chosen: set[int] = set()
    for scan in scans:
        tried = workers.map(scan.each, [c.starts for c in found])
        best = [max(max(gains) for gains in rows) for rows in tried]
        chosen |= set(np.argsort(best)[::-1][:count].tolist())
    chosen |= {i for i, c in enumerate(found) if tuned_away(nominal, none.fit, c.starts[0])}
    ordered = [
        [found[i].starts[k] for k in sorted(range(len(tried[i])), key=lambda k: -tried[i][k][0])]
        for i in range(len(found))
    ]
    # The one that promises most is one for the others to come up to.
    kept = sorted(chosen, key=lambda i: -best[i])
    start = partial(_from_start, nominal, few)
    firsts = workers.map(start, [ordered[i][0] for i in kept[:1]])
    rival = min((f.objective for f in firsts if f is not None), default=np.inf)
    firsts += workers.map(partial(start, rival=rival), [ordered[i][0] for i in kept[1:]])
    # What the best reaches from its first start they have to come up to from the others.
    rival = min((f.objective for f in firsts if f is not None), default=np.inf)
    # Where the level stands out, no start of a linear cause leaves nothing: those that are far behind take no more.
    most = rival + SETTINGS.search_far if level_stands_out(records, none.fit.model) else np.inf
    climb = partial(_from_best_start, nominal, few, rival=rival, most=most)
    fits = workers.map(climb, [ordered[i] for i in kept], firsts)
    pairs = [(found[i], f) for i, f in zip(kept, fits, strict=True) if f is not None]
    return sorted(pairs, key=lambda pair: cost(pair[1]))


def beside_parts(
    nominal: Model,
    records: Records,
    few: Records,
    rough: Sequence[tuple[Candidate, Fit]],
    ranked: Sequence[Ranked],
    workers: Workers,
) -> list[Ranked]:
    """Causes on all lines, with those of the best that need errors of a structure's parts to come first."""
    if not nominal.matrix_parts:
        return list(ranked)
    # A widened noise hides no more than some percent, and parts that differ move resonances by more than they are wide.
    free, best = replace(few, widened=False), rough
    again = partial(refit, nominal, free, steps=SETTINGS.search_later_steps)
    fits = workers.map(again, [f.hypothesis for _, f in best], [f.x for _, f in best])
    found = sorted(
        ((c, f) for (c, _), f in zip(best, fits, strict=True) if f is not None), key=lambda pair: cost(pair[1])
    )
    have = {r.name for r in ranked if r.refined}
    missed = [(c, f) for c, f in found[: SETTINGS.search_parts_leading] if c.name not in have]
    on_all = partial(refit, nominal, records, steps=SETTINGS.search_most_steps)
    fits = workers.map(on_all, [f.hypothesis for _, f in missed], [f.x for _, f in missed])
    new = [Ranked(c.name, f, True) for (c, _), f in zip(missed, fits, strict=True) if f is not None]
    return [*new, *(r for r in ranked if r.name not in {r.name for r in new})]


def tuned_away(nominal: Model, there: Fit, effect: Effect) -> bool:
    """Whether a cause moves what a fit has far out of its tolerance, a value or a gain: no residual shows it."""
    if effect.measurement and there.calibrated_away.intersection(
        channels_of(effect.effect, getattr(effect, "channel", ALL), nominal)
    ):
        return True
    away = np.abs(there.x[: there.n_tuning]) > SETTINGS.fit_tuned_away
    strained = {path for (path, _), far in zip(tuning_paths(nominal), away, strict=True) if far}
    if effect.measurement and any(path[0] == "scales" for path in strained):
        # A gain is a mass and a stiffness that are off together.
        return True
    moved = effect.moved_by(nominal, effect.apply(nominal)) if strained else {}
    return any(path in strained for carried in moved.values() for path, _ in carried)


def _from_best_start(
    nominal: Model, few: Records, starts: Sequence[Effect], first: Fit | None, rival: float, most: float
) -> Fit | None:
    """A candidate from the best of its starts, which are in order of promise; None where the model takes none."""
    tries: list[Fit] = [] if first is None else [first]
    for k, e in enumerate(starts[1 : SETTINGS.search_starts_most], 1):
        left = min((f.reduced for f in tries), default=np.inf)
        far = min((f.objective for f in tries), default=np.inf) > most
        if k >= SETTINGS.search_starts_climbed and (left < SETTINGS.search_enough or far):
            # Far from the truth first order tells little of which start is best; these leave nothing beside the widened noise.
            break
        if (f := _from_start(nominal, few, e, rival)) is not None:
            tries.append(f)
    if not tries:
        return None
    best = min(tries, key=cost)
    steps, gain = SETTINGS.search_later_steps, SETTINGS.search_coarse_gain
    return fit(nominal, few, best.hypothesis, best.x, steps, gain, rival=rival)


def _from_start(nominal: Model, few: Records, start: Effect, rival: float = np.inf) -> Fit | None:
    """A cause after its first steps, from the untuned model: the tuning of a model that lacks the cause leads away."""
    return first_steps(nominal, few, Hypothesis((start,)), None, SETTINGS.search_start_steps, rival)


def scouted_laws(
    nominal: Model,
    outlook: Records,
    found: Sequence[Candidate],
    motion: Mapping[str, float],
    warm: FloatArray | None,
    workers: Workers,
    left: bool = True,
) -> list[tuple[Candidate, Fit]]:
    """The same for restoring forces, whose steps are expensive: each is scanned, and those that promise most take some."""
    scan, faint_too = Scan(nominal, some(outlook), Hypothesis(), warm, motion, apart=True), warm is not None
    if scan.underneath is not None and scan.underneath.reduced > SETTINGS.search_small:
        # On few lines the tuned model is not what it is on all: its tuning alone, without what stands beside it, leads astray.
        # Where it leaves noise on all there is too little to look for.
        warm, faint_too = _tuned_to_the_softest(nominal, outlook) if left else None, False
        scan = Scan(nominal, some(outlook), Hypothesis(), None, motion, apart=True, tuned=warm)
    ahead = promising(scan, found, [c.starts for c in found], SETTINGS.search_laws_looked_at, workers)
    ahead = first_with_forms(ahead, SETTINGS.search_laws_started)
    if scan.is_far and all(s.gain < SETTINGS.search_leads * scan.leaves for _, s in ahead):
        # No start comes near: resonances lie apart by more than they are wide, and squares over the noise tell little.
        ahead += nearest_in_shape(scan, found, [c.starts for c in found], SETTINGS.search_laws_started, workers)
    tried = [(c, s.hypothesis) for c, s in ahead]
    out = stepped(nominal, outlook, tried, warm, SETTINGS.search_law_steps, workers)
    if faint_too:
        # Beside a tuned model that leaves little every start may be far too strong.
        faint = [(c, h) for c, _ in ahead for h in scan.faint(c.starts)]
        out += stepped(nominal, outlook, faint, warm, SETTINGS.search_law_steps, workers)
    return _first_of_each(out)


def _first_of_each(fits: Sequence[tuple[Candidate, Fit]]) -> list[tuple[Candidate, Fit]]:
    """Of fits from several starts the best of each cause; best first."""
    by_name = {c.name: (c, f) for c, f in sorted(fits, key=lambda pair: -cost(pair[1]))}
    return sorted(by_name.values(), key=lambda pair: cost(pair[1]))


def _tuned_to_the_softest(nominal: Model, records: Records) -> FloatArray | None:
    """Unknowns of the model tuned to the records of least level; None where all are of one, or it leaves much of them."""
    # At one level a restoring force is nearly one spring and damper, which the tuning takes up. What is left is how it changes.
    softest = min(e.level_step for e in records.entries)
    few = tuple(e for e in records.entries if e.level_step == softest)
    if len(few) == len(records.entries):
        return None
    try:
        # Its lines stand for all: what leaks from blocks leaks.
        made = fit(nominal, replace(records, entries=few, rough=False), Hypothesis())
    except CutvibError:
        return None
    return made.x if made.reduced < SETTINGS.search_small else None


def springs_with_dampers(
    nominal: Model,
    outlook: Records,
    rough: Sequence[tuple[Candidate, Fit]],
    found: Sequence[Candidate],
    motion: Mapping[str, float],
    workers: Workers,
) -> list[tuple[Candidate, Fit]]:
    """
    The best restoring force with those of its port that lose energy where it stores it, or the other way round; best first.

    A clamp that hardens rubs, too: neither alone says anything of such a port. What is best beside the first is a first one, too.
    None where nothing takes away a tenth of what the first leaves.
    """
    out: dict[frozenset[str], tuple[Candidate, Fit]] = {}
    name, hypothesis, x = rough[0][0].name, rough[0][1].hypothesis, rough[0][1].x
    most = (1.0 - SETTINGS.search_leads) * rough[0][1].reduced
    for _ in range(2):
        [first] = hypothesis.effects
        here = [c for c in found if c.starts[0].place == first.place]
        others = [c for c in here if {_loses(c.starts[0]), _loses(first)} == {False, True}]
        try:
            scan = Scan(nominal, some(outlook), hypothesis, x, motion, apart=True)
        except CutvibError:
            # Without the other it may run away.
            break
        ahead = promising(scan, others, [c.starts for c in others], SETTINGS.pairs_law_seconds, workers)
        tried = [(c, s.hypothesis) for c, s in ahead]
        for c, f in stepped(nominal, outlook, tried, scan.warm, SETTINGS.search_law_steps, workers):
            key = frozenset((name, c.name))
            if f.reduced < most and (key not in out or cost(f) < cost(out[key][1])):
                out[key] = (Candidate(f"{name} + {c.name}", ()), f)
        if not out:
            break
        best, there = min(out.values(), key=lambda pair: cost(pair[1]))
        name, x = best.name.split(" + ")[1], there.x[: there.first_effect]
        hypothesis = replace(there.hypothesis, effects=there.hypothesis.effects[1:])
    return sorted(out.values(), key=lambda pair: cost(pair[1]))


def _loses(effect: Effect) -> bool | None:
    """Whether a restoring force takes energy out of a harmonic motion; None where that is not told."""
    return effect.restoring_force().dissipates() if isinstance(effect, LawElement) else None
