"""Bode plots, and what an absorber does to a response."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cutvib_ss.identification import IdentificationResult
from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    MEASURED,
    NOMINAL,
    WORKING_FREQUENCY,
    modulus_limits,
    on_axes,
    on_grid,
    position_colours,
    position_name,
    unit_text,
)
from cutvib_ss.results import AbsorberCheck, FrequencyResponse

_DASHES = ("-", "--", "-.", ":")
FORM_OF_QUANTITY = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}
"""What the response of each motion quantity to a force is called."""


def bode(frf: FrequencyResponse, input: str | None = None, title: str = "", *, ax: Any = None) -> Any:
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
    ax : array of Axes, shape (2, output), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        A column of two axes for each output; the axes that were given, else the figure.
    """
    shown = frf.sel(input=frf.inputs[0] if input is None else input)
    n = len(shown.outputs)
    with on_grid(ax, 2, n, 1.6 + 4.2 * n, 5.2, title, sharex=True, height_ratios=[2, 1]) as panels:
        axes = panels.axes
        colours = position_colours(shown.positions.tolist())
        for k, (output, unit) in enumerate(zip(shown.outputs, shown.units, strict=True)):
            upper, lower = axes[0, k], axes[1, k]
            for position, colour, data in zip(shown.positions, colours, shown.data[:, k, 0], strict=True):
                name = position_name(float(position))
                upper.semilogy(shown.freq, np.abs(data), color=colour, label=name)
                lower.plot(shown.freq, _phase(data), color=colour)
            form = _form(shown, k)
            upper.set_title(f"{output} / {shown.inputs[0]}")
            upper.set_ylabel(f"{form} [{unit_text(unit)}]")
            upper.set_ylim(*modulus_limits(np.abs(shown.data[:, k])))
            lower.set_ylabel("phase [°]")
            lower.set_yticks([-180, -90, 0, 90, 180])
            lower.set_ylim(-190, 190)
            lower.set_xlabel("frequency [Hz]")
            lower.set_xlim(shown.freq[0], shown.freq[-1])
            if shown.freq[0] < WORKING_FREQUENCY < shown.freq[-1]:
                for axes_ in (upper, lower):
                    axes_.axvline(WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=0.9)
        if not np.isnan(shown.positions).all():
            panels.legend(axes[0, 0], title="head at")
    return panels.drawn


def magnitude(
    frf: FrequencyResponse,
    *,
    ax: Axes | None = None,
    logarithmic: bool = True,
    mark: float | None = WORKING_FREQUENCY,
    title: str = "",
) -> Axes:
    """
    Moduli of responses over frequency in one axes, a curve for each position, output and input.

    Parameters
    ----------
    frf : FrequencyResponse
        The responses, all of one unit.
    ax : Axes, optional
        Where to draw; a new figure by default.
    logarithmic : bool
        Whether the modulus is on a logarithmic axis.
    mark : float, optional
        Frequency to mark [Hz]; the tool's by default.
    title : str
        Title of the picture.

    Returns
    -------
    Axes
        The axes.
    """
    with on_axes(ax, 7.2, 4.0, title) as axes:
        for position, colour, block in zip(
            frf.positions, position_colours(frf.positions.tolist()), frf.data, strict=True
        ):
            for o, (output, rows) in enumerate(zip(frf.outputs, block, strict=True)):
                for input, data in zip(frf.inputs, rows, strict=True):
                    parts = [position_name(float(position))] * (frf.positions.size > 1)
                    parts += [f"{output} / {input}"] * (len(frf.outputs) * len(frf.inputs) > 1)
                    axes.plot(frf.freq, np.abs(data), _DASHES[o % len(_DASHES)], color=colour, label=", ".join(parts))
        if logarithmic:
            axes.set_yscale("log")
            axes.set_ylim(*modulus_limits(np.abs(frf.data)))
        if mark is not None and frf.freq[0] <= mark <= frf.freq[-1]:
            axes.axvline(mark, color=GREY, linestyle=":", linewidth=1.0, label=f"tool, {mark:g} Hz")
        form = _form(frf, 0)
        axes.set(xlim=(frf.freq[0], frf.freq[-1]), xlabel="frequency [Hz]", ylabel=f"{form} [{unit_text(frf.unit)}]")
        if len(axes.lines) > 2:
            axes.legend()
    return axes


