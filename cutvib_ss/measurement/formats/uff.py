"""Universal file format, data set 58 (ASCII and binary): frequency responses, coherences, time records."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats.raw import (
    Contents,
    Layout,
    RawFrf,
    RawHistory,
    RawResponse,
    Signal,
    TextOptions,
    even_sampling,
    sampling_frequency,
)
from cutvib_ss.measurement.formats.uff_body import data_values, split_blocks
from cutvib_ss.results import ComplexArray, FloatArray
from cutvib_ss.units import SI_UNIT

_TIME, _FRF, _COHERENCE = 1, 4, 6
_QUANTITY_OF_TYPE = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}
_TYPE_OF_QUANTITY = {"displacement": 8, "velocity": 11, "acceleration": 12, "force": 13}
_LENGTH_POWER = {"displacement": 1, "velocity": 1, "acceleration": 1, "force": 0}


@dataclass(frozen=True, eq=False)
class _DataSet:
    header: dict[str, Any]
    abscissa: FloatArray
    values: ComplexArray
    number: int

    def dof(self, which: str) -> tuple[int, int]:
        return int(self.header[f"{which}_node"]), int(self.header[f"{which}_dir"])


def read(path: Path, frf: bool, options: TextOptions) -> Contents:
    """All functions of one kind, named by node and direction (``101:+Z``); a negative direction turns the sign."""
    sets, factors = _data_sets(path)
    types = sorted({int(s.header["func_type"]) for s in sets})
    wanted = [s for s in sets if s.header["func_type"] == (_FRF if frf else _TIME)]
    if not wanted:
        raise DataFormatError(
            f"{path}: no {'frequency response (function type 4)' if frf else 'time record (function type 1)'} "
            f"among its data sets 58 (function types {types}); correct `kind` in campaign.toml"
        )
    if not frf:
        return Contents(histories=_histories(wanted, path, factors))
    coherences = [s for s in sets if s.header["func_type"] == _COHERENCE]
    return Contents(frf=_responses(wanted, coherences, path, factors))


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """Write contents as ASCII data sets 58, which every program reads alike."""
    sets: list[dict[str, Any]] = []
    if contents.frf is not None:
        if contents.frf.force_amplitude is not None:
            raise DataFormatError(
                f"{path.name}: UFF has no place for the force amplitude of each line; write csv or mat"
            )
        freq = contents.frf.freq
        even = bool(np.allclose(np.diff(freq), freq[1] - freq[0], rtol=1e-9, atol=0))
        for response in contents.frf.responses:
            common = {"id1": response.name, "x": freq, "abscissa_spacing": int(even), "abscissa_spec_data_type": 18}
            numerator = layout.quantities[response.name]
            sets.append(
                _header(layout, response.name, _FRF)
                | common
                | {"data": response.values, "ordinate_spec_data_type": _TYPE_OF_QUANTITY[numerator]}
                | {"orddenom_spec_data_type": _TYPE_OF_QUANTITY[layout.quantities["force"]]}
                | {"ordinate_axis_units_lab": SI_UNIT[numerator]}
                | {"orddenom_axis_units_lab": SI_UNIT[layout.quantities["force"]]}
            )
            if response.coherence is not None:
                sets.append(
                    _header(layout, response.name, _COHERENCE)
                    | common
                    | {"data": np.asarray(response.coherence, float), "ordinate_spec_data_type": 1}
                )
    for history in contents.histories:
        for signal in history.signals:
            time = np.arange(signal.values.size) / history.fs
            sets.append(
                _header(layout, signal.name, _TIME)
                | {"id1": signal.name, "id2": history.name or "NONE", "x": time, "data": signal.values}
                | {"abscissa_spacing": 1, "abscissa_spec_data_type": 17, "abscissa_axis_units_lab": "s"}
                | {"ordinate_spec_data_type": _TYPE_OF_QUANTITY[layout.quantities[signal.name]]}
                | {"ordinate_axis_units_lab": signal.unit or "NONE"}
            )
    # a data set's abscissa step has six digits in its header; both readers and this one take the rounding out
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite")


def _header(layout: Layout, channel: str, function: int) -> dict[str, Any]:
    """Every field that pyuff writes as a number must hold one: None fails."""
    node, direction = layout.nodes[channel]
    ref_node, ref_direction = layout.nodes["force"]
    exponents = {
        f"{axis}_{unit}_unit_exp": 0
        for axis in ("abscissa", "ordinate", "orddenom", "z_axis")
        for unit in ("len", "force", "temp")
    }
    labels = {
        f"{axis}_axis_{label}": "NONE"
        for axis in ("abscissa", "ordinate", "orddenom", "z_axis")
        for label in ("lab", "units_lab")
    }
    fields: dict[str, Any] = {"type": 58, "binary": 0, "func_type": function, "func_id": 0, "ver_num": 1}
    fields |= {"load_case_id": 0, "rsp_ent_name": "NONE", "ref_ent_name": "NONE"}
    fields |= {f"id{k}": "NONE" for k in range(1, 6)}
    fields |= {"rsp_node": node, "rsp_dir": direction or 1}
    fields |= {"ref_node": ref_node, "ref_dir": ref_direction or 1}
    if function == _TIME:  # a time record has no reference
        fields |= {"ref_node": 0, "ref_dir": 0}
    fields |= {"z_axis_value": 0.0, "abscissa_min": 0.0, "abscissa_inc": 0.0}
    fields |= {f"{axis}_spec_data_type": 0 for axis in ("abscissa", "ordinate", "orddenom", "z_axis")}
    return fields | exponents | labels


def _data_sets(path: Path) -> tuple[list[_DataSet], tuple[float, float]]:
    blocks = split_blocks(path)
    try:
        file = pyuff.UFF(str(path))
        numbers = [int(n) for n in file.get_set_types()]
        if len(numbers) != len(blocks):
            raise DataFormatError(f"{path}: truncated universal file; export it again")
        sets = []
        factors = (1.0, 1.0)
        for k, number in enumerate(numbers):
            if number == 58:
                header = file.read_sets(k, header_only=True)
                abscissa, values = data_values(blocks[k], header, f"{path}: data set {k + 1}")
                sets.append(_DataSet(header, abscissa, values, k + 1))
            elif number == 164:
                units = file.read_sets(k)
                factors = (float(units["length"]), float(units["force"]))
    except DataFormatError:
        raise
    except Exception as error:  # pyuff raises bare Exceptions
        raise DataFormatError(f"{path}: not a readable universal file ({error}); export it again as ASCII") from error
    if not sets:
        raise DataFormatError(f"{path}: holds no data set 58; export the functions as universal file data set 58")
    if not all(np.isfinite(f) and f > 0 for f in factors):
        raise DataFormatError(
            f"{path}: unit factors {factors} of its data set 164 are not positive; export it again in SI"
        )
    return sets, factors


def _known_quantity(data_set: _DataSet) -> str | None:
    return _QUANTITY_OF_TYPE.get(int(data_set.header["ordinate_spec_data_type"]))


def _label(data_set: _DataSet, axis: str) -> str | None:
    label = str(data_set.header.get(f"{axis}_axis_units_lab", "")).strip()
    return None if label.upper() in ("", "NONE") else label


def _unit(data_set: _DataSet, axis: str, factors: tuple[float, float]) -> tuple[str | None, float]:
    """Unit of numerator or denominator, and the factor to it: the label, or the data type in the file's unit system."""
    label = _label(data_set, axis)
    if label is not None:
        return label, 1.0
    quantity = _QUANTITY_OF_TYPE.get(int(data_set.header[f"{axis}_spec_data_type"]))
    if quantity is None:
        return None, 1.0
    length, force = factors
    return SI_UNIT[quantity], 1 / (length if _LENGTH_POWER[quantity] else force)


