"""Frequency responses, computed and measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import check_choice
from cutvib_ss.results.arrays import (
    QUANTITY_OF_FORM,
    ComplexArray,
    FloatArray,
    Form,
    Quantity,
    label_indices,
    position_indices,
    read_only,
)
from cutvib_ss.results.display import Drawn, Table, optional, span
from cutvib_ss.units import DERIVATIVE_ORDER, rate_unit, ratio_unit

EstimatorKind: TypeAlias = Literal["H1", "H2", "Hv"]
_BY_OUTPUT = ("outputs", "quantities", "displacement_units")
_BY_INPUT = ("inputs", "input_units")


@dataclass(frozen=True, repr=False)
class FrequencyResponse(Drawn):
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
        Names of the outputs and inputs; a string is one name.
    quantities : sequence of str
        Motion quantity of each output: ``"displacement"``, ``"velocity"`` or ``"acceleration"``.
    input_unit : str
        SI unit of the inputs, where all share one: ``"N"``, or ``"m/s^2"`` for base excitation.
    decay_rate : float
        σ [1/s]: the response is that at s = σ + jω (0: the ordinary frequency response).
    displacement_units : sequence of str
        Unit of each output's displacement: ``"m"`` (of all, by default), ``"rad"``, or ``"kg^0.5 m"`` of a modal coordinate.
    input_units : sequence of str
        SI unit of each input, where they differ: ``"N m"`` of a torque, ``"kg^-0.5 N"`` of a modal force.

    Examples
    --------
    >>> frf = FrequencyResponse([[[[1 + 2j]]]], [10.0], [0.5], "tool_x", "force", ["acceleration"])
    >>> frf.unit
    'm/s^2/N'
    >>> print(frf)
    Frequency response: 1 position, 1 frequency (10 Hz)
      output  input  unit     largest
      tool_x  force  m/s^2/N  2.236 at 10 Hz, y/L = 0.5
    """

    data: ComplexArray
    freq: FloatArray
    positions: FloatArray
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    input_unit: str = "N"
    decay_rate: float = 0.0
    displacement_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "data", read_only(self.data, np.complex128))
        set_(self, "freq", read_only(self.freq, np.float64))
        set_(self, "positions", read_only(np.atleast_1d(np.asarray(self.positions, dtype=float))))
        for name in (*_BY_OUTPUT, *_BY_INPUT):
            given = getattr(self, name)
            set_(self, name, (given,) if isinstance(given, str) else tuple(given))
        if not self.displacement_units:
            set_(self, "displacement_units", ("m",) * len(self.outputs))
        if not self.input_units:
            set_(self, "input_units", (self.input_unit,) * len(self.inputs))
        set_(self, "input_unit", ", ".join(dict.fromkeys(self.input_units)))
        shape = (self.positions.size, len(self.outputs), len(self.inputs), self.freq.size)
        if self.data.shape != shape:
            raise ParameterError(
                f"frequency response data have shape {self.data.shape}, but (position, output, input, frequency) "
                f"= {shape} is labelled"
            )
        for what, names in (("output", _BY_OUTPUT), ("input", _BY_INPUT)):
            for name in names[1:]:
                if len(getattr(self, name)) != len(getattr(self, names[0])):
                    raise ParameterError(f"{len(getattr(self, names[0]))} {what}s need as many {name}")
        for quantity in self.quantities:
            check_choice("quantity", quantity, tuple(DERIVATIVE_ORDER))

    @property
    def omega(self) -> FloatArray:
        """Angular frequency [rad/s], shape (frequency,)."""
        return 2 * np.pi * self.freq

    def unit_of(self, output: str, input: str | None = None) -> str:
        """
        Unit of one response.

        Parameters
        ----------
        output : str
            The output.
        input : str, optional
            The input; the first by default.

        Returns
        -------
        str
            For instance ``"m/s^2/N"``, ``"rad/N"`` or ``"kg^0.5 m/N"``.
        """
        k, i = label_indices(self.outputs, output, "output")[0], label_indices(self.inputs, input, "input")[0]
        return ratio_unit(rate_unit(self.displacement_units[k], self.quantities[k]), self.input_units[i])

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each output's response, for instance ``"m/s^2/N"``; one after the other where inputs differ in unit."""
        return tuple(", ".join(dict.fromkeys(self.unit_of(o, i) for i in self.inputs)) for o in self.outputs)

    @property
    def unit(self) -> str:
        """The unit, where all outputs share one; else the units of the outputs, joined by commas."""
        units = self.units
        return units[0] if len(set(units)) == 1 else ", ".join(units)

    def sel(
        self,
        *,
        position: float | Sequence[float] | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> Self:
        """
        Part of the response by label; no axis is dropped.

        Parameters
        ----------
        position : float or sequence of float, optional
            Positions y_b / L that were computed or measured (to 1e-9).
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
        rows = position_indices(self.positions, position)
        outs = label_indices(self.outputs, output, "output")
        return self._take(rows, outs, label_indices(self.inputs, input, "input"))

    def at_lines(self, keep: np.ndarray | slice) -> Self:
        """
        Part of the response by frequency line.

        Parameters
        ----------
        keep : ndarray or slice
            Lines to keep: a mask, indices or a slice of ``freq``.

        Returns
        -------
        FrequencyResponse
            The part, with all four axes.
        """
        arrays: dict[str, Any] = {name: getattr(self, name)[..., keep] for name in self._arrays}
        return replace(self, freq=self.freq[keep], **arrays)

    def _take(self, rows: NDArray[np.intp], outs: list[int], ins: list[int]) -> Self:
        index = np.ix_(rows, np.array(outs), np.array(ins), np.arange(self.freq.size))
        labels: dict[str, Any] = {name: tuple(getattr(self, name)[k] for k in outs) for name in _BY_OUTPUT}
        labels |= {name: tuple(getattr(self, name)[k] for k in ins) for name in _BY_INPUT}
        arrays: dict[str, Any] = {name: getattr(self, name)[index] for name in self._arrays}
        return replace(self, positions=self.positions[rows], **labels, **arrays)

    @property
    def _arrays(self) -> tuple[str, ...]:
        return ("data",)

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

        Raises
        ------
        ParameterError
            If the form is none of these.
        """
        check_choice("form", form, tuple(QUANTITY_OF_FORM))
        factor = self._derivative_factor(QUANTITY_OF_FORM[form])
        with np.errstate(invalid="ignore"):
            changed = self._scaled(factor)
        return replace(self, quantities=(QUANTITY_OF_FORM[form],) * len(self.outputs), **changed)

    def _scaled(self, factor: ComplexArray) -> dict[str, Any]:
        return {"data": self.data * factor}

    def _derivative_factor(self, quantity: Quantity) -> ComplexArray:
        s = self.decay_rate + 1j * self.omega
        order = np.array([DERIVATIVE_ORDER[quantity] - DERIVATIVE_ORDER[q] for q in self.quantities])
        factor = np.full((order.size, 1, s.size), np.nan, dtype=np.complex128)
        for row, n in zip(factor, order, strict=True):
            usable = (s != 0) | (n >= 0)
            row[0, usable] = s[usable] ** n
        return factor

    def to_xarray(self) -> Any:
        """
        The response as a labelled array of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``response`` over (position, output, input, freq), with ``unit`` by output and input; of a measured response
            ``variance`` and ``coherence`` too. `cutvib_ss.interchange.from_xarray` turns it back.
        """
        xarray = optional("xarray", "to_xarray")
        dims = ("position", "output", "input", "freq")
        units = [[self.unit_of(o, i) for i in self.inputs] for o in self.outputs]
        return xarray.Dataset(
            {"response" if name == "data" else name: (dims, np.array(getattr(self, name))) for name in self._arrays},
            coords={
                "position": ("position", self.positions, {"long_name": "y_b / L of the head", "units": "1"}),
                "output": list(self.outputs),
                "input": list(self.inputs),
                "freq": ("freq", self.freq, {"long_name": "frequency", "units": "Hz"}),
                "quantity": ("output", list(self.quantities)),
                "displacement_unit": ("output", list(self.displacement_units)),
                "input_unit": ("input", list(self.input_units)),
                "unit": (("output", "input"), units),
            },
            attrs={"decay_rate": self.decay_rate, "averages": getattr(self, "averages", 0)},
        )

    def to_dataframe(self) -> Any:
        """
        The response as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            Rows by position and frequency [Hz], complex columns by output, input and unit.
        """
        pandas = optional("pandas", "to_dataframe")
        rows = pandas.MultiIndex.from_product([self.positions, self.freq], names=["position", "freq [Hz]"])
        pairs = [(o, i, self.unit_of(o, i)) for o in self.outputs for i in self.inputs]
        columns = pandas.MultiIndex.from_tuples(pairs, names=["output", "input", "unit"])
        table = np.moveaxis(self.data, 3, 1).reshape(len(rows), len(pairs))
        return pandas.DataFrame(table, index=rows, columns=columns)

    def _table(self) -> Table:
        rows = []
        for k, output in enumerate(self.outputs):
            for i, input in enumerate(self.inputs):
                size = np.nan_to_num(np.abs(self.data[:, k, i]))
                at, line = np.unravel_index(int(size.argmax()), size.shape) if size.size else (0, 0)
                place = "" if np.isnan(self.positions[at]) else f", y/L = {self.positions[at]:.4g}"
                largest = f"{size[at, line]:.4g} at {self.freq[line]:.4g} Hz{place}" if size.size else "-"
                rows.append((output, input, self.unit_of(output, input), largest))
        count, lines = self.positions.size, self.freq.size
        title = f"{self._title}: {count} position{'s' * (count != 1)}, {lines} frequenc{'ies' if lines != 1 else 'y'}"
        over = f" ({span(self.freq, 'Hz')})" if lines else ""
        return Table(title + over, ("output", "input", "unit", "largest"), rows)

    @property
    def _title(self) -> str:
        return "Frequency response"


@dataclass(frozen=True)
class Estimator:
    """
    What an estimator did to a record on the way to its frequency responses.

    Parameters
    ----------
    kind : {"H1", "H2", "Hv"} or None
        Which estimator it is; None where only its responses were recorded.
    block : float
        Length of the block that follows a blow [s]; infinite where nothing of the response is cut off.
    blow_at : float or None
        Instant of the blow in the block [s]; None where it is not known.
    exponential_decay : float
        Decay rate [1/s] of an exponential window on the response alone.
    scatter_seen : bool
        Whether the noise was seen to scatter, over repetitions or by a coherence; else it is read off how smooth the response is.
    """

    kind: EstimatorKind | None = None
    block: float = float("inf")
    blow_at: float | None = None
    exponential_decay: float = 0.0
    scatter_seen: bool = True


@dataclass(frozen=True, repr=False)
class MeasuredFrequencyResponse(FrequencyResponse):
    """
    An estimated frequency response: the computed type plus its noise and its estimator.

    Parameters
    ----------
    variance : array_like, shape (position, output, input, frequency)
        Variance E|ΔH|² of the complex estimate, in ``unit`` squared (each real part carries half).
    coherence : array_like, shape (position, output, input, frequency)
        Ordinary coherence γ² between input and output, 0 to 1; NaN where unknown.
    averages : int
        Number of blows or blocks behind each estimate.
    estimator : Estimator
        What the estimator did to the record.
    """

    variance: FloatArray = None  # type: ignore[assignment]
    coherence: FloatArray = None  # type: ignore[assignment]
    averages: int = 1
    estimator: Estimator = Estimator()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("variance", "coherence"):
            given = getattr(self, name)
            values = np.full(self.data.shape, np.nan) if given is None else given
            object.__setattr__(self, name, read_only(values, np.float64))
            if getattr(self, name).shape != self.data.shape:
                raise ParameterError(f"{name} has shape {getattr(self, name).shape}, the data {self.data.shape}")

    def computed(self, data: ComplexArray) -> FrequencyResponse:
        """
        What a model shows in place of the measurement.

        Parameters
        ----------
        data : ndarray of complex, shape (position, output, input, frequency)
            The model's responses, in the units of these.

        Returns
        -------
        FrequencyResponse
            With the labels of the measurement.
        """
        labels: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(FrequencyResponse) if f.name != "data"}
        return FrequencyResponse(data, **labels)

    @property
    def _arrays(self) -> tuple[str, ...]:
        return ("data", "variance", "coherence")

    def _scaled(self, factor: ComplexArray) -> dict[str, Any]:
        return {"data": self.data * factor, "variance": self.variance * np.abs(factor) ** 2}

    @property
    def _title(self) -> str:
        return f"Measured frequency response ({self.averages} average{'s' * (self.averages != 1)})"
