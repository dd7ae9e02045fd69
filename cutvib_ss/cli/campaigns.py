"""Commands that read a measurement campaign."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import JsonOption, MachineOption, SaveMachineOption
from cutvib_ss.cli.output import check_outputs, give_json, messages, results, say, show, working, write_all
from cutvib_ss.errors import ParameterError

if TYPE_CHECKING:
    from rich.console import Console

    from cutvib_ss.diagnosis.result import Diagnosis
    from cutvib_ss.identification.identify import IdentificationResult

_CampaignArgument = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN", help="Folder of the campaign, or its campaign.toml.")
]
_SHOWN = 5


class BaseName(StrEnum):
    """How the base is taken in the fit of the head."""

    HELD = "held"
    RAIL = "rail"


def diagnose_command(
    campaign: _CampaignArgument,
    json: JsonOption = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE.html", help="Write the report as one self-contained page."),
    ] = None,
    hold_out: Annotated[
        float | None,
        typer.Option("--hold-out", metavar="FRACTION", help="Part of the records that is judged on, never fitted."),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Same input and seed, same output.")] = 0,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes to use.")] = 1,
    machine: MachineOption = None,
    save_machine: SaveMachineOption = None,
) -> None:
    """Where model and measurement differ, which cause explains it, and how much of the gap it closes."""
    if hold_out is not None and not 0.0 < hold_out < 1.0:
        raise ParameterError(f"--hold-out {hold_out:g} must lie strictly between 0 and 1")
    check_outputs(json, report, save_machine)
    found = diagnosis_of(campaign, machine, hold_out, seed, jobs)
    give_diagnosis(found, json, report, save_machine)
    if json != "-":
        print_diagnosis(found, results())


def identify_command(
    campaign: _CampaignArgument,
    base: Annotated[
        BaseName, typer.Option("--base", help="Fit with the base held, as the paper does, or riding on the rail.")
    ] = BaseName.RAIL,
    band: Annotated[str, typer.Option("--band", metavar="LO:HI", help="Band of the fit [Hz].")] = "150:300",
    machine: MachineOption = None,
    json: JsonOption = None,
    save_machine: SaveMachineOption = None,
) -> None:
    """First guess and bounded fit of the head's ten parameters, and what the records determine of them."""
    check_outputs(json, save_machine)
    from cutvib_ss.identification.identify import identify
    from cutvib_ss.measurement.campaign import read_campaign
    from cutvib_ss.model_files import write_machine

    with working("reading and fitting"):
        measured = read_campaign(campaign, None if machine is None else _read(machine))
        found = identify(measured, base=base.value, band=_band(band))
    fitted = found.machine
    if save_machine is not None and fitted is not None:
        write_all({save_machine: lambda draft: write_machine(fitted, draft)})
    for warning in (*measured.warnings, *found.warnings):
        say(messages(), f"note: {warning}")
    if not give_json(_identify_data(found), json):
        _print_identification(found, results())


def give_diagnosis(found: Diagnosis, json: str | None, report: Path | None, save_machine: Path | None) -> None:
    """Write a diagnosis as JSON, page and machine.toml: all that is asked for, or nothing."""
    writers: dict[str | Path, Any] = {}
    if json is not None and json != "-":
        text = found.to_json() + "\n"
        writers[json] = lambda draft: draft.write_text(text, encoding="utf-8")
    if report is not None:
        from cutvib_ss.report.page import report_html

        with working("writing the report"):
            page = report_html(found)
        writers[report] = lambda draft: draft.write_text(page, encoding="utf-8")
    if save_machine is not None:
        from cutvib_ss.model_files import write_machine

        writers[save_machine] = lambda draft: write_machine(found.corrected_machine, draft)
    write_all(writers)
    if json == "-":
        typer.echo(found.to_json())


