"""Responses in time: histories and their spectra."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cutvib_ss.plot.style import CORRECTED, GREY, on_grid, unit_text
from cutvib_ss.results import FloatArray, TimeResponse

_COLUMNS = 1200
"""Columns of a long history: of each the lowest and the highest value are drawn."""
_CLOSE = 0.025
"""Length of the part that is shown close up [s]."""


def time_histories(response: TimeResponse, highest: float = 2000.0, title: str = "", *, ax: Any = None) -> Any:
    """
    Force and outputs: the whole history, its end close up, and its amplitude spectrum.

    Parameters
    ----------
    response : TimeResponse
        The response.
    highest : float
        Highest frequency of the spectra [Hz].
    title : str
        Title of the picture.
    ax : array of Axes, shape (1 + output, 3), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        The axes that were given, else the figure. A row for the force and for each output. Of one period of a steady
        state, several are drawn in place of the end.
    """
    shown = response.in_g()
    rows = np.vstack([shown.force, shown.data])
    names = ["force", *shown.outputs]
    units = [shown.force_unit, *shown.units]
    freq, lines = shown.spectrum()
    weight = TimeResponse(
        shown.force[None], shown.force, shown.fs, ("force",), (shown.force_unit,), shown.position, shown.periodic
    )
    lines = np.vstack([weight.spectrum()[1], lines])
    kept = freq <= min(highest, shown.fs / 2)
    height = 1.3 + 1.7 * len(rows)
    with on_grid(ax, len(rows), 3, 11.5, height, title, sharex="col", width_ratios=[1.4, 1.0, 1.2]) as grid:
        panels = grid.axes
        for k, (name, unit, values) in enumerate(zip(names, units, rows, strict=True)):
            whole, close, spectrum = panels[k]
            colour = CORRECTED if k else GREY
            _history(whole, shown.time, values, colour)
            if shown.periodic:
                many = np.tile(values, max(2, int(np.ceil(_CLOSE * shown.fs / values.size))))
                close.plot(np.arange(many.size) / shown.fs * 1e3, many, color=colour)
            else:
                first = max(0, values.size - round(_CLOSE * shown.fs))
                close.plot(shown.time[first:] * 1e3, values[first:], color=colour)
            _spectrum(spectrum, freq[kept], lines[k, kept], colour, shown.periodic)
            whole.set_ylabel(f"{name} [{unit_text(unit)}]")
            spectrum.set_ylabel(f"[{unit_text(unit)}]")
        for axes, label in zip(panels[-1], ("time [s]", "time [ms]", "frequency [Hz]"), strict=True):
            axes.set_xlabel(label)
        panels[0, 0].set_title("one period" if shown.periodic else "whole history")
        panels[0, 1].set_title("several periods" if shown.periodic else "its end")
        panels[0, 2].set_title("amplitude")
        panels[0, 2].set_xlim(0.0, min(highest, shown.fs / 2))
        grid.figure.align_ylabels(panels)
    return grid.drawn


def _history(axes: Axes, time: FloatArray, values: FloatArray, colour: str) -> None:
    width = values.size // _COLUMNS
    if width < 4:
        axes.plot(time, values, color=colour, linewidth=0.9)
    else:
        count = values.size // width
        columns = values[: count * width].reshape(count, width)
        axes.fill_between(
            time[: count * width : width], columns.min(axis=1), columns.max(axis=1), color=colour, linewidth=0.4
        )
    axes.set_xlim(time[0], time[-1])


def _spectrum(axes: Axes, freq: FloatArray, amplitude: FloatArray, colour: str, lines: bool) -> None:
    """Lines of a period as stems, others as a curve, over four decades at most."""
    top = float(amplitude[1:].max(initial=0.0)) or 1.0
    if lines:
        axes.vlines(freq[1:], top * 1e-5, amplitude[1:], color=colour, linewidth=1.6)
        axes.set_yscale("log")
    else:
        axes.semilogy(freq[1:], np.maximum(amplitude[1:], top * 1e-6), color=colour, linewidth=0.8)
    axes.set_ylim(top * 1e-4, top * 2.0)
