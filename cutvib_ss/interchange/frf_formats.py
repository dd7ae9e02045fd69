"""
Frequency responses for other programs: UFF data set 58, MATLAB's MAT, NetCDF.

UFF keeps the channels' nodes (tool 1, base 2, head 3, others from 4) and adds 100 for each further position; a rotation has
direction 5 (about Y). MAT holds `frd`'s arguments, ``ResponseData`` (output × input × frequency × position) and
``Frequency`` [rad/s], and one matrix (frequency × position) for each output of the first input.
"""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyuff
from scipy.io import loadmat, savemat

from cutvib_ss.errors import CutvibError, DataFormatError, ParameterError
from cutvib_ss.interchange.conversions import from_xarray
from cutvib_ss.measurement.layout import DIRECTIONS
from cutvib_ss.results import FrequencyResponse, Quantity
from cutvib_ss.results.display import optional
from cutvib_ss.units import DISPLACEMENT_UNITS, FORCE_OF, rate_unit, ratio_unit

QUANTITIES: tuple[Quantity, ...] = ("displacement", "velocity", "acceleration")
UNITS: dict[str, tuple[str, Quantity, str]] = {
    ratio_unit(rate_unit(d, q), u): (d, q, u)
    for u, d, q in product(("N", "m/s^2", *list(FORCE_OF.values())[1:]), DISPLACEMENT_UNITS, QUANTITIES)
}
"""Every unit of a response that reads back: unit of displacement, quantity, unit of the input."""

_ABOUT_Y = 5
_NODES = {"tool": 1, "base": 2, "head": 3}
_NODES_A_POSITION = 100
_TYPE_OF_QUANTITY = {"displacement": 8, "velocity": 11, "acceleration": 12}
_FORCE_TYPE, _FREQUENCY_TYPE, _FRF = 13, 18, 4
_NAME = re.compile(r"(?P<name>.+?)(?: at \S+)?")
_AXIS_LINE = re.compile(r"freq \[Hz\] (\S+) (\S+)")
_POSITION = re.compile(r"y/L = (\S+)")


def write_uff(frf: FrequencyResponse, path: Path) -> None:
    """ASCII data sets 58, one for each position, output and input; names and position in the first two lines."""
    if len(frf.outputs) + len(frf.inputs) + len(_NODES) >= _NODES_A_POSITION:
        raise ParameterError(f".uff: {len(frf.outputs)} outputs are more than {_NODES_A_POSITION} node numbers allow")
    signals = dict(zip(frf.outputs, frf.displacement_units, strict=True))
    forces = {name: "rad" if unit == "N m" else "m" for name, unit in zip(frf.inputs, frf.input_units, strict=True)}
    places = {name: _place("tool_x" if name == "force" else name, unit) for name, unit in (signals | forces).items()}
    numbers = dict(_NODES)
    for place, _ in places.values():
        numbers.setdefault(place, max(numbers.values()) + 1)
    step = float(frf.freq[1] - frf.freq[0]) if frf.freq.size > 1 else 0.0
    # The format keeps six digits of frequencies; those of an even axis stand in full in a line of text too.
    even = frf.freq.size > 1 and bool(np.allclose(np.diff(frf.freq), step, rtol=1e-9, atol=0))
    axis = f"freq [Hz] {float(frf.freq[0])!r} {step!r}" if even else "NONE"
    sets = []
    for k, i, j in np.ndindex(frf.data.shape[:3]):
        position, output, input = float(frf.positions[k]), frf.outputs[i], frf.inputs[j]
        there = "" if np.isnan(position) else f" at {position:g}"
        response, reference = places[output], places[input]
        driven = "acceleration" if frf.input_units[j] == "m/s^2" else "force"
        exponents = {
            f"{axis}_{unit}_unit_exp": 0
            for axis in ("abscissa", "ordinate", "orddenom", "z_axis")
            for unit in ("len", "force", "temp")
        }
        labels = {f"{axis}_axis_lab": "NONE" for axis in ("abscissa", "ordinate", "orddenom", "z_axis")}
        sets.append(
            exponents | labels | {
                "type": 58, "binary": 0, "func_type": _FRF, "func_id": 0, "ver_num": 1, "load_case_id": 0,
                "id1": f"{output}{there}", "id2": input,
                "id3": "NONE" if np.isnan(position) else f"y/L = {position!r}", "id4": axis, "id5": "NONE",
                "rsp_ent_name": "NONE", "rsp_node": numbers[response[0]] + k * _NODES_A_POSITION, "rsp_dir": response[1],
                "ref_ent_name": "NONE", "ref_node": numbers[reference[0]] + k * _NODES_A_POSITION, "ref_dir": reference[1],
                "data": np.array(frf.data[k, i, j]), "x": np.array(frf.freq), "abscissa_spacing": int(even),
                "abscissa_spec_data_type": _FREQUENCY_TYPE, "abscissa_axis_units_lab": "Hz",
                "ordinate_spec_data_type": _TYPE_OF_QUANTITY[frf.quantities[i]],
                "ordinate_axis_units_lab": rate_unit(frf.displacement_units[i], frf.quantities[i]),
                "orddenom_spec_data_type": _FORCE_TYPE if driven == "force" else _TYPE_OF_QUANTITY[driven],
                "orddenom_axis_units_lab": frf.input_units[j],
                "z_axis_spec_data_type": 0, "z_axis_axis_units_lab": "NONE", "z_axis_value": 0.0,
            }
        )  # fmt: skip
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")


def _place(signal: str, unit: str) -> tuple[str, int]:
    """Place of a signal and its direction: 1, 2, 3 for X, Y, Z, 5 for a rotation about Y; X where the name tells none."""
    axis = DIRECTIONS.get(signal[-2:])
    if unit == "rad":
        return signal, _ABOUT_Y
    return (signal, 1) if axis is None else (signal[:-2], axis)


