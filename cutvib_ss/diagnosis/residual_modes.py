"""
Residual modes: what modes above the model's highest one add to a receptance in the band.

    R(ω) = Σ_k a_k / (m ω_k² (1 - (ω/ω_k)² + 2jζ ω/ω_k)),   a_k ~ N(0, size²)

Far below it is a constant, the residual flexibility of experimental modal analysis (Ewins 2000, Modal Testing); close to the
next mode it rises. The frequencies are not known. But a sum of any modes above the band is a smooth function in it, and a few
fixed ones whose distances from the band grow in proportion hold it, as rational approximations on poles that cluster at a
singularity do (Gopal and Trefethen 2019, SIAM Journal on Numerical Analysis 57, 2074-2094).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cutvib_ss.diagnosis.records import Group
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.results import ComplexArray, FloatArray


@dataclass(frozen=True)
class ResidualMode:
    """One mode above the band, between an input and a channel."""

    input: str
    channel: str
    frequency: float  # [Hz]
    damping: float  # Ratio
    flexibility: float  # [m/N], of a mode that moves the ports' masses

    def receptance(self, freq: FloatArray) -> ComplexArray:
        """Receptance [m/N], shape (frequency,)."""
        ratio = freq / self.frequency
        relative: ComplexArray = np.reciprocal(1.0 - ratio**2 + 2j * self.damping * ratio)
        return self.flexibility * relative


def residual_modes(nominal: Model, groups: Sequence[Group], highest: float) -> tuple[ResidualMode, ...]:
    """Modes that a model leaves out above its highest one and above a highest line [Hz], of all inputs and channels of groups."""
    if nominal.highest_mode is None:
        return ()
    last, damping = nominal.highest_mode
    above = [max(last, highest) * ratio for ratio in SETTINGS.likelihood_residual_modes]
    pairs = sorted({(i, c) for g in groups for i in g.inputs for c in g.channels})
    at = {name: nominal.accelerance_above(name) for name in {name for pair in pairs for name in pair}}
    return tuple(
        ResidualMode(i, c, f, damping, float(np.sqrt(at[i] * at[c])) / (2.0 * np.pi * f) ** 2)
        for i, c in pairs
        for f in above
    )
