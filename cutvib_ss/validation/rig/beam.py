"""
The rail by finite elements: slender beams (Hermite) or beams that shear (Timoshenko), shafts for the twist.

Node i carries deflection w, slope s and twist t. Lengths come from a mesh with nodes where something acts. The bending
frequency of the plain rail between pins gives EI; its modes carry the damping.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh

from cutvib_ss.validation.rig.elements import LOBATTO, beam_element, shearing_beam_element
from cutvib_ss.validation.rig.fittings import Fittings, Twist
from cutvib_ss.validation.rig.structure import Rail

Array = NDArray[np.float64]

ELEMENTS = 64
SHEAR_ELEMENTS = 20
"""At least so many elements along the rail, of two nodes, or of four where it shears: frequencies to 500 Hz are right to 1e-5."""


@dataclass(frozen=True)
class RailMatrices:
    """The rail over its kept coordinates."""

    mass: Array  # Matrices [SI]; fixed-interface modes are mass-normalised
    damping: Array
    stiffness: Array
    # Names of the physical coordinates at the front: ``"base"``, the deflection under the head; ``"twist"``, the
    # twist there, where the rail twists; ports that were asked for. The others are fixed-interface modes
    interface: tuple[str, ...]


def _mesh(length: float, points: tuple[float, ...], shear: bool) -> tuple[Array, int]:
    """Nodes [m] along the rail, some of them at the given y / L, and how many spans an element has."""
    elements, inner = (SHEAR_ELEMENTS, LOBATTO) if shear else (ELEMENTS, np.array([0.0, 1.0]))
    cuts = np.unique(np.concatenate([[0.0, 1.0], points]))
    counts = np.maximum(1, np.ceil(np.diff(cuts) * elements).astype(int))
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(cuts[:-1], cuts[1:], counts, strict=True)]
    ends = np.append(np.concatenate(pieces), 1.0)
    within = ends[:-1, None] + np.diff(ends)[:, None] * inner[None, :-1]
    return length * np.append(within.ravel(), 1.0), inner.size - 1


def rail_nodes(length: float, points: tuple[float, ...]) -> Array:
    """Nodes [m] along a slender rail, some of them at the given y / L."""
    return _mesh(length, points, shear=False)[0]


def _bending(rail: Rail, nodes: Array, spans: int, fittings: Fittings) -> tuple[Array, Array]:
    """Mass and stiffness of the free rail in bending over (w, s) of all nodes."""
    mu = rail.mass / rail.length
    ei = mu * (2 * np.pi * rail.first_frequency) ** 2 * (rail.length / np.pi) ** 4
    crack = fittings.crack
    # A crack gives its node a second slope, the last coordinate, for the elements on its right.
    n = 2 * nodes.size + (crack is not None)
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    hinge = -1 if crack is None else _node_at(nodes, crack.position)
    for first in range(0, nodes.size - 1, spans):
        h = float(nodes[first + spans] - nodes[first])
        if fittings.shear is None:
            m, k = beam_element(h, ei, mu)
        else:
            shear = fittings.shear
            kga = shear.shear_ratio * np.pi**2 * ei / rail.length**2
            rotary = mu * ei * shear.modulus_ratio / kga  # ρI = μ EI/(EA), EA = κGA / (κG/E)
            middle = (nodes[first] + h / 2) / nodes[-1]
            if shear.soft and not shear.soft[0] < middle < shear.soft[1]:
                kga *= 50.0
            m, k = shearing_beam_element(h, ei, mu, kga, rotary)
        dofs = np.arange(2 * first, 2 * (first + spans) + 2)
        if first == hinge:
            dofs[1] = n - 1
        mass[np.ix_(dofs, dofs)] += m
        stiffness[np.ix_(dofs, dofs)] += k
    if crack is not None:
        slopes = np.array([2 * hinge + 1, n - 1])
        stiffness[np.ix_(slopes, slopes)] += crack.stiffness * np.array([[1, -1], [-1, 1]])
    return mass, stiffness


def _node_at(nodes: Array, position: float) -> int:
    """The node at y / L."""
    return int(np.argmin(np.abs(nodes - position * nodes[-1])))


def twisting(twist: Twist, nodes: Array) -> tuple[Array, Array, Array]:
    """Mass, damping and stiffness of the shaft over the twists of its nodes, of the inner ones where its ends are held."""
    length = nodes[-1]
    density = twist.inertia / length
    rigidity = density * (2 * twist.torsion_frequency * length) ** 2 * twist.stiffer
    n = nodes.size
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for i, h in enumerate(np.diff(nodes)):
        span = slice(i, i + 2)
        # midway between lumped and consistent inertia: the error is of fourth order in h
        mass[span, span] += density * h * np.array([[5, 1], [1, 5]]) / 12
        stiffness[span, span] += rigidity / h * np.array([[1, -1], [-1, 1]])
    if np.isfinite(twist.ends):
        stiffness[[0, -1], [0, -1]] += twist.ends * rigidity / length
    inner = slice(1, -1) if np.isinf(twist.ends) else slice(None)
    damping = 2 * twist.damping_ratio / (2 * np.pi * twist.torsion_frequency) * stiffness
    return mass[inner, inner], damping[inner, inner], stiffness[inner, inner]


def _strain_damping(mass: Array, stiffness: Array, nodes: Array, rail: Rail) -> Array:
    """Damping of the rail's modes between pins, against motion off the ends' chord; its ratio may grow with frequency."""
    n, last = mass.shape[0], 2 * nodes.size - 2
    ends = np.array([0, last])
    rest = np.setdiff1d(np.arange(n), ends)
    squares, modes = eigh(stiffness[np.ix_(rest, rest)], mass[np.ix_(rest, rest)])
    shapes = mass[np.ix_(rest, rest)] @ modes
    omega = np.sqrt(squares)
    ratio = rail.damping_ratio * (1 + rail.damping_slope * np.log(omega / omega[0]))
    relative = (shapes * (2 * ratio * omega)) @ shapes.T
    chord = np.tile(np.array([-1.0, 1.0]) / nodes[-1], (n, 1))  # slopes
    chord[0 : last + 1 : 2] = np.column_stack([1 - nodes / nodes[-1], nodes / nodes[-1]])
    # Damping comes from the rate of strain (Eq. 4), so that a rail that moves as a rigid body is not damped.
    away = np.zeros((rest.size, n))
    away[np.arange(rest.size), rest] = 1.0
    away[:, ends] -= chord[rest]
    return np.asarray(away.T @ relative @ away)


def rail_matrices(
    rail: Rail, fittings: Fittings, position: float, highest: float, ports: tuple[str, ...] = ()
) -> RailMatrices:
    """The rail under the head, by component modes."""
    crack = fittings.crack
    at = {name: float(name[5:]) for name in ports if name.startswith("rail@")}
    points = (
        position,
        *at.values(),
        *(lump.position for lump in fittings.lumps),
        *((crack.position,) if crack else ()),
    )
    nodes, spans = _mesh(rail.length, points, fittings.shear is not None)
    mass, stiffness = _bending(rail, nodes, spans, fittings)
    damping = _strain_damping(mass, stiffness, nodes, rail)
    ends = {"rail_left": 0, "rail_right": 2 * nodes.size - 2}
    dofs = ends | {"turn_left": 1, "turn_right": 2 * nodes.size - 1}
    dofs |= {name: 2 * _node_at(nodes, y) for name, y in at.items()}
    base = 2 * _node_at(nodes, position)
    ports = tuple(name for name in ports if dofs[name] != base)
    for lump in fittings.lumps:
        dof = 2 * _node_at(nodes, lump.position)
        mass[dof, dof] += lump.mass
        damping[dof, dof] += lump.damping
    for dof, turning in zip(ends.values(), fittings.fixity, strict=True):
        stiffness[dof + 1, dof + 1] += turning
    held = [dof for end, dof in ends.items() if end not in ports]
    if fittings.supports:
        s = fittings.supports
        held = []
        for dof, k, c in zip(ends.values(), (s.k_left, s.k_right), (s.c_left, s.c_right), strict=True):
            stiffness[dof, dof] += k
            damping[dof, dof] += c
    kept = np.setdiff1d(np.arange(mass.shape[0]), held)
    parts = [matrix[np.ix_(kept, kept)] for matrix in (mass, damping, stiffness)]
    names = ("base", *ports)
    front = np.searchsorted(kept, [base, *(dofs[name] for name in ports)])
    if fittings.twist:
        parts = [block_diag(a, b) for a, b in zip(parts, twisting(fittings.twist, nodes), strict=True)]
        front = np.insert(front, 1, kept.size + _node_at(nodes, position) - (1 if np.isinf(fittings.twist.ends) else 0))
        names = ("base", "twist", *ports)
    mass, damping, stiffness = parts
    if rail.truncation is not None:
        return _truncated(mass, damping, stiffness, front, names, rail.truncation)
    return _component_modes(mass, damping, stiffness, front, names, highest)


def _component_modes(
    mass: Array, damping: Array, stiffness: Array, front: NDArray[np.intp], names: tuple[str, ...], highest: float
) -> RailMatrices:
    """Craig and Bampton's reduction: static shapes of the interface and the modes of the rest with the interface held."""
    rest = np.setdiff1d(np.arange(mass.shape[0]), front)
    inner = np.ix_(rest, rest)
    squares, modes = eigh(stiffness[inner], mass[inner])
    modes = modes[:, squares < (2 * np.pi * highest) ** 2]
    basis = np.zeros((mass.shape[0], front.size + modes.shape[1]))
    basis[front, np.arange(front.size)] = 1.0
    basis[rest, : front.size] = -np.linalg.solve(stiffness[inner], stiffness[np.ix_(rest, front)])
    basis[rest, front.size :] = modes
    return _projected(mass, damping, stiffness, basis, names)


def _truncated(
    mass: Array, damping: Array, stiffness: Array, front: NDArray[np.intp], names: tuple[str, ...], count: int
) -> RailMatrices:
    """The first modes alone, turned so that the first coordinate is the deflection under the head."""
    _, modes = eigh(stiffness, mass, subset_by_index=(0, count - 1))
    row = modes[front[0]]
    turn, _ = np.linalg.qr(np.column_stack([row, np.eye(count)]))
    turn[:, 0] /= row @ turn[:, 0]
    return _projected(mass, damping, stiffness, modes @ turn[:, :count], names)


def _projected(mass: Array, damping: Array, stiffness: Array, basis: Array, names: tuple[str, ...]) -> RailMatrices:
    """The rail over the columns of a basis."""
    m, c, k = (basis.T @ matrix @ basis for matrix in (mass, damping, stiffness))
    return RailMatrices((m + m.T) / 2, (c + c.T) / 2, (k + k.T) / 2, names)
