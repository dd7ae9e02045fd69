"""
The catalogue's causes, made in the machine.

Each function takes the machine as built, the severity (1 is what an engineer would call a clear fault) and a generator, and
returns the machine with the fault, its place and its parameters as the contract names them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from cutvib_ss.blind.rig.fittings import Law, Lump, Oscillator, Shear, Spring, Supports, Twist, Viscoelastic
from cutvib_ss.blind.rig.motion import CHANNELS
from cutvib_ss.blind.rig.structure import JOINTS, Rig

Parameters: TypeAlias = Mapping[str, float | str]
Made: TypeAlias = tuple[Rig, str, Parameters]
Maker: TypeAlias = Callable[[Rig, float, np.random.Generator], Made]

TYPICAL = 2 * np.pi * 220.0
"""Angular frequency of the head's pair of modes [rad/s]."""

SWING = {"joint1": 3.0e-5, "joint2": 4.0e-4}
"""Peak deflection of the joints under a blow of 100 N [rad]."""

STICKING = 60.0
"""Stiffness of a joint that sticks by dry friction over that of its spring."""


def either(rng: np.random.Generator) -> float:
    """
    Draw a sign.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator.

    Returns
    -------
    float
        -1 or 1.
    """
    return float(rng.choice([-1.0, 1.0]))


def about(rng: np.random.Generator, value: float, spread: float = 0.3) -> float:
    """
    Draw a value about another.

    Parameters
    ----------
    rng : numpy.random.Generator
        Generator.
    value : float
        Middle.
    spread : float
        How far the logarithm may go either way.

    Returns
    -------
    float
        The value drawn, even in its logarithm.
    """
    return float(value * np.exp(spread * rng.uniform(-1, 1)))


def joint(rig: Rig, rng: np.random.Generator, share: float = 0.5) -> tuple[str, float]:
    """
    Draw a joint.

    Parameters
    ----------
    rig : Rig
        The machine.
    rng : numpy.random.Generator
        Generator.
    share : float
        Probability of joint 1.

    Returns
    -------
    place : str
        ``"joint1"`` or ``"joint2"``.
    stiffness : float
        Its stiffness [N m/rad].
    """
    place = JOINTS[0 if rng.random() < share else 1]
    return place, rig.value("k" + place[-1])


def with_law(rig: Rig, law: Law) -> Rig:
    """
    Fit a nonlinear element.

    Parameters
    ----------
    rig : Rig
        The machine.
    law : Law
        The element.

    Returns
    -------
    Rig
        The machine with it.
    """
    return rig.fitted(laws=(*rig.fittings.laws, law))


