"""Frequency responses as the objects of other libraries, and back: python-control, xarray, pandas, SDyPy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import control_name
from cutvib_ss.results import QUANTITY_OF_FORM, FrequencyResponse, MeasuredFrequencyResponse, Quantity

if TYPE_CHECKING:
    import control


def to_control(frf: FrequencyResponse, position: float | None = None) -> control.FrequencyResponseData:
    """
    The response at one position as python-control's object.

    Parameters
    ----------
    frf : FrequencyResponse
        The response.
    position : float, optional
        Which position y_b / L, where there are several.

    Returns
    -------
    control.FrequencyResponseData
        Over angular frequency [rad/s], signals named; points in names, which it does not allow, become underscores.

    Raises
    ------
    ParameterError
        If there are several positions and none is chosen.
    """
    import control

    chosen = _one_position(frf, position)
    # python-control allows no point in a name: rail@0.25 becomes rail@0_25.
    names = {what: [control_name(n) for n in getattr(chosen, what)] for what in ("inputs", "outputs")}
    return control.frd(np.array(chosen.data[0]), np.array(chosen.omega), **names)


def from_control(
    frd: control.FrequencyResponseData,
    *,
    quantities: Quantity | Sequence[Quantity] = "displacement",
    position: float = float("nan"),
) -> FrequencyResponse:
    """
    A response from python-control's object.

    Parameters
    ----------
    frd : control.FrequencyResponseData
        For instance of ``control.frequency_response(plant, omega)``.
    quantities : str or sequence of str
        Motion quantity of all outputs, or of each: python-control does not hold it.
    position : float
        y_b / L of the head.

    Returns
    -------
    FrequencyResponse
        At one position.
    """
    outputs, inputs = tuple(frd.output_labels), tuple(frd.input_labels)
    each: Sequence[Quantity] = [quantities] * len(outputs) if isinstance(quantities, str) else quantities
    data = np.asarray(frd.frdata)[None]
    freq = np.asarray(frd.omega, dtype=np.float64) / (2 * np.pi)
    return FrequencyResponse(data, freq, np.array([position]), outputs, inputs, tuple(each))


def from_xarray(dataset: Any) -> FrequencyResponse:
    """
    A response from the dataset that `FrequencyResponse.to_xarray` gives.

    Parameters
    ----------
    dataset : xarray.Dataset
        The dataset.

    Returns
    -------
    FrequencyResponse
        The response; a `MeasuredFrequencyResponse` where there is a variance.

    Raises
    ------
    ParameterError
        If a variable or coordinate is missing.
    """
    try:
        labels: dict[str, Any] = {
            field: tuple(str(v) for v in dataset[name].values)
            for field, name in (
                ("outputs", "output"), ("inputs", "input"), ("quantities", "quantity"),
                ("displacement_units", "displacement_unit"), ("input_units", "input_unit"),
            )
        }  # fmt: skip
        arrays = {"data": dataset["response"].values, "freq": dataset["freq"].values}
        arrays["positions"] = dataset["position"].values
    except KeyError as error:
        raise ParameterError(f"the dataset has no {error}; make it with FrequencyResponse.to_xarray") from None
    rate = float(dataset.attrs.get("decay_rate", 0.0))
    if "variance" not in dataset:
        return FrequencyResponse(**arrays, **labels, decay_rate=rate)
    noise: dict[str, Any] = {name: dataset[name].values for name in ("variance", "coherence")}
    noise["averages"] = int(dataset.attrs["averages"])
    return MeasuredFrequencyResponse(**arrays, **labels, **noise, decay_rate=rate)


def from_dataframe(table: Any, quantities: Sequence[Quantity]) -> FrequencyResponse:
    """
    A response from the table that `FrequencyResponse.to_dataframe` gives.

    Parameters
    ----------
    table : pandas.DataFrame
        The table.
    quantities : sequence of str
        Motion quantity of each output.

    Returns
    -------
    FrequencyResponse
        The response; units of displacement from the columns' units.
    """
    from cutvib_ss.interchange.frf_formats import UNITS

    outputs, inputs = (tuple(dict.fromkeys(table.columns.get_level_values(n))) for n in ("output", "input"))
    positions, freq = (np.array(table.index.unique(n), dtype=float) for n in ("position", "freq [Hz]"))
    shape = (positions.size, freq.size, len(outputs), len(inputs))
    units = {(o, i): u for o, i, u in table.columns}
    return FrequencyResponse(
        np.moveaxis(table.to_numpy().reshape(shape), 1, -1), freq, positions, outputs, inputs, tuple(quantities),
        displacement_units=tuple(UNITS[units[o, inputs[0]]][0] for o in outputs),
        input_units=tuple(UNITS[units[outputs[0], i]][2] for i in inputs),
    )  # fmt: skip


def to_sdypy(frf: FrequencyResponse, position: float | None = None, input: str | None = None) -> dict[str, Any]:
    """
    The response to one input at one position by the names of SDyPy's EMA (and pyEMA).

    Parameters
    ----------
    frf : FrequencyResponse
        The response, of one form.
    position : float, optional
        Which position y_b / L, where there are several.
    input : str, optional
        Which input; the first by default.

    Returns
    -------
    dict
        ``frf`` of shape (output, frequency), ``freq`` [Hz] and ``frf_type``: keyword arguments of ``sdypy.EMA.Model``.

    Raises
    ------
    ParameterError
        If there are several positions and none is chosen, or outputs of different quantities.
    """
    chosen = _one_position(frf, position).sel(input=frf.inputs[0] if input is None else input)
    if len(set(chosen.quantities)) > 1:
        raise ParameterError(f"outputs are {', '.join(chosen.quantities)}; bring them to one form with to_form")
    forms = {quantity: form for form, quantity in QUANTITY_OF_FORM.items()}
    freq = np.array(chosen.freq)
    return {"frf": np.array(chosen.data[0, :, 0]), "freq": freq, "frf_type": forms[chosen.quantities[0]]}


def from_sdypy(
    frf: np.ndarray, freq: np.ndarray, frf_type: str = "receptance", *, outputs: Sequence[str], input: str = "force"
) -> FrequencyResponse:
    """
    A response from arrays as SDyPy and pyFRF hold them.

    Parameters
    ----------
    frf : ndarray, shape (output, frequency)
        The responses.
    freq : ndarray, shape (frequency,)
        Frequencies [Hz].
    frf_type : {"receptance", "mobility", "accelerance"}
        Their form.
    outputs : sequence of str
        Names of the outputs.
    input : str
        Name of the input.

    Returns
    -------
    FrequencyResponse
        Without a position.

    Raises
    ------
    ParameterError
        If the form is none of these.
    """
    if frf_type not in QUANTITY_OF_FORM:
        raise ParameterError(f"frf_type = {frf_type!r} is not one of {', '.join(QUANTITY_OF_FORM)}")
    quantity = QUANTITY_OF_FORM[frf_type]
    data = np.atleast_2d(np.asarray(frf))[None, :, None]
    return FrequencyResponse(data, freq, np.array([np.nan]), tuple(outputs), (input,), (quantity,) * data.shape[1])


def _one_position(frf: FrequencyResponse, position: float | None) -> FrequencyResponse:
    if position is None and frf.positions.size > 1:
        raise ParameterError(f"choose one of the positions {frf.positions.tolist()}")
    return frf.sel(position=position)
