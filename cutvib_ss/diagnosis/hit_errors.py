"""Names of the directions in which hits and set-ups are off, and where a head is taken to be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

if TYPE_CHECKING:
    from cutvib_ss.diagnosis.records import Group

# A direction in which records are off: a "hit" of a hand, "late" (of which record), "aim" or "placing" (set-up); its number.
Hit: TypeAlias = tuple[str, int, int]
SET_UPS = ("aim", "placing")


class Placed(NamedTuple):
    """Where the head is taken to be, about which its position error is small."""

    position: float  # y / L
    error: float  # That less the stated position, in units of set-up errors


def taken_at(hits: Iterable[Hit], placed: Placed | None) -> dict[Hit, float]:
    """Where errors of a record's hits and set-up are taken to be, in the units of their directions."""
    return {key: placed.error if placed is not None and key[0] == "placing" else 0.0 for key in hits}


def taken_in(groups: Iterable[Group], hits: Sequence[Hit]) -> tuple[float, ...]:
    """The same of all records of some groups, one of each direction."""
    found = {key: at for g in groups for e, *_ in g.entries for key, at in taken_at(e.hits, e.placed).items()}
    return tuple(found.get(key, 0.0) for key in hits)