def read_uff(path: Path) -> FrequencyResponse:
    """What `write_uff` wrote; a file of another program is a campaign's record."""
    if not path.is_file():
        raise FileNotFoundError(path)
    try:
        found = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # pyuff raises many kinds on damaged files
        raise DataFormatError(f"{path}: not a readable universal file ({error}); export it again") from error
    sets = [s for s in (found if isinstance(found, list) else [found]) if s.get("func_type") == _FRF]
    if not sets:
        raise DataFormatError(f"{path}: holds no frequency response (data set 58, function type 4)")
    cells: dict[tuple[float, str, str], Any] = {}
    labels: dict[str, tuple[str, Quantity]] = {}
    units: dict[str, str] = {}
    for s in sets:
        match, place = _NAME.fullmatch(s["id1"].strip()), _POSITION.fullmatch(s["id3"].strip())
        unit = ratio_unit(s["ordinate_axis_units_lab"].strip(), s["orddenom_axis_units_lab"].strip())
        if match is None or unit not in UNITS:
            raise DataFormatError(f"{path}: data set {s['id1']!r} in {unit!r} is not one that was exported here")
        name, input = match["name"], s["id2"].strip()
        labels[name], units[input] = UNITS[unit][:2], UNITS[unit][2]
        cells[float(place[1] if place else "nan"), name, input] = s["data"]
    # NaN is no key that is found again: positions by their text.
    table = {(str(y), o, i): values for (y, o, i), values in cells.items()}
    positions = list(dict.fromkeys(y for y, _, _ in table))
    try:
        data = np.array([[[table[y, o, i] for i in units] for o in labels] for y in positions])
    except (KeyError, ValueError) as error:
        raise DataFormatError(f"{path}: its data sets do not make a full table ({error}); export it again") from None
    freq, axis = np.asarray(sets[0]["x"], dtype=float), _AXIS_LINE.fullmatch(sets[0]["id4"].strip())
    if axis:
        freq = float(axis[1]) + float(axis[2]) * np.arange(freq.size)
    return FrequencyResponse(
        data, freq, np.array([float(y) for y in positions]), tuple(labels), tuple(units),
        tuple(q for _, q in labels.values()), displacement_units=tuple(d for d, _ in labels.values()),
        input_units=tuple(units.values()),
    )  # fmt: skip


def write_mat(frf: FrequencyResponse, path: Path) -> None:
    """`sys = frd(ResponseData, Frequency, 'InputName', inputs, 'OutputName', outputs)` makes MATLAB's object of it."""
    variables: dict[str, Any] = {"freq": frf.freq[:, np.newaxis], "position": frf.positions[:, np.newaxis]}
    units = {"freq": "Hz", "position": "1"}
    for k, output in enumerate(frf.outputs):
        name = re.sub(r"\W+", "_", output, flags=re.ASCII).strip("_")
        if name in variables:
            raise ParameterError(f".mat: two outputs would both be the variable {name!r}; write them apart")
        variables[name] = frf.data[:, k, 0].T
        units[name] = frf.unit_of(output)
    arguments: dict[str, Any] = {"ResponseData": np.moveaxis(frf.data, 0, -1), "Frequency": frf.omega[:, np.newaxis]}
    for name in ("outputs", "inputs", "quantities", "displacement_units", "input_units"):
        arguments[name] = np.array(getattr(frf, name), dtype=object)
    savemat(path, {**variables, **arguments, "units": units}, appendmat=False, long_field_names=True)


def read_mat(path: Path) -> FrequencyResponse:
    """What `write_mat` wrote."""
    if not path.is_file():
        raise FileNotFoundError(path)
    try:
        held = loadmat(path, appendmat=False, simplify_cells=True)
        labels = ("outputs", "inputs", "quantities", "displacement_units", "input_units")
        names = {n: tuple(str(v) for v in np.atleast_1d(held[n])) for n in labels}
        freq, positions = (np.atleast_1d(np.asarray(held[n], dtype=float)) for n in ("freq", "position"))
        shape = (len(names["outputs"]), len(names["inputs"]), freq.size, positions.size)
        data = np.moveaxis(np.asarray(held["ResponseData"]).reshape(shape), -1, 0)
        return FrequencyResponse(data, freq, positions, **names)  # type: ignore[arg-type]
    except OSError:
        raise
    except KeyError as error:
        raise DataFormatError(f"{path}: holds no variable {error}; it is not an exported frequency response") from None
    except Exception as error:  # scipy raises many kinds on damaged files
        raise DataFormatError(f"{path}: not a readable MAT file ({error}); export it again") from error


def write_netcdf(frf: FrequencyResponse, path: Path) -> None:
    """The dataset of `FrequencyResponse.to_xarray`, real and imaginary part apart: NetCDF has no complex numbers."""
    optional("h5netcdf", ".nc")
    data = frf.to_xarray()
    response = data["response"]
    parts = {"response_re": response.real, "response_im": response.imag}
    data.drop_vars("response").assign(parts).to_netcdf(path, engine="h5netcdf")


def read_netcdf(path: Path) -> FrequencyResponse:
    """What `write_netcdf` wrote."""
    xarray = optional("xarray", ".nc")
    if not path.is_file():
        raise FileNotFoundError(path)
    try:
        with xarray.open_dataset(path, engine="h5netcdf") as held:
            data = held.load()
        whole = data.assign(response=data["response_re"] + 1j * data["response_im"])
    except CutvibError:
        raise
    except Exception as error:  # h5py and xarray raise many kinds on damaged files
        raise DataFormatError(f"{path}: not an exported frequency response ({error}); export it again") from error
    return from_xarray(whole)
