"""Response channels are late against the force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, parameter
from cutvib_ss.errors import ParameterError


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
        """
        Places on a model.

        Parameters
        ----------
        model : Machine or Structure
            The model.

        Returns
        -------
        tuple of str
            The places.
        """
        return ("measurement",)

    def _channels(self, model: Model) -> tuple[str, ...]:
        if self.channel == "all":
            return tuple(model.channels)
        if self.channel not in model.channels:
            raise ParameterError(
                f"channel_delay: no channel {self.channel!r}; there are all, {', '.join(model.channels)}"
            )
        return (self.channel,)

    def apply(self, model: Any) -> Any:
        """
        The model with the effect.

        Parameters
        ----------
        model : Machine or Structure
            The model without it.

        Returns
        -------
        Machine or Structure
            A new model.
        """
        check_place(self, model)
        chain = model.chain
        for name in self._channels(model):
            old = chain.channel(name)
            chain = chain.with_channel(name, replace(old, delay=old.delay + self.delay))
        return applied(model, replace(model, chain=chain), self)

    def moves(self, applied: Any) -> Mapping[str, Carried]:
        """
        Values of the applied model that move with each parameter.

        Parameters
        ----------
        applied : Machine or Structure
            The model with the effect.

        Returns
        -------
        mapping of str to tuple of (path, weight)
            The paths and weights.
        """
        return {"delay": tuple((("chain", "channels", name, "delay"), 1.0) for name in self._channels(applied))}
