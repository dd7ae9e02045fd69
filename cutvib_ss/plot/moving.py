"""Responses of a head that travels."""

from __future__ import annotations

from typing import Any

import numpy as np

from cutvib_ss.plot.style import CORRECTED, GREY, on_grid
from cutvib_ss.results import MovingResponse

_COLUMNS = 240
"""Columns of a history: of each the lowest and the highest value are drawn."""


def travel_histories(response: MovingResponse, title: str = "", *, ax: Any = None) -> Any:
    """
    The head's path, and what the outputs do on the way.

    Parameters
    ----------
    response : MovingResponse
        The response.
    title : str
        Title of the picture.
    ax : sequence of Axes, one for the path and one an output, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or sequence of Axes
        The axes that were given, else the figure. An axes for the path, then one for each output: its lowest and highest
        values, and its RMS between.
    """
    n = len(response.outputs)
    heights = [0.7] + [1.0] * n
    with on_grid(ax, n + 1, 1, 8.2, 1.6 + 1.9 * n, title, sharex=True, height_ratios=heights) as grid:
        panels = grid.axes[:, 0]
        panels[0].plot(response.time, response.path, color=GREY)
        panels[0].set_ylabel("position y/L [-]")
        width = max(1, response.time.size // _COLUMNS)
        count = response.time.size // width
        time = response.time[: count * width : width]
        for axes, name, unit, data in zip(panels[1:], response.outputs, response.units, response.data, strict=True):
            columns = data[: count * width].reshape(count, width)
            low, high = columns.min(axis=1), columns.max(axis=1)
            axes.fill_between(time, low, high, color=CORRECTED, alpha=0.35, linewidth=0, step="mid")
            axes.plot(time, np.sqrt(_smooth(np.mean(columns**2, axis=1))), color=CORRECTED, label="RMS")
            axes.set_ylabel(f"{name} [{unit.replace('^2', '²')}]")
        panels[-1].set_xlabel("time [s]")
        panels[-1].legend(loc="upper right")
        panels[-1].set_xlim(0.0, response.time[-1])
    return grid.drawn


def _smooth(values: np.ndarray) -> np.ndarray:
    """Moving mean over a fortieth of the record."""
    width = max(1, values.size // 40)
    weights = np.ones(width)
    return np.convolve(values, weights, "same") / np.convolve(np.ones(values.size), weights, "same")
