"""Receptance of the rail's twist at points, for all positions and frequencies at once, with derivatives."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from cutvib_ss.model.rail import Torsion
from cutvib_ss.model.twist import twist_modes
from cutvib_ss.response.batched import mixed
from cutvib_ss.results import ComplexArray, FloatArray

_STEP = 1e-5
"""Relative step of the difference by which the fixing of the ends is moved."""


class TwistReceptance:
    """
    Twist per torque at points of the rail.

    Σ ψ_k² / (J/2 (s² + g_k (2ζω_1 s + ω_1²))) [rad/(N m)], as in `cutvib_ss.model.twist`.
    """

    def __init__(self, torsion: Torsion, positions: FloatArray, s: ComplexArray) -> None:
        self.torsion, self.positions, self.s = torsion, positions, s
        self.w = 2 * np.pi * torsion.torsion_frequency
        modes = twist_modes(torsion.fixing)
        self._squares, self._stiffness = modes.shapes(positions) ** 2, modes.stiffness
        elastic = self.w * self.w + 2 * torsion.damping_ratio * self.w * s
        below = np.multiply.outer(self._stiffness, elastic) + s * s
        self._flexibility: ComplexArray = np.reciprocal(torsion.inertia / 2 * below)

    @cached_property
    def value(self) -> ComplexArray:
        """The receptance, shape (position, frequency)."""
        return mixed(self._squares, self._flexibility)

    @cached_property
    def _sums(self) -> ComplexArray:
        """Σ ψ² (g, 1) / (…)² over the modes."""
        weights = np.array([self._stiffness, np.ones(self._stiffness.size)])
        return mixed(weights[:, None] * self._squares, self._flexibility**2)

    def derivative(self, name: str) -> ComplexArray:
        """Its derivative to a value, shape (position, frequency)."""
        t, s, w = self.torsion, self.s, self.w
        if name == "inertia":
            return -self.value / t.inertia
        if name == "fixing":
            # Shapes and stiffnesses of all modes move with it.
            ends = [replace(t, fixing=t.fixing * (1.0 + step)) for step in (_STEP, -_STEP)]
            above, below = (TwistReceptance(end, self.positions, s).value for end in ends)
            return (above - below) / (2.0 * _STEP * t.fixing)
        by_elastic, by_inertia = -t.inertia / 2 * self._sums
        if name == "s":
            both: ComplexArray = 2 * t.damping_ratio * w * by_elastic + 2 * s * by_inertia
            return both
        elastic = {
            "torsion_frequency": 2 * (w + t.damping_ratio * s) * w / t.torsion_frequency,
            "damping_ratio": 2 * w * s,
        }
        out: ComplexArray = elastic[name] * by_elastic
        return out
