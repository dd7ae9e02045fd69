"""What of a frequency response is fitted, and how much each value counts (Eq. 21's weights)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from cutvib_ss.errors import IdentificationError
from cutvib_ss.identification.held_head import TOOL
from cutvib_ss.model.head import HEAD_PARAMETERS
from cutvib_ss.parameters import check_number
from cutvib_ss.results import ComplexArray, FloatArray, FrequencyResponse, MeasuredFrequencyResponse, read_only

Weighting: TypeAlias = Literal["paper", "variance"]


@dataclass(frozen=True)
class FitWeights:
    """
    Weights and scale factors of Eq. 21.

    Parameters
    ----------
    c_x, c_z : float
        Weights C_X and C_Z.
    k_x, k_z : float
        Scale factors k_X and k_Z.
    """

    c_x: float = 1.0
    c_z: float = 0.25
    k_x: float = 1.0
    k_z: float = 0.1

    def __post_init__(self) -> None:
        for name in ("c_x", "c_z", "k_x", "k_z"):
            check_number(f"weights.{name}", getattr(self, name), 0.0)

    def of(self, output: str) -> float:
        """
        Weight C k² of an output's squared differences.

        Parameters
        ----------
        output : {"tool_x", "tool_z"}
            The output.

        Returns
        -------
        float
            The weight.
        """
        return self.c_x * self.k_x**2 if output == "tool_x" else self.c_z * self.k_z**2


@dataclass(frozen=True)
class FitData:
    """
    Responses to fit: one position, one input, XX and where there is one ZX, in a band.

    Parameters
    ----------
    frf : FrequencyResponse
        The responses as measured, cut to band and outputs.
    weights : array_like, shape (output, frequency)
        Weight of each squared difference.
    variance : array_like of float, shape (output, frequency), or None
        Variance of each complex value, where the measurement knows it.
    """

    frf: FrequencyResponse
    weights: FloatArray
    variance: FloatArray | None

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", read_only(self.weights, np.float64))
        if self.variance is not None:
            object.__setattr__(self, "variance", read_only(self.variance, np.float64))

    @property
    def measured(self) -> ComplexArray:
        """The values to fit, shape (output, frequency)."""
        values: ComplexArray = self.frf.data[0, :, 0, :]
        return values


def fit_data(
    frf: FrequencyResponse,
    band: tuple[float, float] = (150.0, 300.0),
    weighting: Weighting = "paper",
    weights: FitWeights | None = None,
) -> FitData:
    """
    What of a frequency response is fitted, and how much each value counts.

    Parameters
    ----------
    frf : FrequencyResponse
        Computed or measured responses to the cutting force; its first position and input are used.
    band : tuple of float
        Lowest and highest frequency [Hz].
    weighting : {"paper", "variance"}
        Weights of Eq. 21, the same at every frequency, or the inverse of each value's own variance.
    weights : FitWeights, optional
        Weights of Eq. 21; the paper's by default.

    Returns
    -------
    FitData
        The values to fit.

    Raises
    ------
    IdentificationError
        If there is no ``tool_x``, too few lines lie in the band, a value is not finite, or variances are asked for that
        are not known.
    """
    outputs = [name for name in TOOL if name in frf.outputs]
    if "tool_x" not in outputs:
        raise IdentificationError(f"the fit needs the response tool_x; there are {', '.join(frf.outputs)}")
    inside = np.flatnonzero((frf.freq >= band[0]) & (frf.freq <= band[1]))
    if inside.size * 2 * len(outputs) <= len(HEAD_PARAMETERS):
        raise IdentificationError(f"{band[0]:g} to {band[1]:g} Hz holds {inside.size} lines; widen the band")
    whole = frf.sel(output=outputs)
    values = whole.data[0, :, 0, inside].T
    if not np.isfinite(values).all():
        raise IdentificationError(
            f"a response between {band[0]:g} and {band[1]:g} Hz is not finite; correct the record"
        )
    cut = FrequencyResponse(
        values[None, :, None, :], frf.freq[inside], frf.positions[:1], tuple(outputs), frf.inputs[:1],
        whole.quantities, frf.input_unit, frf.decay_rate,
    )  # fmt: skip
    variance = None
    if isinstance(whole, MeasuredFrequencyResponse):
        known = whole.variance[0, :, 0, inside].T
        variance = known if np.isfinite(known).all() and (known > 0).all() else None
    if weighting == "variance":
        if variance is None:
            raise IdentificationError("the variance of these responses is not known; take the paper's weights")
        return FitData(cut, 1.0 / variance, variance)
    chosen = weights or FitWeights()
    # Accelerances are some m/s²/N, receptances micrometres: a common factor brings either to one.
    size = float(np.mean(np.abs(values[0]) ** 2))
    rows = np.array([[chosen.of(name) / size] for name in outputs])
    return FitData(cut, rows + np.zeros(values.shape), variance)
