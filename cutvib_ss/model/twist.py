"""
Twist of the rail: a uniform shaft on ends that hold its twist like springs, by its modes and what the modes left out add.

With κ the stiffness of each end over that of the whole shaft, mode k is sin(β_k y/L + φ_k), tan φ_k = β_k/κ, and both ends agree
where β_k + 2 φ_k = kπ. Ends that hold have κ = ∞ and β_k = kπ; as κ falls the first mode becomes that of a stiff rail which rocks
on its fixings. Modal stiffnesses are in proportion to β_k². Normalised to an inertia of J/2, a unit torque at y twists the shaft
there by

    Σ ψ_k² / (J/2 (s² + g_k a)),   g_k = β_k²/β_1²,   a = ω_1² + 2ζω_1 s.

The static sum is known: both halves of the shaft with their ends in parallel, which is β_1²/2 · a b/(a + b) with a = y/L + 1/κ and
b = 1 - y/L + 1/κ. Of ends that hold the whole sum is that of the continuous shaft,
(π/2z) sinh(πzy/L) sinh(πz(1 - y/L)) / sinh(πz) over J/2 · a, with z² = s²/a.

The first `TWIST_MODES` are kept. What all others add where the head is, is one coordinate more: its shape there makes the static
twist exact, and its frequency, g_h = Σ g_k⁻¹ / Σ g_k⁻² over the modes left out, their inertia on average.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.results import FloatArray

TWIST_MODES = 20
"""Modes that are kept. Up to the fifth the twist is the shaft's within 10⁻⁵, at L/50 from an end within 10⁻³."""

_SUMMED = 4000  # Modes of which the remainder's frequency is made; those beyond are integrated


@dataclass(frozen=True)
class TwistModes:
    """Modes of a shaft whose ends have a stiffness of `fixing` times that of the shaft."""

    fixing: float  # κ
    turn: FloatArray  # β_k, shape (TWIST_MODES,)
    phase: FloatArray  # φ_k
    stiffness: FloatArray  # g_k of the modes, then of the remainder, shape (TWIST_MODES + 1,)

    def shapes(self, position: ArrayLike) -> FloatArray:
        """
        Shapes of the twist's coordinates at points of the rail, shape (position, TWIST_MODES + 1).

        Those of the modes, then the remainder's for a torque at that very point.
        """
        y = np.atleast_1d(np.asarray(position, dtype=float))
        squares = 1.0 + np.sin(2.0 * self.phase) / self.turn
        kept = np.sin(np.multiply.outer(y, self.turn) + self.phase) / np.sqrt(squares)
        near, far = y + 1.0 / self.fixing, 1.0 - y + 1.0 / self.fixing
        static = self.turn[0] ** 2 / 2.0 * near * far / (near + far)
        left = static - np.sum(kept**2 / self.stiffness[:-1], axis=1)
        return np.column_stack([kept, np.sqrt(self.stiffness[-1] * np.maximum(left, 0.0))])


@lru_cache(maxsize=256)
def twist_modes(fixing: float = float("inf")) -> TwistModes:
    """The modes for a stiffness of each end over that of the whole shaft; infinite: held."""
    number = np.arange(1, _SUMMED + 1)
    turn: FloatArray = np.asarray(np.pi * (number - 1.0), dtype=np.float64)
    # β + 2 atan(β/κ) is concave: from below Newton's steps rise to its root and never pass it.
    for _ in range(60):
        error = number * np.pi - turn - 2.0 * np.arctan(turn / fixing)
        if np.abs(error).max() < 1e-12 * _SUMMED:
            break
        slope = 1.0 + (0.0 if np.isinf(fixing) else 2.0 * fixing / (fixing**2 + turn**2))
        turn += error / slope
    phase = np.arctan(turn / fixing)
    beyond = _SUMMED + 0.5
    squares, fourths = (
        np.sum(turn[TWIST_MODES:] ** -order) + np.pi**-order * beyond ** (1.0 - order) / (order - 1.0)
        for order in (2.0, 4.0)
    )
    stiffness: FloatArray = np.append(turn[:TWIST_MODES] ** 2, squares / fourths) / turn[0] ** 2
    return TwistModes(fixing, turn[:TWIST_MODES], phase[:TWIST_MODES], stiffness)
