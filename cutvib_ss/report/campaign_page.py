"""What a campaign holds as one HTML page: tables, responses with coherence, poles, blows; nothing loaded from anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cutvib_ss.errors import CutvibError
from cutvib_ss.identification.stabilisation import stabilisation
from cutvib_ss.measurement.inputs import response_to
from cutvib_ss.measurement.record_pairs import PAIR_HEADS
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.measurement.summary import RecordSummary, Summary
from cutvib_ss.plot.style import WORKING_FREQUENCY, scale_of, unit_text
from cutvib_ss.report.frame import complex_lists, lines_to_draw, number_list, page
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse
from cutvib_ss.units import SI_UNIT

_MOST_STRETCHES = 200
"""Stretches of a history of which the extent is drawn."""
_MODEL_LINES = 800
_ORDER = 32
"""Highest order of a stabilisation diagram."""


def campaign_html(campaign: Campaign, found: Summary) -> str:
    """The page of `cutvib campaign show --report`."""
    groups = _groups(found)
    blows = [k for k, record in enumerate(campaign.records) if record.kind == "impact" and record.histories]
    data = {
        "mark": WORKING_FREQUENCY if campaign.machine.has_position else None,
        "groups": [_group(title, members, campaign, found) for title, members in groups],
        "poles": [_poles(title, members, found) for title, members in groups],
        "blows": [_blows(found.records[k].name, campaign.records[k]) for k in blows],
    }
    return page(
        "campaign.html.j2",
        "campaign.js",
        data,
        filters={"unit": unit_text},
        found=found,
        sentences=found.sentences(),
        pair_heads=PAIR_HEADS,
        groups=[title for title, _ in groups],
        channels=list(dict.fromkeys(name for frf in found.frfs for name in frf.outputs)),
        blows=[found.records[k].name for k in blows],
    )


def _groups(found: Summary) -> list[tuple[str, list[int]]]:
    """Records of one position and input, drawn together."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    for k, record in enumerate(found.records):
        groups.setdefault((record.position, record.input), []).append(k)
    titles = []
    for (position, struck), members in groups.items():
        parts = [] if position is None else [f"y/L = {position:g}"]
        parts += [f"struck at {struck}"] if struck else []
        titles.append((", ".join(parts) or "all records", members))
    return titles


def _group(title: str, members: Sequence[int], campaign: Campaign, found: Summary) -> dict[str, Any]:
    records = [_record(found.records[k], found.frfs[k]) for k in members]
    first = found.records[members[0]]
    low = min(found.records[k].band_hz[0] for k in members)
    high = max(found.records[k].band_hz[1] for k in members)
    return {
        "title": title,
        "band": [low, high],
        "records": records,
        "nominal": _nominal(campaign, first, np.linspace(low, high, _MODEL_LINES)),
    }


def _record(record: RecordSummary, frf: MeasuredFrequencyResponse) -> dict[str, Any]:
    channels = {}
    for k, (name, unit) in enumerate(zip(frf.outputs, frf.units, strict=True)):
        factor, shown = scale_of(unit)
        values = factor * frf.data[0, k, 0]
        at = np.flatnonzero((frf.freq >= record.band_hz[0]) & (frf.freq <= record.band_hz[1]) & (frf.freq > 0))
        at = at[lines_to_draw(np.abs(values[at]))]
        coherence = frf.coherence[0, k, 0, at]
        channels[name] = {
            "unit": shown,
            "freq": number_list(frf.freq[at]),
            "h": complex_lists(values[at]),
            "noise": number_list(factor * np.sqrt(frf.variance[0, k, 0, at])),
            "coherence": number_list(coherence) if np.any(np.isfinite(coherence)) else None,
        }
    level = record.level_text()
    return {"name": record.name, "level": f"{level} N" if level else "", "channels": channels}


def _nominal(campaign: Campaign, record: RecordSummary, freq: FloatArray) -> dict[str, Any]:
    """The nominal model's responses in the channels' own quantities."""
    machine = campaign.machine
    names = [c.name for c in record.channels if c.name in machine.channels]
    if not names:
        return {}
    found = response_to(record.input, machine, record.position, freq, names)
    return {
        name: {"freq": number_list(freq), "h": complex_lists(scale_of(unit)[0] * found.data[0, k, 0])}
        for k, (name, unit) in enumerate(zip(names, found.units, strict=True))
    }


def _poles(title: str, members: Sequence[int], found: Summary) -> dict[str, Any]:
    """Stabilisation diagram of the group's record of least noise over its response; without one, why there is none."""
    best = min(members, key=lambda k: float(np.median(_relative_noise(found.frfs[k]))))
    record, frf = found.records[best], found.frfs[best]
    lines = int(np.sum((frf.freq >= record.band_hz[0]) & (frf.freq <= record.band_hz[1])))
    try:
        poles = stabilisation(frf, band=record.band_hz, highest_order=max(2, min(_ORDER, lines // 6)))
    except CutvibError as error:
        return {"title": title, "record": record.name, "why_not": str(error)}
    return {
        "title": title,
        "record": record.name,
        "freq": number_list(poles.freq),
        "modulus": number_list(poles.modulus),
        "natural_freq": number_list(poles.natural_freq),
        "damping": number_list(100 * poles.damping_ratio),
        "order": poles.order.tolist(),
        "stable": poles.stable.tolist(),
        "columns": [[f"{f:.2f}", f"{100 * z:.2f}", str(n)] for f, z, n in poles.columns()],
    }


def _relative_noise(frf: MeasuredFrequencyResponse) -> FloatArray:
    out: FloatArray = np.sqrt(frf.variance) / np.maximum(np.abs(frf.data), 1e-300)
    return out


def _blows(name: str, record: Record) -> dict[str, Any]:
    """Force of each blow about its peak, and the extent of the largest response over the whole record."""
    force, response = [], []
    largest = int(np.argmax([np.ptp(row) for row in record.histories[0].responses]))
    for history in record.histories:
        peak = int(np.argmax(np.abs(history.force)))
        width = max(int(0.01 * history.fs), 20)
        part = slice(max(peak - width, 0), peak + 2 * width)
        time = 1e3 * (history.time[part] - history.time[peak])
        force.append({"x": number_list(time), "y": number_list(history.force[part])})
        row = min(largest, len(history.responses) - 1)
        time, low, high = _envelope(history.time, history.responses[row])
        response.append({"x": number_list(time), "low": number_list(low), "high": number_list(high)})
    return {
        "name": name,
        "unit": record.input_unit,
        "channel": f"{record.channels[largest]} [{unit_text(SI_UNIT[record.quantities[largest]])}]",
        "force": force,
        "response": response,
    }


def _envelope(time: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Least and largest value of stretches of a history."""
    size = max(values.size // _MOST_STRETCHES, 1)
    count = values.size // size
    cut = values[: count * size].reshape(count, size)
    return time[: count * size : size], cut.min(axis=1), cut.max(axis=1)
