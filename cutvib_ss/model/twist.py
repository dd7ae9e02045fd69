"""
Twist of the rail: a uniform shaft held at both ends, by its modes and what the modes left out add.

The modes are sin(kπy/L), k = 1 …, with modal stiffness J/2 · ω_1² k² and inertia J/2. A unit torque at y twists the shaft there by

    Σ sin²(kπy/L) / (J/2 (s² + k² a)),   a = ω_1² + 2ζω_1 s,

whose static sum is known, Σ sin²(kπy/L)/k² = π² (y/L)(1 - y/L)/2, and whose whole sum is that of the continuous shaft,
(π/2z) sinh(πzy/L) sinh(πz(1 - y/L)) / sinh(πz) over J/2 · a, with z² = s²/a.

The first `TWIST_MODES` are kept. What all others add where the head is, is one coordinate more: its shape there makes the static
twist exact, and its frequency, k_h² = Σ k⁻² / Σ k⁻⁴ over the modes left out, their inertia on average.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.results import FloatArray

TWIST_MODES = 20
"""Modes that are kept. Up to the fifth the twist is the shaft's within 10⁻⁵, at L/50 from an end within 10⁻³."""

_KEPT = np.arange(1, TWIST_MODES + 1)
_REMAINDER = float((np.pi**2 / 6 - np.sum(1.0 / _KEPT**2)) / (np.pi**4 / 90 - np.sum(1.0 / _KEPT**4)))


def twist_shapes(position: ArrayLike) -> FloatArray:
    """
    Shapes of the twist's coordinates at points of the rail, shape (position, TWIST_MODES + 1).

    sin(kπy/L), then the remainder's shape for a torque at that very point.
    """
    y = np.atleast_1d(np.asarray(position, dtype=float))
    kept = np.sin(np.outer(y, np.pi * _KEPT))
    left = np.pi**2 * y * (1 - y) / 2 - np.sum((kept / _KEPT) ** 2, axis=1)
    return np.column_stack([kept, np.sqrt(_REMAINDER * np.maximum(left, 0.0))])


def twist_stiffness() -> FloatArray:
    """Modal stiffness of the twist's coordinates relative to J/2 ω_1², shape (TWIST_MODES + 1,); their inertia is J/2."""
    return np.append(_KEPT.astype(float) ** 2, _REMAINDER)
