"""Every cause that the catalogue allows on a model, each with the starts from which it is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.effects.base import Effect, Measured, Model, Motion, discrete_values, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.errors import CutvibError, ParameterError
from cutvib_ss.response.frequency import ChainedResponse, output_quantities


@dataclass(frozen=True)
class Candidate:
    """A cause with its starts."""

    name: str  # Effect, place and what is discrete about it: tells candidates apart
    starts: tuple[Effect, ...]  # The same cause at several starting values


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


def considered(model: Model, band: tuple[float, float], channels: Sequence[str]) -> dict[tuple[str, str], int]:
    """Effect and place of every cause of the catalogue that a model can have, with its number of variants."""
    found: dict[tuple[str, str], int] = {}
    for candidate in candidates(model, band, channels):
        key = (candidate.starts[0].effect, candidate.starts[0].place)
        found[key] = found.get(key, 0) + 1
    found.update(
        {
            (kind.effect, place): kind.forms(model, place)
            for kind in EFFECTS.values()
            if not kind.linear
            for place in kind.places(model)
        }
    )
    return found


def _found(model: Model, measured: Measured, linear: bool) -> list[Candidate]:
    out = []
    for kind in EFFECTS.values():
        if kind.linear is linear:
            own = [Candidate(f"{kind.effect} {what}".strip(), starts) for what, starts in kind.starts(model, measured)]
            if not EFFECTS.is_own(kind.effect):
                for candidate in own:
                    _check(model, candidate.starts[0], measured)
            out += own
    return out


def _check(model: Model, effect: Effect, measured: Measured) -> None:
    """An effect of another package must work on the model: one that does not is named here, where a search would leave it out."""
    try:
        applied = effect.apply(model)
        if not effect.linear:
            return
        moved = effect.moved_by(model, applied)
        idle = [f.name for f in parameter_fields(type(effect)) if not moved.get(f.name)]
        if idle:
            raise ParameterError(f"nothing in the model moves with {', '.join(idle)}; say in `moves` what does")
        s = 2j * np.pi * np.atleast_1d(sum(measured.band) / 2)
        position = np.array([0.5 if model.has_position else np.nan])
        channels = tuple(model.channels)
        response = ChainedResponse(
            applied, position, s, output_quantities(model, channels, "receptance"), channels, ("force",)
        )
        for carried in moved.values():
            for path, _ in carried:
                response.derivative(path)
    except CutvibError as error:
        raise ParameterError(
            f"effect {effect.effect!r} at {effect.place!r} cannot be searched for: {error}; fix it, or do not register it"
        ) from error
