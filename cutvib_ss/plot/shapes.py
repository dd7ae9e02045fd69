"""Mode shapes as drawings of rail and head, standing and animated."""

from __future__ import annotations

import io
import os
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cutvib_ss.errors import ParameterError
from cutvib_ss.files import staged
from cutvib_ss.model.machine import Machine
from cutvib_ss.plot.style import CORRECTED, GREY, INK, MEASURED, drawing, image, on_grid
from cutvib_ss.results import FloatArray, Modes

_SIZE = 0.12
"""Largest deflection in a drawing, as a part of the rail's length."""
_POINTS = np.linspace(0.0, 1.0, 201)


def mode_shapes(
    machine: Machine, modes: Modes, *, highest: float | None = None, title: str = "", ax: Any = None
) -> Any:
    """
    Every mode as a drawing: the rail's deflection in the plane X-Y, and the head's two links in the plane X-Z.

    Parameters
    ----------
    machine : Machine
        The machine whose modes they are.
    modes : Modes
        The modes.
    highest : float, optional
        Highest natural frequency shown [Hz]; all by default.
    title : str
        Title of the picture.
    ax : array of Axes, shape (mode, 2), optional
        Where to draw; a new figure by default.

    Returns
    -------
    Figure or array of Axes
        A row for each mode, rail and head; the axes that were given, else the figure.
    """
    shown = [k for k, f in enumerate(modes.natural_freq) if highest is None or f <= highest]
    with on_grid(ax, len(shown), 2, 8.4, 0.6 + 1.5 * len(shown), title, width_ratios=[2.6, 1.0]) as grid:
        panels = grid.axes
        for row, k in zip(panels, shown, strict=True):
            _draw(row, machine, modes, k, 1.0)
            row[0].set_title(f"{k + 1}: {modes.natural_freq[k]:.1f} Hz, {100 * modes.damping_ratio[k]:.2f} %")
        grid.legend(panels[0, 0])
        panels[-1, 0].set_xlabel("y/L [-]")
        panels[-1, 1].set_xlabel("Z")
    return grid.drawn


def animate_mode(
    machine: Machine, modes: Modes, mode: int, path: str | os.PathLike[str], *, frames: int = 24, dpi: float = 80.0
) -> None:
    """
    One mode in motion, as an animated GIF of one period that repeats.

    Parameters
    ----------
    machine : Machine
        The machine whose modes they are.
    modes : Modes
        The modes.
    mode : int
        Which, counted from 1.
    path : path-like
        File that ends in ``.gif``.
    frames : int
        Pictures in a period.
    dpi : float
        Resolution [dots per inch].

    Raises
    ------
    ParameterError
        If there is no such mode, or the file does not end in ``.gif``.
    """
    if not 1 <= mode <= modes.natural_freq.size:
        raise ParameterError(f"mode = {mode}: there are modes 1 to {modes.natural_freq.size}")
    if os.path.splitext(path)[1].lower() != ".gif":
        raise ParameterError(f"{path}: an animation is written as .gif")
    pictures = []
    for n in range(frames):
        with drawing(8.4, 2.4, f"Mode {mode}: {modes.natural_freq[mode - 1]:.1f} Hz") as figure:
            row = figure.subplots(1, 2, width_ratios=[2.6, 1.0])
            _draw(row, machine, modes, mode - 1, float(np.cos(2 * np.pi * n / frames)))
            pictures.append(image(figure, dpi, 64))
    with staged(path) as draft:
        content = io.BytesIO()
        pictures[0].save(content, "GIF", save_all=True, append_images=pictures[1:], duration=1600 // frames, loop=0)
        draft.write_bytes(content.getvalue())


def deflections(machine: Machine, modes: Modes, mode: int) -> tuple[FloatArray, FloatArray]:
    """Of a mode the rail's deflection at `_POINTS`, and the motions (base, head, tool) in X and Z, shape (3, 2)."""
    names = [f"rail({y:.6g})" for y in _POINTS[1:-1]]
    system = machine.second_order(
        modes.position, points={n: float(y) for n, y in zip(names, _POINTS[1:-1], strict=True)}
    )
    shape = modes.mode_shapes[:, mode]
    along = np.array([system.port(n) @ shape for n in names])
    ends = [system.port(e) @ shape for e in ("rail_left", "rail_right")]
    at = {p: float(system.port(p) @ shape) for p in ("base", "head_x", "head_z", "tool_x", "tool_z")}
    head = np.array([[at["base"], 0.0], [at["head_x"], at["head_z"]], [at["tool_x"], at["tool_z"]]])
    return np.concatenate([ends[:1], along, ends[1:]]), head


def _draw(row: Any, machine: Machine, modes: Modes, mode: int, phase: float) -> None:
    along, head = deflections(machine, modes, mode)
    largest = max(float(np.abs(along).max()), float(np.abs(head).max()), 1e-300)
    y = modes.position
    rail: Axes = row[0]
    rail.plot([0, 1], [0, 0], color=MEASURED, linewidth=0.8)
    rail.plot(_POINTS, _SIZE * phase * along / largest, color=CORRECTED, linewidth=2.0)
    for k, marker, name in ((1, "s", "head"), (2, "o", "tool")):
        at = _SIZE * phase * head[k, 0] / largest
        rail.plot([y], [at], marker, color=INK, markersize=5, clip_on=False, label=name)
    rail.set(xlim=(0, 1), ylim=(1.4 * _SIZE, -1.4 * _SIZE), yticks=[], ylabel="X")  # X points down
    links = _links(machine)
    side: Axes = row[1]
    size = float(np.abs(head).max())
    largest_head = size if size > 1e-9 * largest else np.inf  # a head at a node stands still
    reach = float(np.abs(links).max())
    moved = links + 0.35 * reach * phase * head[:, ::-1] / largest_head
    side.plot(links[:, 0], links[:, 1], "o-", color=MEASURED, markersize=3, linewidth=1.0)
    side.plot(moved[:, 0], moved[:, 1], "o-", color=CORRECTED, markersize=5, linewidth=2.0)
    side.set(xlim=(-0.7 * reach, 1.7 * reach), ylim=(1.6 * reach, -0.7 * reach), xticks=[], yticks=[], aspect="equal")
    side.grid(False)
    for spine in side.spines.values():
        spine.set_color(GREY)


def _links(machine: Machine) -> FloatArray:
    """Base, head and tool in the reference configuration as (Z, X) [m]: Z along the link at θ = 0, X down (Fig. 3)."""
    h = machine.head
    first, second = h.theta01, h.theta01 + h.theta02
    elbow = np.array([h.l1 * np.cos(first), h.l1 * np.sin(first)])
    tool = elbow + np.array([h.l2 * np.cos(second), h.l2 * np.sin(second)])
    return np.array([[0.0, 0.0], elbow, tool])
