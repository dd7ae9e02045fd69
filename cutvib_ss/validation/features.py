"""
What a campaign looks like to methods that fit nothing: estimated responses minus nominal ones, in bands.

The features are the same for every campaign, whatever its positions, channels and levels: what was not measured is zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.measurement.estimation import measured_response
from cutvib_ss.measurement.records import Record
from cutvib_ss.model.machine import Machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray, FloatArray

CHANNELS = ("tool_x", "tool_z", "base_x")
EDGES = np.geomspace(15.0, 450.0, 25)
"""Limits of the bands [Hz]."""
BANDS = EDGES.size - 1
ZONES = 5
"""Parts of the rail over which the error is averaged."""
SIGNATURE = 3 * BANDS
"""Features of a channel, at its front, that tell the shape of the error."""

_LITTLE = 1e-8


@dataclass(frozen=True)
class _Seen:
    """One channel of one record beside the nominal model: arrays over the lines of the band, and each line's band."""

    position: float
    level: float
    measured: ComplexArray
    nominal: ComplexArray
    variance: FloatArray
    coherence: FloatArray
    band: NDArray[np.intp]


def features(folder: Path) -> FloatArray:
    """Features of a campaign on the cutting machine."""
    campaign = read_campaign(folder)
    machine = campaign.machine
    if machine.rail is None:
        raise ParameterError(
            f"{folder}: features are those of a cutting machine; this campaign is of another structure"
        )
    seen: dict[str, list[_Seen]] = {name: [] for name in CHANNELS}
    for record in campaign.records:
        for name, channel in _read(machine, record):
            seen[name].append(channel)
    return np.concatenate([_described(seen[name]) for name in CHANNELS])


def _read(machine: Machine, record: Record) -> list[tuple[str, _Seen]]:
    measured = measured_response(record)
    lines = (measured.freq >= EDGES[0]) & (measured.freq <= EDGES[-1])
    freq = measured.freq[lines]
    position = 0.5 if record.position is None else record.position
    band = np.clip(np.searchsorted(EDGES, freq, side="right") - 1, 0, BANDS - 1)
    names = [name for name in CHANNELS if name in measured.outputs]
    nominal = frequency_response(machine, [position], freq, form="accelerance", outputs=names)
    level = float("nan") if record.peak_force is None else record.peak_force
    out = []
    for k, name in enumerate(names):
        own = measured.to_form("accelerance").sel(output=name)
        data, variance, coherence = (a[0, 0, 0, lines] for a in (own.data, own.variance, own.coherence))
        out.append((name, _Seen(position, level, data, nominal.data[0, k, 0], variance, coherence, band)))
    return out


def _described(seen: Sequence[_Seen]) -> FloatArray:
    """Features of one channel; zeros where it was not measured."""
    shape, lost, zones = np.zeros((3, BANDS)), np.zeros(BANDS), np.zeros((2, ZONES))
    for s in seen:
        change = s.measured - s.nominal
        turned = change * s.nominal.conj()
        power, wrong = _sums(s, np.abs(s.nominal) ** 2), _sums(s, np.abs(change) ** 2)
        shape += [np.log10(wrong / power + _LITTLE) / 2, _sums(s, turned.real) / power, _sums(s, turned.imag) / power]
        lost += _sums(s, 1.0 - np.nan_to_num(s.coherence, nan=1.0)) / np.maximum(_sums(s, np.ones(s.band.size)), 1.0)
        zones[:, min(int(s.position * ZONES), ZONES - 1)] += wrong.sum(), power.sum()
    wrong, power = zones
    by_zone = np.where(power > 0, np.log10(wrong / np.maximum(power, 1e-300) + _LITTLE) / 2, 0.0)
    count = max(len(seen), 1)
    return np.concatenate([shape.ravel() / count, _moved(seen), lost / count, by_zone])


def _moved(seen: Sequence[_Seen]) -> FloatArray:
    """Change between the lowest and the highest level at a position, over its noise."""
    by_position: dict[float, list[_Seen]] = {}
    for s in seen:
        if np.isfinite(s.level):
            by_position.setdefault(s.position, []).append(s)
    total, count = np.zeros(BANDS), 0
    for records in by_position.values():
        low, high = min(records, key=lambda s: s.level), max(records, key=lambda s: s.level)
        if low.level < high.level and low.band.size == high.band.size:
            noise = _sums(low, low.variance + high.variance)
            total += np.log10(
                _sums(low, np.abs(low.measured - high.measured) ** 2) / np.maximum(noise, 1e-300) + _LITTLE
            )
            count += 1
    return total / max(count, 1)


def _sums(s: _Seen, values: FloatArray) -> FloatArray:
    """Sums over the lines of each band."""
    return np.bincount(s.band, values, BANDS).astype(np.float64)
