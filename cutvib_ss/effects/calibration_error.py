"""The sensitivity of a channel is wrong by more than its tolerance, or its instrument turns the phase."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Measured, Model, Severity, channel_choices, channels_of, parameter
from cutvib_ss.effects.chain_effect import ChainEffect
from cutvib_ss.model.measurement_chain import MeasurementChain


@dataclass(frozen=True)
class CalibrationError(ChainEffect):
    """A complex factor on one channel, or on all (a wrong sensitivity of the hammer): gain · e^(i phase)."""

    effect: ClassVar[str] = "calibration_error"
    severity = Severity("one", ("gain",), {"gain": 1.05})
    sentence = "the sensitivity of {what} is wrong"
    inspection = "calibrate {what} with its whole chain: sensor, cable, amplifier, the sensitivity that was typed in"

    channel: str  # Name of the channel, or ``"all"``
    gain: float = parameter("1", 0.2, 5.0, "ratio")  # Shown over true value
    # Constant phase of the channel's instrument [rad]; positive where it leads
    phase: float = parameter("rad", -1.0, 1.0, "linear", minimum=None, default=0.0)

    @classmethod
    def starts(cls, model: Model, measured: Measured) -> Iterator[tuple[str, tuple[Effect, ...]]]:
        for channel in channel_choices(measured.channels):
            yield channel, (cls("measurement", channel, 1.0),)

    @classmethod
    def examples(cls, model: Model, place: str) -> Iterator[tuple[str, Callable[[float], Effect]]]:
        for channel in ("all", *model.channels):
            yield channel, cls(place, channel, 1.2).at
            yield f"{channel}, turned", lambda severity, c=channel: cls(place, c, 1.0 + 0.2 * severity, 0.3 * severity)  # type: ignore[misc]

    def changed_chain(self, model: Model) -> MeasurementChain:
        chain = model.chain
        for name in channels_of(self.effect, self.channel, model):
            old = chain.channel(name)
            chain = chain.with_channel(name, replace(old, gain=old.gain * self.gain, phase=old.phase + self.phase))
        return chain

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        names = channels_of(self.effect, self.channel, applied)
        at = [("chain", "channels", name) for name in names]
        gains = [applied.chain.channel(name).gain / self.gain for name in names]
        return {
            "gain": tuple(((*a, "gain"), gain) for a, gain in zip(at, gains, strict=True)),
            "phase": tuple(((*a, "phase"), 1.0) for a in at),
        }