def _rail_torsion(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """The head hangs beside the shear centre of a rail that twists."""
    p = {
        "eccentricity": either(rng) * about(rng, 0.045) * severity,
        "inertia": about(rng, 0.5, 0.5),
        "torsion_frequency": about(rng, 240.0, 0.3) * severity**-0.3,
        "damping_ratio": about(rng, 0.02, 0.5),
    }
    return rig.fitted(twist=Twist(**p)), "rail", p


def _support_compliance(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Springs under the rail's ends, each side its own."""
    k = {side: about(rng, 5e7, 0.7) / severity for side in ("k_left", "k_right")}
    c = {"c" + side[1:]: float(rng.uniform(0.2, 1.0) * 0.04 * np.sqrt(value * 30.0)) for side, value in k.items()}
    return rig.fitted(supports=Supports(**k, **c)), "rail_ends", k | c


def _end_fixity(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Rotational springs at the rail's ends."""
    p = {side: about(rng, 1.2e5, 0.7) * severity for side in ("k_left", "k_right")}
    return rig.fitted(fixity=(p["k_left"], p["k_right"])), "rail_ends", p


def _rail_added_mass(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A cable carrier on the rail."""
    p = {
        "position": float(rng.uniform(0.12, 0.88)),
        "mass": about(rng, 6.0) * severity,
        "damping": float(rng.uniform(0.0, 80.0)) * severity,
    }
    return rig.fitted(lumps=(*rig.fittings.lumps, Lump(**p))), "rail", p


def _rail_shear(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Shear and rotary inertia of the rail's section."""
    ratio = about(rng, 80.0, 0.2) / severity
    return rig.fitted(shear=Shear(ratio, float(rng.uniform(0.2, 0.36)))), "rail", {"shear_ratio": ratio}


def _guide_compliance(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """The guide's balls give."""
    k = about(rng, 1e8, 0.4) / severity
    c = float(rng.uniform(0.2, 1.0) * 0.04 * np.sqrt(k * 25.0))
    return rig.fitted(guide=(k, c)), "head_base", {"stiffness": k, "damping": c}


def _local_resonator(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A panel or hose on tool or head."""
    place = str(rng.choice(["tool", "head"]))
    p = {
        "mass": about(rng, {"tool": 0.06, "head": 3.0}[place]) * severity,
        "frequency": float(np.exp(rng.uniform(np.log(80.0), np.log(380.0)))),
        "damping_ratio": float(rng.uniform(0.01, 0.05)),
    }
    return rig.fitted(oscillators=(*rig.fittings.oscillators, Oscillator(place, "x", **p))), place, p


def _added_mass(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A mass that the model lacks, or has too much of."""
    place = str(rng.choice(["tool", "head"]))
    name = {"tool": "m2", "head": "m1"}[place]
    mass = about(rng, {"tool": 0.04, "head": 3.5}[place]) * severity * (1.0 if rng.random() < 0.75 else -1.0)
    return rig.scaled({name: 1 + mass / rig.value(name)}), place, {"mass": mass}


def _tool_contact(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Belt or cloth holds the tool."""
    p = {"stiffness": about(rng, 2.2e5) * severity, "damping": float(rng.uniform(0.0, 40.0)) * severity}
    spring = Spring(("tool", "ground"), "x", p["stiffness"], p["damping"])
    return rig.fitted(springs=(*rig.fittings.springs, spring)), "tool", p


_SHIFTS = {
    "k1": ("joint1", 0.08), "c1": ("joint1", 0.9), "k2": ("joint2", 0.05), "c2": ("joint2", 0.6), "l1": ("head", 0.06),
    "l2": ("tool", 0.015), "mass": ("rail", 0.25), "first_frequency": ("rail", 0.08), "damping_ratio": ("rail", 1.0),
}  # fmt: skip


def _parameter_shift(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """One value is off."""
    name = str(rng.choice(list(_SHIFTS)))
    place, size = _SHIFTS[name]
    factor = float(np.exp(either(rng) * about(rng, size, 0.2) * severity))
    return rig.scaled({name: factor}), place, {"parameter": name, "factor": factor}


def _structural_damping(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A hysteretic joint in place of a viscous one."""
    place, k = joint(rig, rng)
    c = rig.value("c" + place[-1])
    loss = float(c * TYPICAL / k * np.exp(either(rng) * about(rng, 0.45, 0.2) * severity))
    lossy = Viscoelastic(place, loss * k, 0.0)
    rig = rig.scaled({"c" + place[-1]: 0.0})
    return rig.fitted(viscoelastic=(*rig.fittings.viscoelastic, lossy)), place, {"loss_factor": loss}


_BY_JOINT = {
    "cubic": {"joint1": 0.8, "joint2": 0.05},
    "gap": {"joint1": 0.05, "joint2": 0.025},
    "friction": {"joint1": 0.05, "joint2": 0.025},
    "slip": {"joint1": 0.35, "joint2": 0.15},
    "bilinear": {"joint1": 0.45, "joint2": 0.18},
    "quadratic": {"joint1": 4.0, "joint2": 1.5},
}
"""Sizes at severity 1: of changes of torque over that of the spring, of a clearance over the swing, and so on."""


def _cubic_stiffness(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A joint that hardens or softens."""
    place, k = joint(rig, rng, 0.4)
    stiffness = either(rng) * about(rng, _BY_JOINT["cubic"][place], 0.2) * severity * k / SWING[place] ** 2
    # a softening joint must not give way under the hardest blow (200 N)
    stiffness = max(stiffness, -0.12 * k / SWING[place] ** 2)
    return with_law(rig, Law(place, "cubic", (stiffness,))), place, {"stiffness3": stiffness}


def _freeplay(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Clearance in a joint."""
    place, k = joint(rig, rng, 0.4)
    gap = about(rng, _BY_JOINT["gap"][place]) * severity * SWING[place]
    return with_law(rig, Law(place, "freeplay", (gap, k))), place, {"gap": gap}


def _dry_friction(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Coulomb friction: it sticks, with an elastic reach far below the joint's motion."""
    place, k = joint(rig, rng, 0.4)
    torque = about(rng, _BY_JOINT["friction"][place]) * severity * k * SWING[place]
    return with_law(rig, Law(place, "jenkins", (torque, STICKING * k))), place, {"torque": torque}


def _joint_slip(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A spring in parallel with the joint's that slips (Jenkins)."""
    place, k = joint(rig, rng, 0.4)
    stiffness = about(rng, _BY_JOINT["slip"][place]) * k * severity
    torque = float(rng.uniform(0.05, 0.4)) * stiffness * SWING[place]
    p = {"stiffness": stiffness, "slip_torque": torque}
    return with_law(rig, Law(place, "jenkins", (torque, stiffness))), place, p


def _bilinear_stiffness(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A joint stiffer one way than the other."""
    place, k = joint(rig, rng, 0.4)
    asymmetry = float(np.clip(either(rng) * about(rng, _BY_JOINT["bilinear"][place]) * severity, -0.8, 0.8))
    return with_law(rig, Law(place, "bilinear", (asymmetry * k,))), place, {"asymmetry": asymmetry}


def _quadratic_damping(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Damping that grows with the rate."""
    place, _ = joint(rig, rng, 0.4)
    c = rig.value("c" + place[-1])
    coefficient = about(rng, _BY_JOINT["quadratic"][place]) * severity * c / (SWING[place] * TYPICAL)
    return with_law(rig, Law(place, "quadratic_damping", (coefficient,))), place, {"coefficient": coefficient}


def _channels(rng: np.random.Generator) -> tuple[str, tuple[str, ...]]:
    """A channel, or all."""
    name = str(rng.choice([*CHANNELS, "all", "all"]))
    return name, CHANNELS if name == "all" else (name,)


def _channel_delay(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """Responses late against the force."""
    name, channels = _channels(rng)
    delay = either(rng) * about(rng, 1.6e-4) * severity
    chain = rig.measured(delays=dict.fromkeys(channels, delay))
    return chain, "measurement", {"delay": delay, "channel": name}


def _calibration_error(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """A sensitivity that is wrong."""
    name, channels = _channels(rng)
    gain = float(np.exp(either(rng) * about(rng, 0.18) * severity))
    chain = rig.measured(gains=dict.fromkeys(channels, gain))
    return chain, "measurement", {"channel": name, "gain": gain}


def _cross_axis(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """X leaks into Z."""
    fraction = either(rng) * about(rng, 0.22) * severity
    return rig.measured(cross_axis=fraction), "measurement", {"fraction": fraction}


def _window_damping(rig: Rig, severity: float, rng: np.random.Generator) -> Made:
    """An exponential window that nobody took out."""
    rate = about(rng, 14.0) * severity
    return rig.measured(decay_rate=rate), "measurement", {"decay_rate": rate}


MECHANICAL: Mapping[str, Maker] = {
    "rail_torsion": _rail_torsion,
    "support_compliance": _support_compliance,
    "end_fixity": _end_fixity,
    "rail_added_mass": _rail_added_mass,
    "rail_shear": _rail_shear,
    "guide_compliance": _guide_compliance,
    "local_resonator": _local_resonator,
    "added_mass": _added_mass,
    "tool_contact": _tool_contact,
    "parameter_shift": _parameter_shift,
    "structural_damping": _structural_damping,
    "cubic_stiffness": _cubic_stiffness,
    "freeplay": _freeplay,
    "dry_friction": _dry_friction,
    "joint_slip": _joint_slip,
    "bilinear_stiffness": _bilinear_stiffness,
    "quadratic_damping": _quadratic_damping,
}
"""Causes in the machine, by their effect ids."""

MEASUREMENT: Mapping[str, Maker] = {
    "channel_delay": _channel_delay,
    "calibration_error": _calibration_error,
    "cross_axis": _cross_axis,
    "window_damping": _window_damping,
}
"""Causes in the measurement, by their effect ids."""
