"""Receptance of the rail's twist at points, for all positions and frequencies at once, with derivatives."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from cutvib_ss.model.rail import Torsion
from cutvib_ss.model.twist import twist_shapes, twist_stiffness
from cutvib_ss.response.batched import mixed
from cutvib_ss.results import ComplexArray, FloatArray


class TwistReceptance:
    """
    Twist per torque at points of the rail.

    Σ ψ_k² / (J/2 (s² + g_k (2ζω_1 s + ω_1²))) [rad/(N m)], as in `cutvib_ss.model.twist`.
    """

    def __init__(self, torsion: Torsion, positions: FloatArray, s: ComplexArray) -> None:
        self.torsion, self.s = torsion, s
        self.w = 2 * np.pi * torsion.torsion_frequency
        self._squares = twist_shapes(positions) ** 2
        self._stiffness = twist_stiffness()
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
