"""Linear causes of the catalogue in head, tool and joints, each in the forms in which real parts have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from cutvib_ss.validation.rig.fittings import Bob, Law, Lossy, Tie
from cutvib_ss.validation.rig.frames import Frame
from cutvib_ss.validation.rig.sites import (
    MIDDLE,
    TYPICAL,
    AnyMachine,
    Form,
    Made,
    Site,
    about,
    either,
    port_site,
    rig_only,
    site,
    with_law,
)
from cutvib_ss.validation.rig.structure import Rig


def _resonator_site(machine: AnyMachine, rng: np.random.Generator) -> tuple[str, str, float]:
    """Place, port in X, and the mass of a resonator that shows."""
    if isinstance(machine, Rig):
        place = str(rng.choice(["tool", "head"]))
        return place, f"{place}_x", {"tool": 0.06, "head": 3.0}[place]
    at = _grounded(machine, rng)
    return at.place, at.place, 0.1 * _mass_at(at)


def _grounded(frame: Frame, rng: np.random.Generator) -> Site:
    """A port of a structure that is one coordinate: what is added there is added to that coordinate."""
    return port_site(frame, str(rng.choice([name for name in sorted(frame.ports) if name.startswith("p")])))


def _mass_at(at: Site) -> float:
    """Mass that goes with a port: of its stiffness at the frequency of most of its motion."""
    return at.stiffness / at.omega**2


def _resonator_values(
    machine: AnyMachine, severity: float, rng: np.random.Generator
) -> tuple[str, str, dict[str, float]]:
    place, port, mass = _resonator_site(machine, rng)
    p = {
        "mass": about(rng, mass) * severity,
        "frequency": float(np.exp(rng.uniform(np.log(80.0), np.log(380.0)))),
        "damping_ratio": float(rng.uniform(0.01, 0.05)),
    }
    return place, port, p


def _resonator(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A panel or hose that resonates along the force."""
    place, port, p = _resonator_values(machine, severity, rng)
    return machine.fitted(bobs=(*machine.fittings.bobs, Bob(port, **p))), place, p


