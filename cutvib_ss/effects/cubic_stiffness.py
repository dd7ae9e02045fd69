"""A joint whose stiffness grows or falls with the square of its rotation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Severity, parameter
from cutvib_ss.effects.law_element import LawElement, StartScale
from cutvib_ss.effects.scales import PortScale


@dataclass(frozen=True)
class CubicStiffness(LawElement):
    """
    Torque k θ + stiffness3 θ³ in place of k θ: hardening, or softening where negative.

    Duffing's spring. Its describing function is ¾ stiffness3 A². A softening one lets motion beyond √(k/-stiffness3) run away.
    """

    effect: ClassVar[str] = "cubic_stiffness"
    severity = Severity("zero", ("stiffness3",))
    sentence = "{place} changes its stiffness with amplitude"
    inspection = "look at {place} for a contact that closes or opens under load, or a preload that is lost"

    # Cubic stiffness [N m/rad^3; N/m^3 at a port that is a displacement]
    stiffness3: float = parameter("N m/rad^3", -2e10, 2e11, "asinh", minimum=None)

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        unit = s.stiffness / s.motion**2
        # The loudest record may move ten times as far, and a light damping shows a stiffness that changes by a percent.
        hardening = np.geomspace(1e-3, 3.0, 8) if s.held else np.geomspace(1e-4, 3.0, 6)
        softening = (-0.001, -0.01, -0.05, -0.2) if s.held else ()
        return ({"stiffness3": float(r) * unit} for r in (*hardening, *softening))

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        unit = scale.stiffness / scale.motion**2
        return {"stiffness3": (-0.5 * unit, 5.0 * unit)}

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"stiffness3": 0.3 * k / motion**2}
