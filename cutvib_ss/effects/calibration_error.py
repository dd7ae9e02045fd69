"""The sensitivity of a channel is wrong by more than its tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from cutvib_ss.effects.base import Carried, Effect, Model, applied, check_place, parameter
from cutvib_ss.errors import ParameterError


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

    channel: str
    gain: float = parameter("1", 0.2, 5.0)

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
            names = ", ".join(model.channels)
            raise ParameterError(f"calibration_error: no channel {self.channel!r}; there are all, {names}")
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
            chain = chain.with_channel(name, replace(old, gain=old.gain * self.gain))
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
        chain = applied.chain
        return {
            "gain": tuple(
                (("chain", "channels", name, "gain"), chain.channel(name).gain / self.gain)
                for name in self._channels(applied)
            )
        }
