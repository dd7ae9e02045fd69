"""
Plants for programs that read arrays: MATLAB's .mat and numpy's .npz, one plant or a family over positions.

In MATLAB, of one plant as of a family (then an array of models, one for each of ``positions``):

    load plant.mat
    sys = ss(A, B, C, D, 'StateName', states, 'InputName', inputs, 'OutputName', outputs);
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import io

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.files import readable, staged
from cutvib_ss.plant import PlantSchedule

if TYPE_CHECKING:
    import control

PLANT_FORMATS = (".npz", ".mat")
"""Suffixes of files that hold plants."""
_NAMES = ("states", "inputs", "outputs")


def check_plant_file(path: str | os.PathLike[str]) -> Path:
    """The name of a file for plants, refused where its suffix is not one that can be written."""
    file = Path(path)
    if file.suffix.lower() not in PLANT_FORMATS:
        raise ParameterError(f"{file}: suffix {file.suffix!r} holds no plants; give .npz or .mat")
    return file


def write_plant(
    plant: control.StateSpace | Sequence[control.StateSpace] | PlantSchedule,
    path: str | os.PathLike[str],
    *,
    positions: Sequence[float] | float | None = None,
) -> None:
    """
    Write a plant, or a family over positions: ``A``, ``B``, ``C``, ``D``, ``states``, ``inputs``, ``outputs``, ``positions``.

    Parameters
    ----------
    plant : control.StateSpace, sequence of control.StateSpace, or PlantSchedule
        What to write; of a sequence all have the same signals and number of states.
    path : path-like
        File that ends in ``.mat`` or ``.npz``.
    positions : float or sequence of float, optional
        y_b / L of each plant; a `PlantSchedule` has its own.

    Raises
    ------
    ParameterError
        If the suffix is not one of these, or the plants of a sequence do not fit each other or the positions.
    DataFormatError
        If the file cannot be written.

    Notes
    -----
    Matrices of a family have the shape (row, column, position), as MATLAB's arrays of state-space models have them. Plants of
    `Machine.plants` have states of their own at each position, scaled there; those of `schedule` are common, and may be
    interpolated.

    Examples
    --------
    >>> import tempfile
    >>> from cutvib_ss.model.machine import published_machine
    >>> file = Path(tempfile.mkdtemp()) / "plant.mat"
    >>> write_plant(published_machine().plant(0.5), file, positions=0.5)
    >>> read_plant(file).nstates
    12
    """
    suffix = check_plant_file(path).suffix.lower()
    if isinstance(plant, PlantSchedule):
        arrays = [np.moveaxis(m, 0, -1) for m in plant.state_matrices()]
        labels: Any = plant
        at, extra = plant.positions, {"quantity": plant.quantity}
    else:
        single = not isinstance(plant, Sequence)
        family: list[Any] = [plant] if single else list(plant)
        labels, extra = _labels(family), {}
        stacked = [np.stack([np.asarray(getattr(p, n)) for p in family], axis=-1) for n in "ABCD"]
        arrays = [m[..., 0] for m in stacked] if single else stacked
        at = np.atleast_1d(np.asarray([] if positions is None else positions, dtype=float))
        if at.size not in (0, len(family)):
            raise ParameterError(f"{len(family)} plants need as many positions, not {at.size}")
    names = {n: np.array(getattr(labels, n), dtype=object if suffix == ".mat" else str) for n in _NAMES}
    content: dict[str, Any] = {"positions": at, **extra, **dict(zip("ABCD", arrays, strict=True)), **names}
    with staged(path) as draft:
        if suffix == ".npz":
            np.savez(draft, **content)
        else:
            io.savemat(draft, content)


class _Labels:
    """Names of states, inputs and outputs."""

    def __init__(self, plant: Any) -> None:
        self.states, self.inputs, self.outputs = plant.state_labels, plant.input_labels, plant.output_labels


def _labels(family: Sequence[Any]) -> _Labels:
    first = _Labels(family[0])
    for plant in family[1:]:
        if vars(_Labels(plant)) != vars(first):
            raise ParameterError("the plants of a family need the same states, inputs and outputs")
    return first


def read_plant(path: str | os.PathLike[str]) -> Any:
    """
    Read what `write_plant` wrote.

    Parameters
    ----------
    path : path-like
        File that ends in ``.mat`` or ``.npz``.

    Returns
    -------
    control.StateSpace or tuple of control.StateSpace
        The plant, or the family in the order of its positions.

    Raises
    ------
    DataFormatError
        If the file is missing or holds no plant.
    """
    import control

    file = check_plant_file(path)
    try:
        with readable(file):
            if file.suffix.lower() == ".npz":
                with np.load(file, allow_pickle=False) as held:
                    data: dict[str, Any] = {name: held[name] for name in held.files}
            else:
                data = io.loadmat(file, appendmat=False, chars_as_strings=True)
        labels = {n: [_text(v) for v in np.ravel(data[n])] for n in _NAMES}
        a, b, c, d = (np.asarray(data[n], dtype=float) for n in "ABCD")
    except DataFormatError:
        raise
    except Exception as error:  # numpy and scipy raise many kinds on damaged files
        raise DataFormatError(f"{file}: holds no plant ({error}); write it again") from error
    if a.ndim == 2:
        return control.ss(a, b, c, d, **labels)
    return tuple(control.ss(a[..., k], b[..., k], c[..., k], d[..., k], **labels) for k in range(a.shape[-1]))


def _text(value: Any) -> str:
    """A name; MATLAB's cells come as arrays of one text."""
    return str(np.ravel(value)[0]) if isinstance(value, np.ndarray) else str(value)
