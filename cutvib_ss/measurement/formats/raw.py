"""What every format gives and takes: named columns in the file's own units, not yet checked or converted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from cutvib_ss.errors import DataFormatError
from cutvib_ss.results import ComplexArray, FloatArray

SEVERAL_POSITIONS = "holds responses at several positions; a record is of one position: write each to a file of its own"


@dataclass(frozen=True)
class Signal:
    """One column of a time record."""

    name: str  # Channel name
    unit: str | None  # Unit as the file spells it; None where the file has none
    values: FloatArray  # Values in that unit
    group: str = ""  # Group of channels that it belongs to, where the format has groups
    # Node and signed direction, where the format numbers nodes; the sign is already applied to the values
    dof: tuple[int, int] | None = None
    quantity: str | None = None  # What it measures, where the format says so apart from the unit
    fs: float | None = None  # Sampling frequency [Hz], where it is not the history's
    origin: str = ""  # Where in the file it stands, for messages


@dataclass(frozen=True)
class RawHistory:
    """One blow or recording as the file holds it."""

    name: str  # Group, blow or segment name
    fs: float  # Sampling frequency [Hz]
    signals: tuple[Signal, ...]  # Force and responses


@dataclass(frozen=True)
class RawResponse:
    """One frequency response as the file holds it."""

    name: str  # Channel name
    unit: str | None  # Unit of response per input, for instance ``"g/N"``; None where the file has none
    values: ComplexArray  # Values in that unit
    coherence: FloatArray | None = None  # Ordinary coherence, where the file has it
    # Node and signed direction of response and input, where the format numbers nodes; signs are already applied
    dof: tuple[int, int] | None = None
    ref: tuple[int, int] | None = None
    quantity: str | None = None  # What the response measures, where the format says so apart from the unit
    freq: FloatArray | None = None  # Frequency [Hz], where it is not that of the others
    origin: str = ""  # Where in the file it stands, for messages


@dataclass(frozen=True)
class RawFrf:
    """Frequency responses on one frequency axis."""

    freq: FloatArray  # Frequency [Hz]
    responses: tuple[RawResponse, ...]  # One per channel
    force_amplitude: Signal | None = None  # Amplitude of the force at each line, where the file states it


@dataclass(frozen=True)
class Contents:
    """All that one file holds for a record."""

    histories: tuple[RawHistory, ...] = ()  # Time records; empty for frequency responses
    frf: RawFrf | None = None  # Frequency responses
    warnings: tuple[str, ...] = ()  # What the reader noticed
    si: bool = False  # Whether values without a unit are SI by the format's convention


@dataclass(frozen=True)
class Layout:
    """What a reader may need to know of the channels."""

    quantities: Mapping[str, str]  # Quantity of every channel, the input's (``"force"``) among them
    # Node and direction (1, 2, 3 for X, Y, Z; None: any) of every channel, for formats that number nodes
    nodes: Mapping[str, tuple[int, int | None]]


@dataclass(frozen=True)
class TextOptions:
    """What of a text file is stated because it cannot be told from the file (``[csv]``); None: recognised."""

    delimiter: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    header_lines: int | None = None
    time: str | int | None = None


class Format(Protocol):
    """What each module of a format offers."""

    def read(self, path: Path, frf: bool, options: TextOptions) -> Contents:
        """All columns of a file by its own names and units: frequency responses, else time records."""
        ...

    def write(self, path: Path, contents: Contents, layout: Layout) -> None:
        """Write histories or frequency responses to a new file."""
        ...


def sampling_frequency(step: float, tolerance: float = 1e-9) -> float:
    """
    Sampling frequency whose time step was written rounded: the shortest decimal that agrees with it.

    >>> sampling_frequency(2.44141e-4, 2e-6)
    4096.0
    """
    for digits in range(1, 16):
        # a step that was cut to six digits is no evidence of a step of six digits
        if abs(_rounded(step, digits) / step - 1) <= 1e-9 and (digits <= 5 or tolerance < 1e-8):
            return 1 / _rounded(step, digits)
        if abs(_rounded(1 / step, digits) * step - 1) <= tolerance:
            return _rounded(1 / step, digits)
    return 1 / step


def even_sampling(time: FloatArray, where: str, resolution: float = 0.0) -> float:
    """Sampling frequency of a time column, after checking that its steps are even up to its own rounding."""
    if time.size < 2:
        raise DataFormatError(f"{where}: {time.size} sample(s) cannot make a time record; record a whole blow")
    if not np.all(np.isfinite(time)):
        raise DataFormatError(f"{where}: the time column holds NaN or Inf; remove the row or record again")
    steps = np.diff(time)
    if not np.all(steps > 0):
        row = int(np.argmin(steps > 0)) + 1
        raise DataFormatError(
            f"{where}: time does not increase at sample {row + 1} ({time[row - 1]:g} s, then {time[row]:g} s); "
            "sort the rows, or give a `blow` column where each blow starts anew"
        )
    index = np.arange(time.size)
    # a straight line through all times is better known than any one step of rounded times
    step, start = np.polyfit(index - index.mean(), time, 1)
    error = float(np.max(np.abs(time - start - step * (index - index.mean()))))
    quantum = max(_printed_quantum(time), resolution)
    # printed coarsely, times hide some jitter, but never a sample that was dropped
    if error > max(1e-3 * step, min(quantum, 0.3 * step)):
        raise DataFormatError(
            f"{where}: time steps are uneven (up to {error:.2g} s off a step of {step:.4g} s); "
            "resample the record evenly"
        )
    return sampling_frequency(float(step), max(1e-9, quantum / float(time[-1] - time[0])))


def _printed_quantum(time: FloatArray) -> float:
    """Last printed digit of the largest times: that of the fewest significant digits which give all of their decade."""
    largest = float(np.max(np.abs(time)))
    exponent = math.floor(math.log10(largest)) if largest > 0 else 0
    sample = time[np.abs(time) >= 10.0**exponent]
    for digits in range(3, 10):
        quantum = float(10.0 ** (exponent - digits + 1))
        if np.all(np.abs(sample / quantum - np.round(sample / quantum)) < 1e-6):
            return quantum
    return 0.0


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits - 1}e}")
