"""Response channels are late against the force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, channels_of, check_place, parameter


@dataclass(frozen=True)
class ChannelDelay(Effect):
    """
    A delay of one response channel, or of all.

    Parameters
    ----------
    place : str
        ``"measurement"``.
    channel : str
        Name of the channel, or ``"all"``.
    delay : float
        How late it is [s]; negative: early.
    """

    effect: ClassVar[str] = "channel_delay"

    channel: str
    delay: float = parameter("s", -2e-3, 2e-3, "linear", minimum=None)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("measurement",)

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        chain = model.chain
        for name in channels_of(self.effect, self.channel, model):
            old = chain.channel(name)
            chain = chain.with_channel(name, replace(old, delay=old.delay + self.delay))
        return applied(model, replace(model, chain=chain), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        return {
            "delay": tuple(
                (("chain", "channels", name, "delay"), 1.0) for name in channels_of(self.effect, self.channel, applied)
            )
        }
