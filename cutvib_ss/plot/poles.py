"""Poles: in the s-plane with lines of constant damping and frequency, and natural frequency and damping over the rail."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize

from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    GRID,
    INK,
    POSITIONS,
    WORKING_FREQUENCY,
    colour_bar,
    figure_of,
    on_axes,
    on_grid,
)
from cutvib_ss.results import Modes, TrackedModes

_RATIOS = (0.005, 0.01, 0.02, 0.03, 0.05, 0.1)


def s_plane(
    modes: Modes | TrackedModes, *, ax: Axes | None = None, highest: float | None = None, title: str = ""
) -> Axes:
    """
    Poles in the upper half of the s-plane, over lines of constant damping ratio; coloured by position where there are several.

    Parameters
    ----------
    modes : Modes or TrackedModes
        The modes.
    ax : Axes, optional
        Where to draw; a new figure by default.
    highest : float, optional
        Highest frequency shown [Hz]; all by default.
    title : str
        Title of the picture.

    Returns
    -------
    Axes
        Real part [1/s] against imaginary part as frequency [Hz].
    """
    poles = np.atleast_2d(modes.poles)
    top = 1.05 * (highest or float(poles.imag.max()) / (2 * np.pi))
    seen = (poles.imag > 0) & (poles.imag <= 2 * np.pi * top)
    left = 1.15 * float(poles.real[seen].min(initial=-1.0))
    with on_axes(ax, 6.4, 4.8, title) as axes:
        for ratio in _RATIOS:
            # p = ω(-ζ ± j√(1 - ζ²)): a straight line through the origin.
            slope = ratio / np.sqrt(1 - ratio**2)
            end = min(top, -left / (2 * np.pi * slope))
            axes.plot([0.0, -2 * np.pi * end * slope], [0.0, end], color=GRID, linewidth=0.8, zorder=0)
            axes.annotate(
                f"{100 * ratio:g} %", (-2 * np.pi * end * slope, end), color=GREY, fontsize=7, ha="left", va="bottom"
            )
        axes.axhline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=1.0)
        axes.annotate(f"{WORKING_FREQUENCY:g} Hz", (left, WORKING_FREQUENCY), color=GREY, fontsize=7, va="bottom")
        if isinstance(modes, TrackedModes):
            norm = Normalize(0.0, 1.0)
            for k in range(poles.shape[1]):
                there = seen[:, k]
                points = poles[there, k]
                axes.plot(points.real, points.imag / (2 * np.pi), color=GREY, linewidth=0.5, zorder=1)
                axes.scatter(
                    points.real, points.imag / (2 * np.pi), c=modes.positions[there], cmap=POSITIONS, norm=norm, s=12,
                    linewidth=0, zorder=2,
                )  # fmt: skip
            colour_bar(figure_of(axes), axes, POSITIONS, norm, "position y/L [-]")
        else:
            axes.plot(poles[seen].real, poles[seen].imag / (2 * np.pi), "x", color=CORRECTED, markersize=7)
        axes.axvline(0.0, color=INK, linewidth=0.8)
        axes.set(
            xlim=(left, -0.03 * left), ylim=(0.0, top), xlabel="real part [1/s]", ylabel="imaginary part / 2π [Hz]"
        )
        axes.grid(False)
    return axes


def poles_over_position(
    tracked: TrackedModes,
    *,
    ax: Sequence[Axes] | None = None,
    highest: float | None = None,
    title: str = "",
) -> np.ndarray:
    """
    Natural frequencies and damping ratios of every mode over the rail.

    Parameters
    ----------
    tracked : TrackedModes
        Modes followed over positions.
    ax : sequence of two Axes, optional
        Where to draw; a new figure by default.
    highest : float, optional
        Highest frequency shown [Hz]; all by default.
    title : str
        Title of the picture.

    Returns
    -------
    ndarray of Axes, shape (2,)
        Frequency [Hz], damping [%].
    """
    colours = ["#27426b", "#2a7f9e", "#5fae8b", "#d9a441", "#c8553d", "#6a4c93", INK, GREY]
    lowest = tracked.natural_freq.min(axis=0)
    with on_grid(ax, 1, 2, 9.6, 4.2, title) as grid:
        panels: np.ndarray = grid.axes[0]
        for k in np.flatnonzero(lowest <= (highest or np.inf)):
            colour = colours[k % len(colours)]
            panels[0].plot(tracked.positions, tracked.natural_freq[:, k], color=colour, label=f"mode {k + 1}")
            panels[1].plot(tracked.positions, 100 * tracked.damping_ratio[:, k], color=colour)
        panels[0].axhline(WORKING_FREQUENCY, color=GREY, linestyle=":", label=f"tool, {WORKING_FREQUENCY:g} Hz")
        panels[0].set(xlim=(0, 1), ylim=(0, highest), xlabel="position y/L [-]", ylabel="natural frequency [Hz]")
        panels[1].set(xlim=(0, 1), ylim=(0, None), xlabel="position y/L [-]", ylabel="damping ratio [%]")
        grid.legend(panels[0])
    return panels
