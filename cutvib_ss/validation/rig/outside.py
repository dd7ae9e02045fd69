"""
Causes outside the catalogue.

Each is a maker as those of the catalogue are, with other places that are physically the same as its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.validation.rig.fittings import Bob, Crack, Law, Lossy, Skew, Spring, Supports
from cutvib_ss.validation.rig.frames import Frame
from cutvib_ss.validation.rig.sites import (
    SWING,
    AnyMachine,
    Made,
    Maker,
    about,
    either,
    rig_only,
    site,
    with_law,
)
from cutvib_ss.validation.rig.structure import Filter, Rig, Window


@dataclass(frozen=True)
class Kind:
    """A kind of cause that the catalogue lacks."""

    make: Maker  # Makes it
    same: tuple[str, ...] = ()  # Other places that are physically the same as its own
    frames: bool = False  # Whether other structures have it too


def _names(machine: AnyMachine) -> tuple[str, ...]:
    return tuple(c.name for c in machine.channels)


def _mains_interference(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """50 Hz and harmonics on the responses."""
    size = about(rng, 0.4) * severity
    p = {f"amplitude{k}": size * float(rng.uniform(0.3, 1.0)) / k**0.5 for k in range(1, 8)}
    return machine.measured(mains=tuple(p.values())), "measurement", p


def _fractional_damper(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A rubber-like torque c (iω)^α in a joint."""
    at = site(machine, rng, 0.5)
    order = float(rng.uniform(0.3, 0.6))
    coefficient = about(rng, {"joint1": 0.25}.get(at.place, 0.1)) * severity * at.stiffness / at.omega**order
    element = Lossy(at.place, "power", (coefficient, order))
    return machine.fitted(lossy=(element,)), at.place, {"coefficient": coefficient, "order": order}


