"""Frequency responses of a model as its measurement chain would show them, and their derivatives to the model's values."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.model.paths import Path
from cutvib_ss.model.protocol import Model
from cutvib_ss.parameters import check_choice, names_of
from cutvib_ss.response.axes import as_laplace, as_positions
from cutvib_ss.response.derivatives import ResponseDerivatives
from cutvib_ss.response.receptance import ModelReceptance
from cutvib_ss.response.signals import displacement_unit, input_unit
from cutvib_ss.results import QUANTITY_OF_FORM, ComplexArray, Form, FrequencyResponse, Quantity
from cutvib_ss.units import DERIVATIVE_ORDER

_BLOCK = 24_000
"""Positions times frequencies that are computed at once: arrays of 0.4 MB."""
_STILL = 1e-6j
"""s in place of 0 on a shaker, whose absolute displacement is infinite there but not its acceleration [rad/s]."""


def frequency_response(
    machine: Model,
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
    See `cutvib_ss.response.receptance` for the derivation. Delays and hysteretic damping are exact.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> frf = frequency_response(published_machine(), [0.5], [217.0], outputs=["tool_x"])
    >>> frf.data.shape, frf.unit
    ((1, 1, 1, 1), 'm/s^2/N')
    """
    inputs, outputs = names_of(inputs), names_of(machine.channels if outputs is None else outputs)
    quantities = output_quantities(machine, outputs, form)
    places = as_positions(machine, positions)
    f, s = as_laplace(freq, decay_rate)
    data = np.empty((places.size, len(outputs), len(inputs), s.size), dtype=np.complex128)
    # By blocks of frequencies whose intermediate arrays stay in the processor's cache; nothing is computed twice.
    lines = max(1, _BLOCK // places.size)
    for k in range(0, s.size, lines):
        part = ChainedResponse(machine, places, s[k : k + lines], quantities, outputs, inputs)
        data[..., k : k + lines] = part.data()
    data.flags.writeable = False  # given away: the result need not copy it
    return FrequencyResponse(
        data, f, places, outputs, inputs, quantities, decay_rate=decay_rate,
        displacement_units=tuple(displacement_unit(machine, o) for o in outputs),
        input_units=tuple(input_unit(machine, i) for i in inputs),
    )  # fmt: skip


def output_quantities(machine: Model, outputs: Sequence[str], form: Form | None) -> tuple[Quantity, ...]:
    """Motion quantity of each output."""
    if form is not None:
        check_choice("form", form, tuple(QUANTITY_OF_FORM))
        return (QUANTITY_OF_FORM[form],) * len(outputs)
    return tuple(machine.channels[o].quantity if o in machine.channels else machine.default_quantity for o in outputs)


class ChainedResponse:
    """Responses through the measurement chain, and their derivatives."""

    def __init__(
        self,
        machine: Model,
        positions: np.ndarray,
        s: ComplexArray,
        quantities: Sequence[Quantity],
        outputs: Sequence[str],
        inputs: Sequence[str],
    ) -> None:
        self.machine, self.outputs, self.inputs = machine, tuple(outputs), tuple(inputs)
        if machine.influence is not None:
            s = np.where(s == 0.0, _STILL, s)
        self._lines = machine.chain.at(outputs, [DERIVATIVE_ORDER[q] for q in quantities], s)
        self.s, self._places = self._lines.s, positions.size
        self.receptance = ModelReceptance(machine, positions, self.s, (*self._lines.signals, *self.inputs))
        self._bare: dict[tuple[str, str], ComplexArray] = {}
        self._changes: dict[str, ResponseDerivatives] = {}

    def _receptance(self, output: str, input: str) -> ComplexArray:
        if (output, input) not in self._bare:
            self._bare[output, input] = self.receptance.between(output, input)
        return self._bare[output, input]

    def data(self) -> ComplexArray:
        """The responses, shape (position, output, input, frequency), in the wanted quantities."""
        signals = self._lines.signals
        out = np.empty((self._places, len(signals), len(self.inputs), self.s.size), dtype=np.complex128)
        for k, signal in enumerate(signals):
            for i, input in enumerate(self.inputs):
                np.multiply(self._lines.factors[k], self._receptance(signal, input), out=out[:, k, i])
        return self._lines.gathered(out, axis=1)

    def derivative(self, path: Path) -> ComplexArray:
        """Derivative of the responses to one of the model's values, shape (position, output, input, frequency)."""
        if path[0] != "chain":
            parts = [self._mechanical(path, input) for input in self.inputs]
        else:
            parts = [self._by_chain(path, input) for input in self.inputs]
        return parts[0][:, :, None] if len(parts) == 1 else np.stack(parts, axis=2)

    def derivatives(self, paths: Sequence[Path]) -> ComplexArray:
        """Derivatives to several values, shape (value, position, output, input, frequency)."""
        shape = (len(paths), self._places, len(self.outputs), len(self.inputs), self.s.size)
        out: ComplexArray = np.empty(shape, dtype=np.complex128)
        mechanical = [k for k, path in enumerate(paths) if path[0] != "chain"]
        for i, input in enumerate(self.inputs):
            if mechanical:
                changes = self._changes_of(input).derivatives([paths[k] for k in mechanical])
                out[mechanical, :, :, i] = self._lines.gathered(changes)
            for k, path in enumerate(paths):
                if path[0] == "chain":
                    out[k, :, :, i] = self._by_chain(path, input)
        return out

    def _changes_of(self, input: str) -> ResponseDerivatives:
        if input not in self._changes:
            self._changes[input] = ResponseDerivatives(self.receptance, self._lines.signals, input, self._lines.factors)
        return self._changes[input]

    def _mechanical(self, path: Path, input: str) -> ComplexArray:
        """Derivative of one input's responses to a value of the mechanics, shape (position, output, frequency)."""
        return self._lines.gathered(self._changes_of(input).derivative(path))

    def _by_chain(self, path: Path, input: str) -> ComplexArray:
        """Derivative of one input's responses to a value of the chain, shape (position, output, frequency)."""

        def motion(signal: str) -> ComplexArray:
            return np.broadcast_to(self._receptance(signal, input), (self._places, self.s.size))

        return self._lines.derivative(path, motion, lambda: self._mechanical(("s",), input))
