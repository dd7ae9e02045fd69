"""A picture of the free dynamic stiffness at a place: what to look at before believing a cause."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cutvib_ss.diagnosis.element_type import element_type_value
from cutvib_ss.diagnosis.findings import DynamicStiffness
from cutvib_ss.plot.style import CORRECTED, INK, NOMINAL, TUNED, on_grid, unit_text
from cutvib_ss.results import FloatArray

_LEVELS = (CORRECTED, TUNED, NOMINAL)
_SEEN = 0.6
"""Part of the lines, those of least uncertainty, that set the limits of an axis."""


def stiffness_grid(functions: Sequence[DynamicStiffness], *, ax: Any = None) -> Any:
    """
    Unknown dynamic stiffnesses over frequency, real beside imaginary part, with the law that their shape suggests.

    Parameters
    ----------
    functions : sequence of DynamicStiffness
        Those of a diagnosis, ``diagnosis.findings.stiffness``.
    ax : array of Axes, shape (function, 2), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        The axes that were given, else the figure.
    """
    with on_grid(ax, len(functions), 2, 9.6, 0.5 + 2.2 * len(functions), sharex=True) as grid:
        panels = grid.axes
        for row, z in zip(panels, functions, strict=True):
            unit = f" [{unit_text(z.unit)}]" if z.unit not in ("", "1") else ""
            for axes, part in zip(row, ("real", "imag"), strict=True):
                _part(axes, z, part)
                axes.set_title("" if part == "imag" else z.place if z.label == z.place else f"{z.place}: {z.label}")
                axes.set_ylabel(f"{'real' if part == 'real' else 'imaginary'} part{unit}")
        for axes in panels[-1]:
            axes.set_xlabel("frequency [Hz]")
        panels[0, 0].set_xlim(functions[0].freq[0], functions[0].freq[-1])
        handles, labels = panels[0, 0].get_legend_handles_labels()
        if len(labels) > 1:
            grid.legend(panels[0, 0], "outside upper right", ncols=len(handles))
    return grid.drawn


def _part(axes: Axes, z: DynamicStiffness, part: str) -> None:
    axes.axhline(0.0, color=INK, lw=0.6)
    for k, level in enumerate(z.levels):
        value, std = getattr(z.value[k], part), z.std[k]
        colour = _LEVELS[min(k * len(_LEVELS) // max(len(z.levels), 1), len(_LEVELS) - 1)]
        label = "the records ask for" if level is None else f"at {level:.3g} N"
        axes.fill_between(z.freq, value - std, value + std, color=colour, alpha=0.25, lw=0)
        axes.plot(z.freq, value, ".", ms=2.2, color=colour, label=label)
    if z.element_type is not None and len(z.levels) == 1:
        law = getattr(element_type_value(z.element_type, z.quantity, z.freq), part)
        axes.plot(z.freq, law, color=NOMINAL, lw=1.2, label=f"{z.element_type.name}, {z.element_type.law}")
    axes.set_ylim(*_limits(getattr(z.value, part), z.std))


def _limits(values: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Limits that hold what is well known, and zero."""
    known = std <= np.quantile(std, _SEEN)
    low, high = np.quantile(values[known], [0.01, 0.99])
    room = 0.25 * max(float(high - low), float(np.median(std[known])), 1e-300)
    return min(float(low) - room, 0.0 - room), max(float(high) + room, room)
