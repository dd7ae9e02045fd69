"""What to measure next: the record in which the remaining causes differ most against the noise to expect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.records import Entry, merged, thinned
from cutvib_ss.diagnosis.result import NextTest
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.effects.base import Model
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.results.arrays import optional_array, positions_given


def next_test(
    models: Sequence[Model], names: Sequence[str], entries: Sequence[Entry], odds: Sequence[float] | None = None
) -> NextTest:
    """
    The most telling record.

    What is maximised is Σ p_i p_j ln(1 + χ²_ij/2) over pairs, with χ²_ij = 2 Σ |ΔH|²/var over the band: a record that tells every
    pair a little is worth more than one that tells a single pair beyond doubt. Noise is that of the loudest record, and goes with
    one over the level. Linear causes differ by as much at every level, so that the loudest is best for them; others are
    simulated at each.
    """
    share = np.full(len(models), 1.0 / len(models)) if odds is None else np.asarray(odds) / np.sum(odds)
    loudest = max(entries, key=lambda e: -1.0 if e.level is None else e.level)
    by_level = any(m.nonlinear for m in models) and loudest.replay is not None and loudest.level is not None
    if by_level:
        loudest = thinned(loudest, slice(None, None, max(1, loudest.freq.size // SETTINGS.next_lines)))
    levels = _levels(entries) if by_level else optional_array([loudest.level])
    count = SETTINGS.next_positions_laws if by_level else SETTINGS.next_positions
    positions = np.linspace(*SETTINGS.next_ends, count) if models[0].has_position else np.array([np.nan])
    # (position, level, channel, frequency) of each model; the noise is told by level.
    shown = [_shown(m, positions, levels, loudest) for m in models]
    louder = 1.0 if not by_level or loudest.level is None else (levels / loudest.level)[:, None, None] ** 2
    precision = louder / loudest.variance[None]
    score = np.zeros(shown[0].shape[:3])
    told: list[tuple[FloatArray, str]] = []
    one = len(set(names)) == 1
    for i, a in enumerate(shown):
        for j, b in enumerate(shown[:i]):
            if names[i] == names[j] and not one:  # forms of one cause, while another is left
                continue
            apart = 2 * np.sum(np.abs(a - b) ** 2 * precision, axis=-1)
            score += share[i] * share[j] * np.log1p(apart / 2)
            told.append((apart, f"two forms of {names[i]}" if one else f"{names[j]} from {names[i]}"))
    best = np.unravel_index(int(np.argmax(score)), score.shape)
    apart, pair = max(told, key=lambda t: t[0][best])
    return NextTest(
        why=f"tells {pair} (expected χ² between them {apart[best]:.3g})",
        position=float(positions[best[0]]) if models[0].has_position else None,
        peak_force=None if np.isnan(levels[best[1]]) else float(levels[best[1]]),
        channel=loudest.channels[best[2]],
    )


def _levels(entries: Sequence[Entry]) -> FloatArray:
    levels = np.unique([e.level for e in entries if e.level is not None])
    return levels if levels.size > 1 else levels[0] * np.array(SETTINGS.next_levels)


def _shown(model: Model, positions: FloatArray, levels: FloatArray, like: Entry) -> ComplexArray:
    """Responses that records like one would show, shape (position, level, channel, frequency)."""
    if not model.nonlinear or like.replay is None:
        places = positions_given(positions)
        linear = frequency_response(model, places, like.freq, inputs=[like.input], outputs=like.channels).data[:, :, 0]
        out: ComplexArray = np.broadcast_to(linear[:, None], (linear.shape[0], levels.size, *linear.shape[1:]))
        return out
    first = like.replay.first
    # Records that state no level are planned as loud as they were.
    louder = np.ones(levels.size) if like.level is None else levels / like.level
    planned = [
        replace(
            like,
            record=k,
            response=replace(like.response, positions=y),
            level=None if like.level is None else float(level),
            replay=replace(first, forces=tuple(f * factor for f in first.forces), measured=()),
        )
        for k, (y, level, factor) in enumerate((y, *row) for y in positions for row in zip(levels, louder, strict=True))
    ]
    (group,) = merged(planned, apart=True)
    data: ComplexArray = simulated(model, group).data.reshape(positions.size, levels.size, *like.data.shape)
    return data
