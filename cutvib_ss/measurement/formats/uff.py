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


def read(path: Path, frf: bool, layout: Layout) -> Contents:
    """
    Contents of a universal file; node and direction give the channel.

    Parameters
    ----------
    path : Path
        File.
    frf : bool
        Whether frequency responses are wanted, else time records.
    layout : Layout
        Node and direction of every channel and of the force.

    Returns
    -------
    Contents
        Frequency responses with their coherences; or histories: the n-th time record of each degree of freedom makes
        the n-th blow. A negative direction turns the sign.

    Raises
    ------
    DataFormatError
        If the file is truncated, holds no such data sets, or two of them claim one channel.
    """
    sets, factors = _data_sets(path)
    types = sorted({int(s.header["func_type"]) for s in sets})
    wanted = [s for s in sets if s.header["func_type"] == (_FRF if frf else _TIME)]
    if not wanted:
        raise DataFormatError(
            f"{path}: no {'frequency response (function type 4)' if frf else 'time record (function type 1)'} "
            f"among its data sets 58 (function types {types}); correct `kind` in campaign.toml"
        )
    if not frf:
        return _time_records(path, wanted, layout, factors)
    return _responses(path, wanted, [s for s in sets if s.header["func_type"] == _COHERENCE], layout, factors)


def write(path: Path, contents: Contents, layout: Layout) -> None:
    """
    Write contents as ASCII data sets 58, which every program reads alike.

    Parameters
    ----------
    path : Path
        File to write.
    contents : Contents
        Histories or frequency responses, in SI units.
    layout : Layout
        Node and direction of every channel and of the force.
    """
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


def _channel_of(dof: tuple[int, int], layout: Layout, quantity: str | None) -> str | None:
    """Response channel at a node and direction; a known quantity tells channels of one place apart."""
    node, direction = dof
    there = [
        name
        for name, (n, d) in layout.nodes.items()
        if name != "force" and n == node and (d is None or d == abs(direction))
    ]
    fitting = [name for name in there if quantity in (None, layout.quantities[name])]
    return next(iter(fitting or there), None)


def _known_quantity(data_set: _DataSet) -> str | None:
    return _QUANTITY_OF_TYPE.get(int(data_set.header["ordinate_spec_data_type"]))


def _label(data_set: _DataSet, axis: str) -> str | None:
    label = str(data_set.header.get(f"{axis}_axis_units_lab", "")).strip()
    return None if label.upper() in ("", "NONE") else label


def _unit(
    path: Path, data_set: _DataSet, axis: str, expected: str, factors: tuple[float, float]
) -> tuple[str | None, float]:
    """Unit of numerator or denominator, and the factor to it: the label, or the data type in the file's unit system."""
    label = _label(data_set, axis)
    if label is not None:
        return label, 1.0
    quantity = _QUANTITY_OF_TYPE.get(int(data_set.header[f"{axis}_spec_data_type"]))
    if quantity is None:
        return None, 1.0
    if quantity != expected:
        raise DataFormatError(
            f"{path}: data set {data_set.number} holds {quantity}, but this channel is {expected}; "
            "correct [dofs], or export the function as " + expected
        )
    length, force = factors
    return SI_UNIT[quantity], 1 / (length if _LENGTH_POWER[quantity] else force)


