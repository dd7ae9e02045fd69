"""What a campaign holds, in figures: records, levels, noise, coherence, repeatability, linearity between levels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from cutvib_ss.measurement.blow_noise import Ordering, blow_scatter, chance_of_ordering
from cutvib_ss.measurement.estimation import measured_response
from cutvib_ss.measurement.interference import interference
from cutvib_ss.measurement.levels import levels_of, mean_level, own_level, peaks, same_level, sessions_of_one_level
from cutvib_ss.measurement.plausibility import levels_over_nominal
from cutvib_ss.measurement.record_pairs import PairSummary, compare
from cutvib_ss.measurement.records import Campaign, Record, Sweep
from cutvib_ss.measurement.sweep_direction import opposed, sweep_direction
from cutvib_ss.measurement.trigger_jitter import trigger_jitter
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse
from cutvib_ss.units import percent

_ORDERED = 0.01
"""Significance below which the scatter of blows is said to order with the force."""

_BY_CHANCE = 0.05
"""Probability of differences between levels as large as these where none depends on the level, from which they are said to."""

_STANDS_OUT = 2.0
"""Of the mean square difference over noise and repeatability, from which levels are said to differ."""


@dataclass(frozen=True)
class ChannelSummary:
    """One channel of a record: root mean squares of |H| and of its noise in the band, and how its blows scatter."""

    name: str
    unit: str
    rms: float
    noise: float
    coherence: float | None
    level: float | None
    blow_ratio: float | None
    ordered: float | None

    def scatter_text(self) -> str:
        """How single blows scatter, for a table."""
        if self.blow_ratio is None:
            return ""
        text = f"{np.sqrt(self.blow_ratio):.2g} x sensors"
        return text + (", orders with force" if self.ordered is not None and self.ordered < _ORDERED else "")


@dataclass(frozen=True)
class RecordSummary:
    """One record: what it is, its blows and levels, and its channels."""

    name: str
    kind: str
    position: float | None
    input: str | None
    use: str | None
    session: str | None
    blows: int
    peaks: tuple[float, ...]
    peak_force: float | None
    band_hz: tuple[float, float]
    line_spacing: float
    coherence: float | None
    channels: tuple[ChannelSummary, ...]
    ordering: Ordering | None = None  # How much its blows order with their force, all channels together
    sweep: Sweep | None = None  # As stated, or as the force of a recording goes
    files: int = 1

    @property
    def level(self) -> float | None:
        """Excitation level: the median peak of the blows, else as stated."""
        return float(np.median(self.peaks)) if self.peaks else self.peak_force

    def name_text(self) -> str:
        """Its file, and how many others it has, for a table."""
        return self.name if self.files == 1 else f"{self.name} +{self.files - 1}"

    def kind_text(self) -> str:
        """Its kind and the direction of its sweep, for a table."""
        return self.kind if self.sweep is None else f"{self.kind}, {self.sweep}"

    def level_text(self) -> str:
        """Levels of the blows, for a table."""
        if not self.peaks:
            return "not stated" if self.peak_force is None else f"{self.peak_force:.3g}"
        low, high = f"{min(self.peaks):.3g}", f"{max(self.peaks):.3g}"
        return low if low == high else f"{low} to {high}"

    def lines_text(self) -> str:
        """Band and spacing of the lines, for a table."""
        return f"{self.band_hz[0]:.3g} to {self.band_hz[1]:.4g} by {self.line_spacing:.3g}"


@dataclass(frozen=True)
class Summary:
    """All of it; ``frfs`` are the responses that the figures were taken from, one a record."""

    title: str
    input_unit: str
    records: tuple[RecordSummary, ...]
    repeated: tuple[PairSummary, ...]
    levels: tuple[PairSummary, ...]
    warnings: tuple[str, ...]
    frfs: tuple[MeasuredFrequencyResponse, ...]
    expected: tuple[str, ...] = ()  # Response channels of the model

    @property
    def repeatability(self) -> float | None:
        """Root mean square of the differences of records of the same thing; None where none repeat."""
        if not self.repeated:
            return None
        return float(np.sqrt(np.mean([pair.difference**2 for pair in self.repeated])))

    def sentences(self) -> list[str]:
        """What is to be said of it in words."""
        said = []
        if self.repeatability is not None:
            by, mean = "no more than", _pairs(len(self.repeated))
            if self.repeatability > 0.0:
                by, mean = f"{percent(self.repeatability)} beyond", f"root mean square of {mean}"
            said.append(f"Records of the same configuration differ by {by} their noise ({mean}).")
        elif len(self.records) > 1:
            same = [part for part, told in self._told() if told]
            alike = f"{', '.join(same)} and level" if same else "level"
            said.append(f"No two records are of the same {alike}: repeatability is not known.")
        if self._confounded():
            said.append(
                "Every session has a level of its own: what drifts between sessions and what depends on the level look alike; "
                "measure two levels in one session."
            )
        if self.levels:
            said.append(self._of_levels())
        said += self._of_missing_channels()
        chance = chance_of_ordering(r.ordering for r in self.records if r.ordering is not None)
        if chance < _ORDERED:
            said.append(
                f"The scatter from blow to blow orders with the peak force (by chance with a probability of {chance:.1g}): "
                "a sign of nonlinearity, or of a hand that hits elsewhere when it hits harder."
            )
        return said

    def _told(self) -> list[tuple[str, bool]]:
        """What tells records apart beside their level, and whether these records state it."""
        return [
            ("position", any(r.position is not None for r in self.records)),
            ("input", any(r.input for r in self.records)),
            ("direction of sweep", any(r.sweep is not None for r in self.records)),
        ]

    def _confounded(self) -> bool:
        """Whether every session has one level, and they differ."""
        return sessions_of_one_level((r.session, r.level) for r in self.records)

    def _of_missing_channels(self) -> list[str]:
        """Channels of the model that some record lacks."""
        said = []
        for channel in self.expected:
            without = [r.name for r in self.records if channel not in [c.name for c in r.channels]]
            some = f"{without[0]} and {len(without) - 1} more" if len(without) > 1 else "".join(without)
            where = "No record has" if len(without) == len(self.records) else f"Not every record has ({some} not)"
            if without:
                said.append(f"{where} the model's channel {channel}: if it was measured, map it under [channels].")
        return said

    def _of_levels(self) -> str:
        """What pairs of levels say of whether the response depends on the level."""
        clear, most = self._levels_apart(), max(self.levels, key=lambda p: p.difference)
        size = f"by {percent(most.difference)} at most"
        if not clear and most.difference > 2.0 * (self.repeatability or np.inf):
            return (
                f"Levels differ {size} ({most.first}, {most.second}), by more than twice what records of one level do; so few of "
                f"these ({_pairs(len(self.repeated))}) do not tell that from chance: measure more levels twice."
            )
        if not clear:
            said = "No dependence on the level stands out of noise and repeatability"
            return f"{said}: {percent(most.difference)} at most." if most.difference > 0 else f"{said}."
        turned = " or directions" if any(opposed(*p.sweeps) for p in self.levels) else ""
        count = f"in {len(clear)} of {_pairs(len(self.levels))} of levels{turned}"
        if self.repeatability is None:
            return (
                f"Responses differ {count} by more than noise, {size} ({most.first}, {most.second}): they depend on the level, or "
                "do not repeat; measure one level twice."
            )
        return (
            f"The response depends on the level: {count} it differs by more than noise and repeatability, "
            f"{size} ({most.first}, {most.second})."
        )

    def _levels_apart(self) -> list[PairSummary]:
        """Pairs of levels that differ by more than noise, and than records of one level by chance: all together, or some alone."""
        beyond = [p for p in self.levels if p.over_noise > _STANDS_OUT and p.difference > 0.0]
        if not self.repeatability or not beyond:
            return beyond
        # What moves between two records is taken as one number that moves the response, at worst.
        ratios = np.array([p.difference for p in self.levels]) ** 2 / self.repeatability**2
        each, repeats = len(ratios), len(self.repeated)
        together = stats.f.sf(ratios.mean(), each, repeats) < _BY_CHANCE
        least = 2.0 if together else float(np.sqrt(stats.f.isf(_BY_CHANCE / each, 1, repeats)))
        return [p for p in beyond if p.difference > least * self.repeatability]

    def to_dict(self) -> dict[str, Any]:
        """The figures as JSON takes them."""
        return {
            "schema": "cutvib-campaign-show/1",
            "title": self.title,
            "input_unit": self.input_unit,
            "records": [_with_units(asdict(r)) | {"level": r.level} for r in self.records],
            "repeatability": self.repeatability,
            "repeated": [asdict(p) for p in self.repeated],
            "levels": [asdict(p) for p in self.levels],
            "sentences": self.sentences(),
            "warnings": list(self.warnings),
        }


def _pairs(count: int) -> str:
    return f"{count} pair" if count == 1 else f"{count} pairs"


def _with_units(record: dict[str, Any]) -> dict[str, Any]:
    """A record's figures under keys that say their unit; peaks and levels are in ``input_unit``."""
    names = {"line_spacing": "line_spacing_hz"}
    return {names.get(name, name): value for name, value in record.items() if name != "ordering"}