def _rattling_support(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A pillar on which an end of the rail only rests: it lifts off and lands."""
    k = about(rng, 2e9, 0.4)  # stiff while it bears: what shows is that it lifts off
    preload = about(rng, 4.0, 0.4) / severity
    end = str(rng.choice(["rail_left", "rail_right"]))
    other = 1e10
    sides = {"rail_left": (k, other), "rail_right": (other, k)}[end]
    supports = Supports(*sides, *(0.02 * np.sqrt(s * 30.0) if s == k else 0.0 for s in sides))
    rattling = with_law(rig_only(machine).fitted(supports=supports), Law(end, "lift_off", (k, preload)))
    return rattling, "rail_ends", {"stiffness": k, "preload": preload, "end": end}


_WARMING = {"joint1": ("k1", 0.3), "joint2": ("k2", 0.1), "rail": ("first_frequency", 0.12)}


def _warming(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A value that changes from record to record, as one part of the machine warms up."""
    place = str(rng.choice(list(_WARMING)))
    name, size = _WARMING[place]
    change = -about(rng, size) * severity
    return replace(rig_only(machine), drift={name: change}), place, {"parameter": name, "change": change}


def _saturating_sensor(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A charge amplifier that saturates softly."""
    limit = about(rng, 80.0) / severity
    return machine.measured(saturation=dict.fromkeys(_names(machine), limit)), "measurement", {"limit": limit}


def _joint_coupling(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A hose that couples the two joints: a spring on the difference of their angles."""
    rig = rig_only(machine)
    stiffness = about(rng, 0.04) * severity * rig.head.k2
    return rig.fitted(coupling=stiffness), "joint2", {"stiffness": stiffness}


def _bending(rig: Rig) -> float:
    """EI / L of the rail [N m]."""
    mu = rig.rail.mass / rig.rail.length
    return mu * (2 * np.pi * rig.rail.first_frequency) ** 2 * (rig.rail.length / np.pi) ** 4 / rig.rail.length


def _crack(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A crack in the rail: it bends more at one point."""
    rig, position = rig_only(machine), float(rng.uniform(0.2, 0.8))
    stiffness = _bending(rig) * about(rng, 9.0) / severity
    return rig.fitted(crack=Crack(position, stiffness)), "rail", {"position": position, "stiffness": stiffness}


def _cable_pull(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A cable between tool and base whose stiffness grows as it is drawn taut."""
    rig, travel = rig_only(machine), 0.096 * SWING["joint2"]
    k2 = about(rng, 1.8) * severity * rig.head.k2 / rig.head.l2**2 / travel
    return with_law(rig, Law("tool_x-base_x", "cable", (k2,))), "tool", {"stiffness2": k2}


def _trigger_jitter(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Force and responses on two devices that start together only about."""
    jitter = about(rng, 1.2e-4) * severity
    return machine.measured(jitter=jitter), "measurement", {"jitter": jitter}


def _saturating_damper(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A damper whose force levels off with the rate (a relief valve)."""
    at = site(machine, rng)
    rate = 0.15 * at.rate
    torque = about(rng, {"joint1": 5.0, "joint2": 1.5}.get(at.place, 4.0)) * severity * at.damping * rate
    law = Law(at.place, "saturating_damper", (torque, rate))
    return with_law(machine, law), at.place, {"torque": torque, "rate": rate}


def _side_spring(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A hose that holds the tool along the machine."""
    k = about(rng, 5e4) * severity
    return rig_only(machine).fitted(springs=(Spring(("tool", "ground"), "z", k, 5.0),)), "tool", {"stiffness": k}


def _loose_mount(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """An accelerometer on a mount that resonates."""
    p = {"frequency": about(rng, 700.0, 0.1) * severity**-0.5, "damping_ratio": float(rng.uniform(0.02, 0.1))}
    mount = Filter("resonance", p["frequency"], p["damping_ratio"])
    return machine.measured(filters={_names(machine)[0]: (mount,)}), "measurement", p


def _gyroscope(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A spindle at the tool whose spin couples its motion down with that along the machine."""
    g = either(rng) * about(rng, 700.0) * severity
    return rig_only(machine).fitted(skews=(Skew("tool_x", "tool_z", g),)), "tool", {"coefficient": g}


def _active_joint(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A position loop with a dead time in a joint or port: at some frequencies it takes damping away."""
    at = site(machine, rng, 0.5)
    delay = float(rng.uniform(0.3, 1.2)) * 1e-3
    gain = -about(rng, {"joint1": 0.12, "joint2": 0.05}.get(at.place, 0.04)) * severity * at.stiffness
    if isinstance(machine, Rig) and rng.random() < 0.5:
        # g e^(-sτ) takes g sin(ωτ)/ω of the damper; the joint must keep some
        gain = min(-gain, 0.6 * at.damping * at.omega / np.sin(at.omega * delay))
    loop = Lossy(at.place, "feedback", (gain, 0.0, delay))
    return machine.fitted(lossy=(loop,)), at.place, {"gain": gain, "delay": delay}


def _hose_waves(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A taut hose in which waves run: many resonances, a few in the band."""
    place, port, impedance = "tool", "tool_x", about(rng, 110.0) * severity
    if isinstance(machine, Frame):
        at = site(machine, rng)
        place, port, impedance = at.place, at.place, about(rng, 0.05) * severity * at.stiffness / at.omega
    travel = float(rng.uniform(1 / 300.0, 1 / 120.0))
    wave = Lossy(port, "wave", (impedance, travel, float(rng.uniform(10.0, 40.0))))
    return machine.fitted(lossy=(wave,)), place, {"impedance": impedance, "travel": travel}


def _eddy_brake(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """An eddy-current brake between tool and base: a damper when slow, a spring when fast."""
    k = about(rng, 3e5) * severity
    tau = 1 / (2 * np.pi * float(rng.uniform(60.0, 250.0)))
    element = Lossy("tool_x-base_x", "maxwell", (k, tau))
    return rig_only(machine).fitted(lossy=(element,)), "tool", {"stiffness": k, "time_constant": tau}


def _second_beam(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A tube that hangs on the rail at a point: a second beam with modes of its own."""
    position, first = float(rng.uniform(0.15, 0.85)), float(rng.uniform(35.0, 90.0))
    mass = about(rng, 14.0) * severity
    # clamped-free modes: frequencies 1, 6.27, 17.5; effective masses 0.61, 0.19, 0.065 of the whole
    bobs = tuple(
        Bob(f"rail@{position:.4f}", share * mass, ratio * first, float(rng.uniform(0.01, 0.03)))
        for ratio, share in ((1.0, 0.61), (6.27, 0.19), (17.5, 0.065))
    )
    return rig_only(machine).fitted(bobs=bobs), "rail", {"position": position, "mass": mass, "frequency": first}


def _parametric(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A stiffness that pulses as a shaft turns, whatever the force."""
    at = site(machine, rng)
    k = about(rng, {"joint1": 0.25, "joint2": 0.08}.get(at.place, 0.1)) * severity * at.stiffness
    # of a lightly damped structure the pulse must stay below twice its frequencies, where it would shake itself to pieces
    turns = float(rng.uniform(8.0, 45.0) if isinstance(machine, Rig) else rng.uniform(4.0, 14.0))
    law = Law(at.place, "parametric", (k, 2 * np.pi * turns, float(rng.uniform(0.0, 2 * np.pi))))
    return with_law(machine, law), at.place, {"stiffness": k, "frequency": turns}


def _fading(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A joint that softens as it is shaken and recovers slowly (grease, a thixotropic seal)."""
    at = site(machine, rng)
    k = min(about(rng, {"joint1": 0.5, "joint2": 0.14}.get(at.place, 0.25)) * severity, 0.7) * at.stiffness
    law = Law(at.place, "fading", (k, 0.3 * at.swing, float(np.exp(rng.uniform(np.log(0.02), np.log(0.2))))))
    return with_law(machine, law), at.place, {"stiffness": k}


def _bumper(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Something stands just below the tool, or beside a port, and is struck."""
    place, swing, k = "tool", 4.0e-5, about(rng, 1.0e6)
    if isinstance(machine, Frame):
        at = site(machine, rng)
        place, swing, k = at.place, at.swing, about(rng, 0.8) * at.stiffness
    gap = swing * float(rng.uniform(0.1, 0.4)) / min(severity, 1.5)
    law = Law("tool_x" if place == "tool" else place, "one_sided", (gap, k * min(severity, 1.0), 0.0))
    return with_law(machine, law), place, {"gap": gap, "stiffness": k}


def _wiper(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A wiper that rubs between the head's base and the gantry."""
    force = about(rng, 9.0, 0.4) * severity
    law = Law("base_x", "jenkins", (force, about(rng, 6e6, 0.3)))
    return with_law(rig_only(machine), law), "head_base", {"force": force}


def _feedthrough(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The force's cable beside those of the responses: they pick up part of its signal."""
    part = either(rng) * about(rng, 0.08) * severity
    return machine.measured(feedthrough=part), "measurement", {"fraction": part}


def _clock(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Two devices whose clocks differ."""
    rate = either(rng) * about(rng, 1.5e-3) * severity
    return machine.measured(clock=rate), "measurement", {"rate": rate}


def _zero_shift(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Piezoelectric sensors whose zero jumps under the shock and creeps back."""
    size, rate = about(rng, 0.25) * severity, float(rng.uniform(20.0, 120.0))
    return machine.measured(shift=(size, rate)), "measurement", {"size": size, "rate": rate}


def _even_distortion(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """Sensors whose sensitivity differs between push and pull."""
    level = about(rng, 250.0) / severity
    return machine.measured(asymmetry=dict.fromkeys(_names(machine), level)), "measurement", {"level": level}


def _swapped_window(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """The force's window laid over the responses: they end when the blow is over."""
    start = float(np.clip(about(rng, 0.09, 0.2) / severity, 0.056, 0.3))
    return machine.measured(window=Window("late", 80.0, start)), "measurement", {"start": start}


def _leaning_blows(machine: AnyMachine, severity: float, rng: np.random.Generator) -> Made:
    """A hammer that leans: part of each blow goes along the machine, always the same way."""
    lean = either(rng) * about(rng, 0.12) * severity
    return replace(rig_only(machine), lean=lean), "measurement", {"lean": lean}


OUTSIDE: Mapping[str, Kind] = {
    "mains_interference": Kind(_mains_interference),
    "fractional_damper": Kind(_fractional_damper, frames=True),
    "rattling_support": Kind(_rattling_support),
    "warming": Kind(_warming),
    "saturating_sensor": Kind(_saturating_sensor),
    "joint_coupling": Kind(_joint_coupling, ("joint1",)),
    "crack": Kind(_crack),
    "cable_pull": Kind(_cable_pull, ("head_base",)),
    "trigger_jitter": Kind(_trigger_jitter, frames=True),
    "saturating_damper": Kind(_saturating_damper, frames=True),
    "side_spring": Kind(_side_spring),
    "loose_mount": Kind(_loose_mount, frames=True),
    "gyroscope": Kind(_gyroscope),
    "active_joint": Kind(_active_joint, frames=True),
    "hose_waves": Kind(_hose_waves, frames=True),
    "eddy_brake": Kind(_eddy_brake, ("head_base",)),
    "second_beam": Kind(_second_beam),
    "parametric": Kind(_parametric, frames=True),
    "fading": Kind(_fading, frames=True),
    "bumper": Kind(_bumper, frames=True),
    "wiper": Kind(_wiper, ("rail",)),
    "feedthrough": Kind(_feedthrough),
    "clock": Kind(_clock, frames=True),
    "zero_shift": Kind(_zero_shift, frames=True),
    "even_distortion": Kind(_even_distortion),
    "swapped_window": Kind(_swapped_window, frames=True),
    "leaning_blows": Kind(_leaning_blows, ("tool",)),
}
"""Every kind outside the catalogue; an element between two places may be said to sit at either."""
