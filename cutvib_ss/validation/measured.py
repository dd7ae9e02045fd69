"""Measured campaigns with a documented cause in one table; and an element of known size added to a measured record."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.result import Diagnosis
from cutvib_ss.errors import CutvibError, DataFormatError, ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.measurement.records import Campaign, History, Record
from cutvib_ss.results import ComplexArray, FloatArray, MeasuredFrequencyResponse
from cutvib_ss.results.display import finite
from cutvib_ss.units import DERIVATIVE_ORDER
from cutvib_ss.validation.files import read_json

SCHEMA = "cutvib-blind-real/1"
LABEL = "label.toml"

Element: TypeAlias = Callable[[Any], Any]


@dataclass(frozen=True)
class DocumentedCause:
    """The effects and places that count as the documented cause of a campaign."""

    effects: tuple[str, ...]
    places: tuple[str, ...]

    def names(self, effect: str, place: str) -> bool:
        """Whether an entry of a diagnosis is the documented cause."""
        return effect in self.effects and place in self.places


@dataclass(frozen=True)
class MeasuredRow:
    """One campaign of the table; a figure that does not exist is None, and ``error`` says why there is no diagnosis."""

    campaign: str
    effects: tuple[str, ...] | None = None
    places: tuple[str, ...] | None = None
    verdict: str | None = None
    probability: float | None = None
    rank: int | None = None
    named: str | None = None
    place_right: bool | None = None
    share: float | None = None
    repeatability: float | None = None
    limits: tuple[dict[str, Any], ...] = ()
    halves: tuple[str | None, str | None] | None = None
    halves_agree: bool | None = None
    error: str | None = None
    # Probability stated for what is named first, all entries of that name together
    confidence: float | None = None

    @property
    def sure_and_wrong(self) -> bool:
        """Whether something else than the documented cause is named with at least 0.9."""
        return self.effects is not None and (self.confidence or 0.0) >= 0.9 and self.rank != 1


def diagnose_measured(
    folder: str | os.PathLike[str],
    *,
    halves: bool = False,
    jobs: int = 1,
    progress: Callable[[str], None] | None = None,
) -> tuple[MeasuredRow, ...]:
    """Diagnose every campaign below a folder and hold each against its label; one row each, in the order of their paths."""
    root = Path(folder)
    if not root.is_dir():
        raise ParameterError(f"{root}: is not a folder; give one that holds campaigns")
    found = sorted(file.parent for file in root.rglob("campaign.toml"))
    if not found:
        raise DataFormatError(f"{root}: no campaign.toml in it or below it")
    rows = []
    for place in found:
        name = place.relative_to(root).as_posix()
        if progress is not None:
            progress(name)
        rows.append(_row(place, root.resolve().name if name == "." else name, halves, jobs))
    return tuple(rows)


def table_data(rows: Sequence[MeasuredRow]) -> dict[str, Any]:
    """The table as plain data of the schema ``cutvib-blind-real/1``."""
    return {"schema": SCHEMA, "campaigns": [asdict(row) for row in rows]}


def read_table(file: Path) -> tuple[MeasuredRow, ...]:
    """A table that was written as JSON."""
    data = read_json(file)
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise DataFormatError(
            f"{file}: is no table of measured rigs; write one with: cutvib blind real DIR --json {file}"
        )
    known = {f.name for f in fields(MeasuredRow)}
    rows = []
    for row in data["campaigns"]:
        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in row.items() if k in known}
        rows.append(MeasuredRow(**values))
    return tuple(rows)


def read_label(folder: Path) -> DocumentedCause | None:
    """The documented cause beside a campaign.toml; None where there is no label."""
    file = folder / LABEL
    if not file.is_file():
        return None
    try:
        given = tomllib.loads(file.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as fault:
        raise DataFormatError(f"{file}: is not TOML: {fault}") from None
    return DocumentedCause(_names(given, "effect", file), _names(given, "place", file))


def halved(campaign: Campaign) -> tuple[Campaign, Campaign]:
    """A campaign in two: alternate records of each level and use."""
    levels: dict[tuple[float | None, str | None], list[Record]] = {}
    for record in campaign.records:
        levels.setdefault((record.peak_force, record.use), []).append(record)
    sides: tuple[list[Record], list[Record]] = ([], [])
    for k, record in enumerate(r for same in levels.values() for r in same):
        sides[k % 2].append(record)
    if not sides[1]:
        raise ParameterError(f"{campaign.title}: has {len(campaign.records)} records; halves need at least two")
    one, two = (replace(campaign, records=tuple(side)) for side in sides)
    return one, two


def add_element(record: Record, z: Element, *, channel: str | None = None) -> Record:
    """
    A record as it would be with an element at the drive point: the same motion x, and the force that it then takes.

    z is the element's dynamic stiffness [N/m] over s = jω: ``lambda s: 0.2 * s**2`` is a mass of 0.2 kg. ``channel`` reads the
    motion of the drive point along the force; it may be left out where there is only one.

    With D the rest of the structure, linear or not, f = D(x). The element adds z * x, so that the same x now takes
    f + z * x: no model enters. Frequency responses are divided by 1 + z H with the drive-point receptance H, their variances
    carried along to first order (errors of channels independent). Of histories the product is formed in the frequency domain:
    periodic ones are exact, and so is any where z over the power of s of the channel is constant (a mass under an
    accelerometer). Otherwise a history must be at rest at both ends. Where z over that power is infinite at zero frequency (a
    spring under an accelerometer) the mean is left out, which an accelerometer does not see. An FRF that was cut off by its
    block is that of the block, and 1 + z H is then as truncated as H.
    """
    if record.input_quantity != "force":
        raise ParameterError(
            f"record {record.name!r}: its input is the base's {record.input_quantity}; an element needs a force"
        )
    drive = _drive(record, channel)
    power = DERIVATIVE_ORDER[record.quantities[drive]]
    if record.frf is not None:
        return _added_to_frf(record, record.frf, z, drive, power)
    histories = tuple(
        _added_to_history(h, z, h.channels.index(record.channels[drive]), power) for h in record.histories
    )
    before, after = (max(float(np.abs(h.force).max()) for h in of) for of in (record.histories, histories))
    level = None if record.peak_force is None else record.peak_force * after / before
    return replace(record, histories=histories, peak_force=level)


def _row(folder: Path, name: str, halves: bool, jobs: int) -> MeasuredRow:
    """One campaign, whatever is wrong with it."""
    row = MeasuredRow(name)
    try:
        label = read_label(folder)
        if label is not None:
            row = replace(row, effects=label.effects, places=label.places)
        campaign = read_campaign(folder)
        row = _told(row, diagnose(campaign, jobs=jobs), label)
    except (CutvibError, OSError) as fault:
        return replace(row, error=str(fault))
    return _with_halves(row, campaign, jobs) if halves else row


def _told(row: MeasuredRow, found: Diagnosis, label: DocumentedCause | None) -> MeasuredRow:
    """A row with what a diagnosis says, held against the label."""
    first = found.causes[0]
    row = replace(
        row,
        verdict=found.verdict,
        named=f"{first.effect} at {first.place}",
        share=finite(first.share),
        repeatability=finite(found.repeatability),
        confidence=float(
            sum(c.probability for c in found.causes if (c.effect, c.place) == (first.effect, first.place))
        ),
    )
    if label is None:
        return row
    those = [(k, c) for k, c in enumerate(found.causes, start=1) if label.names(c.effect, c.place)]
    return replace(
        row,
        probability=sum(c.probability for _, c in those),
        rank=those[0][0] if those else None,
        place_right=bool({found.where.place, *found.where.place_set} & set(label.places)),
        share=finite(those[0][1].share) if those else None,
        limits=tuple(dict(vars(x)) for x in found.limits if label.names(x.effect, x.place)),
    )


def _with_halves(row: MeasuredRow, campaign: Campaign, jobs: int) -> MeasuredRow:
    """A row with the verdicts of both halves; a half without a diagnosis has none, and they do not agree."""
    try:
        sides = halved(campaign)
    except ParameterError:
        return row
    verdicts: list[str | None] = []
    for side in sides:
        try:
            verdicts.append(diagnose(side, jobs=jobs).verdict)
        except CutvibError:
            verdicts.append(None)
    one, two = verdicts
    return replace(row, halves=(one, two), halves_agree=one is not None and one == two)


def _names(given: dict[str, Any], key: str, file: Path) -> tuple[str, ...]:
    value = given.get(key)
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(n, str) and n for n in names):
        raise DataFormatError(
            f'{file}: {key} = {value!r}; give a name or a list of names, for instance {key} = ["one", "two"]'
        )
    return tuple(names)


def _drive(record: Record, channel: str | None) -> int:
    """Index of the drive point's channel."""
    if channel is None and len(record.channels) == 1:
        return 0
    if channel not in record.channels:
        raise ParameterError(
            f"record {record.name!r}: channel = {channel!r}; name the one that reads the drive point, of "
            f"{', '.join(record.channels)}"
        )
    return record.channels.index(channel)


