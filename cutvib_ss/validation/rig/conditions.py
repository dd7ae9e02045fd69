"""Under what conditions a campaign is measured: positions, levels, channels, noise, formats. All drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cutvib_ss.validation.rig.blows import FS, HAMMERS, Blow, Pulse, antialiased
from cutvib_ss.validation.rig.frames import Frame
from cutvib_ss.validation.rig.motion import linear_answer
from cutvib_ss.validation.rig.repeatability import Repeatability
from cutvib_ss.validation.rig.structure import TOLERANCE, Head, Rail

HEADROOM = 2.0
"""Range of the digitiser over the hardest blow that is meant."""

BAD = ("loose_cable", "noisy", "double", "clipped")
"""How a record goes wrong: a channel comes and goes, its noise is twentyfold, every blow is a double hit, a channel is clipped."""

FORMATS = ("tdms", "csv", "mat", "uff", "csv_frf", "mat_frf")
"""Formats of the records; the last three hold frequency responses."""


@dataclass(frozen=True)
class Nominal:
    """What machine.toml says."""

    head: Head = field(default_factory=Head)  # Nominal head
    rail: Rail = field(default_factory=Rail)  # Nominal rail
    n_modes: int = 40  # How many modes of the rail the model takes

    def toml(self, drift: float | None = None) -> str:
        """Text of machine.toml, as the machine's builder would write it down; how far it drifts is stated where it is known."""
        left_out = ("truncation", "damping_slope")
        rail = {key: value for key, value in vars(self.rail).items() if key not in left_out}
        rail["n_modes"] = self.n_modes
        tolerance = dict(TOLERANCE) | ({} if drift is None else {"drift": drift})
        tables = {"head": vars(self.head), "rail": rail, "tolerance": tolerance}
        return "\n\n".join(
            "\n".join([f"[{name}]", *(f"{key} = {value!r}" for key, value in table.items())])
            for name, table in tables.items()
        ) + "\n"  # fmt: skip


@dataclass(frozen=True)
class Conditions:
    """How a campaign is measured."""

    # Positions y_b / L; of a structure without positions as many None as it is measured times over
    positions: tuple[float | None, ...]
    levels: tuple[float, ...]  # Peak forces that are meant [N]
    blows: int  # Blows to a record
    channels: tuple[str, ...]  # Response channels that are recorded
    file_format: str  # One of `FORMATS`
    unit: str  # Unit of the responses, ``"m/s^2"`` or ``"g"``
    width: float  # How long the hammer's tip stays [s]
    noise: tuple[float, ...]  # Standard deviation of the noise of each channel, by sample [m/s^2]
    force_noise: float  # The same of the force [N]
    wander: float  # Offset and slow drift, over ten standard deviations of the noise
    bits: int  # Of the digitiser
    response_range: float  # Its full scale [m/s^2] and [N]
    force_range: float
    hit_twice: float  # Probability that the hammer bounces
    overloads: int  # How many blows exceed the range of a response channel
    repeatability: Repeatability = field(default_factory=Repeatability)  # How the machine moves between records
    # Corners of AC-coupled inputs of force and responses [Hz]; 0 where they are DC-coupled
    coupling: tuple[float, float] = (0.0, 0.0)
    hammer: str = "half_sine"  # Shape of the blows, one of `blows.HAMMERS`
    bad: tuple[tuple[int, str], ...] = ()  # Records that went wrong, and how: one of `BAD`
    # Noise of each channel against which steps in time must be short enough; that of the records where empty
    resolved: tuple[float, ...] = ()

    @property
    def frf(self) -> bool:
        """Whether the records hold frequency responses."""
        return self.file_format in ("uff", "csv_frf", "mat_frf")


def draw_nominal(rng: np.random.Generator) -> Nominal:
    """Draw a nominal machine: the published one, or another of its kind."""
    n_modes = int(rng.choice([32, 40, 40, 50]))
    if rng.random() < 0.6:
        return Nominal(n_modes=n_modes)

    def about(value: float, spread: float) -> float:
        return float(f"{value * (1 + spread * rng.uniform(-1, 1)):.5g}")

    h, r = Head(), Rail()
    # joint 2 keeps near joint 1 in frequency, as the close pair of the paper: their stiffnesses share a factor
    together = 1 + 0.12 * rng.uniform(-1, 1)
    head = Head(
        m1=about(h.m1, 0.12), m2=about(h.m2, 0.12), l1=about(h.l1, 0.08), l2=about(h.l2, 0.08),
        theta01_deg=about(4.0, 0.9), theta02_deg=about(102.0, 0.1),
        k1=about(h.k1 * together, 0.06), k2=about(h.k2 * together, 0.06), c1=about(h.c1, 0.25), c2=about(h.c2, 0.25),
    )  # fmt: skip
    rail = Rail(
        length=about(r.length, 0.15), mass=about(r.mass, 0.15), first_frequency=about(r.first_frequency, 0.15),
        damping_ratio=about(r.damping_ratio, 0.3),
    )  # fmt: skip
    return Nominal(head, rail, n_modes)


