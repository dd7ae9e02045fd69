"""What contacts that stick share: the stiffness with which they do stands beside the model's spring, or is a part of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from cutvib_ss.effects.base import Carried, Effect, attached_to
from cutvib_ss.effects.within_spring import WithinSpring
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import SpringDamperMass


@dataclass(frozen=True)
class Sticking(WithinSpring):
    """
    A force that is elastic until it slides.

    Beside the model's spring it makes a quiet joint stiffer. ``within`` that spring, of a model that was fitted to a quiet
    joint, it makes a loud one softer, and the spring is known as well as it was fitted, contact and all.
    """

    sticks_with: ClassVar[str]  # The parameter that is its stiffness while it sticks

    @property
    def _held(self) -> float:
        return float(getattr(self, self.sticks_with))

    def _far_beyond(self, motion: float) -> float:
        """A motion over that at which the contacts slide in the mean."""
        [limit] = [float(getattr(self, name)) for name in self.strength if name != self.sticks_with]
        return max(motion, 1e-300) * self._held / limit

    @classmethod
    def _parts(cls, starts: Sequence[Effect], spring: float) -> Iterable[Effect]:
        return (e._part_of(spring) for e in starts if isinstance(e, Sticking) and np.isfinite(e._held))

    def _part_of(self, spring: float) -> Effect:
        """As stiff over the rest of a spring, of which it is a part, as it was beside it."""
        part = spring / (spring + self._held)
        return replace(self, within=True).changed({name: part * float(getattr(self, name)) for name in self.strength})

    def apply(self, model: Any) -> Any:
        changed = super().apply(model)
        if not self.within:
            return changed
        if model.spring_at(self.place) is None or not np.isfinite(self._held):
            raise ParameterError(
                f"{self.effect} at {self.place!r} is within no spring: it takes one there, and a finite {self.sticks_with}"
            )
        return attached_to(changed, self.place, SpringDamperMass(stiffness=-self._held))

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        found = dict(super().moves(applied))
        if self.within:
            spring = ("attachments", len(applied.attachments) - 1, "element", "stiffness")
            found[self.sticks_with] = (*found[self.sticks_with], (spring, -1.0))
        return found
