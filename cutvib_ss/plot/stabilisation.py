"""Stabilisation diagrams: poles over the model's order, and which of them stay."""

from __future__ import annotations

from matplotlib.axes import Axes

from cutvib_ss.identification.stabilisation import Stabilisation
from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    MEASURED,
    TUNED,
    WORKING_FREQUENCY,
    legend_beside,
    on_axes,
    position_name,
)

_MARKS = (
    (2, "o", CORRECTED, 14, "frequency and damping stay"),
    (1, "^", TUNED, 14, "frequency stays"),
    (0, "x", GREY, 9, "new"),
)


def stabilisation_diagram(result: Stabilisation, *, ax: Axes | None = None, title: str = "") -> Axes:
    """
    Poles over frequency and model order, over the mean modulus of the responses.

    Parameters
    ----------
    result : Stabilisation
        Poles by order, of `cutvib_ss.stabilisation`.
    ax : Axes, optional
        Where to draw; a new figure by default.
    title : str
        Title of the picture; the position by default.

    Returns
    -------
    Axes
        A mode is a column of dots; the modulus has no scale of its own.
    """
    with on_axes(ax, 8.2, 4.4, title or position_name(result.position)) as axes:
        behind = axes.twinx()
        behind.semilogy(result.freq, result.modulus, color=MEASURED, linewidth=1.0)
        behind.set_axis_off()
        axes.set_zorder(behind.get_zorder() + 1)
        axes.patch.set_visible(False)
        for kind, marker, colour, size, label in _MARKS:
            of = result.stable == kind
            axes.scatter(
                result.natural_freq[of], result.order[of], marker=marker, c=colour, s=size, label=label, linewidths=0.8
            )
        if result.freq[0] < WORKING_FREQUENCY < result.freq[-1]:
            axes.axvline(
                WORKING_FREQUENCY, color=GREY, linestyle=":", linewidth=1.0, label=f"tool, {WORKING_FREQUENCY:g} Hz"
            )
        axes.plot([], [], color=MEASURED, label="mean modulus")
        axes.set(xlim=(result.freq[0], result.freq[-1]), xlabel="frequency [Hz]", ylabel="order of the model")
        legend_beside(axes, ax is None)
    return axes
