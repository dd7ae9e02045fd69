"""Commands of the tuned vibration absorber."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cutvib_ss.cli.options import JsonOption, MachineOption, PositionsOption, above_zero, load_machine, picture
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show, write_all

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cutvib_ss.absorber import AbsorberTolerance, MountedAbsorber
    from cutvib_ss.model.machine import Machine


class PlaceName(StrEnum):
    """Where an absorber may sit."""

    TOOL = "tool"
    HEAD = "head"


class DirectionName(StrEnum):
    """In which direction it works."""

    X = "x"
    Z = "z"


PlaceOption = Annotated[PlaceName, typer.Option("--place", help="Where the absorber sits.")]
DirectionOption = Annotated[DirectionName, typer.Option("--direction", help="In which direction it works.")]
ToleranceOption = Annotated[
    float,
    typer.Option("--tolerance", metavar="FRACTION", help="Tolerance of its tuning, plus or minus; 0: as designed."),
]
RateToleranceOption = Annotated[
    float,
    typer.Option("--rate-tolerance", metavar="FRACTION", help="With --tolerance: tolerance of the tool's pulse rate."),
]
MachinesOption = Annotated[
    int,
    typer.Option(
        "--machines", min=0, help="With --tolerance: machines drawn within the machine's own tolerances, too."
    ),
]
WorkingOption = Annotated[
    float, typer.Option("--working-frequency", callback=above_zero, help="Frequency of the tool's force [Hz].")
]
SaveAbsorbersOption = Annotated[
    Path | None,
    typer.Option("--save-machine", metavar="FILE.toml", help="Write the machine with the absorbers as a machine.toml."),
]
PlotOption = Annotated[
    Path | None,
    typer.Option("--plot", "--out", metavar="FILE", help="Picture: .png, .svg or .pdf.", callback=picture),
]


def absorber_check_command(
    position: PositionsOption = None,
    frequency: Annotated[
        float, typer.Option("--frequency", callback=above_zero, help="Tuning frequency [Hz].")
    ] = 212.0,
    damping_ratio: Annotated[
        float, typer.Option("--damping-ratio", min=0.0, help="Damping ratio of the absorber.")
    ] = 0.04,
    mass: Annotated[float, typer.Option("--mass", callback=above_zero, help="Mass of the absorber \\[kg].")] = 0.08,
    working_frequency: WorkingOption = 217.0,
    place: PlaceOption = PlaceName.TOOL,
    direction: DirectionOption = DirectionName.X,
    tolerance: ToleranceOption = 0.0,
    rate_tolerance: RateToleranceOption = 0.01,
    machines: MachinesOption = 0,
    plot: PlotOption = None,
    machine: MachineOption = None,
    json: JsonOption = None,
    save_machine: SaveAbsorbersOption = None,
) -> None:
    """What an absorber does (by default Table 7's on the tool), at given positions and over the whole rail."""
    check_outputs(plot, json, save_machine)
    import numpy as np

    from cutvib_ss.absorber import HarmonicForce, MountedAbsorber, check_absorber, workspace_check
    from cutvib_ss.parameters import AbsorberParameters

    model = load_machine(machine, "cutvib absorber")
    port = f"{place.value}_{direction.value}"
    chosen = MountedAbsorber(AbsorberParameters(frequency, damping_ratio, mass), port)
    given = check_absorber(
        model, chosen.absorber, position or [1 / 3, 1 / 2], working_frequency=working_frequency, port=port
    )
    force, box = HarmonicForce.tone(working_frequency), tolerance_box(tolerance, rate_tolerance, machines)
    over = workspace_check(model, [chosen], np.arange(1, 50) / 50, force=force, tolerance=box)
    if plot is not None:
        from cutvib_ss.plot.response import absorber_effect
        from cutvib_ss.plot.style import save

        save(absorber_effect(given), plot)
    save_absorbers(model, [chosen], save_machine)
    data = {
        "schema": "cutvib-absorber/1",
        "absorber": absorber_data(chosen),
        "working_frequency_hz": working_frequency,
        "positions": given.positions,
        "before_m_per_s2_per_n": given.before,
        "after_m_per_s2_per_n": given.after,
        "reduction": given.reduction,
        "peaks_before_hz": given.peaks_before,
        "peaks_after_hz": given.peaks_after,
        "workspace": {
            "positions": over.positions,
            "before_m_per_s2_per_n": over.before,
            "after_m_per_s2_per_n": over.exact,
            "toleranced_m_per_s2_per_n": over.toleranced,
            "reduction": 1.0 - over.exact / over.before,
        },
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
    kept = over.exact / over.before
    say(
        console,
        f"Over the rail (y/L = 0.02 to 0.98): less by {100 * (1 - kept.max()):.1f} to {100 * (1 - kept.min()):.1f} %, "
        f"least at y/L = {over.positions[kept.argmax()]:.2f}; most left is {over.worst[1]:.3f} m/s²/N "
        f"at y/L = {over.positions[over.exact.argmax()]:.2f}",
    )
    if tolerance:
        say(console, f"At worst within tolerance {over.worst[2]:.3f} m/s²/N")
    if plot is not None:
        say(console, f"picture: {plot}")


def tolerance_box(tolerance: float, rate: float, machines: int) -> AbsorberTolerance:
    """The box that the options ask for; nothing varies where no tolerance is given."""
    from cutvib_ss.absorber import EXACT, AbsorberTolerance

    return AbsorberTolerance(frequency=tolerance, rate=rate, machines=machines) if tolerance else EXACT


def save_absorbers(model: Machine, mounted: Sequence[MountedAbsorber], target: Path | None) -> None:
    """Write the machine with absorbers, where that is asked for."""
    from cutvib_ss.absorber import attach_absorbers
    from cutvib_ss.model_files import write_machine

    if target is not None:
        write_all({target: lambda draft: write_machine(attach_absorbers(model, mounted), draft)})


def absorber_data(mounted: MountedAbsorber) -> dict[str, float | str]:
    """An absorber for JSON."""
    absorber = mounted.absorber
    return {
        "port": mounted.port,
        "frequency_hz": absorber.frequency,
        "damping_ratio": absorber.damping_ratio,
        "mass_kg": absorber.mass,
        "stiffness_n_per_m": absorber.stiffness,
        "damping_n_s_per_m": absorber.damping,
    }


def _list(values: tuple[float, ...]) -> str:
    return ", ".join(f"{v:.1f}" for v in values) or "-"
