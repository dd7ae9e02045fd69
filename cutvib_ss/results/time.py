"""Responses in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.results.arrays import FloatArray, label_indices, position_indices, read_only
from cutvib_ss.results.display import Drawn, Table, data_frame, optional
from cutvib_ss.units import STANDARD_GRAVITY


@dataclass(frozen=True, repr=False)
class TimeResponse(Drawn):
    """
    Histories of a model's outputs under a force, evenly sampled.

    Parameters
    ----------
    data : array_like, shape (output, sample)
        Histories, each in its unit.
    force : array_like, shape (sample,)
        What drove them [``force_unit``].
    fs : float
        Sampling frequency [Hz].
    outputs : sequence of str
        Names of the outputs.
    units : sequence of str
        SI unit of each output: ``"m"``, ``"m/s"``, ``"m/s^2"``, their angles, or ``"N"``.
    position : float
        y_b / L of the head; NaN where the model has none.
    periodic : bool
        Whether the histories are one period of a steady state.
    force_unit : str
        ``"N"``, or ``"m/s^2"`` for base excitation.
    """

    data: FloatArray
    force: FloatArray
    fs: float
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    position: float = float("nan")
    periodic: bool = False
    force_unit: str = "N"

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "data", read_only(self.data, np.float64))
        set_(self, "force", read_only(self.force, np.float64))
        set_(self, "outputs", tuple(self.outputs))
        set_(self, "units", tuple(self.units))
        if self.data.shape != (len(self.outputs), self.force.size) or len(self.units) != len(self.outputs):
            raise ParameterError(
                f"histories of shape {self.data.shape} do not fit {len(self.outputs)} outputs, {len(self.units)} units and "
                f"{self.force.size} samples of force"
            )

    @property
    def time(self) -> FloatArray:
        """Instants [s], shape (sample,)."""
        return np.asarray(np.arange(self.force.size) / self.fs)

    @property
    def unit(self) -> str:
        """The unit, where all outputs share one; else the units of the outputs, joined by commas."""
        return self.units[0] if len(set(self.units)) == 1 else ", ".join(self.units)

    def sel(
        self,
        *,
        position: float | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> Self:
        """
        Some of the outputs; no axis is dropped.

        Parameters
        ----------
        position : float, optional
            The position of this response (where it starts, of a head that travels).
        output : str or sequence of str, optional
            Outputs to keep, in this order.
        input : str, optional
            The one input, ``"force"``.

        Returns
        -------
        TimeResponse
            The part.

        Raises
        ------
        ParameterError
            If a label is not there; the message lists those that are.
        """
        position_indices(np.array([self.position]), position)
        label_indices(("force",), input, "input")
        kept = label_indices(self.outputs, output, "output")
        return replace(
            self,
            data=self.data[kept],
            outputs=tuple(self.outputs[k] for k in kept),
            units=tuple(self.units[k] for k in kept),
        )

    def after(self, start: float) -> Self:
        """
        The histories from an instant on, for instance once a transient has gone.

        Parameters
        ----------
        start : float
            The instant [s].

        Returns
        -------
        TimeResponse
            The part; its time starts at zero again.

        Raises
        ------
        ParameterError
            If nothing is left.
        """
        first = int(np.ceil(start * self.fs - 1e-9))
        if not 0 <= first < self.force.size:
            raise ParameterError(f"{start} s is outside the response, which lasts {self.force.size / self.fs:g} s")
        return replace(self, data=self.data[:, first:], force=self.force[first:], periodic=self.periodic and first == 0)

    def rms(self) -> FloatArray:
        """
        Root mean square of each output, its mean included.

        Returns
        -------
        ndarray, shape (output,)
            In the output's unit.
        """
        return np.asarray(np.sqrt(np.mean(self.data**2, axis=1)))

    def peak(self) -> FloatArray:
        """
        Largest size of each output.

        Returns
        -------
        ndarray, shape (output,)
            In the output's unit.
        """
        return np.asarray(np.abs(self.data).max(axis=1))

    def spectrum(self, window: bool | None = None) -> tuple[FloatArray, FloatArray]:
        """
        Amplitude spectrum: a sine of amplitude 1 on a line shows as 1.

        Parameters
        ----------
        window : bool, optional
            Whether a Hann window (and removal of the mean) is applied; by default unless the response is periodic.

        Returns
        -------
        freq : ndarray, shape (frequency,)
            Frequencies [Hz].
        amplitude : ndarray, shape (output, frequency)
            Amplitudes, in the outputs' units; of the mean at zero.
        """
        n = self.force.size
        shown = np.asarray(self.data)
        weight = np.ones(n)
        if not self.periodic if window is None else window:
            weight = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
            shown = shown - shown.mean(axis=1, keepdims=True)
        amplitude = np.abs(np.fft.rfft(shown * weight, axis=1)) / weight.sum()
        amplitude[:, 1 : (n + 1) // 2] *= 2.0
        return np.asarray(np.fft.rfftfreq(n, 1 / self.fs), dtype=np.float64), np.asarray(amplitude, dtype=np.float64)

    def in_g(self) -> Self:
        """
        Accelerations in units of gravity.

        Returns
        -------
        TimeResponse
            Those outputs in ``"g"``, the others as they are.
        """
        factor = np.array([1.0 / STANDARD_GRAVITY if u == "m/s^2" else 1.0 for u in self.units])
        units = tuple("g" if u == "m/s^2" else u for u in self.units)
        return replace(self, data=self.data * factor[:, None], units=units)

    def to_xarray(self) -> Any:
        """
        The histories as a dataset of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``force`` over time, ``response`` over (output, time), with the unit of each output.
        """
        xarray = optional("xarray", "to_xarray")
        return xarray.Dataset(
            {
                "response": (("output", "time"), np.array(self.data)),
                "force": ("time", np.array(self.force), {"units": self.force_unit}),
            },
            coords={
                "time": ("time", self.time, {"units": "s"}),
                "output": list(self.outputs),
                "unit": ("output", list(self.units)),
            },
            attrs={"position": self.position, "fs": self.fs},
        )

    def to_dataframe(self) -> Any:
        """
        The histories as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each instant [s], a column for the force and for each output, with units.
        """
        columns = {f"force [{self.force_unit}]": self.force}
        columns |= {f"{o} [{u}]": d for o, u, d in zip(self.outputs, self.units, self.data, strict=True)}
        return data_frame(columns, "time [s]", self.time)

    def _table(self) -> Table:
        rows = [
            (o, u, f"{r:.4g}", f"{p:.4g}")
            for o, u, r, p in zip(self.outputs, self.units, self.rms(), self.peak(), strict=True)
        ]
        place = "" if np.isnan(self.position) else f", y/L = {self.position:.4g}"
        title = f"Response in time: {self.force.size} samples at {self.fs:g} Hz{place}"
        return Table(title, ("output", "unit", "RMS", "peak"), rows)
