"""Commands from a lab's folder to a campaign: `campaign init` and `campaign show`."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import CampaignArgument, JsonOption, MachineOption, existing_folder, load_model
from cutvib_ss.cli.output import check_outputs, give_json, messages, results, say, show, text_writer, working, write_all
from cutvib_ss.errors import CutvibError, ParameterError

if TYPE_CHECKING:
    from cutvib_ss.measurement.draft import Draft, Wishes
    from cutvib_ss.measurement.summary import Summary
    from cutvib_ss.measurement.survey import Survey

_NAMES = ("campaign.toml", "machine.toml")


def campaign_init_command(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Folder with the measured files.", callback=existing_folder)
    ],
    channel: Annotated[
        list[str] | None,
        typer.Option(
            "--channel",
            metavar="NAME=COLUMN",
            help="Which column a channel is, and perhaps its unit: force=Hammer, tool_x='Acc 1:g'. Several times.",
        ),
    ] = None,
    position: Annotated[
        float | None, typer.Option("--position", metavar="Y", help="y_b / L of the head in every record.")
    ] = None,
    averages: Annotated[
        int | None, typer.Option("--averages", min=1, metavar="N", help="Blows or blocks behind each FRF in the files.")
    ] = None,
    title: Annotated[str, typer.Option("--title", help="Title; by default the folder's name.")] = "",
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Write a commented campaign.toml and machine.toml for the files found in a folder; nothing is overwritten."""
    check_outputs(json)
    if position is not None and not 0.0 < position < 1.0:
        raise ParameterError(f"--position {position:g}: y_b / L lies strictly between 0 and 1")
    if not channel and folder.is_dir() and not any(path.is_file() for path in folder.rglob("*")):
        raise ParameterError(f"{folder}: is empty; give the folder with the .tdms, .uff, .csv, .mat or .lvm files")
    from cutvib_ss.measurement.draft import Wishes, draft
    from cutvib_ss.measurement.survey import survey

    model = load_model(machine)
    wishes = Wishes(*_stated(channel or [], model), position=position, title=title, averages=averages)
    with working("reading the files"):
        found = survey(folder, force=wishes.names.get("force"))
    if not found.files:
        reasons = "; ".join(found.refused[:3])
        raise ParameterError(
            f"{folder}: holds no measurement that can be read"
            + (f" ({reasons})" if reasons else "")
            + "; give the folder "
            "with the .tdms, .uff, .csv, .mat or .lvm files"
        )
    if sys.stdin.isatty() and sys.stdout.isatty():
        wishes = _asked(found, model, wishes)
    made = draft(found, model, wishes, "machine.toml")
    written = _write_new(folder, made.text, model, machine)
    data = _init_data(found, made, written)
    if not give_json(data, json):
        _print_init(found, made, written, folder)
    _say_state(folder)


def _stated(given: list[str], model: Any) -> tuple[dict[str, str], dict[str, str]]:
    """Columns and units of ``--channel``."""
    names, units = {}, {}
    known = ["force", *model.channels]
    for text in given:
        channel, equals, column = text.partition("=")
        channel = channel.strip()
        if not equals or not column or channel not in known:
            raise ParameterError(f"--channel {text}: give NAME=COLUMN with NAME one of {', '.join(known)}")
        name, colon, unit = column.rpartition(":")
        if colon and name and unit.strip() in _units():
            column = name
            units[channel] = unit.strip()
        names[channel] = column.strip()
    return names, units


def _units() -> set[str]:
    from cutvib_ss.units import UNITS

    return {*UNITS, *(f"{top}/{bottom}" for top in UNITS for bottom in ("N", "g", "m/s^2"))}


