"""
MATLAB files (v4 to v7.3): variables or structs of any name, and a sampling frequency, time step or time vector.

Time records: ``fs`` (``Fs``, ``dt``, ``t`` …) and each channel as a vector; several blows are the columns of matrices (samples
run along the longer side, so that rows are read as well). Frequency responses: ``freq`` [Hz], each channel a complex
vector, ``<channel>_coherence`` where known. Units are a struct ``units`` with a field per channel, or in the channel's
own struct; without them values are SI. Exports of measuring systems are in `mat_styles`.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pymatreader import read_mat
from scipy.io import savemat

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.mat_styles import (
    FREQ_NAMES,
    RATE_NAMES,
    STEP_NAMES,
    TIME_NAMES,
    Column,
    columns_of,
    first_of,
)
from cutvib_ss.measurement.formats.raw import (
    SEVERAL_POSITIONS,
    Contents,
    Layout,
    RawFrf,
    RawHistory,
    RawResponse,
    Signal,
    TextOptions,
    even_sampling,
)
from cutvib_ss.results import FloatArray

_COHERENCE = "_coherence"
_AMPLITUDE = "force_amplitude"


def read(path: Path, frf: bool, options: TextOptions) -> Contents:
    """Contents of a MATLAB file: frequency responses, or one history per column of its matrices."""
    variables = _variables(path)
    units = {}
    if isinstance(variables.get("units"), dict) or ("units" in variables and "labels" not in variables):
        units = variables.pop("units")
    if not isinstance(units, dict):
        raise DataFormatError(f"{path}: `units` must be a struct with a field per channel, units.force = 'N'")
    for channel, unit in units.items():
        if not isinstance(unit, str):
            raise DataFormatError(f"{path}: units.{channel} is {unit!r}; give text, such as 'm/s^2'")
    columns, left = columns_of(variables)
    if frf:
        return Contents(frf=_frf(path, columns, left, units), si=True)
    return Contents(histories=_histories(path, columns, left, units), si=True)


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """Write contents as a MATLAB v5 file."""
    variables: dict[str, Any] = {}
    units: dict[str, str] = {}
    if contents.frf is not None:
        variables["freq"] = contents.frf.freq[:, np.newaxis]
        if contents.frf.force_amplitude is not None:
            variables[_AMPLITUDE] = contents.frf.force_amplitude.values[:, np.newaxis]
            units[_AMPLITUDE] = contents.frf.force_amplitude.unit or ""
        for response in contents.frf.responses:
            variables[response.name] = response.values[:, np.newaxis]
            units[response.name] = response.unit or ""
            if response.coherence is not None:
                variables[response.name + _COHERENCE] = response.coherence[:, np.newaxis]
    else:
        sizes = {(h.fs, h.signals[0].values.size) for h in contents.histories}
        if len(sizes) > 1:
            raise DataFormatError(
                f"{path.name}: blows of different length or sampling frequency {sorted(sizes)} do not fit one matrix; "
                "write tdms, uff or csv"
            )
        variables["fs"] = contents.histories[0].fs
        for k, signal in enumerate(contents.histories[0].signals):
            variables[signal.name] = np.column_stack([h.signals[k].values for h in contents.histories])
            units[signal.name] = signal.unit or ""
    savemat(path, {**variables, "units": units}, appendmat=False, long_field_names=True)


def _variables(path: Path) -> dict[str, Any]:
    try:
        with warnings.catch_warnings():
            # objects of MATLAB classes beside the data are none of this reader's business
            warnings.simplefilter("ignore")
            variables = read_mat(path)
    except Exception as error:  # scipy and h5py raise many kinds on damaged files
        raise DataFormatError(f"{path}: not a readable MATLAB file ({error}); save it again") from error
    return {name: value for name, value in variables.items() if not name.startswith(("__", "#"))}


def _numbers(path: Path, name: str, value: Any) -> NDArray[Any]:
    array = np.asarray(value)
    if array.dtype.kind not in "fiuc" or array.ndim > 2 or array.size == 0:
        raise DataFormatError(f"{path}: variable {name!r} is not a vector or matrix of numbers; save numbers")
    return array


def _positive(path: Path, name: str, value: Any, meaning: str) -> float:
    array = _numbers(path, name, value)
    if array.size != 1 or array.dtype.kind == "c" or not np.isfinite(array.item()) or not array.item() > 0:
        raise DataFormatError(f"{path}: `{name}` must be one positive number ({meaning})")
    return float(array.item())


def _clock(path: Path, left: dict[str, Any]) -> tuple[float | None, str | None]:
    """Sampling frequency of the file, and the variable of the time vector that gave it."""
    rate = first_of(left, RATE_NAMES)
    if rate is not None:
        first_of(left, TIME_NAMES)  # says the same
        first_of(left, STEP_NAMES)
        return _positive(path, rate[0], rate[1], "sampling frequency [Hz]"), None
    step = first_of(left, STEP_NAMES)
    if step is not None:
        first_of(left, TIME_NAMES)
        return 1 / _positive(path, step[0], step[1], "time step [s]"), None
    time = first_of(left, TIME_NAMES)
    if time is None:
        return None, None
    values = _numbers(path, time[0], time[1])
    if values.dtype.kind == "c":
        raise DataFormatError(f"{path}: the time vector `{time[0]}` is complex; save real times [s]")
    if values.ndim == 2:
        values = values[0] if values.shape[1] >= values.shape[0] else values[:, 0]
    return even_sampling(values.astype(np.float64).ravel(), f"{path}: `{time[0]}`"), time[0]


def _histories(
    path: Path, columns: list[Column], left: dict[str, Any], units: dict[str, str]
) -> tuple[RawHistory, ...]:
    names = [c.name for c in columns] + sorted(left)
    fs, _ = _clock(path, left)
    columns = columns + [Column(n, v) for n, v in _plain(path, left, len(columns)).items()]
    rows: dict[str, FloatArray] = {}
    rates: dict[str, float] = {}
    for column in columns:
        array = _numbers(path, column.name, column.values)
        if array.dtype.kind == "c":
            raise DataFormatError(
                f"{path}: variable {column.name!r} is complex, but a time record is real; set kind = 'frf'?"
            )
        matrix = np.atleast_2d(array.astype(np.float64))
        name = column.name if column.name not in rows else f"{column.name} {len(rows) + 1}"
        rows[name] = matrix if matrix.shape[1] >= matrix.shape[0] else matrix.T
        rate = column.fs
        if rate is None and column.time is not None:
            rate = even_sampling(column.time, f"{path}: time of {column.name!r}", column.resolution)
        rate = rate if rate is not None else fs
        if rate is None:
            raise DataFormatError(
                f"{path}: no variable `fs` (sampling frequency [Hz]), `dt` or time vector `t`; it has "
                f"{', '.join(names)}; add one"
            )
        rates[name] = rate
    if not rows:
        return ()
    shapes = {name: matrix.shape[::-1] for name, matrix in rows.items()}
    if len({rates[name] for name in rows}) == 1 and len(set(shapes.values())) > 1:
        raise DataFormatError(f"{path}: variables have different (samples, blows) {shapes}; save all of one length")
    common = next(iter(rates.values()))
    given = {column.name: column.unit for column in columns}
    return tuple(
        RawHistory(
            f"blow {blow + 1}",
            common,
            tuple(
                Signal(
                    name,
                    given.get(name) or units.get(name),
                    matrix[blow],
                    fs=None if rates[name] == common else rates[name],
                )
                for name, matrix in rows.items()
                if blow < matrix.shape[0]
            ),
        )
        for blow in range(max(matrix.shape[0] for matrix in rows.values()))
    )


def _plain(path: Path, left: dict[str, Any], found: int) -> dict[str, Any]:
    """Variables that are columns by themselves; texts, single numbers and other structs beside them are passed over."""
    sized = {name: np.asarray(value) for name, value in left.items() if not isinstance(value, dict)}
    numbers = {name: left[name] for name, array in sized.items() if array.dtype.kind in "fiuc" and array.size > 1}
    texts = [name for name, array in sized.items() if array.dtype.kind not in "fiuc"]
    if texts and len(numbers) + found < 2:
        raise DataFormatError(f"{path}: variable {texts[0]!r} is not a vector or matrix of numbers; save numbers")
    return numbers


def _check_exported(path: Path, left: dict[str, Any]) -> None:
    """Take out what an exported response of a model holds beside its channels; refuse one of several positions."""
    if {"ResponseData", "position"} <= left.keys():
        if np.size(left["position"]) > 1:
            raise DataFormatError(f"{path}: {SEVERAL_POSITIONS}")
        for name in ("ResponseData", "Frequency", "position"):
            left.pop(name, None)


def _frf(path: Path, columns: list[Column], left: dict[str, Any], units: dict[str, str]) -> RawFrf:
    found = first_of(left, FREQ_NAMES)
    if found is None and not any(column.freq is not None for column in columns):
        names = [c.name for c in columns] + sorted(left)
        raise DataFormatError(f"{path}: no variable `freq` (frequency [Hz]); it has {', '.join(names)}; add it")
    if found is not None:
        freq = _numbers(path, found[0], found[1]).astype(np.float64).ravel()
    else:
        freq = next(np.asarray(c.freq, dtype=np.float64) for c in columns if c.freq is not None)
    _check_exported(path, left)
    amplitude = left.pop(_AMPLITUDE, None)
    held = next((c for c in columns if c.name == _AMPLITUDE), None)
    stated = None
    if amplitude is not None or held is not None:
        values = _numbers(path, _AMPLITUDE, amplitude if held is None else held.values).real.astype(np.float64).ravel()
        unit = (None if held is None else held.unit) or units.get(_AMPLITUDE, units.get("force"))
        stated = Signal(_AMPLITUDE, unit, values)
    plain = [Column(n, v) for n, v in _plain(path, left, len(columns)).items()]
    vectors = {c.name: c for c in [*columns, *plain] if c.name != _AMPLITUDE}
    responses = []
    for name, column in vectors.items():
        vector = _numbers(path, name, column.values).ravel()
        axis = freq if column.freq is None else np.asarray(column.freq, dtype=np.float64)
        if vector.size != axis.size:
            raise DataFormatError(
                f"{path}: variable {name!r} has {vector.size} values, `freq` {axis.size}; save both alike"
            )
        if name.endswith(_COHERENCE):
            if name.removesuffix(_COHERENCE) not in vectors:
                raise DataFormatError(
                    f"{path}: {name!r} belongs to no variable {name.removesuffix(_COHERENCE)!r}; add it"
                )
            continue
        beside = vectors.get(name + _COHERENCE)
        coherence = None if beside is None else _numbers(path, beside.name, beside.values).ravel().real
        same = axis.shape == freq.shape and np.allclose(axis, freq, rtol=1e-9)
        responses.append(
            RawResponse(
                name,
                column.unit or units.get(name),
                vector.astype(np.complex128),
                coherence,
                freq=None if same else axis,
            )
        )
    return RawFrf(freq, tuple(responses), stated)
