"""What lies in a lab's folder: files, the columns in them, blows and levels; and which column is likely which channel."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.formats import is_readable, read_raw
from cutvib_ss.measurement.formats.names import FORCE_NAME, looks_like_unit
from cutvib_ss.measurement.formats.raw import Contents, RawHistory, RawResponse, Signal, TextOptions
from cutvib_ss.measurement.records import FORCE, Kind
from cutvib_ss.results import FloatArray
from cutvib_ss.units import SI_UNIT, to_si

_MOST_FILES = 500
_PLACES = {
    "tool": re.compile(r"tool|tcp|tip|spindle|werkzeug|messer|knife|cutter|driving", re.IGNORECASE),
    "base": re.compile(r"base|carriage|rail|schlitten|slide|guide|gantry|portal|beam", re.IGNORECASE),
    "head": re.compile(r"head|kopf", re.IGNORECASE),
}
_AXIS = re.compile(r"(?:^|[^a-z])[+-]?([xyz])[+-]?(?:$|[^a-z])|([xyz])$", re.IGNORECASE)
_BLOW_NUMBER = re.compile(
    r"[\s_.-]*(?:blow|hit|schlag|impact|shot|avg|average|run|meas|nr|no|n|#)?[\s_.-]*\d+$", re.IGNORECASE
)
_POSITION = re.compile(
    r"(?:pos(?:ition)?|y_?l?|x|p)[\s_=-]*(0[.,p]\d+)(?![.\d])|(?<![\d.,])(\d{1,2})\s*(?:%|pct|percent|proz)",
    re.IGNORECASE,
)
_LEVEL = re.compile(r"(?<![\w.,])(\d+(?:[.,]\d+)?) ?N(?![A-Za-z0-9])|_(\d+(?:[.,]\d+)?) ?N(?![A-Za-z0-9])")
_QUIET = 0.05  # of the largest force: below it the structure is left alone
_MOSTLY = 0.8  # of the samples of a blow's force that are quiet


@dataclass(frozen=True)
class FoundColumn:
    """One column of a file: its name, unit and size, and what its unit or format says it measures."""

    name: str
    unit: str | None
    quantity: str | None
    largest: float
    dof: tuple[int, int] | None = None


@dataclass(frozen=True)
class FoundFile:
    """One file that holds a measurement; ``name`` is relative to the folder."""

    name: str
    kind: Kind
    columns: tuple[FoundColumn, ...]
    blows: int
    samples: int
    fs: float | None
    peaks: tuple[float, ...]
    references: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Survey:
    """Files that are measurements, and those that are none, each with the reason."""

    folder: Path
    files: tuple[FoundFile, ...]
    refused: tuple[str, ...]


def survey(folder: Path, options: TextOptions | None = None, force: str | None = None) -> Survey:
    """Read every file below a folder whose suffix is a format's; ``force`` names the force's column where it is known."""
    if not folder.is_dir():
        raise DataFormatError(f"{folder}: there is no such folder; give the one that holds the measured files")
    paths = sorted(
        (
            p
            for p in folder.rglob("*")
            if p.is_file() and is_readable(p) and not any(part.startswith(".") for part in p.relative_to(folder).parts)
        ),
        key=lambda p: _natural(p.relative_to(folder).as_posix()),
    )
    if len(paths) > _MOST_FILES:
        raise DataFormatError(
            f"{folder}: {len(paths)} files are more than {_MOST_FILES}; take a folder of one campaign"
        )
    files, refused = [], []
    for path in paths:
        try:
            files.append(_found(path, path.relative_to(folder).as_posix(), options, force))
        except DataFormatError as error:
            refused.append(str(error))
    return Survey(folder, tuple(files), tuple(refused))


def guess_force(columns: Sequence[FoundColumn]) -> str | None:
    """Name of the column that is likely the force; None where several are, or none is."""
    by_kind = [c for c in columns if c.quantity == "force"]
    if len(by_kind) == 1:
        return by_kind[0].name
    among = by_kind or [c for c in columns if c.quantity is None]
    named = [c for c in among if FORCE_NAME.search(c.name)]
    if len(named) == 1:
        return named[0].name
    exact = [c for c in columns if c.name.casefold() == FORCE]
    return exact[0].name if exact else None


def guess_channels(
    columns: Sequence[FoundColumn],
    channels: Mapping[str, str],
    force: str | None,
    driven: tuple[int, int] | None = None,
) -> dict[str, tuple[str, bool]]:
    """
    For each channel (name: quantity) the column that it likely is, and whether its name says so.

    A column's name is scored for the channel's own name, its place and its axis; nodes count from the driving point. What no name
    tells is taken in the order of the columns, and is not sure.
    """
    free = [c for c in columns if c.name != force and c.quantity != "force"]
    nodes = list(dict.fromkeys([driven[0]] if driven else []) | dict.fromkeys(c.dof[0] for c in free if c.dof))
    found: dict[str, tuple[str, bool]] = {}
    scores = [
        (_score(column, channel, quantity, nodes), -i, -j, channel, column)
        for j, (channel, quantity) in enumerate(channels.items())
        for i, column in enumerate(free)
    ]
    taken: set[str] = set()
    for score, _, _, channel, column in sorted(scores, key=lambda s: s[:3], reverse=True):
        if score >= 2 and channel not in found and column.name not in taken:
            found[channel] = (column.name, score >= 3)
            taken.add(column.name)
    # in order, but never against what a name says of its axis
    for channel, quantity in channels.items():
        if channel in found:
            continue
        for column in free:
            axis = _axis_of(column)
            wanted = channel[-1] if channel[-2:] in ("_x", "_y", "_z") else None
            if column.name in taken or column.quantity not in (None, quantity):
                continue
            if axis is not None and wanted is not None and axis != wanted:
                continue
            found[channel] = (column.name, False)
            taken.add(column.name)
            break
    return {channel: found[channel] for channel in channels if channel in found}


def guess_position(name: str) -> float | None:
    """Position y_b / L from a file's name: ``pos0.25``, ``y=0,33``, ``25%``."""
    for match in _POSITION.finditer(name):
        text = match[1] or match[2]
        value = float(text.replace(",", ".").replace("p", ".")) if match[1] else float(text) / 100
        if 0 < value < 1:
            return value
    return None


