"""Data of the report's interactive charts: responses, error map, dynamic stiffness; drawn by plotly in the page itself."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cutvib_ss.diagnosis.element_type import element_type_value
from cutvib_ss.diagnosis.findings import DynamicStiffness
from cutvib_ss.diagnosis.result import Comparison, Diagnosis
from cutvib_ss.effects.scales import FREE_FREQUENCY, port_scale
from cutvib_ss.model.protocol import NonlinearElement
from cutvib_ss.plot.diagnosis import error_over_noise
from cutvib_ss.plot.style import WORKING_FREQUENCY, position_name, scale_of, unit_text
from cutvib_ss.report.frame import complex_lists, lines_to_draw, number, number_list
from cutvib_ss.results import ComplexArray

_CELLS = 260
"""Bands of frequency in an error map: finer ones would only show the estimator's scatter."""
_KNOWN = 0.6
"""Part of the lines, those of least uncertainty, that an axis shows whole."""
_CYCLE = 401
_DEFLECTION = 3.0
"""Largest deflection at which a restoring force is drawn, over that under a typical slow force."""
MODELS = ("nominal", "tuned", "corrected")


def charts_data(d: Diagnosis) -> dict[str, Any]:
    """All that the charts show."""
    return {
        "mark": WORKING_FREQUENCY if d.nominal.has_position else None,
        "repeatability": number(d.repeatability),
        "first": first_shown(d.comparisons),
        "records": [_record(c) for c in d.comparisons],
        "maps": _maps(d.comparisons),
        "stiffness": [_stiffness(z, d) for z in d.findings.stiffness],
        "restoring": [_restoring(e, d) for e in d.corrected_machine.nonlinear],
        "bands": [list(b) for b in d.where.bands_hz],
    }


def record_name(c: Comparison) -> str:
    """What a record is called: its position, level and input as far as they tell it apart."""
    position = float(c.measured.positions[0])
    return position_name(position, c.label).replace("\n", ", ") or "the record"


def first_shown(comparisons: Sequence[Comparison]) -> tuple[int, str]:
    """The record and channel in which the gap stands out most: what a reader sees first."""
    whole = np.array([-np.inf, np.inf])
    found = {
        (k, name): float(error_over_noise([c], "tuned", name, whole)[0])
        for k, c in enumerate(comparisons)
        for name in c.measured.outputs
    }
    known = [at for at, error in found.items() if np.isfinite(error)]
    return max(known, key=found.__getitem__) if known else (0, "")


def _record(c: Comparison) -> dict[str, Any]:
    channels = []
    moduli = np.abs(c.measured.data[0, :, 0])
    at = np.unique(np.concatenate([lines_to_draw(modulus) for modulus in moduli]))
    for k, (name, unit) in enumerate(zip(c.measured.outputs, c.measured.units, strict=True)):
        factor, shown = scale_of(unit)
        one: dict[str, Any] = {"name": name, "unit": shown}
        one["measured"] = complex_lists(factor * c.measured.data[0, k, 0, at])
        for side in MODELS:
            one[side] = complex_lists(factor * getattr(c, side).data[0, k, 0, at])
        one["noise"] = number_list(factor * np.sqrt(c.measured.variance[0, k, 0, at]))
        coherence = c.measured.coherence[0, k, 0, at]
        one["coherence"] = number_list(coherence) if np.any(np.isfinite(coherence)) else None
        channels.append(one)
    return {"name": record_name(c), "freq": number_list(c.measured.freq[at]), "channels": channels}


def _maps(comparisons: Sequence[Comparison]) -> dict[str, Any] | None:
    if not comparisons:
        return None
    low = min(float(c.measured.freq[0]) for c in comparisons)
    high = max(float(c.measured.freq[-1]) for c in comparisons)
    edges = np.linspace(low, high, min(_CELLS, comparisons[0].measured.freq.size) + 1)
    rows: dict[str, list[Comparison]] = {}
    for c in comparisons:
        rows.setdefault(record_name(c), []).append(c)
    channels = list(dict.fromkeys(name for c in comparisons for name in c.measured.outputs))
    return {
        "freq": number_list(0.5 * (edges[1:] + edges[:-1])),
        "rows": list(rows),
        "channels": channels,
        "ratio": {
            side: {
                name: [number_list(error_over_noise(m, side, name, edges)) for m in rows.values()] for name in channels
            }
            for side in MODELS
        },
    }


