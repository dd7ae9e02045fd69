"""What the virtual machine is made of: the head, the rail, what is fitted to them, the measurement chain. Plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

JOINTS = ("joint1", "joint2")

TOLERANCE: Mapping[str, float] = {
    "m1": 0.005, "m2": 0.01, "l1": 0.003, "l2": 0.003, "k1": 0.01, "k2": 0.01, "c1": 0.1, "c2": 0.1,
    "mass": 0.005, "first_frequency": 0.005, "damping_ratio": 0.15, "calibration": 0.01,
}  # fmt: skip
"""One standard deviation of what a builder knows of each value, as a fraction of it; the angles are exact."""


@dataclass(frozen=True)
class Head:
    """The two-link head (Table 3 of the paper): SI units, angles in degrees."""

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
    The rail between pins: length [m], whole mass [kg], first frequency without the head [Hz], modal damping ratio.

    A `truncation` leaves only so many modes: not a rail, but a model of one, to see what truncation hides.
    """

    length: float = 2.5
    mass: float = 76.5
    first_frequency: float = 31.7
    damping_ratio: float = 0.01
    truncation: int | None = None


@dataclass(frozen=True)
class Supports:
    """Springs [N/m] and dampers [N s/m] under the rail's ends."""

    k_left: float
    k_right: float
    c_left: float = 0.0
    c_right: float = 0.0


@dataclass(frozen=True)
class Twist:
    """A rail that twists: eccentricity of the head [m], polar inertia of the rail [kg m^2], first frequency [Hz], damping."""

    eccentricity: float
    inertia: float
    torsion_frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Shear:
    """Timoshenko's beam: κGA L²/(π² EI), and κG/E of section and material, which gives the rotary inertia."""

    shear_ratio: float
    modulus_ratio: float


@dataclass(frozen=True)
class Lump:
    """A mass [kg] at y / L of the rail, with a damper to ground [N s/m]."""

    position: float
    mass: float
    damping: float


@dataclass(frozen=True)
class Crack:
    """A hinge in the rail at y / L: a rotational spring [N m/rad] in series with the bending."""

    position: float
    stiffness: float


@dataclass(frozen=True)
class Oscillator:
    """A sprung mass on ``"tool"`` or ``"head"``, along ``"x"`` or ``"z"``: kg, Hz, damping ratio."""

    place: str
    axis: str
    mass: float
    frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Spring:
    """A spring and damper in X or Z between two of ``"tool"``, ``"head"``, ``"base"`` and ``"ground"``: N/m, N s/m."""

    ends: tuple[str, str]
    axis: str
    stiffness: float
    damping: float = 0.0


@dataclass(frozen=True)
class Viscoelastic:
    """A torque in a joint that is stiffness·loss·i [hysteretic, order 0] or coefficient·(iω)^order [fractional]."""

    joint: str
    coefficient: float
    order: float


@dataclass(frozen=True)
class Law:
    """A nonlinear element at a port (`motion.ports`): its kind and up to four values (`laws`)."""

    port: str
    kind: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class Fittings:
    """What is fitted to the plain machine; nothing by default."""

    supports: Supports | None = None
    fixity: tuple[float, float] = (0.0, 0.0)
    twist: Twist | None = None
    shear: Shear | None = None
    lumps: tuple[Lump, ...] = ()
    crack: Crack | None = None
    guide: tuple[float, float] | None = None
    oscillators: tuple[Oscillator, ...] = ()
    springs: tuple[Spring, ...] = ()
    coupling: float = 0.0
    viscoelastic: tuple[Viscoelastic, ...] = ()
    laws: tuple[Law, ...] = ()


@dataclass(frozen=True)
class Chain:
    """
    What the measurement chain does that it should not; nothing by default.

    Delays [s], gains, saturation levels [m/s^2] and loose mounts (resonance [Hz], damping ratio) by channel; `jitter` is
    the standard deviation of how late the responses of a blow are [s]; `hum` is amplitudes [m/s^2] of 50 Hz and its harmonics;
    `decay_rate` [1/s] is of an exponential window on force and response that is never taken out.
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

    `drift` is by how much named values of head and rail have changed (as a fraction) at the end of the campaign; they
    change evenly from record to record.
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
        """The machine with fittings replaced."""
        return replace(self, fittings=replace(self.fittings, **changes))

    def measured(self, **changes: Any) -> Rig:
        """The machine with the measurement chain replaced."""
        return replace(self, chain=replace(self.chain, **changes))

    def value(self, name: str) -> float:
        """A value of head or rail by its name."""
        return float(getattr(self.head if name in HEAD_NAMES else self.rail, name))

    def scaled(self, factors: Mapping[str, float]) -> Rig:
        """The machine with values of head and rail times factors."""
        new = {name: self.value(name) * factor for name, factor in factors.items()}
        head: dict[str, Any] = {name: value for name, value in new.items() if name in HEAD_NAMES}
        rail: dict[str, Any] = {name: value for name, value in new.items() if name not in HEAD_NAMES}
        return replace(self, head=replace(self.head, **head), rail=replace(self.rail, **rail))

    def at(self, progress: float) -> Rig:
        """The machine at a stage of the campaign, 0 to 1."""
        if not self.drift:
            return self
        return replace(self.scaled({name: 1 + change * progress for name, change in self.drift.items()}), drift={})


HEAD_NAMES = tuple(f.name for f in fields(Head))


def scattered(rig: Rig, rng: np.random.Generator) -> Rig:
    """A machine as built: every value drawn about its nominal one within the tolerance."""
    names = [name for name in TOLERANCE if name != "calibration"]
    return rig.scaled({name: float(np.exp(TOLERANCE[name] * rng.standard_normal())) for name in names})
