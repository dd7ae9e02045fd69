"""Commands that need a model and no measurement."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import (
    FormName,
    FreqOption,
    JsonOption,
    MachineOption,
    PictureFileOption,
    PositionOption,
    PositionsOption,
    check_places,
    check_position_given,
    frequencies,
    load_machine,
    load_model,
    picture,
)
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show, working
from cutvib_ss.errors import ParameterError
from cutvib_ss.files import check_picture, check_target, made_folder

if TYPE_CHECKING:
    from cutvib_ss.model.machine import Machine
    from cutvib_ss.results import FloatArray, FrequencyResponse, Modes

_OutputsOption = Annotated[
    list[str] | None,
    typer.Option("--output", metavar="NAME", help="Channel or port to read; by default all channels."),
]
_InputOption = Annotated[
    list[str] | None,
    typer.Option(
        "--input", metavar="PORT", help="Where the force acts: a port, or rail@0.25; by default on the tool in X."
    ),
]
_FormOption = Annotated[
    FormName | None,
    typer.Option("--form", help="By default accelerance; each channel's own for another structure."),
]

_TITLES = {
    "first_guess": "First guess (Eqs. 14-20)",
    "rail": "The rail behind Table 6",
    "fig20": "The absorber's effect (Fig. 20)",
}


def modes_command(
    position: PositionOption = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Also draw the modes of rail and head.", callback=picture),
    ] = None,
    poles: Annotated[
        Path | None,
        typer.Option("--poles", metavar="FILE", help="Also draw the poles in the s-plane.", callback=picture),
    ] = None,
    animate: Annotated[
        Path | None, typer.Option("--animate", metavar="FILE.gif", help="Also show one mode in motion.")
    ] = None,
    mode: Annotated[int, typer.Option("--mode", min=1, help="With --animate: which mode.")] = 1,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Natural frequencies, damping ratios, poles and mode shapes at a position."""
    check_outputs(json, plot, poles, animate)
    check_position_given(machine, position)
    import numpy as np

    from cutvib_ss.response.modes import modes

    model = load_model(machine)
    places = check_places(model, None if position is None else [position])
    found = modes(model, None if places is None else places[0])
    if plot is not None or poles is not None or animate is not None:
        _draw_modes(
            load_machine(machine, "cutvib modes --plot") if plot or animate else None, found, plot, poles, animate, mode
        )
    data = {
        "schema": "cutvib-modes/1",
        "position": found.position,
        "natural_freq_hz": found.natural_freq,
        "damping_ratio": found.damping_ratio,
        "poles": found.poles,
        "dofs": list(found.dofs),
        "mode_shapes": found.mode_shapes,
    }
    if give_json(data, json):
        return
    rows = []
    for k, (freq, ratio, pole) in enumerate(zip(found.natural_freq, found.damping_ratio, found.poles, strict=True)):
        shape = found.mode_shapes[:, k]
        strongest = [i for i in np.argsort(-np.abs(shape))[:3] if abs(shape[i]) > 1e-6 * np.abs(shape).max()]
        moves = ", ".join(f"{found.dofs[i]} {shape[i]:+.3g}" for i in strongest)
        rows.append([f"{k + 1}", f"{freq:.2f}", f"{100 * ratio:.3f}", f"{pole.real:.2f} {pole.imag:+.2f}j", moves])
    title = "Modes" if places is None else f"Modes with the head at y/L = {found.position:g}"
    columns = ["mode", "frequency [Hz]", "damping [%]", "pole [rad/s]", "shape, largest parts (mass-normalised)"]
    show(results(), title, columns, rows, "rrrrl")


def _draw_modes(
    machine: Machine | None, found: Modes, plot: Path | None, poles: Path | None, animate: Path | None, mode: int
) -> None:
    from cutvib_ss.plot import animate_mode, mode_shapes, s_plane, save

    if plot is not None and machine is not None:
        save(mode_shapes(machine, found), plot)
    if poles is not None:
        save(s_plane(found), poles)
    if animate is not None and machine is not None:
        animate_mode(machine, found, mode, animate)