def _responses(
    path: Path, wanted: list[_DataSet], coherences: list[_DataSet], layout: Layout, factors: tuple[float, float]
) -> Contents:
    warnings = []
    force_node, force_direction = layout.nodes["force"]
    driven = [
        s
        for s in wanted
        if s.dof("ref")[0] == force_node and (force_direction is None or abs(s.dof("ref")[1]) in (0, force_direction))
    ]
    if not driven:
        raise DataFormatError(
            f"{path}: no FRF refers to the force's node {force_node} (references: "
            f"{sorted({s.dof('ref') for s in wanted})} as node, direction); set the node numbers under [dofs]"
        )
    responses: dict[str, tuple[_DataSet, RawResponse]] = {}
    ignored = {s.dof("rsp") for s in wanted if s not in driven}
    for data_set in driven:
        channel = _channel_of(data_set.dof("rsp"), layout, _known_quantity(data_set))
        if channel is None:
            ignored.add(data_set.dof("rsp"))
            continue
        if channel in responses:
            raise DataFormatError(
                f"{path}: data sets {responses[channel][0].number} and {data_set.number} are both FRFs of {channel!r}; "
                "one file holds one of each, so split it, one record a file"
            )
        numerator, up = _unit(path, data_set, "ordinate", layout.quantities[channel], factors)
        denominator, down = (None, 1.0)
        if numerator is None or "/" not in numerator.replace("m/s", ""):
            denominator, down = _unit(path, data_set, "orddenom", layout.quantities["force"], factors)
        if numerator is None:
            unit = None
        else:
            unit = numerator if denominator is None else f"{numerator}/{denominator}"
        sign = np.sign(data_set.dof("rsp")[1] or 1) * np.sign(data_set.dof("ref")[1] or 1)
        coherence = _coherence(path, data_set, coherences)
        raw = RawResponse(channel, unit, sign * up / down * data_set.values, coherence)
        responses[channel] = (data_set, raw)
    if not responses:
        raise DataFormatError(
            f"{path}: no FRF at the node and direction of a channel {_places(layout)}; it has "
            f"{sorted({s.dof('rsp') for s in wanted})}; set the node numbers under [dofs]"
        )
    if ignored:
        warnings.append(
            f"{path}: functions at (node, direction) {sorted(ignored)} belong to no channel and are left out"
        )
    axes = [s.abscissa for s, _ in responses.values()]
    if any(axis.shape != axes[0].shape or not np.allclose(axis, axes[0], rtol=1e-6) for axis in axes):
        raise DataFormatError(f"{path}: its FRFs have different frequency axes; export all channels with one")
    return Contents(frf=RawFrf(axes[0], tuple(raw for _, raw in responses.values())), warnings=tuple(warnings))


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


def _time_records(path: Path, wanted: list[_DataSet], layout: Layout, factors: tuple[float, float]) -> Contents:
    columns: dict[str, list[_DataSet]] = {}
    ignored = set()
    for data_set in wanted:
        channel = "force" if _is_force(data_set, layout) else None
        channel = channel or _channel_of(data_set.dof("rsp"), layout, _known_quantity(data_set))
        if channel is None:
            ignored.add(data_set.dof("rsp"))
        else:
            columns.setdefault(channel, []).append(data_set)
    if not columns:
        raise DataFormatError(
            f"{path}: no time record at the node and direction of a channel {_places(layout)}; set the node numbers "
            "under [dofs]"
        )
    counts = {channel: len(sets) for channel, sets in columns.items()}
    if len(set(counts.values())) > 1:
        raise DataFormatError(
            f"{path}: channels have different numbers of time records {counts}; each blow needs one of every channel"
        )
    histories = []
    for blow in range(next(iter(counts.values()))):
        signals = []
        rates = {}
        for channel, sets in columns.items():
            data_set = sets[blow]
            unit, factor = _unit(path, data_set, "ordinate", layout.quantities[channel], factors)
            sign = 1.0 if data_set.dof("rsp")[1] >= 0 else -1.0
            signals.append(Signal(channel, unit, sign * factor * data_set.values.real))
            rates[channel] = _rate(path, data_set)
        if len(set(rates.values())) > 1:
            raise DataFormatError(
                f"{path}: channels have different sampling frequencies {rates}; record them on one clock"
            )
        name = columns[next(iter(columns))][blow].header.get("id2", "")
        name = name if name and name != "NONE" else f"blow {blow + 1}"
        histories.append(RawHistory(name, next(iter(rates.values())), tuple(signals)))
    note = f"{path}: time records at (node, direction) {sorted(ignored)} belong to no channel and are left out"
    return Contents(histories=tuple(histories), warnings=(note,) if ignored else ())


def _is_force(data_set: _DataSet, layout: Layout) -> bool:
    """The force shares node and direction with the driving point: its data type, unit or name tells."""
    if str(data_set.header["id1"]).strip().lower().split(" ")[-1] == "force":
        return True
    if layout.quantities["force"] == "force":
        label = _label(data_set, "ordinate")
        return _known_quantity(data_set) == "force" or (label is not None and label.lower() in ("n", "newton"))
    return False


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


def _places(layout: Layout) -> dict[str, str]:
    axes = {1: "X", 2: "Y", 3: "Z", None: ""}
    return {name: f"{node}{axes.get(direction, '')}" for name, (node, direction) in layout.nodes.items()}
