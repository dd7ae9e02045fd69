"""The page's pictures as plotly figures in plain dictionaries: the library that draws them ships with the page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cutvib_ss.web.curves import Curve

_LIGHT = ("#1f6f8f", "#c8701f", "#2f8560", "#a3457f", "#7458b5", "#8a7420", "#4f6d8f", "#b04a3a")
_DARK = ("#58b4d8", "#f0a35a", "#5cc196", "#dd86bb", "#ab93e8", "#cdb65c", "#8fb0d6", "#e58a7c")
_OWN = {
    "nominal": ("#4a5563", "#b9c2cc"),
    "corrected": ("#b4552d", "#ff9a6b"),
    "absorber": ("#1f6f8f", "#58b4d8"),
    "controller": ("#2f8560", "#5cc196"),
}
_PHONE = 600
"""Width below which a picture is taken for one on a phone [px]."""
_DASH = {"nominal": "dash", "corrected": "dot"}


def response_figure(
    curves: Sequence[Curve],
    *,
    dark: bool,
    width: int,
    title: str,
    phase: bool = False,
    coherence: Sequence[Curve] = (),
    mark: float | None = None,
    span: tuple[float, float] | None = None,
    revision: str = "",
) -> dict[str, Any]:
    """
    Modulus over frequency, and below it the phase or the coherence where asked for.

    A model's curve in the colour of a record is not listed in the legend: dashed the nominal, dotted the corrected one.
    """
    rows = 1 + phase + bool(coherence)
    traces: list[dict[str, Any]] = []
    names: list[str] = []
    palette = _DARK if dark else _LIGHT
    for curve in curves:
        colour = _OWN[curve.kind][dark] if curve.colour is None else palette[curve.colour % len(palette)]
        line = {"color": colour, "width": 1.6, "dash": _DASH.get(curve.kind, "solid")}
        common = {"type": "scatter", "mode": "lines", "name": curve.name, "line": line, "x": curve.freq.tolist()}
        size = np.abs(curve.data)
        hover = f"%{{x:.4g}} Hz<br>%{{y:.4g}} {curve.unit}<extra>{curve.name}</extra>"
        listed = curve.kind not in _DASH or curve.colour is None
        traces.append({**common, "showlegend": listed, "y": _plain(size), "hovertemplate": hover})
        names += [curve.name] if listed else []
        if phase:
            angle = np.degrees(np.angle(curve.data))
            # A line across the picture where the phase passes ±180° would say nothing.
            angle = np.where(np.abs(np.diff(angle, prepend=angle[:1])) > 300, np.nan, angle)
            hover = f"%{{x:.4g}} Hz<br>%{{y:.1f}}°<extra>{curve.name}</extra>"
            traces.append(
                {
                    **common,
                    "y": _plain(angle),
                    "yaxis": "y2",
                    "showlegend": False,
                    "hovertemplate": hover,
                }
            )
    below = f"y{rows}"
    for curve in coherence:
        traces.append(
            {
                "type": "scatter", "mode": "lines", "name": curve.name, "showlegend": False,
                "x": curve.freq.tolist(), "y": _plain(curve.data.real), "yaxis": below,
                "line": {"color": palette[(curve.colour or 0) % len(palette)], "width": 1.0},
                "hovertemplate": f"%{{x:.4g}} Hz<br>coherence %{{y:.3f}}<extra>{curve.name}</extra>",
            }
        )  # fmt: skip
    layout = _layout(dark, revision, names, width, 300 + 130 * (rows - 1))
    domains = _domains(rows)
    layout["yaxis"] |= {
        "type": "log",
        "domain": domains[0],
        "title": {"text": title},
        "exponentformat": "power",
        "dtick": 1,
    }
    if phase:
        layout["yaxis2"] = {
            **layout["yaxis"], "type": "linear", "domain": domains[1], "title": {"text": "phase [°]"},
            "range": [-190, 190], "tickvals": [-180, -90, 0, 90, 180],
        }  # fmt: skip
    if coherence:
        layout[f"yaxis{rows}"] = {
            **layout["yaxis"], "type": "linear", "domain": domains[-1], "title": {"text": "coherence"}, "range": [0, 1.03]
        }  # fmt: skip
    layout["xaxis"] |= {"title": {"text": "frequency [Hz]"}, "anchor": below if rows > 1 else "y"}
    if span is not None:
        layout["xaxis"]["range"] = list(span)
    if mark is not None:
        layout["shapes"] = [_upright(mark, dark)]
        layout["annotations"] = [
            {
                "x": mark, "y": 1.0, "yref": "paper", "yanchor": "bottom", "showarrow": False, "text": f"{mark:g} Hz",
                "font": {"size": 11},
            }
        ]  # fmt: skip
    return {"data": traces, "layout": layout, "config": _config(width)}


def rail_figure(
    curves: Sequence[Curve],
    position: float,
    *,
    dark: bool,
    width: int,
    title: str,
    extra: tuple[float, str] | None = None,
) -> dict[str, Any]:
    """Modulus at the working frequency over the positions of the head, the present one marked."""
    traces: list[dict[str, Any]] = [
        {
            "type": "scatter", "mode": "lines", "name": c.name, "x": c.freq.tolist(), "y": _plain(np.abs(c.data)),
            "line": {"color": _OWN[c.kind][dark], "width": 1.6, "dash": _DASH.get(c.kind, "solid")},
            "hovertemplate": f"y/L = %{{x:.2f}}<br>%{{y:.4g}} {c.unit}<extra>{c.name}</extra>",
        }
        for c in curves
    ]  # fmt: skip
    for c in curves:
        unstable = c.freq[np.isnan(c.data)]
        if unstable.size:
            at = [0.0] * unstable.size
            marker = {"color": _OWN[c.kind][dark], "symbol": "x", "size": 7}
            traces.append(
                {
                    "type": "scatter", "mode": "markers", "name": f"{c.name}: unstable", "x": unstable.tolist(), "y": at,
                    "marker": marker, "cliponaxis": False, "hovertemplate": "y/L = %{x:.2f}: unstable<extra></extra>",
                }
            )  # fmt: skip
    if extra is not None:
        shown = any(t["name"] == extra[1] for t in traces)
        traces.append(
            {
                "type": "scatter", "mode": "markers", "name": extra[1], "showlegend": not shown, "x": [position], "y": [extra[0]],
                "marker": {"color": _OWN["controller"][dark], "size": 10},
            }
        )  # fmt: skip
    layout = _layout(dark, "rail", [t["name"] for t in traces if t.get("showlegend", True)], width, 230)
    layout["yaxis"] |= {"title": {"text": title}, "rangemode": "tozero"}
    layout["xaxis"] |= {"title": {"text": "position y/L of the head"}, "range": [0, 1]}
    layout["shapes"] = [_upright(position, dark)]
    return {"data": traces, "layout": layout, "config": _config(width)}


def _config(width: int) -> dict[str, Any]:
    """Plotly's behaviour; on a phone no bar of tools over the picture."""
    return {
        "displaylogo": False, "responsive": True, "showTips": False, "scrollZoom": False, "plotlyServerURL": "",
        "displayModeBar": width >= _PHONE, "modeBarButtonsToRemove": ["select2d", "lasso2d", "toImage"],
    }  # fmt: skip


