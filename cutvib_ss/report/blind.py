"""A sealed trial's score for reading: as lines and cells of text, as Markdown, as one page with pictures."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from cutvib_ss.plot import blind as pictures
from cutvib_ss.plot.style import svg
from cutvib_ss.validation.cases import Case, name_of
from cutvib_ss.validation.plan import options_of
from cutvib_ss.validation.rows import Row
from cutvib_ss.validation.score import Group, Score, case_data
from cutvib_ss.validation.statistics import Estimate

GROUP_HEAD = (
    "cases that share it",
    "right first",
    "95 % interval",
    "cases",
    "mean stated",
    "calibration error (if perfect)",
)
"""Columns of `group_cells`."""
WRONG_HEAD = ("campaign", "truth", "form", "named", "stated", "gap [σ]", "oracle's probability of the truth")
"""Columns of `wrong_cells`."""

_MET = {True: "yes", False: "no", None: "-"}


def heading(score: Score) -> list[str]:
    """What the trial was."""
    about = score.about
    kinds = ", ".join(f"{n} {kind}" for kind, n in about["kinds"].items())
    said = [f"{about['cases']} cases: {kinds}."]
    for one in (about, *about.get("with", ())):
        said.append(f"Command: cutvib blind run {options_of(one['settings'])}")
        said.append(
            f"Sealed {one['sealed'][:16]}, opened {one['opened'][:16]} (UTC); version {one['version']}, "
            f"commit {one['commit'] or 'unknown'}, code {one['code_sha256'][:12]}."
        )
    refused = about.get("refused_draws") or {}
    told = ", ".join(f"{n} of {name}" for name, n in refused.items()) or "none"
    said.append(
        f"Draws that the rig refused, and drew anew: {told}. Cases with blows whose motion is unstable: "
        f"{about.get('cases_with_unstable_blows', 0)}."
    )
    return said


def figure(value: float, unit: str) -> str:
    """A figure of the score."""
    if not math.isfinite(value):
        return "-"
    if unit == "%":
        return f"{100 * value:.1f} %"
    return (
        f"{value:.3g} s"
        if unit == "s"
        else f"{value:.3f}".rstrip("0").rstrip(".")
        if abs(value) < 10
        else f"{value:.3g}"
    )


def goal(row: Row) -> str:
    """A row's goal."""
    if row.goal is None:
        return ""
    sign = "≥" if row.at_least else "≤" if row.goal else "="
    number = f"{100 * row.goal:g} %" if row.unit == "%" else f"{row.goal:g}{' s' if row.unit == 's' else ''}"
    return f"{sign} {number}"


def interval(estimate: Estimate, unit: str) -> str:
    """A 95 % interval."""
    if estimate.cases == 0:
        return ""
    low, high = figure(estimate.low, unit), figure(estimate.high, unit)
    if not math.isfinite(estimate.high):
        return f"≥ {low}" if math.isfinite(estimate.low) else "unbounded"
    if not math.isfinite(estimate.low):
        return f"≤ {high}"
    return f"{low.removesuffix(' %').removesuffix(' s')}-{high}"


def row_cells(score: Score, row: Row) -> list[str]:
    """A row as cells: figure, goal, measured, interval, cases, met, and each baseline's figure."""
    others = []
    for own in score.baselines.values():
        same = next((r for r in own if r.key == row.key), None)
        others.append("" if same is None or same.estimate.cases == 0 else figure(same.estimate.value, row.unit))
    e = row.estimate
    met = _MET[row.met] if row.goal is not None else ""
    return [row.title, goal(row), figure(e.value, row.unit), interval(e, row.unit), str(e.cases), met, *others]


def group_cells(group: Group) -> list[str]:
    """A group of cases as cells, under `GROUP_HEAD`."""
    e = group.right
    error = f"{group.calibration_error:.3f} ({group.if_perfect:.3f})"
    return [group.name, figure(e.value, "%"), interval(e, "%"), str(e.cases), f"{group.confidence:.3f}", error]


def wrong_cells(case: Case) -> list[str]:
    """A case that was sure and wrong, as cells, under `WRONG_HEAD`."""
    named = "-" if case.answer.first is None else name_of(case.answer.first)
    truth = case.truth.name if case.truth.kind != "outside" else f"{case.truth.name} at {'+'.join(case.truth.place)}"
    odds = case.truth.oracle
    known = "" if odds is None else f"{odds.get(case.truth.causes, 0.0):.3f}"
    form = str(case.truth.label.get("form") or "")
    return [case.name, truth, form, named, f"{case.answer.confidence:.3f}", f"{case.truth.gap_sigma:.3g}", known]


def score_markdown(score: Score) -> str:
    """The score as tables in Markdown, to stand in a page."""
    methods = list(score.baselines)
    parts = ["## Figures", "", *(f"{line}  " for line in heading(score)), ""]
    head = ["figure", "goal", "measured", "95 % interval", "cases", "met", *methods]
    parts += _table(head, [row_cells(score, row) for row in score.rows])
    notes = [f"- {row.title}: {row.note}." for row in score.rows if row.note]
    parts += ["", "Notes:", "", *notes]
    group_head = ["", *GROUP_HEAD[1:]]
    parts += [
        "",
        "## By size of the gap, one cause",
        "",
        *_table(group_head, [group_cells(g) for g in score.by_severity]),
    ]
    for title, groups in score.groups.items():
        parts += ["", f"## {title.capitalize()}", "", *_table(group_head, [group_cells(g) for g in groups])]
    parts += ["", "## By cause", "", *_table(group_head, [group_cells(g) for g in score.by_cause])]
    wrong = [wrong_cells(c) for c in score.sure_and_wrong]
    parts += ["", "## Sure and wrong", ""]
    parts += _table(WRONG_HEAD, wrong) if wrong else ["No case."]
    return "\n".join(parts) + "\n"


def _table(head: Sequence[str], cells: Sequence[Sequence[str]]) -> list[str]:
    lines = [head, ["---"] * len(head), *cells]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]


def score_html(score: Score) -> str:
    """The score as one self-contained page."""
    environment = Environment(
        loader=PackageLoader("cutvib_ss.report"), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    return environment.get_template("blind.html.j2").render(
        heading=heading(score),
        methods=list(score.baselines),
        rows=[(row_cells(score, row), row) for row in score.rows],
        group_head=GROUP_HEAD,
        groups={
            "by size of the gap, one cause": [group_cells(g) for g in score.by_severity],
            **{title: [group_cells(g) for g in own] for title, own in score.groups.items()},
            "by cause": [group_cells(g) for g in score.by_cause],
        },
        wrong_head=WRONG_HEAD,
        wrong=[wrong_cells(c) for c in score.sure_and_wrong],
        cases=[case_data(c) for c in score.cases],
        pictures={
            "reliability": _inline(pictures.reliability_diagram(score), "r"),
            "risk": _inline(pictures.risk_curve(score), "c"),
            "severity": _inline(pictures.severity_curve(score), "s"),
            "shrinkage": _inline(pictures.shrinkage_scatter(score), "k") if score.shrinkage else "",
            "causes": _inline(pictures.confusion_map(score.causes, "Causes"), "m"),
            "places": _inline(pictures.confusion_map(score.places, "Places"), "p"),
        },
    )


def _inline(picture: Figure, prefix: str) -> Markup:
    """A picture as an element of the page; its ids are made its own, for the page holds several."""
    text = svg(picture)
    text = text[text.index("<svg") :]
    text = re.sub(r'\bid="', f'id="{prefix}-', text)
    text = re.sub(r'(url\(|href=")#', rf"\1#{prefix}-", text)
    return Markup(text)
