"""Bode plots, and what an absorber does to a response."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    NOMINAL,
    drawing,
    legend_outside,
    modulus_limits,
    position_colours,
    position_name,
    unit_text,
)
from cutvib_ss.results import AbsorberCheck, FrequencyResponse

FORM_OF_QUANTITY = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
"""What the response of each motion quantity to a force is called."""


def bode(frf: FrequencyResponse, input: str | None = None, title: str = "") -> Figure:
    """
    Magnitude and phase of every output over frequency, a curve for each position.

    Parameters
    ----------
    frf : FrequencyResponse
        The response.
    input : str, optional
        Which input; the first by default.
    title : str
        Title of the picture.

    Returns
    -------
    Figure
        A column of two axes for each output.
    """
    shown = frf.sel(input=frf.inputs[0] if input is None else input)
    n = len(shown.outputs)
    with drawing(1.6 + 4.2 * n, 5.2, title) as figure:
        axes = figure.subplots(2, n, sharex=True, squeeze=False, height_ratios=[2, 1])
        colours = position_colours(shown.positions.tolist())
        for k, (output, unit, quantity) in enumerate(zip(shown.outputs, shown.units, shown.quantities, strict=True)):
            upper, lower = axes[0, k], axes[1, k]
            for position, colour, data in zip(shown.positions, colours, shown.data[:, k, 0], strict=True):
                name = position_name(float(position))
                upper.semilogy(shown.freq, np.abs(data), color=colour, label=name)
                lower.plot(shown.freq, _phase(data), color=colour)
            form = FORM_OF_QUANTITY[quantity] if shown.input_unit == "N" else "transmissibility"
            upper.set_title(f"{output} / {shown.inputs[0]}")
            upper.set_ylabel(f"{form} [{unit_text(unit)}]")
            upper.set_ylim(*modulus_limits(np.abs(shown.data[:, k])))
            lower.set_ylabel("phase [°]")
            lower.set_yticks([-180, -90, 0, 90, 180])
            lower.set_ylim(-190, 190)
            lower.set_xlabel("frequency [Hz]")
            lower.set_xlim(shown.freq[0], shown.freq[-1])
        if not np.isnan(shown.positions).all():
            legend_outside(figure, axes[0, 0], title="head at")
    return figure


def absorber_effect(check: AbsorberCheck) -> Figure:
    """
    Driving-point accelerance without and with an absorber, one panel a position (Fig. 20).

    Parameters
    ----------
    check : AbsorberCheck
        What the absorber does.

    Returns
    -------
    Figure
        One panel for each position.
    """
    n = check.positions.size
    absorber = check.absorber
    title = f"Absorber of {absorber.mass:g} kg at {absorber.frequency:g} Hz, damping ratio {absorber.damping_ratio:g}"
    with drawing(1.8 + 3.4 * n, 3.6, title) as figure:
        panels = figure.subplots(1, n, sharey=True, squeeze=False)[0]
        top = 1.08 * max(float(np.abs(f.data).max()) for f in (check.frf_before, check.frf_after))
        for k, axes in enumerate(panels):
            for frf, colour, label in (
                (check.frf_before, NOMINAL, "without absorber"),
                (check.frf_after, CORRECTED, "with absorber"),
            ):
                axes.plot(frf.freq, np.abs(frf.data[k, 0, 0]), color=colour, label=label)
            axes.axvline(
                check.working_frequency, color=GREY, linestyle=":", label=f"tool, {check.working_frequency:g} Hz"
            )
            axes.set_title(position_name(float(check.positions[k])))
            axes.set_xlabel("frequency [Hz]")
            axes.set_xlim(check.frf_before.freq[0], check.frf_before.freq[-1])
            axes.set_ylim(0.0, top)
        panels[0].set_ylabel(f"accelerance XX [{unit_text(check.frf_before.unit)}]")
        legend_outside(figure, panels[0])
    return figure


def _phase(data: np.ndarray) -> np.ndarray:
    """Phase [°], broken where it jumps from one end of the axis to the other."""
    phase = np.degrees(np.angle(data))
    broken: np.ndarray = np.where(np.abs(np.diff(phase, prepend=phase[:1])) > 270.0, np.nan, phase)
    return broken
