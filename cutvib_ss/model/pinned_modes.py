"""
Modes of the pinned rail in closed form: Euler-Bernoulli's, or Timoshenko's with shear and rotary inertia.

Deflection w and rotation ψ of the cross-section; the shear strain is w' - ψ. Between pins, w = Σ a_r sin(rπy/L) and
ψ = Σ b_r cos(rπy/L) satisfy every condition at the ends, and the modes stay sines. With R = κGA L²/(π² EI) (the first mode's
shear stiffness over its bending stiffness), ε = κG/E, x = r²/R, β_r = b_r L/(rπ) and ω_r = r² ω_1 Euler-Bernoulli's frequencies,

    2T = μL/2 Σ (ȧ² + ε x β̇²),   2V = μL/2 Σ ω_r² (β² + (a - β)²/x),

since EI/(κGA L²) = 1/(π² R), and the radius of gyration ρ follows from the same ratio, ρ²/L² = (κG/E) EI/(κGA L²) = ε/(π² R).
Each r has two modes, λ = (ω/ω_r)² being the roots of ε x² λ² - (1 + (1 + ε) x) λ + 1 = 0, and r = 0 has one, uniform
rotation ψ = b_0 without deflection, at the cut-off √(κGA/(μρ²)) = ω_1 R/√ε. Pins hold it apart; ends that give or that resist
turning excite it. With x → 0 the lower branch is Euler-Bernoulli's and the upper one infinitely high.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.results import FloatArray

SHEAR_TO_EXTENSION = 0.33
"""ε = κG/E: 0.385 for G/E of steel or aluminium, times a shear coefficient of 0.85 (a solid rectangle: 5/6)."""


@dataclass(frozen=True)
class PinnedModes:
    """Modes of the pinned rail; all of modal mass μL/2, all values dimensionless."""

    number: FloatArray  # r, the half waves of each mode: 1 … m; with shear then 0 … m of the upper branch
    frequency: FloatArray  # Natural frequency over Euler-Bernoulli's first
    deflection: FloatArray  # Amplitude of w = d sin(rπy/L) per unit amplitude of the mode
    rotation: FloatArray  # Amplitude of L ψ = t cos(rπy/L) per unit amplitude
    # Inertial coupling with the rail's rigid motions h = (1 - y/L, y/L), whose rotation is h': ∫ (w h + ρ² ψ h') dy/L
    coupling: FloatArray
    rigid_inertia: FloatArray  # Of the rigid motions themselves: ∫ (h hᵀ + ρ² h' h'ᵀ) dy/L

    def __post_init__(self) -> None:
        for f in fields(self):
            getattr(self, f.name).flags.writeable = False

    def deflections(self, position: ArrayLike) -> FloatArray:
        """Deflection of the modes at points, shape (position, mode)."""
        y = np.atleast_1d(np.asarray(position, dtype=float))
        shapes: FloatArray = np.sin(np.pi * np.outer(y, self.number)) * self.deflection
        return shapes

    def rotations(self, position: float) -> FloatArray:
        """Rotation of the cross-section at a point, shape (mode,)."""
        rotations: FloatArray = self.rotation * np.cos(np.pi * self.number * position)
        return rotations


def _end_to_end(diagonal: float, other: float) -> FloatArray:
    return np.array([[diagonal, other], [other, diagonal]])


@lru_cache(maxsize=64)
def euler_bernoulli(n_modes: int) -> PinnedModes:
    """
    Modes of a beam that bends only (Eqs. 7 and 8).

    >>> euler_bernoulli(3).frequency
    array([1., 4., 9.])
    """
    r = np.arange(1.0, n_modes + 1)
    coupling = np.column_stack([1.0 / (np.pi * r), (-1.0) ** (r + 1) / (np.pi * r)])
    return PinnedModes(r, r**2, np.ones(n_modes), np.pi * r, coupling, _end_to_end(1 / 3, 1 / 6))


@lru_cache(maxsize=64)
def timoshenko(n_modes: int, ratio: float) -> tuple[PinnedModes, PinnedModes]:
    """
    Modes of a beam with shear deformation and rotary inertia, and their derivatives to the shear ratio.

    In the coordinates (a, √(εx) β), in which the mass is the identity, the two modes of a sine are (cos φ, sin φ) and
    (sin φ, -cos φ), with tan φ = √(εx) (1 - xλ) at the lower root. Second root of the quadratic: λ = 1/(ε x² λ_lower).

    >>> modes, _ = timoshenko(2, 40.0)
    >>> modes.number, modes.frequency.round(2)
    (array([1., 2., 0., 1., 2.]), array([ 0.98,  3.76, 69.63, 70.77, 74.02]))
    """
    e = SHEAR_TO_EXTENSION
    r = np.arange(n_modes + 1.0)
    # The derivatives below are to x; those of x and of √(R/ε) to the ratio come last.
    x, dx = r**2 / ratio, -(r**2) / ratio**2
    p = 1 + (1 + e) * x
    root = np.sqrt(p**2 - 4 * e * x**2)
    total, d_total = p + root, 1 + e + (p * (1 + e) - 4 * e * x) / root
    low, d_low = 2 / total, -2 * d_total / total**2
    above = 1 - x * low
    d_above = -low - x * d_low
    angle = np.arctan(np.sqrt(e * x) * above)
    # d tan φ = √(e/x)/2 · above + √(e x) d_above, times dx; x^(1/2) and its slope go with r alone.
    d_angle = np.cos(angle) ** 2 * np.sqrt(e) * r * (
        above * (-0.5 * ratio**-1.5) + ratio**-0.5 * d_above * dx
    )  # fmt: skip
    cos, sin = np.cos(angle), np.sin(angle)
    d_cos, d_sin = -sin * d_angle, cos * d_angle
    low_frequency = r**2 * np.sqrt(low)
    d_low_frequency = r**2 * d_low * dx / (2 * np.sqrt(low))
    high_frequency = ratio * np.sqrt(total / (2 * e))
    d_high_frequency = high_frequency * (1 / ratio + d_total * dx / (2 * total))
    size, d_size = np.pi * np.sqrt(ratio / e), np.pi / (2 * np.sqrt(ratio * e))
    # A uniform rotation has twice the mean square of a cosine.
    share = np.where(r == 0, np.sqrt(0.5), 1.0)
    plain = euler_bernoulli(n_modes)
    mean, d_mean = -np.sqrt(e / (2 * ratio)) / np.pi, np.sqrt(e / 2) * ratio**-1.5 / (2 * np.pi)
    turning, d_turning = e / (np.pi**2 * ratio), -e / (np.pi * ratio) ** 2

    def coupled(lower: FloatArray, upper: FloatArray, uniform: float) -> FloatArray:
        return np.vstack([lower * plain.coupling, [[-uniform, uniform]], upper * plain.coupling])

    modes = PinnedModes(
        number=np.concatenate([r[1:], r]),
        frequency=np.concatenate([low_frequency[1:], high_frequency]),
        deflection=np.concatenate([cos[1:], sin]),
        rotation=np.concatenate([size * sin[1:], -size * share * cos]),
        coupling=coupled(cos[1:, None], sin[1:, None], mean),
        rigid_inertia=plain.rigid_inertia + _end_to_end(turning, -turning),
    )
    slope = PinnedModes(
        number=modes.number,
        frequency=np.concatenate([d_low_frequency[1:], d_high_frequency]),
        deflection=np.concatenate([d_cos[1:], d_sin]),
        rotation=np.concatenate([
            (d_size * sin + size * d_sin)[1:], -share * (d_size * cos + size * d_cos)
        ]),
        coupling=coupled(d_cos[1:, None], d_sin[1:, None], d_mean),
        rigid_inertia=_end_to_end(d_turning, -d_turning),
    )  # fmt: skip
    return modes, slope
