"""Commands of the controller prototypes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cutvib_ss.cli.options import JsonOption, MachineOption, existing_machines, load_machine, picture, position_value
from cutvib_ss.cli.output import (
    check_outputs,
    give_json,
    json_text,
    results,
    say,
    show,
    text_writer,
    working,
    write_all,
)
from cutvib_ss.errors import ParameterError

if TYPE_CHECKING:
    import control

    from cutvib_ss.control_design import AmplitudeMargins, ControllerCheck, Hardware, ScheduledController
    from cutvib_ss.model.machine import Machine

_FAMILY = 31
"""Positions at which a controller scheduled over the rail is designed; the check visits others."""

_LOOP_POSITIONS = 7
"""Positions at which loops around nonlinear elements are looked at."""
_FORCES = (1.0, 10.0, 100.0, 1000.0)
"""Amplitudes of the cutting force [N] that set the amplitudes there."""

_PositionOption = Annotated[
    float,
    typer.Option(
        "--position", metavar="Y", parser=position_value, help="y_b / L at which a controller without @ is designed."
    ),
]
_ActuatorOption = Annotated[
    str | None,
    typer.Option(
        "--actuator",
        metavar="PORT",
        help="Where the actuator sits: head_x, tool_x, base; by default that of each kind.",
    ),
]
_RateOption = Annotated[
    float,
    typer.Option("--rate", metavar="HZ", min=0.0, help="Sampling rate; 0: analogue. The command is one period late."),
]
_OrderOption = Annotated[
    int | None, typer.Option("--order", min=1, help="Reduce controllers to this many states (balanced truncation).")
]


def control_design_command(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="lqg, h2, hinf, resonant, ppf or active-absorber; @Y or @rail after it."),
    ],
    position: _PositionOption = 0.5,
    actuator: _ActuatorOption = None,
    rate: _RateOption = 10_000.0,
    order: _OrderOption = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.json", help="Write the controller, for `control check`.")
    ] = None,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Design a controller for the tool's 217 Hz at a position, or (@rail) a family scheduled over the whole rail."""
    check_outputs(out, json)
    import numpy as np

    from cutvib_ss.control_design import ScheduledController, check_controller, controller_data

    model = load_machine(machine, "cutvib control")
    label, made, hardware = _controller(name, model, position, actuator, rate, order)
    places = (
        made.positions if isinstance(made, ScheduledController) else np.array([_place(name, position)], dtype=float)
    )
    with working("checking at the positions of the design"):
        check = check_controller(made, model, places, hardware, label)
    data = controller_data(made, hardware)
    if out is not None:
        write_all({out: text_writer(json_text(data))})
    if give_json(data, json):
        return
    console = results()
    first = made.controllers[0] if isinstance(made, ScheduledController) else made
    say(console, f"{', '.join(first.input_labels)} to {', '.join(first.output_labels)}, {first.nstates} states")
    _show([check], "Where it was designed, on all modes of the rail")
    if out is not None:
        say(console, f"controller: {out}")


