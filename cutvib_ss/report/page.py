"""The report as one HTML page: charts and the library that draws them inside it, nothing loaded from anywhere."""

from __future__ import annotations

import base64
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from cutvib_ss import __version__
from cutvib_ss.diagnosis.result import Comparison, Diagnosis, GapFigures
from cutvib_ss.files import staged
from cutvib_ss.parameters import TOLERANCED_HEAD, TOLERANCED_RAIL
from cutvib_ss.plot.diagnosis import comparison_grid, probability_text
from cutvib_ss.plot.style import png
from cutvib_ss.report import answer, details, wording
from cutvib_ss.report.charts import MODELS, charts_data, record_name
from cutvib_ss.report.drawing import machine_drawing
from cutvib_ss.report.frame import page

_SHOWN_RECORDS = 8
"""Rows of the picture of responses; a campaign of more positions and levels shows one record a position."""

_LISTED = 6
_WORTH_LISTING = 1e-3
"""Causes in the table: so many at least, and all above this probability."""

_UNITS = {
    "m1": "kg", "m2": "kg", "l1": "m", "l2": "m", "k1": "N m/rad", "k2": "N m/rad", "c1": "N m s/rad",
    "c2": "N m s/rad", "mass": "kg", "first_frequency": "Hz", "damping_ratio": "",
}  # fmt: skip


@dataclass(frozen=True)
class _Change:
    name: str
    unit: str
    nominal: str
    corrected: str
    percent: str
    deviations: str


def write_report(diagnosis: Diagnosis, path: str | os.PathLike[str]) -> None:
    """
    Write the report of a diagnosis.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    path : path-like
        HTML file; replaced only once the new one is complete.

    Raises
    ------
    DataFormatError
        If the file cannot be written.
    """
    text = report_html(diagnosis)
    with staged(path) as draft:
        draft.write_text(text, encoding="utf-8")


def report_html(diagnosis: Diagnosis, command: str = "") -> str:
    """
    The report of a diagnosis as HTML.

    Parameters
    ----------
    diagnosis : Diagnosis
        The diagnosis.
    command : str
        The command that gives the same diagnosis again, where one is known.

    Returns
    -------
    str
        One page with charts inside; the same diagnosis gives the same page.
    """
    filters = {"figure": wording.figure, "probability": probability_text, "place": wording.place_name}
    return page("report.html.j2", "charts.js", charts_data(diagnosis), filters=filters, **_content(diagnosis, command))


def _content(d: Diagnosis, command: str) -> dict[str, Any]:
    listed = [
        c for i, c in enumerate(d.causes) if i < _LISTED or c.probability >= _WORTH_LISTING or i in d.ambiguity_set
    ]
    likely = [d.causes[i] for i in d.ambiguity_set]
    return {
        "d": d,
        "verdict": wording.VERDICTS[d.verdict],
        "sentence": wording.verdict_sentence(d),
        "why": answer.why_sentences(d),
        "steps": answer.to_do(d),
        "far_tuned": answer.tuning_suffices(d),
        "drawing": machine_drawing(d),
        "shrinkage": wording.shrinkage_text(d.gap),
        "bands": wording.bands_text(d.where.bands_hz),
        "bars": _bars(d.gap),
        "excess": wording.excess_text(d.gap),
        "places": [row for i, row in enumerate(d.where.places) if i < 3 or row[1] >= _WORTH_LISTING],
        "causes": [
            {
                "cause": c,
                "name": wording.cause_name(c.effect, c.place, c.parameters),
                "parameters": [
                    (name, wording.parameter_text(p), wording.interval_text(p)) for name, p in c.parameters.items()
                ],
                "likely": c in likely,
                "percent": f"{100 * c.probability:.1f}",
                "share": f"{100 * c.share:.0f} %" if np.isfinite(c.share) else "-",
            }
            for c in listed
        ],
        "records": [record_name(c) for c in d.comparisons],
        "channels": list(dict.fromkeys(name for c in d.comparisons for name in c.measured.outputs)),
        "models": list(zip(MODELS, ("nominal model", "re-tuned model", "corrected model"), strict=True))[::-1],
        "sizes": answer.size_rows(d),
        "sizes_sentence": answer.sizes_sentence(d),
        "limits": answer.limit_rows(d),
        "command": command,
        "version": __version__,
        "picture": _picture(comparison_grid(_chosen(d.comparisons))) if d.comparisons else "",
        **_details(d),
        "changes": _changes(d),
        "shown": len(_chosen(d.comparisons)),
    }


def _details(d: Diagnosis) -> dict[str, Any]:
    """What was found beside the verdict."""
    f = d.findings
    return {
        "stiffness": details.stiffness_sentences(f.stiffness),
        "place_scores": f.place_scores,
        "nu_gap": None if f.nu_gap is None else details.nu_gap_sentence(f.nu_gap),
        "nu_gap_rows": [] if f.nu_gap is None else details.nu_gap_rows(f.nu_gap),
        "bands_of": details.band_rows(f.bands),
        "metrics": [(by, details.metric_rows(f.metrics, by)) for by in ("channel", "position", "level")],
        "second_best": details.second_best_sentence(d),
        "second_judged": details.second_judged(d),
        "consequences": f.consequences,
        "means": "" if f.consequences is None else details.consequences_sentence(f.consequences),
        "vibration": [] if f.consequences is None else details.consequence_rows(f.consequences),
        "loops": [] if f.consequences is None else details.loop_rows(f.consequences.loops),
    }


def _picture(figure: Figure) -> str:
    return "data:image/png;base64," + base64.b64encode(png(figure)).decode("ascii")


def _bars(gap: GapFigures) -> list[tuple[str, float, float]]:
    """Label, figure, and length in percent of the longest."""
    rows = [
        ("before: the model as given", gap.before),
        ("tuned, no effect; tolerances are standard deviations", gap.tuned),
        ("after: with the cause added", gap.after),
        ("noise: of the measurement alone", gap.noise_floor),
    ]
    longest = max((v for _, v in rows if np.isfinite(v)), default=1.0) or 1.0
    return [(label, value, 100 * value / longest if np.isfinite(value) else 0.0) for label, value in rows]


def _chosen(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """All comparisons where they are few; else that of least noise at each position."""
    if len(comparisons) <= _SHOWN_RECORDS:
        return list(comparisons)
    best: dict[float | str, Comparison] = {}
    for c in comparisons:
        position = float(c.measured.positions[0])
        key = c.label if np.isnan(position) else position
        if key not in best or np.mean(c.measured.variance) < np.mean(best[key].measured.variance):
            best[key] = c
    return list(best.values())[:_SHOWN_RECORDS]


def _changes(d: Diagnosis) -> list[_Change]:
    """How far the corrected model's own values have moved from the nominal ones."""
    nominal, corrected = d.nominal, d.corrected_machine
    if nominal.rail is None or corrected.rail is None:
        return []
    rows = []
    for names, before, after in (
        (TOLERANCED_HEAD, nominal.head, corrected.head),
        (TOLERANCED_RAIL, nominal.rail.parameters, corrected.rail.parameters),
    ):
        for name in names:
            old, new = float(getattr(before, name)), float(getattr(after, name))
            fraction = new / old - 1.0 if old else 0.0
            tolerance = float(getattr(nominal.tolerance, name))
            rows.append(
                _Change(
                    name=name,
                    unit=_UNITS[name],
                    nominal=f"{old:.6g}",
                    corrected=f"{new:.6g}",
                    percent=f"{100 * fraction:+.2f} %",
                    deviations=f"{fraction / tolerance:+.1f}" if tolerance else "-",
                )
            )
    return rows
