"""Campaigns: campaign.toml and its files, read into records and written from them."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.checks import check_record
from cutvib_ss.measurement.conversion import frf_of, histories_of
from cutvib_ss.measurement.formats import read_file
from cutvib_ss.measurement.formats.raw import Layout, RawFrf
from cutvib_ss.measurement.noise import frf_variance
from cutvib_ss.measurement.records import FORCE, Campaign, History, MachineLike, Record
from cutvib_ss.measurement.schema import CampaignFile, RecordTable, read_campaign_file
from cutvib_ss.results import MeasuredFrequencyResponse, Quantity

_AXIS = {"_x": 1, "_y": 2, "_z": 3}
_CUTTING_MACHINE_NODES = {"tool": 1, "base": 2}


def read_campaign(path: str | os.PathLike[str], machine: Any = None) -> Campaign:
    """
    Read a measurement campaign.

    Parameters
    ----------
    path : path-like
        The campaign's folder, or its campaign.toml.
    machine : object, optional
        Nominal model in place of the one that the campaign names (`MachineLike`).

    Returns
    -------
    Campaign
        Records in SI units, checked; what was noticed is in ``warnings``.

    Raises
    ------
    DataFormatError
        If a file or value cannot be used; the message names the file, what is wrong and how to mend it.
    """
    path = Path(path)
    file = path / "campaign.toml" if path.is_dir() else path
    tables = read_campaign_file(file)
    if machine is None:
        machine = _machine(tables, file)
    layout = layout_of(machine, tables.dofs, f"{file}: dofs")
    records, warnings = [], []
    for number, table in enumerate(tables.record, start=1):
        _check_position(table, machine, f"{file}: record[{number}]")
        record, found = _read_record(table, file.parent, machine, layout)
        records.append(record)
        warnings += found
    title = tables.campaign.title or file.parent.resolve().name
    return Campaign(title, file.parent, machine, tuple(records), tuple(warnings))


def layout_of(machine: MachineLike, dofs: Mapping[str, int] | None = None, where: str = "dofs") -> Layout:
    """
    Quantities of a model's channels, and the node and direction where each is in formats that number nodes.

    Parameters
    ----------
    machine : MachineLike
        Nominal model.
    dofs : mapping of str to int, optional
        Node number of each place: of a port (``"drive"``), of a channel, or of either without its axis (``"tool"`` for
        ``tool_x`` and ``tool_z``). Default: ``tool`` 1, ``base`` 2; ports of other models are numbered from 1
        in the order of the channels.
    where : str
        For the message.

    Returns
    -------
    Layout
        Of the force and every channel; a name that ends in ``_x``, ``_y`` or ``_z`` has direction 1, 2 or 3, others any.

    Raises
    ------
    DataFormatError
        If a place is not the model's.
    """
    ports = {name: str(channel.port) for name, channel in machine.channels.items()} | {FORCE: machine.input_port}
    quantities: dict[str, str] = {FORCE: machine.input_quantity}
    quantities |= {name: str(channel.quantity) for name, channel in machine.channels.items()}
    given = dict(dofs or {})
    places = {name: _places(name, port) for name, port in ports.items()}
    known = {place for names in places.values() for place in names}
    for place in given:
        if place not in known:
            raise DataFormatError(f"{where}.{place}: not a place of the model; it has {', '.join(sorted(known))}")
    if machine.has_position:
        given = _CUTTING_MACHINE_NODES | given
    nodes: dict[str, tuple[int, int | None]] = {}
    for name, port in ports.items():
        stated = next((place for place in places[name] if place in given), None)
        if stated is None:
            stated = places[name][-1]
            given[stated] = max(given.values(), default=0) + 1
        axis = _AXIS.get(port[-2:], _AXIS.get(name[-2:]))
        nodes[name] = (given[stated], 1 if axis is None and machine.has_position else axis)
    return Layout(quantities, nodes)


def _places(name: str, port: str) -> list[str]:
    """Names under which [dofs] may give a channel's node, the most particular first."""
    names = [name, port] if name != FORCE else [FORCE, port]
    return list(dict.fromkeys([*names, *(n[:-2] if n[-2:] in _AXIS else n for n in reversed(names) if n != FORCE)]))


def _machine(tables: CampaignFile, file: Path) -> Any:
    if tables.campaign.machine is None:
        from cutvib_ss.machine import published_machine

        return published_machine()
    from cutvib_ss.model_files import read_machine

    model = file.parent / tables.campaign.machine
    if not model.is_file():
        raise DataFormatError(f"{model}: there is no such file; correct campaign.machine in {file}")
    return read_machine(model)


