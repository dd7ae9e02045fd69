"""Every cause that the catalogue allows on a model, each with the starts from which it is fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.guide_compliance import GuideCompliance
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.modal_truncation import ModalTruncation
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.effects.window_damping import WindowDamping
from cutvib_ss.machine import Machine

FAR = 10.0
"""A rail mode this many times above the band is no cause."""


@dataclass(frozen=True)
class Candidate:
    """
    A cause with its starts.

    Parameters
    ----------
    name : str
        Effect, place and what is discrete about it: tells candidates apart.
    starts : tuple of Effect
        The same cause at several starting values.
    """

    name: str
    starts: tuple[Effect, ...]


def candidates(model: Model, band: tuple[float, float], channels: Sequence[str]) -> tuple[Candidate, ...]:
    """
    All single causes on a model.

    Parameters
    ----------
    model : Machine or Structure
        The nominal model.
    band : tuple of float
        Band of the measurement [Hz], in which resonances are looked for.
    channels : sequence of str
        Measured channels.

    Returns
    -------
    tuple of Candidate
        The causes.
    """
    found = [*_everywhere(model, band), *_measurement(model, channels)]
    if isinstance(model, Machine):
        found += _on_the_rail(model, band)
    return tuple(found)


def _everywhere(model: Model, band: tuple[float, float]) -> list[Candidate]:
    scale = _port_scales(model)
    out = []
    grid = np.geomspace(max(band[0], 1e-3) * 1.2, band[1], 9)[:-1]
    for place in LocalResonator.places(model):
        mass = scale[place][0] * 0.03
        out.append(_candidate("local_resonator", place, *(LocalResonator(place, mass, float(f), 0.03) for f in grid)))
    for place in AddedMass.places(model):
        mass = scale[place][0] * 0.02
        out.append(_candidate("added_mass", place, AddedMass(place, mass), AddedMass(place, 10 * mass)))
    for place in ToolContact.places(model):
        stiffness, damping = scale[place][1] * 0.02, scale[place][2] * 0.02
        out.append(
            _candidate(
                "tool_contact",
                place,
                ToolContact(place, stiffness, damping),
                ToolContact(place, 10 * stiffness, damping),
            )
        )
    for place, name in ParameterShift.choices(model):
        out.append(_candidate("parameter_shift", f"{place}.{name}", ParameterShift(place, name, 1.0)))
    return out


def _measurement(model: Model, channels: Sequence[str]) -> list[Candidate]:
    out = []
    for channel in ("all", *channels) if len(channels) > 1 else channels:
        out.append(_candidate("channel_delay", channel, ChannelDelay("measurement", channel, 0.0)))
    for channel in channels:
        out.append(_candidate("calibration_error", channel, CalibrationError("measurement", channel, 1.0)))
    if CrossAxis.places(model) and "tool_z" in channels:
        out.append(_candidate("cross_axis", "", CrossAxis("measurement", 0.0)))
    out.append(_candidate("window_damping", "", WindowDamping("measurement", 1.0)))
    return out


def _on_the_rail(model: Machine, band: tuple[float, float]) -> list[Candidate]:
    p = model.rail.parameters
    # Stiffness of the rail's first mode, on which all rail effects are scaled.
    k = p.mass / 2 * (2 * np.pi * p.first_frequency) ** 2
    turn = p.bending_stiffness / p.length
    loss = {"joint1": model.head.c1 / model.head.k1, "joint2": model.head.c2 / model.head.k2}
    ends = [(a * k, b * k) for a, b in ((20, 20), (5, 5), (5, 40), (40, 5))]
    spots = (0.15, 0.38, 0.62, 0.85)
    twists = [(e, f) for f in (4.0, 7.0, 11.0) for e in (0.03, -0.03)]
    # Modes far above the band add a stiffness that nothing could tell from the tuning.
    omitted = p.first_frequency * (p.n_modes + 1) ** 2
    more = sorted({p.n_modes + 1, p.n_modes + 2, 2 * p.n_modes, 5 * p.n_modes}) if omitted < FAR * band[1] else []
    return [
        # Nobody knows whether the rail's damping is its own or its surroundings': both are tried.
        *(
            _candidate(
                "support_compliance",
                f"rigid_damping {share:g}",
                *(SupportCompliance("rail_ends", a, b, 500.0, 500.0, share) for a, b in ends),
            )
            for share in (0.0, 1.0)
        ),
        _candidate("end_fixity", "", *(EndFixity("rail_ends", f * turn, f * turn) for f in (0.3, 3.0))),
        _candidate("guide_compliance", "", *(GuideCompliance("head_base", f * k, 500.0) for f in (20.0, 100.0))),
        _candidate("rail_added_mass", "", *(RailAddedMass("rail", y, p.mass / 50, 1.0) for y in spots)),
        _candidate("rail_torsion", "", *(RailTorsion("rail", e, 0.5, f * p.first_frequency, 0.02) for e, f in twists)),
        *(
            _candidate("structural_damping", joint, StructuralDamping(joint, max(2 * np.pi * 220 * loss[joint], 0.005)))
            for joint in ("joint1", "joint2")
        ),
        *(_candidate("modal_truncation", str(n), ModalTruncation("rail", n)) for n in more),
    ]


def _candidate(effect: str, where: str, *starts: Effect) -> Candidate:
    return Candidate(f"{effect} {where}".strip(), tuple(starts))


def _port_scales(model: Model) -> dict[str, tuple[float, float, float]]:
    """Mass, stiffness and damping that each place carries, for starts in proportion."""
    if isinstance(model, Machine):
        h = model.head
        return {
            "head": (h.m1, h.k1 / h.l1**2, h.c1 / h.l1**2),
            "tool": (h.m2, h.k2 / h.l2**2, h.c2 / h.l2**2),
        }
    system = model.system
    scales = {}
    for name, row in system.ports.items():
        own = max(float(row @ row), 1e-30)
        scales[name] = tuple(
            float(abs(row @ m @ row)) / own**2 for m in (system.mass, system.stiffness, system.damping)
        )
    return {name: (m, k, c) for name, (m, k, c) in scales.items()}