def _mounted_resonator(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The same with the mass of its mount, which moves with the machine both ways."""
    place, port, p = _resonator_values(machine, severity, rng)
    mount = p["mass"] * float(rng.uniform(0.2, 0.6))
    ties = [Tie(one, mass=mount) for one in _both_ways(machine, port)]
    fitted = machine.fitted(bobs=(*machine.fittings.bobs, Bob(port, **p)), ties=(*machine.fittings.ties, *ties))
    return fitted, place, p | {"mount": mount}


def _both_ways(machine: AnyMachine, port: str) -> list[str]:
    return [port, port[:-1] + "z"] if isinstance(machine, Rig) else [port]


def _panel(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A panel with two modes."""
    place, port, p = _resonator_values(machine, severity, rng)
    ratio = float(rng.uniform(1.4, 2.6))
    second = Bob(port, 0.4 * p["mass"], ratio * p["frequency"], p["damping_ratio"])
    fitted = machine.fitted(bobs=(*machine.fittings.bobs, Bob(port, **p), second))
    return fitted, place, p | {"ratio": ratio}


def _pendulum(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass that swings across the force (at a port: one on a mount)."""
    if not isinstance(machine, Rig):
        return _mounted_resonator(machine, severity, rng)
    place, port, p = _resonator_values(machine, severity, rng)
    across = Bob(port[:-1] + "z", **p)
    return machine.fitted(bobs=(*machine.fittings.bobs, across)), place, p | {"angle_deg": 90.0}


def _oblique_resonator(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass that swings at an angle to the force (at a port: one whose spring loses as rubber does)."""
    place, port, p = _resonator_values(machine, severity, rng)
    if isinstance(machine, Rig):
        angle = np.deg2rad(float(rng.uniform(20.0, 55.0)) * either(rng))
        port = f"{np.cos(angle):.4f}*{place}_x{np.sin(angle):+.4f}*{place}_z"
        # across its spring it goes with what it hangs on
        across = Tie(f"{-np.sin(angle):.4f}*{place}_x{np.cos(angle):+.4f}*{place}_z", mass=p["mass"])
        fitted = machine.fitted(bobs=(*machine.fittings.bobs, Bob(port, **p)), ties=(*machine.fittings.ties, across))
        return fitted, place, p | {"angle_deg": float(np.rad2deg(angle))}
    return _mounted_resonator(machine, severity, rng)


def _mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass that the model lacks, or has too much of."""
    sign = 1.0 if rng.random() < 0.75 else -1.0
    if isinstance(machine, Rig):
        place = str(rng.choice(["tool", "head"]))
        name = {"tool": "m2", "head": "m1"}[place]
        mass = about(rng, {"tool": 0.04, "head": 3.5}[place]) * severity * sign
        return machine.scaled({name: 1 + mass / machine.value(name)}), place, {"mass": mass}
    at = _grounded(machine, rng)
    mass = about(rng, 0.1 * _mass_at(at)) * severity
    return machine.fitted(ties=(*machine.fittings.ties, Tie(at.place, mass=mass))), at.place, {"mass": mass}


def _overhung_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass that stands off the link's tip: it turns with the link too."""
    if not isinstance(machine, Rig):
        return _soft_mass(machine, severity, rng)
    place = str(rng.choice(["tool", "head"]))
    mass = about(rng, {"tool": 0.04, "head": 3.5}[place]) * severity
    arm = float(rng.uniform(0.3, 0.7)) * machine.value({"tool": "l2", "head": "l1"}[place])
    turn = {"tool": "joint1+joint2", "head": "joint1"}[place]
    ties = [Tie(f"{place}_{axis}", mass=mass) for axis in "xz"] + [Tie(turn, mass=mass * arm**2)]
    return machine.fitted(ties=(*machine.fittings.ties, *ties)), place, {"mass": mass, "arm": arm}


def _soft_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A mass on a mount that is not rigid: it resonates above the band."""
    place, port, mass = _resonator_site(machine, rng)
    mass = about(rng, {"tool": 0.04, "head": 3.5}.get(place, mass)) * severity
    q = {"frequency": float(rng.uniform(600.0, 1200.0)), "damping_ratio": float(rng.uniform(0.01, 0.05))}
    bobs = [Bob(one, mass, **q) for one in _both_ways(machine, port)]
    return machine.fitted(bobs=(*machine.fittings.bobs, *bobs)), place, {"mass": mass} | q


def _hanging_mass(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A hose: part of its mass goes with the machine, part hangs below on a soft spring."""
    place, port, mass = _resonator_site(machine, rng)
    mass = about(rng, {"tool": 0.04, "head": 3.5}.get(place, mass)) * severity
    low = float(rng.uniform(5.0, 12.0))
    ties = [Tie(one, mass=mass) for one in _both_ways(machine, port)]
    bob = Bob(port, 1.5 * mass, low, 0.15)
    fitted = machine.fitted(ties=(*machine.fittings.ties, *ties), bobs=(*machine.fittings.bobs, bob))
    return fitted, place, {"mass": mass, "frequency": low}


def _contact_values(
    machine: AnyMachine, severity: float, rng: np.random.Generator
) -> tuple[str, str, dict[str, float]]:
    if isinstance(machine, Rig):
        k, c = about(rng, 2.2e5) * severity, float(rng.uniform(0.0, 40.0)) * severity
        return "tool", "tool_x", {"stiffness": k, "damping": c}
    at = _grounded(machine, rng)
    k = about(rng, 0.15) * at.stiffness * severity
    return at.place, at.place, {"stiffness": k, "damping": float(rng.uniform(0.0, 0.2)) * k / at.omega}


def _contact(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Belt or cloth holds the tool."""
    place, port, p = _contact_values(machine, severity, rng)
    return machine.fitted(ties=(*machine.fittings.ties, Tie(port, **p))), place, p


def _heavy_contact(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A belt whose mass moves along."""
    place, port, p = _contact_values(machine, severity, rng)
    mass = p["stiffness"] / (2 * np.pi * float(rng.uniform(250.0, 600.0))) ** 2
    return machine.fitted(ties=(*machine.fittings.ties, Tie(port, **p, mass=mass))), place, p | {"mass": mass}


def _felt(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Felt or cloth: stiffer and lossier the faster it is pressed."""
    place, port, p = _contact_values(machine, severity, rng)
    order = float(rng.uniform(0.15, 0.4))
    lossy = Lossy(port, "power", (p["stiffness"] / (2 * np.pi * MIDDLE) ** order, order))
    return machine.fitted(lossy=(*machine.fittings.lossy, lossy)), place, {"stiffness": p["stiffness"], "order": order}


def _oblique_contact(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A spring that holds the tool at an angle (at a port: one with a mass)."""
    if not isinstance(machine, Rig):
        return _heavy_contact(machine, severity, rng)
    place, _, p = _contact_values(machine, severity, rng)
    angle = np.deg2rad(float(rng.uniform(12.0, 40.0)) * either(rng))
    tie = Tie(f"{np.cos(angle):.4f}*tool_x{np.sin(angle):+.4f}*tool_z", **p)
    return machine.fitted(ties=(*machine.fittings.ties, tie)), place, p | {"angle_deg": float(np.rad2deg(angle))}


def _hertz_contact(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A stop that the tool is pressed against: stiffer the harder (Hertz), and it may lift off."""
    place, port, p = _contact_values(machine, severity, rng)
    swing = 4e-5 if isinstance(machine, Rig) else port_site(machine, port).swing
    approach = swing * float(np.exp(rng.uniform(np.log(0.3), np.log(3.0))))
    fitted = machine.fitted(ties=(*machine.fittings.ties, Tie(port, **p)))
    law = Law(port, "preloaded_hertz", (p["stiffness"], approach))
    return with_law(fitted, law), place, p | {"approach": approach}


_SHIFTS = {
    "k1": ("joint1", 0.08), "c1": ("joint1", 0.9), "k2": ("joint2", 0.05), "c2": ("joint2", 0.6), "l1": ("head", 0.06),
    "l2": ("tool", 0.015), "mass": ("rail", 0.25), "first_frequency": ("rail", 0.08), "damping_ratio": ("rail", 1.0),
}  # fmt: skip
_FRAME_SHIFTS = {"mass": 0.08, "damping": 1.0, "stiffness": 0.12}


def _shift(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """One value is off."""
    if isinstance(machine, Rig):
        name = str(rng.choice(list(_SHIFTS)))
        place, size = _SHIFTS[name]
    else:
        name = str(rng.choice(list(_FRAME_SHIFTS)))
        place, size = "structure", _FRAME_SHIFTS[name]
    factor = float(np.exp(either(rng) * about(rng, size, 0.2) * severity))
    return machine.scaled({name: factor}), place, {"parameter": name, "factor": factor}


def _worn_joint(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A worn joint: its stiffness falls and its damping rises, by more than their tolerances."""
    if not isinstance(machine, Rig):
        return _shift(machine, severity, rng)
    at = site(machine, rng)
    name, loss = at.place[-1], about(rng, {"joint1": 0.08, "joint2": 0.05}[at.place], 0.2) * severity
    factors = {f"k{name}": float(np.exp(-loss)), f"c{name}": float(np.exp(about(rng, 4.0) * loss))}
    return machine.scaled(factors), at.place, {"parameter": f"k{name}", "factor": factors[f"k{name}"]}


def _relaxing_joint(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint that is softer to slow motion than to fast, as a plastic bush is (three-parameter solid)."""
    if not isinstance(machine, Rig):
        return _shift(machine, severity, rng)
    at = site(machine, rng)
    change = about(rng, {"joint1": 0.12, "joint2": 0.07}[at.place], 0.2) * severity
    tau = 1 / (2 * np.pi * float(rng.uniform(40.0, 200.0)))
    lossy = Lossy(at.place, "maxwell", (change * at.stiffness, tau))
    p: dict[str, float | str] = {"parameter": f"k{at.place[-1]}", "change": change, "time_constant": tau}
    return machine.fitted(lossy=(*machine.fittings.lossy, lossy)), at.place, p


def _uneven_damping(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A rail whose damping grows with frequency: the tolerance is of one ratio for all modes."""
    if not isinstance(machine, Rig):
        return _shift(machine, severity, rng)
    slope = about(rng, 0.9, 0.2) * severity
    return (
        replace(machine, rail=replace(machine.rail, damping_slope=slope)),
        "rail",
        {"parameter": "damping_ratio", "slope": slope},
    )


def _loss(machine: Rig, severity: float, rng: np.random.Generator) -> tuple[Rig, Site, float]:
    """A joint without its viscous damper, and the loss factor that takes its place."""
    at = site(machine, rng, 0.5)
    loss = float(at.damping * TYPICAL / at.stiffness * np.exp(either(rng) * about(rng, 0.45, 0.2) * severity))
    return machine.scaled({"c" + at.place[-1]: 0.0}), at, loss


def _lossy_joint(kind: str, machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A hysteretic joint in place of a viscous one."""
    rig, at, loss = _loss(rig_only(machine), severity, rng)
    omega = 2 * np.pi * MIDDLE
    p: dict[str, float | str] = {"loss_factor": loss}
    if kind == "storage":
        element = Lossy(at.place, kind, (at.stiffness, omega, 2 / np.pi * float(np.arctan(loss))))
        p |= {"form": "causal", "reference_frequency": MIDDLE}
    elif kind == "log":
        element = Lossy(at.place, kind, (loss * at.stiffness, omega))
    else:
        element = Lossy(at.place, "constant", (loss * at.stiffness,))
        p |= {"form": "constant"}
    return rig.fitted(lossy=(*rig.fittings.lossy, element)), at.place, p


def _rubber_joint(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A bush with two relaxation times: its loss peaks twice in the band."""
    rig, at, loss = _loss(rig_only(machine), severity, rng)
    elements = tuple(
        Lossy(at.place, "maxwell", (1.3 * loss * at.stiffness, 1 / (2 * np.pi * f)))
        for f in (float(rng.uniform(20.0, 60.0)), float(rng.uniform(180.0, 400.0)))
    )
    return rig.fitted(lossy=(*rig.fittings.lossy, *elements)), at.place, {"loss_factor": loss}


HEAD_FORMS: Mapping[str, tuple[Form, ...]] = {
    "local_resonator": (
        Form("along", 0, _resonator), Form("with_mount", 1, _mounted_resonator), Form("two_modes", 2, _panel),
        Form("oblique", 2, _oblique_resonator), Form("across", 2, _pendulum),
    ),
    "added_mass": (
        Form("rigid", 0, _mass), Form("overhung", 1, _overhung_mass), Form("soft_mount", 1, _soft_mass),
        Form("hanging", 2, _hanging_mass),
    ),
    "tool_contact": (
        Form("spring", 0, _contact), Form("heavy_belt", 1, _heavy_contact), Form("felt", 1, _felt),
        Form("oblique", 2, _oblique_contact), Form("hertz", 3, _hertz_contact),
    ),
    "parameter_shift": (
        Form("one_value", 0, _shift), Form("worn", 1, _worn_joint), Form("relaxing", 2, _relaxing_joint),
        Form("uneven_damping", 2, _uneven_damping),
    ),
    "structural_damping": (
        Form("causal", 0, lambda m, s, r: _lossy_joint("storage", m, s, r)),
        Form("constant", 1, lambda m, s, r: _lossy_joint("constant", m, s, r)),
        Form("logarithmic", 1, lambda m, s, r: _lossy_joint("log", m, s, r)),
        Form("relaxing", 2, _rubber_joint),
    ),
}  # fmt: skip
"""Forms of each cause, the catalogue's first."""
