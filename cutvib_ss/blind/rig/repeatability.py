"""How far a machine repeats: values that move between sessions and records, and with the temperature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.blind.rig.structure import TOLERANCE, Rig

_STREAM = 20
_WITHIN = 0.3
"""Movement from record to record of one session over that between sessions."""

_CHANGES: Mapping[str, float] = {"k1": 1.0, "k2": 1.0, "first_frequency": 0.5} | {
    name: TOLERANCE[name] / TOLERANCE["k1"] for name in ("c1", "c2", "damping_ratio")
}
"""Relative standard deviation of each value over the drift that is stated: that of stiffnesses. Masses and lengths stay."""


@dataclass(frozen=True)
class Repeatability:
    """
    How far the machine moves during a campaign; by default it does not.

    Parameters
    ----------
    drift : float
        Relative standard deviation between sessions of every stiffness and every gain.
    within : float
        The same between the records of one session.
    temperature : float
        Relative change of all stiffnesses together over the campaign.
    stated : float, optional
        What machine.toml says of it, `[tolerance] drift`; left out where None.
    """

    drift: float = 0.0
    within: float = 0.0
    temperature: float = 0.0
    stated: float | None = None

    @property
    def moves(self) -> bool:
        """Whether anything moves."""
        return self.drift > 0 or self.within > 0 or self.temperature != 0


def draw_repeatability(rng: np.random.Generator, low: float, high: float, stated: bool) -> Repeatability:
    """Draw a drift, even in its logarithm; half of the machines warm up too, half move within a session."""
    drift = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    warm = drift * float(rng.uniform(-3.0, 3.0)) if rng.random() < 0.5 else 0.0
    within = _WITHIN * drift if rng.random() < 0.5 else 0.0
    told = float(f"{drift * np.exp(0.2 * rng.standard_normal()):.2g}") if stated else None
    return Repeatability(drift, within, warm, told)


@dataclass(frozen=True)
class State:
    """Factors on the machine's values and on the gains of the channels during one record."""

    values: Mapping[str, float]
    gains: tuple[float, ...]


def states(r: Repeatability, sessions: tuple[int, ...], channels: int, seed: int) -> tuple[State, ...]:
    """State of the machine during each record, given the session that each belongs to."""
    rng = np.random.default_rng([seed, _STREAM])
    count, last = max(sessions) + 1, max(len(sessions) - 1, 1)
    names = list(_CHANGES)
    size = np.array([_CHANGES[name] for name in names] + [1.0] * channels)
    between = r.drift * rng.standard_normal((count, size.size))
    inside = r.within * rng.standard_normal((len(sessions), size.size))
    bow = 0.3 * rng.standard_normal()
    out = []
    for i, session in enumerate(sessions):
        logs = (between[session] + inside[i]) * size
        x = i / last
        warm = r.temperature * (x + bow * x * (1 - x))
        warm_by_name = {"k1": warm, "k2": warm, "first_frequency": warm / 2}
        values = {name: float(np.exp(logs[k] + warm_by_name.get(name, 0.0))) for k, name in enumerate(names)}
        out.append(State(values, tuple(float(np.exp(x)) for x in logs[len(names) :])))
    return tuple(out)


def at_rest(rig: Rig, state: State) -> Rig:
    """The machine in one state."""
    return replace(rig.scaled(state.values), drift={})
