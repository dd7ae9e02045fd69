"""Responses in time while the head travels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from cutvib_ss.results.arrays import FloatArray, read_only
from cutvib_ss.results.time import TimeResponse


@dataclass(frozen=True)
class Energies:
    """
    Where energy comes from and goes while the head travels, since the start.

    Parameters
    ----------
    stored : array_like, shape (sample,)
        Kinetic and elastic energy of rail and head in X and Z [J]; the head's motion along the rail is not counted.
    force : array_like, shape (sample,)
        Work of the forces [J].
    drive : array_like, shape (sample,)
        Work of the drive that moves the head along the deflected rail [J].
    lost : array_like, shape (sample,)
        Work lost in dampers [J].
    """

    stored: FloatArray
    force: FloatArray
    drive: FloatArray
    lost: FloatArray

    def __post_init__(self) -> None:
        for name in ("stored", "force", "drive", "lost"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def imbalance(self) -> FloatArray:
        """What does not add up [J], shape (sample,)."""
        off: FloatArray = self.stored - self.stored[0] - (self.force + self.drive - self.lost)
        return off


@dataclass(frozen=True, repr=False)
class MovingResponse(TimeResponse):
    """
    Histories while the head travels; ``position`` is where it starts.

    Parameters
    ----------
    path : array_like, shape (sample,)
        Position y_b / L at each sample.
    energies : Energies, optional
        Where energy comes from and goes; None of a part of the response.
    """

    path: FloatArray = None  # type: ignore[assignment]
    energies: Energies | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "path", read_only(self.path, np.float64))

    def after(self, start: float) -> Self:
        left = super().after(start)
        path = self.path[-left.force.size :]
        return replace(left, path=path, position=float(path[0]), energies=None)
