"""
A campaign as the diagnosis sees it: frequency responses with their noise, a band, and what the estimator did to them.

Nothing else of the campaign is looked at: no file name, title or order.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from cutvib_ss.diagnosis.blows import of_blows
from cutvib_ss.diagnosis.modes_beyond import resonance_beyond
from cutvib_ss.diagnosis.records import Entry, thinned
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.sine_test import SineTest
from cutvib_ss.effects.base import Model
from cutvib_ss.errors import DiagnosisError
from cutvib_ss.measurement.blocks import without_run_in
from cutvib_ss.measurement.cut_responses import with_one_instant
from cutvib_ss.measurement.estimation import measured_response, rounded_part, rounding_variance
from cutvib_ss.measurement.interference import Interference, interference
from cutvib_ss.measurement.levels import levels_of
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.measurement.replay import assumed_blow, replay_of
from cutvib_ss.measurement.steadiness import WORDS as CHANGES
from cutvib_ss.measurement.steadiness import change_within
from cutvib_ss.measurement.trigger_jitter import TriggerJitter, aligned, trigger_jitter
from cutvib_ss.response.modes import modes
from cutvib_ss.results import ComplexArray, FloatArray, MeasuredFrequencyResponse
from cutvib_ss.units import STANDARD_GRAVITY

LACKING = {
    "impact": "state peak_force, or give the histories of the blows",
    "sine": "state peak_force, or give a column `force amplitude`",
    "held": "state peak_response, or give a column `force amplitude`",
}
"""What tells the force of a record."""
SPOILT = "left out for the steps of the converter"
"""What the warning on lines that a converter has spoilt says."""
ADVICE = {
    "impact": "measure longer, with a harder tip, or with more blows",
    "timeseries": "state a longer `block` (lines are 1/block apart), a wider `band_hz`, or record longer, with more excitation",
    "random": "record longer, or with a stronger excitation",
    "multisine": "excite more lines, or repeat more periods",
    "sine": "sweep more lines around the resonance, with a longer dwell",
}


@dataclass(frozen=True)
class Observations:
    """All records of a campaign, in one band."""

    entries: tuple[Entry, ...]  # One a record
    band: tuple[float, float]  # Hull of the records' bands [Hz]
    channels: tuple[str, ...]  # All response channels
    unit: str  # Unit in which errors are reported
    per_unit: float  # SI value of that unit
    warnings: tuple[str, ...] = ()  # What the records lack for some causes, and which were left out
    beyond: float | None = None  # Lowest resonance well above the model's highest mode [Hz]
    # What tones on lines that are left out, and trigger jitter, add to the mean square of a right model's residual, over the noise
    disturbed: float = 0.0
    jitter: TriggerJitter | None = None  # Of triggers, for which blows are aligned
    # Of records within which the machine changes, by their index: mean square of how far, shape (channel, line)
    changes: Mapping[int, FloatArray] = field(default_factory=dict)

    def without(self, records: Collection[int], warnings: tuple[str, ...]) -> Observations:
        """The same without some records, by their index in the campaign."""
        kept = tuple(e for e in self.entries if e.record not in records)
        return replace(self, entries=kept, warnings=(*self.warnings, *warnings))


def observe(campaign: Campaign, machine: Model, highest: float = np.inf) -> Observations:
    """
    Frequency responses of a campaign, each record cut to its band.

    A record's band is what it states, else what its noise allows up to a highest frequency [Hz].
    """
    if (jitter := trigger_jitter(campaign.records)) is not None:
        campaign = replace(campaign, records=tuple(map(aligned, campaign.records, jitter.delays)))
    settled = [without_run_in(r) if r.kind == "timeseries" else (r, 0) for r in campaign.records]
    responses = with_one_instant([measured_response(r) for r, _ in settled])
    levels = levels_of(campaign.records)
    entries = [
        _entry(i, record, response, begin, level)
        for i, (record, response, (_, begin), level) in enumerate(
            zip(campaign.records, responses, settled, levels, strict=True)
        )
    ]
    first = _lowest_frequency(machine, [e.position for e in entries])
    bands = [_band(e, campaign.records[e.record], first) for e in entries]
    # One hammer: what scatters from blow to blow for the structure's sake hides where its reach ends.
    struck = [_kind(campaign.records[e.record]) == "impact" for e in entries]
    reach = min((high for (_, high), hit in zip(bands, struck, strict=True) if hit), default=np.inf)
    # A band that is stated is known to hold what the model describes.
    beyond = resonance_beyond(machine, [e for e in entries if campaign.records[e.record].band_hz is None])
    cut = []
    for e, band, hit in zip(entries, bands, struck, strict=True):
        record = campaign.records[e.record]
        low, high = record.band_hz or (band[0], min(band[1], reach if hit else np.inf, highest))
        keep = (e.freq >= low) & (e.freq <= high) & (e.freq > 0.0)
        if np.count_nonzero(keep) < SETTINGS.record_fewest_lines:
            raise DiagnosisError(
                f"record {record.name}: only {np.count_nonzero(keep)} lines lie in its band of {low:.4g} to {high:.4g} Hz, "
                f"{SETTINGS.record_fewest_lines} are needed; "
                + ("widen `band_hz`, or " if record.band_hz else "")
                + ADVICE[_kind(record)]
            )
        cut.append(thinned(_without_lost(e, record), keep))
    cut = [
        replace(e, replay=None if e.replay is None else e.replay.slower())
        for e in (_with_jitter(e, jitter) for e in of_blows(machine, cut, campaign.records))
    ]
    names = tuple(n for n in machine.channels if any(n in e.channels for e in cut))
    acceleration = all(q == "acceleration" for e in cut for q in e.quantities)
    per_newton = acceleration and machine.input_quantity == "force"
    unit = "g/N" if per_newton else campaign_unit(cut, machine)
    hull = (min(float(e.freq[0]) for e in cut), max(float(e.freq[-1]) for e in cut))
    lacking = (*_without_force(cut, campaign.records), *_words_on_lost(cut, campaign.records))
    disturbed = 0.0
    if jitter is not None:
        disturbed, lacking = _excess(cut, jitter), (*lacking, jitter.words)
    steady = [e for e in cut if _steady(e)]
    apart = [[e.response for e in steady if e.continuous is leaks] for leaks in (False, True)]
    if (tones := interference(*apart)) is not None:
        cut, disturbed, lacking = _without_tones(cut, tones), disturbed + tones.excess, (*lacking, tones.words)
    per_unit = STANDARD_GRAVITY if per_newton else 1.0
    found = {e.record: change_within(e.replay) for e in cut if e.replay is not None and e.continuous and _steady(e)}
    changes = {record: change for record, change in found.items() if change is not None}
    lacking = (*lacking, *_words_on_changes(cut, campaign.records, changes))
    return Observations(tuple(cut), hull, names, unit, per_unit, lacking, beyond, disturbed, jitter, changes)


def _words_on_changes(
    entries: Sequence[Entry], records: Sequence[Record], changes: Mapping[int, FloatArray]
) -> tuple[str, ...]:
    """One line for all records within which the machine changes."""
    sizes = {
        e.record: float(np.sqrt(np.sum(changes[e.record]) / np.sum(np.abs(e.data) ** 2)))
        for e in entries
        if e.record in changes
    }
    return (CHANGES.format(", ".join(records[i].name for i in sizes), max(sizes.values())),) if sizes else ()


def _steady(e: Entry) -> bool:
    """Whether the force at each line acts all the time; once a sweep has passed, a resonance rings on without it as a tone does."""
    if e.sine is not None:
        return False
    return e.replay is None or not e.replay.block or e.replay.shared > SETTINGS.record_swept


def _without_tones(entries: Sequence[Entry], tones: Interference) -> list[Entry]:
    """Records on the lines that tones leave; as they are where these are too few."""
    rest = [thinned(e, ~tones.spoils(e.freq)) for e in entries]
    return [few if few.freq.size >= SETTINGS.record_fewest_lines else e for e, few in zip(entries, rest, strict=True)]


def _without_force(entries: Sequence[Entry], records: Sequence[Record]) -> tuple[str, ...]:
    """One line for the records whose force no simulation can tell, with what each kind would have to state."""
    lacking: dict[str, list[str]] = {}
    for e in entries:
        record = records[e.record]
        if e.replay is None and e.sine is None and (kind := _kind(record)) in LACKING:
            held = kind == "sine" and record.controlled == "response"
            lacking.setdefault("held" if held else kind, []).append(record.name)
    return tuple(
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''}: causes that depend on the level are not tried, "
        f"for the force is not known; {LACKING[kind]}"
        for kind, names in lacking.items()
    )


def _without_lost(e: Entry, record: Record) -> Entry:
    """A record of blows without the lines of each channel that the steps of a converter have spoilt."""
    by_steps = rounding_variance(record) if record.kind == "impact" else np.zeros(1)
    return less_spoilt(e, by_steps) if by_steps.any() else e


def less_spoilt(e: Entry, by_steps: FloatArray) -> Entry:
    """A record of which a part of the variance is by a converter's steps, less the lines that those have spoilt."""
    lost = rounded_part(e.response, by_steps, SETTINGS.record_lost_over) > SETTINGS.record_lost**2
    # Where nothing would be left, the variance that the steps have is all there is to go by.
    return replace(e, rounded=by_steps / e.variance, lost=lost if lost.any() and not lost.all() else None)


