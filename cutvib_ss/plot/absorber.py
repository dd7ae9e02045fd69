"""Absorbers over the whole rail: the study over tuning and damping, what designs leave at each position, mass against result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm
from matplotlib.ticker import LogLocator, NullFormatter

from cutvib_ss.absorber import AbsorberDesign, AbsorberStudy, WorkspaceCheck
from cutvib_ss.parameters import AbsorberParameters
from cutvib_ss.plot.style import (
    CORRECTED,
    GREY,
    INK,
    MEASURED,
    NOMINAL,
    TUNED,
    colour_bar,
    figure_of,
    legend_beside,
    on_axes,
)

_COLOURS = (NOMINAL, TUNED, CORRECTED, "#6a4c93", "#5fae8b", "#27426b")
_MAP_COLOURS = "viridis_r"


def absorber_study(
    study: AbsorberStudy, marks: Mapping[str, AbsorberParameters] | None = None, *, ax: Axes | None = None
) -> Axes:
    """
    Worst accelerance over the positions, for each tuning and damping.

    Parameters
    ----------
    study : AbsorberStudy
        The study.
    marks : mapping of str to AbsorberParameters, optional
        Absorbers to mark, by what they are called.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        One map.
    """
    with on_axes(ax, 7.2, 4.0, f"Absorbers of {study.best.mass:g} kg: largest accelerance over the rail") as axes:
        norm = LogNorm(float(study.worst.min()), float(study.worst.max()))
        x, y = study.tuning, 100 * study.damping_ratio
        axes.pcolormesh(x, y, study.worst.T, cmap=_MAP_COLOURS, norm=norm, shading="nearest", rasterized=True)
        for marker, (name, a) in zip("o^sDv", {"best of the grid": study.best, **(marks or {})}.items(), strict=False):
            axes.plot(
                a.frequency,
                100 * a.damping_ratio,
                marker,
                color="white",
                markeredgecolor=INK,
                label=name,
                clip_on=False,
            )
        axes.grid(False)
        axes.set(xlabel="tuning frequency [Hz]", ylabel="damping ratio [%]")
        label = f"accelerance XX at {study.working_frequency:g} Hz [(m/s²)/N]"
        _plain_ticks(colour_bar(figure_of(axes), axes, _MAP_COLOURS, norm, label).ax.yaxis)
        axes.legend(loc="upper right", facecolor="white", frameon=True, framealpha=0.85)
    return axes


def absorbers_over_the_rail(checks: Mapping[str, WorkspaceCheck], title: str = "", *, ax: Axes | None = None) -> Axes:
    """
    What absorbers leave at each position: as designed, and at worst within tolerance.

    Parameters
    ----------
    checks : mapping of str to WorkspaceCheck
        Absorbers judged under one force, by what they are called.
    title : str
        Title of the picture.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        One axes: full lines as designed, dashed ones at worst within tolerance.
    """
    with on_axes(ax, 8.2, 4.2, title) as axes:
        first = next(iter(checks.values()))
        axes.plot(first.positions, first.before, color=INK, label="no absorber")
        for (name, check), colour in zip(checks.items(), _cycle(len(checks)), strict=True):
            axes.plot(check.positions, check.exact, color=colour, label=name)
            if not np.array_equal(check.exact, check.toleranced):
                axes.plot(check.positions, check.toleranced, "--", color=colour, linewidth=0.9)
        axes.plot([], [], "--", color=GREY, linewidth=0.9, label="at worst within tolerance")
        axes.set_yscale("log")
        _plain_ticks(axes.yaxis)
        axes.set(xlim=(0.0, 1.0), xlabel="position y/L [-]", ylabel=_label(first))
        legend_beside(axes, ax is None)
    return axes


def absorber_front(
    fronts: Mapping[str, Sequence[AbsorberDesign]],
    marks: Mapping[str, WorkspaceCheck] | None = None,
    title: str = "",
    *,
    ax: Axes | None = None,
) -> Axes:
    """
    Mass of the absorbers against the largest acceleration that they leave over the rail.

    Parameters
    ----------
    fronts : mapping of str to sequence of AbsorberDesign
        Designs for several masses, by what they have in common.
    marks : mapping of str to WorkspaceCheck, optional
        Other absorbers to compare with, by what they are called.
    title : str
        Title of the picture.
    ax : Axes, optional
        Where to draw; a new figure by default.

    Returns
    -------
    Axes
        One axes: at worst within each design's tolerance (full) and as designed (dotted).
    """
    with on_axes(ax, 8.2, 4.4, title) as axes:
        for (name, designs), colour in zip(fronts.items(), _cycle(len(fronts)), strict=True):
            mass = [d.check.mass for d in designs]
            axes.plot(mass, [d.check.worst[2] for d in designs], "o-", color=colour, markersize=3.5, label=name)
            axes.plot(mass, [d.check.worst[1] for d in designs], ":", color=colour)
        for marker, (name, check) in zip("s^Dv", (marks or {}).items(), strict=False):
            for k, fill in ((2, "full"), (1, "none")):
                label = name if fill == "full" else None
                axes.plot(check.mass, check.worst[k], marker, color=INK, fillstyle=fill, label=label)
        first = next(iter(fronts.values()))[0].check
        axes.axhline(first.worst[0], color=MEASURED, label="no absorber")
        axes.plot([], [], ":", color=GREY, label="as designed (marks: hollow)")
        axes.set_xscale("log")
        axes.set_yscale("log")
        _plain_ticks(axes.xaxis)
        _plain_ticks(axes.yaxis)
        axes.set(xlabel="mass of all absorbers [kg]", ylabel=_label(first))
        legend_beside(axes, ax is None, title="at worst within tolerance")
    return axes


def _cycle(count: int) -> list[str]:
    return [_COLOURS[k % len(_COLOURS)] for k in range(count)]


def _plain_ticks(axis: Axis) -> None:
    """Ticks of a logarithmic axis that spans a decade or two, written as plain numbers."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def _label(check: WorkspaceCheck) -> str:
    where = " or ".join(check.outputs)
    if check.force.freq.size == 1 and check.force.amplitude[0] == 1.0:
        return f"accelerance of {where} at {check.force.freq[0]:g} Hz [(m/s²)/N]"
    what = "RMS" if check.criterion == "rms" else "largest harmonic"
    return f"acceleration of {where}, {what} [m/s²]"
