"""What the outputs of a response in time read: motion of channels and ports, and the force that the rail's ends pass on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.rail import EndSupports
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.parameters import check_choice
from cutvib_ss.response.modal_basis import ModalBasis
from cutvib_ss.response.modal_form import row_of
from cutvib_ss.response.signals import displacement_unit
from cutvib_ss.results import ComplexArray, FloatArray, Quantity
from cutvib_ss.units import DERIVATIVE_ORDER, rate_unit

END_FORCES = ("rail_left_force", "rail_right_force")
"""Outputs that are forces of the rail on what holds its ends, in X [N]."""


@dataclass(frozen=True)
class OutputRow:
    """An output as a sum over displacement, velocity and acceleration of the degrees of freedom, and over forces."""

    name: str  # Name and SI unit
    unit: str
    motion: FloatArray  # Rows over displacement, velocity and acceleration
    forces: FloatArray  # What each force adds directly

    def weights(self, modes: ModalBasis) -> ComplexArray:
        """The output as a sum over modes, shape (mode,)."""
        powers = modes.poles ** np.arange(3)[:, None]
        total: ComplexArray = np.sum((self.motion @ modes.shapes) * powers, axis=0)
        return total

    def direct(self, system: SecondOrder, drives: FloatArray, signs: FloatArray) -> FloatArray:
        """What forces pass to the output at once, shape (force,)."""
        return np.asarray(signs * self.forces + self.motion[2] @ np.linalg.solve(system.mass, drives))


def output_rows(
    machine: Model,
    system: SecondOrder,
    position: float | None,
    viscous_at: float | None,
    names: Sequence[str],
    quantities: Sequence[Quantity | None],
    inputs: Sequence[str],
) -> list[OutputRow]:
    """Rows of outputs by name."""
    rows = []
    for name, quantity in zip(names, quantities, strict=True):
        if name in END_FORCES:
            if not machine.has_position:
                raise ParameterError(f"output {name!r} needs a cutting machine; this model has no rail")
            rows.append(_end_force(cast(Machine, machine), system, position, viscous_at, name, inputs))
            continue
        channel = machine.channels.get(name)
        read: Quantity = quantity or (channel.quantity if channel else "displacement")
        check_choice("quantity", read, tuple(DERIVATIVE_ORDER))
        motion = np.zeros((3, len(system.dofs)))
        motion[DERIVATIVE_ORDER[read]] = row_of(system, channel.port if channel else name)
        rows.append(OutputRow(name, rate_unit(displacement_unit(machine, name), read), motion, np.zeros(len(inputs))))
    return rows


def _end_force(
    machine: Machine,
    system: SecondOrder,
    position: float | None,
    viscous_at: float | None,
    name: str,
    inputs: Sequence[str],
) -> OutputRow:
    """Force of the rail on what holds an end."""
    end = name.removesuffix("_force")
    motion, forces = np.zeros((3, len(system.dofs))), np.zeros(len(inputs))
    supports = machine.coupling(viscous_at).rail.supports
    if supports is not None:
        # Of springs and dampers under the end: k u + c u̇.
        k, c = (supports.k_left, supports.c_left) if end == "rail_left" else (supports.k_right, supports.c_right)
        motion[0], motion[1] = k * system.port(end), c * system.port(end)
        return OutputRow(name, "N", motion, forces)
    # A rigid pin passes on what the equation of the end's motion, released, lacks: the forces that would push it, less
    # M q̈ + C q̇ + K q in its row, at u = 0.
    released = replace(machine, rail=replace(machine.rail, supports=EndSupports(1.0, 1.0)))
    free = released.second_order(position, viscous_at)
    row = free.dofs.index(end)
    kept = [free.dofs.index(dof) for dof in system.dofs]
    for order, matrix in enumerate((free.stiffness, free.damping, free.mass)):
        motion[order] = -matrix[row, kept]
    for j, port in enumerate(inputs):
        forces[j] = row_of(free, machine.input_port if port == "force" else port)[row]
    return OutputRow(name, "N", motion, forces)