def _words_on_lost(entries: Sequence[Entry], records: Sequence[Record]) -> tuple[str, ...]:
    """One line for all lines that are left out since a converter has spoilt them."""
    spoilt = [(e, e.lost) for e in entries if e.lost is not None and e.lost.any()]
    if not spoilt:
        return ()
    part: dict[str, list[float]] = {}
    for e, lost in spoilt:
        for name, share in zip(e.channels, lost.mean(axis=1), strict=True):
            part.setdefault(name, []).append(float(share))
    each = ", ".join(f"{np.mean(shares):.0%} of {name}" for name, shares in part.items() if any(shares))
    more = f" and {len(spoilt) - 1} more" if len(spoilt) > 1 else ""
    return (
        f"{records[spoilt[0][0].record].name}{more}: {each} {SPOILT}: they change the response there by "
        f"more than {SETTINGS.record_lost:.0%}; lower the range, or take more bits",
    )


def campaign_unit(entries: Sequence[Entry], machine: Model) -> str:
    """SI unit of a campaign's responses, where they are not accelerance."""
    from_quantity = {"displacement": "m", "velocity": "m/s", "acceleration": "m/s^2"}
    below = "N" if machine.input_quantity == "force" else "m/s^2"
    return ", ".join(dict.fromkeys(f"{from_quantity[q]}/{below}" for e in entries for q in e.quantities))


