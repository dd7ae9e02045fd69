"""What the virtual machine is made of: the head, the rail, faults of the measurement chain. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from cutvib_ss.blind.rig.fittings import Fittings

JOINTS = ("joint1", "joint2")

TOLERANCE: Mapping[str, float] = {
    "m1": 0.005, "m2": 0.01, "l1": 0.003, "l2": 0.003, "k1": 0.01, "k2": 0.01, "c1": 0.1, "c2": 0.1,
    "mass": 0.005, "first_frequency": 0.005, "damping_ratio": 0.15, "calibration": 0.01,
}  # fmt: skip
"""One standard deviation of what a builder knows of each value, as a fraction of it; the angles are exact."""


@dataclass(frozen=True)
class Head:
    """
    The two-link head (Table 3 of the paper).

    Parameters
    ----------
    m1, m2 : float
        Masses at the links' tips [kg].
    l1, l2 : float
        Lengths of the links [m].
    theta01_deg, theta02_deg : float
        Angles at rest [degrees].
    k1, k2 : float
        Stiffness of the joints [N m/rad].
    c1, c2 : float
        Damping of the joints [N m s/rad].
    """

    m1: float = 24.88
    m2: float = 0.60
    l1: float = 0.097
    l2: float = 0.096
    theta01_deg: float = 0.65
    theta02_deg: float = 110.0
    k1: float = 522100.0
    k2: float = 10442.0
    c1: float = 44.20
    c2: float = 0.58


@dataclass(frozen=True)
class Rail:
    """
    The rail between pins.

    Parameters
    ----------
    length : float
        Length [m].
    mass : float
        Mass of the whole rail [kg].
    first_frequency : float
        First natural frequency without the head [Hz].
    damping_ratio : float
        Damping ratio of every mode.
    truncation : int, optional
        Leave only so many modes: not a rail, but a model of one, to see what truncation hides.
    """

    length: float = 2.5
    mass: float = 76.5
    first_frequency: float = 31.7
    damping_ratio: float = 0.01
    truncation: int | None = None


@dataclass(frozen=True)
class Chain:
    """
    What the measurement chain does that it should not; nothing by default.

    Parameters
    ----------
    delays : mapping of str to float
        How late a channel is [s].
    gains : mapping of str to float
        Factor on a channel.
    saturation : mapping of str to float
        Level at which a channel's sensor saturates softly [m/s^2].
    mounts : mapping of str to (float, float)
        Resonance [Hz] and damping ratio of a channel's loose mount.
    cross_axis : float
        Fraction of X that leaks into Z.
    decay_rate : float
        Of an exponential window on force and response that is never taken out [1/s].
    jitter : float
        Standard deviation of how late the responses of a blow are [s].
    hum : tuple of float
        Amplitudes of 50 Hz and its harmonics [m/s^2].
    """

    delays: Mapping[str, float] = field(default_factory=dict)
    gains: Mapping[str, float] = field(default_factory=dict)
    saturation: Mapping[str, float] = field(default_factory=dict)
    mounts: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    cross_axis: float = 0.0
    decay_rate: float = 0.0
    jitter: float = 0.0
    hum: tuple[float, ...] = ()


@dataclass(frozen=True)
class Rig:
    """
    A machine as it stands in the workshop.

    Parameters
    ----------
    head : Head
        The head.
    rail : Rail
        The rail.
    fittings : Fittings
        What is fitted to them.
    chain : Chain
        Faults of the measurement chain.
    drift : mapping of str to float
        By how much named values of head and rail have changed, as a fraction, at the end of the campaign; they change evenly
        from record to record.
    """

    head: Head = field(default_factory=Head)
    rail: Rail = field(default_factory=Rail)
    fittings: Fittings = field(default_factory=Fittings)
    chain: Chain = field(default_factory=Chain)
    drift: Mapping[str, float] = field(default_factory=dict)

    @property
    def linear(self) -> bool:
        """Whether every element of the machine is linear (the measurement chain may not be)."""
        return not self.fittings.laws

    def fitted(self, **changes: Any) -> Rig:
        """
        The machine with fittings replaced.

        Parameters
        ----------
        **changes
            Fields of `Fittings`.

        Returns
        -------
        Rig
            The machine.
        """
        return replace(self, fittings=replace(self.fittings, **changes))

    def measured(self, **changes: Any) -> Rig:
        """
        The machine with faults of the measurement chain replaced.

        Parameters
        ----------
        **changes
            Fields of `Chain`.

        Returns
        -------
        Rig
            The machine.
        """
        return replace(self, chain=replace(self.chain, **changes))

    def value(self, name: str) -> float:
        """
        A value of head or rail.

        Parameters
        ----------
        name : str
            Its name.

        Returns
        -------
        float
            The value.
        """
        return float(getattr(self.head if name in HEAD_NAMES else self.rail, name))

    def scaled(self, factors: Mapping[str, float]) -> Rig:
        """
        The machine with values of head and rail times factors.

        Parameters
        ----------
        factors : mapping of str to float
            Factors by name.

        Returns
        -------
        Rig
            The machine.
        """
        new = {name: self.value(name) * factor for name, factor in factors.items()}
        head: dict[str, Any] = {name: value for name, value in new.items() if name in HEAD_NAMES}
        rail: dict[str, Any] = {name: value for name, value in new.items() if name not in HEAD_NAMES}
        return replace(self, head=replace(self.head, **head), rail=replace(self.rail, **rail))

    def at(self, progress: float) -> Rig:
        """
        The machine at a stage of the campaign.

        Parameters
        ----------
        progress : float
            0 at its first record, 1 at its last.

        Returns
        -------
        Rig
            The machine, its drift done.
        """
        if not self.drift:
            return self
        return replace(self.scaled({name: 1 + change * progress for name, change in self.drift.items()}), drift={})


HEAD_NAMES = tuple(f.name for f in fields(Head))


def scattered(rig: Rig, rng: np.random.Generator) -> Rig:
    """
    A machine as built: every value drawn about its nominal one within the tolerance.

    Parameters
    ----------
    rig : Rig
        The nominal machine.
    rng : numpy.random.Generator
        Generator.

    Returns
    -------
    Rig
        The machine as built.
    """
    names = [name for name in TOLERANCE if name != "calibration"]
    return rig.scaled({name: float(np.exp(TOLERANCE[name] * rng.standard_normal())) for name in names})
