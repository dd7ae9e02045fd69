"""The table of plants over positions, for programs that read arrays: numpy's .npz and MATLAB's .mat."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from scipy import io

from cutvib_ss.errors import ParameterError
from cutvib_ss.interchange.files import staged
from cutvib_ss.lpv import PlantSchedule

SCHEDULE_FORMATS = (".npz", ".mat")
"""Suffixes of tables of plants."""


def check_schedule_file(path: str | os.PathLike[str]) -> Path:
    """
    The name of a table of plants, refused where its suffix is not one that can be written.

    Parameters
    ----------
    path : path-like
        File to be.

    Returns
    -------
    Path
        The same path.

    Raises
    ------
    ParameterError
        If the suffix is not known.
    """
    file = Path(path)
    if file.suffix.lower() not in SCHEDULE_FORMATS:
        raise ParameterError(f"{file}: suffix {file.suffix!r} is no table of plants; give .npz or .mat")
    return file


def write_schedule(schedule: PlantSchedule, path: str | os.PathLike[str]) -> None:
    """
    Write the table of plants: ``A``, ``B``, ``C``, ``D``, ``positions``, names of states, inputs and outputs.

    Parameters
    ----------
    schedule : PlantSchedule
        The family.
    path : path-like
        File that ends in ``.npz`` or ``.mat``.

    Raises
    ------
    ParameterError
        If the suffix is not one of these.
    DataFormatError
        If the file cannot be written.

    Notes
    -----
    Matrices have the shape (row, column, position), as MATLAB's arrays of state-space models have them:
    ``ss(A, B, C, D)`` makes one of them.
    """
    suffix = check_schedule_file(path).suffix.lower()
    matrices = {name: np.moveaxis(m, 0, -1) for name, m in zip("ABCD", schedule.state_matrices(), strict=True)}
    names = {"states": schedule.states, "inputs": schedule.inputs, "outputs": schedule.outputs}
    content = {"positions": schedule.positions, "quantity": schedule.quantity, **matrices}
    with staged(path) as draft:
        if suffix == ".npz":
            np.savez(draft, **content, **names)  # type: ignore[arg-type]
        else:
            io.savemat(draft, content | {name: np.array(values, dtype=object) for name, values in names.items()})