def _entry(index: int, record: Record, response: MeasuredFrequencyResponse, begin: int, level: float | None) -> Entry:
    estimator = response.estimator
    replay = None
    if record.kind != "frf":
        replay = replace(replay_of(record), begin=begin)
    elif record.excitation == "impact" and record.peak_force is not None:
        at = SETTINGS.record_blow_at if estimator.blow_at is None else estimator.blow_at
        noise = np.array(response.variance[0, 0, 0])
        replay = assumed_blow(response.freq, estimator.block, at, record.peak_force, noise)
    if not estimator.scatter_seen:
        # How smooth a response is says nothing of what its instruments cannot tell.
        least = (SETTINGS.record_least_noise * np.abs(response.data)) ** 2
        response = replace(response, variance=np.maximum(response.variance, least))
    sine = _sine(record)
    if level is None and sine is not None:
        level = float(np.median(sine.force))
    guessed = record.kind == "frf" and record.excitation == "impact" and record.block is None
    return Entry(index, response, level, record.use == "check", replay, sine, not guessed, session=record.session)


def _sine(record: Record) -> SineTest | None:
    """How a sine record was driven; None where neither force nor response amplitude is known."""
    if record.kind != "frf" or record.excitation != "sine":
        return None
    assert record.frf is not None
    force = record.force_amplitude
    if force is None and record.peak_force is not None and record.controlled != "response":
        force = np.full(record.frf.freq.size, record.peak_force)
    if record.controlled != "response":
        return None if force is None else SineTest(force, record.sweep)
    gain = np.maximum(np.abs(record.frf.data[0, 0, 0]), 1e-300)
    if record.peak_response is not None:
        held = np.full(gain.size, record.peak_response)
        return SineTest(held / gain if force is None else force, record.sweep, held)
    return None if force is None else SineTest(force, record.sweep, force * gain)


def _late(e: Entry, jitter: TriggerJitter) -> ComplexArray:
    """What a record is off by for the mean delay of its blows, of one standard deviation; shape (channel, frequency)."""
    return np.asarray(-2j * np.pi * e.freq * jitter.of_mean(e.record) * e.data)


