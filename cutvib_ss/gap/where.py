"""
Where: the error of the re-tuned model against its noise, over frequency, position, channel and level; and a place for it.

Place without a hypothesis: one unknown dynamic stiffness z(ω), in parallel at a port, changes every response p to q by
Sherman-Morrison, H = H0 - z a_pr a_rq / (1 + z a_rr). One z(ω) has to serve all positions and channels; the port whose z
leaves least is the place. The series element between rail and head adds a compliance to the rail's receptance, and the measurement
chain multiplies each channel by one complex gain for all positions: both compete on equal terms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.effects.base import Model
from cutvib_ss.gap.observations import Entry, Group, merged
from cutvib_ss.gap.prediction import Prediction
from cutvib_ss.gap.result import ErrorFigure
from cutvib_ss.gap.shrinkage import Judged
from cutvib_ss.machine import Machine
from cutvib_ss.response.condensed import CondensedModel
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.units import DERIVATIVE_ORDER

STANDS_OUT = 4.0
"""Standard deviations by which a band's mean square has to exceed what noise leaves."""
LEVEL_EXCESS = 1.15
"""Reduced χ² between levels from which a response is called level-dependent."""
Z_ITERATIONS = 12


@dataclass(frozen=True)
class PlaceScore:
    """
    A place, and what one free z(ω) there leaves.

    Parameters
    ----------
    place : str
        The place.
    chi2 : float
        χ² that is left.
    freedom : int
        Real data less real unknowns.
    z : ndarray, shape (frequency,)
        The dynamic stiffness (compliance for a series place, gain for the measurement), first group.
    """

    place: str
    chi2: float
    freedom: int
    z: ComplexArray


