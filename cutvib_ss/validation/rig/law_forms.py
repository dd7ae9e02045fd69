"""Nonlinear causes of the catalogue, each in the forms in which real joints have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutvib_ss.validation.rig.fittings import Law
from cutvib_ss.validation.rig.sites import AnyMachine, Form, Made, about, either, site, with_law

STICKING = 60.0
"""Stiffness of a joint that sticks by dry friction over that of its spring."""

_SIZE = {
    "cubic": {"joint1": 0.8, "joint2": 0.05},
    "gap": {"joint1": 0.05, "joint2": 0.025},
    "friction": {"joint1": 0.05, "joint2": 0.025},
    "slip": {"joint1": 0.35, "joint2": 0.15},
    "bilinear": {"joint1": 0.45, "joint2": 0.18},
    "quadratic": {"joint1": 4.0, "joint2": 1.5},
}
_ELSEWHERE = {"cubic": 0.1, "gap": 0.05, "friction": 0.05, "slip": 0.2, "bilinear": 0.25, "quadratic": 3.0}
"""Sizes at severity 1: of changes of force over that of the spring, of a clearance over the swing, and so on."""


def _of(name: str, place: str) -> float:
    return _SIZE[name].get(place, _ELSEWHERE[name])


def _cubic(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint that hardens or softens."""
    at = site(machine, rng)
    top = at.stiffness / at.swing**2
    # a softening joint must not give way under the hardest blow (200 N)
    k3 = max(either(rng) * about(rng, _of("cubic", at.place), 0.2) * severity * top, -0.12 * top)
    return with_law(machine, Law(at.place, "cubic", (k3,))), at.place, {"stiffness3": k3}


