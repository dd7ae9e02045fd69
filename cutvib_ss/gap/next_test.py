"""What to measure next: the record in which the remaining causes differ most against the noise to expect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cutvib_ss.effects.base import Model
from cutvib_ss.gap.observations import Entry
from cutvib_ss.gap.result import NextTest
from cutvib_ss.response.frequency import frequency_response

GRID = np.linspace(0.04, 0.96, 24)
"""Positions y_b / L that are tried."""


def next_test(models: Sequence[Model], names: Sequence[str], entries: Sequence[Entry]) -> NextTest:
    """
    The most telling record.

    Parameters
    ----------
    models : sequence of Machine or Structure
        The model with each remaining cause.
    names : sequence of str
        Their names.
    entries : sequence of Entry
        Records so far, for channels, levels and noise.

    Returns
    -------
    NextTest
        Position, level and channel.

    Notes
    -----
    Linear causes differ by the same ratio at every level, so that the quietest responses relative to noise decide the level: the
    loudest so far. What is maximised is the largest, over pairs, of Σ |ΔH|²/var over the band.
    """
    first = entries[0]
    loudest = max(entries, key=lambda e: np.nan_to_num(e.level, nan=-1.0))
    positions = GRID if models[0].has_position else None
    responses = [frequency_response(m, positions, first.freq, outputs=first.channels).data[:, :, 0] for m in models]
    variance = loudest.variance if loudest.freq.size == first.freq.size else first.variance
    score = np.zeros((responses[0].shape[0], len(first.channels)))
    for i, a in enumerate(responses):
        for b in responses[:i]:
            score = np.maximum(score, np.sum(np.abs(a - b) ** 2 / variance, axis=-1))
    place, channel = np.unravel_index(int(np.argmax(score)), score.shape)
    level = None if np.isnan(loudest.level) else float(loudest.level)
    return NextTest(
        why=f"tells {' from '.join(names)}: expected χ² between them {score[place, channel]:.3g}",
        position=float(GRID[place]) if positions is not None else None,
        peak_force=level,
        channel=first.channels[channel],
    )
