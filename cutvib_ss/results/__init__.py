"""Every result type: frozen, labelled, with unit, arrays read-only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import AbsorberParameters
from cutvib_ss.results.arrays import ComplexArray, FloatArray, Form, Quantity, label_indices, read_only
from cutvib_ss.results.moving import Energies, MovingResponse
from cutvib_ss.results.time import TimeResponse
from cutvib_ss.units import DERIVATIVE_ORDER, SI_UNIT

__all__ = [
    "QUANTITY_OF_FORM",
    "AbsorberCheck",
    "ComplexArray",
    "Energies",
    "FloatArray",
    "Form",
    "FrequencyResponse",
    "MeasuredFrequencyResponse",
    "Modes",
    "MovingResponse",
    "Quantity",
    "TimeResponse",
    "TrackedModes",
    "read_only",
]

QUANTITY_OF_FORM: dict[Form, Quantity] = {
    "receptance": "displacement",
    "mobility": "velocity",
    "accelerance": "acceleration",
}
"""The motion quantity that each form of frequency response gives for a unit force."""


@dataclass(frozen=True)
class FrequencyResponse:
    """
    Frequency responses over positions, outputs, inputs and frequencies; computed and measured ones alike.

    Parameters
    ----------
    data : array_like of complex, shape (position, output, input, frequency)
        Response of each output per unit of each input, in ``unit``.
    freq : array_like, shape (frequency,)
        Frequency [Hz], ascending.
    positions : array_like, shape (position,)
        Position y_b / L of the head on the rail; NaN where the model has no position.
    outputs, inputs : sequence of str
        Names of the outputs and inputs.
    quantities : sequence of str
        Motion quantity of each output: ``"displacement"``, ``"velocity"`` or ``"acceleration"``.
    input_unit : str
        SI unit of the inputs: ``"N"``, or ``"m/s^2"`` for base excitation.
    decay_rate : float
        σ [1/s]: the response is that at s = σ + jω (0: the ordinary frequency response).
    """

    data: ComplexArray
    freq: FloatArray
    positions: FloatArray
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    input_unit: str = "N"
    decay_rate: float = 0.0

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "data", read_only(self.data, np.complex128))
        set_(self, "freq", read_only(self.freq, np.float64))
        set_(self, "positions", read_only(np.atleast_1d(np.asarray(self.positions, dtype=float))))
        set_(self, "outputs", tuple(self.outputs))
        set_(self, "inputs", tuple(self.inputs))
        set_(self, "quantities", tuple(self.quantities))
        shape = (self.positions.size, len(self.outputs), len(self.inputs), self.freq.size)
        if self.data.shape != shape:
            raise ParameterError(
                f"frequency response data have shape {self.data.shape}, but (position, output, input, frequency) "
                f"= {shape} is labelled"
            )
        if len(self.quantities) != len(self.outputs):
            raise ParameterError(f"{len(self.outputs)} outputs need as many quantities, not {len(self.quantities)}")

    @property
    def omega(self) -> FloatArray:
        """Angular frequency [rad/s], shape (frequency,)."""
        return 2 * np.pi * self.freq

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each output's response, for instance ``"m/s^2/N"``."""
        return tuple(f"{SI_UNIT[q]}/{self.input_unit}" for q in self.quantities)

    @property
    def unit(self) -> str:
        """The unit, where all outputs share one; else the units of the outputs, joined by commas."""
        units = self.units
        return units[0] if len(set(units)) == 1 else ", ".join(units)

    def sel(
        self,
        position: float | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> Self:
        """
        Part of the response by label; no axis is dropped.

        Parameters
        ----------
        position : float, optional
            Position y_b / L that was computed or measured (to 1e-9).
        output, input : str or sequence of str, optional
            Names to keep, in this order.

        Returns
        -------
        FrequencyResponse
            The part, with all four axes.

        Raises
        ------
        ParameterError
            If a label is not there; the message lists those that are.
        """
        rows = np.arange(self.positions.size)
        if position is not None:
            rows = np.flatnonzero(np.abs(self.positions - position) < 1e-9)
            if rows.size == 0:
                raise ParameterError(f"no position {position}; there are {self.positions.tolist()}")
        outs = label_indices(self.outputs, output, "output")
        ins = label_indices(self.inputs, input, "input")
        return self._take(rows, outs, ins)

    def _take(self, rows: NDArray[np.intp], outs: list[int], ins: list[int]) -> Self:
        return replace(
            self,
            data=self.data[np.ix_(rows, np.array(outs), np.array(ins), np.arange(self.freq.size))],
            positions=self.positions[rows],
            outputs=tuple(self.outputs[i] for i in outs),
            inputs=tuple(self.inputs[i] for i in ins),
            quantities=tuple(self.quantities[i] for i in outs),
        )

    def to_form(self, form: Form) -> Self:
        """
        The same response as receptance, mobility or accelerance: each differentiation multiplies by s = σ + jω.

        Parameters
        ----------
        form : {"receptance", "mobility", "accelerance"}
            Wanted form, of every output.

        Returns
        -------
        FrequencyResponse
            The converted response; lines at s = 0 are NaN where they would be divided by zero.
        """
        if form not in QUANTITY_OF_FORM:
            raise ParameterError(f"form {form!r} is not one of {', '.join(QUANTITY_OF_FORM)}")
        quantity = QUANTITY_OF_FORM[form]
        factor = self._derivative_factor(quantity)
        with np.errstate(invalid="ignore"):
            data = self.data * factor
        return replace(self, data=data, quantities=(quantity,) * len(self.outputs))

    def _derivative_factor(self, quantity: Quantity) -> ComplexArray:
        s = self.decay_rate + 1j * self.omega
        order = np.array([DERIVATIVE_ORDER[quantity] - DERIVATIVE_ORDER[q] for q in self.quantities])
        factor = np.full((order.size, 1, s.size), np.nan, dtype=np.complex128)
        for row, n in zip(factor, order, strict=True):
            usable = (s != 0) | (n >= 0)
            row[0, usable] = s[usable] ** n
        return factor


@dataclass(frozen=True)
class MeasuredFrequencyResponse(FrequencyResponse):
    """
    An estimated frequency response: the computed type plus what is known of its noise.

    Parameters
    ----------
    variance : array_like, shape (position, output, input, frequency)
        Variance E|ΔH|² of the complex estimate, in ``unit`` squared (each real part carries half).
    coherence : array_like, shape (position, output, input, frequency)
        Ordinary coherence γ² between input and output, 0 to 1; NaN where unknown.
    averages : int
        Number of blows or blocks behind each estimate.
    """

    variance: FloatArray = None  # type: ignore[assignment]
    coherence: FloatArray = None  # type: ignore[assignment]
    averages: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("variance", "coherence"):
            given = getattr(self, name)
            values = np.full(self.data.shape, np.nan) if given is None else given
            object.__setattr__(self, name, read_only(values, np.float64))
            if getattr(self, name).shape != self.data.shape:
                raise ParameterError(f"{name} has shape {getattr(self, name).shape}, the data {self.data.shape}")

    def _take(self, rows: NDArray[np.intp], outs: list[int], ins: list[int]) -> Self:
        index = np.ix_(rows, np.array(outs), np.array(ins), np.arange(self.freq.size))
        return replace(
            self,
            data=self.data[index],
            positions=self.positions[rows],
            outputs=tuple(self.outputs[i] for i in outs),
            inputs=tuple(self.inputs[i] for i in ins),
            quantities=tuple(self.quantities[i] for i in outs),
            variance=self.variance[index],
            coherence=self.coherence[index],
        )

    def to_form(self, form: Form) -> Self:
        """
        The same estimate as receptance, mobility or accelerance, its variance scaled alike.

        Parameters
        ----------
        form : {"receptance", "mobility", "accelerance"}
            Wanted form, of every output.

        Returns
        -------
        MeasuredFrequencyResponse
            The converted estimate.
        """
        factor = self._derivative_factor(QUANTITY_OF_FORM[form])
        return replace(super().to_form(form), variance=self.variance * np.abs(factor) ** 2)


@dataclass(frozen=True)
class Modes:
    """
    Natural modes of a model at one position.

    Parameters
    ----------
    natural_freq : array_like, shape (mode,)
        Undamped natural frequencies [Hz], ascending.
    damping_ratio : array_like, shape (mode,)
        Damping ratio -Re(p)/|p| of the damped pole that continues each undamped mode.
    poles : array_like of complex, shape (mode,)
        Poles [rad/s] of the upper half plane, in the order of the modes.
    mode_shapes : array_like, shape (dof, mode)
        Undamped mode shapes, mass-normalised (φᵀ M φ = 1).
    dofs : sequence of str
        Names of the degrees of freedom.
    position : float
        Position y_b / L; NaN where the model has none.
    """

    natural_freq: FloatArray
    damping_ratio: FloatArray
    poles: ComplexArray
    mode_shapes: FloatArray
    dofs: tuple[str, ...]
    position: float = float("nan")

    def __post_init__(self) -> None:
        for name in ("natural_freq", "damping_ratio", "mode_shapes"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))
        object.__setattr__(self, "poles", read_only(self.poles, np.complex128))
        object.__setattr__(self, "dofs", tuple(self.dofs))


