"""
What the tool can tell of the head: the eight combinations of its ten parameters that XX and ZX depend on, base held.

A rotation is seen only through the motion of the tool. Let t_1 and t_2 be the tool's motion per unit of θ1 and θ2, with
lengths g_1 = |t_1| and g_2 = l_2. Measured in metres at the tool, each joint's motion has the direction of t_i, the
stiffness k_i/g_i² and the damping c_i/g_i²; the head's mass is felt through m_1 l_1²/g_1², the tool's as m_2. Nothing
else enters: scaling either rotation (with its length, stiffness, damping and inertia) leaves both responses as they
are. These are the two directions in which no fit of XX and ZX can be unique.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import atan2
from types import MappingProxyType

import numpy as np

from cutvib_ss.model.head import HEAD_PARAMETERS, head_row_derivatives, head_rows
from cutvib_ss.parameters import HeadParameters
from cutvib_ss.results import FloatArray

TOOL_SIDE_UNITS: Mapping[str, str] = MappingProxyType(
    {
        "tool_mass": "kg",
        "head_mass_at_tool": "kg",
        "joint1_direction": "rad",
        "joint2_direction": "rad",
        "joint1_stiffness_at_tool": "N/m",
        "joint2_stiffness_at_tool": "N/m",
        "joint1_damping_at_tool": "N s/m",
        "joint2_damping_at_tool": "N s/m",
    }
)
"""Units of the eight: m_2, m_1 l_1²/g_1², the angles of t_1 and t_2 to X, k_i/g_i² and c_i/g_i²."""


def tool_side(head: HeadParameters) -> dict[str, float]:
    """
    The eight combinations.

    Parameters
    ----------
    head : HeadParameters
        The head.

    Returns
    -------
    dict of str to float
        Values by the names of `TOOL_SIDE_UNITS`.

    Examples
    --------
    >>> from cutvib_ss.parameters import table_3
    >>> tool_side(table_3())["joint2_stiffness_at_tool"]
    1133029.5
    """
    x, y = _lever(head)
    g1, g2 = x * x + y * y, head.l2**2
    return {
        "tool_mass": head.m2,
        "head_mass_at_tool": head.m1 * head.l1**2 / g1,
        "joint1_direction": atan2(y, x),
        "joint2_direction": head.theta01 + head.theta02,
        "joint1_stiffness_at_tool": head.k1 / g1,
        "joint2_stiffness_at_tool": head.k2 / g2,
        "joint1_damping_at_tool": head.c1 / g1,
        "joint2_damping_at_tool": head.c2 / g2,
    }


def tool_side_gradient(head: HeadParameters) -> dict[str, FloatArray]:
    """Derivatives of the combinations to the ten parameters."""
    x, y = _lever(head)
    g1, g2 = x * x + y * y, head.l2**2
    dx, dy = np.zeros(len(HEAD_PARAMETERS)), np.zeros(len(HEAD_PARAMETERS))
    for i, name in enumerate(HEAD_PARAMETERS):
        moved = head_row_derivatives(head, name)
        if moved:
            dx[i], dy[i] = moved["tool_x"][0], -moved["tool_z"][0]
    unit = {name: np.eye(len(HEAD_PARAMETERS))[i] for i, name in enumerate(HEAD_PARAMETERS)}
    dg1, dg2 = 2 * (x * dx + y * dy), 2 * head.l2 * unit["l2"]
    inertia = head.m1 * head.l1**2
    d_inertia = head.l1**2 * unit["m1"] + 2 * head.m1 * head.l1 * unit["l1"]

    def ratio(top: float, d_top: FloatArray, below: float, d_below: FloatArray) -> FloatArray:
        return (d_top * below - top * d_below) / below**2

    return {
        "tool_mass": unit["m2"],
        "head_mass_at_tool": ratio(inertia, d_inertia, g1, dg1),
        "joint1_direction": (x * dy - y * dx) / g1,
        "joint2_direction": unit["theta01"] + unit["theta02"],
        "joint1_stiffness_at_tool": ratio(head.k1, unit["k1"], g1, dg1),
        "joint2_stiffness_at_tool": ratio(head.k2, unit["k2"], g2, dg2),
        "joint1_damping_at_tool": ratio(head.c1, unit["c1"], g1, dg1),
        "joint2_damping_at_tool": ratio(head.c2, unit["c2"], g2, dg2),
    }


def _lever(head: HeadParameters) -> tuple[float, float]:
    """The tool's motion per unit of θ1: in X, and against Z."""
    rows = head_rows(head)
    return float(rows["tool_x"][0]), -float(rows["tool_z"][0])
