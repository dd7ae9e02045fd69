"""
What programs put into MATLAB files, brought to named columns: own variables, structs, and exports of measuring systems.

Layouts: variables or structs (``values``, ``unit``, ``fs``) of any name; Simcenter Testlab and its forerunners (structs with
``x_values.start_value/increment/number_of_values``, ``y_values.values/quantity.label``, ``function_record.name``); Dewesoft
(``Data1_<channel>`` beside ``Data1_time_<channel>``, seconds or days); B&K (``Channel_1_Data``, ``Channel_1_Header`` with
``SignalName`` and ``Unit``, ``File_Header`` with ``SampleFrequency``).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_VALUES = ("values", "value", "data", "y", "signal")
_UNITS = ("unit", "units", "y_unit", "yunit")
RATE_NAMES = (
    "fs",
    "f_s",
    "sample_rate",
    "samplerate",
    "sampling_rate",
    "samplingrate",
    "sampling_frequency",
    "samplefrequency",
)
STEP_NAMES = ("dt", "delta_t", "deltat", "timestep", "time_step", "increment", "tinterval", "ts")
TIME_NAMES = ("t", "time", "tvec", "timevector", "time_vector", "zeit")
FREQ_NAMES = ("freq", "f", "frequency", "freqs", "frequencies", "fvec", "freq_hz", "hz")
_DEWESOFT = re.compile(r"^Data\d+_(?P<time>time_)?(?P<name>.+)$")
_CHANNEL = re.compile(r"^Channel_(?P<number>\d+)_(?P<what>Data|Header)$", re.IGNORECASE)
_DAY = 86400.0
_FIRST_DATE = 36000.0
"""Days: beyond this, times that advance by less than a thousandth are dates, not seconds."""


@dataclass(frozen=True)
class Column:
    """One variable: values along the last axis, with what its own struct says of unit and axis."""

    name: str
    values: NDArray[Any]
    unit: str | None = None
    fs: float | None = None
    freq: NDArray[Any] | None = None
    time: NDArray[Any] | None = None
    resolution: float = 0.0


def columns_of(variables: dict[str, Any]) -> tuple[list[Column], dict[str, Any]]:
    """Columns of every style that is known, and the variables that are left."""
    left = dict(variables)
    found: list[Column] = []
    for style in (_testlab, _numbered_channels, _dewesoft, _labelled_matrix, _structs):
        found += style(left)
    return found, left


def first_of(variables: dict[str, Any], names: tuple[str, ...], remove: bool = True) -> tuple[str, Any] | None:
    """Name and value of the first variable that bears one of some names, whatever its case."""
    for wanted in names:
        for name in variables:
            if name.casefold() == wanted:
                return name, variables.pop(name) if remove else variables[name]
    return None


def _testlab(left: dict[str, Any]) -> list[Column]:
    columns = []
    for name in [n for n, v in left.items() if isinstance(v, dict) and {"x_values", "y_values"} <= set(v)]:
        struct = left.pop(name)
        x, y = struct["x_values"], struct["y_values"]
        values = np.asarray(y.get("values"))
        if values.dtype.kind not in "fiuc" or values.size == 0:
            continue
        matrix = values[:, np.newaxis] if values.ndim == 1 else values
        count = x.get("number_of_values")
        if count is not None and matrix.shape[0] != int(count) and matrix.shape[1] == int(count):
            matrix = matrix.T
        step, start = float(x.get("increment", 0.0) or 0.0), float(x.get("start_value", 0.0) or 0.0)
        axis_unit = str(_label(x.get("quantity")) or "").strip().lower()
        is_frequency = np.iscomplexobj(matrix) or axis_unit == "hz"
        labels = _labels(struct.get("function_record"), matrix.shape[1])
        label = _label(y.get("quantity"))
        units = label if isinstance(label, list) and len(label) == matrix.shape[1] else [label] * matrix.shape[1]
        freq = start + step * np.arange(matrix.shape[0]) if is_frequency and step > 0 else None
        if freq is None and x.get("values") is not None and is_frequency:
            freq = np.asarray(x["values"], dtype=float).ravel()
        for k in range(matrix.shape[1]):
            title = labels[k] if labels else (name if matrix.shape[1] == 1 else f"{name}/{k + 1}")
            unit = units[k] if isinstance(units[k], str) and units[k].strip() else None
            fs = 1 / step if step > 0 and not is_frequency else None
            columns.append(Column(title, matrix[:, k], unit, fs, freq))
    return columns


def _label(quantity: Any) -> Any:
    if isinstance(quantity, dict):
        return quantity.get("label")
    return quantity if isinstance(quantity, str) else None


def _labels(record: Any, count: int) -> list[str]:
    """Names of a Testlab struct's columns, where its function record gives as many."""
    if not isinstance(record, dict):
        return []
    names = record.get("name")
    names = [names] if isinstance(names, str) else names
    if isinstance(names, list | np.ndarray) and len(names) == count and all(isinstance(n, str) and n for n in names):
        return list(names) if len(set(names)) == count else []
    return []