def frf_command(
    position: PositionsOption = None,
    freq: FreqOption = "10:500:0.5",
    form: _FormOption = None,
    input: _InputOption = None,
    output: _OutputsOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Write .csv, .uff, .mat, .nc or .npz."),
    ] = None,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Frequency responses to the force; as CSV on standard output unless a file is asked for."""
    check_outputs(out, json)
    lines = _asked(machine, position, freq)
    from cutvib_ss.interchange.frf_files import frf_csv, frf_writer, write_frf

    if out is not None:
        frf_writer(out)
    frf = _response(machine, position, lines, form, input, output)
    if out is not None:
        write_frf(frf, out)
    if give_json(_frf_data("cutvib-frf/1", frf), json):
        return
    if out is None and json is None:
        sys.stdout.write(frf_csv(frf))
    else:
        _show_peaks(frf)


def bode_command(
    position: PositionsOption = None,
    freq: FreqOption = "10:500:0.5",
    form: _FormOption = None,
    input: _InputOption = None,
    output: _OutputsOption = None,
    out: PictureFileOption = Path("bode.png"),
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Bode plots at given positions."""
    check_outputs(out, json)
    lines = _asked(machine, position, freq)
    frf = _response(machine, position, lines, form, input, output)
    from cutvib_ss.plot.response import bode
    from cutvib_ss.plot.style import save

    with working("drawing"):
        save(bode(frf), out)
    if not give_json(_frf_data("cutvib-bode/1", frf), json):
        _show_peaks(frf)
        say(results(), f"picture: {out}")


def paper_command(json: JsonOption = None) -> None:
    """Every table of the paper beside what this package computes."""
    check_outputs(json)
    from cutvib_ss.paper import paper_tables

    with working("computing the paper's tables"):
        tables = paper_tables()
    if give_json({"schema": "cutvib-paper/1", "tables": tables}, json):
        return
    for name, rows in tables.items():
        title = f"Table {name}" if name.isdigit() else _TITLES.get(name, name)
        shown = [[str(r["name"]), _cell(r["printed"]), _cell(r["computed"]), str(r["note"] or "")] for r in rows]
        show(results(), title, ["name", "printed", "computed", "note"], shown, "lrrl")
        say(results(), "")


def figures_command(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the pictures; made where absent.")
    ] = Path("figures"),
    suffix: Annotated[str, typer.Option("--format", help="png, svg or pdf.")] = "png",
    json: JsonOption = None,
) -> None:
    """Figs. 15 to 20 of the paper as far as its printed values allow, each in a file of its name."""
    check_outputs(json)
    check_picture(out / f"figure.{suffix}")
    check_target(made_folder(out) / "x")
    from cutvib_ss.paper import paper_curves
    from cutvib_ss.plot.paper import FIGURES
    from cutvib_ss.plot.style import save

    files = {name: out / f"{name}.{suffix}" for name in FIGURES}
    with working("drawing the paper's figures"):
        curves = paper_curves()
        for name, figure in FIGURES.items():
            save(figure(curves), files[name])
    if give_json({"schema": "cutvib-figures/1", "figures": {n: str(f) for n, f in files.items()}}, json):
        return
    rows = [[name, str((FIGURES[name].__doc__ or "").strip()), str(file)] for name, file in files.items()]
    show(results(), "Figures", ["figure", "what it shows", "file"], rows, "lll")


def _asked(machine: Path | None, positions: list[float] | None, freq: str) -> FloatArray:
    """Positions and frequencies looked at before anything slow is imported; the frequencies."""
    check_position_given(machine, positions)
    if positions and len(set(positions)) < len(positions):
        raise ParameterError("--position: one position is given twice; leave one of them out")
    return frequencies(freq)


def _response(
    machine: Path | None,
    position: list[float] | None,
    lines: FloatArray,
    form: FormName | None,
    input: list[str] | None,
    output: list[str] | None,
) -> FrequencyResponse:
    from cutvib_ss.response.frequency import frequency_response

    model = load_model(machine)
    places = check_places(model, position)
    signals: dict[str, Any] = {"inputs": input or "force", "outputs": output or None}
    return frequency_response(model, places, lines, form=None if form is None else form.value, **signals)


def _frf_data(schema: str, frf: FrequencyResponse) -> dict[str, Any]:
    import numpy as np

    data: dict[str, Any] = {
        "schema": schema,
        "positions": frf.positions,
        "freq_hz": frf.freq,
        "outputs": list(frf.outputs),
        "inputs": list(frf.inputs),
        "units": list(frf.units),
    }
    if schema.startswith("cutvib-bode"):
        return data | {"magnitude": np.abs(frf.data), "phase_deg": np.degrees(np.angle(frf.data))}
    return data | {"re": frf.data.real, "im": frf.data.imag}


def _show_peaks(frf: FrequencyResponse) -> None:
    """Where each response is largest."""
    import numpy as np

    rows = []
    for position, block in zip(frf.positions, frf.data[:, :, 0], strict=True):
        for output, unit, values in zip(frf.outputs, frf.units, block, strict=True):
            k = int(np.nanargmax(np.abs(values)))
            place = "-" if np.isnan(position) else f"{position:.4g}"
            rows.append([output, place, f"{frf.freq[k]:.2f}", f"{abs(values[k]):.4g}", unit])
    show(results(), "Largest response", ["output", "y/L", "at [Hz]", "modulus", "unit"], rows, "lrrrl")


def _cell(value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.8g}" if abs(value) >= 1e5 else f"{value:.6g}"
    return str(value)