@dataclass(frozen=True)
class TrackedModes:
    """
    Natural modes followed over positions: column k is one and the same mode throughout.

    Parameters
    ----------
    positions : array_like, shape (position,)
        Positions y_b / L.
    natural_freq : array_like, shape (position, mode)
        Undamped natural frequencies [Hz]; ascending at the first position, and on as long as no two modes cross.
    damping_ratio : array_like, shape (position, mode)
        Damping ratios.
    poles : array_like of complex, shape (position, mode)
        Poles [rad/s] of the upper half plane.
    mode_shapes : array_like, shape (position, dof, mode)
        Mass-normalised mode shapes, their signs carried along.
    mac : array_like, shape (position, mode)
        Modal assurance criterion with the step before, the lowest on the way from the position before; 1 at the first.
    dofs : sequence of str
        Names of the degrees of freedom.
    """

    positions: FloatArray
    natural_freq: FloatArray
    damping_ratio: FloatArray
    poles: ComplexArray
    mode_shapes: FloatArray
    mac: FloatArray
    dofs: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("positions", "natural_freq", "damping_ratio", "mode_shapes", "mac"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))
        object.__setattr__(self, "poles", read_only(self.poles, np.complex128))
        object.__setattr__(self, "dofs", tuple(self.dofs))


@dataclass(frozen=True)
class AbsorberCheck:
    """
    What an absorber does over the workspace.

    Parameters
    ----------
    absorber : AbsorberParameters
        The absorber.
    working_frequency : float
        Frequency of the tool's force [Hz].
    positions : array_like, shape (position,)
        Positions y_b / L.
    before, after : array_like, shape (position,)
        Modulus of the driving-point accelerance at the working frequency without and with the absorber [m/s^2/N].
    frf_before, frf_after : FrequencyResponse
        The driving-point accelerance around it, without and with the absorber.
    peaks_before, peaks_after : sequence of tuple of float
        Frequencies of the peaks of ``frf_before`` and ``frf_after`` at each position [Hz].
    """

    absorber: AbsorberParameters
    working_frequency: float
    positions: FloatArray
    before: FloatArray
    after: FloatArray
    frf_before: FrequencyResponse
    frf_after: FrequencyResponse
    peaks_before: tuple[tuple[float, ...], ...]
    peaks_after: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        for name in ("positions", "before", "after"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def reduction(self) -> FloatArray:
        """Part of the accelerance that the absorber takes away at each position, 1 - after/before."""
        return 1.0 - self.after / self.before

    @property
    def worst(self) -> tuple[float, float]:
        """Position at which most is left, and what is left there [m/s^2/N]."""
        k = int(np.argmax(self.after))
        return float(self.positions[k]), float(self.after[k])
