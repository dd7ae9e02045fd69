"""What looks wrong: units off by a known factor, the same data twice, spectra not divided by the force, a sensor that drifts."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement.inputs import response_to
from cutvib_ss.measurement.levels import LEVELS_APART
from cutvib_ss.measurement.records import FORCE, History, MachineLike, Record
from cutvib_ss.model.protocol import Model
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse
from cutvib_ss.units import STANDARD_GRAVITY

_FACTORS = {
    STANDARD_GRAVITY: "9.81 times too large",
    1 / STANDARD_GRAVITY: "9.81 times too small",
    1000.0: "1000 times too large",
    1e-3: "1000 times too small",
}
_CAUSES = {
    STANDARD_GRAVITY: "values in m/s^2 that are called g",
    1 / STANDARD_GRAVITY: "values in g that are called m/s^2",
    1000.0: "values in mm (or mV) that are called m (or V)",
    1e-3: "values in m (or V) that are called mm (or mV)",
}
_FORCES = {STANDARD_GRAVITY: "kgf", 1000.0: "kN", 1e-3: "mN"}
"""Unit of a force that is called N, where every response is off by the factor."""
_CLOSE = 0.25
"""Of the logarithm of a level over the nominal model's: what sensors and models are off by at most."""

_FAR = 20.0
"""Level over the nominal model's that no sensor or structure is off by, whatever the factor."""

_ALIKE = 1.0
"""Spread between the quartiles of that logarithm up to which the shapes are alike."""

_IN_PROPORTION = 0.1
"""Of the logarithm of that ratio: by how much the responses' own may differ from it."""

_DRIFT = 0.02  # of a channel's largest value: a smaller drift is left alone
_CLEAR = 6.0  # standard deviations that a drift must stand out


def unit_hints(record: Record, machine: MachineLike, where: str, frf: MeasuredFrequencyResponse) -> list[str]:
    """A hint on every channel whose level over the nominal model's is off by a factor between units; nothing is changed."""
    found: dict[str, float] = {}
    far: dict[str, float] = {}
    for name, (level, spread) in levels_over_nominal(record, machine, frf).items():
        for factor in _FACTORS:
            # a structure that is another one has another shape, too
            if abs(np.log(level / factor)) < _CLOSE and spread < _ALIKE:
                found[name] = factor
        if name not in found and abs(np.log(level)) > np.log(_FAR) and spread < _ALIKE:
            far[name] = level
    end = "(a unit or gain under [channels] overrides the file's)"
    said = []
    if len(found) == len(record.channels) > 1 and len(set(found.values())) == 1:
        factor = next(iter(found.values()))
        unit = _FORCES.get(factor) if record.input_quantity == "force" else None
        force = f", or a force in {unit} that is called N" if unit else ""
        said.append(
            f"{where}: every response looks {_FACTORS[factor]} against the nominal model: {_CAUSES[factor]}{force}; check the "
            f"units {end}"
        )
    else:
        said += [
            f"{where}: {name} looks {_FACTORS[factor]} against the nominal model: {_CAUSES[factor]}; check its unit {end}"
            for name, factor in found.items()
        ]
    if far:
        sizes = ", ".join(f"{name} {level:.3g} times" for name, level in far.items())
        said.append(
            f"{where}: levels against the nominal model are {sizes}: is a sensitivity missing (V or mV for N or m/s^2)? Check "
            f"units and gains {end}"
        )
    return said


def levels_over_nominal(
    record: Record, machine: MachineLike, frf: MeasuredFrequencyResponse
) -> dict[str, tuple[float, float]]:
    """Median of each channel's modulus over the nominal model's on the lines clear of noise, and the spread of its logarithm."""
    if not isinstance(machine, Model):
        return {}
    above = frf.freq > 0
    freq = frf.freq[above]
    nominal = response_to(record.input, machine, record.position, freq, record.channels).data[0, :, 0]
    levels = {}
    for k, name in enumerate(record.channels):
        h, model = np.abs(frf.data[0, k, 0, above]), np.abs(nominal[k])
        clear = (h**2 > 25 * frf.variance[0, k, 0, above]) & np.isfinite(model) & (model > 0)
        if record.band_hz is not None:
            clear &= (freq >= record.band_hz[0]) & (freq <= record.band_hz[1])
        alike = np.abs(nominal[[q == record.quantities[k] for q in record.quantities]]).max(axis=0)
        # what hardly moves by symmetry moves by what breaks that: its ratio tells nothing of its sensitivity
        if np.count_nonzero(clear) >= 8 and np.median((model / alike)[clear]) > 1.0 / _FAR:
            # the median, since a mode that is shifted is far off at some lines
            low, middle, high = np.percentile(np.log(h[clear] / model[clear]), [25, 50, 75])
            levels[name] = float(np.exp(middle)), float(high - low)
    return levels


def same_data(records: Sequence[Record]) -> list[str]:
    """A warning on every pair of records (or blows of one record) that hold the same measurement."""
    seen: dict[str, tuple[int, str]] = {}
    found: dict[tuple[int, int], list[str]] = {}
    for k, record in enumerate(records):
        for name, mark in _marks(record):
            if mark in seen:
                other, theirs = seen[mark]
                found.setdefault((other, k), []).append(f"{theirs} is {name}" if theirs != name else name)
            else:
                seen[mark] = (k, name)
    words = []
    for (i, j), blows in found.items():
        a, b = records[i], records[j]
        what = ", ".join(blow for blow in blows[:3] if blow) + (" …" if len(blows) > 3 else "")
        what = f" ({what})" if what else ""
        if i == j:
            words.append(f"{a.name}: the same blow twice{what}; it is no second measurement: remove one")
        elif {a.use, b.use} == {"fit", "check"}:
            words.append(
                f"{a.name} (use = {a.use!r}) and {b.name} (use = {b.use!r}) hold the same data{what}: what is judged on would "
                "have been fitted; remove one"
            )
        else:
            words.append(f"{a.name} and {b.name} hold the same data{what}: they count as one measurement; remove one")
    return words


