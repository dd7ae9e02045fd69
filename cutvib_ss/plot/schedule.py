"""The machine over the whole rail: poles and natural frequencies against position, and the map of a response."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from cutvib_ss.plot.style import (
    GREY,
    INK,
    NOMINAL,
    POSITIONS,
    WORKING_FREQUENCY,
    colour_bar,
    figure_of,
    legend_beside,
    modulus_limits,
    on_axes,
    on_grid,
    unit_text,
)
from cutvib_ss.results import FrequencyResponse, TrackedModes

_DAMPING_COLOURS = "viridis_r"
_MAP_COLOURS = "magma"
_PHASE_COLOURS = "twilight"


def pole_map(tracked: TrackedModes, highest: float | None = None, title: str = "", *, ax: Axes | None = None) -> Axes:
    """
    Damping ratio against natural frequency, each mode's way as the head travels, coloured by position.

    Parameters
    ----------
    tracked : TrackedModes
        Modes followed over positions.
    highest : float, optional
        Highest frequency shown [Hz]; all by default.
    title : str
        Title of the picture.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        One axes.
    """
    shown = _below(tracked, highest)
    norm = Normalize(0.0, 1.0)
    with on_axes(ax, 7.2, 4.2, title) as axes:
        for k in shown:
            freq, damping = tracked.natural_freq[:, k], 100 * tracked.damping_ratio[:, k]
            axes.plot(freq, damping, color=GREY, linewidth=0.5, zorder=1)
            axes.scatter(freq, damping, c=tracked.positions, cmap=POSITIONS, norm=norm, s=14, linewidth=0, zorder=2)
        axes.set_xlabel("natural frequency [Hz]")
        axes.set_ylabel("damping ratio [%]")
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        axes.axvline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=1.0)
        axes.annotate(
            f"{WORKING_FREQUENCY:g} Hz", (WORKING_FREQUENCY, 0.0), color=GREY, fontsize=7, ha="left", va="bottom"
        )
        colour_bar(figure_of(axes), axes, POSITIONS, norm, "position y/L [-]")
    return axes


def schedule(
    tracked: TrackedModes,
    frf: FrequencyResponse | None = None,
    title: str = "",
    marks: Sequence[float] = (WORKING_FREQUENCY,),
    *,
    ax: Any = None,
) -> Any:
    """
    Natural frequencies over the rail, coloured by damping; beside them the map of a response over the rail.

    Parameters
    ----------
    tracked : TrackedModes
        Modes followed over positions.
    frf : FrequencyResponse, optional
        Response over positions; its first output and input are mapped, over its frequencies.
    title : str
        Title of the picture.
    marks : sequence of float
        Frequencies to mark [Hz]: the tool's, by default its fundamental.
    ax : Axes, or sequence of two with a response, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure, Axes or sequence of Axes
        One or two axes that share the frequency axis; the axes that were given, else the figure.
    """
    highest = None if frf is None else float(frf.freq[-1])
    shown = _below(tracked, highest)
    with on_grid(ax, 1, 1 if frf is None else 2, 5.6 if frf is None else 10.4, 4.6, title, sharey=True) as grid:
        panels, figure = grid.axes[0], grid.figure
        _frequencies(figure, panels[0], tracked, shown)
        if frf is not None:
            _map(figure, panels[1], frf)
            panels[0].set_ylim(frf.freq[0], frf.freq[-1])
        for axes in panels:
            for mark in marks:
                axes.axhline(mark, color=NOMINAL, linestyle=":", linewidth=1.0)
    return grid.drawn


def bode_map(frf: FrequencyResponse, input: str | None = None, title: str = "", *, ax: Any = None) -> Any:
    """
    Magnitude and phase of every output over position and frequency.

    Parameters
    ----------
    frf : FrequencyResponse
        Response over positions.
    input : str, optional
        Which input; the first by default.
    title : str
        Title of the picture.
    ax : array of Axes, shape (2, output), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        Two axes for each output, magnitude above phase; the axes that were given, else the figure.
    """
    shown = frf.sel(input=frf.inputs[0] if input is None else input)
    n = len(shown.outputs)
    with on_grid(ax, 2, n, 1.4 + 4.0 * n, 7.0, title, sharex=True, sharey=True) as grid:
        panels, figure = grid.axes, grid.figure
        turn = Normalize(-180.0, 180.0)
        for k, name in enumerate(shown.outputs):
            _map(figure, panels[0, k], shown.sel(output=name))
            phase = np.degrees(np.angle(shown.data[:, k, 0]))
            panels[1, k].pcolormesh(
                shown.positions, shown.freq, phase.T, cmap=_PHASE_COLOURS, norm=turn, shading="nearest", rasterized=True
            )
            panels[1, k].grid(False)
            panels[0, k].set_xlabel("")
            panels[1, k].set_xlabel("position y/L [-]")
            colour_bar(figure, panels[1, k], _PHASE_COLOURS, turn, "phase [°]")
        for axes in panels[:, 0]:
            axes.set_ylabel("frequency [Hz]")
    return grid.drawn


def interpolation_error(
    freq: ArrayLike,
    response: ArrayLike,
    error: ArrayLike,
    bound: ArrayLike,
    unit: str,
    title: str = "",
    *,
    ax: Axes | None = None,
) -> Axes:
    """
    What a table over positions makes of a response: largest response, error and bound over positions, against frequency.

    Parameters
    ----------
    freq : array_like, shape (frequency,)
        Frequencies [Hz].
    response, error, bound : array_like, shape (position, frequency)
        Moduli of the exact response, of the table's error, and of its bound.
    unit : str
        Unit of all three.
    title : str
        Title of the picture.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        One axes.
    """
    with on_axes(ax, 7.6, 4.0, title) as axes:
        for values, colour, label in (
            (response, INK, "response"),
            (bound, GREY, "bound on the error"),
            (error, NOMINAL, "error"),
        ):
            largest = np.asarray(values).max(axis=0)
            axes.semilogy(freq, np.where(np.isfinite(largest), largest, np.nan), color=colour, label=label)
        axes.set(xlabel="frequency [Hz]", ylabel=f"largest over positions [{unit_text(unit)}]")
        axes.set_xlim(np.min(freq), np.max(freq))
        legend_beside(axes, ax is None)
    return axes


def _below(tracked: TrackedModes, highest: float | None) -> list[int]:
    lowest = tracked.natural_freq.min(axis=0)
    return [k for k in range(lowest.size) if highest is None or lowest[k] <= highest]


def _frequencies(figure: Figure, axes: Axes, tracked: TrackedModes, shown: list[int]) -> None:
    damping = 100 * tracked.damping_ratio[:, shown]
    norm = Normalize(0.0, max(float(damping.max()), 1e-6))
    for k, ratio in zip(shown, damping.T, strict=True):
        points = np.column_stack([tracked.positions, tracked.natural_freq[:, k]])
        pieces = list(np.stack([points[:-1], points[1:]], axis=1))
        lines = LineCollection(pieces, cmap=_DAMPING_COLOURS, norm=norm, linewidth=2.2)
        lines.set_array((ratio[:-1] + ratio[1:]) / 2)
        axes.add_collection(lines)
    axes.autoscale_view()
    axes.set(xlim=(0.0, 1.0), xlabel="position y/L [-]", ylabel="natural frequency [Hz]", title="Natural frequencies")
    colour_bar(figure, axes, _DAMPING_COLOURS, norm, "damping ratio [%]")


def _map(figure: Figure, axes: Axes, frf: FrequencyResponse) -> None:
    modulus = np.abs(frf.data[:, 0, 0])
    norm = LogNorm(*modulus_limits(modulus, 3.0))
    axes.pcolormesh(
        frf.positions, frf.freq, modulus.T, cmap=_MAP_COLOURS, norm=norm, shading="nearest", rasterized=True
    )
    axes.set(xlim=(0.0, 1.0), xlabel="position y/L [-]", title=f"{frf.outputs[0]} / {frf.inputs[0]}")
    axes.grid(False)
    colour_bar(figure, axes, _MAP_COLOURS, norm, f"modulus [{unit_text(frf.units[0])}]")
