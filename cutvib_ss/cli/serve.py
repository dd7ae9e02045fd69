"""The command that serves the page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cutvib_ss.cli.options import existing_campaign
from cutvib_ss.errors import ParameterError

PORT = 8080


def serve_command(
    campaign: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CAMPAIGN]", help="Folder of a campaign that the page opens with.", callback=existing_campaign
        ),
    ] = None,
    host: Annotated[
        str, typer.Option("--host", metavar="ADDRESS", help="Address to listen at; 0.0.0.0 lets other machines in.")
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port to listen at; 0: any that is free.")
    ] = PORT,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the page in a browser.")] = False,
) -> None:
    """The page: load a campaign, look at it, try out an absorber or controller, diagnose, download the report."""
    if campaign is not None:
        from cutvib_ss.measurement.schema import read_campaign_file

        # What cannot be read is said here, before anything is served.
        read_campaign_file(campaign / "campaign.toml" if campaign.is_dir() else campaign)
    try:
        import nicegui  # noqa: F401
    except ImportError as error:
        raise ParameterError("`cutvib serve` needs NiceGUI: pip install 'cutvib_ss[web]'") from error
    from cutvib_ss.web.server import serve

    serve(host, port, not no_open, campaign)
