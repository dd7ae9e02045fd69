"""
Structures that are no cutting machine: chains of masses, beams, portal frames and plates, by finite elements of the rig's own.

machine.toml gives them as ``kind = "second_order"``: matrices, ports and channels. As built, each matrix is off by a factor within
its tolerance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from cutvib_ss.validation.rig.elements import beam_element, plate_element
from cutvib_ss.validation.rig.fittings import Fittings
from cutvib_ss.validation.rig.multibody import Linearised
from cutvib_ss.validation.rig.structure import Chain, Channel

Array = NDArray[np.float64]
# mass, stiffness, coordinates that are deflections, and ports that have a spring of their own: row and stiffness
_Matrices: TypeAlias = tuple[Array, Array, list[int], dict[str, tuple[Array, float]]]

TOLERANCES: Mapping[str, float] = {"mass": 0.01, "damping": 0.15, "stiffness": 0.02}
_QUANTITIES = ("displacement", "velocity", "acceleration")
_UP_TO = 1200.0
"""Modes above it carry the damping of this frequency [Hz]."""


@dataclass(frozen=True, eq=False)
class Frame:
    """A structure as it stands in the workshop."""

    kind: str  # ``"chain"``, ``"beam"``, ``"frame"`` or ``"plate"``
    mass: Array  # Its matrices [SI]
    damping: Array
    stiffness: Array
    ports: Mapping[str, Array]  # Rows of the ports
    springs: Mapping[str, float]  # Stiffness of the spring that lies along a port, where one does [N/m]
    channels: tuple[Channel, ...]  # What its response channels read
    drive: str  # Port that is struck
    fittings: Fittings = field(default_factory=Fittings)  # What is fitted to it
    chain: Chain = field(default_factory=Chain)  # Faults of the measurement chain
    # By how much stiffness or damping has changed at the end of the campaign
    drift: Mapping[str, float] = field(default_factory=dict)

    @property
    def linear(self) -> bool:
        """Whether every element of it is linear."""
        return not self.fittings.laws

    def linearised(self) -> Linearised:
        """Its matrices and ports, without what is fitted."""
        return Linearised(self.mass, self.damping, self.stiffness, self.ports)

    def fitted(self, **changes: Any) -> Frame:
        """The structure with fittings replaced."""
        return replace(self, fittings=replace(self.fittings, **changes))

    def measured(self, **changes: Any) -> Frame:
        """The structure with faults of the measurement chain replaced."""
        return replace(self, chain=replace(self.chain, **changes))

    def scaled(self, factors: Mapping[str, float]) -> Frame:
        """The structure with matrices times factors."""
        new: dict[str, Any] = {name: getattr(self, name) * factor for name, factor in factors.items()}
        if "stiffness" in factors:
            new["springs"] = {port: k * factors["stiffness"] for port, k in self.springs.items()}
        return replace(self, **new)

    def moved(self, factors: Mapping[str, float]) -> Frame:
        """The structure with matrices times factors, its own drift done."""
        return replace(self.scaled(factors), drift={})

    def at(self, progress: float) -> Frame:
        """The structure at a stage of the campaign."""
        if not self.drift:
            return self
        return replace(self.scaled({name: 1 + change * progress for name, change in self.drift.items()}), drift={})

    def scattered(self, rng: np.random.Generator) -> Frame:
        """The structure as built."""
        return self.scaled({name: float(np.exp(size * rng.standard_normal())) for name, size in TOLERANCES.items()})


@dataclass(frozen=True, eq=False)
class FrameNominal:
    """What machine.toml says of a structure."""

    frame: Frame
    n_modes: int = 0

    def toml(self, drift: float | None = None) -> str:
        """Text of machine.toml."""
        f = self.frame
        dofs = [f"q{i + 1}" for i in range(len(f.mass))]

        def matrix(a: Array) -> str:
            return "[\n" + "".join("  [" + ", ".join(f"{x:.12g}" for x in row) + "],\n" for row in a) + "]"

        lines = ["[model]", 'kind = "second_order"', f"dofs = {dofs!r}".replace("'", '"')]
        lines += [f"{name} = {matrix(getattr(f, name))}" for name in ("mass", "damping", "stiffness")]
        lines += [
            "",
            "[ports]",
            *(f"{name} = [{', '.join(f'{x:.12g}' for x in row)}]" for name, row in f.ports.items()),
        ]
        lines += ["", "[channels]"]
        lines += [f'{c.name} = {{ port = "{c.port}", quantity = "{_QUANTITIES[c.order]}" }}' for c in f.channels]
        lines += ["", "[input]", f'force = "{f.drive}"', "", "[tolerance]"]
        lines += [f"{name} = {size}" for name, size in TOLERANCES.items()] + ["calibration = 0.01"]
        return "\n".join(lines + ([] if drift is None else [f"drift = {drift}"])) + "\n"


def draw_frame(rng: np.random.Generator, springs: bool = False) -> Frame:
    """Draw a structure, its dimensions, damping, ports and sensors; one with springs along ports if that is asked."""
    kind = "chain" if springs else str(rng.choice(list(_KINDS)))
    mass, stiffness, deflections, along = _KINDS[kind](rng)
    squares = eigh(stiffness, mass, eigvals_only=True)
    elastic = squares[squares > 1e-6 * squares.max()] if kind != "chain" else squares[squares > 1e-9 * squares.max()]
    factor = (2 * np.pi * float(np.exp(rng.uniform(np.log(18.0), np.log(60.0))))) ** 2 / elastic[0]
    stiffness, along = factor * stiffness, {name: (row, factor * k) for name, (row, k) in along.items()}
    damping = _modal_damping(mass, stiffness, float(np.exp(rng.uniform(np.log(0.004), np.log(0.03)))), rng)
    unit = np.eye(len(mass))
    picked = rng.permutation(deflections)[: min(len(deflections), int(rng.integers(3, 6)))]
    ports = {f"p{i + 1}": unit[d] for i, d in enumerate(picked)}
    for name, (row, _) in along.items():
        if not any(np.allclose(row, other) for other in ports.values()) and len(ports) < 8:
            ports[name] = row
    drive = "p1"
    seen = [f"p{i + 1}" for i in range(len(picked))][: int(rng.integers(2, 4))]
    order = int(rng.choice([2, 2, 2, 1, 0]))
    channels = tuple(Channel(f"y{i + 1}", port, order) for i, port in enumerate(seen))
    return Frame(
        kind, mass, damping, stiffness, ports, {n: k for n, (_, k) in along.items() if n in ports}, channels, drive
    )


def _modal_damping(mass: Array, stiffness: Array, ratio: float, rng: np.random.Generator) -> Array:
    """Damping by modes, their ratios about one value; a motion as a rigid body is not damped."""
    squares, modes = eigh(stiffness, mass)
    omega = np.sqrt(np.maximum(squares, 0.0))
    ratios = ratio * np.exp(0.3 * rng.standard_normal(omega.size)) * (omega > 1e-3 * omega[-1] ** 0.5)
    shapes = mass @ modes
    c = (shapes * (2 * ratios * np.minimum(omega, 2 * np.pi * _UP_TO))) @ shapes.T
    return np.asarray((c + c.T) / 2)


def _chain(rng: np.random.Generator) -> _Matrices:
    """3 to 10 masses in a row, each on a spring to the next; the first held, or none."""
    n = int(rng.integers(3, 11))
    m = np.exp(rng.uniform(np.log(0.5), np.log(8.0), n))
    k = np.exp(rng.uniform(0.0, np.log(6.0), n + 1))
    k[-1] *= rng.random() < 0.4
    stiffness, springs = np.zeros((n, n)), {}
    for i in range(n + 1):
        row = np.zeros(n)
        if i < n:
            row[i] = 1.0
        if i > 0:
            row[i - 1] = -1.0 if i < n else 1.0
        stiffness += k[i] * np.outer(row, row)
        if 0 < i < n:
            springs[f"s{i}{i + 1}"] = (row, float(k[i]))
    springs["ground"] = (np.eye(n)[0], float(k[0]))
    return np.diag(m), stiffness, list(range(n)), springs


def _beam(rng: np.random.Generator) -> _Matrices:
    """A slender beam of 3 to 14 elements: clamped at one end or both, pinned, or free; a mass at a node."""
    n = int(rng.integers(3, 15))
    length, mu = float(rng.uniform(0.6, 3.0)), float(np.exp(rng.uniform(np.log(2.0), np.log(40.0))))
    mass, stiffness = np.zeros((2 * n + 2,) * 2), np.zeros((2 * n + 2,) * 2)
    for i in range(n):
        m, k = beam_element(length / n, 1.0, mu)
        at = np.arange(2 * i, 2 * i + 4)
        mass[np.ix_(at, at)] += m
        stiffness[np.ix_(at, at)] += k
    lump = 2 * int(rng.integers(1, n))
    mass[lump, lump] += mu * length * float(rng.uniform(0.0, 0.5))
    held = {"clamped": [0, 1], "both": [0, 1, 2 * n, 2 * n + 1], "pinned": [0, 2 * n], "free": []}
    return _without(mass, stiffness, held[str(rng.choice(list(held)))], range(0, 2 * n + 2, 2))


def _frame(rng: np.random.Generator) -> _Matrices:
    """A portal frame: two posts, clamped below, and a beam on top; 2 to 5 elements each, deflection along and across."""
    n = int(rng.integers(2, 6))
    height, width = float(rng.uniform(0.6, 1.5)), float(rng.uniform(0.6, 1.8))
    mu, axial = float(rng.uniform(3.0, 15.0)), float(np.exp(rng.uniform(np.log(2e3), np.log(2e4))))
    corners = [(0.0, 0.0), (0.0, height), (width, height), (width, 0.0)]
    nodes = [corners[0]]
    for a, b in pairwise(corners):
        nodes += [(a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t) for t in np.arange(1, n + 1) / n]
    size = 3 * len(nodes)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))
    for i in range(len(nodes) - 1):
        dx, dy = np.subtract(nodes[i + 1], nodes[i])
        h = float(np.hypot(dx, dy))
        c, s = dx / h, dy / h
        m, k = np.zeros((6, 6)), np.zeros((6, 6))
        across, along = np.ix_([1, 2, 4, 5], [1, 2, 4, 5]), np.ix_([0, 3], [0, 3])
        m[across], k[across] = beam_element(h, 1.0, mu)
        m[along], k[along] = mu * h / 6 * np.array([[2, 1], [1, 2]]), axial / h * np.array([[1, -1], [-1, 1]])
        turn = np.kron(np.eye(2), np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]))
        at = np.arange(3 * i, 3 * i + 6)
        mass[np.ix_(at, at)] += turn.T @ m @ turn
        stiffness[np.ix_(at, at)] += turn.T @ k @ turn
    ends = [*range(3), *range(size - 3, size)]
    return _without(mass, stiffness, ends, [d for d in range(size) if d % 3 != 2])


def _plate(rng: np.random.Generator) -> _Matrices:
    """A thin plate of 2 by 2 to 4 by 3 rectangular elements with one edge or all corners held."""
    nx, ny = int(rng.integers(2, 5)), int(rng.integers(2, 4))
    a, b = float(rng.uniform(0.15, 0.35)), float(rng.uniform(0.15, 0.35))
    # The element of Adini, Clough and Melosh: twelve terms of a polynomial, deflection and two slopes at each corner.
    m, k = plate_element(a, b, float(rng.uniform(8.0, 40.0)), 0.3)
    size = 3 * (nx + 1) * (ny + 1)
    mass, stiffness = np.zeros((size, size)), np.zeros((size, size))

    def node(i: int, j: int) -> int:
        return i * (ny + 1) + j

    for i in range(nx):
        for j in range(ny):
            corners = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)]
            at = np.array([3 * c + d for c in corners for d in range(3)])
            mass[np.ix_(at, at)] += m
            stiffness[np.ix_(at, at)] += k
    if rng.random() < 0.5:
        held = [3 * node(0, j) + d for j in range(ny + 1) for d in range(3)]
    else:
        held = [3 * node(i, j) for i in (0, nx) for j in (0, ny)]
    return _without(mass, stiffness, held, range(0, size, 3))


def _without(mass: Array, stiffness: Array, held: list[int], deflections: range | list[int]) -> _Matrices:
    """The structure with some coordinates held."""
    kept = np.setdiff1d(np.arange(len(mass)), held)
    new = {int(old): i for i, old in enumerate(kept)}
    part = np.ix_(kept, kept)
    return mass[part], stiffness[part], [new[d] for d in deflections if d in new], {}


_KINDS: Mapping[str, Callable[[np.random.Generator], _Matrices]] = {
    "chain": _chain, "beam": _beam, "frame": _frame, "plate": _plate,
}  # fmt: skip
