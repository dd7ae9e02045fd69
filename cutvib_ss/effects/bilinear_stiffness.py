"""A joint that is stiffer to one side."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

from cutvib_ss.effects.base import Severity, parameter
from cutvib_ss.effects.law_element import LawElement, StartScale
from cutvib_ss.effects.scales import PortScale
from cutvib_ss.errors import ParameterError


@dataclass(frozen=True)
class BilinearStiffness(LawElement):
    """
    Stiffness k (1 + a) where θ > 0 and k (1 - a) where θ < 0.

    The asymmetry of the joints that the paper's conclusions name. To the linear spring k that the port spans it adds k a abs(θ).
    Its describing function is nothing: it shifts the mean and makes even harmonics, and is the same at every level.
    """

    effect: ClassVar[str] = "bilinear_stiffness"
    severity = Severity("zero", ("asymmetry",))
    sentence = "{place} is stiffer in one direction than in the other"
    inspection = "look at {place} for a stop or a face that carries load in one direction only"
    scale_free: ClassVar[bool] = True

    asymmetry: float = parameter("1", -0.95, 0.95, "asinh", minimum=None)  # a, between -1 and 1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not -1.0 < self.asymmetry < 1.0:
            raise ParameterError(f"bilinear_stiffness: asymmetry = {self.asymmetry} must lie between -1 and 1")

    @classmethod
    def _starts(cls, s: StartScale) -> Iterable[Mapping[str, float]]:
        return ({"asymmetry": a} for a in (-0.7, -0.35, -0.15, -0.05, 0.05, 0.15, 0.35, 0.7))

    @classmethod
    def _bounds(cls, scale: PortScale) -> Mapping[str, tuple[float, float]]:
        return {"asymmetry": (-0.95, 0.95)}

    @classmethod
    def _examples(cls, motion: float, k: float) -> Iterator[Mapping[str, float]]:
        yield {"asymmetry": 0.3}
