"""What a measurement campaign is, once read: typed, in SI units, whatever files it came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.force_window import stands_out
from cutvib_ss.model.second_order import Channel
from cutvib_ss.results import FloatArray, MeasuredFrequencyResponse, Quantity, read_only
from cutvib_ss.results.display import Displayed, Table

Kind: TypeAlias = Literal["impact", "frf", "timeseries"]
Use: TypeAlias = Literal["fit", "check"]
Sweep: TypeAlias = Literal["up", "down", "random"]
Controlled: TypeAlias = Literal["force", "response"]
InputQuantity: TypeAlias = Literal["force", "acceleration"]

FORCE = "force"
"""Name of the input's column or channel in every format, also where it holds a base acceleration."""


class MachineLike(Protocol):
    """The part of a nominal model that the reading of measurements relies on."""

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Response channels by name: port and quantity of each."""
        ...

    @property
    def input_port(self) -> str:
        """Port at which the measured force acts."""
        ...

    @property
    def input_quantity(self) -> InputQuantity:
        """Quantity of the ``force`` column: a force, or the acceleration of the base."""
        ...

    @property
    def has_position(self) -> bool:
        """Whether records are taken at positions of the head on the rail."""
        ...


@dataclass(frozen=True)
class History:
    """
    One blow, or one continuous recording: force and responses on one clock, in SI units.

    Parameters
    ----------
    fs : float
        Sampling frequency [Hz].
    force : array_like, shape (sample,)
        Force [N]; under base excitation the acceleration of the base [m/s^2].
    responses : array_like, shape (channel, sample)
        Response of each channel, in the SI unit of its quantity.
    channels : sequence of str
        Names of the response channels.
    name : str
        Name of the blow within its record, for messages.
    """

    fs: float
    force: FloatArray
    responses: FloatArray
    channels: tuple[str, ...]
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", read_only(self.force, np.float64))
        object.__setattr__(self, "responses", read_only(self.responses, np.float64))
        object.__setattr__(self, "channels", tuple(self.channels))
        if not self.fs > 0:
            raise ParameterError(f"history {self.name!r}: the sampling frequency is {self.fs} Hz; it must be positive")
        if self.responses.shape != (len(self.channels), self.force.size):
            raise ParameterError(
                f"history {self.name!r}: responses have shape {self.responses.shape}, but {len(self.channels)} "
                f"channels of {self.force.size} samples are labelled"
            )

    @property
    def time(self) -> FloatArray:
        """Time from the first sample [s], shape (sample,)."""
        return np.arange(self.force.size) / self.fs

    @property
    def duration(self) -> float:
        """Length of the recording [s]: number of samples over sampling frequency."""
        return self.force.size / self.fs

    @cached_property
    def start(self) -> int:
        """Sample before which the structure is at rest, of a blow: see `blow_start`."""
        return blow_start(self.force)


def blow_start(force: FloatArray) -> int:
    """
    Sample before which the structure is at rest: a little before the force first leaves its noise.

    The blow has begun where the force stands out of its noise (`force_window.stands_out`). A sixteenth of the samples before that,
    eight at least, are given away: a digitiser's filter rings before an edge.
    """
    onset = int(np.argmax(stands_out(force)))
    return max(onset - max(8, onset // 16), 0)


@dataclass(frozen=True)
class Record:
    """
    One ``[[record]]`` of a campaign: what was measured at one position and level.

    Parameters
    ----------
    name : str
        Path of its (first) file, relative to the campaign's folder.
    kind : {"impact", "frf", "timeseries"}
        Blows, estimated frequency responses, or continuous recordings.
    position : float or None
        Position y_b / L of the head; None where the model has no position.
    peak_force : float or None
        Excitation level [N] (base excitation: [m/s^2]), where stated.
    use : {"fit", "check"} or None
        What the record may be used for, where stated.
    channels : sequence of str
        Names of the response channels.
    quantities : sequence of str
        Motion quantity of each channel.
    histories : sequence of History
        Blows or recordings; empty for ``"frf"``.
    frf : MeasuredFrequencyResponse or None
        Estimated responses; only for ``"frf"``.
    averages : int
        Blows or blocks behind each estimate.
    excitation : str
        ``"impact"``, ``"random"``, ``"multisine"`` or ``"sine"``.
    block : float or None
        Length of the estimator's block [s], where stated.
    blow_at : float or None
        Instant of the blow within the block [s], where stated.
    exponential_decay : float
        Decay rate [1/s] of an exponential window on the response alone.
    input_quantity : {"force", "acceleration"}
        What the ``force`` column holds.
    session : str or None
        Name of the session, where stated: records of one session share their drift.
    band_hz : tuple of float or None
        Lines to use [Hz], where stated.
    input : str or None
        Where the force acted, if not at the model's input: a port, or ``"rail@"`` and the fraction y / L of the rail.
    sweep : {"up", "down", "random"} or None
        Order in which a sine record ran through its lines, where stated.
    controlled : {"force", "response"} or None
        Amplitude that was held during a sine record, where stated.
    peak_response : float or None
        Response amplitude that was held, of the record's first channel in the SI unit of its quantity.
    force_amplitude : array_like or None, shape (frequency,)
        Force amplitude at each line of ``frf`` [N], where the file states it.
    files : sequence of str
        Paths of all its files; empty for a record that was read from none.
    """

    name: str
    kind: Kind
    position: float | None
    peak_force: float | None
    use: Use | None
    channels: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    histories: tuple[History, ...] = ()
    frf: MeasuredFrequencyResponse | None = None
    averages: int = 1
    excitation: str = "impact"
    block: float | None = None
    blow_at: float | None = None
    exponential_decay: float = 0.0
    input_quantity: InputQuantity = "force"
    session: str | None = None
    band_hz: tuple[float, float] | None = None
    input: str | None = None
    sweep: Sweep | None = None
    controlled: Controlled | None = None
    peak_response: float | None = None
    force_amplitude: FloatArray | None = None
    files: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("channels", "quantities", "histories", "files"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        if self.force_amplitude is not None:
            object.__setattr__(self, "force_amplitude", read_only(self.force_amplitude, np.float64))
            if self.frf is None or self.force_amplitude.shape != self.frf.freq.shape:
                raise ParameterError(f"record {self.name!r}: force_amplitude needs one value for each line of `frf`")
        if (self.frf is not None) != (self.kind == "frf") or bool(self.histories) == (self.kind == "frf"):
            raise ParameterError(f"record {self.name!r} of kind {self.kind!r} needs {_needs(self.kind)}")

    @property
    def input_unit(self) -> str:
        """SI unit of the input: ``"N"``, or ``"m/s^2"`` for base excitation."""
        return "N" if self.input_quantity == "force" else "m/s^2"


@dataclass(frozen=True, repr=False)
class Campaign(Displayed):
    """
    One measurement campaign: its nominal model, its records, and what was noticed while reading them.

    Parameters
    ----------
    title : str
        Title.
    folder : Path
        Folder of campaign.toml.
    machine : object
        The nominal model (`MachineLike`).
    records : sequence of Record
        Records, in the order of campaign.toml.
    warnings : sequence of str
        Double hits, overloads, dead channels, wrong signs, dropped blows: each named, one line each.
    """

    title: str
    folder: Path
    machine: Any
    records: tuple[Record, ...]
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "folder", Path(self.folder))
        object.__setattr__(self, "records", tuple(self.records))
        object.__setattr__(self, "warnings", tuple(self.warnings))

    def _table(self) -> Table:
        rows = []
        for r in self.records:
            place = "-" if r.position is None else f"{r.position:.4g}"
            level = "-" if r.peak_force is None else f"{r.peak_force:g} {r.input_unit}"
            count = len(r.histories) or r.averages
            rows.append((r.name, r.kind, place, level, str(count), ", ".join(r.channels)))
        noticed = f", {len(self.warnings)} warning{'s' * (len(self.warnings) != 1)}" if self.warnings else ""
        title = f"Campaign {self.title!r}: {len(rows)} record{'s' * (len(rows) != 1)}{noticed}"
        return Table(title, ("record", "kind", "y/L", "level", "averages", "channels"), rows)


def _needs(kind: str) -> str:
    return "`frf` and no histories" if kind == "frf" else "histories and no `frf`"
