"""How far a machine repeats: values that move between sessions and records, and with the temperature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from cutvib_ss.validation.rig.structure import TOLERANCE

_STREAM = 20
RARELY = 0.04
"""Part of the machines that do not repeat to better than 5 to 10 %."""
_WITHIN = 0.3
"""Movement from record to record of one session over that between sessions."""

CUTTING_MACHINE: Mapping[str, float] = {"k1": 1.0, "k2": 1.0, "first_frequency": 0.5} | {
    name: TOLERANCE[name] / TOLERANCE["k1"] for name in ("c1", "c2", "damping_ratio")
}
"""Relative standard deviation of each value over the drift that is stated: that of stiffnesses. Masses and lengths stay."""

STRUCTURE: Mapping[str, float] = {"stiffness": 1.0, "damping": 10.0}
"""The same of another structure's matrices."""

WARMS: Mapping[str, float] = {"k1": 1.0, "k2": 1.0, "first_frequency": 0.5, "stiffness": 1.0}
"""What the temperature moves, and by how much of the change of all stiffnesses."""


@dataclass(frozen=True)
class Repeatability:
    """How far the machine moves during a campaign; by default it does not."""

    drift: float = 0.0  # Relative standard deviation between sessions of every stiffness and every gain
    within: float = 0.0  # The same between the records of one session
    temperature: float = 0.0  # Relative change of all stiffnesses together over the campaign
    stated: float | None = None  # What machine.toml says of it, `[tolerance] drift`; left out where None
    days: int = 0  # Sessions that the records state, each of several positions; 0 where they state none

    @property
    def moves(self) -> bool:
        """Whether anything moves."""
        return self.drift > 0 or self.within > 0 or self.temperature != 0


def draw_repeatability(rng: np.random.Generator, stated: bool, low: float = 0.001, high: float = 0.02) -> Repeatability:
    """Draw a drift, even in its logarithm, rarely of a tenth; half of the machines warm up too, half move within a session."""
    drift = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    if rng.random() < RARELY:
        drift = float(rng.uniform(0.05, 0.1))
    warm = drift * float(rng.uniform(-3.0, 3.0)) if rng.random() < 0.5 else 0.0
    within = _WITHIN * drift if rng.random() < 0.5 else 0.0
    told = float(f"{drift * np.exp(0.2 * rng.standard_normal()):.2g}") if stated else None
    return Repeatability(drift, within, warm, told)


@dataclass(frozen=True)
class State:
    """Factors on the machine's values and on the gains of the channels during one record."""

    values: Mapping[str, float]
    gains: tuple[float, ...]


def states(
    r: Repeatability, sessions: tuple[int, ...], changes: Mapping[str, float], channels: int, seed: int
) -> tuple[State, ...]:
    """State of the machine during each record, given the session that each belongs to and the values that can change."""
    rng = np.random.default_rng([seed, _STREAM])
    count, last = max(sessions) + 1, max(len(sessions) - 1, 1)
    names = list(changes)
    size = np.array([*changes.values(), *[1.0] * channels])
    between = r.drift * rng.standard_normal((count, size.size))
    inside = r.within * rng.standard_normal((len(sessions), size.size))
    bow = 0.3 * rng.standard_normal()
    out = []
    for i, session in enumerate(sessions):
        logs = (between[session] + inside[i]) * size
        x = i / last
        warm = r.temperature * (x + bow * x * (1 - x))
        values = {name: float(np.exp(logs[k] + warm * WARMS.get(name, 0.0))) for k, name in enumerate(names)}
        out.append(State(values, tuple(float(np.exp(x)) for x in logs[len(names) :])))
    return tuple(out)
