"""Natural modes, at one position and followed over positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.results.arrays import ComplexArray, FloatArray, label_indices, position_indices, read_only
from cutvib_ss.results.display import Drawn, Table, data_frame, optional


def _refuse(what: str, asked: object) -> None:
    """Modes have no inputs, and their outputs are the degrees of freedom."""
    if asked is not None:
        raise ParameterError(f"modes have no {what} (asked for {asked!r}); pick degrees of freedom with output=")


@dataclass(frozen=True, repr=False)
class Modes(Drawn):
    """
    Natural modes of a model at one position.

    Parameters
    ----------
    natural_freq : array_like, shape (mode,)
        Undamped natural frequencies [Hz], ascending.
    damping_ratio : array_like, shape (mode,)
        Damping ratio -Re(p)/|p| of the damped pole that continues each undamped mode.
    poles : array_like of complex, shape (mode,)
        Poles [rad/s] of the upper half plane, in the order of the modes.
    mode_shapes : array_like, shape (dof, mode)
        Undamped mode shapes, mass-normalised (φᵀ M φ = 1): of a displacement in kg^-0.5, of a rotation in rad/(kg^0.5 m), of a
        modal coordinate without unit.
    dofs : sequence of str
        Names of the degrees of freedom.
    position : float
        Position y_b / L; NaN where the model has none.
    """

    natural_freq: FloatArray
    damping_ratio: FloatArray
    poles: ComplexArray
    mode_shapes: FloatArray
    dofs: tuple[str, ...]
    position: float = float("nan")

    def __post_init__(self) -> None:
        for name in ("natural_freq", "damping_ratio", "mode_shapes"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))
        object.__setattr__(self, "poles", read_only(self.poles, np.complex128))
        object.__setattr__(self, "dofs", tuple(self.dofs))

    def sel(
        self,
        *,
        position: float | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> Modes:
        """
        The modes with some of their degrees of freedom.

        Parameters
        ----------
        position : float, optional
            The position of these modes.
        output : str or sequence of str, optional
            Degrees of freedom to keep, in this order.
        input : None
            Modes have no inputs.

        Returns
        -------
        Modes
            The part.

        Raises
        ------
        ParameterError
            If a label is not there; the message lists those that are.
        """
        _refuse("inputs", input)
        position_indices(np.array([self.position]), position)
        kept = label_indices(self.dofs, output, "output")
        return replace(self, mode_shapes=self.mode_shapes[kept], dofs=tuple(self.dofs[k] for k in kept))

    def to_dataframe(self) -> Any:
        """
        The modes as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each mode: natural frequency [Hz], damping ratio, pole [rad/s], and the mode shape by degree of freedom.
        """
        columns: dict[str, Any] = {
            "natural_freq [Hz]": self.natural_freq,
            "damping_ratio": self.damping_ratio,
            "pole [rad/s]": self.poles,
        }
        columns |= {dof: self.mode_shapes[k] for k, dof in enumerate(self.dofs)}
        return data_frame(columns, "mode", range(1, self.natural_freq.size + 1))

    def to_xarray(self) -> Any:
        """
        The modes as a dataset of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``natural_freq`` [Hz], ``damping_ratio``, ``pole`` [rad/s] over mode, ``mode_shape`` over (dof, mode).
        """
        return _dataset(self, ("mode",), {"position": self.position})

    def _table(self) -> Table:
        place = "" if np.isnan(self.position) else f" with the head at y/L = {self.position:.4g}"
        rows = []
        for k, freq in enumerate(self.natural_freq):
            shape = self.mode_shapes[:, k]
            strongest = ", ".join(f"{self.dofs[i]} {shape[i]:+.3g}" for i in np.argsort(-np.abs(shape))[:2])
            rows.append((f"{k + 1}", f"{freq:.2f}", f"{100 * self.damping_ratio[k]:.3f}", strongest))
        columns = ("mode", "frequency [Hz]", "damping [%]", "largest parts")
        return Table(f"{len(rows)} modes{place}", columns, rows)


@dataclass(frozen=True, repr=False)
class TrackedModes(Drawn):
    """
    Natural modes followed over positions: column k is one and the same mode throughout.

    Parameters
    ----------
    positions : array_like, shape (position,)
        Positions y_b / L.
    natural_freq : array_like, shape (position, mode)
        Undamped natural frequencies [Hz]; ascending at the first position, and on as long as no two modes cross.
    damping_ratio : array_like, shape (position, mode)
        Damping ratios.
    poles : array_like of complex, shape (position, mode)
        Poles [rad/s] of the upper half plane.
    mode_shapes : array_like, shape (position, dof, mode)
        Mass-normalised mode shapes, their signs carried along.
    mac : array_like, shape (position, mode)
        Modal assurance criterion with the step before, the lowest on the way from the position before; 1 at the first.
    dofs : sequence of str
        Names of the degrees of freedom.
    """

    positions: FloatArray
    natural_freq: FloatArray
    damping_ratio: FloatArray
    poles: ComplexArray
    mode_shapes: FloatArray
    mac: FloatArray
    dofs: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in ("positions", "natural_freq", "damping_ratio", "mode_shapes", "mac"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))
        object.__setattr__(self, "poles", read_only(self.poles, np.complex128))
        object.__setattr__(self, "dofs", tuple(self.dofs))

    def sel(
        self,
        *,
        position: float | Sequence[float] | None = None,
        output: str | Sequence[str] | None = None,
        input: str | Sequence[str] | None = None,
    ) -> TrackedModes:
        """
        The modes at some positions, with some of their degrees of freedom.

        Parameters
        ----------
        position : float or sequence of float, optional
            Positions y_b / L among those that were computed (to 1e-9).
        output : str or sequence of str, optional
            Degrees of freedom to keep, in this order.
        input : None
            Modes have no inputs.

        Returns
        -------
        TrackedModes
            The part.

        Raises
        ------
        ParameterError
            If a label is not there; the message lists those that are.
        """
        _refuse("inputs", input)
        rows, kept = position_indices(self.positions, position), label_indices(self.dofs, output, "output")
        names = ("positions", "natural_freq", "damping_ratio", "poles", "mac")
        return replace(
            self,
            **{name: getattr(self, name)[rows] for name in names},
            mode_shapes=self.mode_shapes[rows][:, kept],
            dofs=tuple(self.dofs[k] for k in kept),
        )

    def to_dataframe(self) -> Any:
        """
        Frequencies and damping over positions as a table of pandas (extra ``data``).

        Returns
        -------
        pandas.DataFrame
            A row for each position and mode.
        """
        pandas = optional("pandas", "to_dataframe")
        count = self.natural_freq.shape[1]
        rows = pandas.MultiIndex.from_product([self.positions, range(1, count + 1)], names=["position", "mode"])
        columns = {
            "natural_freq [Hz]": self.natural_freq.ravel(),
            "damping_ratio": self.damping_ratio.ravel(),
            "pole [rad/s]": self.poles.ravel(),
            "mac": self.mac.ravel(),
        }
        return pandas.DataFrame(columns, index=rows)

    def to_xarray(self) -> Any:
        """
        The modes as a dataset of xarray (extra ``data``).

        Returns
        -------
        xarray.Dataset
            ``natural_freq`` [Hz], ``damping_ratio``, ``pole`` [rad/s], ``mac`` over (position, mode), ``mode_shape`` over
            (position, dof, mode).
        """
        return _dataset(self, ("position", "mode"), {"position": self.positions})

    def _table(self) -> Table:
        rows = []
        for k in range(self.natural_freq.shape[1]):
            freq, ratio = self.natural_freq[:, k], 100 * self.damping_ratio[:, k]
            ranges = (f"{v.min():.{n}f} to {v.max():.{n}f}" for v, n in ((freq, 2), (ratio, 3)))
            rows.append((f"{k + 1}", *ranges))
        title = f"{len(rows)} modes over {self.positions.size} positions"
        return Table(title, ("mode", "frequency [Hz]", "damping [%]"), rows)


def _dataset(modes: Modes | TrackedModes, dims: tuple[str, ...], coords: dict[str, Any]) -> Any:
    xarray = optional("xarray", "to_xarray")
    values: dict[str, Any] = {
        "natural_freq": (dims, np.array(modes.natural_freq), {"units": "Hz"}),
        "damping_ratio": (dims, np.array(modes.damping_ratio), {"units": "1"}),
        "pole": (dims, np.array(modes.poles), {"units": "rad/s"}),
        "mode_shape": ((*dims[:-1], "dof", "mode"), np.array(modes.mode_shapes)),
    }
    if isinstance(modes, TrackedModes):
        values["mac"] = (dims, np.array(modes.mac))
    count = modes.natural_freq.shape[-1]
    return xarray.Dataset(values, coords={**coords, "mode": range(1, count + 1), "dof": list(modes.dofs)})
