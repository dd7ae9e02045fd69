"""A campaign on the virtual machine: every blow at every position and level, and what becomes of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.validation.rig.assembly import assembled
from cutvib_ss.validation.rig.blows import BLOCK, FS, Blow, antialiased, draw_blow
from cutvib_ss.validation.rig.chain import frequencies, mains_interference, recorded, sensed, smooth_error, windowed
from cutvib_ss.validation.rig.conditions import Conditions
from cutvib_ss.validation.rig.motion import STEPS, converged_answer, linear_answer
from cutvib_ss.validation.rig.multibody import Linearised
from cutvib_ss.validation.rig.repeatability import CUTTING_MACHINE, STRUCTURE, State, states
from cutvib_ss.validation.rig.structure import Machinery, Rig

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Streams of random numbers, one a purpose, so that none depends on how many numbers another took.
_BLOWS, _ERRORS, _NOISE, _LATE, _OVERLOAD, _BAD = range(10, 16)


@dataclass(frozen=True)
class Frf:
    """Frequency responses of one record."""

    freq: Array  # Frequencies [Hz]
    data: Complex  # H1 [m/s^2/N]
    coherence: Array  # Coherence
    averages: int  # Blows behind them


@dataclass(frozen=True)
class Campaign:
    """Every blow of a campaign, computed when asked for. Records run over positions, then levels."""

    rig: Machinery  # The machine
    conditions: Conditions  # How it is measured
    seed: int  # Blows, calibration errors, noise follow from it, in streams of their own

    @property
    def names(self) -> tuple[str, ...]:
        """All response channels, recorded or not."""
        return tuple(c.name for c in self.rig.channels)

    @property
    def records(self) -> tuple[tuple[float | None, float], ...]:
        """Position and level of each record; a structure without positions is measured several times over."""
        return tuple((y, level) for y in self.conditions.positions for level in self.conditions.levels)

    @cached_property
    def blows(self) -> tuple[tuple[Blow, ...], ...]:
        """The blows of each record."""
        c = self.conditions
        rng = np.random.default_rng([self.seed, _BLOWS])
        twice = [1.0 if kind == "double" else c.hit_twice for kind in map(dict(c.bad).get, range(len(self.records)))]
        return tuple(
            tuple(draw_blow(rng, level, c.width, bounce, c.hammer) for _ in range(c.blows))
            for (_, level), bounce in zip(self.records, twice, strict=True)
        )

    @cached_property
    def sessions(self) -> tuple[int, ...]:
        """Session of each record: those at one position are measured in one."""
        return tuple(i // len(self.conditions.levels) for i in range(len(self.records)))

    @cached_property
    def states(self) -> tuple[State, ...]:
        """How far the machine has moved during each record."""
        changes = CUTTING_MACHINE if isinstance(self.rig, Rig) else STRUCTURE
        return states(self.conditions.repeatability, self.sessions, changes, len(self.names), self.seed)

    @cached_property
    def _machines(self) -> dict[tuple[float | None, int], Linearised]:
        return {}

    def machine(self, record: int) -> tuple[Machinery, Linearised]:
        """The machine during a record, assembled once for each state that it is in."""
        rig = self.rig.at(record / max(len(self.records) - 1, 1))
        moves = self.conditions.repeatability.moves
        if moves:
            rig = rig.moved(self.states[record].values)
        key = (self.records[record][0], record if self.rig.drift or moves else 0)
        if key not in self._machines:
            self._machines[key] = assembled(rig, key[0])
        return rig, self._machines[key]

    @cached_property
    def _steps(self) -> dict[str, int]:
        return {}

    @cached_property
    def _answers(self) -> dict[tuple[int, int], tuple[Array, Array]]:
        return {}

    @cached_property
    def _unstable(self) -> dict[tuple[int, int], float]:
        return {}

    @property
    def unstable_blows(self) -> int:
        """Blows so far whose motion is unstable: a part in a million of the force shows, see `motion.converged_answer`."""
        return sum(size > 0.0 for size in self._unstable.values())

    def answer(self, record: int, blow: int) -> tuple[Array, Array]:
        """Force and accelerations of one blow, filtered, at FS, before sensors."""
        key = (record, blow)
        if key not in self._answers:
            rig, machine = self.machine(record)
            struck = self.blows[record][blow]
            force = antialiased(struck.force())
            if rig.linear:
                response = linear_answer(rig, machine, force[None], FS)[0]
            else:
                begin = self._steps.get("needed", STEPS[0])
                found = converged_answer(rig, machine, struck, self.conditions.resolved or self.conditions.noise, begin)
                response = found.response
                self._unstable[key] = found.sensitivity
                # the next blow begins where this one could have, and is checked by halving all the same
                self._steps["needed"] = max(found.steps // 2, STEPS[0])
            self._answers[key] = (force, response)
        return self._answers[key]

    @cached_property
    def errors(self) -> Complex:
        """Calibration errors that are nobody's cause: (channel, frequency of the sensors' transform)."""
        rng = np.random.default_rng([self.seed, _ERRORS])
        return np.array([smooth_error(rng, frequencies()) for _ in self.names])

    def overloaded(self) -> frozenset[tuple[int, int]]:
        """Blows that exceed the range of a response channel."""
        rng = np.random.default_rng([self.seed, _OVERLOAD])
        count = len(self.records) * self.conditions.blows
        picked = rng.choice(count, min(self.conditions.overloads, count), replace=False)
        return frozenset(divmod(int(k), self.conditions.blows) for k in picked)

    def recording(self, record: int, blow: int) -> tuple[Array, Array]:
        """One blow as recorded."""
        late = np.random.default_rng([self.seed, _LATE, record, blow]).standard_normal() * self.rig.chain.jitter
        force, response = self.answer(record, blow)
        shown = sensed(self.rig.chain, self.names, force, response, late, self.errors)
        shown = shown * np.array(self.states[record].gains)[:, None]
        rng = np.random.default_rng([self.seed, _NOISE, record, blow])
        bad = dict(self.conditions.bad).get(record)
        channel = np.random.default_rng([self.seed, _BAD, record]).integers(len(self.names))
        conditions = self.conditions
        if bad == "loose_cable":
            shown[channel] *= rng.uniform(0.4, 0.9)
        elif bad == "noisy":
            noise = [n * (20 if i == channel else 1) for i, n in enumerate(conditions.noise)]
            conditions = replace(conditions, noise=tuple(noise))
        overload = (record, blow) in self.overloaded() or bad == "clipped"
        return recorded(self.rig.chain, conditions, force, shown, rng, overload)

    def frf(self, record: int) -> Frf:
        """The record's frequency responses as an analyser would give them, blows with an overload rejected."""
        spoilt = self.overloaded()
        blows = [b for b in range(self.conditions.blows) if (record, b) not in spoilt]
        recordings = [self.recording(record, b) for b in blows]
        return estimated(np.array([f for f, _ in recordings]), np.array([a for _, a in recordings]))


