"""
The cutting head as an equivalent two-link robot (Section 3.1, Eqs. 1-3).

Everything follows from where the two masses move. With absolute link angles, X down and Z along the machine,

    head_x = x_b + l1 cos θ01 · θ1                    head_z = -l1 sin θ01 · θ1
    tool_x = head_x + l2 cos(θ01+θ02) · (θ1 + θ2)     tool_z = head_z - l2 sin(θ01+θ02) · (θ1 + θ2)

and the mass matrix of Eq. 2 is m1 (h_x h_xᵀ + h_z h_zᵀ) + m2 (t_x t_xᵀ + t_z t_zᵀ) over those rows; the generalised force of
Eq. 3 is the row of tool_x; Eqs. 12 and 13 are the rows of tool_x and tool_z. On a rail that twists the base is the
rail's shear centre, where bending is felt alone. Its rotation ψ turns both links as θ1 does, and lifts the first joint,
and so both masses, by the eccentricity e of that joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.parameters import HeadParameters
from cutvib_ss.results import FloatArray

HEAD_PARAMETERS = ("m1", "m2", "l1", "l2", "theta01", "theta02", "k1", "k2", "c1", "c2")
"""Names of the head's ten parameters, in the tables' order."""
HEAD_UNITS = ("kg", "kg", "m", "m", "rad", "rad", "N m/rad", "N m/rad", "N m s/rad", "N m s/rad")
"""Their SI units."""
HEAD_DOFS = ("theta1", "theta2", "base", "twist")
"""Its coordinates: rotations of the joints, and what follows the rail."""
_MASSES = {"m1": ("head_x", "head_z"), "m2": ("tool_x", "tool_z")}


@lru_cache(maxsize=64)
def head_rows(p: HeadParameters, twist: bool = False, eccentricity: float = 0.0) -> Mapping[str, FloatArray]:
    """Rows of the head's ports over (θ1, θ2, x_b) and, on a rail that twists, ψ, shape (3,) or (4,)."""
    a, b = p.theta01, p.theta01 + p.theta02
    x1, z1 = p.l1 * np.cos(a), -p.l1 * np.sin(a)
    x2, z2 = p.l2 * np.cos(b), -p.l2 * np.sin(b)
    return _with_twist(
        {
            "tool_x": np.array([x1 + x2, x2, 1.0]),
            "tool_z": np.array([z1 + z2, z2, 0.0]),
            "head_x": np.array([x1, 0.0, 1.0]),
            "head_z": np.array([z1, 0.0, 0.0]),
            "base": np.array([0.0, 0.0, 1.0]),
            "joint1": np.array([1.0, 0.0, 0.0]),
            "joint2": np.array([0.0, 1.0, 0.0]),
        },
        twist,
        eccentricity,
    )


def head_row_derivatives(
    p: HeadParameters, name: str, twist: bool = False, eccentricity: float = 0.0
) -> dict[str, FloatArray]:
    """Derivatives of the rows to one of the head's parameters; rows that do not depend on it are left out."""
    a, b = p.theta01, p.theta01 + p.theta02
    # Derivatives of (x1, z1, x2, z2) of head_rows.
    moves = {
        "l1": (np.cos(a), -np.sin(a), 0.0, 0.0),
        "l2": (0.0, 0.0, np.cos(b), -np.sin(b)),
        "theta01": (-p.l1 * np.sin(a), -p.l1 * np.cos(a), -p.l2 * np.sin(b), -p.l2 * np.cos(b)),
        "theta02": (0.0, 0.0, -p.l2 * np.sin(b), -p.l2 * np.cos(b)),
    }
    if name not in moves:
        return {}
    x1, z1, x2, z2 = moves[name]
    rows = {
        "tool_x": np.array([x1 + x2, x2, 0.0]),
        "tool_z": np.array([z1 + z2, z2, 0.0]),
        "head_x": np.array([x1, 0.0, 0.0]),
        "head_z": np.array([z1, 0.0, 0.0]),
    }
    return _with_twist(rows, twist, eccentricity, port=False)


def head_changes(
    p: HeadParameters, name: str, twist: bool = False, eccentricity: float = 0.0
) -> tuple[dict[str, FloatArray], list[tuple[int, FloatArray]]]:
    """
    How the head moves with one of its parameters, or with the ``"eccentricity"``.

    Derivatives of its rows, and of its dynamic stiffness as (power of s, matrix), or (power, row r) of r rᵀ alone.
    """
    rows = head_rows(p, twist, eccentricity)
    if name in ("k1", "k2", "c1", "c2"):
        return {}, [(int(name[0] == "c"), rows["joint" + name[1]])]
    if name in ("m1", "m2"):
        return {}, [(2, np.sum([np.outer(rows[r], rows[r]) for r in _MASSES[name]], axis=0))]
    if name == "eccentricity":
        # The twist lifts what follows the base by the eccentricity.
        moved = {port: np.array([0.0, 0.0, 0.0, row[2]]) for port, row in rows.items() if row[2] and port != "base"}
    else:
        moved = head_row_derivatives(p, name, twist, eccentricity)
    change = np.zeros((len(rows["base"]),) * 2)
    for mass, ports in _MASSES.items():
        for port in (r for r in ports if r in moved):
            half = getattr(p, mass) * np.outer(moved[port], rows[port])
            change += half + half.T
    return moved, [(2, change)]


def _with_twist(
    rows: dict[str, FloatArray], twist: bool, eccentricity: float, port: bool = True
) -> dict[str, FloatArray]:
    if not twist:
        return rows
    still = ("base", "joint1", "joint2")
    turned = {
        name: np.append(row, 0.0 if name in still else row[0] + eccentricity * row[2]) for name, row in rows.items()
    }
    if port:
        turned["twist"] = np.array([0.0, 0.0, 0.0, 1.0])
    return turned


def mass_matrix(p: HeadParameters, rows: Mapping[str, FloatArray]) -> FloatArray:
    """Eq. 2, from the rows of the two masses, shape (3, 3) or (4, 4)."""
    total: FloatArray = p.m1 * (np.outer(rows["head_x"], rows["head_x"]) + np.outer(rows["head_z"], rows["head_z"]))
    total += p.m2 * (np.outer(rows["tool_x"], rows["tool_x"]) + np.outer(rows["tool_z"], rows["tool_z"]))
    return total


def head_matrices(p: HeadParameters, rows: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M, C and K of Eq. 1, of the size of the rows."""
    damping, stiffness = (
        np.diag([one, two, *[0.0] * (rows["base"].size - 2)]) for one, two in ((p.c1, p.c2), (p.k1, p.k2))
    )
    return mass_matrix(p, rows), damping, stiffness


def head(p: HeadParameters, twist: bool = False, eccentricity: float = 0.0) -> SecondOrder:
    """The head over (θ1, θ2, x_b), and ψ on a rail that twists (Eq. 1); the mass matrix is singular where θ01 = 0 (Table 1)."""
    rows = head_rows(p, twist, eccentricity)
    return SecondOrder(*head_matrices(p, rows), HEAD_DOFS[: rows["base"].size], rows)
