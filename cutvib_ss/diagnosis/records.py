"""
Records as the diagnosis fits them: frequency responses with their noise, merged by position or apart.

Records at one position are merged by their precision for fitting linear causes; each stays apart where the level matters and for
judging.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.diagnosis.hit_errors import SET_UPS, Hit, Placed
from cutvib_ss.diagnosis.pulses import Pulses
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.sine_test import SineTest
from cutvib_ss.measurement.blow_noise import Ordering
from cutvib_ss.measurement.noise import leaking_variance
from cutvib_ss.measurement.records import FORCE
from cutvib_ss.measurement.replay import Replay
from cutvib_ss.results import ComplexArray, Estimator, FloatArray, MeasuredFrequencyResponse, Quantity
from cutvib_ss.results.arrays import optional_array, position_at

By = Literal["session", "record"]  # What the groups of a problem hold one of


@dataclass(frozen=True)
class Entry:
    """One record: its measured response within the band, and how the machine was driven."""

    record: int  # Index of the record in the campaign
    response: MeasuredFrequencyResponse  # At one position, of one input
    level: float | None = None  # Peak force [N], as stated or of its blows; None where neither tells
    check: bool = False  # Whether the record is only for judging
    # The estimator itself, through which simulated histories pass; None where no force history can be told
    replay: Replay | None = None
    sine: SineTest | None = None  # Of a stepped or swept sine
    block_stated: bool = True  # Whether how long the block of an estimated response was is more than a guess
    session: str | None = None  # Name of its session, where stated
    # Changes of the response by the hand's hits and by set-up errors, each of unit normal size, shape (channel, frequency)
    hits: Mapping[Hit, ComplexArray] = field(default_factory=dict)
    ordering: Ordering | None = None  # How much its blows order with their force; None where that was not looked at
    # Lines of each channel that a converter's steps have spoilt, shape (channel, frequency); None where there are none
    lost: NDArray[np.bool_] | None = None
    # Share of the variance that a converter's steps make, alike in all blows, shape (channel, frequency); None where they make none
    rounded: FloatArray | None = None
    widened: bool = False  # Whether its noise has been widened, for starts
    placed: Placed | None = None  # Where the head is; None at its stated position

    @cached_property
    def position(self) -> float | None:
        """Position y_b / L; None for a structure."""
        return position_at(self.response.positions[0])

    @property
    def head_at(self) -> float | None:
        """Where the head is taken to be; None for a structure."""
        return self.position if self.placed is None else self.placed.position

    @cached_property
    def group(self) -> Group:
        """The record by itself."""
        return _group([self], apart=False)

    @property
    def input(self) -> str:
        """Where the force acts: the model's input, a port, or ``rail@`` and a fraction of the rail."""
        return self.response.inputs[0]

    @property
    def data(self) -> ComplexArray:
        """Responses, shape (channel, frequency)."""
        return self.response.data[0, :, 0]

    @property
    def variance(self) -> FloatArray:
        """Their variance E|ΔH|²."""
        return self.response.variance[0, :, 0]

    @property
    def freq(self) -> FloatArray:
        """Frequency [Hz]."""
        return self.response.freq

    @property
    def channels(self) -> tuple[str, ...]:
        """Response channels."""
        return self.response.outputs

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """Quantity of each channel."""
        return self.response.quantities

    @property
    def estimator(self) -> Estimator:
        """What the estimator did."""
        return self.response.estimator

    @property
    def driven(self) -> float | None:
        """Its level, or of a continuous recording that states none the root mean square of its force; None where neither tells."""
        if self.level is not None or self.replay is None or not self.replay.block:
            return self.level
        return float(np.sqrt(np.mean([np.mean(f**2) for f in self.replay.forces]))) or None

    @property
    def level_step(self) -> int:
        """Its level in steps of what tells two levels apart."""
        return round(float(np.log(self.driven or 1.0) / np.log(SETTINGS.level_apart)))

    @property
    def continuous(self) -> bool:
        """Whether it is a continuous recording, cut into blocks."""
        return self.replay is not None and self.replay.block > 0

    @property
    def leaks(self) -> bool:
        """Whether its blocks leak, or its force outlasts the blow: only a replayed simulation shows what it shows."""
        return self.continuous or (self.replay is not None and self.replay.lasting)

    @cached_property
    def unreplayed(self) -> Entry:
        """The record for models that do not replay how its blocks leak: noise then, as its coherence shows, and smeared peaks."""
        if not self.continuous or self.response.averages < 2:
            return self
        coherence, averages = self.response.coherence[0, :, 0], self.response.averages
        return self.showing(self.data, leaking_variance(self.data, self.variance, coherence, averages))

    @property
    def precision(self) -> FloatArray:
        """What each datum tells: one over its variance, nothing where it is lost."""
        told: FloatArray = 1.0 / self.variance
        return told if self.lost is None else np.where(self.lost, 0.0, told)

    @property
    def count(self) -> int:
        """Real data that tell something."""
        return 2 * int(np.count_nonzero(self.precision))

    def showing(self, data: ComplexArray, variance: FloatArray | None = None) -> Entry:
        """The same record with other responses, and their variance where that is another."""
        noise = self.response.variance if variance is None else variance[None, :, None]
        return replace(self, response=replace(self.response, data=data[None, :, None], variance=noise))


