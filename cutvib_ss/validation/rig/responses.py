"""
Responses of a linear cutting machine, a thousand times as fast as its finite elements: what the oracle computes with.

The rail's modes between pins are sines. They are eliminated line by line: the deflections remain at the ports that
something is fitted to (the head's base always), the ends where they give, twist, guide and the two links. What is fitted is a
dynamic stiffness along a row of these. The finite elements of `beam` and `multibody` are the check
(`tests/unit/test_rig_oracle.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from cutvib_ss.validation.rig.beam import rail_nodes, twisting
from cutvib_ss.validation.rig.chain import filtered
from cutvib_ss.validation.rig.fittings import Twist, combination
from cutvib_ss.validation.rig.structure import CHANNELS, Chain, Rail, Rig

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_MODES, _RESIDUAL = 40, 400
"""Modes of the rail that move, and up to which one the static answer of the others is summed."""

_APART = 1e-3
"""Two ports of the rail stand at least so far apart, y / L: closer ones would be one."""


def covered(rig: Rig) -> bool:
    """Whether a machine has nothing but what is computed here."""
    f, c = rig.fittings, rig.chain
    strange = (f.laws, f.springs, f.coupling, f.skews, f.crack, rig.lean, rig.drift)
    odd = (c.saturation, c.asymmetry, c.jitter, c.mains, c.feedthrough, c.clock, c.shift[0])
    pierced = f.shear is not None and f.shear.soft is not None
    return not any(strange + odd) and not pierced and (c.window is None or c.window.kind == "exponential")


def responses(rig: Rig, positions: Sequence[float], s: Complex) -> Complex:
    """What the channels show over the force, shape (position, channel, line), at complex frequencies s [rad/s]."""
    if rig.chain.window is not None:
        # An exponential window on force and response shifts s.
        s = s + rig.chain.window.rate
    motion = _answer(rig, np.asarray(positions, dtype=np.float64), s)
    return shown(rig.chain, motion * s**2, s)


def shown(chain: Chain, motion: Complex, s: Complex) -> Complex:
    """Leaks, gains, delays and filters of the measurement chain, in the order of `chain.sensed`."""
    out, at = motion.copy(), {name: i for i, name in enumerate(CHANNELS)}
    leaks = [("tool_z", "tool_x", chain.cross_axis, 0.0)] if chain.cross_axis else []
    for into, source, fraction, corner in (*leaks, *chain.tilts):
        out[:, at[into]] += fraction * motion[:, at[source]] * (s / (2 * np.pi * corner) if corner else 1.0)
    freq = s.imag / (2 * np.pi)
    for name, i in at.items():
        out[:, i] *= chain.gains.get(name, 1.0) * np.exp(-s * chain.delays.get(name, 0.0))
        if name in chain.filters:
            out[:, i] *= filtered(chain.filters[name], freq)
    return out


class _Rail:
    """The rail's modes between pins: A = g / (s² + 2 ζ ω s + ω²) over modes, and shapes sin(nπy)."""

    def __init__(self, rig: Rig, s: Complex) -> None:
        rail: Rail = rig.rail
        self.length, self.mass, self.fittings = rail.length, rail.mass, rig.fittings
        every = np.arange(1, _RESIDUAL + 1)
        omega_one = 2 * np.pi * rail.first_frequency
        number, omega, gain = every, every.astype(float) ** 2 * omega_one, np.full(_RESIDUAL, 2 / rail.mass)
        if rig.fittings.shear is not None:
            number, omega, gain = _shearing(rail, rig.fittings.shear.shear_ratio, rig.fittings.shear.modulus_ratio)
        self.number, self.static = number, gain / omega**2
        order = np.flatnonzero(number <= _MODES)
        self.moving, self.rest = order, np.flatnonzero(number > _MODES)
        w = omega[order]
        ratio = rail.damping_ratio * (1 + rail.damping_slope * np.log(w / omega.min()))
        self.modal = gain[order][:, None] / (s**2 + (2 * ratio * w)[:, None] * s + (w**2)[:, None])

    def rows(self, ports: Sequence[str], bases: Array) -> tuple[Array, Array]:
        """Shapes of ports in all modes (position, port, mode), and what the ends' deflections move there (position, port, 2)."""
        shapes = np.empty((bases.size, len(ports), self.number.size))
        chords = np.empty((bases.size, len(ports), 2))
        turn = self.number * np.pi / self.length
        for k, port in enumerate(ports):
            if port in ("turn_left", "turn_right"):
                shapes[:, k] = turn * (1.0 if port == "turn_left" else (-1.0) ** self.number)
                chords[:, k] = (-1 / self.length, 1 / self.length)
            else:
                y = bases if port == "base_x" else np.full(bases.size, float(port[5:]))
                if port != "base_x":
                    y = np.where(np.abs(y - bases) < _APART, bases + _APART, y)
                shapes[:, k] = np.sin(np.pi * self.number * y[:, None])
                chords[:, k] = np.column_stack([1 - y, y])
        return shapes, chords

    def stiffness(self, ports: Sequence[str], bases: Array, s: Complex) -> Complex:
        """Dynamic stiffness (position, line, dof, dof) over deflections at ports, and over those of the ends where they give."""
        shapes, chords = self.rows(ports, bases)
        count, p = bases.size, len(ports)
        moving, rest = shapes[..., self.moving], shapes[..., self.rest]
        products = (moving[:, :, None] * moving[:, None]).reshape(count * p * p, -1)
        flexibility = (products @ self.modal).reshape(count, p, p, s.size).transpose(0, 3, 1, 2)
        flexibility = flexibility + ((rest * self.static[self.rest]) @ rest.transpose(0, 2, 1))[:, None]
        stiff = 1.0 / flexibility if p == 1 else np.linalg.inv(flexibility)
        supports = self.fittings.supports
        if supports is None:
            return np.asarray(stiff)
        # w = R q + C e, and inertia of the chord drives the modes: q = A (Rᵀ f - s² m e)
        n = self.number[self.moving]
        driven = self.mass / (np.pi * n)[:, None] * np.column_stack([np.ones(n.size), -((-1.0) ** n)])
        into = (moving[:, :, None] * driven.T).reshape(count * p * 2, -1) @ self.modal
        into = into.reshape(count, p, 2, s.size).transpose(0, 3, 1, 2) * (s**2)[:, None, None]
        through = chords[:, None] - into
        own = ((driven[:, :, None] * driven[:, None]).reshape(n.size, 4).T @ self.modal).T.reshape(s.size, 2, 2)
        ends = (s**2)[:, None, None] * self.mass * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]])
        ends = ends - own * (s**4)[:, None, None]
        for i, (k, c) in enumerate(((supports.k_left, supports.c_left), (supports.k_right, supports.c_right))):
            ends[:, i, i] += k + c * s
        cross = stiff @ through
        total = np.empty((count, s.size, p + 2, p + 2), dtype=np.complex128)
        total[..., :p, :p], total[..., :p, p:] = stiff, -cross
        total[..., p:, :p], total[..., p:, p:] = -cross.swapaxes(2, 3), ends + through.swapaxes(2, 3) @ cross
        return total


