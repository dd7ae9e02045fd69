"""
MATLAB files (v4 to v7.3): variables of the channels' names, and ``fs``.

Time records: ``fs`` [Hz], ``force`` and each channel as vectors; several blows are the columns of matrices (samples run
along the longer side, so that rows are read as well). Frequency responses: ``freq`` [Hz], each channel a complex
vector, ``<channel>_coherence`` where known. A struct ``units`` with a field per channel names units; without it values
are SI.
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
from cutvib_ss.measurement.formats.raw import (
    Contents,
    Layout,
    RawFrf,
    RawHistory,
    RawResponse,
    Signal,
)
from cutvib_ss.units import SI_UNIT

_COHERENCE = "_coherence"
_AMPLITUDE = "force_amplitude"


def read(path: Path, frf: bool, layout: Layout) -> Contents:
    """
    Contents of a MATLAB file.

    Parameters
    ----------
    path : Path
        File.
    frf : bool
        Whether frequency responses are wanted, else time records.
    layout : Layout
        Quantities of the channels, which give the unit where the file names none.

    Returns
    -------
    Contents
        Frequency responses, or one history per column.

    Raises
    ------
    DataFormatError
        If the file is damaged, ``fs`` or ``freq`` is missing, or shapes do not agree.
    """
    variables = _variables(path)
    units = variables.pop("units", {})
    if not isinstance(units, dict):
        raise DataFormatError(f"{path}: `units` must be a struct with a field per channel, units.force = 'N'")
    for channel, unit in units.items():
        if not isinstance(unit, str):
            raise DataFormatError(f"{path}: units.{channel} is {unit!r}; give text, such as 'm/s^2'")
    if frf:
        return Contents(frf=_frf(path, variables, units, layout))
    return Contents(histories=_histories(path, variables, units, layout))


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """
    Write contents as a MATLAB v5 file.

    Parameters
    ----------
    path : Path
        File to write.
    contents : Contents
        Histories of equal length and sampling frequency, or frequency responses.
    layout : Layout
        Not used.

    Raises
    ------
    DataFormatError
        If the histories cannot be columns of one matrix.
    """
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


def _scalar(path: Path, name: str, variables: dict[str, Any], meaning: str) -> float:
    if name not in variables:
        raise DataFormatError(
            f"{path}: no variable `{name}` ({meaning}); it has {', '.join(sorted(variables))}; add it"
        )
    array = _numbers(path, name, variables.pop(name))
    if array.size != 1 or array.dtype.kind == "c" or not np.isfinite(array.item()) or not array.item() > 0:
        raise DataFormatError(f"{path}: `{name}` must be one positive number ({meaning})")
    return float(array.item())


def _histories(path: Path, variables: dict[str, Any], units: dict[str, str], layout: Layout) -> tuple[RawHistory, ...]:
    fs = _scalar(path, "fs", variables, "sampling frequency [Hz]")
    columns = {}
    for name, value in variables.items():
        array = _numbers(path, name, value)
        if array.dtype.kind == "c":
            raise DataFormatError(f"{path}: variable {name!r} is complex, but a time record is real; set kind = 'frf'?")
        matrix = np.atleast_2d(array.astype(np.float64))
        columns[name] = matrix if matrix.shape[1] >= matrix.shape[0] else matrix.T
    shapes = {name: matrix.shape[::-1] for name, matrix in columns.items()}
    if len(set(shapes.values())) > 1:
        raise DataFormatError(f"{path}: variables have different (samples, blows) {shapes}; save all of one length")
    blows = next(iter(columns.values())).shape[0] if columns else 0
    return tuple(
        RawHistory(
            f"blow {blow + 1}",
            fs,
            tuple(Signal(name, _unit(name, units, layout), matrix[blow]) for name, matrix in columns.items()),
        )
        for blow in range(blows)
    )


def _frf(path: Path, variables: dict[str, Any], units: dict[str, str], layout: Layout) -> RawFrf:
    if "freq" not in variables:
        raise DataFormatError(
            f"{path}: no variable `freq` (frequency [Hz]); it has {', '.join(sorted(variables))}; add it"
        )
    freq = _numbers(path, "freq", variables.pop("freq")).astype(np.float64).ravel()
    amplitude = variables.pop(_AMPLITUDE, None)
    vectors = {name: _numbers(path, name, value).ravel() for name, value in variables.items()}
    for name, vector in vectors.items():
        if vector.size != freq.size:
            raise DataFormatError(
                f"{path}: variable {name!r} has {vector.size} values, `freq` {freq.size}; save both alike"
            )
    responses = []
    for name, vector in vectors.items():
        if name.endswith(_COHERENCE):
            if name.removesuffix(_COHERENCE) not in vectors:
                raise DataFormatError(
                    f"{path}: {name!r} belongs to no variable {name.removesuffix(_COHERENCE)!r}; add it"
                )
            continue
        coherence = vectors.get(name + _COHERENCE)
        unit = units.get(name)
        if unit is None and name in layout.quantities:
            unit = f"{SI_UNIT[layout.quantities[name]]}/{SI_UNIT[layout.quantities['force']]}"
        responses.append(
            RawResponse(name, unit, vector.astype(np.complex128), None if coherence is None else coherence.real)
        )
    stated = None
    if amplitude is not None:
        values = _numbers(path, _AMPLITUDE, amplitude).real.astype(np.float64).ravel()
        stated = Signal(
            _AMPLITUDE, units.get(_AMPLITUDE, units.get("force", SI_UNIT[layout.quantities["force"]])), values
        )
    return RawFrf(freq, tuple(responses), stated)


def _unit(name: str, units: dict[str, str], layout: Layout) -> str | None:
    if name in units:
        return units[name]
    return SI_UNIT[layout.quantities[name]] if name in layout.quantities else None