def nyquist(
    frf: FrequencyResponse, *, ax: Axes | None = None, mark: float | None = WORKING_FREQUENCY, title: str = ""
) -> Axes:
    """
    Imaginary against real part of responses in one axes, a curve for each position, output and input.

    Parameters
    ----------
    frf : FrequencyResponse
        The responses, all of one unit. A resonance draws a circle; lines should be dense there.
    ax : Axes, optional
        Where to draw; a new figure by default.
    mark : float, optional
        Frequency whose line is marked by a dot [Hz]; the tool's by default.
    title : str
        Title of the picture.

    Returns
    -------
    Axes
        The axes, both directions on one scale.
    """
    with on_axes(ax, 5.6, 5.2, title) as axes:
        for position, colour, block in zip(
            frf.positions, position_colours(frf.positions.tolist()), frf.data, strict=True
        ):
            for o, rows in enumerate(block):
                for i, data in enumerate(rows):
                    parts = [position_name(float(position), "response")]
                    parts += [f"{frf.outputs[o]} / {frf.inputs[i]}"] * (len(frf.outputs) * len(frf.inputs) > 1)
                    axes.plot(data.real, data.imag, _DASHES[o % len(_DASHES)], color=colour, label=", ".join(parts))
                    if mark is not None and frf.freq[0] <= mark <= frf.freq[-1]:
                        at = data[int(np.abs(frf.freq - mark).argmin())]
                        axes.plot(at.real, at.imag, "o", color=colour, markersize=5)
        if mark is not None and frf.freq[0] <= mark <= frf.freq[-1]:
            axes.plot([], [], "o", color=GREY, markersize=5, label=f"tool, {mark:g} Hz")
        form, unit = _form(frf, 0), unit_text(frf.unit)
        axes.axhline(0.0, color=GREY, linewidth=0.6)
        axes.axvline(0.0, color=GREY, linewidth=0.6)
        axes.set(xlabel=f"{form}, real part [{unit}]", ylabel=f"imaginary part [{unit}]")
        axes.set_aspect("equal", adjustable="datalim")
        axes.legend()
    return axes


def absorber_effect(check: AbsorberCheck, names: Sequence[str] | None = None, *, ax: Any = None) -> Any:
    """
    Driving-point accelerance without and with an absorber, one panel a position (Fig. 20).

    Parameters
    ----------
    check : AbsorberCheck
        What the absorber does.
    names : sequence of str, optional
        What the positions are called; y/L by default.
    ax : sequence of Axes, one a position, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or sequence of Axes
        One panel for each position; the axes that were given, else the figure.
    """
    n = check.positions.size
    absorber = check.absorber
    title = f"Absorber of {absorber.mass:g} kg at {absorber.frequency:g} Hz, damping ratio {absorber.damping_ratio:g}"
    with on_grid(ax, 1, n, 1.8 + 3.4 * n, 3.6, title, sharey=True) as grid:
        panels = grid.axes[0]
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
            axes.set_title(position_name(float(check.positions[k])) if names is None else names[k])
            axes.set_xlabel("frequency [Hz]")
            axes.set_xlim(check.frf_before.freq[0], check.frf_before.freq[-1])
            axes.set_ylim(0.0, top)
        panels[0].set_ylabel(f"accelerance XX [{unit_text(check.frf_before.unit)}]")
        grid.legend(panels[0])
    return grid.drawn


def fitted_response(result: IdentificationResult, *, title: str = "", ax: Any = None) -> Any:
    """
    Measured and fitted responses XX and ZX of an identification (Fig. 15).

    Parameters
    ----------
    result : IdentificationResult
        The identification.
    title : str
        Title of the picture.
    ax : sequence of Axes, one an output, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or sequence of Axes
        One panel for each output; the axes that were given, else the figure.
    """
    measured, fitted = result.measured, result.fitted
    n = len(measured.outputs)
    with on_grid(ax, 1, n, 1.6 + 4.0 * n, 3.4, title) as grid:
        panels = grid.axes[0]
        for axes, k in zip(panels, range(n), strict=True):
            axes.plot(measured.freq, np.abs(measured.data[0, k, 0]), color=MEASURED, linewidth=2.4, label="measured")
            axes.plot(fitted.freq, np.abs(fitted.data[0, k, 0]), color=CORRECTED, label="fitted")
            axes.set(
                xlim=(measured.freq[0], measured.freq[-1]), ylim=(0.0, None), xlabel="frequency [Hz]",
                ylabel=f"{_form(measured, k)} [{unit_text(measured.units[k])}]", title=measured.outputs[k],
            )  # fmt: skip
        grid.legend(panels[0])
    return grid.drawn


def _form(frf: FrequencyResponse, output: int) -> str:
    return "transmissibility" if frf.input_units[0] == "m/s^2" else FORM_OF_QUANTITY[frf.quantities[output]]


def _phase(data: np.ndarray) -> np.ndarray:
    """Phase [°], broken where it jumps from one end of the axis to the other."""
    phase = np.degrees(np.angle(data))
    broken: np.ndarray = np.where(np.abs(np.diff(phase, prepend=phase[:1])) > 270.0, np.nan, phase)
    return broken