def _responses(wanted: list[_DataSet], coherences: list[_DataSet], path: Path, factors: tuple[float, float]) -> RawFrf:
    axis = wanted[0].abscissa
    responses = []
    for data_set in wanted:
        numerator, up = _unit(data_set, "ordinate", factors)
        denominator, down = (None, 1.0)
        if numerator is None or "/" not in numerator.replace("m/s", ""):
            denominator, down = _unit(data_set, "orddenom", factors)
        unit = numerator if numerator is None or denominator is None else f"{numerator}/{denominator}"
        rsp, ref = data_set.dof("rsp"), data_set.dof("ref")
        sign = np.sign(rsp[1] or 1) * np.sign(ref[1] or 1)
        alike = data_set.abscissa.shape == axis.shape and np.allclose(data_set.abscissa, axis, rtol=1e-6)
        responses.append(
            RawResponse(
                dof_name(rsp),
                unit,
                sign * up / down * data_set.values,
                _coherence(path, data_set, coherences),
                dof=rsp,
                ref=ref,
                quantity=_known_quantity(data_set),
                freq=None if alike else data_set.abscissa,
                origin=f"data set {data_set.number}",
            )
        )
    return RawFrf(axis, tuple(responses))


def _histories(wanted: list[_DataSet], path: Path, factors: tuple[float, float]) -> tuple[RawHistory, ...]:
    """The n-th time record of each degree of freedom and quantity makes the n-th blow."""
    columns: dict[tuple[int, int, str | None], list[_DataSet]] = {}
    for data_set in wanted:
        node, direction = data_set.dof("rsp")
        columns.setdefault((node, abs(direction), _measured(data_set)), []).append(data_set)
    places = [key[:2] for key in columns]
    histories = []
    for blow in range(max(len(sets) for sets in columns.values())):
        present = {key: sets[blow] for key, sets in columns.items() if blow < len(sets)}
        first = next(iter(present.values()))
        fs = _rate(path, first)
        signals = []
        for key, data_set in present.items():
            unit, factor = _unit(data_set, "ordinate", factors)
            dof, quantity = data_set.dof("rsp"), key[2]
            rate = _rate(path, data_set)
            name = dof_name(dof) + (f" {quantity or 'other'}" if places.count(key[:2]) > 1 else "")
            sign = 1.0 if dof[1] >= 0 else -1.0
            signals.append(
                Signal(
                    name,
                    unit,
                    sign * factor * data_set.values.real,
                    dof=dof,
                    quantity=quantity,
                    fs=None if rate == fs else rate,
                    origin=f"data set {data_set.number}",
                )
            )
        title = str(first.header.get("id2", "")).strip()
        histories.append(RawHistory(title if title and title != "NONE" else f"blow {blow + 1}", fs, tuple(signals)))
    return tuple(histories)


