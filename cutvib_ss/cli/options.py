"""Options that several commands share, and what becomes of them."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import check_picture

if TYPE_CHECKING:
    from cutvib_ss.model.machine import Machine
    from cutvib_ss.model.structure import Structure
    from cutvib_ss.results import FloatArray


def _existing(path: Path | None, remedy: str) -> Path | None:
    """A path that must be there: refused before anything slow is imported."""
    if path is not None and not path.exists():
        raise DataFormatError(f"{path}: there is no such file; {remedy}")
    return path


def existing_machine(path: Path | None) -> Path | None:
    """A machine.toml that is there."""
    return _existing(path, "give the path of a machine.toml")


def existing_machines(paths: list[Path] | None) -> list[Path] | None:
    """Each a machine.toml that is there."""
    for path in paths or ():
        existing_machine(path)
    return paths


def existing_input(path: Path | None) -> Path | None:
    """A file of input that is there."""
    return _existing(path, "correct the path")


def existing_folder(path: Path | None) -> Path | None:
    """A folder that is there."""
    if path is not None and not path.is_dir():
        raise DataFormatError(f"{path}: there is no such folder; correct the path")
    return path


def existing_folders(paths: list[Path]) -> list[Path]:
    """Each a folder that is there."""
    for path in paths:
        existing_folder(path)
    return paths


def existing_campaign(path: Path | None) -> Path | None:
    """A campaign: its campaign.toml, or the folder that holds it."""
    if path is not None and path.is_dir() and not (path / "campaign.toml").exists():
        raise DataFormatError(
            f"{path / 'campaign.toml'}: there is no such file; `cutvib campaign init {path}` writes one for the files "
            "of the folder"
        )
    return _existing(path, "a campaign is a folder with a campaign.toml")


def above_zero(value: float | None) -> float | None:
    """A number above zero: told before anything slow is imported."""
    if value is not None and not 0.0 < value < float("inf"):
        raise typer.BadParameter(f"{value:g} must be greater than 0")
    return value


def each_above_zero(values: list[float] | None) -> list[float] | None:
    """Numbers above zero."""
    for value in values or []:
        above_zero(value)
    return values


def picture(path: Path | None) -> Path | None:
    """The name of a picture that can be drawn."""
    return None if path is None else check_picture(path)


CampaignArgument = Annotated[
    Path,
    typer.Argument(
        metavar="CAMPAIGN", help="Folder of the campaign, or its campaign.toml.", callback=existing_campaign
    ),
]
MachineOption = Annotated[
    Path | None,
    typer.Option(
        "--machine", metavar="FILE.toml", help="The model; by default the published machine.", callback=existing_machine
    ),
]
NominalOption = Annotated[
    Path | None,
    typer.Option(
        "--machine",
        metavar="FILE.toml",
        help="The nominal model; by default the campaign's own.",
        callback=existing_machine,
    ),
]
JsonOption = Annotated[
    str | None,
    typer.Option("--json", metavar="FILE", help="Write the figures as JSON; - is standard output."),
]


def position_value(given: str | float) -> float:
    """A position as the command line takes it: a number, which a default is already, or FC, CC, BC, FR, CR, BR."""
    from cutvib_ss.parameters import check_position

    try:
        return check_position(str(given))
    except ParameterError as error:
        raise typer.BadParameter(str(error)) from None


PositionsOption = Annotated[
    list[float] | None,
    typer.Option(
        "--position", metavar="Y", parser=position_value,
        help="y_b / L of the head, between 0 and 1, or FC, CC, BC, FR, CR, BR; may be given several times.",
    ),
]  # fmt: skip
PositionOption = Annotated[
    float | None,
    typer.Option(
        "--position", metavar="Y", parser=position_value,
        help="y_b / L of the head, strictly between 0 and 1, or FC, CC, BC, FR, CR, BR.",
    ),
]  # fmt: skip
FreqOption = Annotated[
    str, typer.Option("--freq", metavar="LO:HI:STEP", help="Frequencies from LO to HI in steps of STEP [Hz].")
]
SaveMachineOption = Annotated[
    Path | None,
    typer.Option("--save-machine", metavar="FILE.toml", help="Write the corrected model as a machine.toml."),
]
PictureFileOption = Annotated[
    Path, typer.Option("--out", metavar="FILE", help="Picture: .png, .svg or .pdf.", callback=picture)
]
TablePageOption = Annotated[
    Path | None,
    typer.Option("--report", metavar="FILE.html", help="Write the table as one self-contained page."),
]
SchedulerOption = Annotated[
    str | None, typer.Option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers do the work.")
]

_MOST_LINES = 1_000_000


class FormName(StrEnum):
    """Forms of a frequency response."""

    RECEPTANCE = "receptance"
    MOBILITY = "mobility"
    ACCELERANCE = "accelerance"


def load_model(path: Path | None) -> Machine | Structure:
    """The model of a file, or the published machine."""
    if path is None:
        from cutvib_ss.model.machine import published_machine

        return published_machine()
    from cutvib_ss.model_files import read_machine

    return read_machine(path)


def load_machine(path: Path | None, command: str) -> Machine:
    """A cutting machine; another structure is refused, for it has no rail to move along."""

    model = load_model(path)
    if model.rail is None:
        raise ParameterError(f'{path}: kind = "second_order" has no position; `{command}` needs a cutting machine')
    return model


def check_position_given(machine: Path | None, given: object) -> None:
    """The published machine has a rail: without a position nothing need be loaded to say that it is missing."""
    if machine is None and not given and given != 0.0:
        raise ParameterError("--position is missing; give y_b / L of the head, strictly between 0 and 1")


def check_places(model: Machine | Structure, positions: list[float] | None) -> list[float] | None:
    """Positions for a machine, at least one; None for a structure."""
    if not model.has_position:
        if positions:
            raise ParameterError(f"--position {positions[0]:g}: this model has no position; leave the option out")
        return None
    if not positions:
        raise ParameterError("--position is missing; give y_b / L of the head, strictly between 0 and 1")
    return positions


def frequencies(text: str) -> FloatArray:
    """Frequencies from LO:HI:STEP, both ends included where the step meets them."""
    import numpy as np

    parts = text.split(":")
    try:
        low, high, step = (float(part) for part in parts)
    except ValueError:
        raise ParameterError(f"--freq {text}: give LO:HI:STEP in Hz, for instance 10:500:0.5") from None
    if not (0.0 <= low <= high < float("inf")) or not 0.0 < step < float("inf"):
        raise ParameterError(f"--freq {text}: needs 0 <= LO <= HI and STEP > 0, all finite")
    count = int((high - low) / step + 1e-9) + 1
    if count > _MOST_LINES:
        raise ParameterError(f"--freq {text}: {count} frequencies are too many; take a larger step")
    lines: FloatArray = low + step * np.arange(count, dtype=np.float64)
    return lines


def limits(text: str, example: str) -> tuple[float, float]:
    """A band from LO:HI [Hz]."""
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        raise ParameterError(f"--band {text}: give LO:HI in Hz, for instance {example}") from None
    if not 0.0 < low < high < float("inf"):
        raise ParameterError(f"--band {text}: needs 0 < LO < HI, both finite")
    return low, high