def control_check_command(
    controllers: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CONTROLLER]...",
            help="NAME, NAME@Y, NAME@rail (scheduled) or FILE.json; by default every kind, scheduled.",
        ),
    ] = None,
    corrected: Annotated[
        list[Path] | None,
        typer.Option(
            "--corrected",
            metavar="FILE.toml",
            help="Check on this machine too; may be given several times.",
            callback=existing_machines,
        ),
    ] = None,
    positions: Annotated[int, typer.Option("--positions", min=2, max=999, help="Positions over the rail.")] = 25,
    modes: Annotated[int, typer.Option("--modes", min=1, max=200, help="Modes of the rail to check on.")] = 20,
    position: _PositionOption = 0.5,
    actuator: _ActuatorOption = None,
    rate: _RateOption = 10_000.0,
    order: _OrderOption = None,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Picture over the rail: .png, .svg or .pdf.", callback=picture),
    ] = None,
    responses: Annotated[
        Path | None,
        typer.Option(
            "--responses", metavar="FILE", help="Picture over frequency: .png, .svg or .pdf.", callback=picture
        ),
    ] = None,
    machine: MachineOption = None,
    json: JsonOption = None,
) -> None:
    """Stability, margins, attenuation at 217 Hz and effort over the whole rail, with modes that the design left out."""
    check_outputs(plot, responses, json)
    from cutvib_ss.control_design import PROTOTYPES, check_controller, check_positions

    model = load_machine(machine, "cutvib control")
    machines = {"nominal" if machine is None else machine.stem: model}
    for file in corrected or []:
        if file.stem in machines:
            raise ParameterError(f"--corrected {file}: a machine is called {file.stem} already; rename the file")
        machines[file.stem] = load_machine(file, "cutvib control")
    checks, loops = [], []
    for name in controllers or [f"{kind}@rail" for kind in PROTOTYPES]:
        with working(f"{name}: designing and checking"):
            label, made, hardware = _controller(name, model, position, actuator, rate, order)
            checks.append(check_controller(made, machines, check_positions(positions), hardware, label, modes))
            loops += _over_amplitude(label, made, machines, hardware)
    drawn = {}
    if plot is not None or responses is not None:
        from cutvib_ss.plot.control import controller_overview, controller_responses
        from cutvib_ss.plot.style import save

        with working("drawing"):
            for target, draw in ((plot, controller_overview), (responses, controller_responses)):
                if target is not None:
                    drawn[target] = draw(checks)
                    save(drawn[target], target)
    data = {
        "schema": "cutvib-control-check/1",
        "checks": [_check_data(c) for c in checks],
        "over_amplitude": [_loop_data(*row) for row in loops],
    }
    if give_json(data, json):
        return
    _show(checks, f"{positions} positions, y/L = 0.02 to 0.98; {modes} modes of the rail or more")
    _show_loops(loops)
    if drawn:
        say(results(), f"picture: {', '.join(map(str, drawn))}")


def _controller(
    name: str, model: Machine, position: float, actuator: str | None, rate: float, order: int | None
) -> tuple[str, control.StateSpace | ScheduledController, Hardware]:
    """The controller of a name or a file, and what it is called."""
    from cutvib_ss.control_design import Sampling, check_positions, prototype, read_controller, reduced, schedule

    if name.endswith(".json"):
        made, hardware = read_controller(name)
        return Path(name).stem, made, hardware
    kind = prototype(name.partition("@")[0])
    place = _place(name, position)
    if not rate < float("inf"):
        raise ParameterError(f"--rate {rate:g}: give samples per second, or 0 for an analogue controller")
    hardware = kind.hardware(actuator or kind.port, Sampling(rate, 1.0 / rate) if rate else None)

    def design(y: float) -> control.StateSpace:
        found = kind.design(model, y, hardware)
        return found if order is None else reduced(found, order)

    label = name if actuator in (None, kind.port) else f"{name}, {actuator}"
    if place is not None:
        return label, design(place), hardware
    return label, schedule(design, check_positions(_FAMILY), align=order is not None), hardware


def _place(name: str, position: float) -> float | None:
    """Where a named controller is designed; None: over the whole rail."""
    from cutvib_ss.parameters import check_position

    _, at, where = name.partition("@")
    if where == "rail":
        return None
    try:
        return check_position(float(where) if at else position)
    except ValueError:
        raise ParameterError(f"{name}: after @ comes y_b / L between 0 and 1, or rail") from None


def _show(checks: list[ControllerCheck], title: str) -> None:
    columns = [
        "controller", "machine", "stable", "left", "at y/L", "peak", "disk", "gain [dB]", "phase [°]", "delay [ms]",
        "N/N",
    ]  # fmt: skip
    rows = []
    for check in checks:
        for machine in check.machines:
            w = check.worst(machine)
            rows.append(
                [
                    check.name, machine, f"{w.stable}/{w.positions}", _number(w.attenuation, ".3f"),
                    f"{w.attenuation_position:.2f}", _number(w.amplification, ".2f"), _number(w.disk_margin, ".2f"),
                    _number(w.gain_margin, ".1f"), _number(w.phase_margin, ".0f"), _number(1e3 * w.delay_margin, ".2f"),
                    _number(w.effort, ".3g"),
                ]
            )  # fmt: skip
    console = results()
    show(console, title, columns, rows, "llr")
    frequency, output = checks[0].working_frequency, checks[0].outputs[0]
    say(
        console,
        f"left: of {output} at {frequency:g} Hz, largest over the positions; peak: largest response over that without "
        "control; then the smallest margins, and the command per newton of cutting force",
    )


