"""What answers keep of their probability where their form is not what the records show."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from cutvib_ss.diagnosis.held_out import HeldOut
from cutvib_ss.diagnosis.posterior import UNKNOWN, best, give, is_there, kind_of
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.settings import SETTINGS


def of_known_form(
    ranked: Sequence[Ranked],
    odds: Mapping[str, float],
    held: Callable[[Ranked], HeldOut],
    untried: bool = False,
) -> dict[str, float]:
    """
    Probabilities in which an answer whose form nothing here has is not sure.

    Where a parameter ends at its range although other values lie beyond, or discrepancies or tuned values lie beyond what is
    believed (`Fit.beyond_belief`), or held-out records show far more than noise as stated, or a larger error than the re-tuned
    model has there, the form is not known, and no more is the cause. Nor is no cause sure where a tuned value lies out of any
    tolerance; nor a restoring force that needs the largest error of its prior at one level, or leaves more than noise beside it on
    held-out records. What such answers lose lies on something unknown: with it the probabilities sum to one. A cause that ends
    where another takes over, as a resonance far above the band is a mass, has that one's name by now. Where elements of unknown
    form were left `untried`, no cause is sure that leaves more than noise.

    An unknown element has no form that could err, but a known cause in a form that the catalogue lacks fits no other hypothesis
    either: no evidence tells the two apart, and priors have to. A known cause of its place is the answer in another form, and
    keeps what such an answer keeps, where it leaves no more of what the element explains than the largest error of its dynamic
    stiffness that is believed: squared, since the excess is of squares. Else the nearest known cause has the rest of an unknown
    element, or no cause where the re-tuned model leaves little; and of a known cause beside one the nearest pair of that cause
    with another known one, where it leaves no more than noise. Where no hypothesis is believed the known cause of most evidence has
    what is more than such an answer keeps.
    """
    out = dict(odds)
    likely = [r for r in ranked if odds[r.name] >= SETTINGS.verdict_hardly and r.fit.hypothesis.causes]
    bare = next((r for r in ranked if r.refined and not r.fit.hypothesis.effects), None)
    strained = [
        r
        for r in likely
        if not _is_unknown(r)
        and r.refined
        and (
            of_another_form(r, held)
            or r.fit.at_end
            or (bare is not None and _leaves_more(held(r), held(bare)))
            # What was not computed is not ruled out.
            or (untried and held(r).reduced > SETTINGS.verdict_noise)
            or _errs_too_much(r, held(r))
        )
    ]
    if bare is not None and bare.fit.tuned_out:
        # No cause is what tuning within tolerance explains.
        strained.append(bare)
    for r in strained:
        out[r.name] *= SETTINGS.verdict_form
    _among_kindred(likely, [r for r in ranked if r.refined], out)
    if bare is not None:
        _among_places(likely, [r for r in ranked if r.refined], bare, out, held)
    # What may as well be nothing is no form of anything.
    named = [r for r in ranked if r.refined and UNKNOWN not in dict(r.fit.hypothesis.causes) and is_there(r)]
    for r in [r for r in likely if r not in strained and r.fit.hypothesis.causes[-1][0] == UNKNOWN]:
        known, part = _another_form(r, named, out, held)
        if known:
            give(out, r, known, part)
    _by_one_name(likely, out)
    # Where no hypothesis is left that is believed, a known cause in another form is as possible as before.
    nameless, nearest = 1.0 - sum(out.values()), best(r for r in named if kind_of(r.fit.hypothesis) == "known")
    if nearest is not None and nameless > SETTINGS.verdict_form:
        out[nearest.name] += nameless - SETTINGS.verdict_form
    return out


def _by_one_name(likely: Sequence[Ranked], odds: dict[str, float]) -> None:
    """The likeliest known cause, alone and beside something unknown, in one where another answer would come between the two."""
    groups: dict[frozenset[tuple[str, str]], list[Ranked]] = {}
    for r in likely:
        if known := frozenset(c for c in r.fit.hypothesis.causes if c[0] != UNKNOWN):
            groups.setdefault(known, []).append(r)
    if not groups:
        return
    total = {known: sum(odds[r.name] for r in same) for known, same in groups.items()}
    likeliest = max(groups, key=lambda known: total[known])
    first, *others = sorted(groups.pop(likeliest), key=lambda r: -odds[r.name])
    named = [odds[r.name] for same in groups.values() for r in same]
    # What an unknown element has, and what nothing here has.
    nameless = 1.0 - sum(p for name, p in odds.items() if name not in {r.name for r in likely if _is_unknown(r)})
    if odds[first.name] < max([nameless, *named]) < total[likeliest]:
        for r in others:
            give(odds, r, first)


def _among_kindred(likely: Sequence[Ranked], refined: Sequence[Ranked], odds: dict[str, float]) -> None:
    """Share what a cause and its kindred one have by their odds, unless the better errs less."""
    # Where the form of both errs as much the records show a third, and which of the two is the nearer tells nothing of the cause.
    seen: set[str] = set()
    for r in sorted(likely, key=lambda r: -odds[r.name]):
        effects = r.fit.hypothesis.effects
        each = zip(effects, r.fit.stds_of_effects, strict=True)
        known = [(e, k) for e, stds in each if (k := e.kindred(stds)) is not None]
        if len(known) != 1 or not r.refined or r.name in seen:
            continue
        [(effect, kin)] = known
        causes = tuple((kin.effect, c[1]) if c == (effect.effect, effect.place) else c for c in r.fit.hypothesis.causes)
        other = best(x for x in refined if x.fit.hypothesis.causes == causes)
        if other is None:
            continue
        seen.add(other.name)
        if r.fit.spread.sizes.cause < other.fit.spread.sizes.cause:
            continue
        ratio = effect.odds_to_kindred(r.fit.hypothesis.motions[effect.place])
        both = odds[r.name] + odds[other.name]
        odds[r.name], odds[other.name] = both * ratio / (1.0 + ratio), both / (1.0 + ratio)


def _among_places(
    likely: Sequence[Ranked],
    refined: Sequence[Ranked],
    bare: Ranked,
    odds: dict[str, float],
    held: Callable[[Ranked], HeldOut],
) -> None:
    """Share the probability of a linear cause whose error is the largest of its prior with other places that fit as well."""
    # The places differ by less than that error, so the evidence between them is that of the error, not of the place.
    for r in likely:
        if kind_of(r.fit.hypothesis) != "known" or not (r.fit.hypothesis.linear and r.fit.spread.largest("cause")):
            continue
        [(effect, place)] = r.fit.hypothesis.causes
        found: dict[str, Ranked] = {}
        for x in sorted(refined, key=lambda x: x.fit.log_evidence):
            if (
                kind_of(x.fit.hypothesis) == "known"
                and x.fit.hypothesis.effect == effect
                and x.fit.hypothesis.place != place
            ):
                found[x.fit.hypothesis.place] = x
        close = [x for x in found.values() if _as_much(held(x).squares, held(r).squares, held(bare).squares)]
        if close and odds[r.name] > max(odds[x.name] for x in close):
            together = (odds[r.name] + sum(odds[x.name] for x in close)) / (1 + len(close))
            odds |= {x.name: together for x in (r, *close)}


def _errs_too_much(r: Ranked, judged: HeldOut) -> bool:
    """Whether a restoring force needs the largest error of its prior, at one level, or leaves more than noise beside it."""
    # One level shows what it does, and no other what else would do the same.
    needs = not r.fit.hypothesis.linear and r.fit.spread.largest("cause")
    return needs and (_at_one_level(judged) or judged.reduced > SETTINGS.verdict_noise)


def _at_one_level(judged: HeldOut) -> bool:
    """Whether all records were driven as hard."""
    return len({j.entry.level_step for j in judged.records}) == 1


def _is_unknown(r: Ranked) -> bool:
    """Whether a hypothesis is something unknown alone."""
    return kind_of(r.fit.hypothesis) == UNKNOWN


def _another_form(
    r: Ranked, named: Sequence[Ranked], odds: Mapping[str, float], held: Callable[[Ranked], HeldOut]
) -> tuple[Ranked | None, float]:
    """The known cause that something unknown may be in another form, and the part of its probability that it has then."""
    *first, _ = r.fit.hypothesis.causes
    rest = 1.0 - SETTINGS.verdict_form
    if first:
        nearest = best(x for x in named if len(x.fit.hypothesis.causes) > 1 and first[0] in x.fit.hypothesis.causes)
        return (nearest, rest) if nearest and held(nearest).reduced <= SETTINGS.verdict_noise else (None, rest)
    single = [x for x in named if kind_of(x.fit.hypothesis) == "known"]
    bare = best(x for x in named if not x.fit.hypothesis.causes)
    here = best(x for x in single if x.fit.hypothesis.place == r.fit.hypothesis.place)
    if bare and here and _as_much(held(here).squares, held(r).squares, held(bare).squares):
        # Of what both have together it keeps as much as the answer in another form does.
        both = odds[here.name] + odds[r.name]
        return here, max(SETTINGS.verdict_form * both - odds[here.name], 0.0) / odds[r.name]
    # Where no known cause is there at all and the re-tuned model leaves little, it may be nothing.
    nothing = bare if bare and held(bare).against_stated <= SETTINGS.verdict_misfit else None
    return best(x for x in named if x.fit.hypothesis.causes) or nothing, rest


def _as_much(known: float, unknown: float, bare: float) -> bool:
    """Whether a known cause closes what an unknown element does but for the largest error of a cause, by their mean squares."""
    return known < bare and known - unknown <= SETTINGS.sizes["cause"][-1][0] ** 2 * (bare - unknown)


def of_another_form(r: Ranked, held: Callable[[Ranked], HeldOut]) -> bool:
    """Whether causes only stand because their model errs by more than is believed."""
    beyond = bool(r.fit.at_end) and not r.fit.hypothesis.linear
    return beyond or r.fit.beyond_belief or held(r).against_stated > SETTINGS.verdict_misfit


def _leaves_more(cause: HeldOut, bare: HeldOut) -> bool:
    """Whether a cause leaves a larger error than the re-tuned model: of held-out records by more than its standard error."""
    if bare.reduced > SETTINGS.verdict_misfit:
        # Of the larger error the cause knows, by its drift and residual modes; of its own the re-tuned model does not.
        return False
    more = np.array([j.squares - other.squares for j, other in zip(cause.records, bare.records, strict=True)])
    if not cause.unseen:
        # Of a record that it was fitted to any cause should leave less.
        return bool(more.mean() > 0.0)
    return bool(more.mean() > np.std(more, ddof=1) / np.sqrt(more.size)) if more.size > 1 else False