def _asked(found: Survey, model: Any, wishes: Wishes) -> Wishes:
    """What no name tells, asked on a terminal; an empty answer leaves it open."""
    from dataclasses import replace

    from cutvib_ss.measurement.draft import map_file

    first = found.files[0]
    mapped = map_file(first, model, wishes)
    names = dict(wishes.names)
    for number, column in enumerate(first.columns, start=1):
        say(results(), f"  {number}: {column.name} [{column.unit or '?'}]")
    for name in ([] if first.kind == "frf" else ["force"]) + list(model.channels):
        if mapped.sure.get(name):
            continue
        guess = mapped.columns.get(name)
        answer = typer.prompt(
            f"Which column is {name}? (number, name, or empty)", default=guess.name if guess else "", show_default=True
        ).strip()
        if answer.isdigit() and 1 <= int(answer) <= len(first.columns):
            answer = first.columns[int(answer) - 1].name
        if answer:
            names[name] = answer
    return replace(wishes, names=names)


def _write_new(folder: Path, text: str, model: Any, machine: Path | None) -> dict[str, bool]:
    """Write what is not there yet; True for each file that was written."""
    from cutvib_ss.model_files import write_machine

    written = {}
    target = folder / "machine.toml"
    if not target.exists():
        write_machine(model, target)
        if machine is None:
            body = target.read_text(encoding="utf-8")
            target.write_text(
                "# TODO The nominal model. These are the published machine's values: put in your own, and under\n"
                f"# [tolerance] how well each is known.\n{body}",
                encoding="utf-8",
            )
        written["machine.toml"] = True
    else:
        written["machine.toml"] = False
    target = folder / "campaign.toml"
    written["campaign.toml"] = not target.exists()
    if written["campaign.toml"]:
        target.write_text(text, encoding="utf-8")
    return written


def _init_data(found: Survey, made: Draft, written: dict[str, bool]) -> dict[str, Any]:
    return {
        "schema": "cutvib-campaign-init/1",
        "files": [
            {
                "file": file.name,
                "kind": file.kind,
                "blows": file.blows,
                "samples": file.samples,
                "sampling_frequency_hz": file.fs,
                "peak_forces": list(file.peaks),
                "references": list(file.references),
                "columns": [
                    {"name": c.name, "unit": c.unit, "quantity": c.quantity, "largest": c.largest} for c in file.columns
                ],
            }
            for file in found.files
        ],
        "channels": {
            name: {channel: column.name for channel, column in mapped.columns.items()}
            for name, mapped in made.mapped.items()
        },
        "not_read": list(found.refused),
        "todo": list(made.todo),
        "written": [name for name, new in written.items() if new],
        "kept": [name for name, new in written.items() if not new],
        "campaign_toml": made.text,
    }


def _print_init(found: Survey, made: Draft, written: dict[str, bool], folder: Path) -> None:
    console = results()
    rows = []
    for file in found.files:
        level = _range_text(file.peaks)
        rate = "" if file.fs is None else f"{file.fs:g}"
        rows.append([file.name, file.kind, str(file.blows), rate, level, str(len(file.columns))])
    show(console, "Files", ["file", "kind", "blows", "rate [Hz]", "peaks", "columns"], rows, "llrrrr")
    shown: list[list[list[str]]] = []
    for name, mapped in made.mapped.items():
        rows = [
            [channel, column.name, column.unit or "?", "" if mapped.sure.get(channel, True) else "TODO: check"]
            for channel, column in mapped.columns.items()
        ]
        rows += [[channel, "-", "", "not found"] for channel in mapped.missing]
        rows += [["(not used)", column, "", ""] for column in mapped.left]
        if rows in shown:
            continue  # as in a file above
        shown.append(rows)
        say(console, "")
        show(console, f"Channels of {name}", ["channel", "column", "unit", ""], rows, "llll")
    for words in found.refused:
        say(messages(), f"note: not read: {words}")
    say(console, "")
    for name in _NAMES:
        if written[name]:
            say(console, f"written: {folder / name}")
        else:
            say(messages(), f"note: {folder / name} is there already and is left as it is")
    if made.todo:
        say(console, "To do:")
        for item in made.todo:
            say(console, f"  {item}")