def _shearing(rail: Rail, ratio: float, modulus: float) -> tuple[NDArray[np.int64], Array, Array]:
    """Numbers, frequencies and gains of the modes of Timoshenko's beam between pins: two of each number."""
    n = np.arange(1, 4 * _MODES + 1)
    kappa = n * np.pi / rail.length
    mu = rail.mass / rail.length
    ei = mu * (2 * np.pi * rail.first_frequency) ** 2 * (rail.length / np.pi) ** 4
    kga = ratio * np.pi**2 * ei / rail.length**2
    rotary = mu * ei * modulus / kga
    scale = np.sqrt(np.array([mu, rotary]))
    k = np.array([[kga * kappa**2, -kga * kappa], [-kga * kappa, ei * kappa**2 + kga]]).transpose(2, 0, 1)
    squares, vectors = np.linalg.eigh(k / np.outer(scale, scale))
    gain = vectors[:, 0, :] ** 2 / mu * 2 / rail.length
    return np.repeat(n, 2), np.sqrt(squares).ravel(), gain.ravel()


def _twist_flexibility(twist: Twist, length: float, positions: Array, s: Complex) -> Complex:
    """Twist under the head over the moment there (position, line), by the rig's shaft."""
    nodes = rail_nodes(length, tuple(positions))
    mass, _, stiffness = twisting(twist, nodes)
    squares, modes = eigh(stiffness, mass)
    shift = 1 if np.isinf(twist.ends) else 0
    at = modes[np.argmin(np.abs(nodes[:, None] - positions * length), axis=0) - shift]
    loss = 2 * twist.damping_ratio / (2 * np.pi * twist.torsion_frequency)
    return np.asarray((at**2) @ (1.0 / (s**2 + squares[:, None] * (1 + loss * s))))


