"""Under what conditions a campaign is measured: positions, levels, channels, noise, formats. All drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cutvib_ss.blind.rig.repeatability import Repeatability
from cutvib_ss.blind.rig.structure import Head, Rail

HEADROOM = 2.0
"""Range of the digitiser over the hardest blow that is meant."""

FORMATS = ("tdms", "csv", "mat", "uff", "csv_frf", "mat_frf")
"""Formats of the records; the last three hold frequency responses."""


@dataclass(frozen=True)
class Nominal:
    """
    What machine.toml says.

    Parameters
    ----------
    head : Head
        Nominal head.
    rail : Rail
        Nominal rail.
    n_modes : int
        How many modes of the rail the model takes.
    """

    head: Head = field(default_factory=Head)
    rail: Rail = field(default_factory=Rail)
    n_modes: int = 40


@dataclass(frozen=True)
class Conditions:
    """
    How a campaign is measured.

    Parameters
    ----------
    positions : tuple of float
        Positions y_b / L.
    levels : tuple of float
        Peak forces that are meant [N].
    blows : int
        Blows to a record.
    channels : tuple of str
        Response channels that are recorded.
    file_format : str
        One of `FORMATS`.
    unit : str
        Unit of the responses, ``"m/s^2"`` or ``"g"``.
    width : float
        How long the hammer's tip stays [s].
    noise : tuple of float
        Standard deviation of the noise of each channel, by sample [m/s^2].
    force_noise : float
        The same of the force [N].
    wander : float
        Offset and slow drift, over ten standard deviations of the noise.
    bits : int
        Of the digitiser.
    response_range, force_range : float
        Its full scale [m/s^2] and [N].
    hit_twice : float
        Probability that the hammer bounces.
    overloads : int
        How many blows exceed the range of a response channel.
    repeatability : Repeatability
        How the machine moves between records.
    """

    positions: tuple[float, ...]
    levels: tuple[float, ...]
    blows: int
    channels: tuple[str, ...]
    file_format: str
    unit: str
    width: float
    noise: tuple[float, ...]
    force_noise: float
    wander: float
    bits: int
    response_range: float
    force_range: float
    hit_twice: float
    overloads: int
    repeatability: Repeatability = field(default_factory=Repeatability)

    @property
    def frf(self) -> bool:
        """Whether the records hold frequency responses."""
        return self.file_format in ("uff", "csv_frf", "mat_frf")


def draw_nominal(rng: np.random.Generator) -> Nominal:
    """
    Draw a nominal machine: the published one, or another of its kind.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator.

    Returns
    -------
    Nominal
        The nominal machine.
    """
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
    """
    Draw the conditions of one campaign.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator.

    Returns
    -------
    Conditions
        The conditions.
    """
    count = int(rng.choice([4, 5, 6, 6, 6, 7, 8]))
    grid = (np.arange(count) + 0.5 + 0.35 * rng.uniform(-1, 1, count)) / count
    if rng.random() < 0.5:
        grid[0] = rng.uniform(0.015, 0.04)  # over a pillar, as the paper's BR
    levels = {1: (50.0,), 2: (20.0, 100.0), 3: (15.0, 50.0, 150.0)}[int(rng.choice([1, 2, 3, 3, 3]))]
    loudness = float(np.exp(0.15 * rng.standard_normal()))
    channels = [("tool_x",), ("tool_x", "tool_z"), ("tool_x", "base_x"), ("tool_x", "tool_z", "base_x")]
    floor = float(np.exp(rng.uniform(np.log(0.02), np.log(0.06))))
    bits = int(rng.choice([24, 24, 24, 16]))
    top = max(levels) * loudness
    return Conditions(
        positions=tuple(float(round(y, 4)) for y in grid),
        levels=tuple(float(f"{level * loudness:.3g}") for level in levels),
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

    Parameters
    ----------
    conditions : Conditions
        As drawn.
    changes : mapping of str to object
        Fields and their values.

    Returns
    -------
    Conditions
        As changed.

    Notes
    -----
    Ranges of the digitiser follow the levels, as whoever measures sets them: else it clips the hammer's force.
    """
    if "levels" in changes:
        reach = HEADROOM * max(changes["levels"])
        changes = {"response_range": reach, "force_range": reach, **changes}
    return replace(conditions, **changes)