def _over_amplitude(
    name: str,
    made: control.StateSpace | ScheduledController,
    machines: dict[str, Machine],
    hardware: Hardware,
) -> list[tuple[str, str, AmplitudeMargins]]:
    """Margins over amplitude, for every nonlinear element of every machine."""
    from cutvib_ss.control_design import amplitude_margins, check_positions, working_amplitudes

    places = check_positions(_LOOP_POSITIONS)
    out = []
    for machine, model in machines.items():
        for k in range(len(model.nonlinear)):
            steps = working_amplitudes(model, _FORCES, places, k)
            out.append((name, machine, amplitude_margins(made, model, steps, places, hardware, k)))
    return out


def _show_loops(loops: list[tuple[str, str, AmplitudeMargins]]) -> None:
    if not loops:
        return
    columns = ["controller", "machine", "element", *(f"disk {f:g} N" for f in _FORCES), "worst at y/L", "limit cycles"]
    rows = []
    for name, machine, found in loops:
        cycles = [
            f"{c.amplitude:.2g} at {c.frequency:.0f} Hz, {'attracts' if c.attracts else 'repels'}"
            for c in found.limit_cycles
        ]
        worst = found.disk_margin.min(axis=1)
        rows.append(
            [
                name, machine, f"{found.element.law} at {found.element.port}", *(f"{d:.2f}" for d in worst),
                f"{found.worst[2]:.2f}", "; ".join(dict.fromkeys(cycles)) or "none",
            ]
        )  # fmt: skip
    console = results()
    show(
        console,
        "Around nonlinear elements, by their describing functions",
        columns,
        rows,
        "lll" + "r" * len(_FORCES) + "rl",
    )
    say(
        console,
        "disk margin at the amplitudes that such a cutting force at the working frequency causes, smallest over the rail",
    )


def _loop_data(name: str, machine: str, found: AmplitudeMargins) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "controller": name,
        "machine": machine,
        "law": found.element.law,
        "port": found.element.port,
        "forces_n": _FORCES,
        "amplitudes": found.amplitudes,
        "positions": found.positions,
        "growth_rate_per_s": found.growth_rate,
        "growth_freq_hz": found.growth_freq,
        "disk_margin": found.disk_margin,
        "limit_cycles": [asdict(c) for c in found.limit_cycles],
    }


def _number(value: float, form: str) -> str:
    """A figure as it is printed; what an unstable or unlimited loop lacks is a dash."""
    return f"{value:{form}}" if abs(value) < float("inf") else "-"


def _check_data(check: ControllerCheck) -> dict[str, Any]:
    from dataclasses import asdict

    machines = []
    for m, machine in enumerate(check.machines):
        machines.append(
            {
                "machine": machine,
                "stable": check.stable[m],
                "growth_rate_per_s": check.growth_rate[m],
                "growth_freq_hz": check.growth_freq[m],
                "before_m_per_s2_per_n": dict(zip(check.outputs, check.before[m], strict=True)),
                "passive_m_per_s2_per_n": dict(zip(check.outputs, check.passive[m], strict=True)),
                "after_m_per_s2_per_n": dict(zip(check.outputs, check.after[m], strict=True)),
                "effort_n_per_n": check.effort[m],
                "noise_command_n": check.noise_command[m],
                "disk_margin": check.disk_margin[m],
                "gain_margin_db": check.gain_margin[m],
                "phase_margin_deg": check.phase_margin[m],
                "delay_margin_s": check.delay_margin[m],
                "worst": {k: v for k, v in asdict(check.worst(machine)).items() if k != "machine"},
            }
        )
    return {
        "controller": check.name,
        "working_frequency_hz": check.working_frequency,
        "positions": check.positions,
        "machines": machines,
    }