def estimated(forces: Array, responses: Array) -> Frf:
    """H1 and coherence of blows, boxcar over the whole block, up to 500 Hz."""
    freq = np.asarray(np.fft.rfftfreq(forces.shape[-1], 1 / FS), dtype=np.float64)
    lines = freq <= 500.0
    f = np.fft.rfft(forces, axis=-1)[:, lines]
    a = np.fft.rfft(responses, axis=-1)[..., lines]
    power = np.sum(np.abs(f) ** 2, axis=0)
    cross = np.sum(a * f[:, None].conj(), axis=0)
    coherence = np.abs(cross) ** 2 / (power * np.sum(np.abs(a) ** 2, axis=0))
    return Frf(freq[lines], cross / power, coherence, len(forces))


def quiet_response(campaign: Campaign, record: int, freq: Array) -> Complex:
    """A record's frequency responses by its first blow, without noise and calibration errors."""
    force, response = campaign.answer(record, 0)
    chain = campaign.rig.chain
    count = round(BLOCK * FS)
    late = np.random.default_rng([campaign.seed, _LATE, record, 0]).standard_normal() * chain.jitter
    shown = sensed(chain, campaign.names, force, response, late)
    if chain.mains:
        shown = shown + mains_interference(chain, len(shown), np.random.default_rng([campaign.seed, _NOISE, record, 0]))
    on_force, on_responses = windowed(chain.window, np.arange(count) / FS)
    lines = np.round(freq * BLOCK).astype(int)
    f, a = (np.fft.rfft(x, axis=-1)[..., lines] for x in (force[:count] * on_force, shown * on_responses))
    return np.asarray(a / f)


def force_power(campaign: Campaign, record: int, freq: Array) -> Array:
    """Power of a record's first blow."""
    force = campaign.answer(record, 0)[0][: round(BLOCK * FS)]
    return np.asarray(np.abs(np.fft.rfft(force)[np.round(freq * BLOCK).astype(int)]) ** 2)


def conditions_label(campaign: Campaign) -> Mapping[str, object]:
    """What of the conditions goes into the label."""
    c = campaign.conditions
    return {
        "positions": list(c.positions),
        "levels": list(c.levels),
        "blows": c.blows,
        "channels": list(c.channels),
        "format": c.file_format,
        "noise": list(c.noise),
        "bits": c.bits,
        "overloads": c.overloads,
        "repeatability": asdict(c.repeatability),
        "coupling": list(c.coupling),
        "hammer": c.hammer,
        "bad_records": [list(b) for b in c.bad],
    }
