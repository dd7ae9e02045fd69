"""What the virtual machine is made of: the head, the rail, faults of the measurement chain. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Protocol, Self

import numpy as np

from cutvib_ss.validation.rig.fittings import Fittings

JOINTS = ("joint1", "joint2")
CHANNELS = ("tool_x", "tool_z", "base_x")
"""Response channels of the cutting machine."""

TOLERANCE: Mapping[str, float] = {
    "m1": 0.005, "m2": 0.01, "l1": 0.003, "l2": 0.003, "k1": 0.01, "k2": 0.01, "c1": 0.1, "c2": 0.1,
    "mass": 0.005, "first_frequency": 0.005, "damping_ratio": 0.15, "calibration": 0.01,
}  # fmt: skip
"""One standard deviation of what a builder knows of each value, as a fraction of it; the angles are exact."""


@dataclass(frozen=True)
class Head:
    """The two-link head (Table 3 of the paper)."""

    m1: float = 24.88  # Masses at the links' tips [kg]
    m2: float = 0.60
    l1: float = 0.097  # Lengths of the links [m]
    l2: float = 0.096
    theta01_deg: float = 0.65  # Angles at rest [degrees]
    theta02_deg: float = 110.0
    k1: float = 522100.0  # Stiffness of the joints [N m/rad]
    k2: float = 10442.0
    c1: float = 44.20  # Damping of the joints [N m s/rad]
    c2: float = 0.58


@dataclass(frozen=True)
class Rail:
    """The rail between pins."""

    length: float = 2.5  # Length [m]
    mass: float = 76.5  # Mass of the whole rail [kg]
    first_frequency: float = 31.7  # First natural frequency without the head [Hz]
    damping_ratio: float = 0.01  # Damping ratio of every mode
    damping_slope: float = 0.0  # Relative growth of the damping ratio over a factor of e of the modes' frequencies
    # Leave only so many modes: not a rail, but a model of one, to see what truncation hides
    truncation: int | None = None


@dataclass(frozen=True)
class Channel:
    """What a response channel reads."""

    name: str  # Its name
    port: str  # Where
    order: int = 2  # 0 for displacement, 1 for velocity, 2 for acceleration


@dataclass(frozen=True)
class Filter:
    """What a channel's instrument does to its signal."""

    # ``"lowpass"``, ``"bessel"`` (a second-order filter with the flattest delay), ``"highpass"``, ``"resonance"``, or
    # ``"slope"``: a gain that grows with the logarithm of frequency, 1 at ``freq``
    kind: str
    freq: float  # Corner or resonance [Hz]
    value: float = 0.0  # Damping ratio of a resonance; of a slope the relative change over a factor of ten


@dataclass(frozen=True)
class Window:
    """What is laid over a record and never taken out."""

    # ``"exponential"`` on force and responses, ``"late"`` (exponential on the responses alone, from `start` on),
    # ``"taper"`` (the tail fades out from `start` on as half a cosine, within 1/rate), ``"cut"`` (nothing after
    # `start`)
    kind: str
    rate: float = 0.0  # Decay rate [1/s]
    start: float = 0.0  # When it begins [s]


@dataclass(frozen=True)
class Chain:
    """What the measurement chain does that it should not; nothing by default."""

    delays: Mapping[str, float] = field(default_factory=dict)  # How late a channel is [s]
    gains: Mapping[str, float] = field(default_factory=dict)  # Factor on a channel
    # Level at which a channel's sensor saturates softly [m/s^2]
    saturation: Mapping[str, float] = field(default_factory=dict)
    # Level at which the square of a channel's signal is as large as the signal [m/s^2]
    asymmetry: Mapping[str, float] = field(default_factory=dict)
    filters: Mapping[str, tuple[Filter, ...]] = field(default_factory=dict)  # What a channel's instrument does
    cross_axis: float = 0.0  # Fraction of X that leaks into Z
    # Other leaks: into which channel, from which, what fraction, and the frequency at which it is that large where it
    # grows in proportion to frequency (0: it does not) [Hz]
    tilts: tuple[tuple[str, str, float, float], ...] = ()
    window: Window | None = None  # A window that is never taken out
    jitter: float = 0.0  # Standard deviation of how late the responses of a blow are [s]
    mains: tuple[float, ...] = ()  # Amplitudes of 50 Hz and its harmonics [m/s^2]
    feedthrough: float = 0.0  # Part of the force's signal that the responses pick up [m/s^2/N]
    clock: float = 0.0  # By what fraction the responses' clock runs fast
    # Zero shift of the sensors after a shock, over its peak, and how fast it decays [1/s]
    shift: tuple[float, float] = (0.0, 1.0)


