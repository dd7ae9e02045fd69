"""What the result types are made of: array types, quantities, arrays that refuse to be written to, labels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cutvib_ss.errors import ParameterError

Quantity: TypeAlias = Literal["displacement", "velocity", "acceleration"]
Form: TypeAlias = Literal["receptance", "mobility", "accelerance"]
FloatArray: TypeAlias = NDArray[np.float64]
ComplexArray: TypeAlias = NDArray[np.complex128]


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
    """
    Indices of wanted labels.

    Parameters
    ----------
    labels : tuple of str
        The labels.
    wanted : str or sequence of str, optional
        Those wanted; all by default.
    what : str
        What they label, for the message.

    Returns
    -------
    list of int
        The indices.

    Raises
    ------
    ParameterError
        If there is no such label; the message lists those that are.
    """
    if wanted is None:
        return list(range(len(labels)))
    names = [wanted] if isinstance(wanted, str) else list(wanted)
    for name in names:
        if name not in labels:
            raise ParameterError(f"no {what} {name!r}; there are {', '.join(labels)}")
    return [labels.index(name) for name in names]
