"""The application and its exit status: 0 done, 2 the input cannot be used, 1 a fault of the program."""

from __future__ import annotations

import re
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Any

import typer

from cutvib_ss.cli.absorber_design import absorber_design_command
from cutvib_ss.cli.absorbers import absorber_check_command
from cutvib_ss.cli.blind import blind_measured_command, blind_real_command, blind_run_command, blind_score_command
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
absorber = typer.Typer(help="The tuned vibration absorber over the workspace.", rich_markup_mode="rich")
campaign = typer.Typer(help="From a folder of measured files to a campaign.", rich_markup_mode="rich")
control = typer.Typer(help="Controller prototypes and their check over the workspace.", rich_markup_mode="rich")
blind = typer.Typer(help="The sealed trial of the diagnosis on a virtual machine.", rich_markup_mode="rich")


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


@absorber.callback(invoke_without_command=True)
def absorber_root(context: typer.Context) -> None:
    """The tuned vibration absorber over the workspace."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@campaign.callback(invoke_without_command=True)
def campaign_root(context: typer.Context) -> None:
    """From a folder of measured files to a campaign."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@control.callback(invoke_without_command=True)
def control_root(context: typer.Context) -> None:
    """Controller prototypes and their check over the workspace."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@blind.callback(invoke_without_command=True)
def blind_root(context: typer.Context) -> None:
    """The sealed trial of the diagnosis on a virtual machine."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


app.command("demo", epilog="Example: cutvib demo --out my-demo")(demo_command)
app.command("diagnose", epilog="Example: cutvib diagnose my-campaign --json out.json --report out.html")(
    diagnose_command
)
app.command("fleet", epilog="Example: cutvib fleet my-campaigns --jobs 2 --json fleet.json --report fleet.html")(
    fleet_command
)
app.command(
    "plan", epilog="Example: cutvib plan --position 0.1 --position 0.5 --level 20 --level 100 --json plan.json"
)(plan_command)
app.command("identify", epilog="Example: cutvib identify my-campaign --save-machine fitted.toml")(identify_command)
app.command("paper", epilog="Example: cutvib paper --json tables.json")(paper_command)
app.command("figures", epilog="Example: cutvib figures --out my-figures")(figures_command)
app.command("modes", epilog="Example: cutvib modes --position 0.5")(modes_command)
app.command("frf", epilog="Example: cutvib frf --position 0.5 --position 0.3333 --freq 100:300:0.5 --out frf.csv")(
    frf_command
)
app.command("bode", epilog="Example: cutvib bode --position 0.02 --position 0.5 --out bode.png")(bode_command)
app.command("schedule", epilog="Example: cutvib schedule --out schedule.png --bode bode.png --table plants.mat")(
    schedule_command
)
app.command("simulate", epilog="Example: cutvib simulate --position 0.5 --steady --plot pulses.png")(simulate_command)
app.add_typer(absorber, name="absorber")
absorber.command("check", epilog="Example: cutvib absorber check --frequency 215 --damping-ratio 0.03 --mass 0.08")(
    absorber_check_command
)
absorber.command(
    "design", epilog="Example: cutvib absorber design --mass 0.08 --direction z --tolerance 0.02 --harmonics 5"
)(absorber_design_command)
app.add_typer(campaign, name="campaign")
campaign.command("init", epilog="Example: cutvib campaign init my-folder --channel force=Hammer --position 0.25")(
    campaign_init_command
)
campaign.command("show", epilog="Example: cutvib campaign show my-folder --report campaign.html")(campaign_show_command)
app.add_typer(control, name="control")
control.command("design", epilog="Example: cutvib control design h2@rail --order 10 --out h2.json")(
    control_design_command
)
control.command(
    "check", epilog="Example: cutvib control check resonant@rail hinf@rail --corrected corrected.toml --plot rail.png"
)(control_check_command)
app.add_typer(blind, name="blind")
blind.command("run", epilog="Example: cutvib blind run --cases 12 --seed 1 --out my-trial --jobs 2")(blind_run_command)
blind.command("score", epilog="Example: cutvib blind score my-trial --json score.json --report score.html")(
    blind_score_command
)
blind.command("measured", epilog="Example: cutvib blind measured measured-rigs --out added --seed 1 --jobs 2")(
    blind_measured_command
)
blind.command("real", epilog="Example: cutvib blind real measured-rigs --json table.json")(blind_real_command)

app.command("serve", epilog="Example: cutvib serve my-campaign --port 8080 --no-open")(serve_command)


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