def guess_level(name: str) -> float | None:
    """Peak force in newtons from a file's name: ``50N``, ``150 N``. FRFs do not hold it, and laws of the joints ask for it."""
    match = _LEVEL.search(name)
    value = float((match[1] or match[2]).replace(",", ".")) if match else 0.0
    return value if value > 0 else None


def grouped(files: Sequence[FoundFile]) -> list[list[FoundFile]]:
    """Files of one blow each put together, where names differ by a number at the end alone."""
    groups: dict[tuple[object, ...], list[FoundFile]] = {}
    for k, file in enumerate(files):
        path = Path(file.name)
        key: tuple[object, ...] = (k,)
        stem = _BLOW_NUMBER.sub("", path.stem)
        numbered = file.kind == "impact" and file.blows == 1 and stem != path.stem
        # the number at the end may be the position itself
        if numbered and (guess_position(path.stem) is None or guess_position(stem) is not None):
            key = (path.parent, stem, path.suffix.lower(), tuple(c.name for c in file.columns))
        groups.setdefault(key, []).append(file)
    return list(groups.values())


def _natural(text: str) -> list[tuple[int, int, str]]:
    """Sorting key under which blow_10 follows blow_9."""
    return [(1, int(part), "") if part.isdigit() else (0, 0, part.casefold()) for part in re.split(r"(\d+)", text)]


def _found(path: Path, name: str, options: TextOptions | None, force: str | None) -> FoundFile:
    prefer_frf = path.suffix.lower() in (".uff", ".unv")
    first: DataFormatError | None = None
    for frf in (prefer_frf, not prefer_frf):
        try:
            contents = read_raw(path, frf, options)
            if frf and contents.frf is not None and contents.frf.responses:
                return _of_frf(contents, name)
            if not frf and contents.histories:
                return _of_histories(contents, name, force)
        except DataFormatError as error:
            first = first or error
    raise first or DataFormatError(f"{path}: holds neither time records nor frequency responses")


def _of_frf(contents: Contents, name: str) -> FoundFile:
    frf = contents.frf
    assert frf is not None
    columns: dict[str, FoundColumn] = {}
    for r in frf.responses:
        size = float(np.max(np.abs(r.values), initial=0.0))
        columns.setdefault(r.name, FoundColumn(r.name, r.unit, r.quantity or _quantity(_numerator(r)), size, r.dof))
    references = list(dict.fromkeys(_dof_text(r) for r in frf.responses if r.ref is not None))
    return FoundFile(
        name, "frf", tuple(columns.values()), 1, frf.freq.size, None, (), tuple(references), contents.warnings
    )


