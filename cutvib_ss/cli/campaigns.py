"""Commands that read a measurement campaign."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from fnmatch import fnmatchcase
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import CampaignArgument, JsonOption, NominalOption, SaveMachineOption, limits, load_model
from cutvib_ss.cli.output import check_outputs, give_json, messages, results, say, show, text_writer, working, write_all
from cutvib_ss.cli.progress import progress
from cutvib_ss.errors import ParameterError
from cutvib_ss.units import percent

if TYPE_CHECKING:
    from rich.console import Console

    from cutvib_ss.diagnosis.result import Diagnosis
    from cutvib_ss.effects.base import Model
    from cutvib_ss.identification.identify import IdentificationResult
    from cutvib_ss.measurement.records import Campaign

_SHOWN = 5


class BaseName(StrEnum):
    """How the base is taken in the fit of the head."""

    HELD = "held"
    RAIL = "rail"


def diagnose_command(
    campaign: CampaignArgument,
    json: JsonOption = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="FILE.html", help="Write the report as one self-contained page."),
    ] = None,
    hold_out: Annotated[
        float | None,
        typer.Option(
            "--hold-out", metavar="FRACTION", help="Fraction of the records that is held out of the fit, to judge on."
        ),
    ] = None,
    band: Annotated[
        str | None, typer.Option("--band", metavar="LO:HI", help="Frequency band to use, for all records [Hz].")
    ] = None,
    records: Annotated[
        list[str] | None,
        typer.Option(
            "--records",
            metavar="GLOB",
            help="Use only records whose file matches, such as 'records/p[12]*'; may be given several times.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Same input and seed, same output.")] = 0,
    jobs: Annotated[int, typer.Option("--jobs", min=1, help="Processes to use.")] = 1,
    effort: Annotated[
        float,
        typer.Option(
            "--effort",
            metavar="FACTOR",
            help="How much may be computed before further steps are left out, times the default.",
        ),
    ] = 1.0,
    machine: NominalOption = None,
    save_machine: SaveMachineOption = None,
) -> None:
    """
    Where model and measurement differ, which cause explains it, and how much of the gap it closes.

    Takes minutes. A diagnosis that is stopped cannot be resumed: it starts anew, and writes nothing before it is complete.
    """
    if hold_out is not None and not 0.0 < hold_out < 1.0:
        raise ParameterError(f"--hold-out {hold_out:g} must lie strictly between 0 and 1")
    lines = None if band is None else limits(band, "150:300")
    check_outputs(json, report, save_machine)
    found = diagnosis_of(campaign, machine, hold_out, seed, jobs, lines, tuple(records or ()), effort)
    again = _command(campaign, machine, hold_out, seed, band, records or (), effort)
    give_diagnosis(found, json, report, save_machine, again)
    if json != "-":
        print_diagnosis(found, results())


def identify_command(
    campaign: CampaignArgument,
    base: Annotated[
        BaseName, typer.Option("--base", help="Fit with the base held, as the paper does, or moving with the rail.")
    ] = BaseName.RAIL,
    band: Annotated[str, typer.Option("--band", metavar="LO:HI", help="Band of the fit [Hz].")] = "150:300",
    machine: NominalOption = None,
    json: JsonOption = None,
    save_machine: SaveMachineOption = None,
) -> None:
    """First guess and bounded fit of the head's ten parameters, and what the records determine of them."""
    lines = limits(band, "150:300")
    check_outputs(json, save_machine)
    from cutvib_ss.identification.identify import identify
    from cutvib_ss.measurement.campaign import read_campaign
    from cutvib_ss.model_files import write_machine

    with working("reading and fitting"):
        measured = read_campaign(campaign, None if machine is None else load_model(machine))
        found = identify(measured, base=base.value, band=lines)
    fitted = found.machine
    if save_machine is not None and fitted is not None:
        write_all({save_machine: lambda draft: write_machine(fitted, draft)})
    for warning in (*measured.warnings, *found.warnings):
        say(messages(), f"note: {warning}")
    if not give_json(_identify_data(found), json):
        _print_identification(found, results())


