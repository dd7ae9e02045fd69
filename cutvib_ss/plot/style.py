"""One look for all pictures, and figures without pyplot."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from PIL import Image

from cutvib_ss.errors import ParameterError
from cutvib_ss.files import check_picture, staged
from cutvib_ss.units import STANDARD_GRAVITY

INK, GREY, GRID = "#1d2733", "#6b7683", "#dfe4e9"
MEASURED, NOMINAL, TUNED, CORRECTED = "#b0b9c2", "#c8553d", "#d9a441", "#1f6f8f"
"""Colours of a measurement and of the three models beside it; told apart in grey and by the colour-blind."""

POSITIONS = LinearSegmentedColormap.from_list("positions", ["#27426b", "#2a7f9e", "#5fae8b", "#d9a441", "#c8553d"])
"""Colours along the rail, from y = 0 to y = L."""

WORKING_FREQUENCY = 217.0
"""Fundamental frequency of the tool's force (Section 2), marked where it matters [Hz]."""

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "text.color": INK,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "cutvib",
}


@contextmanager
def drawing(width: float, height: float, title: str = "") -> Iterator[Figure]:
    """A figure in the house style; artists made inside the block take its settings."""
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        FigureCanvasAgg(figure)
        if title:
            figure.suptitle(title, x=0.01, ha="left", fontsize=11.0, fontweight="bold")
        yield figure


@contextmanager
def on_axes(ax: Axes | None, width: float, height: float, title: str = "") -> Iterator[Axes]:
    """The axes that were given, or those of a new figure; the title goes above whichever it is."""
    if ax is None:
        with drawing(width, height, title) as figure:
            yield figure.subplots()
        return
    with mpl.rc_context(_STYLE):
        if title:
            ax.set_title(title)
        yield ax


@dataclass(frozen=True)
class Panels:
    """Axes of a picture in rows and columns: those that were given, or those of a figure of its own."""

    axes: np.ndarray
    figure: Figure
    given: Any = None

    @property
    def own(self) -> bool:
        """Whether the figure was made for this picture."""
        return self.given is None

    @property
    def drawn(self) -> Any:
        """What a plot function returns: the axes that it was given, else the figure."""
        return self.figure if self.own else self.given

    def legend(self, axes: Axes, loc: Any = "outside right upper", **options: Any) -> None:
        """`legend_beside`, as the picture has a figure of its own or not."""
        legend_beside(axes, self.own, loc, **options)


@contextmanager
def on_grid(
    ax: Any, rows: int, columns: int, width: float, height: float, title: str = "", **layout: Any
) -> Iterator[Panels]:
    """Panels in rows and columns: axes that were given, so many, or those of a new figure laid out as asked."""
    if ax is None:
        with drawing(width, height, title) as figure:
            yield Panels(figure.subplots(rows, columns, squeeze=False, **layout), figure)
        return
    given = np.asarray(ax, dtype=object)
    if given.size != rows * columns:
        raise ParameterError(
            f"ax: {given.size} axes were given; this picture needs {rows * columns}, in {rows} rows of {columns}"
        )
    with mpl.rc_context(_STYLE):
        yield Panels(given.reshape(rows, columns), figure_of(given), ax)


def figure_of(drawn: Any) -> Figure:
    """The figure behind what a plot function returned: a figure, axes, or an array of axes."""
    if isinstance(drawn, Figure):
        return drawn
    first: Axes = np.asarray(drawn, dtype=object).ravel()[0]
    figure = first.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


def save(figure: Figure | Axes | np.ndarray, path: str | os.PathLike[str], dpi: float = 150.0) -> None:
    """
    Write a figure to a file; the suffix tells the format.

    Parameters
    ----------
    figure : Figure, Axes or array of Axes
        The picture, as a plot function returns it.
    path : path-like
        File that ends in ``.png``, ``.svg`` or ``.pdf``.
    dpi : float
        Resolution of a PNG [dots per inch].

    Raises
    ------
    ParameterError
        If the suffix is not one of these.
    DataFormatError
        If the file cannot be written.
    """
    suffix = check_picture(path).suffix.lower()
    # no date inside: the same result makes the same file
    metadata = {".png": {}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}[suffix]
    with staged(path) as draft, mpl.rc_context(_STYLE):
        figure_of(figure).savefig(draft, dpi=dpi, format=suffix[1:], metadata=metadata)