def print_diagnosis(found: Diagnosis, console: Console) -> None:
    """A diagnosis for reading: the answer, then where, which and how far."""
    from rich.text import Text

    from cutvib_ss.plot.diagnosis import probability_text
    from cutvib_ss.report import details, wording

    say(console, Text(wording.VERDICTS[found.verdict], style="bold"))
    say(console, wording.verdict_sentence(found))
    say(console, "")
    where = found.where
    places = ", ".join(f"{p} {probability_text(q)}" for p, q in where.places[:3])
    gap = found.gap
    share, interval = wording.shrinkage_text(gap)
    facts = [
        ["where", f"{where.place} ({places})" if places else where.place],
        ["bands", wording.bands_text(where.bands_hz)],
        ["before", f"{wording.figure(gap.before)} {gap.unit}: the model as given, on held-out records"],
        ["tuned", f"{wording.figure(gap.tuned)} {gap.unit}: within its tolerances"],
        ["after", f"{wording.figure(gap.after)} {gap.unit}: with the cause added"],
        ["noise", f"{wording.figure(gap.noise_floor)} {gap.unit}"],
        ["closed", share + (f" ({interval})" if interval else "")],
    ]
    show(console, "", ["", ""], facts, "ll")
    by_channel = details.metric_rows(found.findings.metrics, "channel")
    if by_channel:
        say(console, "")
        say(console, f"By channel, on held-out records [{gap.unit}]")
        heads = ["", "before", "tuned", "after", "second-best", "noise", "FRAC before", "after", "dB before", "after"]
        show(console, "", heads, by_channel, "lrrrrrrrrr")
    say(console, "")
    rows = []
    for cause in found.causes[:_SHOWN]:
        parameters = "\n".join(f"{name} {value}" for name, value in wording.parameters_text(cause))
        rows.append(
            [cause.effect, cause.place, parameters, probability_text(cause.probability), wording.figure(cause.after)]
        )
    show(console, "", ["cause", "place", "parameters", "probability", f"left [{gap.unit}]"], rows, "lllrr")
    for told in details.sentences(found):
        say(console, "")
        say(console, told)
    if found.next_test is not None:
        say(console, "")
        say(console, f"Next: {wording.next_test_sentence(found.next_test)}")
    for warning in found.warnings:
        say(messages(), f"note: {warning}")


def diagnosis_of(campaign: Path, machine: Path | None, hold_out: float | None, seed: int, jobs: int) -> Diagnosis:
    """The diagnosis of a campaign's files, with another nominal model where one is given."""
    from cutvib_ss.measurement.campaign import read_campaign

    with working("reading the campaign"):
        measured = read_campaign(campaign, None if machine is None else _read(machine))
    with working("diagnosing"):
        from cutvib_ss.diagnosis.diagnose import diagnose

        return diagnose(measured, hold_out=hold_out, seed=seed, jobs=jobs)


def _read(machine: Path) -> Any:
    from cutvib_ss.model_files import read_machine

    return read_machine(machine)


def _band(text: str) -> tuple[float, float]:
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise ParameterError(f"--band {text}: give LO:HI in Hz, for instance 150:300") from None
    if not 0.0 < low < high < float("inf"):
        raise ParameterError(f"--band {text}: needs 0 < LO < HI, both finite")
    return low, high


def _identify_data(found: IdentificationResult) -> dict[str, Any]:
    from cutvib_ss.model.head import HEAD_PARAMETERS, HEAD_UNITS

    keys = {
        name: f"{name}_{unit.replace('/', ' per ').replace('  ', ' ').replace(' ', '_').lower()}"
        for name, unit in zip(HEAD_PARAMETERS, HEAD_UNITS, strict=True)
    }
    guess = found.first_guess
    return {
        "schema": "cutvib-identify/1",
        "record": found.record,
        "position": found.position,
        "base": found.base,
        "head": {key: getattr(found.head, name) for name, key in keys.items()},
        "first_guess": None if guess is None else {key: getattr(guess, name) for name, key in keys.items()},
        "parameters": [vars(e) for e in found.determination.parameters],
        "combinations": [vars(e) for e in found.determination.combinations],
        "interval_level": found.determination.level,
        "n_determined": found.determination.n_determined,
        "singular_values": found.determination.singular_values,
        "outputs": list(found.measured.outputs),
        "units": list(found.measured.units),
        "mean_error": found.error,
        "mean_noise": found.noise,
        "warnings": list(found.warnings),
    }


def _print_identification(found: IdentificationResult, console: Console) -> None:
    guess = found.first_guess
    shown = found.determination
    rows = []
    for e in shown.parameters:
        first = "-" if guess is None else f"{getattr(guess, e.name):.5g}"
        rows.append([e.name, e.unit, e.status, first, f"{e.value:.5g}", _interval(e.interval)])
    place = "" if found.position != found.position else f" at y/L = {found.position:g}"
    title = f"The head from {found.record}{place}, base {found.base}"
    level = f"{100 * shown.level:g} % interval"
    show(console, title, ["parameter", "unit", "status", "first guess", "fit", level], rows, "lll")
    say(console, "")
    rows = [[e.name, e.unit, e.status, f"{e.value:.5g}", _interval(e.interval)] for e in shown.combinations]
    title = f"What the tool can tell: {shown.n_determined} directions of ten are determined"
    show(console, title, ["combination", "unit", "status", "value", level], rows, "lll")
    say(console, "")
    for output, unit, error, noise in zip(
        found.measured.outputs, found.measured.units, found.error, found.noise, strict=True
    ):
        say(console, f"{output}: mean error {error:.3g} {unit}, of noise alone {noise:.3g}")


def _interval(interval: tuple[float, float] | None) -> str:
    return "-" if interval is None else f"{interval[0]:.5g} to {interval[1]:.5g}"
