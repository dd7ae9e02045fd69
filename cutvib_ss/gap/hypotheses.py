"""Every cause that the catalogue allows on a model, each with the starts from which it is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cutvib_ss.effects.base import Effect, Measured, Model, Motion, discrete_values
from cutvib_ss.effects.catalogue import EFFECTS


@dataclass(frozen=True)
class Candidate:
    """
    A cause with its starts.

    Parameters
    ----------
    name : str
        Effect, place and what is discrete about it: tells candidates apart.
    starts : tuple of Effect
        The same cause at several starting values.
    """

    name: str
    starts: tuple[Effect, ...]


def candidates(model: Model, band: tuple[float, float], channels: Sequence[str]) -> tuple[Candidate, ...]:
    """All single linear causes on a model, for a measurement of some channels in a band [Hz]."""
    found = _found(model, Measured(band, tuple(channels)), linear=True)
    # Causes of one channel follow each other, whichever they are.
    rank = {c: i for i, c in enumerate(("all", *channels))}
    at = [rank.get(discrete_values(c.starts[0]).get("channel", ""), -1) for c in found]
    ordered = iter(sorted((i for i, r in enumerate(at) if r >= 0), key=lambda i: at[i]))
    return tuple(found[next(ordered)] if r >= 0 else c for c, r in zip(found, at, strict=True))


def nonlinear_candidates(model: Model, motions: Mapping[str, Motion]) -> tuple[Candidate, ...]:
    """All single causes that depend on the level, or on the sign, of the motion; starts go by how each place moves."""
    return tuple(_found(model, Measured(motions=motions), linear=False))


def _found(model: Model, measured: Measured, linear: bool) -> list[Candidate]:
    return [
        Candidate(f"{kind.effect} {what}".strip(), starts)
        for kind in EFFECTS.values()
        if kind.linear is linear
        for what, starts in kind.starts(model, measured)
    ]
