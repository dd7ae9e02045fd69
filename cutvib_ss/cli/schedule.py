"""The command that shows the machine over the whole rail."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import (
    FreqOption,
    JsonOption,
    MachineOption,
    PictureFileOption,
    frequencies,
    load_machine,
    picture,
)
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show, working

if TYPE_CHECKING:
    from cutvib_ss.plant import PlantSchedule
    from cutvib_ss.results import FloatArray

WORKING_HARMONICS = (217.0, 434.0, 651.0)
"""The tool's harmonics that are marked in the picture [Hz]."""


class InterpolationName(StrEnum):
    """How a table over positions is read."""

    LINEAR = "linear"
    CUBIC = "cubic"


def _picture(option: str, what: str) -> Any:
    return typer.Option(option, metavar="FILE", help=f"Also draw {what}.", callback=picture)


def schedule_command(
    positions: Annotated[
        int, typer.Option("--positions", min=5, max=2001, help="Number of positions over the rail.")
    ] = 99,
    freq: FreqOption = "5:600:1",
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            metavar="NAME",
            help="Channel or port to map; the first is drawn beside the frequencies. Default: tool_x.",
        ),
    ] = None,
    out: PictureFileOption = Path("schedule.png"),
    poles: Annotated[Path | None, _picture("--poles", "the poles over positions")] = None,
    bode: Annotated[Path | None, _picture("--bode", "maps of magnitude and phase, one for each output")] = None,
    grid: Annotated[int, typer.Option("--grid", min=2, max=2001, help="Grid points of the table of plants.")] = 33,
    interpolation: Annotated[
        InterpolationName, typer.Option("--interpolation", help="How the table is read between its grid points.")
    ] = InterpolationName.CUBIC,
    table: Annotated[
        Path | None, typer.Option("--table", metavar="FILE", help="Write the plants at the grid points: .mat or .npz.")
    ] = None,
    error: Annotated[Path | None, _picture("--error", "the table's error between its points, and its bound")] = None,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Natural frequencies, damping and responses over the whole rail; the plants as a table, with its error."""
    check_outputs(out, poles, bode, table, error, json)
    lines, outputs = frequencies(freq), output or ["tool_x"]
    import numpy as np

    from cutvib_ss.interchange.plant_files import check_plant_file, write_plant
    from cutvib_ss.plant import schedule as family_over
    from cutvib_ss.plot.schedule import bode_map, interpolation_error, pole_map, schedule
    from cutvib_ss.plot.style import save
    from cutvib_ss.response.frequency import frequency_response
    from cutvib_ss.response.modes import track_modes

    pictures = [p for p in (out, poles, bode, error) if p is not None]
    if table is not None:
        check_plant_file(table)
    model = load_machine(machine, "cutvib schedule")
    places = np.arange(1, positions + 1) / (positions + 1)
    with working("following the modes along the rail"):
        tracked = track_modes(model, places)
        frf = frequency_response(model, places, lines, outputs=outputs)
        marks = [f for f in WORKING_HARMONICS if lines[0] <= f <= lines[-1]]
        save(schedule(tracked, frf.sel(output=outputs[0]), marks=marks), out)
        if poles is not None:
            save(pole_map(tracked, float(lines[-1])), poles)
        if bode is not None:
            save(bode_map(frf), bode)
    data: dict[str, Any] = {
        "schema": "cutvib-schedule/1",
        "positions": tracked.positions,
        "natural_freq_hz": tracked.natural_freq,
        "damping_ratio": tracked.damping_ratio,
        "poles": tracked.poles,
        "mac": tracked.mac,
    }
    if table is not None or error is not None:
        points = np.linspace(places[0], places[-1], grid)
        family = family_over(model, points, outputs=outputs, quantity="acceleration", interpolation=interpolation.value)
        with working("comparing the table with the plants between its points"):
            response, wrong, bound = _between(family, lines)
            if error is not None:
                title = f"Table of {grid} plants, {interpolation.value} between them: {outputs[0]} / force"
                save(interpolation_error(lines, response, wrong, bound, "m/s^2/N", title), error)
            if table is not None:
                write_plant(family, table)
        data["table"] = {
            "positions": family.positions,
            "interpolation": interpolation.value,
            "outputs": outputs,
            "largest_error": wrong.max(),
            "largest_bound": bound.max(),
            "largest_response": response.max(),
        }
    if give_json(data, json):
        return
    rows = []
    for k in range(tracked.natural_freq.shape[1]):
        frequency, ratio = tracked.natural_freq[:, k], 100 * tracked.damping_ratio[:, k]
        rows.append([f"{k + 1}", *(f"{v:.2f}" for v in (frequency.min(), frequency.max(), ratio.min(), ratio.max()))])
    columns = ["mode", "lowest [Hz]", "highest [Hz]", "least damped [%]", "most damped [%]"]
    console = results()
    show(console, f"Modes over {positions} positions", columns, rows)
    if "table" in data:
        t = data["table"]
        say(
            console,
            f"Table of {grid} plants, {interpolation.value} between them: largest error of {outputs[0]} "
            f"{t['largest_error']:.3g} m/s²/N of {t['largest_response']:.3g}, never more than {t['largest_bound']:.3g}",
        )
    if table is not None:
        say(console, f"table: {table}")
    say(console, f"picture: {', '.join(map(str, pictures))}")


def _between(family: PlantSchedule, lines: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Moduli of the first output's response, of the table's error and of its bound, half way between grid points."""
    import numpy as np

    half_way = (family.positions[:-1] + family.positions[1:]) / 2
    response = np.abs(family.frequency_response(half_way, lines).data)[:, 0, 0]
    return response, family.error(half_way, lines)[:, 0, 0], family.error_bound(half_way, lines)[:, 0, 0]