def _of_histories(contents: Contents, name: str, force: str | None) -> FoundFile:
    histories = _joined(contents.histories)
    first = histories[0]
    columns = tuple(_column(signal) for signal in first.signals)
    hammer = force if force is not None and any(c.name == force for c in columns) else guess_force(columns)
    peaks, impacts, hits = [], [], []
    for history in histories:
        values = next((s.values for s in history.signals if _full(s) == hammer), None)
        if values is not None and values.size and np.all(np.isfinite(values)):
            centred = np.abs(values - np.median(values))
            peak = float(np.max(centred))
            peaks.append(peak * _factor(columns, hammer))
            impacts.append(peak > 0 and float(np.mean(centred < _QUIET * peak)) > _MOSTLY)
            hits.append(_hits(centred, peak))
    several = len(histories) == 1 and max(hits, default=1) > 2
    kind: Kind = (
        "impact"
        if not several and ((impacts and all(impacts)) or (not impacts and len(histories) > 1))
        else "timeseries"
    )
    samples = min((s.values.size for s in first.signals), default=0)
    notes = contents.warnings
    if several and all(impacts):
        notes = (*notes, f"{hits[0]} hits in one recording: cut it into one blow each, for kind = 'impact'")
    return FoundFile(name, kind, columns, len(histories), samples, first.fs, tuple(peaks), (), notes)


def _hits(size: FloatArray, peak: float) -> int:
    """Number of hits well apart: stretches above a third of the peak, with at least a fiftieth of the record between them."""
    loud = np.flatnonzero(size > peak / 3)
    return 1 + int(np.count_nonzero(np.diff(loud) > size.size / 50)) if loud.size else 0


def _joined(histories: Sequence[RawHistory]) -> Sequence[RawHistory]:
    """Groups of unlike channels are parts of one record, their channels named group/name; alike ones are blows."""
    names = [{s.name for s in h.signals} for h in histories]
    if len(histories) < 2 or any(a & b for a, b in itertools.pairwise(names)):
        return histories
    signals = tuple(
        Signal(s.name, s.unit, s.values, group=h.name, dof=s.dof, quantity=s.quantity, fs=s.fs or h.fs)
        for h in histories
        for s in h.signals
    )
    fs = max(s.fs or 0.0 for s in signals)
    return [RawHistory("", fs, tuple(s for s in signals if abs((s.fs or fs) / fs - 1) < 1e-9))]


def _full(signal: Signal) -> str:
    return f"{signal.group}/{signal.name}" if signal.group else signal.name


def _column(signal: Signal) -> FoundColumn:
    largest = float(np.max(np.abs(_finite(signal.values)), initial=0.0))
    return FoundColumn(_full(signal), signal.unit, signal.quantity or _quantity(signal.unit), largest, signal.dof)


def _finite(values: FloatArray) -> FloatArray:
    return values[np.isfinite(values)]


def _numerator(response: RawResponse) -> str | None:
    if response.unit is None:
        return None
    top, slash, _ = response.unit.rpartition("/")
    return (top if slash and looks_like_unit(response.unit) else response.unit).strip("()")


def _quantity(unit: str | None) -> str | None:
    """Quantity of a unit that is read; None of one that is not (V, or none at all)."""
    if unit is None:
        return None
    for quantity in SI_UNIT:
        try:
            to_si(unit, quantity, "")
        except DataFormatError:
            continue
        return quantity
    return None


def _factor(columns: Sequence[FoundColumn], name: str | None) -> float:
    unit = next((c.unit for c in columns if c.name == name), None)
    quantity = _quantity(unit)
    return 1.0 if unit is None or quantity is None else to_si(unit, quantity, "")


def _dof_text(response: RawResponse) -> str:
    from cutvib_ss.measurement.formats.uff import dof_name

    return dof_name(response.ref) if response.ref is not None else ""


def _axis_of(column: FoundColumn) -> str | None:
    if column.dof is not None:
        return {1: "x", 2: "y", 3: "z"}.get(abs(column.dof[1]))
    match = _AXIS.search(column.name)
    return None if match is None else (match[1] or match[2]).lower()


def _score(column: FoundColumn, channel: str, quantity: str, nodes: Sequence[int]) -> int:
    """How far a column's name speaks for a channel: 4 its own name, place 2, axis 1; negative against it."""
    if column.quantity not in (None, quantity):
        return -9
    plain = re.sub(r"[^a-z0-9]", "", column.name.casefold())
    if plain == re.sub(r"[^a-z0-9]", "", channel.casefold()):
        return 9
    place, wanted = (channel[:-2], channel[-1]) if channel[-2:] in ("_x", "_y", "_z") else (channel, None)
    axis, score = _axis_of(column), 0
    if axis is not None and wanted is not None:
        score += 1 if axis == wanted else -9
    if column.dof is not None:
        order = ["tool", "base"]
        at = nodes.index(column.dof[0]) if column.dof[0] in nodes else -1
        score += 2 if 0 <= at < len(order) and order[at] == place else -2
        return score
    words = {name for name, pattern in _PLACES.items() if pattern.search(column.name)}
    if place in words:
        score += 2
    elif words and place in _PLACES:
        score -= 4
    elif place not in _PLACES and place.casefold() in column.name.casefold():
        score += 2
    elif not words and place == "tool" and axis is not None and axis == wanted:
        score += 1  # an axis alone: the tool is what one measures first
    return score