class Machinery(Protocol):
    """What a campaign needs of a machine, cutting machine or other structure."""

    @property
    def fittings(self) -> Fittings:
        """What is fitted to it."""

    @property
    def chain(self) -> Chain:
        """Faults of its measurement chain."""

    @property
    def drift(self) -> Mapping[str, float]:
        """Values that change evenly during the campaign."""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What its response channels read."""

    @property
    def drive(self) -> str:
        """Port that is struck."""

    @property
    def linear(self) -> bool:
        """Whether every element of it is linear."""

    def at(self, progress: float) -> Self:
        """The machine at a stage of the campaign, from 0 to 1."""

    def moved(self, factors: Mapping[str, float]) -> Self:
        """The machine with stiffnesses and dampings times factors: of ``"stiffness"``, ``"damping"`` or of one value by name."""


@dataclass(frozen=True)
class Rig:
    """A cutting machine as it stands in the workshop."""

    head: Head = field(default_factory=Head)  # The head
    rail: Rail = field(default_factory=Rail)  # The rail
    fittings: Fittings = field(default_factory=Fittings)  # What is fitted to them
    chain: Chain = field(default_factory=Chain)  # Faults of the measurement chain
    lean: float = 0.0  # Part of each blow that goes along the machine, over that which goes down
    # By how much named values of head and rail have changed, as a fraction, at the end of the campaign; they change
    # evenly from record to record
    drift: Mapping[str, float] = field(default_factory=dict)

    @property
    def linear(self) -> bool:
        """Whether every element of the machine is linear (the measurement chain may not be)."""
        return not self.fittings.laws

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Accelerations of tool and base."""
        return tuple(Channel(name, name) for name in CHANNELS)

    @property
    def drive(self) -> str:
        """The hammer strikes the tool."""
        return f"tool_x{self.lean:+.5f}*tool_z" if self.lean else "tool_x"

    def moved(self, factors: Mapping[str, float]) -> Rig:
        """The machine with named values times factors, its own drift done."""
        return replace(self.scaled(factors), drift={})

    def fitted(self, **changes: Any) -> Rig:
        """The machine with fittings replaced."""
        return replace(self, fittings=replace(self.fittings, **changes))

    def measured(self, **changes: Any) -> Rig:
        """The machine with faults of the measurement chain replaced."""
        return replace(self, chain=replace(self.chain, **changes))

    def value(self, name: str) -> float:
        """A value of head or rail."""
        return float(getattr(self.head if name in HEAD_NAMES else self.rail, name))

    def scaled(self, factors: Mapping[str, float]) -> Rig:
        """The machine with values of head and rail times factors."""
        new = {name: self.value(name) * factor for name, factor in factors.items()}
        head: dict[str, Any] = {name: value for name, value in new.items() if name in HEAD_NAMES}
        rail: dict[str, Any] = {name: value for name, value in new.items() if name not in HEAD_NAMES}
        return replace(self, head=replace(self.head, **head), rail=replace(self.rail, **rail))

    def at(self, progress: float) -> Rig:
        """The machine at a stage of the campaign."""
        if not self.drift:
            return self
        return replace(self.scaled({name: 1 + change * progress for name, change in self.drift.items()}), drift={})


HEAD_NAMES = tuple(f.name for f in fields(Head))


def scattered(rig: Rig, rng: np.random.Generator) -> Rig:
    """A machine as built: every value drawn about its nominal one within the tolerance."""
    names = [name for name in TOLERANCE if name != "calibration"]
    return rig.scaled({name: float(np.exp(TOLERANCE[name] * rng.standard_normal())) for name in names})