def _numbered_channels(left: dict[str, Any]) -> list[Column]:
    parts: dict[int, dict[str, Any]] = {}
    for name in list(left):
        match = _CHANNEL.match(name)
        if match is not None:
            parts.setdefault(int(match["number"]), {})[match["what"].lower()] = left.pop(name)
    if not parts:
        return []
    head = left.pop("File_Header", {})
    fs = _number(first_of(dict(head), RATE_NAMES)) if isinstance(head, dict) else None
    columns = []
    for number, part in sorted(parts.items()):
        if "data" not in part:
            continue
        header = part.get("header") if isinstance(part.get("header"), dict) else {}
        assert isinstance(header, dict)
        name = str(header.get("SignalName", "")).strip() or f"Channel_{number}"
        unit = str(header.get("Unit", "")).strip() or None
        columns.append(Column(name, np.asarray(part["data"]), unit, fs))
    return columns


def _dewesoft(left: dict[str, Any]) -> list[Column]:
    matched = {name: m for name in left if (m := _DEWESOFT.match(name)) is not None}
    times = {m["name"]: name for name, m in matched.items() if m["time"]}
    columns = []
    for name, m in matched.items():
        if m["time"]:
            continue
        clock = times.get(m["name"])
        time, resolution = (None, 0.0) if clock is None else _seconds(np.asarray(left[clock], dtype=float).ravel())
        columns.append(Column(m["name"], np.asarray(left[name]), time=time, resolution=resolution))
    for name in matched:
        left.pop(name)
    return columns


def _seconds(time: NDArray[Any]) -> tuple[NDArray[Any], float]:
    """Times in seconds and their rounding: dates are counted in days, to which ten microseconds are the last digit."""
    if (
        time.size > 1
        and np.all(np.isfinite(time))
        and time[0] > _FIRST_DATE
        and (time[-1] - time[0]) / time.size < 1e-3
    ):
        return (time - time[0]) * _DAY, 2 * float(np.spacing(time[-1])) * _DAY
    return time, 0.0


def _labelled_matrix(left: dict[str, Any]) -> list[Column]:
    """A matrix ``data`` beside its channels' names."""
    data = first_of(left, ("data", "signals", "x", "y"), remove=False)
    names = first_of(left, ("labels", "names", "channel_names", "channels", "channelnames"), remove=False)
    if data is None or names is None:
        return []
    titles = [str(n).strip() for n in np.atleast_1d(np.asarray(names[1], dtype=object))]
    matrix = np.asarray(data[1])
    if matrix.dtype.kind not in "fiuc" or matrix.ndim != 2 or len(titles) not in matrix.shape:
        return []
    matrix = matrix.T if matrix.shape[0] == len(titles) and matrix.shape[1] != len(titles) else matrix
    units = first_of(left, ("units", "unit"), remove=False)
    words = [None] * len(titles)
    if units is not None and not isinstance(units[1], dict):
        given = [str(u).strip() or None for u in np.atleast_1d(np.asarray(units[1], dtype=object))]
        words = given if len(given) == len(titles) else words  # type: ignore[assignment]
        left.pop(units[0])
    left.pop(data[0])
    left.pop(names[0])
    return [Column(title, matrix[:, k], words[k]) for k, title in enumerate(titles)]


def _structs(left: dict[str, Any]) -> list[Column]:
    """Structs of values and unit, one a channel; their own rate, step or times where they have them."""
    columns = []
    for name in [n for n, v in left.items() if isinstance(v, dict) and first_of(dict(v), _VALUES)]:
        if name.casefold() in ("units", "unit"):
            continue
        struct = dict(left.pop(name))
        held = first_of(struct, _VALUES)
        assert held is not None
        values = np.asarray(held[1])
        if values.dtype.kind not in "fiuc":
            left[name] = held[1]
            continue
        unit = first_of(struct, _UNITS)
        rate, step = _number(first_of(struct, RATE_NAMES)), _number(first_of(struct, STEP_NAMES))
        time, freq = first_of(struct, TIME_NAMES), first_of(struct, FREQ_NAMES)
        columns.append(
            Column(
                name,
                values,
                unit[1].strip() if unit is not None and isinstance(unit[1], str) else None,
                rate if rate is not None else (1 / step if step else None),
                None if freq is None else np.asarray(freq[1], dtype=float).ravel(),
                None if time is None else np.asarray(time[1], dtype=float).ravel(),
            )
        )
        coherence = first_of(struct, ("coherence", "coh"))
        if coherence is not None:
            columns.append(Column(f"{name}_coherence", np.asarray(coherence[1])))
    return columns


def _number(found: tuple[str, Any] | None) -> float | None:
    if found is None:
        return None
    try:
        value = float(np.asarray(found[1], dtype=float).item())
    except (TypeError, ValueError):
        return None
    return value if np.isfinite(value) and value > 0 else None