def _stiffness(z: Element, freq: FloatArray, power: int) -> ComplexArray:
    """z over the power of s that the channel's quantity has; zero at zero frequency where it is infinite."""
    s = np.asarray(2j * np.pi * freq, dtype=np.complex128)
    with np.errstate(divide="ignore", invalid="ignore"):
        out = np.asarray(np.broadcast_to(z(s), s.shape) / s**power, dtype=np.complex128).copy()
    out[(freq == 0.0) & ~np.isfinite(out)] = 0.0
    if not np.isfinite(out).all():
        worst = float(freq[~np.isfinite(out)][0])
        raise ParameterError(f"z is not finite at {worst:g} Hz; give a dynamic stiffness that is, over the whole band")
    return out


def _added_to_frf(record: Record, frf: MeasuredFrequencyResponse, z: Element, drive: int, power: int) -> Record:
    per_motion = _stiffness(z, frf.freq, power)
    own = frf.data[:, drive : drive + 1]
    more = 1.0 + per_motion * own
    data = frf.data / more
    # d(H_i/(1+zH)) = dH_i/(1+zH) - z H_i dH/(1+zH)^2, and for the drive point itself dH/(1+zH)^2.
    variance = frf.variance / np.abs(more) ** 2
    variance = variance + np.abs(per_motion * data / more) ** 2 * frf.variance[:, drive : drive + 1]
    variance[:, drive] = frf.variance[:, drive] / np.abs(more[:, 0]) ** 4
    changed = replace(frf, data=data, variance=variance)
    if record.excitation != "sine":
        return replace(record, frf=changed)
    # The motion of a sine test is kept line by line, so that its force amplitude is not the same at all lines any more.
    amplitude = record.force_amplitude
    if amplitude is None and record.peak_force is not None and record.controlled != "response":
        amplitude = np.full(frf.freq.size, record.peak_force)
    amplitude = None if amplitude is None else amplitude * np.abs(more[0, 0, 0])
    return replace(record, frf=changed, force_amplitude=amplitude)


