"""
How each fault of a place enters the responses.

Elements in parallel need receptances alone. What lies behind the head's base enters through the forces that pass there: the guide
gives between rail and head; a change of the rail is a change of its receptance; ends that give add t(ω, y)ᵀ (1 + C S)^-1 C t(ω, y)
to it, t being the forces on the pinned ends and S what the freed rail opposes there; twist of the rail gives the base a rotation.

A force on the rail itself moves it under the head by a without the head. What passes there is the total motion less a, over A; a
changes with the rail too, so that a channel through which p passes shows ΔH = p (Δa + d ΔA) / (1 + S ΔA), d being what passes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.diagnosis.modification import Elements, Lines, RailModes
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.model.elements import SpringDamperMass
from cutvib_ss.model.rail import EndSupports, RailAttachment, Torsion
from cutvib_ss.response.rail_receptance import RailPort, RailReceptance
from cutvib_ss.results import ComplexArray, FloatArray

# -- elements in parallel -----------------------------------------------------------------------------------------------------


def in_parallel(v: Lines, ports: Sequence[str], ties: FloatArray) -> Elements:
    """Elements between ports and ground, or across a relative port."""
    left = np.array([v.shown(p) for p in ports])
    right = np.array([v.driven(p) for p in ports])
    own = np.array([[v.between(p, q) for q in ports] for p in ports])
    return Elements(v.response, left, right, own, ties, -1)


def across(v: Lines, one: str, other: str) -> Elements:
    """An element that opposes two ports' being parted."""
    own = v.between(one, one) + v.between(other, other) - 2.0 * v.between(one, other)
    right = v.driven(one) - v.driven(other)
    return Elements(v.response, (v.shown(one) - v.shown(other))[None], right[None], own[None, None], np.eye(1), -1)


def at_point(v: Lines, y: float) -> Elements:
    """An element between a point of the rail and ground."""
    return in_parallel(v, (f"rail({y!r})",), np.eye(1))


# -- what lies behind the head's base -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Interface:
    """Where two parts meet: forces that pass, and the stiffness against being parted."""

    passed: list[ComplexArray]  # of each channel, (row, frequency)
    driven: ComplexArray  # of the input
    opposing: ComplexArray


def _interface(v: Lines, port: str, own: ComplexArray) -> _Interface:
    """From receptances alone: what moves the far side is the force that passes, times its own receptance."""
    passed = [v.between(port, r) / own for r in v.reads]
    return _Interface(passed, v.driven(port) / own, (own - v.between(port, port)) / own**2)


def _base(v: Lines) -> _Interface:
    rail, field = v.receptance.rail, v.receptance.base_field
    own = rail.product(field, field)
    at = _interface(v, "at_head", own)
    if v.struck is None:
        return at
    return replace(at, driven=at.driven - _struck(v, lambda y: rail.product(rail.field(rail.point(y)), field)) / own)


def _struck(v: Lines, at: Callable[[FloatArray], ComplexArray]) -> ComplexArray:
    """What a force on the rail adds in the rows that have one, from its value at points y / L; zero in the others."""
    y = v.struck
    assert y is not None
    on_rail = np.isfinite(y)
    return np.where(on_rail[:, None], at(np.where(on_rail, y, 0.5)), 0.0)


def guide(v: Lines) -> Elements:
    """A guide that gives between rail and head."""
    at = _base(v)
    return Elements(v.response, v.through(at.passed)[None], at.driven[None], at.opposing[None, None], np.eye(1), 1)


def _behind(v: Lines, loads_at: Callable[[FloatArray], ComplexArray], own: ComplexArray, sign: int) -> Elements:
    """A change loadsᵀ (1 + U own)^-1 U loads of the rail's receptance between points y / L, as the head passes it on."""
    at = _base(v)
    loads = loads_at(v.group.positions)
    loads = np.broadcast_to(loads, (len(loads), *at.opposing.shape))
    right = at.driven * loads
    if v.struck is not None:
        right = right + _struck(v, loads_at)
    left = np.array([v.through([p * t for p in at.passed]) for t in loads])
    through = np.array([[at.opposing * t * u for u in loads] for t in loads])
    return Elements(v.response, left, right, own[:, :, None, :] + sign * through, np.eye(len(loads)), sign)


def end_supports(v: Lines) -> Elements:
    """Ends that give: one compliance at y = 0, one at y = L."""
    rail = v.receptance.rail.model
    p = rail.parameters
    k = SETTINGS.faults_end_stiffness * p.mass / 2 * (2 * np.pi * p.first_frequency) ** 2
    freed = RailReceptance(replace(rail, supports=EndSupports(k, k)), v.s)
    ends = [freed.field(freed.point([y])) for y in (0.0, 1.0)]
    # At the ends the motion is (K + S)^-1 t: S from forces there, t from a force under the head.
    moved = np.array([[freed.product(e, f)[0] for f in ends] for e in ends])
    stiffness: ComplexArray = np.moveaxis(np.linalg.inv(np.moveaxis(moved, -1, 0)), 0, -1)

    def loads(y: FloatArray) -> ComplexArray:
        there = freed.field(freed.point(y))
        out: ComplexArray = np.einsum("ijf,jpf->ipf", stiffness, np.array([freed.product(e, there) for e in ends]))
        return out

    return _behind(v, loads, stiffness - k * np.eye(2)[:, :, None], 1)


