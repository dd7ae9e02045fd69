"""What an absorber does over the workspace."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cutvib_ss.parameters import AbsorberParameters
from cutvib_ss.results.arrays import FloatArray, position_indices, read_only
from cutvib_ss.results.display import Drawn, Table, data_frame, optional
from cutvib_ss.results.frequency import FrequencyResponse


@dataclass(frozen=True, repr=False)
class AbsorberCheck(Drawn):
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
        """Position of the largest residual response, and that response [m/s^2/N]."""
        k = int(np.argmax(self.after))
        return float(self.positions[k]), float(self.after[k])

    def sel(
        self,
        *,
        position: float | Sequence[float] | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> AbsorberCheck:
        """
        The check at some of its positions.

        Parameters
        ----------
        position : float or sequence of float, optional
            Positions y_b / L that were computed (to 1e-9).
        output, input : str or sequence of str, optional
            Names of the responses' output and input.

        Returns
        -------
        AbsorberCheck
            The part.

        Raises
        ------
        ParameterError
            If a label is not there; the message lists those that are.
        """
        rows = position_indices(self.positions, position)
        return replace(
            self,
            positions=self.positions[rows],
            before=self.before[rows],
            after=self.after[rows],
            frf_before=self.frf_before.sel(position=position, output=output, input=input),
            frf_after=self.frf_after.sel(position=position, output=output, input=input),
            peaks_before=tuple(self.peaks_before[k] for k in rows),
            peaks_after=tuple(self.peaks_after[k] for k in rows),
        )

    def to_dataframe(self) -> Any:
        """
        Accelerances at the working frequency as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each position y_b / L: accelerance before and after [m/s^2/N], reduction as a fraction of 1.
        """
        columns = {"before [m/s^2/N]": self.before, "after [m/s^2/N]": self.after, "reduction": self.reduction}
        return data_frame(columns, "position", self.positions)

    def to_xarray(self) -> Any:
        """
        Accelerances at the working frequency as a dataset of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``before`` and ``after`` [m/s^2/N] over position; the responses around it are ``frf_before`` and ``frf_after``, which
            become datasets of their own.
        """
        return optional("xarray", "to_xarray").Dataset(
            {name: ("position", np.array(getattr(self, name)), {"units": "m/s^2/N"}) for name in ("before", "after")},
            coords={"position": self.positions},
            attrs={"working_frequency": self.working_frequency},
        )

    def _table(self) -> Table:
        a = self.absorber
        rows = [
            (f"{y:.4g}", f"{b:.3f}", f"{c:.3f}", f"{100 * r:.1f}")
            for y, b, c, r in zip(self.positions, self.before, self.after, self.reduction, strict=True)
        ]
        title = (
            f"Absorber of {a.mass:g} kg at {a.frequency:g} Hz, damping ratio {a.damping_ratio:g}: "
            f"accelerance at {self.working_frequency:g} Hz"
        )
        return Table(title, ("y/L", "before [m/s^2/N]", "after [m/s^2/N]", "less by [%]"), rows)
