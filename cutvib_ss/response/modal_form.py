"""A model at a position as a sum over its complex modes, as its channels and its nonlinear elements see it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import linalg

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.machine import CUTTING_SIGNALS, Machine
from cutvib_ss.mechanical import SecondOrder
from cutvib_ss.results import ComplexArray, FloatArray, Quantity
from cutvib_ss.structure import Structure
from cutvib_ss.units import DERIVATIVE_ORDER

_RIGID = 1e-10
"""Undamped poles closer to zero than this part of the fastest are set apart by it: a free body's motion has a double pole."""


@dataclass(frozen=True)
class ModalForm:
    """
    A model at a position as a sum over its complex modes.

    Parameters
    ----------
    poles : ndarray of complex, shape (mode,)
        Poles of positive imaginary part, and real ones [rad/s].
    drives : ndarray of complex, shape (mode, input)
        Participation of the inputs: the force, then the ports.
    shapes : ndarray of complex, shape (output, mode)
        Displacement of the outputs: the channels, then the ports. A conjugate pair counts twice its real part.
    quantities : tuple of str
        Motion quantity of each channel.
    outputs, ports : tuple of str
        Names of the channels, and of the ports of nonlinear elements.
    from_state : ndarray of complex, shape (mode, 2 n)
        Modes of an initial displacement and velocity of the degrees of freedom.
    dofs : tuple of str
        Names of the degrees of freedom.
    """

    poles: ComplexArray
    drives: ComplexArray
    shapes: ComplexArray
    quantities: tuple[Quantity, ...]
    outputs: tuple[str, ...]
    ports: tuple[str, ...]
    from_state: ComplexArray
    dofs: tuple[str, ...]

    @cached_property
    def orders(self) -> tuple[int, ...]:
        """How often each channel differentiates displacement."""
        return tuple(DERIVATIVE_ORDER[q] for q in self.quantities)

    def receptance(self, s: ComplexArray) -> ComplexArray:
        """
        Displacements per unit force.

        Parameters
        ----------
        s : ndarray of complex, shape (frequency,)
            Laplace variable [rad/s].

        Returns
        -------
        ndarray, shape (output, input, frequency)
            The sum over the modes.
        """
        residues = self.shapes[:, None, :] * self.drives.T[None, :, :]
        # Half a residue over each of two conjugate poles; a real pole's halves fall on the same one.
        both = np.concatenate([residues, residues.conj()], axis=2) / 2
        poles = np.concatenate([self.poles, self.poles.conj()])
        total: ComplexArray = both @ (1.0 / (s - poles[:, None]))
        return total


def modal_form(
    machine: Machine | Structure,
    position: float | None = None,
    outputs: Sequence[str] | None = None,
    viscous_at: float | None = None,
    quantities: Sequence[Quantity] | None = None,
    ports: Sequence[str] | None = None,
) -> ModalForm:
    """
    The modal sum of a model at a position, as its channels and nonlinear elements see it.

    Parameters
    ----------
    machine : Machine or Structure
        The model; its measurement chain is not applied here.
    position : float, optional
        y_b / L of the head, strictly inside (0, 1); left out for a structure.
    outputs : sequence of str, optional
        Channels or ports, ``rail(0.25)`` among them; the channels by default.
    viscous_at : float, optional
        Frequency [Hz] at which hysteretic damping is replaced by the equivalent viscous one.
    quantities : sequence of str, optional
        Motion quantity of each output: by default each channel's own, displacement of ports.
    ports : sequence of str, optional
        Ports of nonlinear elements; those of the model by default.

    Returns
    -------
    ModalForm
        All modes.

    Raises
    ------
    ParameterError
        If the position or a signal is impossible.
    CouplingError
        If damping is hysteretic and no ``viscous_at`` is given, or the mass matrix is not positive definite.
    """
    names = tuple(machine.channels) if outputs is None else tuple(outputs)
    at = tuple(e.port for e in machine.nonlinear) if ports is None else tuple(ports)
    given = {n: machine.channels[n].quantity if n in machine.channels else "displacement" for n in names}
    read = tuple(given.values()) if quantities is None else tuple(quantities)
    reads = [machine.channels[n].port if n in machine.channels else n for n in names]
    system = _system(machine, position, viscous_at, (*reads, *at))
    rows = np.array([_row(system, r) for r in (*reads, *at)])
    if isinstance(machine, Structure):
        force = machine.drive(system)
    else:
        force = system.port(machine.input_port)
    forces = np.array([force, *(_row(system, p) for p in at)]).T
    poles, right, left, from_state = _modes(system)
    return ModalForm(poles, left @ forces, rows @ right, read, names, at, from_state, system.dofs)


def _system(
    machine: Machine | Structure, position: float | None, viscous_at: float | None, names: Sequence[str]
) -> SecondOrder:
    if isinstance(machine, Structure):
        return machine.second_order(position, viscous_at)
    points = {}
    for name in names:
        if found := re.fullmatch(r"rail\((.*)\)", name):
            try:
                points[name] = float(found[1])
            except ValueError:
                raise ParameterError(f"signal {name!r}: write rail(0.25) for the rail at a quarter") from None
    return machine.second_order(position, viscous_at, points)


def _row(system: SecondOrder, name: str) -> FloatArray:
    return system.port(CUTTING_SIGNALS.get(name, name) if name not in system.ports else name)


def _modes(system: SecondOrder) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
    """
    Poles, shapes over the degrees of freedom, participations of forces on them, and of an initial state.

    With p the undamped modes' amplitudes the states are (p, ṗ/w); right and left vectors of that small matrix give the modal sum.
    """
    try:
        squares, basis = linalg.eigh(system.stiffness, system.mass)
    except linalg.LinAlgError as error:
        raise CouplingError("the mass matrix is not positive definite: there are no modes to step") from error
    n = squares.size
    w = float(np.sqrt(np.abs(squares).max())) or 1.0
    squares = np.where(np.abs(squares) < (_RIGID * w) ** 2 * 1e4, (_RIGID * w) ** 2 * 1e8, squares)
    damping = basis.T @ system.damping @ basis
    a = np.block([[np.zeros((n, n)), w * np.eye(n)], [-np.diag(squares) / w, -damping]])
    values, vectors = linalg.eig(a)
    inverse: ComplexArray = linalg.inv(vectors)
    # A real pole's shape is real up to a factor of its own, which inverse and vector share; a pair counts twice.
    values.imag[np.abs(values.imag) < 1e-13 * w] = 0.0
    kept = np.flatnonzero(values.imag >= 0.0)
    kept = kept[np.argsort(np.abs(values[kept]), kind="stable")]
    right: ComplexArray = basis @ vectors[:n, kept] * np.where(values[kept].imag > 0.0, 2.0, 1.0)
    left = inverse[kept, n:] @ basis.T / w
    state = np.hstack([inverse[kept, :n], inverse[kept, n:] / w]) @ np.kron(np.eye(2), basis.T @ system.mass)
    return values[kept], right, left, state
