"""The error band by band: how large, whether it moves with position or level, and how much of it repeats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from scipy import ndimage, stats

from cutvib_ss.diagnosis.cross_validation import Judged
from cutvib_ss.diagnosis.findings import Band
from cutvib_ss.diagnosis.metrics import Sides
from cutvib_ss.diagnosis.records import measured_at
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray


def bands(
    stand_out: Sequence[tuple[float, float]],
    whole: tuple[float, float],
    sides: Sides,
    per_unit: float,
) -> tuple[Band, ...]:
    """The bands that hold most of what the error has above the noise, and those between."""
    tuned = sides.tuned
    edges = [whole[0], *(f for band in _main(stand_out, whole, tuned) for f in band), whole[1]]
    out = []
    for i, (low, high) in enumerate(pairwise(edges)):
        stands_out = i % 2 == 1
        inside = [(j.entry.freq >= low) & (j.entry.freq <= high) for j in tuned]
        if not any(m.any() for m in inside) or (not stands_out and max(m.sum() for m in inside) < SETTINGS.band_narrow):
            continue
        before, again, after, second = (
            float("nan") if side is None else _mean_error(side, inside) / per_unit
            for side in (sides.before, tuned, sides.after, sides.second)
        )
        noise = np.mean([np.sqrt(np.pi * j.entry.variance[:, m]).mean() / 2 for j, m in zip(tuned, inside) if m.any()])
        by_position = _centres(tuned, inside, lambda j: j.entry.position)
        by_level = _centres(tuned, inside, lambda j: j.entry.level)
        out.append(
            Band(
                low=low,
                high=high,
                before=before,
                tuned=again,
                after=after,
                noise=float(noise) / per_unit,
                second=second,
                stands_out=stands_out,
                centres=tuple((p, c) for p, c, _ in by_position if p is not None) if stands_out else (),
                moves_with_position=stands_out and _moves(by_position),
                moves_with_level=stands_out and _moves(by_level),
                coherence=_coherence(tuned, inside),
            )
        )
    return tuple(out)


def _main(
    stand_out: Sequence[tuple[float, float]], whole: tuple[float, float], records: Sequence[Judged]
) -> list[tuple[float, float]]:
    """The highest parts of the error's mean modulus above the noise, until they hold most of it."""
    step = max(float(np.median(np.diff(j.entry.freq))) for j in records)
    freq = np.arange(whole[0], whole[1] + step / 2, step)
    height, count = np.zeros(freq.size), np.zeros(freq.size)
    for j in records:
        excess = np.abs(j.residual) - np.sqrt(np.pi * j.entry.variance) / 2
        at = np.clip(np.rint((j.entry.freq - freq[0]) / step).astype(int), 0, freq.size - 1)
        np.add.at(height, at, excess.mean(axis=0))
        np.add.at(count, at, 1.0)
    width = max(1, round(SETTINGS.band_smooth / step))
    height = ndimage.uniform_filter1d(height / np.maximum(count, 1.0), width, mode="constant")
    inside = np.zeros(freq.size, dtype=bool)
    for low, high in stand_out:
        inside |= (freq >= low) & (freq <= high)
    height = np.where(inside, np.maximum(height, 0.0), 0.0)
    if not height.any():
        return []
    order = np.sort(height)[::-1]
    least = order[np.searchsorted(np.cumsum(order), SETTINGS.band_main_share * order.sum())]
    ends = np.flatnonzero(np.diff(np.concatenate([[0], (height >= least).astype(int), [0]])))
    found: list[tuple[float, float]] = []
    for a, b in zip(ends[::2], ends[1::2] - 1, strict=True):
        if found and freq[a] - found[-1][1] <= SETTINGS.band_smooth:
            found[-1] = (found[-1][0], float(freq[b]))
        elif (b - a) * step >= SETTINGS.band_smooth / 2:
            found.append((float(freq[a]), float(freq[b])))
    return found


def _mean_error(records: Sequence[Judged], inside: Sequence[np.ndarray]) -> float:
    errors = [np.abs(j.residual)[:, m].mean() for j, m in zip(records, inside, strict=True) if m.any()]
    return float(np.mean(errors))


def _centres(
    records: Sequence[Judged], inside: Sequence[np.ndarray], key: Callable[[Judged], float | None]
) -> list[tuple[float | None, float, float]]:
    """Key, centre of the error's excess over the noise, and the centre's standard deviation."""
    groups: dict[float | None, list[tuple[FloatArray, FloatArray]]] = {}
    for j, m in zip(records, inside, strict=True):
        if m.any():
            excess = np.mean(np.abs(j.residual)[:, m] ** 2 / j.entry.variance[:, m], axis=0) - 1.0
            groups.setdefault(key(j), []).append((j.entry.freq[m], np.maximum(excess, 0.0)))
    out = []
    for value, parts in sorted(groups.items(), key=lambda item: (item[0] is not None, item[0] or 0.0)):
        freq, weight = (np.concatenate(side) for side in zip(*parts, strict=True))
        total = weight.sum()
        if total > 0:
            centre = float(weight @ freq / total)
            spread = float(np.sqrt(weight @ (freq - centre) ** 2 / total))
            effective = float(total**2 / (weight @ weight))
            step = float(np.median(np.diff(np.unique(freq)))) if np.unique(freq).size > 1 else 1.0
            out.append((value, centre, max(spread / np.sqrt(effective), step)))
    return out


def _moves(centres: Sequence[tuple[float | None, float, float]]) -> bool:
    if len(centres) < 2:
        return False
    centre, spread = (np.array(side) for side in tuple(zip(*centres, strict=True))[1:])
    mean = np.average(centre, weights=spread**-2)
    return bool(stats.chi2.sf(np.sum(((centre - mean) / spread) ** 2), len(centres) - 1) < SETTINGS.band_moves)


def _coherence(records: Sequence[Judged], inside: Sequence[np.ndarray]) -> float:
    """What records of one position share of their errors' power above the noise."""
    places: dict[tuple[float | None, str], list[tuple[ComplexArray, FloatArray]]] = {}
    for j, m in zip(records, inside, strict=True):
        error = j.residual[:, m]
        places.setdefault(measured_at(j.entry), []).append((error, j.entry.variance[:, m]))
    shared, total = 0.0, 0.0
    for same in places.values():
        alike = [(e, v) for e, v in same if e.shape == same[0][0].shape]
        n = len(alike)
        if n > 1:
            # One weight for all records of a line, so that loud ones do not outweigh quiet ones.
            weight = 1.0 / np.mean([v for _, v in alike], axis=0)
            power = float(np.sum(weight * sum(np.abs(e) ** 2 for e, _ in alike)))
            together = float(np.sum(weight * np.abs(sum(e for e, _ in alike)) ** 2))
            shared += (together - power) / (n - 1)
            total += power - float(np.sum(weight * sum(v for _, v in alike)))
    return float(np.clip(shared / total, 0.0, 1.0)) if total > 0 else float("nan")
