"""Campaigns: campaign.toml and its files, read into records and written from them."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.measurement.checks import EmptyRecordError, check_record, guesses_left
from cutvib_ss.measurement.conversion import frf_of, histories_of, motion_factor, to_contents
from cutvib_ss.measurement.formats import format_of
from cutvib_ss.measurement.formats.raw import Contents, Layout, RawFrf, RawResponse, Signal, TextOptions
from cutvib_ss.measurement.inputs import struck_port
from cutvib_ss.measurement.layout import layout_of
from cutvib_ss.measurement.noise import frf_variance, smeared_variance
from cutvib_ss.measurement.plausibility import refuse_undivided, same_data
from cutvib_ss.measurement.reading import read_file
from cutvib_ss.measurement.records import FORCE, Campaign, History, MachineLike, Record
from cutvib_ss.measurement.rounding import words_on_steps
from cutvib_ss.measurement.schema import CampaignFile, ChannelTable, RecordTable, read_campaign_file, toml_text
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.results import MeasuredFrequencyResponse, Quantity
from cutvib_ss.results.arrays import optional_array

_Writable: TypeAlias = Literal["tdms", "uff", "csv", "mat"]
_FORMATS: tuple[str, ...] = get_args(_Writable)


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
        If a file or value cannot be used; the message names the file, what is wrong and how to fix it.
    """
    path = Path(path)
    file = path / "campaign.toml" if path.is_dir() else path
    tables = read_campaign_file(file)
    warnings = guesses_left(file, "something")
    if machine is None:
        machine = _machine(tables, file)
        if tables.campaign.machine is not None:
            warnings += guesses_left(file.parent / tables.campaign.machine, "the nominal model")
    records: list[Record] = []
    empty: list[EmptyRecordError] = []
    for number, table in enumerate(tables.record, start=1):
        _check_position(table, machine, f"{file}: record[{number}]")
        struck = struck_port(table.input, machine, f"{file}: record[{number}]")
        here = layout_of(machine, tables.dofs, f"{file}: dofs", struck)
        options = TextOptions(**tables.csv_of(table).model_dump())
        try:
            record, found = _read_record(table, file.parent, machine, here, tables.channels_of(table), struck, options)
        except EmptyRecordError as error:
            # A soft blow may be less than a step of a coarse converter: the other records still tell.
            empty.append(error)
            continue
        records.append(record)
        warnings += found
    if empty and not records:
        raise empty[0]
    warnings += tuple(f"{error}; this record is left out" for error in empty)
    warnings += same_data(records)
    refuse_undivided(records, str(file))
    blows = [record for record in records if record.kind == "impact"]
    warnings += words_on_steps(blows, [[h.start for h in record.histories] for record in blows])
    title = tables.campaign.title or file.parent.resolve().name
    return Campaign(title, file.parent, machine, tuple(records), _told_once(warnings))


def _told_once(warnings: Sequence[str]) -> tuple[str, ...]:
    """What is said of several files alike, said once: of the first, and how many more."""
    files: dict[str, dict[str, None]] = {}
    for warning in warnings:
        where, _, what = warning.partition(": ")
        files.setdefault(what, {})[where] = None
    return tuple(
        f"{next(iter(names))}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: {what}"
        for what, names in files.items()
    )


def write_campaign(campaign: Campaign, folder: str | os.PathLike[str], *, format: _Writable = "tdms") -> Path:
    """
    Write a campaign: campaign.toml, machine.toml and a file per record, in SI units.

    Parameters
    ----------
    campaign : Campaign
        What to write.
    folder : path-like
        Folder to write to; made where absent. Files of the same names in it are replaced.
    format : {"tdms", "uff", "csv", "mat"}
        Format of the records. TDMS holds time records only.

    Returns
    -------
    Path
        The campaign.toml written.

    Raises
    ------
    ParameterError
        If the format is not one of these.
    DataFormatError
        If the format cannot hold a record.

    Notes
    -----
    Everything is written beside the folder first and moved into it at the end, campaign.toml last: nothing is left half
    written. UFF keeps twelve digits of a value, and six of the time or frequency step.
    """
    if format not in _FORMATS:
        raise ParameterError(f"format {format!r} is not written; choose one of {', '.join(_FORMATS)}")
    folder = Path(folder).resolve()
    layout = layout_of(campaign.machine)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as name:
        scratch = Path(name)
        write_machine(campaign.machine, scratch / "machine.toml")
        lines = ["[campaign]", f"title = {toml_text(campaign.title)}", 'machine = "machine.toml"']
        files = _file_names(campaign.records, f".{format}")
        for record, file in zip(campaign.records, files, strict=True):
            (scratch / file).parent.mkdir(parents=True, exist_ok=True)
            format_of(scratch / file).write(scratch / file, _contents(record, layout), layout)
            lines += ["", "[[record]]", f"file = {toml_text(file)}", *_record_lines(record)]
        (scratch / "campaign.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
        for file in [*files, "machine.toml", "campaign.toml"]:
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            os.replace(scratch / file, folder / file)
    return folder / "campaign.toml"


def _machine(tables: CampaignFile, file: Path) -> Any:
    if tables.campaign.machine is None:
        return published_machine()
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
    table: RecordTable,
    folder: Path,
    machine: MachineLike,
    layout: Layout,
    mapping: Mapping[str, ChannelTable],
    struck: str | None,
    options: TextOptions,
) -> tuple[Record, tuple[str, ...]]:
    paths = [folder / name for name in table.files]
    contents = [read_file(path, table.kind == "frf", layout, mapping, options) for path in paths]
    warnings = [warning for content in contents for warning in content.warnings]
    histories: tuple[History, ...] = ()
    frf, amplitude, peak_response = None, None, table.peak_response
    if table.kind == "frf":
        raw = _merged(
            [frf_of(content, layout, str(path)) for path, content in zip(paths, contents, strict=True)], paths
        )
        channels = tuple(response.name for response in raw.responses)
        frf = _measured(raw, table, machine, struck)
        amplitude = None if raw.force_amplitude is None else raw.force_amplitude.values
        if peak_response is not None:
            given = next(c.frf for c in contents if c.frf and any(r.name == channels[0] for r in c.frf.responses))
            peak_response *= motion_factor(given, channels[0], layout, str(paths[0]))
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
        session=table.session,
        band_hz=table.band_hz,
        input=struck,
        sweep=table.sweep,
        controlled=table.controlled,
        peak_response=peak_response,
        force_amplitude=amplitude,
        files=tuple(table.files),
    )
    checked, found = check_record(record, machine, str(paths[0]))
    _check_blow(checked, str(paths[0]))
    return checked, (*warnings, *found)


