"""Restoring forces as the arrays that compiled loops take."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cutvib_ss.model.restoring_forces.base import Hysteretic, Memoryless, RestoringForce, registered
from cutvib_ss.results import FloatArray

SLIDES, JUMPS = -1, -2
"""Codes of Jenkins elements and of Coulomb friction; laws without memory count from zero."""


WIDTH = 6
"""Numbers that the kernels of a law may take."""


class Packed(NamedTuple):
    """
    Laws of some elements.

    Parameters
    ----------
    laws : ndarray of records, shape (element,)
        ``code`` and ``by_rate`` of each; the name of the last field changes with the code of the registered laws and of the loops,
        so that what was compiled of others is not taken from numba's cache.
    values : ndarray, shape (element, WIDTH)
        What the kernels of those without memory take.
    sliders : ndarray, shape (element, slider, 2)
        Stiffness and slip force of those with memory; zero where there are fewer.
    """

    laws: np.ndarray
    values: FloatArray
    sliders: FloatArray


def memoryless() -> tuple[type[Memoryless], ...]:
    """The registered laws without memory, in the order of their codes."""
    return tuple(law for law in registered().values() if issubclass(law, Memoryless))


def _loops() -> list[Path]:
    """Files of what is compiled: numba's cache looks at that of a function alone, not at those of functions inlined in it."""
    here = Path(__file__).parent
    return [*here.glob("*.py"), *here.parents[1].glob("response/compiled*.py")]


@cache
def _record(laws: tuple[type[Memoryless], ...]) -> np.dtype[np.void]:
    stamp = hashlib.sha256()
    for file in sorted({*_loops(), *(Path(inspect.getfile(law)) for law in laws)}):
        stamp.update(file.read_bytes())
    return np.dtype(
        [("code", np.int64), ("by_rate", np.int64), (f"laws_{stamp.hexdigest()[:16]}", np.int64)], align=True
    )


def packed(forces: Sequence[RestoringForce]) -> Packed:
    """The arrays of some laws."""
    known = memoryless()
    laws = np.zeros(len(forces), dtype=_record(known))
    values = [f.values if isinstance(f, Memoryless) else () for f in forces]
    sliders = [f.sliders() if isinstance(f, Hysteretic) else np.zeros((0, 2)) for f in forces]
    count = max([1, *map(len, sliders)])
    wide, deep = np.zeros((len(forces), WIDTH)), np.zeros((len(forces), count, 2))
    for k, f in enumerate(forces):
        laws[k]["code"] = known.index(type(f)) if isinstance(f, Memoryless) else JUMPS if f.jumps else SLIDES
        laws[k]["by_rate"] = f.moved_by == "velocity"
        wide[k, : len(values[k])] = values[k]
        deep[k, : len(sliders[k])] = sliders[k]
    return Packed(laws, wide, deep)