def _with_jitter(e: Entry, jitter: TriggerJitter | None) -> Entry:
    """A record of blows with the direction in which their mean delay moves it."""
    if jitter is None or not jitter.of_mean(e.record):
        return e
    return replace(e, hits={**e.hits, ("late", e.record, 0): _late(e, jitter)})


def _excess(entries: Sequence[Entry], jitter: TriggerJitter) -> float:
    """What mean delays add to the mean square of a right model's residual, over the noise."""
    return float(np.mean(np.concatenate([(np.abs(_late(e, jitter)) ** 2 / e.variance).ravel() for e in entries])))


def _lowest_frequency(machine: Model, positions: Sequence[float | None]) -> float:
    places = sorted({p for p in positions if p is not None})
    lowest = [float(modes(machine, p).natural_freq[0]) for p in places] or [float(modes(machine).natural_freq[0])]
    return max(min(lowest), 0.0)


def _kind(record: Record) -> str:
    return record.excitation if record.kind == "frf" else record.kind


def _band(e: Entry, record: Record, first: float) -> tuple[float, float]:
    """Lines that a record's noise allows [Hz]."""
    kind = _kind(record)
    # Power over noise of the channel that hears best, of some lines together: one line may pass by chance.
    ratio = np.max(np.abs(e.data) ** 2 / e.variance, axis=0)
    heard = (ndimage.median_filter(ratio, SETTINGS.record_median_lines, mode="nearest") > SETTINGS.record_heard) & (
        e.freq > 0.0
    )
    told = e.freq[heard] if heard.any() else e.freq[e.freq > 0.0]
    if kind in ("sine", "multisine") or not heard.any():
        # Only excited lines are there.
        return float(told[0]), float(told[-1])
    # Below the first mode accelerance drowns in the drift of sensors and amplifiers, which no scatter shows.
    below = all(q == "acceleration" for q in e.quantities) and first > 0.0
    low = SETTINGS.record_below_first_mode * first if below else float(told[0])
    high = min(_highest_quiet(e, low), float(told[-1]))
    if record.kind == "timeseries":
        # Of noise, too, some lines pass: the band begins and ends where beyond it fewer are heard than not.
        surplus = np.cumsum(np.where(heard & _driven(e), 1, -1) * (e.freq >= low))
        last = int(np.argmax(surplus))
        before = np.concatenate([[0], surplus])[: last + 1]
        low = max(low, float(e.freq[before.size - 1 - np.argmin(before[::-1])]))
        high = min(high, float(e.freq[last]))
    if record.kind != "frf":
        # Near the Nyquist frequency the digitiser's filter falls off.
        high = min(high, 0.9 * float(e.freq[-1]))
    return (low, high) if low < high else (float(told[0]), float(told[-1]))


def _driven(e: Entry) -> NDArray[np.bool_]:
    """Lines on which the force of a continuous recording stands out of its sensor's noise; all where no line shows that noise."""
    if e.replay is None or e.replay.power.shape != e.freq.shape:
        return np.ones(e.freq.size, dtype=bool)
    power = ndimage.median_filter(e.replay.power, SETTINGS.record_median_lines, mode="nearest")
    # A shaker's signal ends somewhere below the Nyquist frequency: behind it there is the sensor alone, of even power.
    least, more = np.quantile(power[e.freq > 0.0], [0.1 * SETTINGS.record_quiet_lines, SETTINGS.record_quiet_lines])
    driven = power > least / SETTINGS.record_driven_bias
    return driven if driven.any() and more < SETTINGS.record_even_noise * least else np.ones_like(driven)


def _highest_quiet(e: Entry, low: float) -> float:
    """Frequency up to which the excitation carries: above it the estimates drown in noise."""
    noise = np.sqrt(np.mean(e.variance, axis=0))
    width = max(3, e.freq.size // 200)
    smooth = np.convolve(np.pad(noise, width, mode="edge"), np.ones(2 * width + 1) / (2 * width + 1), mode="valid")
    above = e.freq >= low
    quiet = above & (smooth <= SETTINGS.record_noisy * np.quantile(smooth[above], 0.2)) if above.any() else above
    # The last quiet line: a bump below it is the structure's doing (a response that rattles scatters), not the hammer's.
    return float(e.freq[np.flatnonzero(quiet)[-1]]) if quiet.any() else float(e.freq[-1])
