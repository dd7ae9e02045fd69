"""Pictures of a diagnosis: measured beside computed, where the error stands out of the noise, the likely causes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.ticker import NullLocator

from cutvib_ss.diagnosis.result import Cause, Comparison
from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    INK,
    MEASURED,
    NOMINAL,
    TUNED,
    colour_bar,
    modulus_limits,
    on_grid,
    position_name,
    scale_of,
)
from cutvib_ss.results import FloatArray

_LINES = 260
"""Bands of frequency in an error map: finer ones would only show the estimator's scatter."""


def comparison_grid(comparisons: Sequence[Comparison], channels: Sequence[str] | None = None, *, ax: Any = None) -> Any:
    """
    Measured FRF, nominal and corrected model: a row for each comparison, a column for each channel.

    Parameters
    ----------
    comparisons : sequence of Comparison
        What to show.
    channels : sequence of str, optional
        Which channels; all of the first comparison by default.
    ax : array of Axes, shape (comparison, channel), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        Moduli on logarithmic axes, the measurement's noise dotted; the axes that were given, else the figure.
    """
    names = list(comparisons[0].measured.outputs if channels is None else channels)
    rows, columns = len(comparisons), len(names)
    with on_grid(ax, rows, columns, 0.9 + 3.3 * columns, 0.7 + 1.75 * rows, sharex=True, sharey="col") as grid:
        panels = grid.axes
        for r, comparison in enumerate(comparisons):
            for c, name in enumerate(names):
                if name in comparison.measured.outputs:
                    _compare(panels[r, c], comparison, name)
                else:
                    panels[r, c].set_axis_off()
                if r == 0:
                    panels[r, c].set_title(name)
            position = float(comparison.measured.positions[0])
            panels[r, 0].set_ylabel(
                f"{position_name(position, comparison.label)}\n[{scale_of(comparison.measured.units[0])[1]}]"
            )
        for axes in panels[-1]:
            axes.set_xlabel("frequency [Hz]")
        freq = comparisons[0].measured.freq
        panels[0, 0].set_xlim(freq[0], freq[-1])
        for c, name in enumerate(names):
            shown = [x.measured.sel(output=name) for x in comparisons if name in x.measured.outputs]
            moduli = np.concatenate([scale_of(frf.unit)[0] * np.abs(frf.data).ravel() for frf in shown])
            panels[0, c].set_ylim(*modulus_limits(moduli, 3.2))
        for axes in panels.flat:
            # Fifteen panels of minor ticks cost more to draw than the curves do.
            axes.yaxis.set_minor_locator(NullLocator())
        # five names in a row are wider than one or two panels
        grid.legend(panels[0, 0], "outside upper left", ncols=min(2 * columns - 1, 5))
    return grid.drawn


def _compare(axes: Axes, comparison: Comparison, channel: str) -> None:
    measured = comparison.measured.sel(output=channel)
    scale, _ = scale_of(measured.unit)
    noise = scale * np.sqrt(measured.variance[0, 0, 0])
    axes.semilogy(measured.freq, scale * np.abs(measured.data[0, 0, 0]), color=MEASURED, lw=2.2, label="measured")
    for model, colour, style, width, label in (
        (comparison.nominal, NOMINAL, (0, (4, 1.5)), 1.0, "nominal model"),
        (comparison.tuned, TUNED, (0, (1.2, 1.2)), 1.3, "re-tuned model"),
        (comparison.corrected, CORRECTED, "-", 1.1, "corrected model"),
    ):
        data = model.sel(output=channel).data[0, 0, 0]
        axes.semilogy(model.freq, scale * np.abs(data), color=colour, linestyle=style, lw=width, label=label)
    axes.semilogy(measured.freq, noise, color=INK, lw=0.7, linestyle=":", label="noise of the measurement")


