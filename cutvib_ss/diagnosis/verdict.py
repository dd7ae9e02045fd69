"""What may be concluded from the causes' probabilities."""

from __future__ import annotations

from collections.abc import Sequence

from cutvib_ss.diagnosis.result import Cause, Verdict
from cutvib_ss.diagnosis.settings import SETTINGS


def ambiguity_set(causes: Sequence[Cause]) -> tuple[int, ...]:
    """The smallest set of causes that carries 0.95."""
    total, out = 0.0, []
    for i, cause in enumerate(causes):
        out.append(i)
        total += cause.probability
        if total >= SETTINGS.verdict_set - 1e-9:
            break
    return tuple(out)


def verdict(causes: Sequence[Cause], shrinks: bool = True, at_end: bool = False) -> Verdict:
    """What may be concluded; the first that holds."""
    best = causes[0]
    none = next((c.probability for c in causes if c.effect == "none"), 0.0)
    if none >= SETTINGS.verdict_half:
        return "no_gap"
    if sum(c.probability for c in causes if c.effect == "unknown") > SETTINGS.verdict_half:
        return "unknown"
    partly: dict[tuple[str, str], float] = {}
    for c in causes:
        known, _, last = c.effect.rpartition("+")
        if last == "unknown" and known:
            key = (known, c.place.rpartition("+")[0])
            partly[key] = partly.get(key, 0.0) + c.probability
    if shrinks and not at_end:
        if (
            best.probability >= SETTINGS.verdict_sure
            and best.effect not in ("none", "unknown")
            and not best.effect.endswith("+unknown")
        ):
            return "explained"
        if max(partly.values(), default=0.0) >= SETTINGS.verdict_sure:
            return "partly_explained"
    return "ambiguous"


def place_set(places: Sequence[tuple[str, float]]) -> tuple[str, ...]:
    """The smallest set of places that carries 0.95."""
    total, out = 0.0, []
    for place, p in places:
        out.append(place)
        total += p
        if total >= SETTINGS.verdict_set - 1e-9:
            break
    return tuple(out)