def _check_blow(record: Record, where: str) -> None:
    """Refuse a stated instant of the blow that an estimate's block does not hold."""
    if record.frf is None or record.excitation != "impact" or record.blow_at is None:
        return
    block = record.block or 1.0 / float(np.median(np.diff(record.frf.freq)))
    if record.blow_at >= block:
        raise DataFormatError(
            f"{where}: blow_at = {record.blow_at:g} s lies beyond the block of {block:g} s (1/Δf, unless `block` says otherwise); "
            "give the time from the block's start to the blow"
        )


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
    amplitudes = [part.force_amplitude for part in parts if part.force_amplitude is not None]
    if any(not np.allclose(a.values, amplitudes[0].values, rtol=1e-6) for a in amplitudes[1:]):
        raise DataFormatError(f"{paths[0]}: the files of this record state different force amplitudes; keep one")
    responses = tuple(response for part in parts for response in part.responses)
    return RawFrf(freq, responses, amplitudes[0] if amplitudes else None)


def _measured(raw: RawFrf, table: RecordTable, machine: MachineLike, struck: str | None) -> MeasuredFrequencyResponse:
    data = np.stack([response.values for response in raw.responses])
    unknown = np.full(raw.freq.size, np.nan)
    coherence = np.stack([unknown if r.coherence is None else r.coherence for r in raw.responses])
    variance = frf_variance(data, coherence, table.averages)
    if table.excitation == "random":
        # Of which window is not told: what that of most analysers does is an error of unknown sign.
        variance = variance + smeared_variance(data, variance)
    channels = tuple(response.name for response in raw.responses)
    quantities: tuple[Quantity, ...] = tuple(machine.channels[name].quantity for name in channels)
    return MeasuredFrequencyResponse(
        data=data[np.newaxis, :, np.newaxis],
        freq=raw.freq,
        positions=optional_array([table.position]),
        outputs=channels,
        inputs=(struck or FORCE,),
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


def _contents(record: Record, layout: Layout) -> Contents:
    if record.frf is None:
        return to_contents(record.histories, layout)
    frf = record.frf
    known = ~np.all(np.isnan(frf.coherence[0, :, 0]), axis=-1)
    responses = tuple(
        RawResponse(name, unit, frf.data[0, k, 0], frf.coherence[0, k, 0] if known[k] else None)
        for k, (name, unit) in enumerate(zip(frf.outputs, frf.units, strict=True))
    )
    amplitude = record.force_amplitude
    stated = None if amplitude is None else Signal("force amplitude", record.input_unit, amplitude)
    return Contents(frf=RawFrf(frf.freq, responses, stated))


def _file_names(records: Sequence[Record], suffix: str) -> list[str]:
    """A file per record, under its own name with another suffix; numbered where two would share one."""
    names: list[str] = []
    for record in records:
        path = Path(record.name).with_suffix("")
        if path.is_absolute() or ".." in path.parts:  # not out of the folder
            path = Path("records") / path.name
        candidate, number = path.as_posix() + suffix, 1
        while candidate in names:
            number += 1
            candidate = f"{path.as_posix()}_{number}{suffix}"
        names.append(candidate)
    return names


def _record_lines(record: Record) -> list[str]:
    values = {
        "kind": record.kind,
        "use": record.use,
        "position": record.position,
        "peak_force": record.peak_force,
        "averages": record.averages if record.kind == "frf" else None,
        "excitation": None if record.kind == "impact" else record.excitation,
        "block": record.block,
        "blow_at": record.blow_at,
        "exponential_decay": record.exponential_decay or None,
        "session": record.session,
        "band_hz": record.band_hz,
        "input": record.input,
        "sweep": record.sweep,
        "controlled": record.controlled,
        "peak_response": record.peak_response,
    }
    return [f"{key} = {toml_text(value)}" for key, value in values.items() if value is not None]