def _stiffness(z: DynamicStiffness, d: Diagnosis) -> dict[str, Any]:
    laws = []
    if z.element_type is not None and len(z.levels) == 1:
        laws.append(
            (
                f"element type of its shape: {z.element_type.name}",
                element_type_value(z.element_type, z.quantity, z.freq),
            )
        )
    named = _named_law(z, d)
    if named is not None:
        carried = (
            "the element, as fitted" if d.causes[0].effect == "unknown" else "dynamic stiffness of the named cause"
        )
        laws.append((carried, named))
    levels = [
        {
            "name": "the records ask for" if level is None else f"at {level:.3g} N",
            "re": number_list(value.real), "im": number_list(value.imag), "std": number_list(std),
        }
        for level, value, std in zip(z.levels, z.value, z.std, strict=True)
    ]  # fmt: skip
    return {
        "quantity": z.quantity,
        "unit": "" if z.unit == "1" else unit_text(z.unit),
        "freq": number_list(z.freq),
        "levels": levels,
        "laws": [{"name": name, **complex_lists(value)} for name, value in laws],
        "limits": {part: _limits(z, [v for _, v in laws], part) for part in ("real", "imag")},
    }


def _named_law(z: DynamicStiffness, d: Diagnosis) -> ComplexArray | None:
    """Dynamic stiffness of what the corrected machine carries at the function's port; None where nothing, or no such element."""
    if z.quantity != "dynamic stiffness":
        return None
    s: ComplexArray = np.asarray(2j * np.pi * z.freq, dtype=np.complex128)
    values = [
        np.asarray(a.element.dynamic_stiffness(s), dtype=np.complex128)
        for a in d.corrected_machine.attachments
        if a.port == z.label and hasattr(a.element, "dynamic_stiffness")
    ]
    values = [v for v in values if v.shape == z.freq.shape]
    return sum(values[1:], values[0]) if values else None


def _restoring(e: NonlinearElement, d: Diagnosis) -> dict[str, Any]:
    """Restoring force of a place over a cycle of its deflection: of its spring alone, and with the named restoring force."""
    machine = d.corrected_machine
    scale, spring = port_scale(d.nominal, e.port), machine.spring_at(e.port)
    rate = WORKING_FREQUENCY if d.nominal.has_position else scale.natural_freq or FREE_FREQUENCY
    # From rest to the largest deflection and once around: laws with memory draw their loop.
    turn = np.linspace(0.0, 2.5 * np.pi, _CYCLE)
    largest = _DEFLECTION * scale.motion
    q, v = largest * np.sin(turn), largest * 2 * np.pi * rate * np.cos(turn)
    alone = (spring[0] if spring is not None else 0.0) * q
    rotates = d.nominal.has_position and e.port.startswith("joint")
    return {
        "place": e.port,
        "law": e.law,
        "x": "deflection [rad]" if rotates else "deflection [m]",
        "y": "torque [N m]" if rotates else "force [N]",
        "q": number_list(q),
        "alone": number_list(alone),
        "with": number_list(alone + e.restoring_force.force(q, v)),
    }


def _limits(z: DynamicStiffness, laws: Sequence[ComplexArray], part: str) -> list[float]:
    """Limits that hold all lines that are well known with their deviation, each law whole, and zero."""
    known = z.std <= np.quantile(z.std, _KNOWN)
    value = getattr(z.value, part)
    ends = [(value - z.std)[known], (value + z.std)[known], np.zeros(1), *(getattr(v, part) for v in laws)]
    every = np.concatenate([e[np.isfinite(e)] for e in ends])
    low, high = float(every.min()), float(every.max())
    room = 0.06 * max(high - low, 1e-300)
    return [low - room, high + room]
