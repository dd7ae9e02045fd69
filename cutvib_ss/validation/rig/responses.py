"""
Responses of a linear cutting machine, a thousand times as fast as its finite elements: what the oracle computes with.

The rail's modes between pins are sines. They are eliminated line by line: what is left are the deflections at the ports that
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

_MODES, _RESIDUAL = 40, 1500
"""Modes of the rail that move, and up to which one the static answer of the others is summed."""


def covered(rig: Rig) -> bool:
    """Whether a machine has nothing but what is computed here."""
    f, c = rig.fittings, rig.chain
    strange: object = f.laws or f.oscillators or f.springs or f.coupling or f.skews or f.crack
    strange = strange or (f.shear is not None and f.shear.soft is not None) or rig.lean or rig.drift
    odd = c.saturation or c.asymmetry or c.jitter or c.mains or c.feedthrough or c.clock or c.shift[0]
    return not strange and not odd and (c.window is None or c.window.kind == "exponential")


def responses(rig: Rig, positions: Sequence[float], s: Complex) -> Complex:
    """What the channels show over the force, shape (position, channel, line), at complex frequencies s [rad/s]."""
    if rig.chain.window is not None:
        # An exponential window on force and response shifts s.
        s = s + rig.chain.window.rate
    rail = _Rail(rig, s)
    motion = np.array([_answer(rig, rail, y, s) for y in positions])
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

    def rows(self, ports: Sequence[str], base: float) -> tuple[Array, Array]:
        """Shapes of ports in all modes (port, mode), and what the ends' deflections move there (port, 2)."""
        shapes, chords = [], []
        turn = self.number * np.pi / self.length
        for port in ports:
            if port in ("turn_left", "turn_right"):
                shapes.append(turn * (1.0 if port == "turn_left" else (-1.0) ** self.number))
                chords.append((-1 / self.length, 1 / self.length))
            else:
                y = base if port == "base_x" else float(port[5:])
                shapes.append(np.sin(np.pi * self.number * y))
                chords.append((1 - y, y))
        return np.array(shapes), np.array(chords)

    def stiffness(self, ports: Sequence[str], base: float, s: Complex) -> Complex:
        """Dynamic stiffness (line, dof, dof) over deflections at ports, and over those of the ends where they give."""
        shapes, chords = self.rows(ports, base)
        p = len(ports)
        moving, rest = shapes[:, self.moving], shapes[:, self.rest]
        products = (moving[:, None] * moving[None]).reshape(p * p, -1)
        flexibility = (products @ self.modal).T.reshape(s.size, p, p)
        flexibility = flexibility + (rest * self.static[self.rest]) @ rest.T
        stiff = 1.0 / flexibility if p == 1 else np.linalg.inv(flexibility)
        supports = self.fittings.supports
        if supports is None:
            return np.asarray(stiff)
        # w = R q + C e, and inertia of the chord drives the modes: q = A (Rᵀ f - s² m e)
        n = self.number[self.moving]
        driven = self.mass / (np.pi * n)[:, None] * np.column_stack([np.ones(n.size), -((-1.0) ** n)])
        into = np.einsum("pn,nl,ne->lpe", moving, self.modal, driven) * (s**2)[:, None, None]
        through = chords[None] - into
        own = np.einsum("ne,nl,nd->led", driven, self.modal, driven) * (s**4)[:, None, None]
        ends = (s**2)[:, None, None] * self.mass * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]]) - own
        for i, (k, c) in enumerate(((supports.k_left, supports.c_left), (supports.k_right, supports.c_right))):
            ends[:, i, i] += k + c * s
        cross = stiff @ through
        back = through.transpose(0, 2, 1)
        return np.block([[stiff, -cross], [-cross.transpose(0, 2, 1), ends + back @ cross]])


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


def _twist_flexibility(twist: Twist, length: float, position: float, s: Complex) -> Complex:
    """Twist under the head over the moment there, by the rig's shaft."""
    nodes = rail_nodes(length, (position,))
    mass, _, stiffness = twisting(twist, nodes)
    squares, modes = eigh(stiffness, mass)
    shift = 1 if np.isinf(twist.ends) else 0
    at = modes[int(np.argmin(np.abs(nodes - position * length))) - shift]
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


def _answer(rig: Rig, rail: _Rail, position: float, s: Complex) -> Complex:
    """Displacements of the channels over the force at one position: (channel, line)."""
    h, f = rig.head, rig.fittings
    elements = list(_elements(rig, s))
    used = {name for port, _ in elements for name in combination(port)}
    own = [n for n in sorted(used) if n.startswith(("rail@", "turn_"))]
    own = [n for n in own if n.startswith("turn_") or abs(float(n[5:]) - position) > 1e-6]
    ports = ["base_x", *own]
    dofs = [*ports, *(("rail_left", "rail_right") if f.supports else ()), *(("guide",) if f.guide else ())]
    dofs += ["twist"] if f.twist else []
    dofs += ["joint1", "joint2"]
    at = {name: i for i, name in enumerate(dofs)}
    unit = np.eye(len(dofs))
    rows = {name: unit[i] for name, i in at.items()}
    one, two = np.deg2rad(h.theta01_deg), np.deg2rad(h.theta01_deg + h.theta02_deg)
    e = f.twist.at(position) if f.twist else 0.0
    carried = unit[0] + (unit[at["guide"]] if f.guide else 0.0)
    turned = unit[at["joint1"]] + (unit[at["twist"]] if f.twist else 0.0)
    offset = e * unit[at["twist"]] if f.twist else 0.0
    link = turned + unit[at["joint2"]]
    rows["head_x"] = carried + offset + h.l1 * np.cos(one) * turned
    rows["head_z"] = -h.l1 * np.sin(one) * turned
    rows["tool_x"] = rows["head_x"] + h.l2 * np.cos(two) * link
    rows["tool_z"] = rows["head_z"] - h.l2 * np.sin(two) * link
    for name in used:
        if name.startswith("rail@") and name not in rows:
            rows[name] = unit[0]

    d = np.zeros((s.size, len(dofs), len(dofs)), dtype=np.complex128)
    block = rail.stiffness(ports, position, s)
    n = block.shape[1]
    d[:, :n, :n] = block
    mass = sum(
        m * np.outer(rows[r], rows[r]) for m, p in ((h.m1, "head"), (h.m2, "tool")) for r in (f"{p}_x", f"{p}_z")
    )
    d += (s**2)[:, None, None] * mass
    for joint, k, c in (("joint1", h.k1, h.c1), ("joint2", h.k2, h.c2)):
        d[:, at[joint], at[joint]] += k + c * s
    if f.twist:
        d[:, at["twist"], at["twist"]] += 1.0 / _twist_flexibility(f.twist, rail.length, position, s)
    for port, z in elements:
        row = sum(factor * rows[name] for name, factor in combination(port).items())
        d += z[:, None, None] * np.outer(row, row)
    x = np.linalg.solve(d, np.broadcast_to(rows["tool_x"][:, None], (s.size, len(dofs), 1)))[..., 0]
    return np.asarray((x @ np.array([rows[name] for name in CHANNELS]).T).T)
