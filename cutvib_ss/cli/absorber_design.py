"""The command that designs absorbers."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.absorbers import (
    DirectionName,
    MachinesOption,
    PlaceName,
    PlotOption,
    RateToleranceOption,
    SaveAbsorbersOption,
    ToleranceOption,
    WorkingOption,
    absorber_data,
    save_absorbers,
    tolerance_box,
)
from cutvib_ss.cli.options import (
    JsonOption,
    MachineOption,
    PositionsOption,
    above_zero,
    each_above_zero,
    frequencies,
    load_machine,
)
from cutvib_ss.cli.output import check_outputs, give_json, results, say, show, working
from cutvib_ss.errors import ParameterError

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes

    from cutvib_ss.absorber import AbsorberDesign, AbsorberStudy, WorkspaceCheck


class CriterionName(StrEnum):
    """What of a periodic acceleration counts."""

    HARMONIC = "harmonic"
    RMS = "rms"


def absorber_design_command(
    position: PositionsOption = None,
    mass: Annotated[
        list[float] | None,
        typer.Option(
            "--mass",
            callback=each_above_zero,
            help="Mass of all absorbers together \\[kg]; several: what each mass can do.",
        ),
    ] = None,
    place: Annotated[
        list[PlaceName] | None, typer.Option("--place", help="Place; given once, or once per absorber.")
    ] = None,
    direction: Annotated[
        list[DirectionName] | None, typer.Option("--direction", help="Direction; given once, or once per absorber.")
    ] = None,
    count: Annotated[int, typer.Option("--count", min=1, max=4, help="Number of absorbers at one place.")] = 1,
    tuning: Annotated[
        str, typer.Option("--tuning", metavar="LO:HI:STEP", help="Tuning frequencies to try [Hz].")
    ] = "200:250:1",
    damping_ratio: Annotated[
        list[float] | None,
        typer.Option(
            "--damping-ratio",
            callback=each_above_zero,
            help="Damping ratio to try; may be given several times; by default 0.01 to 0.05.",
        ),
    ] = None,
    working_frequency: WorkingOption = 217.0,
    harmonics: Annotated[
        int, typer.Option("--harmonics", min=1, help="More than 1: harmonics of trapezoidal pulses of 1 N.")
    ] = 1,
    duty: Annotated[float, typer.Option("--duty", help="Pulses: mean force over peak.")] = 0.3,
    rise: Annotated[
        float, typer.Option("--rise", callback=above_zero, help="Pulses: duration of the rise \\[s].")
    ] = 5e-4,
    fall: Annotated[
        float, typer.Option("--fall", callback=above_zero, help="Pulses: duration of the fall \\[s].")
    ] = 5e-4,
    output: Annotated[
        list[str] | None,
        typer.Option("--output", metavar="PORT", help="Output whose acceleration is judged; by default tool_x."),
    ] = None,
    criterion: Annotated[
        CriterionName, typer.Option("--criterion", help="Criterion: the largest harmonic, or the RMS of all.")
    ] = CriterionName.HARMONIC,
    tolerance: ToleranceOption = 0.0,
    rate_tolerance: RateToleranceOption = 0.01,
    machines: MachinesOption = 0,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Same input and seed, same output.")] = 0,
    plot: PlotOption = None,
    machine: MachineOption = None,
    json: JsonOption = None,
    save_machine: SaveAbsorbersOption = None,
) -> None:
    """The absorbers of a given mass whose worst over the rail is the best: a study over a grid, then the optimum between."""
    check_outputs(plot, json, save_machine)
    tunings = frequencies(tuning)
    import numpy as np

    from cutvib_ss.absorber import HarmonicForce, MountedAbsorber, mass_front, parametric_study, workspace_check
    from cutvib_ss.absorber.workspace import WORKSPACE
    from cutvib_ss.parameters import table_7

    model = load_machine(machine, "cutvib absorber")
    masses, ports = mass or [0.08], _ports(place, direction, count)
    if save_machine is not None and len(masses) > 1:
        raise ParameterError("--save-machine: several masses give several machines; name one mass")
    where = np.asarray(position) if position else WORKSPACE
    dampings = np.array(damping_ratio) if damping_ratio else np.arange(10, 51, 5) / 1000
    force = HarmonicForce.tone(working_frequency)
    if harmonics > 1:
        force = HarmonicForce.pulses(working_frequency, duty, rise, fall, harmonics=harmonics)
    box = tolerance_box(tolerance, rate_tolerance, machines)
    judged: dict[str, Any] = {
        "positions": where, "force": force, "outputs": tuple(output or ["tool_x"]), "criterion": criterion.value,
        "tolerance": box,
    }  # fmt: skip
    with working("designing"):
        studies = [
            parametric_study(
                model,
                where,
                mass=m,
                tuning=tunings,
                damping_ratio=dampings,
                working_frequency=working_frequency,
                port=ports[0],
            )
            for m in masses
        ]
        study = studies[0]
        ends = {"tuning": (tunings[0], tunings[-1]), "damping_ratio": (dampings.min(), dampings.max())}
        front = mass_front(model, masses, ports=ports, seed=seed, **ends, **judged)
        baseline = workspace_check(model, [MountedAbsorber(table_7())], **judged)
        if plot is not None:
            from cutvib_ss.plot.style import save

            save(_picture(study, front, baseline), plot)
    save_absorbers(model, front[0].mounted, save_machine)
    data = {
        "schema": "cutvib-absorber-design/1",
        "best": absorber_data(MountedAbsorber(study.best, ports[0])),
        "working_frequency_hz": working_frequency,
        "positions": study.positions,
        "before_m_per_s2_per_n": study.before,
        "tuning_hz": study.tuning,
        "damping_ratio": study.damping_ratio,
        "worst_m_per_s2_per_n": study.worst,
        "force": {"freq_hz": force.freq, "amplitude_n": force.amplitude},
        "optimum": _check_data(front[0].check),
        "table_7": _check_data(baseline),
        "front": [
            _check_data(design.check) | {"grid_worst_m_per_s2_per_n": s.worst}
            for design, s in zip(front, studies, strict=True)
        ],
    }
    if not give_json(data, json):
        _tell(study, front, baseline, plot)


def _ports(place: list[PlaceName] | None, direction: list[DirectionName] | None, count: int) -> list[str]:
    places, directions = place or [PlaceName.TOOL], direction or [DirectionName.X]
    n = max(len(places), len(directions), count)
    for option, given in (("--place", places), ("--direction", directions)):
        if len(given) not in (1, n):
            raise ParameterError(f"{option} is given {len(given)} times for {n} absorbers; give it once, or {n} times")
    return [f"{places[k % len(places)].value}_{directions[k % len(directions)].value}" for k in range(n)]


def _check_data(check: WorkspaceCheck) -> dict[str, Any]:
    before, exact, toleranced = check.worst
    return {
        "absorbers": [absorber_data(m) for m in check.mounted],
        "mass_kg": check.mass,
        "before_m_per_s2": check.before,
        "after_m_per_s2": check.exact,
        "toleranced_m_per_s2": check.toleranced,
        "worst_m_per_s2": {"before": before, "after": exact, "toleranced": toleranced},
    }


def _picture(study: AbsorberStudy, front: tuple[AbsorberDesign, ...], baseline: WorkspaceCheck) -> Axes:
    from cutvib_ss.plot.absorber import absorber_front, absorber_study, absorbers_over_the_rail

    if len(front) > 1:
        return absorber_front({"best of each mass": front}, {"Table 7": baseline})
    if len(front[0].mounted) > 1 or study.worst.size < 2 or min(study.worst.shape) < 2:
        return absorbers_over_the_rail({"Table 7": baseline, "optimum": front[0].check})
    return absorber_study(study, {"optimum": front[0].mounted[0].absorber, "Table 7": baseline.mounted[0].absorber})


def _tell(study: AbsorberStudy, front: tuple[AbsorberDesign, ...], baseline: WorkspaceCheck, plot: Path | None) -> None:
    console, best = results(), study.best
    rows = []
    for j, ratio in enumerate(study.damping_ratio):
        i = int(study.worst[:, j].argmin())
        rows.append([f"{ratio:g}", f"{study.tuning[i]:g}", f"{study.worst[i, j]:.3f}"])
    title = f"Absorbers of {best.mass:g} kg: the best tuning for each damping"
    show(console, title, ["damping ratio", "tuning [Hz]", "worst accelerance [m/s²/N]"], rows)
    say(
        console,
        f"Best: {best.frequency:g} Hz, damping ratio {best.damping_ratio:g}, k = {best.stiffness:.6g} N/m, "
        f"c = {best.damping:.4g} N s/m; worst position {study.worst.min():.3f} m/s²/N, "
        f"without absorber {study.before.max():.3f}\n",
    )
    named = [("Table 7", baseline), *(("optimum", design.check) for design in front)]
    rows = [["nothing", "-", "-", "-", "-", "0", f"{baseline.worst[0]:.4g}", "-"]]
    for name, check in named:
        for k, m in enumerate(check.mounted):
            a = m.absorber
            own = [m.port, f"{a.frequency:.2f}", f"{a.damping_ratio:.4f}", f"{a.stiffness:.6g}", f"{a.mass:.4g}"]
            rows.append([name if k == 0 else "", *own, *(f"{v:.4g}" if k == 0 else "" for v in check.worst[1:])])
    columns = [
        "absorber", "port", "tuning [Hz]", "damping", "k [N/m]", "mass [kg]", "worst [m/s²]", "in tolerance [m/s²]"
    ]  # fmt: skip
    show(console, "The largest acceleration over the rail", columns, rows, "llrrrrrr")
    if plot is not None:
        say(console, f"picture: {plot}")