def png(figure: Figure | Axes | np.ndarray, dpi: float = 150.0, colours: int = 256) -> bytes:
    """
    A figure as a small PNG for a page, its colours reduced to a palette.

    Parameters
    ----------
    figure : Figure
        The picture.
    dpi : float
        Resolution [dots per inch].
    colours : int
        Size of the palette, 2 to 256.

    Returns
    -------
    bytes
        The PNG file.
    """
    small = io.BytesIO()
    image(figure_of(figure), dpi, colours).save(small, format="PNG", optimize=True)
    return small.getvalue()


def image(figure: Figure, dpi: float, colours: int) -> Image.Image:
    """A figure as an image, its colours reduced to a palette."""
    canvas: Any = FigureCanvasAgg(figure)  # matplotlib does not annotate its canvases
    before = figure.dpi
    with mpl.rc_context(_STYLE):
        figure.set_dpi(dpi)
        try:
            canvas.draw()
            drawn = Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])
        finally:
            figure.set_dpi(before)
    return drawn.quantize(colours, dither=Image.Dither.NONE)


def position_colours(positions: Sequence[float]) -> list[Any]:
    """A colour for each position along the rail, spread over those that there are; one for all where there is none."""
    places = sorted(set(positions))
    last = max(len(places) - 1, 1)
    return [CORRECTED if np.isnan(p) else POSITIONS(places.index(p) / last) for p in positions]


def scale_of(unit: str) -> tuple[float, str]:
    """Factor and unit in which a response is shown: accelerance in g/N, as the paper's figures and the gap."""
    return (1.0 / STANDARD_GRAVITY, "g/N") if unit == "m/s^2/N" else (1.0, unit_text(unit))


def unit_text(unit: str) -> str:
    """
    A unit as it is printed on an axis.

    >>> unit_text("m/s^2/N")
    '(m/s²)/N'
    """
    raised = unit.replace("^2", "²").replace("^3", "³").replace("^0.5", "^½").replace("^-0.5", "^-½")
    return raised.replace("m/s²/", "(m/s²)/").replace("m/s/", "(m/s)/")


def legend_beside(axes: Axes, outside: bool, loc: Any = "outside right upper", **options: Any) -> None:
    """A legend beside the axes in a figure of one's own, inside of them in another's, where there is no room but for a title."""
    if not outside:
        axes.legend(**{k: v for k, v in options.items() if k == "title"})
        return
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure_of(axes).legend(handles, labels, loc=loc, **options)


def colour_bar(figure: Figure, axes: Any, colours: Colormap | str, norm: Normalize, label: str) -> Any:
    """A slim colour bar."""
    bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, aspect=30, pad=0.015, fraction=0.05)
    bar.set_label(label)
    bar.outline.set_linewidth(0.5)
    return bar


def position_name(position: float, label: str = "") -> str:
    """How a picture calls a position; what a label says beside it, a level or an input, goes below."""
    if np.isnan(position):
        return label
    _, comma, rest = label.partition(", ") if label.startswith("position ") else ("", "", "")
    return f"y/L = {position:.3g}" + (f"\n{rest}" if comma else "")


def modulus_limits(values: np.ndarray, decades: float = 4.0) -> tuple[float, float]:
    """Limits of a logarithmic axis that leave deep notches out."""
    there = values[np.isfinite(values) & (values > 0)]
    if there.size == 0:
        return 1e-3, 1.0
    high = float(there.max()) * 1.6
    return max(float(there.min()) * 0.8, high * 10.0**-decades), high
