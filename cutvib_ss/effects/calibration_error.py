"""The sensitivity of a channel is wrong by more than its tolerance."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import (
    Carried,
    Effect,
    Measured,
    Model,
    Severity,
    applied,
    channel_choices,
    channels_of,
    check_place,
    parameter,
)


@dataclass(frozen=True)
class CalibrationError(Effect):
    """
    A factor on one channel, or on all (a wrong sensitivity of the hammer).

    Parameters
    ----------
    place : str
        ``"measurement"``.
    channel : str
        Name of the channel, or ``"all"``.
    gain : float
        Shown over true value.
    """

    effect: ClassVar[str] = "calibration_error"
    measurement = True
    severity = Severity("one", ("gain",), {"gain": 1.05})
    sentence = "the sensitivity of {what} is wrong"
    inspection = "calibrate {what} with its whole chain: sensor, cable, amplifier, the sensitivity that was typed in"

    channel: str
    gain: float = parameter("1", 0.2, 5.0)

    @classmethod
    def places(cls, model: Model) -> tuple[str, ...]:
        return ("measurement",)

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for channel in channel_choices(measured.channels):
            yield channel, (cls("measurement", channel, 1.0),)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        return ((channel, cls(place, channel, 1.2).at) for channel in ("all", *model.channels))

    def apply(self, model: Any) -> Any:
        check_place(self, model)
        chain = model.chain
        for name in channels_of(self.effect, self.channel, model):
            old = chain.channel(name)
            chain = chain.with_channel(name, replace(old, gain=old.gain * self.gain))
        return applied(model, replace(model, chain=chain), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        chain = applied.chain
        return {
            "gain": tuple(
                (("chain", "channels", name, "gain"), chain.channel(name).gain / self.gain)
                for name in channels_of(self.effect, self.channel, applied)
            )
        }