def draw_conditions(rng: np.random.Generator) -> Conditions:
    """Draw the conditions of one campaign."""
    count = int(rng.choice([4, 5, 6, 6, 6, 7, 8]))
    grid = (np.arange(count) + 0.5 + 0.35 * rng.uniform(-1, 1, count)) / count
    if rng.random() < 0.5:
        grid[0] = rng.uniform(0.015, 0.04)  # over a pillar, as the paper's BR
    levels = {1: (50.0,), 2: (20.0, 100.0), 3: (15.0, 50.0, 150.0)}[int(rng.choice([1, 2, 3, 3, 3]))]
    force_scale = float(np.exp(0.15 * rng.standard_normal()))
    channels = [("tool_x",), ("tool_x", "tool_z"), ("tool_x", "base_x"), ("tool_x", "tool_z", "base_x")]
    floor = float(np.exp(rng.uniform(np.log(0.02), np.log(0.06))))
    bits = int(rng.choice([24, 24, 24, 16]))
    top = max(levels) * force_scale
    return Conditions(
        positions=tuple(float(round(y, 4)) for y in grid),
        levels=tuple(float(f"{level * force_scale:.3g}") for level in levels),
        blows=3,
        channels=channels[int(rng.choice(4, p=[0.08, 0.27, 0.15, 0.5]))],
        file_format=str(rng.choice(FORMATS, p=[0.42, 0.08, 0.15, 0.22, 0.05, 0.08])),
        unit=str(rng.choice(["m/s^2", "g"], p=[0.8, 0.2])),
        width=float(rng.uniform(2.4e-3, 3.4e-3)),
        noise=tuple(float(floor * np.exp(0.2 * x)) for x in rng.standard_normal(3)),
        force_noise=float(rng.uniform(0.002, 0.006)),
        wander=float(rng.uniform(0.0, 0.02)),
        bits=bits,
        response_range=float(HEADROOM * top),
        force_range=float(HEADROOM * top),
        hit_twice=0.03,
        overloads=int(rng.random() < 0.1),
    )


def changed(conditions: Conditions, changes: Mapping[str, Any]) -> Conditions:
    """
    Conditions with some of them given instead of drawn.

    Ranges of the digitiser follow the levels, as whoever measures sets them: else it clips the hammer's force.
    """
    if "levels" in changes:
        louder = max(changes["levels"]) / max(conditions.levels)
        ranges = {name: louder * getattr(conditions, name) for name in ("response_range", "force_range")}
        changes = {**ranges, **changes}
    return replace(conditions, **changes)


def frame_conditions(frame: Frame, rng: np.random.Generator) -> Conditions:
    """
    Conditions of a campaign on another structure: measured in one to four sittings, its channels' noise in proportion to their
    signals, in a format that can hold any unit.
    """
    usual = draw_conditions(rng)
    force = antialiased(Blow((Pulse(0.05, 50.0, usual.width, -0.1),)).force())
    peak = np.abs(linear_answer(frame, frame.linearised(), force[None], FS)[0]).max(axis=1)
    floor = float(np.exp(rng.uniform(np.log(1e-4), np.log(6e-4))))
    noise = tuple(float(floor * p * np.exp(0.2 * rng.standard_normal())) for p in peak)
    every = tuple(c.name for c in frame.channels)
    return replace(
        usual,
        positions=(None,) * int(rng.integers(1, 5)),
        channels=every if rng.random() < 0.8 else every[:1],
        file_format=str(rng.choice(["tdms", "csv", "mat", "csv_frf", "mat_frf"], p=[0.45, 0.1, 0.15, 0.1, 0.2])),
        unit="m/s^2",
        noise=noise,
        # of the first channel; those of the others go with their noise
        response_range=HEADROOM * max(usual.levels) / 50.0 * float(peak[0]),
    )


def roughened(conditions: Conditions, rng: np.random.Generator) -> Conditions:
    """
    The same measured with instruments and hands as they are: AC-coupled inputs, a converter of few bits or set too coarse, a
    hammer whose blows are no half sines, more double hits and overloads, a record or two that went wrong.
    """
    c = conditions
    corners = tuple(float(np.exp(rng.uniform(np.log(0.05), np.log(0.4)))) for _ in range(2))
    reach = float(rng.uniform(1.0, 8.0))
    records = len(c.positions) * len(c.levels)
    bad = int(rng.choice([0, 0, 1, 1, 2])) if records >= 6 else 0
    wrong = rng.choice(records, bad, replace=False)
    return replace(
        c,
        coupling=(corners[0], corners[1]) if rng.random() < 0.7 else (0.0, 0.0),
        bits=int(rng.choice([24, 16, 16, 12])),
        response_range=reach * c.response_range,
        force_range=reach * c.force_range,
        hammer=str(rng.choice([name for name in HAMMERS if name != "half_sine"])),
        width=c.width * float(rng.uniform(0.7, 1.3)),
        hit_twice=0.08,
        overloads=int(rng.integers(0, 3)),
        bad=tuple((int(i), str(rng.choice(BAD))) for i in wrong),
    )