def _check_position(table: RecordTable, machine: MachineLike, where: str) -> None:
    if machine.has_position and table.position is None:
        raise DataFormatError(f"{where}.position: missing; give y_b / L of the head, strictly inside (0, 1)")
    if not machine.has_position and table.position is not None:
        raise DataFormatError(f"{where}.position = {table.position}: this model has no position; remove the key")


def _read_record(
    table: RecordTable, folder: Path, machine: MachineLike, layout: Layout
) -> tuple[Record, tuple[str, ...]]:
    paths = [folder / name for name in table.files]
    contents = [read_file(path, table.kind == "frf", layout) for path in paths]
    warnings = [warning for content in contents for warning in content.warnings]
    histories: tuple[History, ...] = ()
    frf = None
    if table.kind == "frf":
        raw = _merged(
            [frf_of(content, layout, str(path)) for path, content in zip(paths, contents, strict=True)], paths
        )
        channels = tuple(response.name for response in raw.responses)
        frf = _measured(raw, table, machine)
        averages = table.averages
    else:
        histories = tuple(
            history
            for path, content in zip(paths, contents, strict=True)
            for history in histories_of(content, layout, str(path))
        )
        _check_alike(histories, paths)
        channels = histories[0].channels
        averages = len(histories) if table.kind == "impact" else table.averages
    record = Record(
        name=table.files[0],
        kind=table.kind,
        position=table.position,
        peak_force=table.peak_force,
        use=table.use,
        channels=channels,
        quantities=tuple(machine.channels[name].quantity for name in channels),
        histories=histories,
        frf=frf,
        averages=averages,
        excitation=table.excitation or ("random" if table.kind == "timeseries" else "impact"),
        block=table.block,
        blow_at=table.blow_at,
        exponential_decay=table.exponential_decay,
        input_quantity=machine.input_quantity,
    )
    checked, found = check_record(record, machine, str(paths[0]))
    return checked, (*warnings, *found)


def _merged(parts: Sequence[RawFrf], paths: Sequence[Path]) -> RawFrf:
    """Channels from several files of one frf record."""
    freq = parts[0].freq
    names: set[str] = set()
    for part, path in zip(parts, paths, strict=True):
        if part.freq.shape != freq.shape or not np.allclose(part.freq, freq, rtol=1e-6):
            raise DataFormatError(f"{path}: its frequency axis is not that of {paths[0]}; export both with one")
        for response in part.responses:
            if response.name in names:
                raise DataFormatError(f"{path}: channel {response.name!r} is in another file of this record; keep one")
            names.add(response.name)
    return RawFrf(freq, tuple(response for part in parts for response in part.responses))


def _measured(raw: RawFrf, table: RecordTable, machine: MachineLike) -> MeasuredFrequencyResponse:
    data = np.stack([response.values for response in raw.responses])
    unknown = np.full(raw.freq.size, np.nan)
    coherence = np.stack([unknown if r.coherence is None else r.coherence for r in raw.responses])
    variance = frf_variance(raw.freq, data, coherence, table.averages)
    channels = tuple(response.name for response in raw.responses)
    quantities: tuple[Quantity, ...] = tuple(machine.channels[name].quantity for name in channels)
    return MeasuredFrequencyResponse(
        data=data[np.newaxis, :, np.newaxis],
        freq=raw.freq,
        positions=np.array([np.nan if table.position is None else table.position]),
        outputs=channels,
        inputs=(FORCE,),
        quantities=quantities,
        input_unit="N" if machine.input_quantity == "force" else "m/s^2",
        variance=variance[np.newaxis, :, np.newaxis],
        coherence=coherence[np.newaxis, :, np.newaxis],
        averages=table.averages,
    )


def _check_alike(histories: Sequence[History], paths: Sequence[Path]) -> None:
    first = histories[0]
    for history in histories[1:]:
        if history.channels != first.channels:
            raise DataFormatError(
                f"{paths[0]}: {history.name!r} has channels {', '.join(history.channels)}, {first.name!r} "
                f"{', '.join(first.channels)}; every blow of a record needs the same"
            )
        if abs(history.fs / first.fs - 1) > 1e-9:
            raise DataFormatError(
                f"{paths[0]}: {history.name!r} is sampled at {history.fs:g} Hz, {first.name!r} at {first.fs:g} Hz; "
                "every blow of a record needs the same"
            )
