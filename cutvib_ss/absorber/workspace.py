"""
Acceleration of the machine under a periodic force, with absorbers, over the whole rail and a box of tolerances.

The bare machine's responses between the force, the absorbers' feet and the outputs are computed once, for all positions
and all harmonics. Absorbers then come in by Eq. 23, one port after another, in closed form: no model is built again. With
z_r the dynamic stiffness of all that sits at port r, a response of the modified machine moves by

    da'_pq = -a'_pr dz_r a'_rq,

Eq. 23 for a small z, so that derivatives to tuning, damping and mass cost nothing more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cutvib_ss.absorber.coupling import MountedAbsorber
from cutvib_ss.absorber.force import HarmonicForce
from cutvib_ss.absorber.tolerance import EXACT, AbsorberTolerance, machine_as_built, machines_within
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.parameters import names_of
from cutvib_ss.response.axes import as_positions
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import ComplexArray, FloatArray, read_only
from cutvib_ss.results.arrays import label_indices, position_indices
from cutvib_ss.results.display import Drawn, Table, data_frame, optional

Criterion: TypeAlias = Literal["harmonic", "rms"]

WORKSPACE = read_only(np.arange(1, 100) / 100)
"""Positions y_b / L that stand for the whole rail."""
_JUDGED = ("before", "exact", "toleranced")
"""What a check has at each position."""


class Workspace:
    """A machine without absorbers, at all positions, harmonics and rates that matter, ready to have absorbers put on it."""

    def __init__(
        self,
        machine: Machine,
        ports: Sequence[str],
        positions: ArrayLike,
        force: HarmonicForce,
        outputs: Sequence[str] = ("tool_x",),
        criterion: Criterion = "harmonic",
        tolerance: AbsorberTolerance = EXACT,
    ) -> None:
        if criterion not in ("harmonic", "rms"):
            raise ParameterError(f"criterion {criterion!r} is not one of harmonic, rms")
        if len(set(ports)) < len(ports):
            raise ParameterError("a port is named twice; absorbers at one port share it")
        self.ports, self.outputs, self.criterion, self.force = tuple(ports), tuple(outputs), criterion, force
        self.positions = as_positions(machine, positions)
        self._rates = tolerance.rates()
        freq = np.outer(self._rates, force.freq).ravel()
        self._s: ComplexArray = np.asarray(2j * np.pi * freq, dtype=np.complex128)
        names = (*self.outputs, *self.ports)
        data = [
            frequency_response(
                m, self.positions, freq, form="receptance", inputs=("force", *self.ports), outputs=names
            ).data
            for m in (machine_as_built(machine), *machines_within(machine, tolerance))
        ]
        # Machines stand beside positions: both only have to be tried.
        self._receptance = np.concatenate(data)
        self._weight = np.tile(force.amplitude, self._rates.size) * np.abs(self._s) ** 2

    def values(self, parameters: FloatArray, at: Sequence[int]) -> FloatArray:
        """Acceleration with absorbers."""
        response = self._with(parameters, at)[:, :, : len(self.outputs), 0]
        return self._judged(np.abs(response) * self._weight)

    def gradient(self, parameters: FloatArray, at: Sequence[int]) -> tuple[FloatArray, FloatArray]:
        """Acceleration with absorbers, and its derivatives to their parameters."""
        n = len(self.outputs)
        x = self._with(parameters, at)
        response = x[:, :, :n, 0]
        size = np.abs(response)
        direction = np.conj(response) / np.maximum(size, 1e-300)
        amplitude = size * self._weight
        values = self._judged(amplitude)
        slopes = np.empty((*values.shape, len(at), 3))
        _, dz = sprung_stiffness(parameters, self._s)
        for k, r in enumerate(at):
            moved = -x[:, :, :n, 1 + r] * x[:, :, n + r, 0][:, :, None]
            along = self._weight * direction * moved
            for j in range(3):
                change = np.real(along * dz[:, k, j][:, None, None])
                slopes[..., k, j] = self._judged_change(amplitude, change, values)
        return values, slopes

    def _with(self, parameters: FloatArray, at: Sequence[int]) -> ComplexArray:
        """All responses with the absorbers in place, shape (case, machine and position, output or foot, force or foot, line)."""
        n = len(self.outputs)
        z, _ = sprung_stiffness(parameters, self._s)
        x = self._receptance[None]
        for r in range(len(self.ports)):
            here = [k for k, port in enumerate(at) if port == r]
            if not here:
                continue
            total = z[:, here].sum(axis=1)[:, None]
            factor = total / (1.0 + total * x[:, :, n + r, 1 + r])
            x = x - factor[:, :, None, None] * x[:, :, :, 1 + r, None] * x[:, :, n + r, None, :]
        return np.broadcast_to(x, (len(parameters), *x.shape[1:]))

    def _judged(self, amplitude: FloatArray) -> FloatArray:
        """What counts, from amplitudes of shape (case, position, output, rate and harmonic)."""
        if self.criterion == "harmonic":
            return amplitude.reshape(*amplitude.shape[:2], -1)
        by_rate = amplitude.reshape(*amplitude.shape[:3], self._rates.size, -1)
        rms: FloatArray = np.sqrt(np.sum(by_rate**2, axis=-1) / 2)
        return rms.reshape(*amplitude.shape[:2], -1)

    def _judged_change(self, amplitude: FloatArray, change: FloatArray, values: FloatArray) -> FloatArray:
        if self.criterion == "harmonic":
            return change.reshape(values.shape)
        by_rate = (amplitude * change).reshape(*amplitude.shape[:3], self._rates.size, -1).sum(axis=-1) / 2
        out: FloatArray = by_rate.reshape(values.shape) / np.maximum(values, 1e-300)
        return out


@dataclass(frozen=True, repr=False)
class WorkspaceCheck(Drawn):
    """
    Absorbers judged over the whole rail.

    Parameters
    ----------
    mounted : tuple of MountedAbsorber
        The absorbers; none for the machine as it is.
    force : HarmonicForce
        The force on the tool.
    outputs : tuple of str
        Ports whose acceleration counts.
    criterion : {"harmonic", "rms"}
        What counts: the amplitude of the largest harmonic, or the RMS of all.
    tolerance : AbsorberTolerance
        The box.
    positions : array_like, shape (position,)
        y_b / L.
    before : array_like, shape (position,)
        Without absorbers, all as designed [m/s^2].
    exact : array_like, shape (position,)
        With them, all as designed [m/s^2].
    toleranced : array_like, shape (position,)
        With them, at worst within the tolerance [m/s^2].
    """

    mounted: tuple[MountedAbsorber, ...]
    force: HarmonicForce
    outputs: tuple[str, ...]
    criterion: Criterion
    tolerance: AbsorberTolerance
    positions: FloatArray
    before: FloatArray
    exact: FloatArray
    toleranced: FloatArray

    def __post_init__(self) -> None:
        for name in ("positions", *_JUDGED):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def mass(self) -> float:
        """Mass of all absorbers together [kg]."""
        return sum(m.absorber.mass for m in self.mounted)

    @property
    def worst(self) -> tuple[float, float, float]:
        """Largest over the rail: without absorbers, with them as designed, with them at worst within tolerance [m/s^2]."""
        return float(self.before.max()), float(self.exact.max()), float(self.toleranced.max())

    def sel(
        self,
        *,
        position: float | Sequence[float] | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> WorkspaceCheck:
        """
        The check at some of its positions.

        Parameters
        ----------
        position : float or sequence of float, optional
            Positions y_b / L that were judged (to 1e-9).
        output : str or sequence of str, optional
            All of the outputs that count: what is left is of them together.
        input : str, optional
            The one input, ``"force"``.

        Returns
        -------
        WorkspaceCheck
            The part.

        Raises
        ------
        ParameterError
            If a label is not there; the message lists those that are.
        """
        label_indices(("force",), input, "input")
        if len(label_indices(self.outputs, output, "output")) < len(self.outputs):
            raise ParameterError(f"{', '.join(self.outputs)} are judged together; run workspace_check for fewer")
        rows = position_indices(self.positions, position)
        return replace(self, **{name: getattr(self, name)[rows] for name in ("positions", *_JUDGED)})

    def to_dataframe(self) -> Any:
        """
        Accelerations over the rail as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each position y_b / L: before, exact and toleranced [m/s^2].
        """
        return data_frame({f"{name} [m/s^2]": getattr(self, name) for name in _JUDGED}, "position", self.positions)

    def to_xarray(self) -> Any:
        """
        Accelerations over the rail as a dataset of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``before``, ``exact`` and ``toleranced`` [m/s^2] over position.
        """
        return optional("xarray", "to_xarray").Dataset(
            {name: ("position", np.array(getattr(self, name)), {"units": "m/s^2"}) for name in _JUDGED},
            coords={"position": self.positions},
            attrs={"criterion": self.criterion},
        )

    def _table(self) -> Table:
        rows = []
        for name, values, worst in zip(
            ("nothing", "as designed", "at worst in tolerance"), (self.before, self.exact, self.toleranced), self.worst,
            strict=True,
        ):  # fmt: skip
            rows.append((name, f"{worst:.4g}", f"{self.positions[int(values.argmax())]:.3g}"))
        fitted = ", ".join(f"{m.absorber.mass:g} kg at {m.absorber.frequency:.4g} Hz on {m.port}" for m in self.mounted)
        title = f"Absorbers over the rail: {fitted or 'none'}"
        return Table(title, ("with", "largest [m/s^2]", "at y/L"), rows)


def workspace_check(
    machine: Machine,
    mounted: Sequence[MountedAbsorber] = (),
    positions: ArrayLike = WORKSPACE,
    *,
    force: HarmonicForce | None = None,
    outputs: str | Sequence[str] = ("tool_x",),
    criterion: Criterion = "harmonic",
    tolerance: AbsorberTolerance = EXACT,
) -> WorkspaceCheck:
    """
    Judge absorbers over the whole rail, under a periodic force, within tolerances.

    Parameters
    ----------
    machine : Machine
        The machine without them.
    mounted : sequence of MountedAbsorber
        The absorbers; none to judge the machine as it is.
    positions : array_like, shape (position,)
        y_b / L; the whole rail by default.
    force : HarmonicForce, optional
        The force on the tool; by default 1 N at 217 Hz, so that figures are accelerances.
    outputs : str or sequence of str
        Ports whose acceleration counts.
    criterion : {"harmonic", "rms"}
        What counts: the amplitude of the largest harmonic, or the RMS of all.
    tolerance : AbsorberTolerance
        The box; none by default.

    Returns
    -------
    WorkspaceCheck
        What is left at each position.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> from cutvib_ss.parameters import table_7
    >>> check = workspace_check(published_machine(), [MountedAbsorber(table_7())])
    >>> [round(value, 2) for value in check.worst]
    [2.78, 0.83, 0.83]
    """
    drive, outputs = HarmonicForce.tone() if force is None else force, names_of(outputs)
    ports = tuple(dict.fromkeys(m.port for m in mounted))
    at = [ports.index(m.port) for m in mounted]
    a = [m.absorber for m in mounted]
    nominal = np.array([[x.frequency, x.damping_ratio, x.mass] for x in a]).reshape(1, len(a), 3)
    plain = Workspace(machine, ports, positions, drive, outputs, criterion)
    n = plain.positions.size
    before = plain.values(np.empty((1, 0, 3)), [])[0].max(axis=-1)
    exact = plain.values(nominal, at)[0].max(axis=-1)
    wide = Workspace(machine, ports, positions, drive, outputs, criterion, tolerance)
    worst = wide.values(nominal * tolerance.factors(len(a)), at).max(axis=(0, 2))
    return WorkspaceCheck(
        tuple(mounted), drive, outputs, criterion, tolerance, plain.positions, before, exact,
        worst.reshape(-1, n).max(axis=0),
    )  # fmt: skip


def sprung_stiffness(parameters: FloatArray, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Dynamic stiffness of many sprung masses at once (Eq. 24), and its derivatives."""
    w = 2 * np.pi * parameters[..., 0, None]
    zeta, m = parameters[..., 1, None], parameters[..., 2, None]
    spring = w * w + 2 * zeta * w * s
    below = spring + s * s
    per_mass = s * s * spring / below
    # Through the spring alone: dz = m s⁴ d(spring) / below².
    through = m * s**4 / below**2
    slopes = np.stack([through * 2 * np.pi * (2 * w + 2 * zeta * s), through * 2 * w * s, per_mass], axis=-2)
    return m * per_mass, slopes