def summarise(campaign: Campaign) -> Summary:
    """Figures of every record of a campaign, and of the pairs that can be compared."""
    frfs = tuple(measured_response(r) for r in campaign.records)
    records = tuple(_record(r, h, campaign.machine) for r, h in zip(campaign.records, frfs, strict=True))
    # Once a sweep has passed, a resonance rings on as a tone does.
    measured = zip(campaign.records, records, frfs, strict=True)
    steady = [(r, h) for r, own, h in measured if r.excitation != "sine" and own.sweep is None]
    tones = interference(*([h for r, h in steady if (r.kind == "timeseries") is leaks] for leaks in (False, True)))
    jitter = trigger_jitter(campaign.records)
    # What tones do to a line is no difference of two records.
    kept = frfs if tones is None else tuple(h.at_lines(~tones.spoils(h.freq)) for h in frfs)
    repeated: list[PairSummary] = []
    levels: list[PairSummary] = []
    stated = levels_of(campaign.records)
    level = {r.name: (own, mean_level(r)) for r, own in zip(campaign.records, stated, strict=True)}
    for (a, ha), (b, hb) in combinations(zip(records, kept, strict=True), 2):
        if (a.position, a.input, a.kind) != (b.position, b.input, b.kind):
            continue
        pair = compare(a, ha, b, hb)
        if pair is not None:
            same = all(same_level(x, y) for x, y in zip(level[a.name], level[b.name], strict=True))
            # A linear machine answers alike in both directions.
            (repeated if same and not opposed(a.sweep, b.sweep) else levels).append(pair)
    unit = campaign.records[0].input_unit if campaign.records else "N"
    warnings = (*campaign.warnings, *(found.words for found in (tones, jitter) if found is not None))
    expected = tuple(campaign.machine.channels)
    return Summary(campaign.title, unit, records, tuple(repeated), tuple(levels), warnings, frfs, expected)


