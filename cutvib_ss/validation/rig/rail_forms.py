"""Linear causes of the catalogue in the rail, its ends and the guide, each in the forms in which real parts have it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cutvib_ss.validation.rig.fittings import Bob, Law, Lossy, Lump, Shear, Supports, Tie, Twist
from cutvib_ss.validation.rig.sites import MIDDLE, AnyMachine, Form, Made, about, either, rig_only, with_law


def _twist(rng: np.random.Generator, severity: float) -> dict[str, float]:
    return {
        "eccentricity": either(rng) * about(rng, 0.045) * severity,
        "inertia": about(rng, 0.5, 0.5),
        "torsion_frequency": about(rng, 240.0, 0.3) * severity**-0.3,
        "damping_ratio": about(rng, 0.02, 0.5),
    }


def _torsion(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The head hangs beside the shear centre of a rail that twists."""
    p = _twist(rng, severity)
    return rig_only(machine).fitted(twist=Twist(**p)), "rail", p


def _soft_ended_torsion(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The same with ends that turn: the rail twists more evenly."""
    p = _twist(rng, severity)
    ends = float(rng.uniform(2.0, 8.0))
    return rig_only(machine).fitted(twist=Twist(**p, ends=ends)), "rail", p | {"ends": ends}


def _skewed_torsion(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A rail whose shear centre wanders along it."""
    p = _twist(rng, severity)
    slope = float(rng.uniform(0.4, 1.0)) * either(rng)
    return rig_only(machine).fitted(twist=Twist(**p, slope=slope)), "rail", p | {"slope": slope}


def _rocking_rail(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A stiff rail that rocks on its fixings: the same twist everywhere."""
    p = _twist(rng, severity) | {"torsion_frequency": about(rng, 200.0, 0.2)}
    return rig_only(machine).fitted(twist=Twist(**p, ends=np.pi**2 / 50, stiffer=25.0)), "rail", p


def _support_values(rng: np.random.Generator, severity: float) -> dict[str, float]:
    k = {side: about(rng, 5e7, 0.7) / severity for side in ("k_left", "k_right")}
    return k | {"c" + side[1:]: float(rng.uniform(0.2, 1.0) * 0.04 * np.sqrt(v * 30.0)) for side, v in k.items()}


def _supports(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Springs under the rail's ends, each side its own."""
    p = _support_values(rng, severity)
    return rig_only(machine).fitted(supports=Supports(**p)), "rail_ends", p


def _heavy_pillars(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Pillars that have a mass of their own, and so an inertia in series with the ground."""
    p, rig = _support_values(rng, severity), rig_only(machine)
    mass = {side: about(rng, 12.0, 0.6) for side in ("left", "right")}
    ties = tuple(Tie(f"rail_{side}", mass=m) for side, m in mass.items())
    return rig.fitted(supports=Supports(**p), ties=(*rig.fittings.ties, *ties)), "rail_ends", p | mass


def _rubber_feet(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Rubber under the pillars: loss that hardly depends on frequency, stiffness that grows with it."""
    p, rig = _support_values(rng, severity), rig_only(machine)
    order = float(rng.uniform(0.06, 0.16))
    soft = Supports(p["k_left"], p["k_right"])
    lossy = tuple(
        Lossy(f"rail_{side}", "storage", (p[f"k_{side}"], 2 * np.pi * MIDDLE, order)) for side in ("left", "right")
    )
    p = {"k_left": p["k_left"], "k_right": p["k_right"], "order": order}
    return rig.fitted(supports=soft, lossy=(*rig.fittings.lossy, *lossy)), "rail_ends", p


def _common_floor(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Both pillars on one floor plate that gives: one end sinks when the other is loaded."""
    p, rig = _support_values(rng, severity), rig_only(machine)
    # springs a and b to a plate on a spring g: K = diag(a, b) - [a, b]ᵀ[a, b]/(a + b + g), as diag plus a tie across
    a, b = p["k_left"], p["k_right"]
    g = (a + b) * float(rng.uniform(0.5, 2.0))
    total = a + b + g
    ends = Supports(a * g / total, b * g / total, p["c_left"], p["c_right"])
    across = Tie("rail_left-rail_right", stiffness=a * b / total)
    return rig.fitted(supports=ends, ties=(*rig.fittings.ties, across)), "rail_ends", p | {"floor": g}


def _hertz_supports(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Feet that stand on rounded pads: stiffer the harder they are pressed (Hertz)."""
    p, rig = _support_values(rng, severity), rig_only(machine)
    approach = float(np.exp(rng.uniform(np.log(3e-6), np.log(2e-5))))
    out: AnyMachine = rig.fitted(supports=Supports(**p))
    for side in ("left", "right"):
        out = with_law(out, Law(f"rail_{side}", "preloaded_hertz", (p[f"k_{side}"], approach)))
    return out, "rail_ends", p | {"approach": approach}


def _fixity_values(rng: np.random.Generator, severity: float) -> dict[str, float]:
    return {side: about(rng, 1.2e5, 0.7) * severity for side in ("k_left", "k_right")}


def _fixity(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Rotational springs at the rail's ends."""
    p = _fixity_values(rng, severity)
    return rig_only(machine).fitted(fixity=(p["k_left"], p["k_right"])), "rail_ends", p


def _lossy_fixity(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Rotational springs that lose energy, with the inertia of an end plate."""
    p, rig = _fixity_values(rng, severity), rig_only(machine)
    loss, inertia = float(rng.uniform(0.05, 0.3)), float(rng.uniform(0.005, 0.03))
    ties = tuple(
        Tie(f"turn_{side}", p[f"k_{side}"], loss * p[f"k_{side}"] / (2 * np.pi * MIDDLE), inertia)
        for side in ("left", "right")
    )
    return rig.fitted(ties=(*rig.fittings.ties, *ties)), "rail_ends", p | {"loss": loss, "inertia": inertia}


def _long_clamp(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Clamps of some length: a second support a little inside each end, which holds the slope by holding the deflection."""
    p, rig = _fixity_values(rng, severity), rig_only(machine)
    arm = float(rng.uniform(0.05, 0.1)) * rig.rail.length
    share = arm / rig.rail.length
    ties = tuple(Tie(f"rail@{y:.4f}", p[f"k_{side}"] / arm**2) for side, y in (("left", share), ("right", 1 - share)))
    return rig.fitted(ties=(*rig.fittings.ties, *ties)), "rail_ends", p | {"arm": arm}


def _mass_values(rng: np.random.Generator, severity: float) -> dict[str, float]:
    return {
        "position": float(rng.uniform(0.12, 0.88)),
        "mass": about(rng, 6.0) * severity,
        "damping": float(rng.uniform(0.0, 80.0)) * severity,
    }


def _rail_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A cable carrier on the rail."""
    p, rig = _mass_values(rng, severity), rig_only(machine)
    return rig.fitted(lumps=(*rig.fittings.lumps, Lump(**p))), "rail", p


def _spread_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass spread over part of the rail."""
    p, rig = _mass_values(rng, severity), rig_only(machine)
    width = float(rng.uniform(0.1, 0.3))
    centre = float(np.clip(p["position"], 0.02 + width / 2, 0.98 - width / 2))
    lumps = tuple(
        Lump(round(float(y), 4), p["mass"] / 7, p["damping"] / 7) for y in centre + width * np.linspace(-0.5, 0.5, 7)
    )
    return rig.fitted(lumps=(*rig.fittings.lumps, *lumps)), "rail", p | {"position": centre, "width": width}


def _sprung_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass that is not bolted tight: it resonates above or in the upper part of the band."""
    p, rig = _mass_values(rng, severity), rig_only(machine)
    q = {"frequency": float(rng.uniform(180.0, 500.0)), "damping_ratio": float(rng.uniform(0.02, 0.1))}
    bob = Bob(f"rail@{p['position']:.4f}", p["mass"], **q)
    return rig.fitted(bobs=(*rig.fittings.bobs, bob)), "rail", p | q


def _held_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass that hangs on its cables: a spring to the gantry too."""
    p, rig = _mass_values(rng, severity), rig_only(machine)
    k = p["mass"] * (2 * np.pi * float(rng.uniform(15.0, 60.0))) ** 2
    tie = Tie(f"rail@{p['position']:.4f}", k)
    lumps = (*rig.fittings.lumps, Lump(**p))
    return rig.fitted(lumps=lumps, ties=(*rig.fittings.ties, tie)), "rail", p | {"stiffness": k}


def _shear(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Shear and rotary inertia of the rail's section."""
    ratio = about(rng, 80.0, 0.2) / severity
    return rig_only(machine).fitted(shear=Shear(ratio, float(rng.uniform(0.2, 0.36)))), "rail", {"shear_ratio": ratio}


def _shear_alone(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A thin web between flanges: it shears, and its section has hardly any rotary inertia."""
    ratio = about(rng, 80.0, 0.2) / severity
    return rig_only(machine).fitted(shear=Shear(ratio, 0.01)), "rail", {"shear_ratio": ratio}


def _pierced_web(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A web that is pierced in part of the rail: it shears there alone."""
    ratio = about(rng, 80.0, 0.2) / severity
    begin = float(rng.uniform(0.1, 0.5))
    soft = (begin, begin + float(rng.uniform(0.25, 0.45)))
    p = {"shear_ratio": ratio, "from": soft[0], "to": soft[1]}
    return rig_only(machine).fitted(shear=Shear(ratio, float(rng.uniform(0.1, 0.3)), soft)), "rail", p


def _guide_values(rng: np.random.Generator, severity: float) -> dict[str, float]:
    k = about(rng, 1e8, 0.4) / severity
    return {"stiffness": k, "damping": float(rng.uniform(0.2, 1.0) * 0.04 * np.sqrt(k * 25.0))}


def _guide(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The guide's balls give."""
    p = _guide_values(rng, severity)
    return rig_only(machine).fitted(guide=(p["stiffness"], p["damping"])), "head_base", p


def _heavy_carriage(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A carriage on the rail's side of the balls: a mass goes with the rail."""
    p, rig = _guide_values(rng, severity), rig_only(machine)
    mass = float(rng.uniform(0.5, 2.5))
    ties = (*rig.fittings.ties, Tie("base_x", mass=mass))
    return rig.fitted(guide=(p["stiffness"], p["damping"]), ties=ties), "head_base", p | {"carriage": mass}


def _lossy_guide(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Balls and their cage lose a share of each cycle's energy, whatever its frequency."""
    p, rig = _guide_values(rng, severity), rig_only(machine)
    order = float(rng.uniform(0.04, 0.12))
    lossy = Lossy("guide", "storage", (p["stiffness"], 2 * np.pi * MIDDLE, order))
    fitted = rig.fitted(guide=(p["stiffness"], 0.0), lossy=(*rig.fittings.lossy, lossy))
    return fitted, "head_base", {"stiffness": p["stiffness"], "order": order}


def _preloaded_balls(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Balls under little preload: their contacts soften as they are relieved (Hertz)."""
    p, rig = _guide_values(rng, severity), rig_only(machine)
    approach = float(np.exp(rng.uniform(np.log(2e-6), np.log(1e-5))))
    fitted = rig.fitted(guide=(p["stiffness"], p["damping"]))
    law = Law("guide", "preloaded_hertz", (p["stiffness"], approach))
    return with_law(fitted, law), "head_base", p | {"approach": approach}


RAIL_FORMS: Mapping[str, tuple[Form, ...]] = {
    "rail_torsion": (
        Form("shaft", 0, _torsion), Form("soft_ends", 1, _soft_ended_torsion), Form("wandering_centre", 1, _skewed_torsion),
        Form("rocking", 2, _rocking_rail),
    ),
    "support_compliance": (
        Form("springs", 0, _supports), Form("heavy_pillars", 1, _heavy_pillars), Form("rubber", 1, _rubber_feet),
        Form("common_floor", 2, _common_floor), Form("hertz", 2, _hertz_supports),
    ),
    "end_fixity": (
        Form("springs", 0, _fixity), Form("lossy_plates", 1, _lossy_fixity), Form("long_clamps", 2, _long_clamp),
    ),
    "rail_added_mass": (
        Form("lump", 0, _rail_mass), Form("spread", 1, _spread_mass), Form("sprung", 2, _sprung_mass), Form("held", 2, _held_mass),
    ),
    "rail_shear": (Form("timoshenko", 0, _shear), Form("thin_web", 1, _shear_alone), Form("pierced_web", 2, _pierced_web)),
    "guide_compliance": (
        Form("spring", 0, _guide), Form("heavy_carriage", 1, _heavy_carriage), Form("lossy", 1, _lossy_guide),
        Form("hertz", 2, _preloaded_balls),
    ),
}  # fmt: skip
"""Forms of each cause, the catalogue's first."""
