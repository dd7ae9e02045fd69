"""A campaign.toml for the files found in a folder: channels mapped as far as they can be, what is open marked TODO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from statistics import median

from cutvib_ss.measurement.dofs import parse_dof
from cutvib_ss.measurement.records import FORCE, MachineLike
from cutvib_ss.measurement.schema import toml_text
from cutvib_ss.measurement.survey import (
    FoundColumn,
    FoundFile,
    Survey,
    grouped,
    guess_channels,
    guess_force,
    guess_level,
    guess_position,
)
from cutvib_ss.units import SI_UNIT

_VOLTS = ("V", "mV")


@dataclass(frozen=True)
class Wishes:
    """What the user states because it cannot be told: columns of channels, position, units by channel, averages of FRFs."""

    names: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    position: float | None = None
    title: str = ""
    averages: int | None = None


@dataclass(frozen=True)
class Mapped:
    """Columns of files of one kind: channel to column, and whether that is sure; channels without a column."""

    columns: Mapping[str, FoundColumn]
    sure: Mapping[str, bool]
    missing: tuple[str, ...]
    left: tuple[str, ...]
    ratio: bool = False
    reference: str | None = None


@dataclass(frozen=True)
class Draft:
    """The text of campaign.toml, the mapping of each file, and what is left to do."""

    text: str
    mapped: Mapping[str, Mapped]
    todo: tuple[str, ...]


def map_file(file: FoundFile, machine: MachineLike, wishes: Wishes) -> Mapped:
    """Which column of a file is which channel: as stated, else as its name, unit, node or order says."""
    by_name = {column.name: column for column in file.columns}
    columns: dict[str, FoundColumn] = {}
    sure: dict[str, bool] = {}
    ratio = file.kind == "frf"
    for channel, name in wishes.names.items():
        match = by_name.get(name) or next((c for n, c in by_name.items() if n.casefold() == name.casefold()), None)
        if match is not None:
            columns[channel], sure[channel] = match, True
    force = columns[FORCE].name if FORCE in columns else guess_force(file.columns)
    if not ratio and FORCE not in columns and force is not None:
        columns[FORCE], sure[FORCE] = by_name[force], True
    driven = by_name[force].dof if force is not None and not ratio else None
    if ratio and file.references:
        driven = parse_dof(file.references[0])
    open_ = {n: str(c.quantity) for n, c in machine.channels.items() if n not in columns}
    rest = [c for c in file.columns if c.name not in {column.name for column in columns.values()}]
    for channel, (name, certain) in guess_channels(rest, open_, None if ratio else force, driven).items():
        columns[channel], sure[channel] = by_name[name], certain
    wanted = ([] if ratio else [FORCE]) + list(machine.channels)
    used = {column.name for column in columns.values()}
    return Mapped(
        {n: columns[n] for n in wanted if n in columns},
        sure,
        tuple(n for n in wanted if n not in columns),
        tuple(c.name for c in file.columns if c.name not in used),
        ratio,
        file.references[0] if file.references else None,
    )


def draft(found: Survey, machine: MachineLike, wishes: Wishes, machine_file: str | None) -> Draft:
    """campaign.toml of the files of a folder."""
    groups = grouped(found.files)
    mapped = {group[0].name: map_file(group[0], machine, wishes) for group in groups}
    todo: list[str] = []
    tables = [_channel_lines(m, machine, wishes) for m in mapped.values()]
    common = max(tables, key=tables.count) if tables else ([], [])
    title = wishes.title or found.folder.resolve().name
    lines = [
        "# What was measured here. Lines marked TODO are guesses or gaps: correct them, then see `cutvib campaign show`.",
        "[campaign]",
        f"title = {toml_text(title)}",
    ]
    if machine_file is not None:
        lines.append(f"machine = {toml_text(machine_file)}  # the nominal model")
    for group, table in zip(groups, tables, strict=True):
        lines += ["", *_record_lines(group, machine, wishes, todo)]
        if table != common and table[0]:
            lines += ["[record.channels]", *table[0]]
        todo += [f"{group[0].name}: {word}" for word in (table[1] if table != common else [])]
    if common[0]:
        lines += [
            "",
            "# What the files call the channels. physical = sign * gain * e^(i phase_deg) * what the file says in `unit`;",
            "# a unit here overrides the file's. Columns that are not named are not used.",
            "[channels]",
            *common[0],
        ]
    todo = [*common[1], *todo]
    if any(m.ratio and any(c.dof is not None for c in m.columns.values()) for m in mapped.values()):
        lines.append("# [dofs]  # or by node numbers in place of names: tool = 101, a line each")
    for words in found.refused:
        lines += ["", f"# not read: {words}"]
    return Draft("\n".join(lines) + "\n", mapped, tuple(dict.fromkeys(todo)))


def _channel_lines(m: Mapped, machine: MachineLike, wishes: Wishes) -> tuple[list[str], list[str]]:
    """Lines of [channels], and what is to be done about them."""
    lines, todo = [], []
    if m.reference is not None and m.columns:
        lines.append(f"{FORCE} = {{ name = {toml_text(m.reference)} }}  # the reference of the FRFs")
    for channel, column in m.columns.items():
        quantity = machine.input_quantity if channel == FORCE else str(machine.channels[channel].quantity)
        parts, notes = [f"name = {toml_text(column.name)}"], []
        unit = wishes.units.get(channel)
        if unit is not None:
            parts.append(f"unit = {toml_text(unit)}")
        elif column.unit is None:
            parts.append(f"unit = {toml_text(_unit(quantity, m.ratio, machine))}")
            notes.append("the file names no unit: is it this one?")
        elif column.unit.strip() in _VOLTS:
            parts += [f"unit = {toml_text(SI_UNIT[quantity])}", "gain = 1.0"]
            notes.append(f"the file holds {column.unit}: set the gain in {SI_UNIT[quantity]} per {column.unit}")
        if not m.sure.get(channel, True):
            notes.append("guessed: is it this column?")
        if column.name == channel and len(parts) == 1 and not notes:
            continue
        lines.append(f"{channel} = {{ {', '.join(parts)} }}" + (f"  # TODO {'; '.join(notes)}" if notes else ""))
        todo += [f"{channel}: {note}" for note in notes]
    if not lines and not m.left:
        return [], []
    for channel in m.missing:
        left = ", ".join(m.left[:6]) or "none left"
        lines.append(f'# {channel} = {{ name = "…" }}  # TODO if it was measured; columns left: {left}')
        if channel == FORCE or not any(name != FORCE for name in m.columns):
            todo.append(f"{channel}: no column found for it; name it (columns: {left})")
    if lines and all(line.startswith("#") for line in lines) and not m.left:
        return [], todo
    if not any(not line.startswith("#") for line in lines) and m.left and m.columns:
        # a line that maps something, so that columns that are left are passed over
        channel, column = next(iter(m.columns.items()))
        lines.insert(0, f"{channel} = {{ name = {toml_text(column.name)} }}")
    return lines, todo


def _unit(quantity: str, ratio: bool, machine: MachineLike) -> str:
    per = "N" if machine.input_quantity == "force" else "m/s^2"
    return f"{SI_UNIT[quantity]}/{per}" if ratio else SI_UNIT[quantity]


def _record_lines(group: Sequence[FoundFile], machine: MachineLike, wishes: Wishes, todo: list[str]) -> list[str]:
    first = group[0]
    names = toml_text(first.name) if len(group) == 1 else "[" + ", ".join(toml_text(f.name) for f in group) + "]"
    lines = ["[[record]]", f"file = {names}", f'kind = "{first.kind}"{_comment(group)}']
    for note in first.warnings:
        if "hits in one recording" in note:
            lines.append(f"# TODO {note}")
            todo.append(f"{first.name}: {note}")
    if machine.has_position:
        position = wishes.position or guess_position(str(PurePosixPath(first.name).with_suffix("")))
        if position is None:
            lines.append("position = 0.5  # TODO y_b / L of the head on the rail, strictly between 0 and 1")
            todo.append(f"{first.name}: position")
        else:
            lines.append(f"position = {position:g}")
    peaks = [peak for file in group for peak in file.peaks]
    if peaks and first.kind == "impact" and min(peaks) > 0:
        unit = "N" if machine.input_quantity == "force" else "m/s^2"
        spread = f"{min(peaks):.3g} to {max(peaks):.3g} {unit}" if len(peaks) > 1 else unit
        lines.append(f"peak_force = {median(peaks):.4g}  # {spread}")
    if first.kind == "frf":
        level = guess_level(PurePosixPath(first.name).stem) if machine.input_quantity == "force" else None
        if level is not None:
            lines.append(f"peak_force = {level:g}  # N, as the name says")
        if wishes.averages is None:
            lines.append("averages = 1  # TODO blows or blocks behind each FRF; with one the coherence says nothing")
            todo.append("averages: how many blows or blocks are behind each FRF? (--averages states it for all)")
        else:
            lines.append(f"averages = {wishes.averages}")
        lines.append('# excitation = "impact"  # or "random", "multisine", "sine"')
        if len(first.references) > 1:
            lines.append(
                f"# it holds FRFs to {', '.join(first.references)}; add a record with `input` for each other one"
            )
    lines.append('# use = "check"  # or "fit"; left out: held out by turns')
    return lines


def _comment(group: Sequence[FoundFile]) -> str:
    first = group[0]
    if first.kind == "frf":
        return f"  # {first.samples} lines"
    blows = sum(file.blows for file in group)
    what = f"{blows} blow{'s' if blows > 1 else ''}" if first.kind == "impact" else "one history"
    rate = "" if first.fs is None else f" at {first.fs:g} Hz"
    return f"  # {what} of {first.samples} samples{rate}"
