"""What one absorber on the tool does over the workspace (Fig. 20), and the study over tunings and dampings behind Table 7."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import signal

from cutvib_ss.absorber.coupling import attach_absorber
from cutvib_ss.absorber.force import WORKING_FREQUENCY, HarmonicForce
from cutvib_ss.absorber.workspace import Workspace
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import AbsorberParameters
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import AbsorberCheck, FloatArray, FrequencyResponse, read_only
from cutvib_ss.results.arrays import label_indices, position_indices, value_indices
from cutvib_ss.results.display import Drawn, Table, optional

_PEAK_PROMINENCE = 0.02
"""A peak stands out of its surroundings by this part of the largest value."""


@dataclass(frozen=True, repr=False)
class AbsorberStudy(Drawn):
    """
    Absorbers over a grid of tunings and dampings, each judged by its worst position.

    Parameters
    ----------
    working_frequency : float
        Frequency of the tool's force [Hz].
    positions : array_like, shape (position,)
        Positions y_b / L over which the worst is taken.
    tuning : array_like, shape (tuning,)
        Tuning frequencies [Hz].
    damping_ratio : array_like, shape (damping,)
        Damping ratios of the absorber.
    before : array_like, shape (position,)
        Modulus of the driving-point accelerance at the working frequency without an absorber [m/s^2/N].
    worst : array_like, shape (tuning, damping)
        Largest modulus over the positions with the absorber [m/s^2/N].
    best : AbsorberParameters
        The absorber whose worst position is the best.
    """

    working_frequency: float
    positions: FloatArray
    tuning: FloatArray
    damping_ratio: FloatArray
    before: FloatArray
    worst: FloatArray
    best: AbsorberParameters

    def __post_init__(self) -> None:
        for name in ("positions", "tuning", "damping_ratio", "before", "worst"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    def sel(
        self,
        *,
        position: float | Sequence[float] | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
        tuning: float | Sequence[float] | None = None,
        damping_ratio: float | Sequence[float] | None = None,
    ) -> AbsorberStudy:
        """
        The study of some of its absorbers; no axis is dropped.

        Parameters
        ----------
        position : float or sequence of float, optional
            All of the positions y_b / L: the worst is taken over them together.
        output, input : str or sequence of str, optional
            The one output, ``"tool_x"``, and the one input, ``"force"``.
        tuning : float or sequence of float, optional
            Tuning frequencies that were tried [Hz] (to 1e-9).
        damping_ratio : float or sequence of float, optional
            Damping ratios that were tried (to 1e-9).

        Returns
        -------
        AbsorberStudy
            The part; ``best`` is the best of it.

        Raises
        ------
        ParameterError
            If a label is not there, or positions are left out; the message lists those that are.
        """
        label_indices(("tool_x",), output, "output")
        label_indices(("force",), input, "input")
        if len(set(position_indices(self.positions, position).tolist())) < self.positions.size:
            places = ", ".join(f"{y:g}" for y in self.positions)
            raise ParameterError(f"the worst is that of positions {places} together; run parametric_study for fewer")
        kept = value_indices(self.tuning, tuning, "tuning")
        ratios = value_indices(self.damping_ratio, damping_ratio, "damping ratio")
        tunings, dampings, worst = self.tuning[kept], self.damping_ratio[ratios], self.worst[np.ix_(kept, ratios)]
        best = _best(self.best, tunings, dampings, worst)
        return replace(self, tuning=tunings, damping_ratio=dampings, worst=worst, best=best)

    def to_dataframe(self) -> Any:
        """
        What each absorber leaves as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each tuning frequency [Hz] and damping ratio: the largest accelerance over the positions [m/s^2/N].
        """
        pandas = optional("pandas", "to_dataframe")
        rows = pandas.MultiIndex.from_product([self.tuning, self.damping_ratio], names=["tuning [Hz]", "damping_ratio"])
        return pandas.DataFrame({"worst [m/s^2/N]": self.worst.ravel()}, index=rows)

    def to_xarray(self) -> Any:
        """
        The study as a dataset of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``worst`` over (tuning [Hz], damping_ratio), ``before`` over position; both [m/s^2/N].
        """
        unit = {"units": "m/s^2/N"}
        return optional("xarray", "to_xarray").Dataset(
            {
                "worst": (("tuning", "damping_ratio"), np.array(self.worst), unit),
                "before": ("position", np.array(self.before), unit),
            },
            coords={
                "position": self.positions,
                "tuning": ("tuning", self.tuning, {"units": "Hz"}),
                "damping_ratio": self.damping_ratio,
            },
            attrs={"working_frequency": self.working_frequency, "mass": self.best.mass},
        )

    def _table(self) -> Table:
        rows = []
        for j, ratio in enumerate(self.damping_ratio):
            i = int(self.worst[:, j].argmin())
            rows.append((f"{ratio:g}", f"{self.tuning[i]:g}", f"{self.worst[i, j]:.3f}"))
        title = (
            f"Absorbers of {self.best.mass:g} kg: best at {self.best.frequency:g} Hz, damping ratio "
            f"{self.best.damping_ratio:g}; worst position {self.worst.min():.3f} m/s^2/N, without {self.before.max():.3f}"
        )
        return Table(title, ("damping ratio", "best tuning [Hz]", "worst [m/s^2/N]"), rows)


def check_absorber(
    machine: Machine,
    absorber: AbsorberParameters,
    positions: ArrayLike = (1 / 3, 1 / 2),
    *,
    working_frequency: float = WORKING_FREQUENCY,
    freq: ArrayLike | None = None,
    port: str = "tool_x",
) -> AbsorberCheck:
    """
    What an absorber does to the tool's accelerance XX over the workspace (Fig. 20).

    Parameters
    ----------
    machine : Machine
        The machine without it.
    absorber : AbsorberParameters
        The absorber.
    positions : array_like, shape (position,)
        y_b / L; by default the two of Fig. 20.
    working_frequency : float
        Frequency of the tool's force [Hz].
    freq : array_like, shape (frequency,), optional
        Frequencies of the responses and their peaks [Hz]; 150 to 300 Hz by default.
    port : str
        Where it sits, and in which direction it works; on the tool in X by default.

    Returns
    -------
    AbsorberCheck
        Accelerance XX at the working frequency before and after, the responses around it, and their peaks.
    """
    lines = np.arange(150.0, 300.0 + 0.125, 0.25) if freq is None else freq
    with_it = attach_absorber(machine, absorber, port)
    near = [frequency_response(m, positions, lines, outputs=("tool_x",)) for m in (machine, with_it)]
    there = [
        np.abs(frequency_response(m, positions, [working_frequency], outputs=("tool_x",)).data[:, 0, 0, 0])
        for m in (machine, with_it)
    ]
    return AbsorberCheck(
        absorber, working_frequency, near[0].positions, there[0], there[1], near[0], near[1], *map(_peaks, near)
    )


def parametric_study(
    machine: Machine,
    positions: ArrayLike = (1 / 3, 1 / 2),
    *,
    mass: float = 0.08,
    tuning: Sequence[float] | FloatArray | None = None,
    damping_ratio: Sequence[float] | FloatArray | None = None,
    working_frequency: float = WORKING_FREQUENCY,
    port: str = "tool_x",
) -> AbsorberStudy:
    """
    Absorbers of one mass over tunings and dampings, each judged by its worst position (the study behind Table 7).

    Parameters
    ----------
    machine : Machine
        The machine without absorber.
    positions : array_like, shape (position,)
        y_b / L over which the worst is taken; by default the two of Fig. 20.
    mass : float
        m_a [kg].
    tuning : sequence of float, optional
        Tuning frequencies [Hz]; 210 to 250 Hz in steps of 1 Hz by default.
    damping_ratio : sequence of float, optional
        Damping ratios; 0.01 to 0.05 in steps of 0.005 by default.
    working_frequency : float
        Frequency of the tool's force [Hz].
    port : str
        Where the absorber sits, and in which direction it works; on the tool in X by default.

    Returns
    -------
    AbsorberStudy
        What is left at the worst position for each absorber, and the best of them.

    Notes
    -----
    By Eq. 23 the whole grid costs one frequency response a position.
    """
    tunings = np.arange(210.0, 250.5) if tuning is None else np.asarray(tuning, dtype=float)
    dampings = np.arange(10, 51, 5) / 1000 if damping_ratio is None else np.asarray(damping_ratio, dtype=float)
    workspace = Workspace(machine, (port,), positions, HarmonicForce.tone(working_frequency))
    grid = np.stack(np.broadcast_arrays(tunings[:, None], dampings, mass), axis=-1)
    worst = workspace.values(grid.reshape(-1, 1, 3), [0]).max(axis=(1, 2)).reshape(grid.shape[:2])
    any_of_them = AbsorberParameters(float(tunings[0]), float(dampings[0]), mass, source="parametric study")
    best = _best(any_of_them, tunings, dampings, worst)
    before = workspace.values(np.empty((1, 0, 3)), [])[0].max(axis=-1)
    return AbsorberStudy(working_frequency, workspace.positions, tunings, dampings, before, worst, best)


def _best(like: AbsorberParameters, tuning: FloatArray, damping: FloatArray, worst: FloatArray) -> AbsorberParameters:
    """An absorber with the tuning and damping of the least worst, and all else as given."""
    i, j = np.unravel_index(int(np.argmin(worst)), worst.shape)
    return replace(like, frequency=float(tuning[i]), damping_ratio=float(damping[j]))


def _peaks(frf: FrequencyResponse) -> tuple[tuple[float, ...], ...]:
    out = []
    for modulus in np.abs(frf.data[:, 0, 0]):
        index, _ = signal.find_peaks(modulus, prominence=_PEAK_PROMINENCE * modulus.max())
        out.append(tuple(float(f) for f in frf.freq[index]))
    return tuple(out)
