"""A model at a position as a sum over its complex modes, as its channels and its nonlinear elements see it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import CUTTING_SIGNALS
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.rail import rail_points
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.response.batched import mixed
from cutvib_ss.response.modal_basis import modal_basis
from cutvib_ss.results import ComplexArray, FloatArray, Quantity
from cutvib_ss.units import DERIVATIVE_ORDER

_FORMS = 40
"""Sums that are kept."""


@dataclass(frozen=True)
class ModalForm:
    """A model at a position as a sum over its complex modes."""

    poles: ComplexArray  # Poles of positive imaginary part, and real ones [rad/s]
    drives: ComplexArray  # Participation of the inputs: the force, then the ports
    # Displacement of the outputs: the channels, then the ports. A conjugate pair counts twice its real part
    shapes: ComplexArray
    quantities: tuple[Quantity, ...]  # Motion quantity of each channel
    outputs: tuple[str, ...]  # Names of the channels, and of the ports of nonlinear elements
    ports: tuple[str, ...]
    from_state: ComplexArray  # Modes of an initial displacement and velocity of the degrees of freedom
    dofs: tuple[str, ...]  # Names of the degrees of freedom
    # How the channels move with a shaker's base, where they read absolute motion; the sum over the modes is relative
    # to it
    base_shares: tuple[float, ...] = ()

    @cached_property
    def at_lines(self) -> dict[tuple[float, int], Any]:
        """What a transform makes of it at its lines, by clock and length (`stepping`)."""
        return {}

    @cached_property
    def orders(self) -> tuple[int, ...]:
        """How often each channel differentiates displacement."""
        return tuple(DERIVATIVE_ORDER[q] for q in self.quantities)

    def add_base(self, responses: FloatArray, acceleration: FloatArray, fs: float) -> None:
        """Add a shaker's own motion, at rest at first, to responses of shape (blow, channel, sample)."""
        for k, (share, order) in enumerate(zip(self.base_shares, self.orders, strict=False)):
            if share:
                responses[:, k] += share * base_motion(acceleration, fs, order)

    def receptance(self, s: ComplexArray) -> ComplexArray:
        """Displacements per unit force, shape (output, input, frequency)."""
        return self.summed(s, self.inverses(s))

    def inverses(self, s: ComplexArray) -> ComplexArray:
        """1/((s - p)(s - p̄)) of each pole, shape (mode, frequency)."""
        # In real arithmetic, which takes a third of the time.
        p, square = self.poles[:, None], s * s
        real = square.real - 2 * p.real * s.real + (p.real**2 + p.imag**2)
        imaginary = square.imag - 2 * p.real * s.imag
        weight = 1.0 / (real * real + imaginary * imaginary)
        out = np.empty(weight.shape, dtype=np.complex128)
        np.multiply(real, weight, out=out.real)
        np.multiply(imaginary, -weight, out=out.imag)
        return out

    def summed(self, s: ComplexArray, inverses: ComplexArray) -> ComplexArray:
        """Displacements per unit force, shape (output, input, frequency)."""
        # Half a residue R over each of two conjugate poles is (Re(R) s - Re(R p̄))/((s - p)(s - p̄)), of a real pole R/(s - p).
        residues = self.shapes[:, None, :] * self.drives.T[None, :, :]
        numerators = np.stack([residues.real, -(residues * self.poles.conj()).real])
        linear, constant = mixed(numerators, inverses)
        total: ComplexArray = linear * s
        total += constant
        return total


def modal_form(
    machine: Model,
    position: float | None = None,
    outputs: Sequence[str] | None = None,
    viscous_at: float | None = None,
    quantities: Sequence[Quantity] | None = None,
    ports: Sequence[str] | None = None,
    classical_above: float = np.inf,
    input: str = "force",
) -> ModalForm:
    """The modal sum of a model at a position, as its channels and nonlinear elements see it."""
    names = tuple(machine.channels) if outputs is None else tuple(outputs)
    at = tuple(e.port for e in machine.nonlinear) if ports is None else tuple(ports)
    given = {n: machine.channels[n].quantity if n in machine.channels else "displacement" for n in names}
    read = tuple(given.values()) if quantities is None else tuple(quantities)
    reads = [machine.channels[n].port if n in machine.channels else n for n in names]
    system = system_with(machine, position, viscous_at, (*reads, *at, input))
    rows = np.array([row_of(system, r) for r in (*reads, *at)])
    first = machine.drive(system) if input == "force" else row_of(system, input)
    forces = np.array([first, *(row_of(system, p) for p in at)])
    shares = tuple(machine.base_share(n) for n in names)
    matrices = tuple(a.tobytes() for a in (system.mass, system.damping, system.stiffness, rows, forces))
    return _form(matrices, system.dofs, classical_above, read, names, at, shares)


@lru_cache(maxsize=_FORMS)
def _form(
    matrices: tuple[bytes, ...],
    dofs: tuple[str, ...],
    classical_above: float,
    quantities: tuple[Quantity, ...],
    outputs: tuple[str, ...],
    ports: tuple[str, ...],
    shares: tuple[float, ...],
) -> ModalForm:
    """The modal sum of a system of given matrices, rows of the outputs and rows of the inputs."""
    # A restoring force is simulated on one machine with many values of its own: all share its modes. Where records drift each has a
    # machine of its own, which comes again only after all others have come.
    mass, damping, stiffness, rows, forces = (np.frombuffer(m).reshape(-1, len(dofs)) for m in matrices)
    m = modal_basis(SecondOrder(mass, damping, stiffness, dofs, {}), classical_above)
    return ModalForm(
        m.poles, m.drives @ forces.T, rows @ m.shapes, quantities, outputs, ports, m.from_state, dofs, shares
    )


def base_motion(acceleration: FloatArray, fs: float, order: int, periodic: bool = False) -> FloatArray:
    """
    A base's displacement, velocity or acceleration (order 0 to 2) of an acceleration that is linear between its samples.

    From rest, or periodic: then without mean, which the acceleration must not have either.
    """
    if order == 2:
        return acceleration
    h = 1.0 / fs
    a = np.concatenate([acceleration, acceleration[..., :1]], axis=-1) if periodic else acceleration
    left, right = a[..., :-1], a[..., 1:]

    def summed(steps: FloatArray) -> FloatArray:
        return np.concatenate([np.zeros((*a.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)

    velocity = summed(h * (left + right) / 2)
    if periodic:
        if np.abs(velocity[..., -1]).max() > 1e-6 * np.abs(h * a).sum():
            raise ParameterError(
                "the base's acceleration has a mean: its periodic velocity does not exist; take it out"
            )
        travelled = np.sum(h * velocity[..., :-1] + h * h * (2 * left + right) / 6, axis=-1, keepdims=True)
        velocity = velocity - travelled / (h * left.shape[-1])
    out = velocity if order else summed(h * velocity[..., :-1] + h * h * (2 * left + right) / 6)
    if not periodic:
        return out
    out = out[..., :-1]
    return out if order else out - out.mean(axis=-1, keepdims=True)


def system_with(machine: Model, position: float | None, viscous_at: float | None, names: Sequence[str]) -> SecondOrder:
    """The second-order form of a model with the ports that some signals need; points of the rail as ``rail(0.25)``."""
    return machine.second_order(position, viscous_at, rail_points(names))


def row_of(system: SecondOrder, name: str) -> FloatArray:
    """A signal's row over the degrees of freedom, shape (n,)."""
    return system.port(CUTTING_SIGNALS.get(name, name) if name not in system.ports else name)