def _quintic(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A cubic whose next term counts."""
    at = site(machine, rng)
    k = about(rng, _of("cubic", at.place), 0.2) * severity * at.stiffness
    p = {"stiffness3": 0.6 * k / at.swing**2, "stiffness5": 0.5 * k / at.swing**4}
    cubic = Law(at.place, "cubic", (p["stiffness3"],))
    return with_law(with_law(machine, cubic), Law(at.place, "power_spring", (0.5 * k, at.swing, 5.0))), at.place, p


def _power(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A spring whose force goes with another power of its deflection (a coned washer, a rubber stop)."""
    at = site(machine, rng)
    k, p = about(rng, _of("cubic", at.place), 0.2) * severity * at.stiffness, float(rng.choice([1.8, 2.5, 4.0]))
    return with_law(machine, Law(at.place, "power_spring", (k, at.swing, p))), at.place, {"stiffness": k, "exponent": p}


def _softening(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A preloaded joint part of whose stiffness is lost as it deflects."""
    at = site(machine, rng)
    k = min(1.5 * about(rng, _of("cubic", at.place), 0.2) * severity, 0.5) * at.stiffness
    scale = about(rng, 0.5, 0.3) * at.swing
    return with_law(machine, Law(at.place, "tanh_spring", (k, scale))), at.place, {"stiffness": k, "scale": scale}


def _freeplay(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Clearance in a joint."""
    at = site(machine, rng, spring=True)
    gap = about(rng, _of("gap", at.place)) * severity * at.swing
    p = {"gap": gap, "contact_stiffness": at.stiffness}
    return with_law(machine, Law(at.place, "freeplay", (gap, at.stiffness))), at.place, p


def _rounded_freeplay(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Clearance whose flanks touch gradually: rough surfaces, an oil film."""
    at = site(machine, rng, spring=True)
    gap = about(rng, _of("gap", at.place)) * severity * at.swing
    radius = gap * float(rng.uniform(0.2, 0.7))
    law = Law(at.place, "rounded_freeplay", (gap, at.stiffness, radius))
    return with_law(machine, law), at.place, {"gap": gap, "radius": radius}


def _offset_freeplay(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Clearance that weight has closed on one side for the most part."""
    at = site(machine, rng, spring=True)
    gap, share = 2 * about(rng, _of("gap", at.place)) * severity * at.swing, float(rng.uniform(0.1, 0.35))
    law = Law(at.place, "offset_freeplay", (share * gap, (1 - share) * gap, at.stiffness))
    return with_law(machine, law), at.place, {"gap_below": share * gap, "gap_above": (1 - share) * gap}


def _hertz_freeplay(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Clearance between round flanks that lose energy as they close (Hertz; Hunt and Crossley)."""
    at = site(machine, rng, spring=True)
    gap = about(rng, _of("gap", at.place)) * severity * at.swing
    flank = at.stiffness / np.sqrt(at.swing) * about(rng, 1.2, 0.2)
    law = Law(at.place, "hertz_freeplay", (gap, at.stiffness, flank, float(rng.uniform(0.0, 0.3)) / at.rate))
    return with_law(machine, law), at.place, {"gap": gap, "flank": flank}


def _friction(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Coulomb friction that sticks with a finite stiffness."""
    at = site(machine, rng)
    torque = about(rng, _of("friction", at.place)) * severity * at.stiffness * at.swing
    p = {"torque": torque, "sticking_stiffness": STICKING * at.stiffness}
    return with_law(machine, Law(at.place, "jenkins", (torque, p["sticking_stiffness"]))), at.place, p


def _smooth_friction(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Friction that fades as motion ceases: a greased contact that creeps and never sticks."""
    at = site(machine, rng)
    torque = about(rng, _of("friction", at.place)) * severity * at.stiffness * at.swing
    rate = at.rate * float(rng.uniform(0.003, 0.02))
    return with_law(machine, Law(at.place, "tanh_friction", (torque, rate))), at.place, {"torque": torque, "rate": rate}


def _lugre(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Friction with bristles that is larger before it slides (Canudas de Wit, Olsson, Åström, Lischinsky; Stribeck)."""
    at = site(machine, rng)
    torque = about(rng, _of("friction", at.place)) * severity * at.stiffness * at.swing
    static, rate = torque * float(rng.uniform(1.2, 1.8)), at.rate * float(rng.uniform(0.03, 0.1))
    bristles = at.stiffness * about(rng, 20.0, 0.4)
    values = (torque, static, rate, bristles, 0.3 * np.sqrt(bristles * at.stiffness) / at.omega)
    return (
        with_law(machine, Law(at.place, "lugre", values)),
        at.place,
        {"torque": torque, "static": static, "rate": rate},
    )


def _dahl_friction(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Friction that yields from the first moment on (Dahl): rolling bearings."""
    at = site(machine, rng)
    torque = about(rng, _of("friction", at.place)) * severity * at.stiffness * at.swing
    stiffness = at.stiffness * about(rng, 8.0, 0.4)
    return (
        with_law(machine, Law(at.place, "dahl", (torque, stiffness))),
        at.place,
        {"torque": torque, "stiffness": stiffness},
    )


def _slip(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A spring in parallel with the joint's that slips (Jenkins)."""
    at = site(machine, rng)
    k = about(rng, _of("slip", at.place)) * at.stiffness * severity
    torque = float(rng.uniform(0.05, 0.4)) * k * at.swing
    return (
        with_law(machine, Law(at.place, "jenkins", (torque, k))),
        at.place,
        {"stiffness": k, "slip_torque": torque, "spread": 0.0},
    )


def _iwan(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A bolted joint: sliders whose slips follow a power law (Iwan; Segalman)."""
    at = site(machine, rng)
    k = about(rng, _of("slip", at.place)) * at.stiffness * severity
    reach, chi = float(rng.uniform(0.3, 1.2)) * at.swing, float(rng.uniform(-0.7, -0.2))
    return (
        with_law(machine, Law(at.place, "iwan", (k, reach, chi))),
        at.place,
        {"stiffness": k, "slip": reach, "exponent": chi},
    )


def _dahl_slip(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint that slips gradually, without a state in which it sticks (Dahl)."""
    at = site(machine, rng)
    k = about(rng, _of("slip", at.place)) * at.stiffness * severity
    torque = float(rng.uniform(0.1, 0.5)) * k * at.swing
    return with_law(machine, Law(at.place, "dahl", (torque, k))), at.place, {"stiffness": k, "slip_torque": torque}


def _two_slips(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Two bolts of which one is loose: two sliders, far apart, and grease beside them."""
    at = site(machine, rng)
    k = about(rng, _of("slip", at.place)) * at.stiffness * severity
    share, torque = float(rng.uniform(0.3, 0.7)), float(rng.uniform(0.05, 0.15)) * k * at.swing
    machine = with_law(machine, Law(at.place, "jenkins", (torque, share * k)))
    machine = with_law(machine, Law(at.place, "jenkins", (8 * torque, (1 - share) * k)))
    return machine, at.place, {"stiffness": k, "slip_torque": torque, "share": share}


def _bilinear(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint stiffer one way than the other."""
    at = site(machine, rng, spring=True)
    a = float(np.clip(either(rng) * about(rng, _of("bilinear", at.place)) * severity, -0.8, 0.8))
    return with_law(machine, Law(at.place, "bilinear", (a * at.stiffness,))), at.place, {"asymmetry": a}


def _rounded_bilinear(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The same with a gradual change from one side to the other."""
    at = site(machine, rng, spring=True)
    a = float(np.clip(either(rng) * about(rng, _of("bilinear", at.place)) * severity, -0.8, 0.8))
    radius = at.swing * float(rng.uniform(0.05, 0.3))
    law = Law(at.place, "rounded_bilinear", (a * at.stiffness, radius))
    return with_law(machine, law), at.place, {"asymmetry": a, "radius": radius}


def _offset_bilinear(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint whose stiffness changes beside its rest: a preload that is overcome."""
    at = site(machine, rng, spring=True)
    a = float(np.clip(either(rng) * about(rng, _of("bilinear", at.place)) * severity, -0.7, 0.7))
    where = at.swing * float(rng.uniform(0.05, 0.3))
    law = Law(at.place, "offset_bilinear", (a * at.stiffness, where))
    return with_law(machine, law), at.place, {"asymmetry": a, "where": where}


def _quadratic_spring(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint whose asymmetry grows with its deflection."""
    at = site(machine, rng, spring=True)
    a = float(np.clip(either(rng) * about(rng, _of("bilinear", at.place)) * severity, -0.25, 0.25))
    k2 = a * at.stiffness / at.swing
    return with_law(machine, Law(at.place, "quadratic_spring", (k2,))), at.place, {"stiffness2": k2}


def _quadratic(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Damping that grows with the rate."""
    at = site(machine, rng)
    c = about(rng, _of("quadratic", at.place)) * severity * at.damping / at.rate
    return with_law(machine, Law(at.place, "quadratic_damping", (c,))), at.place, {"coefficient": c}


def _mixed(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A flow that is laminar while slow and turbulent when fast."""
    at = site(machine, rng)
    rate = at.rate * float(rng.uniform(0.05, 0.4))
    c = about(rng, _of("quadratic", at.place)) * severity * at.damping
    return with_law(machine, Law(at.place, "mixed_damper", (c, rate))), at.place, {"coefficient": c, "rate": rate}


def _orifice(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """An orifice that lets pass more one way than the other."""
    at = site(machine, rng)
    c, ratio = about(rng, _of("quadratic", at.place)) * severity * at.damping / at.rate, float(rng.uniform(0.3, 0.7))
    law = Law(at.place, "orifice", (c, ratio * c))
    return with_law(machine, law), at.place, {"coefficient": c, "ratio": ratio}


def _power_damper(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A damper whose force goes with another power of the rate (silicone, a shim stack)."""
    at = site(machine, rng)
    c, p = about(rng, _of("quadratic", at.place)) * severity * at.damping, float(rng.choice([1.5, 3.0]))
    return (
        with_law(machine, Law(at.place, "power_damper", (c, at.rate, p))),
        at.place,
        {"coefficient": c, "exponent": p},
    )


LAW_FORMS: Mapping[str, tuple[Form, ...]] = {
    "cubic_stiffness": (
        Form("cubic", 0, _cubic), Form("quintic_too", 1, _quintic), Form("power", 2, _power), Form("softening", 2, _softening),
    ),
    "freeplay": (
        Form("dead_zone", 0, _freeplay), Form("rounded", 1, _rounded_freeplay), Form("off_centre", 1, _offset_freeplay),
        Form("hertz", 2, _hertz_freeplay),
    ),
    "dry_friction": (
        Form("jenkins", 0, _friction), Form("creeping", 2, _smooth_friction), Form("lugre", 2, _lugre),
        Form("dahl", 1, _dahl_friction),
    ),
    "joint_slip": (
        Form("jenkins", 0, _slip), Form("iwan", 1, _iwan), Form("two_sliders", 1, _two_slips), Form("dahl", 2, _dahl_slip),
    ),
    "bilinear_stiffness": (
        Form("kink", 0, _bilinear), Form("rounded", 1, _rounded_bilinear), Form("beside_rest", 2, _offset_bilinear),
        Form("quadratic", 3, _quadratic_spring),
    ),
    "quadratic_damping": (
        Form("quadratic", 0, _quadratic), Form("mixed", 1, _mixed), Form("orifice", 1, _orifice),
        Form("power", 2, _power_damper),
    ),
}  # fmt: skip
"""Forms of each nonlinear cause, the catalogue's first."""
