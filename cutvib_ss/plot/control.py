"""What controllers do over the rail, and over frequency."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cutvib_ss.control_design.result import ControllerCheck
from cutvib_ss.plot.style import CORRECTED, GREY, NOMINAL, modulus_limits, on_grid, unit_text

_LINES: tuple[tuple[str, Any], ...] = (
    ("#1f6f8f", "-"), ("#c8553d", "-"), ("#d9a441", "-"), ("#5fae8b", "-"), ("#27426b", "--"), ("#8a5a83", "--"),
    ("#6b7683", "--"), ("#b5651d", "--"),
)  # fmt: skip
"""A colour and a stroke for each controller, told apart in grey by the stroke."""

_BAND = (120.0, 350.0)
"""Frequencies that are drawn [Hz]."""


def controller_overview(checks: Sequence[ControllerCheck], *, ax: Any = None) -> Any:
    """
    What is left at the working frequency, disk margin and effort over the rail, a column for each machine.

    Parameters
    ----------
    checks : sequence of ControllerCheck
        Checks on the same machines.
    ax : array of Axes, shape (3, machine), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        The axes that were given, else the figure. Three rows; a cross on the upper edge marks a position where a loop is unstable.
    """
    first = checks[0]
    n = len(first.machines)
    with on_grid(ax, 3, n, 2.6 + 3.6 * n, 6.4, sharex=True, sharey="row") as grid:
        rows = grid.axes
        for m, machine in enumerate(first.machines):
            for k, check in enumerate(checks):
                colour, stroke = _LINES[k % len(_LINES)]
                style = {"color": colour, "linestyle": stroke, "label": check.name}
                margin = np.where(check.stable[m], check.disk_margin[m], np.nan)
                for axes, values in zip(rows[:, m], (check.attenuation[m, 0], margin, check.effort[m]), strict=True):
                    axes.plot(check.positions, values, **style)
                _mark_unstable(rows[0, m], check, m, colour, k)
            rows[0, m].axhline(1.0, color=GREY, linestyle=":", linewidth=0.8)
            rows[0, m].set_title(machine)
            rows[2, m].set_xlabel("position of the head, y/L")
            rows[2, m].set_xlim(0.0, 1.0)
        rows[0, 0].set_yscale("log")
        rows[0, 0].margins(y=0.15)
        rows[0, 0].set_ylabel(f"left at {first.working_frequency:g} Hz\n({first.outputs[0]}, closed over open)")
        rows[1, 0].set_ylabel("disk margin")
        rows[1, 0].set_ylim(bottom=0.0)
        rows[2, 0].set_yscale("log")
        rows[2, 0].set_ylabel("command per force [N/N]")
        grid.legend(rows[0, 0], title="controller")
    return grid.drawn


def controller_responses(checks: Sequence[ControllerCheck], *, ax: Any = None) -> Any:
    """
    The largest response over all positions, open and closed: a row for each controller, a column for each machine.

    Parameters
    ----------
    checks : sequence of ControllerCheck
        Checks on the same machines.
    ax : array of Axes, shape (controller, machine), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        The axes that were given, else the figure. A panel says so where a position is unstable; its curve is that of the others.
    """
    n = len(checks[0].machines)
    size = 2.0 + 3.4 * n, 0.9 + 1.7 * len(checks)
    with on_grid(ax, len(checks), n, *size, sharex=True, sharey=True) as grid:
        panels = grid.axes
        shown = [_largest(f.data) for check in checks for f in (*check.open, *check.closed)]
        for row, check in zip(panels, checks, strict=True):
            for m, axes in enumerate(row):
                freq = check.open[m].freq
                axes.semilogy(freq, _largest(check.open[m].data), color=NOMINAL, label="open")
                axes.semilogy(freq, _largest(check.closed[m].data), color=CORRECTED, label="closed")
                axes.axvline(check.working_frequency, color=GREY, linestyle=":", linewidth=0.8)
                title = check.name if n == 1 else f"{check.name}: {check.machines[m]}"
                lost = int((~check.stable[m]).sum())
                axes.set_title(title + (f" (unstable at {lost} of {check.positions.size})" if lost else ""))
            row[0].set_ylabel(f"{check.outputs[0]} [{unit_text(check.open[0].unit)}]")
        panels[0, 0].set_ylim(*modulus_limits(np.concatenate(shown), 2.5))
        panels[0, 0].set_xlim(*_BAND)
        for axes in panels[-1]:
            axes.set_xlabel("frequency [Hz]")
        grid.legend(panels[0, 0], title="largest over y/L")
    return grid.drawn


def _mark_unstable(axes: Axes, check: ControllerCheck, machine: int, colour: str, row: int) -> None:
    there = check.positions[~check.stable[machine]]
    height = 0.985 - 0.045 * row
    axes.plot(there, np.full(there.size, height), "x", color=colour, markersize=4, transform=axes.get_xaxis_transform())


def _largest(data: np.ndarray) -> np.ndarray:
    """Largest modulus over positions, those without a response left out."""
    modulus = np.abs(data[:, 0, 0])
    some = ~np.isnan(modulus).all(axis=1)
    return modulus[some].max(axis=0) if some.any() else np.full(modulus.shape[1], np.nan)
