"""
Causes that are not in the catalogue, as unlike each other as they come: other couplings, laws, places, things that change.

Made as in `causes`; the place is the catalogue's name of where it sits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cutvib_ss.blind.rig.causes import SWING, TYPICAL, Made, Maker, about, joint, with_law
from cutvib_ss.blind.rig.fittings import Crack, Law, Oscillator, Spring, Supports, Viscoelastic
from cutvib_ss.blind.rig.motion import CHANNELS
from cutvib_ss.blind.rig.structure import Rig


def _mains_hum(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """50 Hz and harmonics on the responses."""
    size = about(rng, 0.4) * severity
    p = {f"amplitude{k}": size * float(rng.uniform(0.3, 1.0)) / k**0.5 for k in range(1, 8)}
    return rig.measured(hum=tuple(p.values())), "measurement", p


def _fractional_damper(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A rubber-like torque c (iω)^α in a joint."""
    place, k = joint(rig, rng)
    order = float(rng.uniform(0.3, 0.6))
    coefficient = about(rng, {"joint1": 0.25, "joint2": 0.1}[place]) * severity * k / TYPICAL**order
    element = Viscoelastic(place, coefficient, order)
    return rig.fitted(viscoelastic=(element,)), place, {"coefficient": coefficient, "order": order}


def _rattling_support(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A pillar on which an end of the rail only rests: it lifts off and lands."""
    k = about(rng, 2e9, 0.4)  # stiff while it bears: what shows is that it lifts off
    preload = about(rng, 4.0, 0.4) / severity
    end = str(rng.choice(["rail_left", "rail_right"]))
    other = 1e10
    sides = {"rail_left": (k, other), "rail_right": (other, k)}[end]
    supports = Supports(*sides, *(0.02 * np.sqrt(s * 30.0) if s == k else 0.0 for s in sides))
    rattling = with_law(rig.fitted(supports=supports), Law(end, "lift_off", (k, preload)))
    return rattling, "rail_ends", {"stiffness": k, "preload": preload, "end": end}


_WARMING = {"joint1": ("k1", 0.3), "joint2": ("k2", 0.1), "rail": ("first_frequency", 0.12)}


def _warming(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A value that changes from record to record, as the machine warms up."""
    place = str(rng.choice(list(_WARMING)))
    name, size = _WARMING[place]
    change = -about(rng, size) * severity
    return replace(rig, drift={name: change}), place, {"parameter": name, "change": change}


def _saturating_sensor(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A charge amplifier that saturates softly."""
    limit = about(rng, 80.0) / severity
    return rig.measured(saturation=dict.fromkeys(CHANNELS, limit)), "measurement", {"limit": limit}


def _z_pendulum(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A mass on the tool that swings along the machine (the head hardly moves that way)."""
    p = {
        "mass": about(rng, 0.015) * severity,
        "frequency": float(rng.uniform(120.0, 320.0)),
        "damping_ratio": float(rng.uniform(0.01, 0.05)),
    }
    return rig.fitted(oscillators=(Oscillator("tool", "z", **p),)), "tool", p


def _joint_coupling(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A hose that couples the two joints: a spring on the difference of their angles."""
    stiffness = about(rng, 0.04) * severity * rig.head.k2
    return rig.fitted(coupling=stiffness), "joint2", {"stiffness": stiffness}


def _crack(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A crack in the rail: it bends more at one point."""
    position = float(rng.uniform(0.2, 0.8))
    mu = rig.rail.mass / rig.rail.length
    ei = mu * (2 * np.pi * rig.rail.first_frequency) ** 2 * (rig.rail.length / np.pi) ** 4
    stiffness = ei / rig.rail.length * about(rng, 9.0) / severity
    return rig.fitted(crack=Crack(position, stiffness)), "rail", {"position": position, "stiffness": stiffness}


def _cable_pull(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A cable between tool and base whose stiffness grows as it is drawn taut."""
    travel = 0.096 * SWING["joint2"]
    k2 = about(rng, 1.8) * severity * rig.head.k2 / rig.head.l2**2 / travel
    return with_law(rig, Law("tool_x-base_x", "cable", (k2,))), "tool", {"stiffness2": k2}


def _trigger_jitter(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Force and responses on two devices that start together only about."""
    jitter = about(rng, 1.2e-4) * severity
    return rig.measured(jitter=jitter), "measurement", {"jitter": jitter}


def _saturating_damper(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A damper whose torque levels off with the rate (a relief valve)."""
    place, _ = joint(rig, rng, 0.4)
    rate = 0.15 * SWING[place] * TYPICAL
    torque = about(rng, {"joint1": 5.0, "joint2": 1.5}[place]) * severity * rig.value("c" + place[-1]) * rate
    return with_law(rig, Law(place, "saturating_damper", (torque, rate))), place, {"torque": torque, "rate": rate}


def _side_spring(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A hose that holds the tool along the machine."""
    k = about(rng, 5e4) * severity
    return rig.fitted(springs=(Spring(("tool", "ground"), "z", k, 5.0),)), "tool", {"stiffness": k}


def _loose_mount(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """An accelerometer on a mount that resonates."""
    resonance = about(rng, 700.0, 0.1) * severity**-0.5
    p = {"frequency": resonance, "damping_ratio": float(rng.uniform(0.02, 0.1))}
    return rig.measured(mounts={"tool_x": (p["frequency"], p["damping_ratio"])}), "measurement", p


OUTSIDE: Mapping[str, Maker] = {
    "mains_hum": _mains_hum,
    "fractional_damper": _fractional_damper,
    "rattling_support": _rattling_support,
    "warming": _warming,
    "saturating_sensor": _saturating_sensor,
    "z_pendulum": _z_pendulum,
    "joint_coupling": _joint_coupling,
    "crack": _crack,
    "cable_pull": _cable_pull,
    "trigger_jitter": _trigger_jitter,
    "saturating_damper": _saturating_damper,
    "side_spring": _side_spring,
    "loose_mount": _loose_mount,
}
"""Every kind outside the catalogue."""
