"""A joint whose stiffness grows or falls with the square of its rotation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from cutvib_ss.effects.base import Model, Range, Severity, parameter
from cutvib_ss.effects.law_element import LawElement, StartScale
from cutvib_ss.effects.scales import PortScale
from cutvib_ss.errors import ParameterError


@dataclass(frozen=True)
class CubicStiffness(LawElement):
    """
    Torque k θ + stiffness3 θ³ in place of k θ: hardening, or softening where negative.

    Duffing's spring. Its describing function is ¾ stiffness3 A². A softening one lets motion beyond √(k/-stiffness3) run away.
    One that a weight or a preload holds at an ``offset`` from its middle has a quadratic part, too, k θ + stiffness3 (θ³ + 3 offset
    θ²), with the k that it has at rest. Far beyond a ``bend`` the force may go with another ``exponent`` of θ: 1 where the
    stiffness comes to another constant, 5 where a fifth power takes over.
    """

    effect: ClassVar[str] = "cubic_stiffness"
    severity = Severity("zero", ("stiffness3",))
    sentence = "{place} changes its stiffness with amplitude"
    inspection = "look at {place} for a contact that closes or opens under load, or a preload that is lost"

    # Cubic stiffness [N m/rad^3; N/m^3 at a port that is a displacement]
    stiffness3: float = parameter("N m/rad^3", -2e10, 2e11, "asinh", minimum=None)
    # How far the spring is deflected at rest [rad; m]; by default not at all
    offset: float | None = parameter("rad", -1e-2, 1e-2, "asinh", default=None, minimum=None)
    # Where it bends to another power [rad; m]; by default nowhere
    bend: float | None = parameter("rad", 1e-7, 1e-2, default=None, limits=True)
    # Power of the motion beyond the bend; a distant bend hardly determines it, so its ends are limits
    exponent: float | None = parameter("1", 0.0, 7.0, "linear", default=None, limits=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if (self.bend is None) != (self.exponent is None):
            raise ParameterError(f"{self.effect}: a bend and the exponent beyond it go together; give both or none")

    def further(self, motion: float) -> CubicStiffness | None:
        """With a static offset, and another power beyond half the largest motion; of equal force at 0.7 of that motion."""
        if self.offset is not None:
            return None
        if self.bend is not None:
            return replace(self, offset=0.0)
        # At an exponent of three the force does not depend on the bend.
        bend, exponent = 0.5 * motion, 3.5 if self.stiffness3 > 0.0 else 2.0
        as_strong = (1.0 + (0.7 * motion / bend) ** 2) ** (0.5 * (3.0 - exponent))
        return replace(self, stiffness3=as_strong * self.stiffness3, offset=0.0, bend=bend, exponent=exponent)

    def ranges_here(self, model: Model, motion: float | None = None) -> Mapping[str, Range]:
        given = dict(super().ranges_here(model, motion))
        if self.bend is not None:
            # With an early bend the same change of stiffness takes a larger cubic coefficient.
            most = 10.0 * given["stiffness3"].high
            given["stiffness3"] = replace(given["stiffness3"], low=-most, high=most)
        return given

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        unit = s.stiffness / s.motion**2
        # The loudest record may move ten times as far, and a light damping shows a stiffness that changes by a percent.
        hardening = np.geomspace(1e-3, 3.0, 8) if s.held else np.geomspace(1e-4, 3.0, 6)
        softening = (-0.001, -0.01, -0.05, -0.2) if s.held else ()
        plain: list[dict[str, float]] = [{"stiffness3": float(r) * unit} for r in (*hardening, *softening)]
        # A preloaded joint loses a part of its stiffness, and then no more.
        lost = ((part, bend) for part in (0.05, 0.3) for bend in (0.15, 0.6)) if s.held else ()
        return plain + [
            {"stiffness3": -part * unit / bend**2, "bend": bend * s.motion, "exponent": 1.0} for part, bend in lost
        ]

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        unit = scale.stiffness / scale.motion**2
        return {
            "stiffness3": (-0.5 * unit, 5.0 * unit),
            "offset": (-3.0 * scale.motion, 3.0 * scale.motion),
            "bend": (0.01 * scale.motion, 3.0 * scale.motion),
            "exponent": (0.0, 7.0),
        }

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"stiffness3": 0.3 * k / motion**2}
