"""Commands of the sealed trial."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cutvib_ss.cli.options import JsonOption, SchedulerOption, TablePageOption, existing_folder, existing_folders
from cutvib_ss.cli.output import check_outputs, give_json, messages, results, say, show, text_writer, working, write_all
from cutvib_ss.errors import ParameterError

if TYPE_CHECKING:
    from rich.console import Console

    from cutvib_ss.validation.score import Score
    from cutvib_ss.validation.seal import Trial
    from cutvib_ss.validation.statistics import Estimate

_TrialOption = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Folder of the trial; the labels go to DIR.sealed beside it.")
]
_TimeoutOption = Annotated[
    float,
    typer.Option(
        "--timeout",
        min=1.0,
        metavar="S",
        help="Time limit of a diagnosis \\[s]; beyond it the diagnosis counts as failed.",
    ),
]
_SuffixError = "give a name that ends in .html (a page) or .md (a table)"


def blind_run_command(
    cases: Annotated[int, typer.Option("--cases", metavar="N", help="Number of cases.")],
    seed: Annotated[int, typer.Option("--seed", metavar="S", help="Seed of all cases: same settings, same cases.")],
    out: _TrialOption,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Cases at a time.")] = 1,
    scheduler: SchedulerOption = None,
    mix: Annotated[
        str | None,
        typer.Option(
            "--mix",
            metavar="KIND=N,…",
            help="Cases with none, outside or pair; the rest has one cause. Default: 30, 12 and 8 % of all.",
        ),
    ] = None,
    severity: Annotated[
        str, typer.Option("--severity", metavar="LO:HI", help="Range of severities, relative to the rig's usual ones.")
    ] = "0.3:2",
    small: Annotated[
        bool,
        typer.Option("--small", help="Campaigns of four positions, two levels and two channels, for a quick trial."),
    ] = False,
    timeout: _TimeoutOption = 1800.0,
) -> None:
    """Make campaigns on a virtual machine, seal what is wrong with it, diagnose them. The same command again resumes."""
    from cutvib_ss.validation.plan import settings
    from cutvib_ss.validation.trial import package_tools, run_trial

    asked = settings(cases, seed, mix, _range(severity), small)
    trial = run_trial(asked, out, package_tools(), jobs, scheduler, timeout, _progress)
    _say_sealed(trial, cases)


def blind_score_command(
    trials: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR…",
            help="Folder of the trial; several, already opened, are scored as one.",
            callback=existing_folders,
        ),
    ],
    json: JsonOption = None,
    report: Annotated[
        list[Path] | None,
        typer.Option(
            "--report", metavar="FILE", help="Write the score as a page (.html) or a table (.md); may be repeated."
        ),
    ] = None,
    train: Annotated[
        list[Path] | None,
        typer.Option(
            "--baselines",
            metavar="DIR",
            help="Opened trial from which simpler methods learn, to be scored beside; may be repeated.",
        ),
    ] = None,
    measured: Annotated[
        Path | None,
        typer.Option(
            "--measured", metavar="FILE", help="Table of `cutvib blind real --json`, for the rows of measured rigs."
        ),
    ] = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Campaigns at a time.")] = 1,
) -> None:
    """Open the seal, once, and score the diagnoses."""
    pages = report or []
    for page in pages:
        if page.suffix.lower() not in (".html", ".md"):
            raise ParameterError(f"--report {page}: {_SuffixError}")
    check_outputs(json, *pages)
    from cutvib_ss.validation.measured import read_table
    from cutvib_ss.validation.trial_score import score_trials

    with working("scoring"):
        found = score_trials(trials, jobs, () if measured is None else read_table(measured))
    if train:
        from cutvib_ss.validation.baselines import with_baselines

        with working("training and running the baselines"):
            found = with_baselines(found, trials, train, jobs)
    if pages:
        from cutvib_ss.report.blind import score_html, score_markdown

        with working("writing the report"):
            texts = {p: score_html(found) if p.suffix.lower() == ".html" else score_markdown(found) for p in pages}
        write_all({page: text_writer(text) for page, text in texts.items()})
    if not give_json(found.to_dict(), json):
        _print_score(found, results())


def blind_measured_command(
    data: Annotated[
        Path, typer.Argument(metavar="DATA", help="Folder that holds measured campaigns with documented causes.")
    ],
    out: _TrialOption,
    seed: Annotated[int, typer.Option("--seed", metavar="S", help="Seed of the elements' sizes.")] = 1,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Cases at a time.")] = 1,
    timeout: _TimeoutOption = 1800.0,
) -> None:
    """Add elements of known kind, place and size to measured campaigns, seal what they are, diagnose. The same command resumes."""
    from cutvib_ss.validation.measured_set import measured_trial
    from cutvib_ss.validation.trial import run_trial

    if not data.is_dir():
        raise ParameterError(f"{data}: is not a folder; give one that holds measured campaigns")
    asked, tools = measured_trial(data, seed)
    trial = run_trial(asked, out, tools, jobs, None, timeout, _progress)
    _say_sealed(trial, asked.cases)


def blind_real_command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="Folder that holds campaigns, a label.toml beside each campaign.toml.",
            callback=existing_folder,
        ),
    ],
    json: JsonOption = None,
    report: TablePageOption = None,
    halves: Annotated[
        bool, typer.Option("--halves", help="Diagnose both halves of each campaign's records too: do they agree?")
    ] = False,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes of a diagnosis.")] = 1,
) -> None:
    """Diagnose measured campaigns and hold each against its documented cause."""
    check_outputs(json, report)
    from cutvib_ss.validation.measured import cells, diagnose_measured, table_data

    rows = diagnose_measured(folder, halves=halves, jobs=jobs, progress=lambda name: say(messages(), name))
    if report is not None:
        from cutvib_ss.report.blind import measured_html

        text = measured_html(rows)
        write_all({report: text_writer(text)})
    if give_json(table_data(rows), json):
        return
    console = results()
    columns = ["campaign", "documented", "verdict", "named", "probability", "rank", "place right", "share closed"]
    show(
        console,
        "Measured campaigns",
        [*columns, "repeatability", "halves"],
        [tuple(cells(r)) for r in rows],
        "llllrrlrrl",
    )
    for row in rows:
        if row.error is not None:
            say(console, f"{row.campaign}: {row.error}")


def blind_ranks_command(
    cases: Annotated[int, typer.Option("--cases", min=1, metavar="N", help="Number of cases.")],
    seed: Annotated[int, typer.Option("--seed", min=0, metavar="S", help="Seed of all cases.")],
    causes: Annotated[
        list[str] | None,
        typer.Option("--cause", metavar="EFFECT", help="Draw this cause; may be repeated. Default: all linear ones."),
    ] = None,
    severity: Annotated[
        str, typer.Option("--severity", metavar="LO:HI", help="Range of severities, relative to the rig's usual ones.")
    ] = "0.3:2",
    small: Annotated[
        bool, typer.Option("--small", help="Campaigns of four positions, two levels and two channels.")
    ] = False,
    json: JsonOption = None,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Cases at a time.")] = 1,
) -> None:
    """Draw causes on a virtual machine, fit each by its own name: how often do intervals of a fit hold the true values?"""
    check_outputs(json)
    from cutvib_ss.validation.plan import SMALL
    from cutvib_ss.validation.ranks import CENTRAL, LINEAR, coverage, draw_ranks, to_dict

    with working("drawing and fitting"):
        ranks = draw_ranks(cases, seed, causes or LINEAR, _range(severity), SMALL if small else None, jobs)
    if give_json(to_dict(ranks), json):
        return
    columns = ["", "values", *(f"{of} {part:.0%}" for of in ("posterior", "stated") for part in CENTRAL)]
    rows = [(c.name, str(c.values), *map(_covered, (*c.posterior, *c.stated))) for c in coverage(ranks)]
    show(results(), "True values within central intervals", columns, rows, "lrrrrr")


def _covered(found: Estimate) -> str:
    return f"{found.value:.0%} ({found.low:.0%}-{found.high:.0%})" if found.cases else "-"


def _say_sealed(trial: Trial, cases: int) -> None:
    say(results(), f"{cases} cases diagnosed; sealed by {trial.commitment}")
    say(results(), f"labels: {trial.sealed}; open them with `cutvib blind score {trial.folder}`")


def _range(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise ParameterError(f"--severity {text}: give LO:HI, for instance 0.3:2") from None
    return low, high


def _progress(stage: str, done: int, total: int) -> None:
    if done in (0, total) or done % max(1, total // 20) == 0:
        say(messages(), f"{stage}: {done} of {total}")


def _print_score(found: Score, console: Console) -> None:
    from cutvib_ss.report.blind import GROUP_HEAD, WRONG_HEAD, group_cells, heading, row_cells, wrong_cells

    for line in heading(found):
        say(console, line)
    say(console, "")
    methods = list(found.baselines)
    table = [row_cells(found, row) for row in found.rows]
    columns = ["figure", "goal", "measured", "95 % interval", "cases", "met", *methods]
    show(console, "Score", columns, table, "llrrrl")
    say(console, "")
    groups = {
        "By size of the gap, one cause": found.by_severity,
        **{title.capitalize(): own for title, own in found.groups.items()},
        "By cause": found.by_cause,
    }
    for title, own in groups.items():
        show(console, title, list(GROUP_HEAD), [group_cells(g) for g in own], "lrrrrr")
        say(console, "")
    wrong = [wrong_cells(c) for c in found.sure_and_wrong]
    if wrong:
        show(console, "Sure and wrong", list(WRONG_HEAD), wrong, "llllrrr")
    else:
        say(console, "No case was sure and wrong.")
