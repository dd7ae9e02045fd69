"""
Where: the error of the re-tuned model against its noise, over frequency, position, channel and level.

The place without a hypothesis is in `cutvib_ss.diagnosis.place`, the error band by band in `cutvib_ss.diagnosis.bands`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cutvib_ss.diagnosis.comparison import across_grids
from cutvib_ss.diagnosis.cross_validation import Judged
from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.prediction import Predicted
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Entry, Group, estimator_of, measured_at, merged, session_of
from cutvib_ss.diagnosis.result import ErrorFigure
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.results import ComplexArray, FloatArray


def bands(
    residuals: Sequence[tuple[Group, ComplexArray]], width: float, drifts: Sequence[FloatArray] | None = None
) -> tuple[tuple[float, float], ...]:
    """
    Bands in which the error stands out of noise and drift.

    Squares of whitened residuals are 2 for noise alone; drift adds its own (`drift_squares`). Neighbouring lines share the drift of
    a session: it averages over sessions alone.
    """
    found: list[tuple[float, float]] = []
    for (g, r), drift in zip(residuals, drifts or [np.zeros(r.shape) for _, r in residuals], strict=True):
        allowed = 1.0 + drift / 2
        power = np.mean(np.abs(r) ** 2 / 2 / allowed, axis=(0, 1))
        share = np.mean(1.0 - 1.0 / allowed, axis=(0, 1))
        step = float(np.median(np.diff(g.freq)))
        half = min(max(1, round(width / step / 2)), (g.freq.size - 1) // 2)
        kernel = np.ones(2 * half + 1)
        counts = np.convolve(np.ones(power.size), kernel, mode="same")
        smooth, shared = (np.convolve(values, kernel, mode="same") / counts for values in (power, share))
        sessions = len({session_of(same[0]) for same in g.entries}) or 1
        # Each |r|²/2 is exponential with mean one, a drift's share of it a square of one normal number a session; the noise
        # itself is known to some percent.
        spread = np.sqrt(1.0 / (counts * r.shape[0] * r.shape[1]) + 2.0 * shared**2 / sessions) + 0.05
        out = smooth > 1.0 + SETTINGS.band_stands_out * spread
        edges = np.flatnonzero(np.diff(np.concatenate([[0], out.astype(int), [0]])))
        found += [(float(g.freq[a]), float(g.freq[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return _joined(sorted(found), width)


def drift_squares(problem: Problem, x: FloatArray, predictions: Sequence[Predicted], sizes: Sizes) -> list[FloatArray]:
    """What drift and set-ups, of the sizes that a fit found, add to the squares of a problem's whitened residuals."""
    directions = Directions(problem, x, predictions)
    lay = directions.layout
    scale = lay.scale(sizes)[:, None, None]
    out = [np.zeros(p.data.shape) for p in predictions]
    for i, rows, c, index, part in directions.chunks():
        repeats = ((index >= lay.unknowns) & (index < lay.first_nominal)) | (index >= lay.first_hit)
        out[i][rows, c] += np.sum(np.abs(scale[index[repeats]] * part[repeats]) ** 2, axis=0)
        out[i][rows, c] += 2.0 * (sizes.noise - 1.0)
    return out


def _joined(found: list[tuple[float, float]], width: float) -> tuple[tuple[float, float], ...]:
    joined: list[tuple[float, float]] = []
    for low, high in found:
        if joined and low <= joined[-1][1] + width:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return tuple(joined)


def level_dependence(entries: Sequence[Entry], model: Model | None = None, blow_at: float = 0.0) -> float:
    """
    Reduced χ² of the levels at each position, in each session, against their mean: sessions differ by drift.

    Records whose levels are known to be about the same differ for another reason. Records on different grids are compared in
    pairs; where their blocks differ, by a model.
    """
    total, freedom = 0.0, 0
    places: dict[tuple[object, ...], list[Entry]] = {}
    for e in entries:
        # Records of a structure are compared as they are, unless they state their sessions.
        session = (e.session,) if e.session is not None else ()
        places.setdefault((*measured_at(e), *estimator_of(e), *session), []).append(e)
    for same in places.values():
        levels = [e.driven or 0.0 for e in same]
        if len(same) < 2 or 0.0 < max(levels) <= SETTINGS.level_apart * min(levels):
            continue
        precision = np.array([e.precision for e in same])
        data = np.array([e.data for e in same])
        mean = np.sum(precision * data, axis=0) / np.maximum(precision.sum(axis=0), 1e-300)
        total += float(np.sum(np.abs(data - mean) ** 2 * precision))
        freedom += (len(same) - 1) * mean.size
    for _, pair in across_grids(merged(entries), model, blow_at, stated=True):
        total += float(pair.power.sum())
        freedom += pair.power.size
    return total / freedom if freedom else float("nan")


def by_position(records: Sequence[Judged], per_unit: float, accepted: Sequence[Judged]) -> tuple[ErrorFigure, ...]:
    """Errors over positions; what noise and drift leave is as the accepted answer has it."""
    wider = {j.entry.record: _wider(j) for j in accepted}
    known: list[float | None] = [*sorted({j.entry.position for j in records if j.entry.position is not None})]
    out = []
    for place in known or [None]:
        own = [j for j in records if j.entry.position == place]
        error, noise, floor = (
            float(np.mean(v)) / per_unit
            for v in zip(
                *((j.error.mean(), j.noise.mean(), j.noise.mean() * wider[j.entry.record]) for j in own), strict=True
            )
        )
        out.append(ErrorFigure(place, error, noise, floor))
    return tuple(out)


def by_channel(
    records: Sequence[Judged], channels: Sequence[str], per_unit: float, accepted: Sequence[Judged]
) -> tuple[ErrorFigure, ...]:
    """Errors over channels, likewise."""
    wider = {j.entry.record: _wider(j) for j in accepted}
    out = []
    for name in channels:
        pairs = [
            (j.error[k], j.noise[k], j.noise[k] * wider[j.entry.record])
            for j in records
            if name in j.entry.channels
            for k in [j.entry.channels.index(name)]
        ]
        error, noise, floor = np.mean(pairs, axis=0) / per_unit
        out.append(ErrorFigure(name, float(error), float(noise), float(floor)))
    return tuple(out)


def _wider(j: Judged) -> float:
    """Root of what noise and drift leave over what noise alone leaves."""
    return float(np.sqrt(max(j.floor / float(j.entry.variance.mean()), 1.0)))
