"""The application and its exit status: 0 done, 2 the input cannot be used, 1 a fault of the program."""

from __future__ import annotations

import re
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from typing import Any

import typer

from cutvib_ss.cli.absorber_design import absorber_design_command
from cutvib_ss.cli.absorbers import absorber_check_command
from cutvib_ss.cli.blind import (
    blind_measured_command,
    blind_ranks_command,
    blind_real_command,
    blind_run_command,
    blind_score_command,
)
from cutvib_ss.cli.campaign_files import campaign_init_command, campaign_show_command
from cutvib_ss.cli.campaigns import diagnose_command, identify_command
from cutvib_ss.cli.control import control_check_command, control_design_command
from cutvib_ss.cli.demo import demo_command
from cutvib_ss.cli.fleet import fleet_command
from cutvib_ss.cli.models import bode_command, figures_command, frf_command, modes_command, paper_command
from cutvib_ss.cli.plan import plan_command
from cutvib_ss.cli.schedule import schedule_command
from cutvib_ss.cli.serve import serve_command
from cutvib_ss.cli.simulate import simulate_command
from cutvib_ss.errors import CutvibError

# Older and newer typer keep their parser's exceptions in different modules; BadParameter is public in both.
_ParserError: type[Exception] = typer.BadParameter.__mro__[2]
_STOPPED = 130
"""Exit status of what was stopped from the keyboard."""

app = typer.Typer(
    name="cutvib",
    add_completion=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["--help", "-h"]},
    pretty_exceptions_enable=False,
)


def _version(asked: bool) -> None:
    if asked:
        from cutvib_ss import __version__

        typer.echo(f"cutvib {__version__}")
        raise typer.Exit


@app.callback(invoke_without_command=True, epilog="Example: cutvib demo")
def root(
    context: typer.Context,
    version: bool = typer.Option(False, "--version", callback=_version, is_eager=True, help="Print the version."),
) -> None:
    """Vibration of a Cartesian cutting machine, and a diagnosis of the gap between model and measurement."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def _group(name: str, text: str, example: str) -> typer.Typer:
    """Commands under a common name, which alone prints their help."""
    group = typer.Typer(help=text, rich_markup_mode="rich")

    @group.callback(invoke_without_command=True, help=text, epilog=f"Example: cutvib {name} {example}")
    def group_root(context: typer.Context) -> None:
        if context.invoked_subcommand is None:
            typer.echo(context.get_help())

    app.add_typer(group, name=name)
    return group


absorber = _group("absorber", "The tuned vibration absorber over the workspace.", "check --plot absorber.png")
campaign = _group("campaign", "From a folder of measured files to a campaign.", "show my-campaign")
control = _group("control", "Controller prototypes and their check over the workspace.", "check --plot rail.png")
blind = _group(
    "blind", "The sealed trial of the diagnosis on a virtual machine.", "run --cases 12 --seed 1 --out my-trial"
)

_COMMANDS: tuple[tuple[typer.Typer, str, Callable[..., None], str], ...] = (
    (app, "demo", demo_command, "--out my-demo"),
    (app, "diagnose", diagnose_command, "my-campaign --json out.json --report out.html"),
    (app, "fleet", fleet_command, "my-campaigns --jobs 2 --json fleet.json --report fleet.html"),
    (app, "plan", plan_command, "--position 0.1 --position 0.5 --level 20 --level 100 --json plan.json"),
    (app, "identify", identify_command, "my-campaign --save-machine fitted.toml"),
    (app, "paper", paper_command, "--json tables.json"),
    (app, "figures", figures_command, "--out my-figures"),
    (app, "modes", modes_command, "--position 0.5"),
    (app, "frf", frf_command, "--position 0.5 --position 0.3333 --freq 100:300:0.5 --out frf.csv"),
    (app, "bode", bode_command, "--position 0.02 --position 0.5 --out bode.png"),
    (app, "schedule", schedule_command, "--out schedule.png --bode bode.png --table plants.mat"),
    (app, "simulate", simulate_command, "--position 0.5 --steady --plot pulses.png"),
    (absorber, "absorber check", absorber_check_command, "--frequency 215 --damping-ratio 0.03 --mass 0.08"),
    (absorber, "absorber design", absorber_design_command, "--mass 0.08 --direction z --tolerance 0.02 --harmonics 5"),
    (campaign, "campaign init", campaign_init_command, "my-folder --channel force=Hammer --position 0.25"),
    (campaign, "campaign show", campaign_show_command, "my-folder --report campaign.html"),
    (control, "control design", control_design_command, "h2@rail --order 10 --out h2.json"),
    (
        control,
        "control check",
        control_check_command,
        "resonant@rail hinf@rail --corrected corrected.toml --plot rail.png",
    ),
    (blind, "blind run", blind_run_command, "--cases 12 --seed 1 --out my-trial --jobs 2"),
    (blind, "blind score", blind_score_command, "my-trial --json score.json --report score.html"),
    (blind, "blind measured", blind_measured_command, "measured-rigs --out added --seed 1 --jobs 2"),
    (blind, "blind real", blind_real_command, "measured-rigs --json table.json"),
    (blind, "blind ranks", blind_ranks_command, "--cases 60 --seed 1 --jobs 2"),
    (app, "serve", serve_command, "my-campaign --port 8080 --no-open"),
)
"""The commands: what each stands under, its name, what it runs, and the arguments of the example in its help."""

for _group_of, _path, _run, _arguments in _COMMANDS:
    _group_of.command(_path.split()[-1], epilog=f"Example: cutvib {_path} {_arguments}".rstrip())(_run)


def main(arguments: Sequence[str] | None = None) -> int:
    """
    Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments after the program's name; by default those of the process.

    Returns
    -------
    int
        Exit status.
    """
    if not sys.warnoptions:
        # Notes of third-party code between the lines help no one who did not ask for them with -W.
        warnings.simplefilter("ignore")
    try:
        command = _with_units(typer.main.get_command(app))
        status = command.main(None if arguments is None else list(arguments), prog_name="cutvib", standalone_mode=False)
        sys.stdout.flush()
        if status == _STOPPED:
            # The parser turns a KeyboardInterrupt into this status, and says nothing.
            sys.stderr.write("cutvib: stopped\n")
        return status if isinstance(status, int) else 0
    except _ParserError as error:
        context = getattr(error, "ctx", None)
        asked = context.command_path if context is not None else "cutvib"
        return _refuse(f"{error.format_message()}; see `{asked} --help`")  # type: ignore[attr-defined]
    except CutvibError as error:
        return _refuse(str(error))
    except (KeyboardInterrupt, typer.Abort):
        sys.stderr.write("cutvib: stopped\n")
        return _STOPPED
    except BrokenPipeError:
        # Whoever read the output has seen enough; keep the interpreter from complaining at its end.
        sys.stderr.close()
        return 1
    except Exception:
        traceback.print_exc()
        sys.stderr.write("cutvib: a fault of the program, not of the input; please report it with the lines above\n")
        return 1


def _with_units(command: Any) -> Any:
    """The command with units in its help: rich takes [s] and [m/s] for markup unless they are escaped."""
    for p in command.params:
        if getattr(p, "help", None):
            p.help = re.sub(r"(?<!\\)\[(?=[a-z#/@])", r"\[", p.help)
    for inner in getattr(command, "commands", {}).values():
        _with_units(inner)
    return command


def _refuse(message: str) -> int:
    sys.stderr.write(f"cutvib: {' '.join(message.split())}\n")
    return 2
