"""Effects of the measurement chain."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Effect, Model, applied, check_place
from cutvib_ss.model.measurement_chain import MeasurementChain


class ChainEffect(Effect):
    """An effect at the one place ``"measurement"``, which changes the chain and nothing else."""

    measurement: ClassVar[bool] = True

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("measurement",)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        return applied(model, replace(model, chain=self.changed_chain(model)), self)

    @abstractmethod
    def changed_chain(self, model: Model) -> MeasurementChain:
        """The model's chain with the effect."""
