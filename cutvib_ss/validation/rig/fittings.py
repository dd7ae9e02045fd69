"""What may be fitted to the virtual machine, by fault or design. Plain data."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]

_TERM = re.compile(r"([+-]?)\s*(?:([\d.]+(?:e-?\d+)?)\s*\*\s*)?([a-z]\w*(?:@[\d.]+)?)")


def combination(port: str) -> Mapping[str, float]:
    """
    Ports and their coefficients in an expression.

    >>> combination("0.9*tool_x+0.4*tool_z-base_x")
    {'tool_x': 0.9, 'tool_z': 0.4, 'base_x': -1.0}
    """
    return {name: float(f"{sign}{factor or 1.0}") for sign, factor, name in _TERM.findall(port)}


@dataclass(frozen=True)
class Supports:
    """Springs and dampers under the rail's ends."""

    k_left: float  # Stiffness [N/m]
    k_right: float
    c_left: float = 0.0  # Damping [N s/m]
    c_right: float = 0.0


@dataclass(frozen=True)
class Twist:
    """A rail that twists."""

    eccentricity: float  # Distance in Z of the head's first joint from the shear centre [m]
    inertia: float  # Polar moment of inertia of the whole rail [kg m^2]
    torsion_frequency: float  # First frequency of torsion, without the head [Hz]
    damping_ratio: float  # Damping ratio of that mode; damping goes with the rate of strain
    ends: float = np.inf  # Springs that hold the ends' twist, over the stiffness of the whole shaft; infinite: held
    # Stiffness of the shaft over what the frequency says; for a rail that rocks on its ends as one
    stiffer: float = 1.0
    # Change of the eccentricity from the middle to the right end, relative; the left end changes the other way
    slope: float = 0.0

    def at(self, position: float) -> float:
        """Eccentricity [m] where the head is, y_b / L."""
        return self.eccentricity * (1 + self.slope * (2 * position - 1))


@dataclass(frozen=True)
class Shear:
    """Timoshenko's beam."""

    shear_ratio: float  # κGA L²/(π² EI)
    modulus_ratio: float  # κG/E of section and material; with the shear ratio it gives the rotary inertia
    # The part of the rail, y / L, that shears; the rest is fifty times as stiff
    soft: tuple[float, float] | None = None


@dataclass(frozen=True)
class Lump:
    """A mass on the rail."""

    position: float  # Where, y / L
    mass: float  # Mass [kg]
    damping: float  # Damping to ground [N s/m]


@dataclass(frozen=True)
class Crack:
    """A hinge in the rail."""

    position: float  # Where, y / L
    stiffness: float  # Rotational spring that holds it [N m/rad]


@dataclass(frozen=True)
class Spring:
    """A spring and damper between two places."""

    ends: tuple[str, str]  # Two of ``"tool"``, ``"head"``, ``"base"`` and ``"ground"``
    axis: str  # ``"x"`` or ``"z"``
    stiffness: float  # Stiffness [N/m]
    damping: float = 0.0  # Damping [N s/m]


@dataclass(frozen=True)
class Tie:
    """Spring, damper and inertance along a port or a combination of ports."""

    port: str  # Along what, `combination`
    stiffness: float = 0.0  # Of its ends' difference [N/m, N s/m, kg, or N m/rad …]
    damping: float = 0.0
    mass: float = 0.0


@dataclass(frozen=True)
class Bob:
    """A mass on a spring and damper along a port or a combination of ports."""

    port: str  # Along what, `combination`
    mass: float  # Mass [kg]
    frequency: float  # Natural frequency [Hz]
    damping_ratio: float  # Damping ratio


@dataclass(frozen=True)
class Skew:
    """Two ports that a spinning rotor couples: each feels the other's rate, with opposite signs."""

    one: str  # The ports
    other: str
    # Spin times moment of inertia, over what turns rates of the ports into rates of the rotor's tilt [N s/m]
    coefficient: float