def refuse_undivided(records: Sequence[Record], where: str) -> None:
    """
    Refuse estimated responses that grow in proportion to the stated force: they are spectra that were not divided by it.

    No structure does that at most of its lines: a restoring force that gives way changes those near a resonance.
    """
    grown = [
        (a.name, b.name, _grow(a.frf, b.frf, float(np.log(b.peak_force / a.peak_force))))
        for i, a in enumerate(records)
        for b in records[i + 1 :]
        if (a.position, a.input, a.channels) == (b.position, b.input, b.channels)
        and a.frf is not None
        and b.frf is not None
        and a.peak_force
        and b.peak_force
        and not 1 / LEVELS_APART < a.peak_force / b.peak_force < LEVELS_APART
    ]
    if grown and all(grows for _, _, grows in grown):
        one, other, _ = grown[0]
        raise DataFormatError(
            f"{where}: responses grow in proportion to peak_force ({other} against {one}): they look like spectra that were not "
            'divided by the force; divide each by its force, or give histories (kind = "timeseries" or "impact")'
        )


def _grow(one: MeasuredFrequencyResponse, other: MeasuredFrequencyResponse, by: float) -> bool:
    """Whether every channel of another response is larger by a factor, given as its logarithm, at most lines."""
    freq = one.freq[(one.freq >= other.freq[0]) & (one.freq <= other.freq[-1])]
    for k in range(one.data.shape[1]):
        a, b = (np.interp(freq, h.freq, np.abs(h.data[0, k, 0])) for h in (one, other))
        seen = (a > 0.0) & (b > 0.0)
        # By the median, since at a resonance friction and drag hold the growth back.
        if not np.any(seen) or abs(float(np.median(np.log(b[seen] / a[seen]))) - by) > _IN_PROPORTION * abs(by):
            return False
    return True


def _marks(record: Record) -> list[tuple[str, str]]:
    """A mark of each blow's (or estimate's) numbers, whatever file and unit they came in."""
    if record.frf is not None:
        return [("", _mark(record.frf.data[0, :, 0]))]
    return [(h.name, _mark(np.vstack([h.force, h.responses]))) for h in record.histories]


def _mark(values: np.ndarray) -> str:
    size = np.max(np.abs(values)) or 1.0
    rounded = np.round(values / size, 6) + 0.0  # files print six digits, at the least; no minus zero
    return hashlib.sha256(np.ascontiguousarray(rounded).tobytes()).hexdigest()


def without_drift(record: Record, where: str) -> tuple[Record, list[str]]:
    """
    Blows without the straight drift of a sensor, and a warning for each that was taken off.

    Force and acceleration return to where they were, once the structure is at rest or rings about it. A difference between the mean
    before the blow and that over the last tenth is the sensor's drift, where it exceeds what ringing and noise leave of such
    a mean; the line through both is taken off. Velocities and displacements of a free body do not return: they are left.
    """
    if record.kind != "impact":
        return record, []
    histories: list[History] = []
    drifts: dict[str, list[float]] = {}
    for history in record.histories:
        columns = [history.force, *history.responses]
        kinds = ["acceleration" if record.input_quantity == "acceleration" else "force", *record.quantities]
        for k, (values, kind) in enumerate(zip(columns, kinds, strict=True)):
            slope = _drift(values, history) if kind in ("force", "acceleration") else 0.0
            if slope:
                name = (FORCE, *record.channels)[k]
                drifts.setdefault(name, []).append(slope * history.duration / np.max(np.abs(values)))
                columns[k] = values - slope * history.time
        changed = any(new is not old for new, old in zip(columns, [history.force, *history.responses], strict=True))
        histories.append(replace(history, force=columns[0], responses=np.vstack(columns[1:])) if changed else history)
    words = [
        f"{where}: {name} drifts by {100 * max(shares, key=abs):.0f} % of its largest value over a blow "
        f"({len(shares)} of {len(histories)} blows): the straight line is taken off"
        for name, shares in drifts.items()
    ]
    return (replace(record, histories=tuple(histories)) if drifts else record), words


def _drift(values: FloatArray, history: History) -> float:
    """Slope per second of a drift that stands out; zero where none does."""
    start = history.start
    tail = values.size // 10
    if start < 32 or tail < 64:
        return 0.0
    before, after = values[:start], values[-tail:]
    # means of parts of the tail tell how far its mean is known: slow ringing does not average out
    parts = [float(np.mean(part)) for part in np.array_split(after, 8)]
    middle = float(np.mean(after))
    known = np.hypot(np.std(parts, ddof=1) / np.sqrt(8), np.std(before) / np.sqrt(before.size / 4))
    step = middle - float(np.mean(before))
    if abs(step) < max(_DRIFT * float(np.max(np.abs(values))), _CLEAR * known):
        return 0.0
    return step / ((values.size - tail / 2 - start / 2) / history.fs)
