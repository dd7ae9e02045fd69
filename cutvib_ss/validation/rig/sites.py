"""Where a cause sits, how much moves there, and draws that all causes share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from cutvib_ss.validation.rig.blows import FS, Blow, Pulse, antialiased
from cutvib_ss.validation.rig.fittings import Law
from cutvib_ss.validation.rig.frames import Frame
from cutvib_ss.validation.rig.motion import linear_answer, modes, receptance
from cutvib_ss.validation.rig.structure import JOINTS, Channel, Rig

Parameters: TypeAlias = Mapping[str, float | str]
AnyMachine: TypeAlias = Rig | Frame
Made: TypeAlias = tuple[AnyMachine, str, Parameters]
Maker: TypeAlias = Callable[[AnyMachine, float, np.random.Generator], Made]

TYPICAL = 2 * np.pi * 220.0
"""Angular frequency of the head's pair of modes [rad/s]."""

MIDDLE = float(np.sqrt(15.0 * 450.0))
"""Middle of the band [Hz]."""

SWING = {"joint1": 3.0e-5, "joint2": 4.0e-4}
"""Peak deflection of the joints under a blow of 100 N [rad]."""


@dataclass(frozen=True)
class Form:
    """One physical form of a cause."""

    name: str  # Its name
    grade: int  # How far it is from the catalogue's: 0 its own, 1 near it, 2 another, 3 of its kind only
    # Of the machine, the severity (1 is what an engineer would call a clear fault) and a generator: the machine with
    # the fault, its place and its parameters
    make: Maker


@dataclass(frozen=True)
class Site:
    """A joint, or a port of another structure."""

    place: str  # Its name
    stiffness: float  # Of the spring and damper there [N m/rad and N m s/rad, or N/m and N s/m]
    damping: float
    swing: float  # Peak deflection under a blow of 100 N [rad or m]
    omega: float  # Angular frequency of most of its motion [rad/s]

    @property
    def rate(self) -> float:
        """Peak rate under a blow of 100 N."""
        return self.swing * self.omega


def either(rng: np.random.Generator) -> float:
    """Draw a sign."""
    return float(rng.choice([-1.0, 1.0]))


def about(rng: np.random.Generator, value: float, spread: float = 0.3) -> float:
    """Draw a value about another, even in its logarithm, which may go so far either way."""
    return float(value * np.exp(spread * rng.uniform(-1, 1)))


def site(machine: AnyMachine, rng: np.random.Generator, share: float = 0.4, spring: bool = False) -> Site:
    """Draw a joint (joint 1 with a probability), or a port of another structure, one with a spring of its own if that is asked."""
    if isinstance(machine, Rig):
        place = JOINTS[0 if rng.random() < share else 1]
        k, c = machine.value("k" + place[-1]), machine.value("c" + place[-1])
        return Site(place, k, c, SWING[place], TYPICAL)
    place = str(rng.choice(sorted(machine.springs if spring else machine.ports)))
    return port_site(machine, place)


def port_site(frame: Frame, place: str) -> Site:
    """What moves at a port of a structure, and how stiff it is there."""
    m = modes(frame.linearised())
    freq = np.arange(15.0, 450.0, 0.5)
    alpha = receptance(m, np.asarray(2j * np.pi * freq, dtype=np.complex128), [place], [place])[0, 0]
    shown = replace(frame, channels=(Channel("y", place, 0),))
    force = antialiased(Blow((Pulse(0.05, 100.0, 2.8e-3, -0.1),)).force())
    motion = linear_answer(shown, frame.linearised(), force[None], FS)[0, 0]
    stiffness = frame.springs.get(place, float(np.median(1 / np.abs(alpha))))
    omega = 2 * np.pi * float(np.average(freq, weights=np.abs(alpha) ** 2))
    return Site(place, stiffness, 0.02 * stiffness / omega, float(np.abs(motion).max()), omega)


def with_law(machine: AnyMachine, law: Law) -> AnyMachine:
    """Fit a nonlinear element."""
    return machine.fitted(laws=(*machine.fittings.laws, law))


def rig_only(machine: AnyMachine) -> Rig:
    """The cutting machine; other structures have no such part."""
    if not isinstance(machine, Rig):
        raise TypeError("only the cutting machine has this part")
    return machine