def dof_name(dof: tuple[int, int]) -> str:
    """Node and direction as analysers write them: ``101:+Z``; rotations as ``+RZ``, direction 0 as ``S``."""
    node, direction = dof
    axis = {0: "S", 1: "X", 2: "Y", 3: "Z", 4: "RX", 5: "RY", 6: "RZ"}.get(abs(direction), str(abs(direction)))
    return f"{node}:{'-' if direction < 0 else '+'}{axis}"


def _coherence(path: Path, data_set: _DataSet, coherences: list[_DataSet]) -> FloatArray | None:
    def same(c: _DataSet) -> bool:
        ends = ("rsp", "ref")
        return all(c.dof(e)[0] == data_set.dof(e)[0] and abs(c.dof(e)[1]) == abs(data_set.dof(e)[1]) for e in ends)

    found = [c for c in coherences if same(c)]
    if not found:
        return None
    # several at one degree of freedom: the one that follows its FRF
    best = min(found, key=lambda c: (c.number < data_set.number, abs(c.number - data_set.number)))
    if best.values.shape != data_set.values.shape:
        raise DataFormatError(
            f"{path}: coherence (data set {best.number}) has {best.values.size} lines, its FRF {data_set.values.size}"
            "; export both with one frequency axis"
        )
    return np.ascontiguousarray(best.values.real)


def _measured(data_set: _DataSet) -> str | None:
    """Quantity of a time record; the input is told by data type, unit or name, since it shares a node with a response."""
    label = _label(data_set, "ordinate")
    if str(data_set.header["id1"]).strip().lower().split(" ")[-1] == "force":
        return "force"
    if label is not None and label.lower() in ("n", "newton"):
        return "force"
    return _known_quantity(data_set)


def _rate(path: Path, data_set: _DataSet) -> float:
    where = f"{path}: data set {data_set.number}"
    if data_set.header["abscissa_spacing"] == 0:
        return even_sampling(data_set.abscissa, where)
    step = float(data_set.header["abscissa_inc"])
    if not step > 0:
        raise DataFormatError(f"{where}: its time step is {step} s; it must be positive")
    # the header prints the step with six digits
    last = 10.0 ** (np.floor(np.log10(step)) - 5)
    return sampling_frequency(step, max(0.51 * last / step, 1e-9))