def end_slopes(v: Lines) -> Elements:
    """Ends that resist turning: one rotational stiffness at y = 0, one at y = L."""
    rail = v.receptance.rail.model
    probes = tuple(RailAttachment(SpringDamperMass(), y, slope=True) for y in (0.0, 1.0))
    probed = RailReceptance(replace(rail, attachments=(*rail.attachments, *probes)), v.s)
    ends = [probed.field(port) for port in probed.attached[-2:]]
    own = np.array([[probed.product(e, f)[0] for f in ends] for e in ends])

    def loads(y: FloatArray) -> ComplexArray:
        there = probed.field(probed.point(y))
        return np.array([probed.product(e, there) for e in ends])

    return _behind(v, loads, own, -1)


def kink(v: Lines, y: float) -> Elements:
    """A rail that bends more, or less, at one point: a stiffness against its curvature there."""
    rail = v.receptance.rail
    turns = np.pi * np.arange(1, rail.w.size + 1)
    bent = rail.field(RailPort(-(turns**2 * np.sin(turns * y))[None], np.zeros((1, 2))))
    return _behind(v, lambda y: rail.product(bent, rail.field(rail.point(y)))[None], rail.product(bent, bent)[None], -1)


def next_mode(v: Lines, r: int) -> Elements:
    """A bending mode that the model lacks."""

    def loads(y: FloatArray) -> ComplexArray:
        return np.asarray(np.sin(r * np.pi * y)[None, :, None] + 0 * v.s, dtype=np.complex128)

    return _behind(v, loads, np.zeros((1, 1, v.s.size), dtype=np.complex128), 1)


def rail_modes(v: Lines, kind: str) -> RailModes:
    """A value that all modes of the rail share."""
    rail, at = v.receptance.rail, _base(v)
    inertia = rail.half * v.s**2 + 0 * rail.w[:, None]
    change = rail.half * rail.w[:, None] ** 2 + 0 * v.s if kind == "relative stiffness" else inertia
    through = v.through([p * at.driven for p in at.passed])
    shapes = rail.point(v.group.positions).elastic
    crosses = np.zeros((1, rail.w.size))
    if (y := v.struck) is not None:
        crosses = np.where(np.isfinite(y)[:, None], rail.point(np.nan_to_num(y)).elastic, 0.0)
    return RailModes(
        v.response, through, v.through(at.passed), at.opposing, shapes**2, shapes * crosses, rail.flexibility, change
    )


def twist(v: Lines, eccentricity: float) -> Elements:
    """Two modes of twist of the rail, freed against a twist that is all but rigid."""
    machine = v.model
    assert machine.rail is not None
    rigid = Torsion(eccentricity, 1.0, SETTINGS.faults_twist * machine.rail.parameters.first_frequency, 0.0)
    twisted = Lines(replace(machine, rail=replace(machine.rail, torsion=rigid)), v.group, v.tail, v.window)
    at = _interface(twisted, "twist", twisted.receptance.twist.value)
    loads: ComplexArray = np.array([np.sin(k * np.pi * v.group.positions)[:, None] for k in (1, 2)])
    left = np.array([twisted.through([p * t for p in at.passed]) for t in loads])
    own = np.array([[at.opposing * t * u for u in loads] for t in loads])
    return Elements(v.response, left, at.driven * loads, own, np.eye(2), 1)


# -- the measurement ----------------------------------------------------------------------------------------------------------


def _linear(response: ComplexArray, left: ComplexArray) -> Elements:
    one: ComplexArray = np.ones((1, len(response), response.shape[-1]), dtype=np.complex128)
    return Elements(response, left[None], one, 0 * one[None], np.eye(1), 1)


def channel_gain(v: Lines, channel: str) -> Elements:
    """One channel's gain beside one."""
    left = np.zeros_like(v.response)
    own = [i for i, c in enumerate(v.group.channels) if c == channel]
    left[:, own] = v.response[:, own]
    return _linear(v.response, left)


def leak(v: Lines) -> Elements:
    """X that leaks into Z."""
    left, names = np.zeros_like(v.response), v.group.channels
    if "tool_x" in names and "tool_z" in names:
        left[:, names.index("tool_z")] = v.response[:, names.index("tool_x")]
    return _linear(v.response, left)


def windowed(v: Lines, rate: float) -> Elements:
    """One gain for all channels, of a response at the line that a window shifts."""
    chain = replace(v.model.chain, decay_rate=v.model.chain.decay_rate + rate)
    shifted = Lines(replace(v.model, chain=chain), v.group, v.tail, v.window)
    return _linear(shifted.response, shifted.response)