def error_map(comparisons: Sequence[Comparison], which: str = "tuned", *, ax: Any = None) -> Any:
    """
    Error over position and frequency, as a multiple of the noise, one panel a channel.

    Parameters
    ----------
    comparisons : sequence of Comparison
        One or more a position.
    which : {"nominal", "tuned", "corrected"}
        Whose error.
    ax : sequence of Axes, one a channel, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or sequence of Axes
        Panels that share their colours, 1 is noise; the axes that were given, else the figure.
    """
    channels = list(dict.fromkeys(name for c in comparisons for name in c.measured.outputs))
    freq = comparisons[0].measured.freq
    edges = np.linspace(freq[0], freq[-1], min(_LINES, freq.size) + 1)
    rows = _rows(comparisons)
    height = 0.8 + len(channels) * (0.75 + 0.17 * len(rows))
    with on_grid(ax, len(channels), 1, 9.6, height, sharex=True) as grid:
        panels = grid.axes[:, 0]
        norm = LogNorm(1.0, 100.0)
        for axes, channel in zip(panels, channels, strict=True):
            ratios = [error_over_noise(members, which, channel, edges) for members in rows.values()]
            axes.pcolormesh(
                edges, np.arange(len(rows) + 1), np.array(ratios), cmap="YlOrRd", norm=norm, rasterized=True
            )
            axes.set_yticks(np.arange(len(rows)) + 0.5, list(rows))
            axes.invert_yaxis()
            axes.set_title(channel)
            axes.set_ylabel("y/L" if not np.isnan(comparisons[0].measured.positions[0]) else "record")
            axes.grid(False)
        panels[-1].set_xlabel("frequency [Hz]")
        colour_bar(grid.figure, list(panels), "YlOrRd", norm, "error / noise [-]")
    return grid.drawn


def _rows(comparisons: Sequence[Comparison]) -> dict[str, list[Comparison]]:
    """Comparisons by position, or one by one where there is none."""
    rows: dict[float | str, list[Comparison]] = {}
    for comparison in comparisons:
        position = float(comparison.measured.positions[0])
        rows.setdefault(comparison.label if np.isnan(position) else position, []).append(comparison)
    if all(isinstance(key, float) for key in rows):
        return {f"{key:.3g}": rows[key] for key in sorted(rows, key=float)}
    return {str(key): members for key, members in rows.items()}


def error_over_noise(comparisons: Sequence[Comparison], which: str, channel: str, edges: FloatArray) -> FloatArray:
    """Root mean square of error over noise in bands of frequency."""
    total, count = np.zeros(edges.size - 1), np.zeros(edges.size - 1)
    for comparison in comparisons:
        if channel not in comparison.measured.outputs:
            continue
        measured = comparison.measured.sel(output=channel)
        model = getattr(comparison, which).sel(output=channel)
        squared = np.abs(model.data - measured.data)[0, 0, 0] ** 2 / measured.variance[0, 0, 0]
        band = np.clip(np.searchsorted(edges, measured.freq, side="right") - 1, 0, total.size - 1)
        total += np.bincount(band, squared, minlength=total.size)
        count += np.bincount(band, minlength=total.size)
    out: FloatArray = np.sqrt(np.divide(total, count, out=np.full(total.size, np.nan), where=count > 0))
    return out


def cause_bars(causes: Sequence[Cause], names: Sequence[str], highest: int = 6, *, ax: Axes | None = None) -> Any:
    """
    Probabilities of the causes as bars, the most probable on top.

    Parameters
    ----------
    causes : sequence of Cause
        Causes, most probable first.
    names : sequence of str
        What to call each.
    highest : int
        How many to show; the others are summed up in one bar.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or Axes
        The axes that were given, else the figure.
    """
    values = [c.probability for c in causes[:highest]]
    labels = list(names[:highest])
    if len(causes) > highest:
        values.append(sum(c.probability for c in causes[highest:]))
        labels.append(f"{len(causes) - highest} more")
    with on_grid(ax, 1, 1, 7.2, 0.6 + 0.34 * len(values)) as grid:
        axes = grid.axes[0, 0]
        rows = np.arange(len(values))
        axes.barh(rows, values, color=[CORRECTED] + [GREY] * (len(values) - 1), height=0.62)
        for row, value in enumerate(values):
            axes.text(value + 0.01, row, probability_text(value), va="center", color=INK, fontsize=8.5)
        axes.set_yticks(rows, labels)
        axes.invert_yaxis()
        axes.set_xlim(0.0, 1.1)
        axes.set_xticks(np.linspace(0.0, 1.0, 6))
        axes.set_xlabel("probability [-]")
        axes.grid(axis="y", visible=False)
    return grid.drawn


def probability_text(value: float) -> str:
    """
    A probability for reading: no more digits than it deserves, and never a certainty.

    >>> [probability_text(p) for p in (1.0, 0.973, 0.04, 1e-9)]
    ['> 99.9 %', '97 %', '4.0 %', '< 0.1 %']
    """
    if value > 0.999:
        return "> 99.9 %"
    if value < 0.001:
        return "< 0.1 %"
    return f"{100 * value:.1f} %" if value < 0.1 or value > 0.99 else f"{100 * value:.0f} %"
