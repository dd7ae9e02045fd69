"""
The measurement chain: gain, phase, delay, cross axis and window, applied and differentiated here alone.

With x the motion of the ports that the channels read, a channel shows

    y_k = g_k e^(iφ_k) e^(-sτ_k) (1 + e_k(s)) s^n_k (x_k + ε_k x_X),

e_k being an error of unknown form of its instrument, n_k the order of its quantity and ε_k the cross axis of ``tool_z``, zero of
the others. An accelerometer's charge is S (a_z + ε a_x), ε its transverse sensitivity: what leaks is the physical motion of the
tool in X, whether or not channel ``tool_x`` is measured, and whatever that channel's own gain and delay are; it passes gain, phase
and delay of ``tool_z``. An exponential window e^(-σt) on force and response that was never taken out shows all of this at s + σ. A
constant phase belongs to positive frequencies; at negative ones it has the other sign.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import SmoothElement
from cutvib_ss.parameters import check_number, control_name
from cutvib_ss.results import ComplexArray, FloatArray

if TYPE_CHECKING:
    import control

CROSS_AXIS = ("tool_z", "tool_x")
"""The channel into which the tool's motion leaks, and the motion that leaks into it."""


@dataclass(frozen=True)
class ChannelChain:
    """
    What a measurement chain does to one response channel: gain · e^(i phase) · e^(-s delay) · (1 + error).

    Parameters
    ----------
    gain : float
        Factor on the sensitivity.
    delay : float
        How late the channel is against the force [s].
    phase : float
        Constant phase of its instrument [rad].
    error : SmoothElement, optional
        An error of unknown form, whose dynamic stiffness stands for a dimensionless function of frequency.
    """

    gain: float = 1.0
    delay: float = 0.0
    phase: float = 0.0
    error: SmoothElement | None = None

    def __post_init__(self) -> None:
        for name in ("gain", "delay", "phase"):
            check_number(name, getattr(self, name))


@dataclass(frozen=True)
class MeasurementChain:
    """
    The measurement chain; ideal by default.

    Parameters
    ----------
    channels : mapping of str to ChannelChain
        Chains of the response channels; those left out are ideal.
    cross_axis : float
        Fraction of the tool's motion in X that leaks into ``tool_z``.
    decay_rate : float
        Rate of an exponential window on force and response whose damping was never taken out [1/s].
    """

    channels: Mapping[str, ChannelChain] = field(default_factory=dict)
    cross_axis: float = 0.0
    decay_rate: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "channels", MappingProxyType(dict(self.channels)))
        check_number("cross_axis", self.cross_axis)
        check_number("decay_rate", self.decay_rate, 0.0)

    def channel(self, name: str) -> ChannelChain:
        """The chain of one channel; ideal where nothing is known."""
        return self.channels.get(name, ChannelChain())

    def with_channel(self, name: str, chain: ChannelChain) -> MeasurementChain:
        """The measurement chain with one channel's replaced."""
        return replace(self, channels={**self.channels, name: chain})

    def leaks(self, output: str) -> bool:
        """Whether another motion leaks into an output."""
        return self.cross_axis != 0.0 and output == CROSS_AXIS[0]

    def signals(self, outputs: Sequence[str]) -> tuple[str, ...]:
        """The motions behind some outputs: their own, then one for each output into which another leaks."""
        return (*outputs, *(CROSS_AXIS[1] for output in outputs if self.leaks(output)))

    def shift(self, s: ArrayLike) -> ComplexArray:
        """The Laplace variable at which the mechanics is seen [rad/s]."""
        return np.asarray(s, dtype=np.complex128) + self.decay_rate

    def window(self, lag: FloatArray) -> FloatArray:
        """What the window leaves of force and response at a time after the blow [s]."""
        left: FloatArray = np.exp(-self.decay_rate * lag)
        return left

    def at(self, outputs: Sequence[str], orders: Sequence[int], s: ArrayLike) -> ChainAtLines:
        """The chain at given values of the measurement's Laplace variable; orders are those of differentiation."""
        return ChainAtLines(self, tuple(outputs), tuple(orders), self.shift(s))

    def plant(
        self, build: Callable[[Sequence[str]], control.StateSpace], outputs: Sequence[str], pade_order: int | None
    ) -> control.StateSpace:
        """
        A plant as the chain shows it; ``build`` makes one with given displacement outputs.

        Delays are approximated to order ``pade_order``; without one they are refused, as a constant phase and a window are always.
        """
        names = list(outputs)
        chains = [self.channel(name) for name in names]
        if self.decay_rate:
            raise CouplingError("an exponential window in the chain shifts every pole; it is no property of a plant")
        if any(c.error is not None for c in chains):
            raise CouplingError("an error of unknown form in the chain has no finite plant; leave it out")
        if any(c.phase for c in chains):
            raise CouplingError("a constant phase has no finite plant; leave it out, or give the channel a delay")
        signals = self.signals(names)
        unique = tuple(dict.fromkeys(signals))
        out = build(unique)
        late = [c.delay for c in chains]
        if (
            unique == tuple(names)
            and not any(late)
            and all(c.gain == 1.0 for c in chains)
            and len(signals) == len(names)
        ):
            return out
        mix = np.zeros((len(names), len(unique)))
        for (k, signal), weight in zip(self._terms(names), self._weights(names), strict=True):
            mix[k, unique.index(signal)] += weight * chains[k].gain
        inputs, states = out.input_labels, out.state_labels
        import control  # late: it takes long to load

        out = control.ss(out.A, out.B, mix @ out.C, mix @ out.D)
        if any(late):
            if pade_order is None:
                raise CouplingError("a delayed channel has no finite plant; ask for an approximation with pade_order")
            delays = [
                control.ss(control.tf(*control.pade(t, pade_order))) if t else control.ss([], [], [], [[1.0]])
                for t in late
            ]
            out = control.append(*delays) * out
            states = [*states, *(f"delay{i}" for i in range(out.nstates - len(states)))]
        return control.ss(out.A, out.B, out.C, out.D, inputs=inputs, outputs=[*map(control_name, names)], states=states)

    def _terms(self, outputs: Sequence[str]) -> list[tuple[int, str]]:
        """Output and motion of each of `signals`."""
        of = [*range(len(outputs)), *(k for k, output in enumerate(outputs) if self.leaks(output))]
        return list(zip(of, self.signals(outputs), strict=True))

    def _weights(self, outputs: Sequence[str]) -> list[float]:
        """Weight of each of `signals` in its output."""
        return [1.0] * len(outputs) + [self.cross_axis] * (len(self.signals(outputs)) - len(outputs))


