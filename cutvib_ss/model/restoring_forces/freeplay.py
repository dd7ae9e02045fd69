"""Clearance before a contact."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.restoring_forces.base import Course, Memoryless, Values, mean_size, value
from cutvib_ss.results import ComplexArray


@dataclass(frozen=True)
class Freeplay(Memoryless):
    """
    No force within ±gap, contact_stiffness (q ∓ gap) beyond, in place of the linear spring.

    To that spring, stiffness · q, it adds (contact - stiffness) q - contact · clip(q, ±gap).
    """

    name: ClassVar[str] = "freeplay"
    strength: ClassVar[tuple[str, ...]] = ("stiffness", "contact_stiffness")

    gap: float = value("rad")
    stiffness: float = value("N m/rad")
    contact_stiffness: float | None = value("N m/rad", default=None)
    """By default the spring's."""

    @property
    def values(self) -> Values:
        return self.gap, self.contact, self.contact - self.stiffness

    @property
    def contact(self) -> float:
        """Stiffness beyond the gap."""
        return self.stiffness if self.contact_stiffness is None else self.contact_stiffness

    @staticmethod
    def resist(p: Values, q: float, v: float) -> float:
        return p[2] * q - p[1] * min(max(q, -p[0]), p[0])

    @staticmethod
    def tangents(p: Values, q: float, v: float) -> tuple[float, float]:
        return (p[2] - p[1] if abs(q) < p[0] else p[2]), 0.0

    @staticmethod
    def implicit(p: Values, q: float, a: float, v: float, b: float) -> float:
        """Two straight lines; where the lacking spring outweighs the step's compliance (a k ≥ 1), it jumps to contact."""
        gap, contact, more = p[0], p[1], p[2]
        inside = 1.0 + a * (more - contact)
        if inside > 0.0 and abs(q) <= gap * inside:
            return (more - contact) * q / inside
        held = contact * math.copysign(gap, q)
        if more == 0.0:
            return -held
        beyond = 1.0 + a * more
        return (more * q - held) / beyond if beyond > 0.0 else math.nan

    @staticmethod
    def mean(p: Values, q: Course, v: Course, f0: float, f1: float) -> float:
        """Exact for straight motion over each half, with what Simpson's rule adds to that for its bend."""
        gap, bend = p[0], (2.0 * q[1] - q[0] - q[2]) / 12.0
        high = mean_size(q[0] + gap, q[1] + gap) + mean_size(q[1] + gap, q[2] + gap)
        low = mean_size(q[0] - gap, q[1] - gap) + mean_size(q[1] - gap, q[2] - gap)
        held = 0.25 * (high - low) + (bend if abs(q[1]) < gap else 0.0)
        linear = p[2] * (q[0] + 4.0 * q[1] + q[2]) / 6.0 if p[2] != 0.0 else 0.0
        return linear - p[1] * held

    @staticmethod
    def steepest(p: Values, q: float, v: float) -> float:
        """The greater of the two branches: within the gap and in contact."""
        return max(abs(p[2] - p[1]), abs(p[2]))

    def describing_function(self, amplitude: ArrayLike, omega: ArrayLike) -> ComplexArray:
        ratio = np.minimum(self.gap / np.asarray(amplitude, dtype=np.float64), 1.0)
        saturation = 2.0 / np.pi * (np.arcsin(ratio) + ratio * np.sqrt(1.0 - ratio**2))
        return np.asarray(self.contact - self.stiffness - self.contact * saturation + 0j * np.asarray(omega))
