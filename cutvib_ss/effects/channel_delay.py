"""Response channels are late against the force."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, channel_choices, channels_of, parameter
from cutvib_ss.effects.chain_effect import ChainEffect
from cutvib_ss.model.measurement_chain import MeasurementChain


@dataclass(frozen=True)
class ChannelDelay(ChainEffect):
    """A delay of one response channel, or of all."""

    effect: ClassVar[str] = "channel_delay"
    severity = Severity("zero", ("delay",), {"delay": 1e-4})
    sentence = "{what} is late against the force"
    inspection = "compare the filters, sampling and cables of {what} with those of the force"

    channel: str  # Name of the channel, or ``"all"``
    delay: float = parameter("s", -1e-2, 1e-2, "asinh", minimum=None)  # How late it is [s]; negative: early

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for channel in channel_choices(measured.channels):
            yield channel, (cls("measurement", channel, 0.0),)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        return ((channel, cls(place, channel, 1e-4).at) for channel in ("all", *model.channels))

    def changed_chain(self, model: Model) -> MeasurementChain:
        chain = model.chain
        for name in channels_of(self.effect, self.channel, model):
            old = chain.channel(name)
            chain = chain.with_channel(name, replace(old, delay=old.delay + self.delay))
        return chain

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {
            "delay": tuple(
                (("chain", "channels", name, "delay"), 1.0) for name in channels_of(self.effect, self.channel, applied)
            )
        }