def give_diagnosis(
    found: Diagnosis, json: str | None, report: Path | None, save_machine: Path | None, command: str = ""
) -> None:
    """Write a diagnosis as JSON, page and machine.toml: all that is asked for, or nothing."""
    writers: dict[str | Path, Any] = {}
    if json is not None and json != "-":
        writers[json] = text_writer(found.to_json() + "\n")
    if report is not None:
        from cutvib_ss.report.page import report_html

        with working("writing the report"):
            writers[report] = text_writer(report_html(found, command))
    if save_machine is not None:
        from cutvib_ss.model_files import write_machine

        model, left_out = without_unknown(found.corrected_machine)
        writers[save_machine] = lambda draft: write_machine(model, draft)
        if left_out:
            say(
                messages(),
                f"note: {save_machine}: without the element of unknown form at {left_out}; no file can hold it",
            )
    write_all(writers)
    if json == "-":
        typer.echo(found.to_json())


def print_diagnosis(found: Diagnosis, console: Console) -> None:
    """A diagnosis for reading: the answer, then where, which and how far."""
    from rich.text import Text

    from cutvib_ss.plot.diagnosis import probability_text
    from cutvib_ss.report import answer, details, wording

    say(console, Text(wording.VERDICTS[found.verdict], style="bold"))
    say(console, wording.verdict_sentence(found))
    say(console, "")
    where = found.where
    places = ", ".join(f"{p} {probability_text(q)}" for p, q in where.places[:3])
    gap = found.gap
    share, interval = wording.shrinkage_text(gap)
    facts = [
        ["where", f"{where.place} ({places})" if places else where.place],
        *([["place set", ", ".join(where.place_set)]] if len(where.place_set) > 1 else []),
        ["bands", wording.bands_text(where.bands_hz)],
        ["before", f"{wording.figure(gap.before)} {gap.unit}: the model as given, on held-out records"],
        ["tuned", f"{wording.figure(gap.tuned)} {gap.unit}: no effect; tolerances are standard deviations"],
        ["after", f"{wording.figure(gap.after)} {gap.unit}: with the cause added"],
        ["noise", f"{wording.figure(gap.noise_floor)} {gap.unit}"],
        [
            "repeats",
            "not measured" if not isfinite(found.repeatability) else f"{percent(found.repeatability)} beyond noise",
        ],
        ["closed", share + (f" ({interval})" if interval else "")],
    ]
    show(console, "", ["", ""], facts, "ll")
    by_channel = details.metric_rows(found.findings.metrics, "channel")
    if by_channel:
        say(console, "")
        say(console, f"By channel, on held-out records [{gap.unit}]")
        heads = ["", "before", "tuned", "after", "second-best", "noise", "FRAC before", "after", "dB before", "after"]
        kept = [k for k, head in enumerate(heads) if head != "second-best" or details.second_judged(found)]
        table = [[row[k] for k in kept] for row in by_channel]
        show(console, "", [heads[k] for k in kept], table, "l" + "r" * (len(kept) - 1))
    heads, correlated = details.frac_rows(found.findings.frac)
    if len(correlated) > 1:
        say(console, "")
        show(
            console,
            "FRAC by position, of the model as given and with the cause",
            heads,
            correlated,
            "l" + "r" * len(heads),
        )
    modes = details.mode_rows(found.findings.modes)
    if modes:
        say(console, "")
        heads = ["y/L", "nominal [Hz]", "corrected [Hz]", "damping [%]", "corrected [%]", "MAC"]
        show(console, "Modes", heads, modes, "rrrrrr")
    say(console, "")
    rows = []
    for cause in found.causes[:_SHOWN]:
        parameters = "\n".join(f"{name} {value}" for name, value in wording.parameters_text(cause))
        part = f"{100 * cause.share:.0f} %" if isfinite(cause.share) else "-"
        probability = probability_text(cause.probability)
        rows.append([cause.effect, cause.place, parameters, probability, part, wording.figure(cause.after)])
    heads = ["cause", "place", "parameters", "probability", "share", f"left [{gap.unit}]"]
    show(console, "", heads, rows, "lll")
    if found.sizes:
        say(console, "")
        say(console, answer.sizes_sentence(found))
        listed = "; ".join(f"{name} {size}" for name, size, _ in answer.size_rows(found)[2:])
        say(console, f"Sizes in the likelihood: {listed}.")
    limits = answer.limit_rows(found)
    if limits:
        say(console, "")
        show(
            console,
            "Still allowed beside the answer",
            ["cause", "size", "allowed (95 %)", "named from"],
            limits[:_SHOWN],
            "ll",
        )
    if limits[_SHOWN:]:
        say(console, f"and {len(limits) - _SHOWN} more in the JSON and the report")
    for told in details.sentences(found):
        say(console, "")
        say(console, told)
    say(console, "")
    for step in answer.to_do(found):
        say(console, step)
    for warning in found.warnings:
        say(messages(), f"note: {warning}")


