"""Every cause that the catalogue allows on a model, each with the starts from which it is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Effect, Model
from cutvib_ss.effects.bilinear_stiffness import BilinearStiffness
from cutvib_ss.effects.calibration_error import CalibrationError
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.cross_axis import CrossAxis
from cutvib_ss.effects.cubic_stiffness import CubicStiffness
from cutvib_ss.effects.dry_friction import DryFriction
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.effects.guide_compliance import GuideCompliance
from cutvib_ss.effects.joint_slip import JointSlip
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.modal_truncation import ModalTruncation
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.effects.quadratic_damping import QuadraticDamping
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.rail_shear import RailShear
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.effects.window_damping import WindowDamping
from cutvib_ss.model.machine import Machine

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


@dataclass(frozen=True)
class Motion:
    """
    Motion of a place in the records.

    Parameters
    ----------
    low, high : float
        Peak in the quietest and in the loudest record [m or rad].
    rate : float
        Peak rate at a level between [m/s or rad/s].
    """

    low: float
    high: float
    rate: float


LAWS = (CubicStiffness, Freeplay, DryFriction, JointSlip, BilinearStiffness, QuadraticDamping)
"""Effects that only a simulation shows."""


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
    grid = np.geomspace(max(band[0], 1e-3) * 1.2, band[1], 46)[:-1]
    for place in LocalResonator.places(model):
        masses = (scale[place][0] * 0.01, scale[place][0] * 0.06)
        starts = (LocalResonator(place, mass, float(f), 0.03) for f in grid for mass in masses)
        out.append(_candidate("local_resonator", place, *starts))
    for place in AddedMass.places(model):
        mass = scale[place][0] * 0.02
        out.append(_candidate("added_mass", place, *(AddedMass(place, f * mass) for f in (1.0, 4.0, 16.0))))
    for place in ToolContact.places(model):
        stiffness, damping = scale[place][1] * 0.02, scale[place][2] * 0.02
        out.append(
            _candidate(
                "tool_contact",
                place,
                *(ToolContact(place, f * stiffness, g * damping) for f in (0.3, 2.0, 12.0, 60.0) for g in (0.3, 10.0)),
            )
        )
    for place, name in ParameterShift.choices(model):
        out.append(
            _candidate(
                "parameter_shift",
                f"{place}.{name}",
                *(ParameterShift(place, name, f) for f in (1.0, 0.6, 0.8, 1.25, 1.7)),
            )
        )
    return out


def _measurement(model: Model, channels: Sequence[str]) -> list[Candidate]:
    out = []
    # What is wrong with all responses alike is wrong with the force.
    for channel in ("all", *channels) if len(channels) > 1 else channels:
        out.append(_candidate("channel_delay", channel, ChannelDelay("measurement", channel, 0.0)))
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
    ends = [(a * k, b * k) for a in (2, 8, 30, 120) for b in (2, 8, 30, 120)]
    turns = (0.1, 0.4, 1.2, 4.0, 15.0)
    spots = (0.12, 0.25, 0.38, 0.5, 0.62, 0.75, 0.88)
    twists = [(e, f) for f in (3.0, 4.5, 6.5, 9.0, 12.0) for e in (0.03, -0.03, 0.09, -0.09)]
    # Modes far above the band add a stiffness that nothing could tell from the tuning.
    omitted = p.first_frequency * (p.n_modes + 1) ** 2
    more = sorted({p.n_modes + 1, p.n_modes + 2, 2 * p.n_modes, 5 * p.n_modes}) if omitted < FAR * band[1] else []
    # Shear is told from a softer rail by the square of a mode's number: with one mode in the band the two are the same.
    told = p.n_modes > 1 and 4 * p.first_frequency < band[1]
    return [
        _candidate("support_compliance", "", *(SupportCompliance("rail_ends", a, b, 500.0, 500.0) for a, b in ends)),
        _candidate("end_fixity", "", *(EndFixity("rail_ends", a * turn, b * turn) for a in turns for b in turns)),
        _candidate(
            "guide_compliance", "", *(GuideCompliance("head_base", f * k, 500.0) for f in (5.0, 20.0, 60.0, 200.0))
        ),
        _candidate(
            "rail_added_mass", "", *(RailAddedMass("rail", y, p.mass * f, 1.0) for y in spots for f in (0.01, 0.06))
        ),
        *([_candidate("rail_shear", "", *(RailShear("rail", ratio) for ratio in (15.0, 80.0, 300.0)))] if told else []),
        _candidate("rail_torsion", "", *(RailTorsion("rail", e, 0.5, f * p.first_frequency, 0.02) for e, f in twists)),
        *(
            _candidate("structural_damping", joint, StructuralDamping(joint, max(2 * np.pi * 220 * loss[joint], 0.005)))
            for joint in ("joint1", "joint2")
        ),
        *(_candidate("modal_truncation", str(n), ModalTruncation("rail", n)) for n in more),
    ]


def nonlinear_candidates(model: Model, motions: Mapping[str, Motion]) -> tuple[Candidate, ...]:
    """
    All single causes that depend on the level, or on the sign, of the motion.

    Parameters
    ----------
    model : Machine or Structure
        The nominal model.
    motions : mapping of str to Motion
        How far and how fast each place moves in the records, by the re-tuned model.

    Returns
    -------
    tuple of Candidate
        The causes, their starts in proportion to that motion.
    """
    scale = _port_scales(model)
    out = []
    for law in LAWS:
        for place in law.places(model):
            if place in motions and motions[place].high > 0.0:
                _, k, c = scale[place]
                out.append(_candidate(law.effect, place, *_law_starts(law, place, motions[place], k, c)))
    return tuple(out)


def _law_starts(law: type[Effect], place: str, m: Motion, k: float, c: float) -> tuple[Effect, ...]:
    """Values of a law from hardly visible to strong, against the linear spring and damper at its place."""
    middle = float(np.sqrt(m.low * m.high))
    force = k * middle
    if law is CubicStiffness:
        sizes = np.geomspace(0.01, 3.0, 6).tolist()
        return tuple(CubicStiffness(place, r * k / middle**2) for r in (*sizes, -0.01, -0.05, -0.2))
    if law is Freeplay:
        return tuple(Freeplay(place, r * middle) for r in np.geomspace(0.005, 1.5, 9).tolist())
    if law is DryFriction:
        return tuple(DryFriction(place, r * force) for r in np.geomspace(0.003, 1.5, 8).tolist())
    if law is JointSlip:
        return tuple(JointSlip(place, r * k, q * r * force) for r in (0.05, 0.25, 1.0) for q in (0.03, 0.15, 0.6, 1.5))
    if law is BilinearStiffness:
        return tuple(BilinearStiffness(place, a) for a in (-0.7, -0.35, -0.15, -0.05, 0.05, 0.15, 0.35, 0.7))
    damping = max(c, 1e-3 * force / m.rate)
    return tuple(QuadraticDamping(place, r * damping / m.rate) for r in np.geomspace(0.1, 20.0, 6).tolist())


def _candidate(effect: str, where: str, *starts: Effect) -> Candidate:
    return Candidate(f"{effect} {where}".strip(), tuple(starts))


def _port_scales(model: Model) -> dict[str, tuple[float, float, float]]:
    """Mass, stiffness and damping that each place carries, for starts in proportion."""
    if isinstance(model, Machine):
        h = model.head
        return {
            "head": (h.m1, h.k1 / h.l1**2, h.c1 / h.l1**2),
            "tool": (h.m2, h.k2 / h.l2**2, h.c2 / h.l2**2),
            "joint1": (h.m1 * h.l1**2, h.k1, h.c1),
            "joint2": (h.m2 * h.l2**2, h.k2, h.c2),
        }
    system = model.system
    scales = {}
    for name, row in system.ports.items():
        own = max(float(row @ row), 1e-30)
        scales[name] = tuple(
            float(abs(row @ m @ row)) / own**2 for m in (system.mass, system.stiffness, system.damping)
        )
    return {name: (m, k, c) for name, (m, k, c) in scales.items()}