class ChainAtLines:
    """
    The chain of some outputs at given s: factors of the motions behind them, and their derivatives.

    ``signals`` are those motions, and ``factors`` what each is multiplied by, shape (signal, frequency), before `gathered` adds
    what leaks to its output.
    """

    def __init__(
        self, chain: MeasurementChain, outputs: tuple[str, ...], orders: tuple[int, ...], s: ComplexArray
    ) -> None:
        self.chain, self.outputs, self.orders, self.s = chain, outputs, orders, s
        self.signals = chain.signals(outputs)
        self._leaks = [k for k, _ in chain._terms(outputs)[len(outputs) :]]
        own = [self._factor(k) for k in range(len(outputs))]
        self.factors: ComplexArray = np.array(own + [chain.cross_axis * own[k] for k in self._leaks])

    def _factor(self, k: int) -> ComplexArray:
        channel = self.chain.channel(self.outputs[k])
        turned = channel.gain * np.exp(1j * channel.phase) if channel.phase else channel.gain
        factor: ComplexArray = turned * self.s ** self.orders[k]
        if channel.error is not None:
            factor = factor * (1.0 + channel.error.dynamic_stiffness(self.s))
        return factor * np.exp(-self.s * channel.delay) if channel.delay else factor

    def gathered(self, shown: ComplexArray, axis: int = -2) -> ComplexArray:
        """Outputs from the signals' motions times their factors, which are given away."""
        if not self._leaks:
            return shown
        parts = np.moveaxis(shown, axis, 0)
        for extra, k in enumerate(self._leaks, start=len(self.outputs)):
            parts[k] += parts[extra]
        return np.moveaxis(parts[: len(self.outputs)], 0, axis)

    def shown(self, motions: ComplexArray) -> ComplexArray:
        """What the outputs show of the signals' displacements, shape (…, signal, frequency)."""
        return self.gathered(motions * self.factors)

    def derivative(
        self, path: tuple[str | int, ...], motion: Callable[[str], ComplexArray], by_s: Callable[[], ComplexArray]
    ) -> ComplexArray:
        """
        Derivative of the outputs to a value of the chain, shape (…, output, frequency).

        ``motion`` gives a signal's displacement, shape (…, frequency); ``by_s`` the outputs' derivative to s, factors held.
        """
        if path == ("chain", "cross_axis"):
            changes = [
                self._factor(k) * motion(CROSS_AXIS[1]) if output == CROSS_AXIS[0] else 0 * motion(output)
                for k, output in enumerate(self.outputs)
            ]
            return np.asarray(np.stack(changes, axis=-2))
        shown = self.shown(np.stack([motion(name) for name in self.signals], axis=-2))
        channels = [self.chain.channel(output) for output in self.outputs]
        if path == ("chain", "decay_rate"):
            slopes = [
                n / self.s - c.delay if n else 0 * self.s - c.delay for n, c in zip(self.orders, channels, strict=True)
            ]
            for k, c in enumerate(channels):
                if c.error is not None:
                    slopes[k] = slopes[k] + c.error.derivative("s", self.s) / (1.0 + c.error.dynamic_stiffness(self.s))
            return by_s() + np.array(slopes) * shown
        if path[:2] != ("chain", "channels") or path[3] not in ("gain", "delay", "phase", "error"):
            raise ParameterError(f"the response has no derivative to {'.'.join(map(str, path))}")
        own = np.array([output == path[2] for output in self.outputs])[:, None]
        if path[3] == "gain":
            return np.asarray(own * shown / np.array([c.gain for c in channels])[:, None])
        if path[3] == "error":
            error = self.chain.channel(str(path[2])).error
            assert error is not None
            return np.asarray(
                own * shown * (error.derivative(str(path[-1]), self.s) / (1.0 + error.dynamic_stiffness(self.s)))
            )
        return np.asarray(own * shown * (-self.s if path[3] == "delay" else 1j))