def diagnosis_of(
    campaign: Path,
    machine: Path | None,
    hold_out: float | None,
    seed: int,
    jobs: int,
    band: tuple[float, float] | None = None,
    records: Sequence[str] = (),
    effort: float = 1.0,
) -> Diagnosis:
    """The diagnosis of a campaign's files, or of some records and lines, with another nominal model where one is given."""
    with progress() as told:
        from cutvib_ss.measurement.campaign import read_campaign

        measured = read_campaign(campaign, None if machine is None else load_model(machine))
        measured = chosen(measured, band, records)
        from cutvib_ss.diagnosis.diagnose import diagnose

        return diagnose(measured, hold_out=hold_out, seed=seed, jobs=jobs, effort=effort, progress=told)


def chosen(campaign: Campaign, band: tuple[float, float] | None, records: Sequence[str]) -> Campaign:
    """A campaign with the records that match one of the patterns, and their lines in a band."""
    kept = campaign.records
    if records:
        kept = tuple(r for r in kept if any(fnmatchcase(r.name, pattern) for pattern in records))
        if not kept:
            names = ", ".join(r.name for r in campaign.records[:_SHOWN])
            raise ParameterError(f"--records {' '.join(records)}: matches no record; there are {names}")
    if band is not None:
        kept = tuple(replace(r, band_hz=band) for r in kept)
    return replace(campaign, records=kept)


def without_unknown(model: Model) -> tuple[Model, str]:
    """A corrected model without elements of unknown form, which no file can hold, and the places where they sat."""
    unknown = [e.place for e in model.effects if e.effect == "unknown"]  # type: ignore[attr-defined]
    if not unknown or model.bare is None:
        return model, ""
    known: Any = model.bare
    for effect in model.effects:
        if effect.effect != "unknown":  # type: ignore[attr-defined]
            known = effect.apply(known)  # type: ignore[attr-defined]
    return known, ", ".join(unknown)


def _command(
    campaign: Path,
    machine: Path | None,
    hold_out: float | None,
    seed: int,
    band: str | None,
    records: Sequence[str],
    effort: float,
) -> str:
    """The command that gives the same diagnosis again."""
    parts = ["cutvib", "diagnose", str(campaign)]
    parts += [] if machine is None else ["--machine", str(machine)]
    parts += [] if hold_out is None else ["--hold-out", f"{hold_out:g}"]
    parts += [] if band is None else ["--band", band]
    parts += [] if effort == 1.0 else ["--effort", f"{effort:g}"]
    for pattern in records:
        parts += ["--records", pattern]
    return shlex.join([*parts, "--seed", str(seed), "--report", "report.html"])


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