@dataclass(frozen=True)
class Lossy:
    """A linear element that has no matrices: its force is -z(s) times the motion that it senses."""

    port: str  # Where its force acts, `combination`
    # ``"constant"`` (c): z = i c. ``"power"`` (c, order): c s^order. ``"storage"`` (k, ω0, order): what takes k's
    # place is k (s/ω0)^order over cos(π order/2). ``"log"`` (k η, ω0): k η (2/π) ln(s/ω0), causal with a loss that
    # does not change. ``"maxwell"`` (k, τ): k s τ/(1 + s τ). ``"wave"`` (impedance, travel time, decay): a string
    # with its far end held. ``"feedback"`` (kp, kd, delay): (kp + kd s) e^(-s delay)
    kind: str
    values: tuple[float, ...]  # Its values
    sense: str | None = None  # Whose motion it answers; its own port's by default

    def stiffness(self, s: Complex) -> Complex:
        """Dynamic stiffness z at complex frequencies s [rad/s]."""
        v = self.values
        z: Complex
        if self.kind == "constant":
            z = np.full_like(s, 1j * v[0])
        elif self.kind == "power":
            z = v[0] * s ** v[1]
        elif self.kind == "storage":
            z = v[0] * ((s / v[1]) ** v[2] / np.cos(np.pi * v[2] / 2) - 1)
        elif self.kind == "log":
            z = np.asarray(v[0] * 2 / np.pi * np.log(s / v[1]), dtype=np.complex128)
        elif self.kind == "maxwell":
            z = v[0] * s * v[1] / (1 + s * v[1])
        elif self.kind == "wave":
            lost = s + v[2]
            z = v[0] * lost / np.tanh(lost * v[1])
        else:
            z = (v[0] + v[1] * s) * np.exp(-s * v[2])
        return np.asarray(z, dtype=np.complex128)


@dataclass(frozen=True)
class Law:
    """A nonlinear element."""

    port: str  # A port or a combination of ports, `combination`
    kind: str  # Its law (`laws.KINDS`)
    values: tuple[float, ...]  # Its values (`laws.force`)


@dataclass(frozen=True)
class Fittings:
    """What is fitted to the plain machine; nothing by default."""

    supports: Supports | None = None  # Springs under the rail's ends
    fixity: tuple[float, float] = (0.0, 0.0)  # Rotational springs at the ends [N m/rad]
    twist: Twist | None = None  # A rail that twists
    shear: Shear | None = None  # A rail that shears
    lumps: tuple[Lump, ...] = ()  # Masses on the rail
    crack: Crack | None = None  # A crack in the rail
    # Stiffness [N/m] and damping [N s/m] of a guide that gives between rail and head
    guide: tuple[float, float] | None = None
    springs: tuple[Spring, ...] = ()  # Springs between places
    coupling: float = 0.0  # Spring on the difference of the joints' angles [N m/rad]
    ties: tuple[Tie, ...] = ()  # Springs, dampers and inertances along ports
    bobs: tuple[Bob, ...] = ()  # Sprung masses along ports
    skews: tuple[Skew, ...] = ()  # Gyroscopic couplings
    lossy: tuple[Lossy, ...] = ()  # Linear elements without matrices
    laws: tuple[Law, ...] = ()  # Nonlinear elements

    @property
    def rail_ports(self) -> tuple[str, ...]:
        """Ports on the rail that something is fitted to: ``"rail_left"``, ``"turn_right"``, ``"rail@0.25"`` …"""
        elements: tuple[Tie | Bob | Lossy | Law, ...] = (*self.ties, *self.bobs, *self.lossy, *self.laws)
        used = [e.port for e in elements]
        used += [e.sense for e in self.lossy if e.sense] + [p for e in self.skews for p in (e.one, e.other)]
        names = {name for port in used for name in combination(port)}
        return tuple(sorted(n for n in names if n.startswith(("rail_", "rail@", "turn_"))))
