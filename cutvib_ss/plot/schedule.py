"""The machine over the whole rail: poles and natural frequencies against position, and the map of a response."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LogNorm, Normalize
from matplotlib.figure import Figure

from cutvib_ss.plot.style import GREY, POSITIONS, colour_bar, drawing, modulus_limits, unit_text
from cutvib_ss.results import FrequencyResponse, TrackedModes

_DAMPING_COLOURS = "viridis_r"
_MAP_COLOURS = "magma"


def pole_map(tracked: TrackedModes, highest: float | None = None, title: str = "") -> Figure:
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

    Returns
    -------
    Figure
        One axes.
    """
    shown = _below(tracked, highest)
    norm = Normalize(0.0, 1.0)
    with drawing(7.2, 4.2, title) as figure:
        axes = figure.subplots()
        for k in shown:
            freq, damping = tracked.natural_freq[:, k], 100 * tracked.damping_ratio[:, k]
            axes.plot(freq, damping, color=GREY, linewidth=0.5, zorder=1)
            axes.scatter(freq, damping, c=tracked.positions, cmap=POSITIONS, norm=norm, s=14, linewidth=0, zorder=2)
        axes.set_xlabel("natural frequency [Hz]")
        axes.set_ylabel("damping ratio [%]")
        axes.set_xlim(left=0.0)
        axes.set_ylim(bottom=0.0)
        colour_bar(figure, axes, POSITIONS, norm, "position y/L [-]")
    return figure


def schedule(tracked: TrackedModes, frf: FrequencyResponse | None = None, title: str = "") -> Figure:
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

    Returns
    -------
    Figure
        One or two axes that share the frequency axis.
    """
    highest = None if frf is None else float(frf.freq[-1])
    shown = _below(tracked, highest)
    with drawing(5.6 if frf is None else 10.4, 4.6, title) as figure:
        panels = figure.subplots(1, 1 if frf is None else 2, sharey=True, squeeze=False)[0]
        _frequencies(figure, panels[0], tracked, shown)
        if frf is not None:
            _map(figure, panels[1], frf)
            panels[0].set_ylim(frf.freq[0], frf.freq[-1])
    return figure


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