@dataclass(frozen=True)
class Group:
    """Entries on one frequency grid with one set of channels, merged by position and input."""

    positions: FloatArray  # y_b / L; one NaN for a structure
    freq: FloatArray  # Frequency [Hz]
    channels: tuple[str, ...]  # Response channels
    quantities: tuple[Quantity, ...]  # Their quantities
    data: ComplexArray  # Responses and E|ΔH|²
    variance: FloatArray
    block: FloatArray  # What the estimator did, as in `Estimator`
    blow_at: FloatArray  # NaN where it is not known
    decay_rate: FloatArray
    entries: tuple[tuple[Entry, ...], ...] = ()  # The records behind each row
    struck: tuple[str, ...] = ()  # Where the force of each row acts, as in `Entry`; nothing: at the model's input
    hits: tuple[Mapping[Hit, ComplexArray], ...] = ()  # What the hits of each row's records do, with their weight in it

    @cached_property
    def blows(self) -> dict[tuple[int, float], tuple[Pulses, ComplexArray]]:
        """The pulses of a row, and the share of each in the lines' spectrum, by the instant that times count from."""
        return {}

    @cached_property
    def places(self) -> tuple[FloatArray, NDArray[np.intp]]:
        """The positions, each once, and the index of each row's."""
        return np.unique(self.positions, return_inverse=True)

    @cached_property
    def weight(self) -> FloatArray:
        """Of each real part: one over its standard deviation."""
        return np.asarray(np.sqrt(2.0 / self.variance))

    @property
    def inputs(self) -> tuple[str, ...]:
        """Where the force of each row acts."""
        return self.struck or (FORCE,) * len(self.data)

    @property
    def widened(self) -> bool:
        """Whether the noise of its records has been widened."""
        return any(e.widened for same in self.entries for e in same)

    def entry(self, row: int) -> Entry:
        """The records behind a row as the one that they are merged into."""
        first, *others = self.entries[row]
        averages = first.response.averages + sum(e.response.averages for e in others)
        coherence = first.response.coherence * np.nan if others else first.response.coherence
        merged_into = first.showing(self.data[row], self.variance[row])
        return replace(merged_into, response=replace(merged_into.response, averages=averages, coherence=coherence))


