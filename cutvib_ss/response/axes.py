"""Positions and frequencies of a response, checked."""

from __future__ import annotations

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.protocol import Model
from cutvib_ss.parameters import check_number, check_position
from cutvib_ss.results import ComplexArray, FloatArray


def as_positions(model: Model, positions: object) -> FloatArray:
    """Positions as an array, checked against the kind of model, shape (position,)."""
    if not model.has_position:
        if positions is not None and not np.isnan(np.asarray(positions, dtype=float)).all():
            raise ParameterError("a second_order model has no position")
        return np.array([np.nan])
    if positions is None:
        raise ParameterError("the response of a cutting machine needs a position y_b / L, strictly inside (0, 1)")
    given = np.asarray(positions, dtype=object).ravel()
    if given.size == 0:
        raise ParameterError("the list of positions is empty: a response is at one at least, y_b / L")
    return np.array([check_position(y) for y in given])


def as_laplace(freq: object, decay_rate: float) -> tuple[FloatArray, ComplexArray]:
    """Frequencies [Hz] and s = σ + j2πf, shape (frequency,)."""
    f = np.atleast_1d(np.asarray(freq, dtype=float))
    if f.ndim != 1 or not np.isfinite(f).all() or (f < 0).any():
        raise ParameterError("frequencies must be finite, at least 0 Hz, in one list")
    return f, check_number("decay_rate", decay_rate) + 2j * np.pi * f
