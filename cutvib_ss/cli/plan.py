"""The command that asks of a campaign, before any test, what it could tell."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import (
    JsonOption,
    MachineOption,
    PositionsOption,
    check_places,
    check_position_given,
    limits,
    load_model,
)
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show, working
from cutvib_ss.errors import ParameterError

if TYPE_CHECKING:
    from rich.console import Console

    from cutvib_ss.diagnosis.plan import Plan, PlannedCause

_LISTED = 12


def plan_command(
    positions: PositionsOption = None,
    levels: Annotated[
        list[float] | None,
        typer.Option("--level", metavar="N", help="Peak force of blows [N]; may be given several times."),
    ] = None,
    channels: Annotated[
        list[str] | None,
        typer.Option("--channel", metavar="NAME", help="Response channel; all of the model by default."),
    ] = None,
    blows: Annotated[int, typer.Option("--blows", min=1, help="Blows at each position and level.")] = 3,
    band: Annotated[str, typer.Option("--band", metavar="LO:HI", help="Band that the hammer excites [Hz].")] = "15:450",
    block: Annotated[float, typer.Option("--block", metavar="S", help="Length of a record \\[s].")] = 2.0,
    noise: Annotated[
        float, typer.Option("--noise", metavar="DENSITY", help="Noise of a response channel \\[its unit/√Hz].")
    ] = 7e-4,
    error: Annotated[
        float,
        typer.Option("--error", metavar="FRACTION", help="Relative error of a response beyond its noise."),
    ] = 0.003,
    laws: Annotated[bool, typer.Option(help="Include causes that depend on the force level.")] = True,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Which causes a planned campaign could see and tell apart, and how little of each, before any test."""
    check_outputs(json)
    lines = limits(band, "15:450")
    # before the libraries that the plan needs are loaded
    if min([*(levels or [1.0]), block, noise]) <= 0 or error < 0:
        raise ParameterError("--level, --block and --noise must be above zero, --error not below")
    check_position_given(machine, positions)
    model = load_model(machine)
    places = check_places(model, positions)
    from cutvib_ss.diagnosis.plan import PlannedCampaign, plan

    with working("asking about every cause"):
        found = plan(
            model,
            PlannedCampaign(
                positions=tuple(places or ()),
                levels=tuple(levels or (50.0,)),
                channels=tuple(channels or model.channels),
                blows=blows,
                band=lines,
                block=block,
                noise=noise,
                error=error,
            ),
            laws=laws,
        )
    if not give_json(_data(found), json):
        _print(found, results())


_KEYS = {"levels": "levels_n", "band": "band_hz", "block": "block_s", "noise": "noise_si_per_sqrt_hz"}
"""Keys of the JSON that say a unit."""


def _data(found: Plan) -> dict[str, Any]:
    return {
        "schema": "cutvib-plan/1",
        "campaign": {_KEYS.get(name, name): value for name, value in asdict(found.campaign).items()},
        "threshold_log_evidence": found.threshold,
        "causes": [asdict(c) for c in found.causes],
        "pairs": [{"cause": a, "rival": b, "told_apart": factor} for a, b, factor in found.pairs],
    }


def _print(found: Plan, console: Console) -> None:
    rows: list[tuple[str, ...]] = []
    for c in found.causes:
        spread = "" if c.seen_best == c.seen_worst else f"{_value(c, c.seen_best)} to {_value(c, c.seen_worst)}"
        rival = f"{c.rival}, until {c.told_apart:.2g} times as strong" if c.rival else ""
        unit = "" if c.unit in ("", "1") else f" [{c.unit}]"
        rows.append((c.name, f"{c.parameter}{unit}", _from(c, c.seen), spread, _from(c, c.named), rival))
    heads = ["cause", "told by", "seen from", "over its shapes", "named from", "taken for"]
    show(console, "What the planned campaign could tell", heads, rows, "llrlrl")
    say(console, "")
    if found.pairs:
        say(console, "Longest confused:")
        for one, other, factor in found.pairs[:_LISTED]:
            say(console, f"  {one} with {other}, up to {factor:.2g} times the severity at which it is seen")
    else:
        say(console, "No two causes are confused once they are seen.")


def _value(c: PlannedCause, value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _from(c: PlannedCause, value: float | None) -> str:
    if value is None:
        return "no"
    if c.weak_end == "whole":
        return "yes"
    return f"{'below ' if c.weak_end == 'infinity' else ''}{value:.3g}"