@dataclass(frozen=True)
class Records:
    """Records to fit on: merged by position for linear causes, apart for those that depend on the level."""

    entries: tuple[Entry, ...]  # The records
    rough: bool = False  # Whether lines have been left out, for starts
    widened: bool = False  # Whether the noise has been widened too: by more than machines drift
    moving: bool = False  # Whether the machine may have moved between the records of a session: none are merged

    @cached_property
    def merged(self) -> tuple[Group, ...]:
        """Groups with one row a position."""
        return merged(self.entries)

    @cached_property
    def _groups(self) -> dict[tuple[bool, By | None], tuple[Group, ...]]:
        return {}

    def groups(self, by: By | None = None) -> tuple[Group, ...]:
        """Groups for a linear cause: one row a position, or a record where the machine moves; all, by session, or by record."""
        if not self.moving and by != "record":
            return self.merged if by is None else self._grouped(False, by)
        return self._grouped(True, by)

    def apart_groups(self, by: By | None = None) -> tuple[Group, ...]:
        """Groups with one row a record, those that can be simulated alone."""
        return self._alone._grouped(True, by)

    def _grouped(self, apart: bool, by: By | None) -> tuple[Group, ...]:
        if (apart, by) not in self._groups:
            entries = self.entries
            self._groups[apart, by] = (
                tuple(e.group for e in entries)
                if by == "record"
                else merged(entries, apart, by_session=by == "session")
            )
        return self._groups[apart, by]

    @cached_property
    def simulable(self) -> tuple[Entry, ...]:
        """Records whose force history is known or can be assumed, and sine sweeps."""
        return tuple(e for e in self.entries if e.replay is not None or e.sine is not None)

    @cached_property
    def _alone(self) -> Records:
        return self if len(self.simulable) == len(self.entries) else Records(self.simulable)

    @cached_property
    def still(self) -> Records:
        """The same as if the machine had not moved within a session: merged, to tell from afar what is alike at every level."""
        return replace(self, moving=False) if self.moving else self

    @property
    def leaking(self) -> bool:
        """Whether there are records that only a replayed simulation shows."""
        return not self.rough and any(e.leaks for e in self.entries)

    @cached_property
    def scatter(self) -> float:
        """χ² of the records about what they are merged into: what a cause that ignores the level cannot lower, nor their hits."""
        return sum(_scatter(row, same) for g in self.merged for row, same in zip(g.data, g.entries, strict=True))

    def coarse(self, lines: int, error: float, replayed: bool = False) -> Records:
        """The same records with few lines and a widened noise; whether their blocks are replayed there, too."""
        behind = {e.record: len(same) for g in self.groups() for same in g.entries for e in same}
        out = []
        for e in self.entries:
            few = thinned(e if replayed else e.unreplayed, slice(None, None, max(1, e.freq.size // lines)))
            widened = few.variance + behind[e.record] * (error * np.abs(few.data)) ** 2
            out.append(replace(few.showing(few.data, widened), widened=error > 0.0))
        return Records(tuple(out), rough=True, widened=error > 0.0, moving=self.moving)

    def for_laws(self, lines: int, error: float) -> Records | None:
        """Few records that show what depends on the level: some positions, each level once, short, on few lines."""
        if len(self.simulable) < len(self.entries):
            return None
        places = sorted({site(e) for e in self.entries})
        chosen = {
            places[i]
            for i in np.unique(np.linspace(0, len(places) - 1, SETTINGS.search_outlook_positions).round().astype(int))
        }
        # Of continuous recordings one of each level: another session at a level tells of drift only.
        seen: dict[tuple[object, ...], Entry] = {}
        for e in (e for e in self.entries if site(e) in chosen):
            seen.setdefault((*measured_at(e), *block_and_window(e), e.level_step) if e.continuous else (e.record,), e)
        return Records(tuple(in_short(e) for e in seen.values())).coarse(lines, error, replayed=True)


def _scatter(row: ComplexArray, same: Sequence[Entry]) -> float:
    """Weighted squares of some records about their mean, less what their hits explain."""
    weight = np.sqrt(2.0 * np.array([e.precision for e in same]))
    left = (weight * (np.array([e.data for e in same]) - row)).ravel()
    squares = float(np.vdot(left, left).real)
    keys = dict.fromkeys(key for e in same for key in e.hits)
    if len(same) < 2 or not keys:
        return squares
    share = weight**2 / np.maximum(np.sum(weight**2, axis=0), 1e-300)
    still = np.zeros(weight.shape[1:])
    moved = np.array([[e.hits.get(key, still) for e in same] for key in keys])
    rows = ((moved - np.sum(share * moved, axis=1, keepdims=True)) * weight).reshape(len(keys), -1)
    pulled = (rows.conj() @ left).real
    return squares - float(pulled @ np.linalg.solve((rows @ rows.conj().T).real + np.eye(len(keys)), pulled))


def merged(entries: Sequence[Entry], apart: bool = False, by_session: bool = False) -> tuple[Group, ...]:
    """Records merged by position, weighted by their precision."""
    kinds: dict[tuple[object, ...], list[Entry]] = {}
    for e in entries:
        grid = (e.channels, e.quantities, e.freq.size, float(e.freq[0]), float(e.freq[-1]))
        key = (*grid, *(session_of(e) if by_session else ()))
        kinds.setdefault(key, []).append(e)
    return tuple(_group(members, apart) for members in kinds.values())


def measured_at(e: Entry) -> tuple[float | None, str]:
    """Position and input: records that share them show the same responses."""
    return e.position, e.input


def estimator_of(e: Entry) -> tuple[object, ...]:
    """Channels, lines, block and window of a record: records that share them can be compared as they are."""
    lines = (e.freq.size, float(e.freq[0]), float(e.freq[-1]))
    return (e.channels, e.quantities, *lines, *block_and_window(e))


def site(e: Entry) -> tuple[float | str | None, ...]:
    """What records must share to be merged: input, session, position, and a block that loses the same tails."""
    return (*measured_at(e), *block_and_window(e), *session_of(e))


def block_and_window(e: Entry) -> tuple[float, float]:
    """Length of the block, which loses the tails, and rate of the window, which damps."""
    return round(e.estimator.block, 9), round(e.estimator.exponential_decay, 9)


def session_of(e: Entry) -> tuple[float | str, ...]:
    """The session of a record, whose records share their drift."""
    if e.session is not None:
        return (e.session,)
    return (e.position,) if e.position is not None else (float(e.record), "record")


def in_short(e: Entry) -> Entry:
    """A record as its first blow, or its loudest blocks, alone show it."""
    r = e.replay
    # In a sweep lines take turns.
    if r is None or (r.shared <= SETTINGS.record_swept if r.block else len(r.forces) < 2):
        return e
    short = r.short(SETTINGS.search_outlook_blocks)
    more = r.power / np.maximum(short.power, 1e-12 * np.max(r.power))
    # A set-up is the same whatever is told of it.
    hits = {key: h if key[0] in SET_UPS else np.sqrt(more) * h for key, h in e.hits.items()}
    return replace(e.showing(short.data(short.measured), more * e.variance), replay=short, hits=hits)


def _group(members: list[Entry], apart: bool) -> Group:
    places: dict[tuple[float | str | None, ...], list[Entry]] = {}
    for e in members:
        places.setdefault((float(e.record),) if apart else site(e), []).append(e)
    data, variance, hits = [], [], []
    for same in places.values():
        precision = np.array([e.precision for e in same])
        total = precision.sum(axis=0)
        told = total > 0.0
        share = np.where(told, precision / np.where(told, total, 1.0), 1.0 / len(same))
        data.append(sum(w * e.data for w, e in zip(share, same, strict=True)))
        variance.append(np.where(told, 1.0 / np.where(told, total, 1.0), np.inf))
        own: dict[Hit, ComplexArray] = {}
        for w, e in zip(share, same, strict=True):
            own |= {key: own.get(key, 0.0) + w * direction for key, direction in e.hits.items()}
        hits.append(own)
    first = [same[0] for same in places.values()]
    return Group(
        positions=optional_array([e.head_at for e in first]),
        freq=first[0].freq,
        channels=first[0].channels,
        quantities=first[0].quantities,
        data=np.array(data),
        variance=np.array(variance),
        block=np.array([e.estimator.block for e in first]),
        blow_at=np.array([np.mean(optional_array([e.estimator.blow_at for e in same])) for same in places.values()]),
        decay_rate=np.array([e.estimator.exponential_decay for e in first]),
        entries=tuple(tuple(same) for same in places.values()),
        struck=tuple(e.input for e in first),
        hits=tuple(hits),
    )


def thinned(e: Entry, keep: np.ndarray | slice) -> Entry:
    """A record on some of its lines."""
    replay = None if e.replay is None else e.replay.at(keep)
    sine = None if e.sine is None else e.sine.at(keep)
    hits = {key: direction[..., keep] for key, direction in e.hits.items()}
    lost = None if e.lost is None else e.lost[..., keep]
    rounded = None if e.rounded is None else e.rounded[..., keep]
    return replace(
        e, response=e.response.at_lines(keep), replay=replay, sine=sine, hits=hits, lost=lost, rounded=rounded
    )