def _added_to_history(history: History, z: Element, drive: int, power: int) -> History:
    freq = np.asarray(np.fft.rfftfreq(history.force.size, 1.0 / history.fs), dtype=np.float64)
    per_motion = _stiffness(z, freq, power)
    if history.force.size % 2 == 0:
        # The line at half the sampling frequency is real: a phase has no meaning there.
        per_motion[-1] = per_motion[-1].real
    force = np.fft.irfft(per_motion * np.fft.rfft(history.responses[drive]), n=history.force.size)
    return replace(history, force=history.force + force)


def cells(row: MeasuredRow) -> Iterator[str]:
    """A row as the cells of a printed table."""
    yield row.campaign
    yield "no label" if row.effects is None else f"{' | '.join(row.effects)} at {' | '.join(row.places or ())}"
    yield row.verdict or "failed"
    yield row.named or ""
    yield "" if row.probability is None else f"{row.probability:.3f}"
    yield "" if row.rank is None else str(row.rank)
    yield "" if row.place_right is None else "yes" if row.place_right else "no"
    yield "" if row.share is None else f"{row.share:.2f}"
    yield "" if row.repeatability is None else f"{row.repeatability:.2g}"
    yield "" if row.halves is None else f"{row.halves[0] or 'failed'} / {row.halves[1] or 'failed'}"