def _elements(rig: Rig, s: Complex) -> Iterator[tuple[str, Complex]]:
    """Dynamic stiffness of everything that is fitted along a port, and the port."""
    f = rig.fittings
    for lump in f.lumps:
        yield f"rail@{lump.position:.6f}", lump.mass * s**2 + lump.damping * s
    for side, k in zip(("left", "right"), f.fixity, strict=True):
        if k:
            yield f"turn_{side}", np.full_like(s, k)
    for tie in f.ties:
        yield tie.port, tie.mass * s**2 + tie.damping * s + tie.stiffness
    for bob in f.bobs:
        w = 2 * np.pi * bob.frequency
        spring = 2 * bob.damping_ratio * w * s + w**2
        yield bob.port, bob.mass * s**2 * spring / (s**2 + spring)
    for lossy in f.lossy:
        yield lossy.port, lossy.stiffness(s)
    if f.guide is not None:
        yield "guide", f.guide[0] + f.guide[1] * s


def _merged(names: Sequence[str]) -> dict[str, str]:
    """Points of the rail that are one port, and the name of that port."""
    out: dict[str, str] = {}
    last = ""
    for name in names:
        if last and name.startswith("rail@") and abs(float(name[5:]) - float(last[5:])) < _APART:
            out[name] = last
        else:
            out[name] = name
            last = name if name.startswith("rail@") else last
    return out


def _answer(rig: Rig, positions: Array, s: Complex) -> Complex:
    """Displacements of the channels over the force: (position, channel, line)."""
    h, f = rig.head, rig.fittings
    elements = [(combination(port), z) for port, z in _elements(rig, s)]
    used = sorted({name for port, _ in elements for name in port})
    one_port = _merged(used)
    ports = ["base_x", *dict.fromkeys(one_port[n] for n in used if n.startswith(("rail@", "turn_")))]
    dofs = [*ports, *(("rail_left", "rail_right") if f.supports else ()), *(("guide",) if f.guide else ())]
    dofs += ["twist", "joint1", "joint2"] if f.twist else ["joint1", "joint2"]
    at = {name: i for i, name in enumerate(dofs)}
    # Rows of ports, one for each position where that matters.
    rows = {name: np.tile(np.eye(len(dofs))[i], (positions.size, 1)) for name, i in at.items()}
    one, two = np.deg2rad(h.theta01_deg), np.deg2rad(h.theta01_deg + h.theta02_deg)
    carried = rows["base_x"] + (rows["guide"] if f.guide else 0.0)
    turned = rows["joint1"].copy()
    if f.twist:
        eccentricity = np.array([f.twist.at(float(y)) for y in positions])
        carried = carried + eccentricity[:, None] * rows["twist"]
        turned = turned + rows["twist"]
    link = turned + rows["joint2"]
    rows["head_x"] = carried + h.l1 * np.cos(one) * turned
    rows["head_z"] = -h.l1 * np.sin(one) * turned
    rows["tool_x"] = rows["head_x"] + h.l2 * np.cos(two) * link
    rows["tool_z"] = rows["head_z"] - h.l2 * np.sin(two) * link

    rows |= {name: rows[same] for name, same in one_port.items() if name != same}

    d = np.zeros((positions.size, s.size, len(dofs), len(dofs)), dtype=np.complex128)
    rail = _Rail(rig, s)
    block = rail.stiffness(ports, positions, s)
    n = block.shape[-1]
    d[..., :n, :n] = block
    mass = np.zeros((positions.size, len(dofs), len(dofs)))
    for name, m in (("head_x", h.m1), ("head_z", h.m1), ("tool_x", h.m2), ("tool_z", h.m2)):
        mass += m * rows[name][:, :, None] * rows[name][:, None]
    d += (s**2)[:, None, None] * mass[:, None]
    for joint, k, c in (("joint1", h.k1, h.c1), ("joint2", h.k2, h.c2)):
        d[..., at[joint], at[joint]] += k + c * s
    if f.twist:
        d[..., at["twist"], at["twist"]] += 1.0 / _twist_flexibility(f.twist, rail.length, positions, s)
    for port, z in elements:
        row = np.sum([factor * rows[name] for name, factor in port.items()], axis=0)
        outer = row[:, :, None] * row[:, None]
        i, j = np.nonzero(outer.any(axis=0))
        d[..., i, j] += z[:, None] * outer[:, None, i, j]
    drive = np.broadcast_to(rows["tool_x"][:, None, :, None], (*d.shape[:3], 1))
    x = np.linalg.solve(d, drive)[..., 0]
    return np.asarray(np.array([np.einsum("pld,pd->pl", x, rows[name]) for name in CHANNELS]).transpose(1, 0, 2))
