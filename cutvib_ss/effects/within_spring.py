"""Restoring forces of which there are two forms: beside the model's spring, or of a part of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from cutvib_ss.effects.base import Effect, Measured, Model
from cutvib_ss.effects.law_element import LawElement
from cutvib_ss.errors import ParameterError


@dataclass(frozen=True)
class WithinSpring(LawElement):
    """A restoring force that may be that of a part of its place's spring."""

    within: bool = field(default=False, kw_only=True)  # Whether the model's spring holds its stiffness already

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.within, bool):
            raise ParameterError(f"{self.effect}: within = {self.within!r} is neither true nor false")

    @classmethod
    def forms(cls, model: Model, place: str) -> int:
        return 1 if model.spring_at(place) is None else 2

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for place, starts in super().starts(model, measured):
            yield place, starts
            if (spring := model.spring_at(place)) is not None:
                yield f"{place} within", tuple(cls._parts(starts, spring[0]))

    @classmethod
    def _parts(cls, starts: Sequence[Effect], spring: float) -> Iterable[Effect]:
        """Starts within a spring of that stiffness, made of those beside it."""
        raise NotImplementedError
