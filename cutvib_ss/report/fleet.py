"""The page of many campaigns: one table, a chart, and links to the reports."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from cutvib_ss.fleet import HEAD, FleetRow, cells
from cutvib_ss.report.frame import page
from cutvib_ss.report.wording import VERDICTS, cause_name


def fleet_html(rows: Sequence[FleetRow], target: Path) -> str:
    """The table as one self-contained page, whose links to reports hold from where it will lie."""
    failed = [r for r in rows if r.error is not None]
    counts = Counter(r.verdict for r in rows if r.verdict is not None)
    said = [f"{len(rows)} campaigns."]
    said += [f"{VERDICTS.get(v, v)}: {n}." for v, n in counts.most_common()]
    if failed:
        said.append(f"{len(failed)} could not be diagnosed.")
    return page(
        "fleet.html.j2",
        "fleet.js",
        None,
        said=said,
        head=HEAD,
        rows=[(list(cells(r)), _link(r, target), r) for r in rows],
        causes=Counter(cause_name(r.effect, r.place or "") for r in rows if r.effect is not None).most_common(),
        failed=failed,
        warned=[r for r in rows if r.warnings],
    )


def _link(row: FleetRow, target: Path) -> str | None:
    """A report's address, relative to the page."""
    if row.report is None:
        return None
    report, page_folder = Path(row.report).resolve(), target.resolve().parent
    try:
        return quote(Path(os.path.relpath(report, page_folder)).as_posix())
    except ValueError:
        return report.as_uri()  # another drive
