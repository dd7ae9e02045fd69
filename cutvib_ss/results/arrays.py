"""What the result types are made of: array types, quantities, arrays that refuse to be written to, labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cutvib_ss.errors import ParameterError
from cutvib_ss.parameters import names_of, position_named

Quantity: TypeAlias = Literal["displacement", "velocity", "acceleration"]
Form: TypeAlias = Literal["receptance", "mobility", "accelerance"]
FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]

QUANTITY_OF_FORM: dict[Form, Quantity] = {
    "receptance": "displacement",
    "mobility": "velocity",
    "accelerance": "acceleration",
}
"""The motion quantity that each form of frequency response gives for a unit force."""


def read_only(values: ArrayLike, dtype: Any = None) -> NDArray[Any]:
    """
    Copy of an array that refuses to be written to.

    Parameters
    ----------
    values : array_like
        Any array.
    dtype : dtype, optional
        Wanted element type.

    Returns
    -------
    ndarray
        A read-only copy; the array itself where it already is read-only and no view of another.
    """
    if isinstance(values, np.ndarray) and not values.flags.writeable and values.base is None:
        return values if dtype is None or values.dtype == dtype else read_only(values.astype(dtype))
    array = np.array(values, dtype=dtype)
    array.flags.writeable = False
    return array


def label_indices(labels: tuple[str, ...], wanted: str | Sequence[str] | None, what: str) -> list[int]:
    """Indices of wanted labels, all by default; the message of the error lists those that are there."""
    if wanted is None:
        return list(range(len(labels)))
    for name in names_of(wanted):
        if name not in labels:
            raise ParameterError(f"no {what} {name!r}; there are {', '.join(labels)}")
    return [labels.index(name) for name in names_of(wanted)]


def position_at(value: Any) -> float | None:
    """A position out of an array, where NaN stands for none."""
    return None if np.isnan(value) else float(value)


def optional_array(values: Sequence[float | None]) -> FloatArray:
    """Positions or other values as an array, where NaN stands for none."""
    return np.array([np.nan if y is None else y for y in values])


def positions_given(positions: FloatArray) -> FloatArray | None:
    """An array of positions as responses take it: None of a structure, which has none."""
    return None if np.isnan(positions).all() else positions


def position_indices(positions: FloatArray, wanted: float | str | Sequence[float | str] | None) -> NDArray[np.intp]:
    """Indices of wanted positions (to 1e-9), all by default."""
    if wanted is None:
        return np.arange(positions.size)
    given = np.asarray(wanted, dtype=object).ravel()
    return value_indices(positions, [position_named(y) if isinstance(y, str) else float(y) for y in given], "position")


def value_indices(values: FloatArray, wanted: float | Sequence[float] | None, what: str) -> NDArray[np.intp]:
    """Indices of wanted values (to 1e-9), all by default; the message of the error lists those that are there."""
    if wanted is None:
        return np.arange(values.size)
    rows: list[np.intp] = []
    for value in np.atleast_1d(np.asarray(wanted, dtype=np.float64)):
        hits = np.flatnonzero(np.abs(values - value) < 1e-9)
        if hits.size == 0:
            raise ParameterError(f"no {what} {value:g}; there are {values.tolist()}")
        rows.extend(hits)
    return np.array(rows, dtype=np.intp)