def _record(record: Record, frf: MeasuredFrequencyResponse, machine: Any) -> RecordSummary:
    band = record.band_hz or _clear_band(frf)
    keep = (frf.freq >= band[0]) & (frf.freq <= band[1])
    levels = levels_over_nominal(record, machine, frf)
    ratios: list[float | None] = [None] * len(record.channels)
    ordered: list[float | None] = [None] * len(record.channels)
    ordering: Ordering | None = None
    if record.kind == "impact" and len(record.histories) > 2:
        scatter = blow_scatter(record, band=band)
        ratios = [_known(x) if np.all(np.isfinite(scatter.noise[k])) else None for k, x in enumerate(scatter.ratio)]
        ordered, ordering = [_known(x) for x in scatter.significance], scatter.ordering
    sweep = sweep_direction(record)
    # Of a sweep each block holds the force at few lines, and its coherence says nothing.
    untold = record.kind == "timeseries" and sweep is not None
    channels = []
    for k, (name, unit) in enumerate(zip(frf.outputs, frf.units, strict=True)):
        h, v, c = frf.data[0, k, 0, keep], frf.variance[0, k, 0, keep], frf.coherence[0, k, 0, keep]
        # Of what the channel measured: where it hardly moves, coherence is that of its noise.
        told, power = np.isfinite(c) & (not untold), np.abs(h) ** 2
        channels.append(
            ChannelSummary(
                name,
                unit,
                float(np.sqrt(np.mean(np.abs(h) ** 2))),
                float(np.sqrt(np.mean(v))),
                float(np.average(c[told], weights=power[told])) if power[told].any() else None,
                levels[name][0] if name in levels else None,
                ratios[k],
                ordered[k],
            )
        )
    told = [c.coherence for c in channels if c.coherence is not None]
    return RecordSummary(
        record.name,
        record.kind,
        record.position,
        record.input,
        record.use,
        record.session,
        len(record.histories) or record.averages,
        tuple(peaks(record)),
        own_level(record),
        (float(band[0]), float(band[1])),
        float(np.median(np.diff(frf.freq))),
        min(told) if told else None,
        tuple(channels),
        ordering,
        sweep,
        max(len(record.files), 1),
    )


def _clear_band(frf: MeasuredFrequencyResponse) -> tuple[float, float]:
    """Hull of the lines on which some channel stands out of its noise by a factor of three, its thin ends cut off."""
    clear = np.any(np.abs(frf.data[0, :, 0]) ** 2 > 9 * frf.variance[0, :, 0], axis=0) & (frf.freq > 0)
    freq: Sequence[float] | FloatArray = frf.freq[clear]
    if len(freq) < 8:
        freq = frf.freq[frf.freq > 0]
    low, high = np.percentile(freq, [1, 97])
    return float(low), float(high)


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
