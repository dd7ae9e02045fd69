"""
The machine as a multibody system in exudyn.

The head is a tree of joints and point masses with its real geometry; the rail's finite elements share the coordinates of
its base. Exudyn's axes: x is the machine's Z, y its X (down), so that link angles turn about exudyn's z.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import exudyn as exu
import numpy as np
from exudyn import itemInterface as item
from numpy.typing import NDArray

from cutvib_ss.validation.rig.beam import rail_matrices
from cutvib_ss.validation.rig.fittings import Fittings, combination
from cutvib_ss.validation.rig.structure import Rig

Array = NDArray[np.float64]

HIGHEST = 12000.0
"""Component modes of the rail are kept up to this frequency [Hz]."""

_POSITION = exu.OutputVariableType.Position

_STEP = 1e-5
"""Step of the central differences that give the rows of ports [m or rad]: errors of 1e-10."""


@dataclass(frozen=True)
class Linearised:
    """The machine about its rest."""

    mass: Array  # Matrices [SI]
    damping: Array
    stiffness: Array
    # Rows of ``tool_x``, ``tool_z``, ``head_x``, ``head_z``, ``base_x``, ``joint1``, ``joint2``, ``guide`` where
    # there is one, and of what on the rail is fitted with something
    ports: Mapping[str, Array]

    def row(self, port: str) -> Array:
        """Row of a port or of a combination of ports."""
        return np.asarray(sum(factor * self.ports[name] for name, factor in combination(port).items()))


@dataclass(frozen=True)
class Machine:
    """An exudyn system, with the numbers of what is in it."""

    system: exu.MainSystem  # The system
    markers: Mapping[str, int]  # Markers of ``"tool"``, ``"head"``, ``"base"`` and ``"ground"``
    joints: Mapping[str, int]  # Markers of the joints' angles
    coordinates: Mapping[str, int]  # Coordinates that are ports
    tree: int  # The kinematic tree
    tree_size: int  # How many coordinates the tree has; they come first
    on_tree: Mapping[str, tuple[int, float]]  # Link of each place, and its distance along it [m]


def build(rig: Rig, position: float, highest: float = HIGHEST, assemble: bool = True) -> Machine:
    """
    Put the machine together.

    What is fitted along ports (`attached`) and nonlinear laws are left to who comes after; their ports are there.
    """
    head, fittings = rig.head, rig.fittings
    rail = rail_matrices(rig.rail, fittings, position, highest, fittings.rail_ports)
    system = exu.SystemContainer().AddSystem()

    # The tree: base in X, then twist and guide where there are any, then the two links.
    prismatic, revolute = exu.JointType.PrismaticY, exu.JointType.RevoluteZ
    angles = np.deg2rad([head.theta01_deg, head.theta02_deg])
    links: list[tuple[exu.JointType, list[float], float, float, float, float]] = [
        (prismatic, [0.0] * 3, 0.0, 0.0, 0.0, 0.0)
    ]
    eccentric = [0.0, 0.0, 0.0]
    if fittings.twist:
        links.append((revolute, [0.0] * 3, 0.0, 0.0, 0.0, 0.0))
        eccentric = [fittings.twist.at(position), 0.0, 0.0]
    if fittings.guide:
        links.append((prismatic, eccentric, 0.0, *fittings.guide, 0.0))
        eccentric = [0.0, 0.0, 0.0]
    links.append((revolute, eccentric, head.m1, head.k1, head.c1, angles[0]))
    links.append((revolute, [head.l1, 0.0, 0.0], head.m2, head.k2, head.c2, angles[1]))
    n = len(links)
    kinds, offsets, masses, springs, dampers, rest = zip(*links, strict=True)
    centres = [[0.0] * 3] * (n - 2) + [[head.l1, 0.0, 0.0], [head.l2, 0.0, 0.0]]
    tree_node = _coordinates(system, list(rest))
    tree = system.AddObject(
        item.ObjectKinematicTree(
            nodeNumber=tree_node,
            jointTypes=list(kinds),
            linkParents=list(range(-1, n - 1)),
            jointTransformations=exu.Matrix3DList([np.eye(3)] * n),
            jointOffsets=exu.Vector3DList([list(offset) for offset in offsets]),
            linkInertiasCOM=exu.Matrix3DList([np.zeros((3, 3))] * n),
            linkCOMs=exu.Vector3DList(centres),
            linkMasses=list(masses),
            jointPControlVector=list(springs),
            jointDControlVector=list(dampers),
            jointPositionOffsetVector=list(rest),
            jointVelocityOffsetVector=[0.0] * n,
        )
    )

    # The rail shares base and twist with the tree; the rest of its coordinates are its own.
    shared = 2 if fittings.twist else 1
    own = rail.mass.shape[0] - shared
    rail_nodes = [tree_node, _coordinates(system, [0.0] * own)] if own else [tree_node]
    order = np.concatenate([np.arange(shared), np.arange(n, n + own)])
    spread = [np.zeros((n + own, n + own)) for _ in range(3)]
    for target, source in zip(spread, (rail.mass, rail.damping, rail.stiffness), strict=True):
        target[np.ix_(order, order)] = source
    system.AddObject(
        item.ObjectGenericODE2(
            nodeNumbers=rail_nodes, massMatrix=spread[0], dampingMatrix=spread[1], stiffnessMatrix=spread[2]
        )
    )

    def on_link(link: int, x: float) -> int:
        at = item.MarkerKinematicTreeRigid(objectNumber=tree, linkNumber=link, localPosition=[x, 0.0, 0.0])
        return int(system.AddMarker(at))

    first, second = np.cumsum(angles)
    shift = np.array([fittings.twist.at(position) if fittings.twist else 0.0, 0.0, 0.0])
    elbow = shift + head.l1 * np.array([np.cos(first), np.sin(first), 0.0])
    where = {"base": np.zeros(3), "head": elbow, "ground": np.zeros(3)}
    where["tool"] = elbow + head.l2 * np.array([np.cos(second), np.sin(second), 0.0])
    ground = system.AddNode(item.NodePointGround())
    on_tree = {"tool": (n - 1, head.l2), "head": (n - 2, head.l1), "base": (0, 0.0)}
    markers = {place: on_link(*at) for place, at in on_tree.items()}
    markers["ground"] = int(system.AddMarker(item.MarkerNodePosition(nodeNumber=ground)))

    def spring(pair: tuple[int, int], axis: str, stiffness: float, damping: float, offset: Array) -> None:
        along = np.array([0.0, 1.0, 0.0] if axis == "x" else [1.0, 0.0, 0.0])
        system.AddObject(
            item.CartesianSpringDamper(
                markerNumbers=list(pair), stiffness=stiffness * along, damping=damping * along, offset=offset
            )
        )

    for s in fittings.springs:
        one, other = s.ends
        spring((markers[other], markers[one]), s.axis, s.stiffness, s.damping, where[one] - where[other])
    joints = {f"joint{i + 1}": _coordinate_marker(system, tree_node, n - 2 + i) for i in range(2)}
    if fittings.coupling:
        pair = [joints["joint1"], joints["joint2"]]
        system.AddObject(item.CoordinateSpringDamper(markerNumbers=pair, stiffness=fittings.coupling))
    coordinates = {"joint1": n - 2, "joint2": n - 1}
    coordinates |= {"guide": n - 3} if fittings.guide else {}
    # a point of the rail right under the head is the base
    coordinates |= dict.fromkeys(fittings.rail_ports, 0)
    coordinates |= {name: n + i for i, name in enumerate(rail.interface[shared:])}
    if assemble:
        system.Assemble()
    return Machine(system, markers, joints, coordinates, int(tree), n, on_tree)


def linearise(machine: Machine) -> Linearised:
    """Matrices and ports about the rest."""
    system = machine.system
    # numerical differences inside exudyn: stiffness to 1e-7 of itself
    mass, stiffness, damping = system.ComputeLinearizedSystem()[:3]
    count = mass.shape[0]
    rest = np.array(system.systemData.GetODE2Coordinates())
    rows = {name: np.zeros(count) for name in ("tool_x", "tool_z", "head_x", "head_z", "base_x")}
    for i in range(machine.tree_size):
        moved = []
        for step in (_STEP, -_STEP):
            coordinates = rest.copy()
            coordinates[i] += step
            system.systemData.SetODE2Coordinates(coordinates)
            moved.append({name: np.array(system.GetMarkerOutput(m, _POSITION)) for name, m in machine.markers.items()})
        for place in ("tool", "head", "base"):
            slope = (moved[0][place] - moved[1][place]) / (2 * _STEP)
            rows[f"{place}_x"][i] = slope[1]
            if place != "base":
                rows[f"{place}_z"][i] = slope[0]
    system.systemData.SetODE2Coordinates(rest)
    rows |= {name: np.eye(count)[i] for name, i in machine.coordinates.items()}
    return Linearised(mass, damping, stiffness, rows)


def attached(machine: Linearised, fittings: Fittings) -> Linearised:
    """The machine with ties, sprung masses and gyroscopic couplings; a sprung mass adds a coordinate."""
    extra = len(fittings.bobs)
    m, c, k = (np.pad(matrix, (0, extra)) for matrix in (machine.mass, machine.damping, machine.stiffness))
    grown = Linearised(m, c, k, {name: np.pad(row, (0, extra)) for name, row in machine.ports.items()})
    for tie in fittings.ties:
        outer = np.outer(grown.row(tie.port), grown.row(tie.port))
        m += tie.mass * outer
        c += tie.damping * outer
        k += tie.stiffness * outer
    for i, bob in enumerate(fittings.bobs, start=machine.mass.shape[0]):
        row = grown.row(bob.port)
        row[i] -= 1.0
        omega = 2 * np.pi * bob.frequency
        m[i, i] += bob.mass
        c += 2 * bob.damping_ratio * omega * bob.mass * np.outer(row, row)
        k += bob.mass * omega**2 * np.outer(row, row)
    for skew in fittings.skews:
        one, other = grown.row(skew.one), grown.row(skew.other)
        c += skew.coefficient * (np.outer(one, other) - np.outer(other, one))
    return grown


def _coordinates(system: exu.MainSystem, reference: list[float]) -> int:
    zeros = [0.0] * len(reference)
    node = item.NodeGenericODE2(
        referenceCoordinates=reference,
        initialCoordinates=zeros,
        initialCoordinates_t=zeros,
        numberOfODE2Coordinates=len(reference),
    )
    return int(system.AddNode(node))


def _coordinate_marker(system: exu.MainSystem, node: int, coordinate: int) -> int:
    return int(system.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)))
