"""A sealed trial's score, and the table of measured campaigns, for reading: as cells of text, as Markdown, as one page."""

from __future__ import annotations

import math
from collections.abc import Sequence

from cutvib_ss.report.frame import number, number_list, page
from cutvib_ss.validation.cases import Case, name_of
from cutvib_ss.validation.measured import MeasuredRow, cells
from cutvib_ss.validation.plan import command_of
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
        said.append(f"Command: {command_of(one['settings'])}")
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
    charts = {
        "bins": [
            {"at": number(b.confidence), "right": number(b.right.value), "low": number(b.right.low), "high": number(b.right.high),
             "cases": b.right.cases}
            for b in score.bins if b.right.cases
        ],
        "counts": [{"at": 0.5 * (b.low + b.high), "width": b.high - b.low, "cases": b.right.cases} for b in score.bins],
        "risk": {"coverage": number_list(score.coverage), "risk": number_list(score.risk)},
        "severity": [
            {"name": g.name, "cases": g.right.cases, "right": number(g.right.value), "low": number(g.right.low),
             "high": number(g.right.high), "probability": number(g.probability)}
            for g in score.by_severity
        ],
        "shrinkage": [
            {"name": s.name, "right": s.right, "achieved": number(1.0 - s.achieved), "stated": number(1.0 - s.stated),
             "low": number(1.0 - s.high), "high": number(1.0 - s.low)}
            for s in score.shrinkage
        ],
        "maps": {
            name: {"truths": list(m.truths), "named": list(m.named), "counts": m.counts.tolist()}
            for name, m in (("causes", score.causes), ("places", score.places))
        },
    }  # fmt: skip
    return page(
        "blind.html.j2",
        "blind.js",
        charts,
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
        shrinkage=bool(score.shrinkage),
    )


def measured_html(rows: Sequence[MeasuredRow]) -> str:
    """Measured campaigns held against their documented causes, as one self-contained page."""
    labelled = [r for r in rows if r.effects is not None and r.probability is not None]
    charts = {
        "campaigns": [
            {"name": r.campaign, "probability": number(r.probability or 0.0), "rank": r.rank, "place": r.place_right,
             "share": None if r.share is None else number(r.share)}
            for r in labelled
        ]
    }  # fmt: skip
    named = sum(r.rank == 1 for r in labelled)
    placed = sum(bool(r.place_right) for r in labelled)
    said = [f"{len(rows)} campaigns, {len(labelled)} of them with a documented cause and a diagnosis."]
    if labelled:
        said.append(
            f"The documented cause is named first in {named} of {len(labelled)}; its place is in the set of places in "
            f"{placed}."
        )
    failed = [r for r in rows if r.error is not None]
    if failed:
        said.append(f"{len(failed)} could not be diagnosed.")
    return page(
        "measured.html.j2",
        "blind.js",
        charts if labelled else None,
        filters={"bound": _bound},
        said=said,
        rows=[(list(cells(r)), r) for r in rows],
        failed=failed,
        limits=[(r.campaign, x) for r in rows for x in r.limits],
    )


def _bound(value: object) -> str:
    """A limit, or the pair of a signed value."""
    if isinstance(value, tuple | list):
        return " to ".join(f"{v:.3g}" for v in value)
    return f"{value:.3g}"
