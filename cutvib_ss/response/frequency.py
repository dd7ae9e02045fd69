"""Frequency responses of a model as its measurement chain would show them, and their derivatives to the model's values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.errors import ParameterError
from cutvib_ss.machine import Machine
from cutvib_ss.paths import Path
from cutvib_ss.response.axes import as_laplace, as_positions
from cutvib_ss.response.condensed import CondensedModel
from cutvib_ss.response.derivatives import ResponseDerivatives
from cutvib_ss.response.signals import displacement_unit, input_unit, port_name
from cutvib_ss.results import (
    QUANTITY_OF_FORM,
    ComplexArray,
    Form,
    FrequencyResponse,
    Quantity,
    as_names,
    check_choice,
)
from cutvib_ss.structure import Structure
from cutvib_ss.units import DERIVATIVE_ORDER

_BLOCK = 24_000
"""Positions times frequencies that are computed at once: arrays of 0.4 MB."""


def frequency_response(
    machine: Machine | Structure,
    positions: ArrayLike | None,
    freq: ArrayLike,
    *,
    form: Form | None = None,
    inputs: str | Sequence[str] = ("force",),
    outputs: str | Sequence[str] | None = None,
    decay_rate: float = 0.0,
) -> FrequencyResponse:
    """
    Frequency responses in closed form, for all positions and frequencies at once.

    Parameters
    ----------
    machine : Machine or Structure
        The model.
    positions : array_like, shape (position,)
        y_b / L of the head, strictly inside (0, 1); None for a structure.
    freq : array_like, shape (frequency,)
        Frequencies [Hz].
    form : {"receptance", "mobility", "accelerance"}, optional
        Form of every output. By default accelerance for a cutting machine, each channel's own for a structure.
    inputs : str or sequence of str
        ``force`` (the cutting force, tool X) or any port: ``head_x``, ``base``, ``tool_z``, ``rail@0.25`` (a hammer on the rail).
    outputs : str or sequence of str, optional
        Channels and ports: ``tool_x``, ``tool_z``, ``base_x``, ``head_x``, ``joint2``, ``rail@0.25``, or modal coordinates
        ``eta1`` … (Fig. 18). By default the model's channels.
    decay_rate : float
        σ [1/s]: the response at s = σ + jω, what an FRF estimated under an exponential window shows.

    Returns
    -------
    FrequencyResponse
        ``data`` of shape (position, output, input, frequency).

    Raises
    ------
    ParameterError
        If a position, frequency, form or signal is impossible.

    Notes
    -----
    See `cutvib_ss.response.condensed` for the derivation. Delays and hysteretic damping are exact.

    Examples
    --------
    >>> from cutvib_ss.machine import published_machine
    >>> frf = frequency_response(published_machine(), [0.5], [217.0], outputs=["tool_x"])
    >>> frf.data.shape, frf.unit
    ((1, 1, 1, 1), 'm/s^2/N')
    """
    outputs = tuple(machine.channels) if outputs is None else as_names(outputs)
    inputs = as_names(inputs)
    quantities = output_quantities(machine, outputs, form)
    places = as_positions(machine, positions)
    f, s = as_laplace(freq, decay_rate)
    data = np.empty((places.size, len(outputs), len(inputs), s.size), dtype=np.complex128)
    ports_out, ports_in = tuple(map(port_name, outputs)), tuple(map(port_name, inputs))
    # By blocks of frequencies whose intermediate arrays stay in the processor's cache; nothing is computed twice.
    lines = max(1, _BLOCK // places.size)
    for k in range(0, s.size, lines):
        part = ChainedResponse(machine, places, s[k : k + lines], quantities, ports_out, ports_in)
        data[..., k : k + lines] = part.data()
    data.flags.writeable = False  # given away: the result need not copy it
    return FrequencyResponse(
        data, f, places, outputs, inputs, quantities, decay_rate=decay_rate,
        displacement_units=tuple(displacement_unit(machine, o) for o in outputs),
        input_units=tuple(input_unit(machine, i) for i in inputs),
    )  # fmt: skip


def output_quantities(machine: Machine | Structure, outputs: Sequence[str], form: Form | None) -> tuple[Quantity, ...]:
    """
    Motion quantity of each output.

    Parameters
    ----------
    machine : Machine or Structure
        The model.
    outputs : sequence of str
        Channels and ports.
    form : {"receptance", "mobility", "accelerance"} or None
        Form of every output; None: each channel's own, acceleration of other ports of a machine, displacement of a structure's.

    Returns
    -------
    tuple of str
        The quantities.

    Raises
    ------
    ParameterError
        If the form is unknown.
    """
    if form is not None:
        check_choice("form", form, tuple(QUANTITY_OF_FORM))
        return (QUANTITY_OF_FORM[form],) * len(outputs)
    other: Quantity = "acceleration" if isinstance(machine, Machine) else "displacement"
    return tuple(machine.channels[o].quantity if o in machine.channels else other for o in outputs)


class ChainedResponse:
    """
    Responses through the measurement chain, and their derivatives.

    Parameters
    ----------
    machine : Machine or Structure
        The model.
    positions : ndarray, shape (position,)
        y_b / L.
    s : ndarray of complex, shape (frequency,)
        Laplace variable of the measurement [rad/s].
    quantities : sequence of str
        Motion quantity of each output.
    outputs, inputs : sequence of str
        Signals.

    Notes
    -----
    H = g e^(-sτ) s^k (H_own + cross · H_tool_x), at s shifted by the rate of a window that was never taken out.
    """

    def __init__(
        self,
        machine: Machine | Structure,
        positions: np.ndarray,
        s: ComplexArray,
        quantities: Sequence[Quantity],
        outputs: Sequence[str],
        inputs: Sequence[str],
    ) -> None:
        self.machine, self.outputs, self.inputs = machine, tuple(outputs), tuple(inputs)
        self.chain = machine.chain
        self.s = s + self.chain.decay_rate
        self.model = CondensedModel(machine, positions, self.s)
        self.orders = [DERIVATIVE_ORDER[q] for q in quantities]
        self._shape = (positions.size, len(self.outputs), len(self.inputs), s.size)
        self._bare: dict[tuple[str, str], ComplexArray] = {}
        self._changes: dict[str, ResponseDerivatives] = {}
        self._factors = [self._factor(k) for k in range(len(self.outputs))]

    def _receptance(self, output: str, input: str) -> ComplexArray:
        if (output, input) not in self._bare:
            self._bare[output, input] = self.model.receptance(output, input)
        return self._bare[output, input]

    def _leaks(self, output: str) -> bool:
        return output == "tool_z" and self.chain.cross_axis != 0.0

    def _factor(self, k: int) -> ComplexArray:
        channel = self.chain.channel(self.outputs[k])
        factor: ComplexArray = channel.gain * self.s ** self.orders[k]
        return factor * np.exp(-self.s * channel.delay) if channel.delay else factor

    def data(self) -> ComplexArray:
        """
        The responses.

        Returns
        -------
        ndarray, shape (position, output, input, frequency)
            In the wanted quantities.
        """
        out = np.empty(self._shape, dtype=np.complex128)
        for k, output in enumerate(self.outputs):
            for i, input in enumerate(self.inputs):
                value = self._receptance(output, input)
                if self._leaks(output):
                    value = value + self.chain.cross_axis * self._receptance("tool_x", input)
                np.multiply(self._factors[k], value, out=out[:, k, i])
        return out

    def derivative(self, path: Path) -> ComplexArray:
        """
        Derivative of the responses to one of the model's values.

        Parameters
        ----------
        path : tuple of str and int
            The value's path, as `slots.value_at` takes it.

        Returns
        -------
        ndarray, shape (position, output, input, frequency)
            The derivative.

        Raises
        ------
        ParameterError
            If the response has no derivative to that value.
        """
        if path[0] != "chain":
            parts = [self._mechanical(path, input) for input in self.inputs]
            return parts[0][:, :, None] if len(parts) == 1 else np.stack(parts, axis=2)
        out = np.zeros(self._shape, dtype=np.complex128)
        for k, output in enumerate(self.outputs):
            for i, input in enumerate(self.inputs):
                out[:, k, i] = self._by_chain(path, k, output, input)
        return out

    def _mechanical(self, path: Path, input: str) -> ComplexArray:
        """Derivative of one input's responses to a value of the mechanics, shape (position, output, frequency)."""
        # What leaks into an output is one more output, with that one's factor.
        leaks = [k for k, output in enumerate(self.outputs) if self._leaks(output)]
        if input not in self._changes:
            factors = self._factors + [self.chain.cross_axis * self._factors[k] for k in leaks]
            signals = self.outputs + ("tool_x",) * len(leaks)
            self._changes[input] = ResponseDerivatives(self.model, signals, input, factors)
        change, count = self._changes[input].derivative(path), len(self.outputs)
        for extra, k in enumerate(leaks, start=count):
            change[:, k] += change[:, extra]
        return change[:, :count]

    def _by_chain(self, path: Path, k: int, output: str, input: str) -> ComplexArray | float:
        """Derivative of one response to a value of the chain, shape (position, frequency)."""
        if path == ("chain", "cross_axis"):
            return self._factors[k] * self._receptance("tool_x", input) if output == "tool_z" else 0.0
        value = self._receptance(output, input)
        if self._leaks(output):
            value = value + self.chain.cross_axis * self._receptance("tool_x", input)
        value = self._factors[k] * value
        channel = self.chain.channel(output)
        if path == ("chain", "decay_rate"):
            order: ComplexArray = self.orders[k] / self.s if self.orders[k] else 0 * self.s
            return self._mechanical(("s",), input)[:, k] + (order - channel.delay) * value
        if path[:2] == ("chain", "channels"):
            if path[2] != output:
                return 0.0
            return -self.s * value if path[3] == "delay" else value / channel.gain
        raise ParameterError(f"the response has no derivative to {'.'.join(map(str, path))}")