def bands(residuals: Sequence[tuple[Group, ComplexArray]], width: float) -> tuple[tuple[float, float], ...]:
    """
    Bands in which the error stands out of the noise.

    Parameters
    ----------
    residuals : sequence of (Group, ndarray)
        Groups with their residuals over the noise of a real part, shape (position, channel, frequency).
    width : float
        Width over which the error is averaged [Hz].

    Returns
    -------
    tuple of (float, float)
        Bands [Hz], ascending and apart.
    """
    found: list[tuple[float, float]] = []
    for g, r in residuals:
        power = np.mean(np.abs(r) ** 2 / 2, axis=(0, 1))
        step = float(np.median(np.diff(g.freq)))
        half = max(1, round(width / step / 2))
        kernel = np.ones(2 * half + 1)
        counts = np.convolve(np.ones(power.size), kernel, mode="same")
        smooth = np.convolve(power, kernel, mode="same") / counts
        # Each |r|²/2 is exponential with mean one; the noise itself is known to some percent.
        spread = np.sqrt(1.0 / (counts * r.shape[0] * r.shape[1])) + 0.05
        out = smooth > 1.0 + STANDS_OUT * spread
        edges = np.flatnonzero(np.diff(np.concatenate([[0], out.astype(int), [0]])))
        found += [(float(g.freq[a]), float(g.freq[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return _joined(sorted(found), width)


def _joined(found: list[tuple[float, float]], width: float) -> tuple[tuple[float, float], ...]:
    joined: list[tuple[float, float]] = []
    for low, high in found:
        if joined and low <= joined[-1][1] + width:
            joined[-1] = (joined[-1][0], max(high, joined[-1][1]))
        else:
            joined.append((low, high))
    return tuple(joined)


def level_dependence(entries: Sequence[Entry]) -> float:
    """
    Reduced χ² of the levels at each position against their mean.

    Parameters
    ----------
    entries : sequence of Entry
        Records.

    Returns
    -------
    float
        About 1 where the response does not change with the level; NaN with one level.
    """
    total, freedom = 0.0, 0
    places: dict[tuple[float, tuple[str, ...], int], list[Entry]] = {}
    for e in entries:
        places.setdefault((float(np.nan_to_num(e.position, nan=-1.0)), e.channels, e.freq.size), []).append(e)
    for same in places.values():
        if len(same) < 2:
            continue
        precision = np.array([1.0 / e.variance for e in same])
        data = np.array([e.data for e in same])
        mean = np.sum(precision * data, axis=0) / precision.sum(axis=0)
        total += float(np.sum(np.abs(data - mean) ** 2 * precision))
        freedom += (len(same) - 1) * mean.size
    return total / freedom if freedom else float("nan")


def by_position(records: Sequence[Judged], per_unit: float) -> tuple[ErrorFigure, ...]:
    """
    Errors over positions.

    Parameters
    ----------
    records : sequence of Judged
        Records against the re-tuned model.
    per_unit : float
        SI value of the reported unit.

    Returns
    -------
    tuple of ErrorFigure
        One a position, ascending.
    """
    places = sorted({float(np.nan_to_num(j.entry.position, nan=-1.0)) for j in records})
    out = []
    for place in places:
        own = [j for j in records if float(np.nan_to_num(j.entry.position, nan=-1.0)) == place]
        error, noise = (float(np.mean([getattr(j, k).mean() for j in own])) / per_unit for k in ("error", "noise"))
        out.append(ErrorFigure(None if place < 0 else place, error, noise))
    return tuple(out)


def by_channel(records: Sequence[Judged], channels: Sequence[str], per_unit: float) -> tuple[ErrorFigure, ...]:
    """
    Errors over channels.

    Parameters
    ----------
    records : sequence of Judged
        Records against the re-tuned model.
    channels : sequence of str
        Channels, in order.
    per_unit : float
        SI value of the reported unit.

    Returns
    -------
    tuple of ErrorFigure
        One a channel.
    """
    out = []
    for name in channels:
        pairs = [
            (j.error[j.entry.channels.index(name)], j.noise[j.entry.channels.index(name)])
            for j in records
            if name in j.entry.channels
        ]
        error, noise = np.mean(pairs, axis=0) / per_unit
        out.append(ErrorFigure(name, float(error), float(noise)))
    return tuple(out)


def places(model: Model) -> dict[str, str]:
    """
    Places at which a free z(ω) is tried, and the port of each; an empty port is no port.

    Parameters
    ----------
    model : Machine or Structure
        The model.

    Returns
    -------
    dict of str to str
        Place to port.
    """
    if isinstance(model, Machine):
        return {
            "joint1": "joint1",
            "joint2": "joint2",
            "tool": "tool_x",
            "head": "head_x",
            "rail": "base",
            "measurement": "",
        }
    return {**{name: name for name in model.system.ports}, "measurement": ""}


def locate(
    model: Model, entries: Sequence[Entry], calibration: Sequence[ComplexArray], blow_at: float
) -> list[PlaceScore]:
    """
    Every place with what one free z(ω) leaves there.

    Parameters
    ----------
    model : Machine or Structure
        The re-tuned model.
    entries : sequence of Entry
        Records.
    calibration : sequence of ndarray
        Calibration errors of each merged group, 1 + ε.
    blow_at : float
        Instant of the blow [s] where records do not state it.

    Returns
    -------
    list of PlaceScore
        Best first.
    """
    groups = merged(entries)
    scores = []
    for place, port in places(model).items():
        total, freedom, first = 0.0, 0, np.zeros(0, dtype=np.complex128)
        for g, e in zip(groups, calibration, strict=True):
            prediction = Prediction(model, g, blow_at)
            if port:
                chi2, z = _free_stiffness(model, g, prediction, e, port)
                unknowns = 2 * g.freq.size
            else:
                chi2, z = _free_gain(g, prediction, e)
                unknowns = 2 * g.freq.size * len(g.channels)
            total += chi2
            freedom += 2 * g.data.size - unknowns
            first = z if first.size == 0 else first
        scores.append(PlaceScore(place, total, max(freedom, 1), first))
    return sorted(scores, key=lambda s: s.chi2 / s.freedom)


def _free_stiffness(
    model: Model, g: Group, prediction: Prediction, error: ComplexArray, port: str
) -> tuple[float, ComplexArray]:
    """One z for all positions and channels at each frequency: Gauss-Newton, all frequencies at once."""
    s: ComplexArray = np.asarray(prediction.s + model.chain.decay_rate, dtype=np.complex128)
    condensed = CondensedModel(model, g.positions, s)
    reads = [model.channels[c].port for c in g.channels]
    orders = [DERIVATIVE_ORDER[q] for q in g.quantities]
    chain = [model.chain.channel(c) for c in g.channels]
    factor = np.array([c.gain * np.exp(-s * c.delay) * s**k for c, k in zip(chain, orders, strict=True)]) * error
    drive = condensed.receptance(port, "force")
    own = condensed.receptance(port, port)
    # (position, channel, frequency): what a unit of z/(1 + z own) takes away.
    taken = np.stack([condensed.receptance(r, port) * drive for r in reads], axis=1) * factor
    residual0 = g.data - prediction.data * error
    own = own[:, None, :] + 0 * taken
    weight = 1.0 / g.variance
    # Starts: the inversion of each response, and none; the best at each frequency goes on.
    with np.errstate(divide="ignore", invalid="ignore"):
        single = -residual0 / (taken + residual0 * own)
    starts = [np.zeros(s.size, dtype=np.complex128)]
    starts += [_where_finite(single[i, c]) for i in range(g.positions.size) for c in range(len(reads))]
    z = starts[0]
    best = np.full(s.size, np.inf)
    for start in starts:
        cost = _cost(start, residual0, taken, own, weight)
        better = cost < best
        z, best = np.where(better, start, z), np.where(better, cost, best)
    damping = np.full(s.size, 1e-3)
    for _ in range(Z_ITERATIONS):
        below = 1.0 + z * own
        residual = residual0 + z * taken / below
        slope = taken / below**2
        curvature = np.sum(weight * np.abs(slope) ** 2, axis=(0, 1))
        step = -np.sum(weight * slope.conj() * residual, axis=(0, 1)) / (curvature * (1 + damping) + 1e-300)
        cost = _cost(z + step, residual0, taken, own, weight)
        better = cost < best
        z, best = np.where(better, z + step, z), np.where(better, cost, best)
        damping = np.where(better, damping / 5, damping * 10)
    return float(2.0 * np.sum(best)), z


def _cost(
    z: ComplexArray, residual: ComplexArray, taken: ComplexArray, own: ComplexArray, weight: FloatArray
) -> FloatArray:
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        left = residual + z * taken / (1.0 + z * own)
        cost = np.sum(weight * np.abs(left) ** 2, axis=(0, 1))
    return np.asarray(np.where(np.isfinite(cost), cost, np.inf), dtype=np.float64)


def _where_finite(z: ComplexArray) -> ComplexArray:
    return np.asarray(np.where(np.isfinite(z), z, 0.0), dtype=np.complex128)


def _free_gain(g: Group, prediction: Prediction, error: ComplexArray) -> tuple[float, ComplexArray]:
    """One complex gain a channel and frequency for all positions."""
    shown = prediction.data * error
    weight = 1.0 / g.variance
    gain = np.sum(weight * shown.conj() * g.data, axis=0) / np.sum(weight * np.abs(shown) ** 2, axis=0)
    left = 2.0 * np.sum(weight * np.abs(g.data - gain * shown) ** 2)
    return float(left), gain[0]
