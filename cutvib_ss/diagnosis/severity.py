"""How the severity of each cause runs from none, for asking how little of it a campaign would see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from cutvib_ss.diagnosis.hypotheses import Candidate
from cutvib_ss.effects.base import Effect, Model, identifying_values, parameter_fields


@dataclass(frozen=True)
class Run:
    """A cause whose severity runs from none."""

    name: str  # Effect, place, and parameter or channel that it names
    effect: Effect  # The cause at severity one

    @property
    def head(self) -> str:
        """The parameter that tells the severity."""
        return self.effect.grown_by.carried_by[0]

    def unit(self, model: Model) -> str:
        """Its SI unit on a model."""
        return self.effect.units(model).get(self.head, "")

    @property
    def weak_end(self) -> str:
        """Where its severity ends in nothing: ``"zero"``, ``"one"`` or ``"infinity"``; ``"whole"`` where it does not."""
        return self.effect.grown_by.end

    @property
    def whole(self) -> bool:
        """Whether it is either there or not."""
        return self.weak_end == "whole"

    @property
    def parameters(self) -> int:
        """Number of its fitted parameters, at least one."""
        return max(len(parameter_fields(type(self.effect))), 1)

    def at(self, severity: float) -> Effect:
        """The cause at a severity: 0 is none, 1 the effect given."""
        return self.effect.at(severity)

    def size(self, severity: float) -> float:
        """How strong the cause is, comparable between its shapes: distance from where it is none; its reciprocal from infinity."""
        value = float(getattr(self.at(severity), self.head))
        return (
            1.0 / abs(value) if self.weak_end == "infinity" else abs(value - 1.0 if self.weak_end == "one" else value)
        )

    def believable(self, severity: float) -> bool:
        """Whether its leading parameter does not pass the strong end of its range; weaker than any range is fine."""
        own = {f.name: f.metadata["range"] for f in parameter_fields(type(self.effect))}
        if self.head not in own:
            return True
        value, bounds = float(getattr(self.at(severity), self.head)), own[self.head]
        if self.weak_end == "infinity":
            return bool(value >= bounds.low)
        return bool(bounds.low <= value <= bounds.high) if self.weak_end == "one" else bool(abs(value) <= bounds.high)


def runs(candidates: Sequence[Candidate]) -> tuple[tuple[Run, ...], ...]:
    """
    The shapes of each cause that severity does not change: a resonance at each frequency, ends that give in each proportion.

    Grouped by effect, place, and what is discrete and named: a parameter, a channel.
    """
    causes: dict[tuple[str, ...], dict[tuple[Any, ...], Run]] = {}
    for candidate in candidates:
        for start in (s for s in candidate.starts if s.vanishes):
            effect = _told(start)
            key = (effect.effect, effect.place, *identifying_values(effect))
            causes.setdefault(key, {}).setdefault(_shape(effect), Run(" ".join(key), effect))
    return tuple(tuple(shapes.values()) for shapes in causes.values())


def _told(start: Effect) -> Effect:
    """A start that is an effect at all."""
    grows = start.grown_by
    none = 1.0 if grows.end == "one" else 0.0
    return start.changed({n: value for n, value in grows.reference.items() if getattr(start, n) == none})


def _shape(effect: Effect) -> tuple[Any, ...]:
    """What of an effect its severity does not change."""
    grows = effect.grown_by
    if grows.end == "whole":
        return (effect,)
    heads = np.array([float(getattr(effect, n)) for n in grows.carried_by])
    ratio = tuple(np.round(heads / heads[0], 2).tolist())
    return (ratio, *(getattr(effect, f.name) for f in fields(effect) if f.name not in grows.carried_by))
