"""The command that diagnoses every campaign of a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cutvib_ss.cli.options import JsonOption, NominalOption, SchedulerOption, TablePageOption, existing_folder
from cutvib_ss.cli.output import check_outputs, give_json, messages, results, say, show, text_writer, write_all


def fleet_command(
    folder: Annotated[
        Path,
        typer.Argument(metavar="DIR", help="Folder that holds campaigns, at any depth.", callback=existing_folder),
    ],
    machine: NominalOption = None,
    json: JsonOption = None,
    report: TablePageOption = None,
    reports: Annotated[
        bool,
        typer.Option(
            "--reports",
            help="Keep the report of each campaign too, linked from the page (about 5 MB each). Campaigns diagnosed without are "
            "diagnosed anew.",
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Folder of what is kept. Default: .cutvib-fleet in the folder of campaigns."
        ),
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Campaigns at a time.")] = 1,
    scheduler: SchedulerOption = None,
) -> None:
    """
    Diagnose every campaign below a folder: one table, one page.

    Each diagnosis is kept at once. The same command again goes on where it was, and diagnoses anew what has changed; a
    campaign that cannot be diagnosed is a row with its error.
    """
    check_outputs(json, report)
    from cutvib_ss.fleet import HEAD, cells, diagnose_fleet, table_data

    rows = diagnose_fleet(
        folder, out=out, reports=reports, jobs=jobs, scheduler=scheduler, machine=machine, progress=_progress
    )
    if report is not None:
        from cutvib_ss.report.fleet import fleet_html

        text = fleet_html(rows, report)
        write_all({report: text_writer(text)})
    if give_json(table_data(rows), json):
        return
    console = results()
    show(console, "Campaigns", list(HEAD), [tuple(cells(r)) for r in rows], "llll")
    for row in rows:
        if row.error is not None:
            say(console, f"{row.campaign}: {row.error}")


def _progress(name: str, done: int, total: int) -> None:
    say(messages(), f"{done} of {total} campaigns" + (f": {name}" if name else " are done already" if done else ""))