def _range_text(values: Sequence[float]) -> str:
    if not values:
        return ""
    low, high = f"{min(values):.3g}", f"{max(values):.3g}"
    return low if low == high else f"{low} to {high}"


def _say_state(folder: Path) -> None:
    """Whether the campaign can be read as it stands."""
    from cutvib_ss.measurement.campaign import read_campaign

    try:
        with working("reading the campaign"):
            campaign = read_campaign(folder)
    except CutvibError as error:
        say(messages(), f"note: not yet readable: {error}")
        return
    for warning in campaign.warnings:
        say(messages(), f"note: {warning}")
    say(messages(), f"next: cutvib campaign show {folder}")


def campaign_show_command(
    campaign: CampaignArgument,
    json: JsonOption = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE.html", help="Write pictures and tables as one self-contained page."),
    ] = None,
    machine: MachineOption = None,
) -> None:
    """What a campaign holds: records, blows, levels, coherence, repeatability, linearity, and what was noticed."""
    check_outputs(json, report)
    from cutvib_ss.measurement.campaign import read_campaign
    from cutvib_ss.measurement.summary import summarise

    with working("reading the campaign"):
        measured = read_campaign(campaign, None if machine is None else load_model(machine))
    with working("looking at the records"):
        found = summarise(measured)
    if report is not None:
        from cutvib_ss.report.campaign_page import campaign_html

        with working("drawing"):
            page = campaign_html(measured, found)
        write_all({report: text_writer(page)})
    if not give_json(found.to_dict(), json):
        _print_show(found)


_OF_CHANNELS = (
    "|H| and its noise: root mean square over the band. Over nominal: median over the lines that are clear of noise; a resonance "
    "that is shifted in a narrow band moves it, too."
)
_OF_COHERENCE = "Coherence: mean over the band, weighted with |H|²; of a record that of the channel that has least."
_OF_PAIRS = "Difference: root mean square beyond noise, over that of the response."


def _print_show(found: Summary) -> None:
    from cutvib_ss.measurement.record_pairs import PAIR_HEADS

    console = results()
    say(console, found.title)
    rows = [
        [
            r.name_text(),
            r.kind_text(),
            "" if r.position is None else f"{r.position:g}",
            r.input or "",
            r.session or "",
            r.use or "",
            str(r.blows),
            r.level_text(),
            r.lines_text(),
            "" if r.coherence is None else f"{r.coherence:.3f}",
        ]
        for r in found.records
    ]
    peak = f"peak [{found.input_unit}]"
    heads = ["record", "kind", "y/L", "input", "session", "use", "blows", peak, "band [Hz]", "coherence"]
    show(console, "", heads, rows, "llllllrrrr")
    say(console, "")
    rows = [
        [
            r.name,
            c.name,
            c.unit,
            f"{c.rms:.3g}",
            f"{c.noise:.2g}",
            "" if c.level is None else f"{c.level:.2f}",
            "" if c.coherence is None else f"{c.coherence:.3f}",
            c.scatter_text(),
        ]
        for r in found.records
        for c in r.channels
    ]
    heads = ["record", "channel", "unit", "rms |H|", "noise of H", "over nominal", "coherence", "scatter of blows"]
    show(console, "Channels", heads, rows, "lllrrrrl")
    say(console, _OF_CHANNELS)
    if any(r.coherence is not None for r in found.records):
        say(console, _OF_COHERENCE)
    for title, pairs in (("Repeatability", found.repeated), ("Linearity between levels", found.levels)):
        if pairs:
            say(console, "")
            show(console, title, PAIR_HEADS, [p.row() for p in pairs], "llllrl")
    if found.repeated or found.levels:
        say(console, _OF_PAIRS)
    for line in found.sentences():
        say(console, "")
        say(console, line)
    for warning in found.warnings:
        say(messages(), f"note: {warning}")