def _layout(dark: bool, revision: str, names: Sequence[str], width: int, height: int) -> dict[str, Any]:
    """Colours, axes, and a legend below them that has as many rows as its entries need."""
    each = max((7.0 * len(name) + 55.0 for name in names), default=1.0)
    rows = int(np.ceil(len(names) / max(int((width - 90) // each), 1)))
    ink, grid = ("#dfe5ea", "#39424c") if dark else ("#1d2733", "#dfe4e9")
    axis = {
        "gridcolor": grid,
        "linecolor": grid,
        "zeroline": False,
        "automargin": True,
        "ticks": "outside",
        "tickcolor": grid,
    }
    return {
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": ink, "size": 12, "family": "system-ui, Helvetica, Arial, sans-serif"},
        "margin": {"l": 56, "r": 12, "t": 22, "b": 48 + 19 * rows},
        "height": height + 19 * rows,
        "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": "#8a939c", "activecolor": ink},
        "dragmode": "zoom" if width >= _PHONE else False,  # where a drag is to scroll the page
        "hovermode": "closest",
        "hoverlabel": {"bgcolor": "#222b34" if dark else "#ffffff", "font": {"color": ink}},
        "showlegend": bool(names),
        "legend": {"orientation": "h", "x": 0, "xanchor": "left", "y": 0, "yanchor": "bottom", "yref": "container"},
        "xaxis": dict(axis),
        "yaxis": dict(axis),
        "uirevision": revision or "kept",
    }


def _domains(rows: int) -> list[list[float]]:
    """Heights of the pictures under each other, the first the tallest."""
    return {1: [[0.0, 1.0]], 2: [[0.36, 1.0], [0.0, 0.3]], 3: [[0.5, 1.0], [0.25, 0.45], [0.0, 0.2]]}[rows]


def _upright(x: float, dark: bool) -> dict[str, Any]:
    line = {"color": "#9aa5b0" if dark else "#8a939c", "width": 1, "dash": "dot"}
    return {
        "type": "line",
        "xref": "x",
        "x0": x,
        "x1": x,
        "yref": "paper",
        "y0": 0,
        "y1": 1,
        "line": line,
        "layer": "below",
    }


def _plain(values: Any) -> list[float | None]:
    """Numbers as JSON takes them, to five digits."""
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in np.asarray(values, dtype=float)]
