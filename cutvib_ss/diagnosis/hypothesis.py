"""What may cause the gap: effects on top of a tuned model, and what moves in the model when one of its values moves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from cutvib_ss.effects.base import Carried, Effect, Model


@dataclass(frozen=True)
class Hypothesis:
    """What may cause the gap."""

    effects: tuple[Effect, ...] = ()  # Effects at their starting values; none for the tuned nominal model
    # Peak displacement of places in the records, where it is known: the scale of nonlinear restoring forces
    motions: Mapping[str, float] = field(default_factory=dict)

    @property
    def causes(self) -> tuple[tuple[str, str], ...]:
        """Effect and place of each; two channels or two values of one place are one cause."""
        return tuple(dict.fromkeys((e.effect, e.place) for e in self.effects))

    @property
    def effect(self) -> str:
        """Ids, joined by ``+``."""
        return "+".join(effect for effect, _ in self.causes) or "none"

    @property
    def place(self) -> str:
        """Places, joined by ``+``."""
        return "+".join(place for _, place in self.causes) or "none"

    @property
    def places(self) -> str:
        """The same, each once: two causes at one place are at that place."""
        return "+".join(dict.fromkeys(place for _, place in self.causes)) or "none"

    @property
    def touches(self) -> bool:
        """Whether something touches at instants between samples."""
        return any(e.touches for e in self.effects)

    @property
    def at_one_port(self) -> bool:
        """Whether it has restoring forces, at one port and no other."""
        return len({e.place for e in self.effects if not e.linear}) == 1

    @property
    def linear(self) -> bool:
        """Whether the frequency response alone carries it."""
        return all(e.linear for e in self.effects)


def stages_of(tuned: Model, effects: Sequence[Effect]) -> list[Model]:
    """A model before each of some effects, and with all of them."""
    stages = [tuned]
    for e in effects:
        stages.append(e.apply(stages[-1]))
    return stages


def carried_on(carried: Carried, effects: Sequence[Effect], stages: Sequence[Model], first: int) -> Carried:
    """What moves in the last stage when values of an earlier one move."""
    for e, stage in zip(effects[first:], stages[first + 1 :], strict=True):
        carried = tuple((p, w * v) for path, w in carried for p, v in e.carries(path, stage))
    return carried
