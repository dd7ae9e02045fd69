"""What a campaign holds as one HTML page: tables, responses with coherence, blows; nothing loaded from anywhere."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullFormatter, ScalarFormatter

from cutvib_ss.measurement.records import FORCE, Campaign, Record
from cutvib_ss.measurement.summary import PAIR_HEADS, RecordSummary, Summary
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse

_PEN = "#010203"  # what is drawn in the page's own text colour
_COLOURS = ("#3b82b8", "#d9822b", "#3f9b6e", "#b0508f", "#8a6fc0", "#a08a2c")
_MOST_LINES = 500  # drawn of a response
_MOST_STRETCHES = 200  # of which the extent of a history is drawn
_MOST_PICTURES = 24


def campaign_html(campaign: Campaign, found: Summary) -> str:
    """The page of `cutvib campaign show --report`: figures as SVG whose text takes the page's colour, light or dark."""
    environment = Environment(
        loader=PackageLoader("cutvib_ss.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    groups = _groups(found)[:_MOST_PICTURES]
    pictures = []
    for k, (title, members) in enumerate(groups):
        records = [(found.records[i], found.frfs[i]) for i in members]
        pictures.append((title, _inline(_responses(records, campaign), f"r{k}")))
    blows = [
        (found.records[k].name, _inline(_blows(record), f"b{k}"))
        for k, record in enumerate(campaign.records)
        if record.kind == "impact"
    ][:_MOST_PICTURES]
    return environment.get_template("campaign.html.j2").render(
        found=found,
        sentences=found.sentences(),
        pair_heads=PAIR_HEADS,
        pictures=pictures,
        blows=blows,
        left_out=max(len(_groups(found)) - _MOST_PICTURES, 0),
    )


def _groups(found: Summary) -> list[tuple[str, list[int]]]:
    """Records of one position and input, drawn together."""
    groups: dict[tuple[Any, ...], list[int]] = {}
    for k, record in enumerate(found.records):
        groups.setdefault((record.position, record.input), []).append(k)
    titles = []
    for (position, struck), members in groups.items():
        parts = [] if position is None else [f"y/L = {position:g}"]
        parts += [f"struck at {struck}"] if struck else []
        titles.append((", ".join(parts) or "all records", members))
    return titles


def _responses(records: Sequence[tuple[RecordSummary, MeasuredFrequencyResponse]], campaign: Campaign) -> Figure:
    """Modulus of each channel over frequency, the nominal model's in grey, and the coherence under it."""
    names = list(dict.fromkeys(name for _, frf in records for name in frf.outputs))
    coherent = any(np.any(np.isfinite(frf.coherence)) for _, frf in records)
    low = min(r.band_hz[0] for r, _ in records)
    high = max(r.band_hz[1] for r, _ in records)
    picture = _figure(1.8 * len(names) + (0.95 if coherent else 0.0) + 0.5 + 0.2 * (len(records) + 1))
    heights = [1.8] * len(names) + ([0.9] if coherent else [])
    axes = np.atleast_1d(picture.subplots(len(heights), 1, sharex=True, height_ratios=heights))
    for k, name in enumerate(names):
        ax = axes[k]
        unit, least, largest = "", np.inf, 0.0
        for j, (record, frf) in enumerate(records):
            if name not in frf.outputs:
                continue
            part = frf.sel(output=name)
            size = np.abs(part.data[0, 0, 0])
            keep = _extremes(size, np.flatnonzero((part.freq >= low) & (part.freq <= high) & (part.freq > 0)))
            unit = part.units[0]
            least, largest = min(least, float(np.min(size[keep]))), max(largest, float(np.max(size[keep])))
            ax.plot(part.freq[keep], size[keep], color=_colour(j), label=record.name, lw=1.1)
        nominal = _nominal(campaign, records[0][0], name, np.linspace(low, high, 800))
        if nominal is not None:
            ax.plot(*nominal, color="#888888", ls="--", lw=0.9, label="nominal model", zorder=1)
        if largest > 8 * least:
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            ax.yaxis.set_minor_formatter(NullFormatter())
        ax.set_title(f"{name} [{unit}]", fontsize=9, loc="left", color=_PEN)
        ax.grid(True)
    if coherent:
        ax = axes[-1]
        for j, (_, frf) in enumerate(records):
            at = np.flatnonzero((frf.freq >= low) & (frf.freq <= high) & (frf.freq > 0))
            least = np.min(np.nan_to_num(frf.coherence[0, :, 0], nan=1.0), axis=0)
            keep = _extremes(least, at)
            if np.any(np.isfinite(frf.coherence)):
                ax.plot(frf.freq[keep], least[keep], color=_colour(j), lw=0.9)
        ax.set_ylim(0, 1.02)
        ax.set_title("coherence (least of the channels)", fontsize=9, loc="left", color=_PEN)
        ax.grid(True)
    last = axes[-1]
    last.set_xscale("log" if high > 4 * low else "linear")
    last.xaxis.set_major_formatter(ScalarFormatter())
    last.xaxis.set_minor_formatter(NullFormatter())
    ticks = [f for f in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000) if low <= f <= high]
    if high > 4 * low and len(ticks) > 1:
        last.set_xticks(ticks)
    last.set_xlim(low, high)
    last.set_xlabel("frequency [Hz]", fontsize=9)
    handles, labels = axes[0].get_legend_handles_labels()
    picture.legend(handles, labels, loc="outside lower center", ncols=1, fontsize=8)
    return picture


def _blows(record: Record) -> Figure:
    """Force of each blow about its peak, and the largest response over the whole record."""
    picture = _figure(3.6)
    top, bottom = picture.subplots(2, 1)
    for k, history in enumerate(record.histories):
        peak = int(np.argmax(np.abs(history.force)))
        width = max(int(0.01 * history.fs), 20)
        part = slice(max(peak - width, 0), peak + 2 * width)
        top.plot(1e3 * (history.time[part] - history.time[peak]), history.force[part], color=_colour(k), lw=1.1)
        largest = int(np.argmax(np.ptp(history.responses, axis=-1)))
        time, values = _envelope(history.time, history.responses[largest])
        bottom.fill_between(time, values[0], values[1], color=_colour(k), alpha=0.45, lw=0)
    top.set_title(f"force [{record.input_unit}] over time from the peak [ms]", fontsize=9, loc="left", color=_PEN)
    name = record.channels[int(np.argmax(np.ptp(record.histories[0].responses, axis=-1)))]
    bottom.set_title(f"{name}, extent over time [s]", fontsize=9, loc="left", color=_PEN)
    for ax in (top, bottom):
        ax.grid(True)
    return picture


def _envelope(time: FloatArray, values: FloatArray) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """Least and largest value of stretches of a history."""
    size = max(values.size // _MOST_STRETCHES, 1)
    count = values.size // size
    cut = values[: count * size].reshape(count, size)
    return time[: count * size : size], (cut.min(axis=1), cut.max(axis=1))


def _nominal(
    campaign: Campaign, record: RecordSummary, name: str, freq: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """The nominal model's modulus in the channel's own quantity."""
    from cutvib_ss.measurement.inputs import port_of

    channel = campaign.machine.channels.get(name)
    if channel is None:
        return None
    inputs = (FORCE,) if record.input is None else (port_of(record.input, campaign.machine),)
    position = None if record.position is None else [record.position]
    found = frequency_response(campaign.machine, position, freq, inputs=inputs, outputs=(name,))
    return freq, np.abs(found.data[0, 0, 0])


def _extremes(values: FloatArray, at: np.ndarray) -> np.ndarray:
    """Indices to draw: all, or the least and the largest of each stretch, so that no peak is lost."""
    size = at.size // (_MOST_LINES // 2)
    if size < 3:
        return at
    stretches = at[: at.size // size * size].reshape(-1, size)
    chosen = values[stretches]
    rows = np.arange(len(stretches))
    both = np.stack([stretches[rows, chosen.argmin(axis=1)], stretches[rows, chosen.argmax(axis=1)]], axis=1)
    return np.unique(both)


def _colour(k: int) -> str:
    return _COLOURS[k % len(_COLOURS)]


def _figure(height: float) -> Figure:
    return Figure(figsize=(4.6, height), layout="constrained", facecolor="none")


def _inline(picture: Figure, prefix: str) -> Markup:
    """An SVG element of the page: text as text, lines and letters in the page's colour, ids of its own."""
    style: dict[Any, Any] = {
        "svg.fonttype": "none",
        "svg.hashsalt": prefix,
        "font.family": "sans-serif",
        "font.size": 9.0,
    }
    for ax in picture.axes:
        ax.set_facecolor("none")
        ax.tick_params(colors=_PEN, labelsize=8, which="both")
        ax.xaxis.label.set_color(_PEN)
        ax.title.set_color(_PEN)
        for side, spine in ax.spines.items():
            spine.set_visible(side in ("left", "bottom"))
            spine.set_color(_PEN)
        ax.grid(color="#888888", alpha=0.3, lw=0.6)
    for legend in picture.legends:
        legend.set_frame_on(False)
        for text in legend.get_texts():
            text.set_color(_PEN)
    buffer = io.StringIO()
    with mpl.rc_context(style):
        picture.savefig(buffer, format="svg", metadata={"Date": None})
    drawn = buffer.getvalue()
    drawn = drawn[drawn.index("<svg") :].replace(_PEN, "currentColor")
    drawn = re.sub(r'\bid="', f'id="{prefix}-', drawn)
    drawn = re.sub(r'(url\(|href=")#', rf"\1#{prefix}-", drawn)
    # without width and height it takes the width of its place
    names = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    return Markup(
        re.sub(r'<svg [^>]*?viewBox="([^"]*)"[^>]*>', rf'<svg {names} viewBox="\1" role="img">', drawn, count=1)
    )
