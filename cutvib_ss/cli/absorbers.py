"""Commands of the tuned vibration absorber."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import JsonOption, MachineOption, PositionsOption, frequencies, load_machine
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show

if TYPE_CHECKING:
    from cutvib_ss.parameters import AbsorberParameters
    from cutvib_ss.results import AbsorberCheck


def absorber_check_command(
    position: PositionsOption = None,
    frequency: Annotated[float, typer.Option("--frequency", help="Tuning frequency [Hz].")] = 212.0,
    damping_ratio: Annotated[float, typer.Option("--damping-ratio", help="Damping ratio of the absorber.")] = 0.04,
    mass: Annotated[float, typer.Option("--mass", help="Mass of the absorber [kg].")] = 0.08,
    working_frequency: Annotated[
        float, typer.Option("--working-frequency", help="Frequency of the tool's force [Hz].")
    ] = 217.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Picture of the responses: .png, .svg or .pdf."),
    ] = None,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """What an absorber on the tool does (Table 7's by default), at given positions and over the whole rail."""
    check_outputs(out, json)
    import numpy as np

    from cutvib_ss.absorber import check_absorber
    from cutvib_ss.parameters import AbsorberParameters

    model = load_machine(machine, "cutvib absorber")
    chosen = AbsorberParameters(frequency, damping_ratio, mass)
    given = check_absorber(model, chosen, position or [1 / 3, 1 / 2], working_frequency)
    over = check_absorber(model, chosen, np.arange(1, 50) / 50, working_frequency, freq=[working_frequency])
    if out is not None:
        from cutvib_ss.plot.response import absorber_effect
        from cutvib_ss.plot.style import check_picture, save

        save(absorber_effect(given), check_picture(out))
    data = {
        "schema": "cutvib-absorber/1",
        "absorber": _absorber_data(chosen),
        "working_frequency_hz": working_frequency,
        **_check_data(given),
        "peaks_before_hz": given.peaks_before,
        "peaks_after_hz": given.peaks_after,
        "workspace": _check_data(over),
    }
    if give_json(data, json):
        return
    rows = [
        [f"{y:.4g}", f"{b:.3f}", f"{a:.3f}", f"{100 * r:.1f}", _list(p), _list(q)]
        for y, b, a, r, p, q in zip(
            given.positions, given.before, given.after, given.reduction, given.peaks_before, given.peaks_after,
            strict=True,
        )
    ]  # fmt: skip
    columns = ["y/L", "before [m/s²/N]", "after [m/s²/N]", "less by [%]", "peaks before [Hz]", "peaks after [Hz]"]
    console = results()
    show(console, f"Accelerance XX at {working_frequency:g} Hz", columns, rows)
    worst = int(np.argmin(over.reduction))
    say(
        console,
        f"Over the rail (y/L = 0.02 to 0.98): less by {100 * over.reduction.min():.1f} to "
        f"{100 * over.reduction.max():.1f} %, least at y/L = {over.positions[worst]:.2f}; "
        f"most left is {over.worst[1]:.3f} m/s²/N at y/L = {over.worst[0]:.2f}",
    )
    if out is not None:
        say(console, f"picture: {out}")


def absorber_design_command(
    position: PositionsOption = None,
    mass: Annotated[float, typer.Option("--mass", help="Mass of the absorber [kg].")] = 0.08,
    tuning: Annotated[
        str, typer.Option("--tuning", metavar="LO:HI:STEP", help="Tuning frequencies to try [Hz].")
    ] = "200:250:1",
    damping_ratio: Annotated[
        list[float] | None,
        typer.Option("--damping-ratio", help="Damping ratio to try; may be given several times."),
    ] = None,
    working_frequency: Annotated[
        float, typer.Option("--working-frequency", help="Frequency of the tool's force [Hz].")
    ] = 217.0,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """The absorber of a given mass whose worst position is the best, over tunings and dampings."""
    check_outputs(json)
    import numpy as np

    from cutvib_ss.absorber import parametric_study

    model = load_machine(machine, "cutvib absorber")
    study = parametric_study(
        model,
        position or [1 / 3, 1 / 2],
        mass,
        frequencies(tuning),
        np.array(damping_ratio) if damping_ratio else None,
        working_frequency,
    )
    data = {
        "schema": "cutvib-absorber-design/1",
        "best": _absorber_data(study.best),
        "working_frequency_hz": working_frequency,
        "positions": study.positions,
        "before_m_per_s2_per_n": study.before,
        "tuning_hz": study.tuning,
        "damping_ratio": study.damping_ratio,
        "worst_m_per_s2_per_n": study.worst,
    }
    if give_json(data, json):
        return
    rows = []
    for j, ratio in enumerate(study.damping_ratio):
        i = int(np.argmin(study.worst[:, j]))
        rows.append([f"{ratio:g}", f"{study.tuning[i]:g}", f"{study.worst[i, j]:.3f}"])
    console = results()
    title = f"Absorbers of {mass:g} kg: the best tuning for each damping"
    show(console, title, ["damping ratio", "tuning [Hz]", "worst accelerance [m/s²/N]"], rows)
    best = study.best
    say(
        console,
        f"Best: {best.frequency:g} Hz, damping ratio {best.damping_ratio:g}, k = {best.stiffness:.6g} N/m, "
        f"c = {best.damping:.4g} N s/m; worst position {study.worst.min():.3f} m/s²/N, "
        f"without absorber {study.before.max():.3f}",
    )


def _absorber_data(absorber: AbsorberParameters) -> dict[str, float]:
    return {
        "frequency_hz": absorber.frequency,
        "damping_ratio": absorber.damping_ratio,
        "mass_kg": absorber.mass,
        "stiffness_n_per_m": absorber.stiffness,
        "damping_n_s_per_m": absorber.damping,
    }


def _check_data(check: AbsorberCheck) -> dict[str, Any]:
    return {
        "positions": check.positions,
        "before_m_per_s2_per_n": check.before,
        "after_m_per_s2_per_n": check.after,
        "reduction": check.reduction,
    }


def _list(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:.1f}" for v in values) or "-"
