"""
The variants of a fault at each place, each with one or two unknown functions of frequency.

A place of the catalogue may be at fault in several directions or forms: the tool in X alone or in X and Z, the rail at a point, in
a value that all its modes share, in twist, in a mode that the model lacks, its ends in deflection or in slope, one channel or all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from cutvib_ss.diagnosis import faults
from cutvib_ss.diagnosis.modification import Lines, Modification
from cutvib_ss.effects.base import Model, ports_of
from cutvib_ss.model.machine import Machine

Build: TypeAlias = Callable[[Lines, float], Modification]


@dataclass(frozen=True)
class Variant:
    """One way in which a place can be at fault."""

    place: str  # Place of the catalogue, or port of a structure
    name: str  # Distinguishes the variants of a place
    # What the unknown functions are: ``"dynamic stiffness"``, ``"compliance"``, ``"gain"``, ``"relative stiffness"``
    # or ``"relative mass"``
    kind: str
    unit: str  # Their unit
    labels: tuple[str, ...]  # One for each function
    build: Build  # Makes the modification from `Lines` and the value of the shape
    # Starts of the one real unknown beside the functions (where on the rail, how eccentric); empty where there is
    # none
    starts: tuple[float, ...] = ()
    bounds: tuple[float, float] = (0.0, 0.0)  # Its range

    def at(self, lines: Lines, shape: float) -> Modification:
        """The modification of a model."""
        value = float(np.clip(shape, *self.bounds)) if self.starts else 0.0
        key = (self.place, self.name, value)
        if key not in lines.built:
            lines.built[key] = self.build(lines, value)
        return lines.built[key]


def variants(model: Model, channels: Sequence[str]) -> tuple[Variant, ...]:
    """Every place of a model, each with the variants of its fault."""
    if model.head is None:
        # A port's own unit (N/m or N m/rad) is the model's affair.
        ports = [_parallel(name, (name,), unit="") for name in ports_of(model, ())]
        return (*ports, *_measurement(channels, leaks=False))
    out = [_parallel(joint, (joint,), unit="N m/rad") for joint in ("joint1", "joint2")]
    for place in ("tool", "head"):
        # A spring or a panel acts in X; a mass in X and Z alike.
        out.append(_parallel(place, (f"{place}_x",)))
        out.append(_parallel(place, (f"{place}_x", f"{place}_z"), tied=True))
    # A hose may hold the tool along the machine; the head moves that way by its joint alone.
    out.append(_parallel("tool", ("tool_z",)))
    # A cable runs between tool and carriage.
    out.append(
        Variant(
            "tool",
            "tool_x-base",
            "dynamic stiffness",
            "N/m",
            ("tool_x-base",),
            lambda v, _: faults.across(v, "tool_x", "base"),
        )
    )
    if model.guide is None:
        out.append(Variant("head_base", "guide", "compliance", "m/N", ("guide",), lambda v, _: faults.guide(v)))
    leaks = {"tool_x", "tool_z"} <= set(channels)
    return (*out, *_rail(model), *_ends(model), *_measurement(channels, leaks))


def _parallel(place: str, ports: tuple[str, ...], tied: bool = False, unit: str = "N/m") -> Variant:
    ties = np.ones((len(ports), 1)) if tied else np.eye(len(ports))
    labels = ("=".join(ports),) if tied else ports
    return Variant(
        place, "=".join(ports), "dynamic stiffness", unit, labels, lambda v, _: faults.in_parallel(v, ports, ties)
    )


def _rail(model: Machine) -> list[Variant]:
    out = [_parallel("rail", ("base",))]
    if model.rail.supports is None and not model.rail.attachments:
        out += [
            Variant("rail", kind, kind, "1", (kind,), lambda v, _, kind=kind: faults.rail_modes(v, kind))  # type: ignore[misc]
            for kind in ("relative stiffness", "relative mass")
        ]
    n = model.rail.parameters.n_modes + 1
    out.append(Variant("rail", "next mode", "compliance", "m/N", (f"mode {n}",), lambda v, _: faults.next_mode(v, n)))
    spots = tuple(np.linspace(0.1, 0.9, 9).round(3).tolist())
    out.append(Variant("rail", "point", "dynamic stiffness", "N/m", ("point",), faults.at_point, spots, (0.02, 0.98)))
    if model.rail.supports is None and not model.rail.attachments:
        out.append(Variant("rail", "kink", "dynamic stiffness", "N/m", ("kink",), faults.kink, spots, (0.02, 0.98)))
    if model.rail.torsion is None:
        labels = ("twist 1", "twist 2")
        out.append(
            Variant(
                "rail",
                "twist",
                "compliance",
                "rad/(N m)",
                labels,
                faults.twist,
                (-0.08, -0.03, 0.03, 0.08),
                (-0.2, 0.2),
            )
        )
    return out


def _ends(model: Machine) -> list[Variant]:
    labels = ("left", "right")
    out = [Variant("rail_ends", "slopes", "dynamic stiffness", "N m/rad", labels, lambda v, _: faults.end_slopes(v))]
    if model.rail.supports is None:
        out.append(Variant("rail_ends", "supports", "compliance", "m/N", labels, lambda v, _: faults.end_supports(v)))
    else:
        out.append(_parallel("rail_ends", ("rail_left", "rail_right")))
    return out


def _measurement(channels: Sequence[str], leaks: bool) -> list[Variant]:
    # A window that was never taken out shifts the line s; a gain of all channels stands beside it.
    out = [Variant("measurement", "all", "gain", "1", ("all channels",), faults.windowed, (0.1,), (0.0, 50.0))]
    if len(channels) > 1:
        out += [
            Variant("measurement", c, "gain", "1", (c,), lambda v, _, c=c: faults.channel_gain(v, c))  # type: ignore[misc]
            for c in channels
        ]
    if leaks:
        out.append(Variant("measurement", "leak", "gain", "1", ("tool_x into tool_z",), lambda v, _: faults.leak(v)))
    return out
