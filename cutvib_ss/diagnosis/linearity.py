"""What the excitation level does: whether the responses change with it, and how far each place moves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from scipy import signal, special, stats

from cutvib_ss.diagnosis.comparison import across_grids, with_like_tails
from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.level_trend import about_sessions
from cutvib_ss.diagnosis.prediction import moves_as_one
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.records import Entry, Records, merged, session_of
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model, Motion
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.measurement.blow_noise import chance_of_ordering
from cutvib_ss.measurement.levels import sessions_of_one_level
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.stepping import modal_form, step
from cutvib_ss.results import FloatArray
from cutvib_ss.results.arrays import position_at


def levels_compared(records: Records, model: Model | None = None, blow_at: float = 0.0) -> bool:
    """Whether some position was measured at levels far enough apart for a difference to show."""
    each = [[e.level for e in same] for g in records.merged for same in g.entries]
    each += [list(levels) for levels, _ in across_grids(records.merged, model, blow_at)]
    stated = [[level for level in levels if level is not None] for levels in each]
    return any(max(levels) > SETTINGS.level_apart * min(levels) for levels in stated if levels)


def confounded(records: Records) -> bool:
    """Whether every session has one level, and they differ: drift then does what a nonlinear restoring force does."""
    return sessions_of_one_level((session_of(e), e.driven) for e in records.entries)


def drift_for_levels(fit: Fit, records: Records) -> bool:
    """Whether sessions, each of a level of its own, drift by so much that a restoring force may hide in it."""
    return confounded(records) and fit.spread.sizes.drift >= SETTINGS.level_hiding_drift


def level_stands_out(records: Records, model: Model | None = None, blow_at: float = 0.0) -> bool:
    """
    Whether some band of the responses changes with the level.

    Records on unlike blocks are compared by a model; where no levels can be compared, single blows are by their force.
    """
    for g in records.merged:
        # What blocks cut off of blows at unlike instants passes for an effect of the level: the model tells that.
        if _differ(g.entries) and (model is None or _differ([with_like_tails(s, model, blow_at) for s in g.entries])):
            return True
    pairs = across_grids(records.merged, model, blow_at)
    if any(_rises(pair.power.sum(axis=0), len(pair.channels)) for _, pair in pairs):
        return True
    return not levels_compared(records, model, blow_at) and blows_order(records)


def blows_order(records: Records) -> bool:
    """Whether single blows order with their force beyond what chance does in so many records."""
    told = (e.ordering for e in records.entries if e.ordering is not None)
    return chance_of_ordering(told) < SETTINGS.level_ordered


def drift_of_any_order(fit: Fit, records: Records) -> bool:
    """Whether records drift within their sessions, and are so few that this drift may have any order of their levels by chance."""
    if not fit.spread.layout.records or fit.spread.sizes.within < SETTINGS.level_hiding_within:
        return False
    sessions: dict[tuple[float | str, ...], Counter[int]] = {}
    for e in records.entries:
        sessions.setdefault(session_of(e), Counter())[e.level_step] += 1
    # n!/(n1! n2! ...) of each session.
    each = [
        special.gammaln(s.total() + 1) - special.gammaln(np.array([*s.values()]) + 1).sum() for s in sessions.values()
    ]
    return bool(np.sum(each) < -np.log(SETTINGS.level_drift))


def chance_of_order(spread: Spread, records: Records) -> float:
    """
    Chance that drift of the records of a session orders with their level as much as a fit says; 1 where it cannot be told.

    Where every session has a level of its own, that is the drift of the sessions.

    A machine that moves while it is measured does not ask how hard it is struck; a restoring force moves what all records of a
    level show to the same side. By Student's t of each value's slope over the logarithm of the level, sessions apart, times the
    number of values.
    """
    lay = spread.layout
    by_record = {e.record: e for e in records.entries}
    of, first = [by_record[r] for r in lay.records], lay.first_within
    names: list[tuple[float | str, ...]] = [session_of(e) for e in of]
    if not of and confounded(records):
        levels = {session_of(e): e for e in records.entries}
        of, first = [levels[name] for name in lay.sessions if name in levels], lay.unknowns
        names = [() for _ in of]
    driven = [e.driven for e in of]
    # Where records hardly drift within their session nothing hides in that.
    small = bool(lay.records) and spread.sizes.within < SETTINGS.level_hiding_within
    if not of or any(level is None for level in driven) or small:
        return 1.0
    free = len(of) - len(set(names)) - 1
    start = first + lay.per_session * np.arange(len(of))
    drift = np.array([spread.offsets[k : k + lay.per_session] for k in start])
    drift, level = (about_sessions(a, names) for a in (drift, np.log(np.array(driven, dtype=np.float64))[:, None]))
    power = float(np.sum(level**2))
    if free < 1 or power < np.log(SETTINGS.level_apart) ** 2 / 2:
        return 1.0
    slope = level.T @ drift / power
    scatter = np.sum((drift - level * slope) ** 2, axis=0) / (free * power)
    seen = scatter > 0.0
    chances = 2.0 * stats.t.sf(np.abs(slope[0, seen]) / np.sqrt(scatter[seen]), free)
    return min(float(chances.min()) * chances.size, 1.0) if chances.size else 1.0


def _differ(places: Sequence[Sequence[Entry]]) -> bool:
    """Whether records at the same place differ in some band by more than their noise."""
    power, count, leaks = 0.0, 0, False
    for same in places:
        if len(same) > 1:
            precision = np.array([e.unreplayed.precision for e in same])
            data = np.array([e.data for e in same])
            mean = np.sum(precision * data, axis=0) / np.maximum(np.sum(precision, axis=0), 1e-300)
            power = power + np.sum(np.abs(data - mean) ** 2 * precision, axis=(0, 1))
            count += (len(same) - 1) * len(same[0].channels)
            leaks = leaks or any(e.continuous for e in same)
    # All that a mode leaks into lines and channels goes together.
    return count > 0 and _rises(np.asarray(power), count, sum(len(same) - 1 for same in places) if leaks else None)


def _rises(power: FloatArray, count: int, independent: int | None = None) -> bool:
    """Whether some band of a sum of `count` squares over their variances, of so many independent ones, rises above one."""
    width = min(SETTINGS.level_lines, power.size)
    smooth = np.convolve(power / count, np.ones(width) / width, mode="valid")
    scatter = 1.0 / np.sqrt(count * width if independent is None else independent)
    return bool(smooth.max() > 1.0 + SETTINGS.level_noise_error + SETTINGS.level_stands_out * scatter)


def motions(model: Model, records: Records) -> dict[str, Motion]:
    """How far and how fast each place of a restoring force moves in the records."""
    places = tuple(dict.fromkeys(place for kind in EFFECTS.values() if not kind.linear for place in kind.places(model)))
    peaks: list[np.ndarray] = []
    forces: list[np.ndarray] = []
    rates: list[np.ndarray] = []
    floats = moves_as_one(model)
    for g in merged(records.simulable, apart=True):
        for position, struck, (entry, *_) in zip(g.positions, g.inputs, g.entries, strict=True):
            at = position_at(position)
            forces.append(_holding(model, at, g.freq, places, struck) * _peak(entry))
            if entry.sine is not None:
                sweep = frequency_response(
                    model, None if at is None else [at], g.freq, form="receptance", inputs=[struck], outputs=places
                )
                size = entry.sine.force * np.abs(sweep.data[0, :, 0])
                peaks.append(size.max(axis=1))
                rates.append((size * 2 * np.pi * g.freq).max(axis=1))
                continue
            assert entry.replay is not None
            form = modal_form(model, at, places, SETTINGS.simulation_hysteresis_at, input=struck)
            moved = step(form, np.stack(entry.replay.forces), entry.replay.fs).responses
            if floats:
                moved = _in_band(moved, entry.replay.fs, float(g.freq[0]))
            peaks.append(np.abs(moved).max(axis=(0, 2)))
            rates.append(np.abs(np.diff(moved, axis=-1)).max(axis=(0, 2)) * entry.replay.fs)
    peak, rate, force = np.array(peaks), np.array(rates), np.array(forces)
    return {
        name: Motion(
            float(peak[:, i].min()),
            float(peak[:, i].max()),
            float(np.median(rate[:, i])),
            float(np.median(force[:, i])),
        )
        for i, name in enumerate(places)
    }


def _in_band(moved: FloatArray, fs: float, lowest: float) -> FloatArray:
    """Motions without what lies below a record's lines: what nothing holds wanders off under the errors of a force."""
    filtered = signal.butter(2, 0.5 * lowest, "highpass", fs=fs, output="sos")
    return np.asarray(signal.sosfiltfilt(filtered, moved, axis=-1))


def _holding(model: Model, position: float | None, freq: FloatArray, places: tuple[str, ...], input: str) -> FloatArray:
    """Force that would hold each place still over the exciting force, of which the median over the lines: by H_pf/H_pp."""
    at = None if position is None else [position]
    both = frequency_response(model, at, freq, form="receptance", inputs=[input, *places], outputs=places)
    by_force, own = np.abs(both.data[0, :, 0]), np.abs(both.data[0, :, 1:])
    return np.asarray(np.median(by_force / np.diagonal(own, axis1=0, axis2=1).T, axis=1))


def _peak(entry: Entry) -> float:
    """Peak of a record's force."""
    if entry.sine is not None:
        return float(entry.sine.force.max())
    assert entry.replay is not None
    return float(np.abs(np.stack(entry.replay.forces)).max())
