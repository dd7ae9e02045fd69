"""Figs. 15 to 20 of the paper, as far as its printed values allow: responses of the model, no measured curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import signal

from cutvib_ss.identification.first_guess import PAPER_PEAKS
from cutvib_ss.paper import PaperCurves
from cutvib_ss.paper.figures import FIG_16, FIG_20
from cutvib_ss.parameters import PAPER_POSITIONS
from cutvib_ss.plot.response import absorber_effect
from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    INK,
    MEASURED,
    NOMINAL,
    TUNED,
    WORKING_FREQUENCY,
    drawing,
    legend_beside,
)
from cutvib_ss.results import FrequencyResponse
from cutvib_ss.units import STANDARD_GRAVITY

_COLOURS = (CORRECTED, NOMINAL, TUNED, "#5fae8b")
_NOISE = 1e-3
"""Part of a response's largest value below which its phase says nothing."""


def figure_15(curves: PaperCurves) -> Figure:
    """Accelerances XX and ZX with the base held; of the measurement only the two peaks are printed."""
    with drawing(9.4, 3.6, "Fig. 15: responses with the base held (BR)") as figure:
        panels = figure.subplots(1, 2)
        for k, (axes, name) in enumerate(zip(panels, ("XX", "ZX"), strict=True)):
            for (table, frf), colour in zip(curves.held.items(), (MEASURED, CORRECTED), strict=True):
                axes.plot(frf.freq, np.abs(frf.data[0, k, 0]) / STANDARD_GRAVITY, color=colour, label=table)
            for j, peak in enumerate(PAPER_PEAKS[: 2 - k]):
                axes.axvline(
                    peak, color=INK, linestyle="--", linewidth=0.8, label="measured peak (printed)" if j == 0 else None
                )
            _finish(axes, next(iter(curves.held.values())), f"|{name}| [g/N]", name)
        legend_beside(panels[0], True)
    return figure


def figure_16(curves: PaperCurves) -> Figure:
    """Accelerances XX and ZX in different positions; CR and FR differ in nothing that the model knows."""
    frf = curves.positions
    with drawing(9.4, 3.6, "Fig. 16: responses in different positions") as figure:
        panels = figure.subplots(1, 2)
        for k, (axes, name) in enumerate(zip(panels, ("XX", "ZX"), strict=True)):
            for place, colour, data in zip(FIG_16, _COLOURS[:3], frf.data, strict=True):
                label = f"{place}, y/L = {PAPER_POSITIONS[place.split()[0]]:.3g}"
                axes.plot(frf.freq, np.abs(data[k, 0]) / STANDARD_GRAVITY, color=colour, label=label)
            _finish(axes, frf, f"|{name}| [g/N]", name)
        legend_beside(panels[0], True)
    return figure


def figure_17(curves: PaperCurves) -> Figure:
    """The rail's first four modes."""
    with drawing(5.2, 5.4, "Fig. 17: modes of the rail") as figure:
        panels = figure.subplots(4, 1, sharex=True)
        y = np.linspace(0.0, 1.0, len(curves.shapes))
        for r, axes in enumerate(panels):
            axes.plot(y, curves.shapes[:, r], color=CORRECTED)
            axes.axhline(0.0, color=GREY, linewidth=0.6)
            axes.set_ylabel(f"mode {r + 1}\n[kg$^{{-1/2}}$]")
        panels[-1].set(xlabel="y/L [-]", xlim=(0, 1))
    return figure


def figure_18(curves: PaperCurves) -> Figure:
    """Receptances of the modal coordinates; those with their node under the head are left out, and phases of nothing."""
    with drawing(9.4, 4.8, "Fig. 18: modal coordinates over the cutting force") as figure:
        panels = figure.subplots(2, 2, sharex=True, height_ratios=[2, 1])
        for column, (place, frf) in zip(panels.T, curves.modal.items(), strict=True):
            upper, lower = column
            for output, data in zip(frf.outputs, frf.data[0, :, 0], strict=True):
                colour = _COLOURS[int(output[3:]) - 1]
                upper.semilogy(frf.freq, np.abs(data), color=colour, label=f"$\\eta_{output[3:]}$")
                phase = np.degrees(np.unwrap(np.angle(data)))
                lower.plot(frf.freq, (phase + 360) % 360 - 360, ".", markersize=1.2, color=colour)
            still = [f"η{r}" for r in range(1, 5) if f"eta{r}" not in frf.outputs]
            upper.set_title(f"{place}, y/L = {PAPER_POSITIONS[place]:.3g}; not excited: {', '.join(still)}")
            upper.set_ylabel("receptance [kg$^{1/2}$ m/N]")
            lower.set(
                ylabel="phase [°]", xlabel="frequency [Hz]", yticks=[-360, -180, 0], xlim=(frf.freq[0], frf.freq[-1])
            )
            for axes in column:
                axes.axvline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=0.9)
            upper.legend(loc="upper right")
    return figure


def figure_19(curves: PaperCurves) -> Figure:
    """Accelerance of the base to the cutting force, CC, to 600 Hz: the fifth peak is beyond the paper's 300 Hz."""
    frf = curves.base
    size = np.abs(frf.data[0, 0, 0])
    peaks, _ = signal.find_peaks(size, prominence=_NOISE * size.max())
    with drawing(7.6, 3.8, "Fig. 19: base over cutting force, CC (y/L = 0.333)") as figure:
        axes = figure.subplots()
        axes.semilogy(frf.freq, size, color=CORRECTED)
        for n, k in enumerate(peaks, start=1):
            text = f"{n}: {frf.freq[k]:.0f} Hz"
            axes.annotate(
                text, (frf.freq[k], size[k]), xytext=(0, 5), textcoords="offset points", ha="center", fontsize=8
            )
        axes.set_ylim(size.max() * 1e-4, size.max() * 2.0)
        _finish(axes, frf, "accelerance [(m/s²)/N]", "", linear=False)
        axes.legend(loc="lower right")
    return figure


def figure_20(curves: PaperCurves) -> Figure:
    """Accelerance XX without and with Table 7's absorber, in central and lateral position."""
    names = []
    for place in FIG_20:
        said = "assumed" if place.endswith("R") else "stated"
        names.append(
            f"{'lateral' if place.endswith('R') else 'central'} ({place}), y/L = {PAPER_POSITIONS[place]:.3g} {said}"
        )
    drawn: Figure = absorber_effect(curves.absorber, names)
    return drawn


FIGURES: dict[str, Callable[[PaperCurves], Figure]] = {
    "figure_15": figure_15,
    "figure_16": figure_16,
    "figure_17": figure_17,
    "figure_18": figure_18,
    "figure_19": figure_19,
    "figure_20": figure_20,
}
"""The figures by the names of their files."""


def _finish(axes: Axes, frf: FrequencyResponse, label: str, title: str, linear: bool = True) -> None:
    axes.axvline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=1.0, label=f"tool, {WORKING_FREQUENCY:g} Hz")
    axes.set(xlim=(frf.freq[0], frf.freq[-1]), xlabel="frequency [Hz]", ylabel=label)
    if title:
        axes.set_title(title)
    if linear:
        axes.set_ylim(bottom=0.0)
