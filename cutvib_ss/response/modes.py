"""Natural modes, poles and damping of a model at a position, and modes followed over positions as they veer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, optimize

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import SpringDamperMass, of_known_poles
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import ModelT
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.response.axes import as_positions
from cutvib_ss.results import ComplexArray, FloatArray, Modes, TrackedModes

_RIGID = 1e-12
"""Squared natural frequencies below this part of the largest are a free body's."""
_START, _STEPS = 600j, 30
"""First s [rad/s], and most steps, in the search of a mode's pole where elements have no finite form."""
_SAME_MODE = 0.9
"""Where the modal assurance criterion falls below this, a step along the rail is halved."""


def modes(machine: Model, position: float | None = None) -> Modes:
    """
    Natural modes and poles at a position.

    Parameters
    ----------
    machine : Machine or Structure
        The model; nonlinear elements and the measurement chain do not matter here.
    position : float, optional
        y_b / L of the head, strictly inside (0, 1); left out for a structure.

    Returns
    -------
    Modes
        Undamped modes from the symmetric problem, ascending, each with the pole that continues it as damping is added.

    Raises
    ------
    ParameterError
        If a machine has no position, or it lies outside the rail.
    CouplingError
        If the mass matrix is not positive definite.

    Notes
    -----
    K φ = ω² M φ, and (p² M + p C + K + jH) ψ = 0, where H is what hysteretic elements add at positive frequencies. A
    mode damped beyond oscillation is given its slower real pole, a free body's motion the pole 0. Where an element has no finite
    form, each mode is that of the model with the spring and damper that equal it at the mode's pole, which is exact for the pole.

    Examples
    --------
    >>> from cutvib_ss.model.machine import published_machine
    >>> modes(published_machine(), 0.5).natural_freq.round(1)
    array([ 24.5, 126.8, 210.6, 220.6, 409.1, 507.2])
    """
    place = float(as_positions(machine, position)[0])
    if any(of_known_poles(e, 1j) is not e for e in machine.elements):
        return _each_at_its_own(machine, None if np.isnan(place) else place)
    system, loss = _matrices(machine, None if np.isnan(place) else place)
    freq, shapes = _undamped(system)
    poles = _poles(system, loss, freq, shapes)
    return Modes(freq, _ratio(poles), poles, shapes, system.dofs, place)


def _each_at_its_own(machine: Model, position: float | None) -> Modes:
    """Each mode of the model whose elements without a finite form are replaced by what equals them at that mode's pole."""

    def at(s: complex) -> Modes:
        return modes(machine.equivalent(s), position)

    start = at(_START)
    each = range(start.poles.size)
    found = [start] * len(each)
    for r in each:
        for _ in range(_STEPS):
            pole = complex(found[r].poles[r])
            if pole.imag == 0.0:
                break
            found[r] = at(pole)
            if abs(found[r].poles[r] - pole) <= 1e-10 * abs(pole):
                break
    poles = np.array([found[r].poles[r] for r in each])
    return replace(
        start,
        natural_freq=np.array([found[r].natural_freq[r] for r in each]),
        damping_ratio=_ratio(poles),
        poles=poles,
        mode_shapes=np.column_stack([found[r].mode_shapes[:, r] for r in each]),
    )


def mac(a: ArrayLike, b: ArrayLike, mass: ArrayLike | None = None) -> FloatArray:
    """
    Modal assurance criterion between two sets of mode shapes.

    >>> mac([[1.0], [0.0]], [[1.0, 0.0], [1.0, 2.0]])
    array([[0.5, 0. ]])
    """
    left, right = np.asarray(a), np.asarray(b)
    if left.ndim != 2 or right.ndim != 2 or left.shape[0] != right.shape[0]:
        raise ParameterError(
            f"mode shapes of shape {left.shape} and {right.shape} cannot be compared; give (dof, mode)"
        )
    weight = np.eye(left.shape[0]) if mass is None else np.asarray(mass)
    cross = np.abs(left.conj().T @ weight @ right) ** 2
    sizes = np.outer(_square_norm(left, weight), _square_norm(right, weight))
    out: FloatArray = np.divide(cross, sizes, out=np.zeros(cross.shape), where=sizes > 0)
    return out


def _square_norm(shapes: NDArray[Any], weight: NDArray[Any]) -> FloatArray:
    return np.asarray(np.einsum("ik,ij,jk->k", shapes.conj(), weight, shapes).real)


def track_modes(machine: Machine, positions: ArrayLike, *, halvings: int = 8) -> TrackedModes:
    """
    Modes followed over positions by the modal assurance criterion.

    Parameters
    ----------
    machine : Machine
        The machine.
    positions : array_like, shape (position,)
        y_b / L, in the order in which the head travels.
    halvings : int
        How often a step may be halved where modes change too much to be told apart (they veer).

    Returns
    -------
    TrackedModes
        Frequencies, damping and shapes, one column a mode.

    Raises
    ------
    ParameterError
        If the model has no position, or one lies outside the rail.

    Notes
    -----
    From one position to the next, modes are paired so that the sum of their assurance criteria is largest, with the
    mass matrix as weight. Where a pair agrees less than 0.9 the step is halved. A veering narrower than the finest step
    is passed as a crossing; ``mac`` tells where.
    """
    if not machine.has_position:
        raise ParameterError("modes are followed over positions; a second_order model has none")
    places = as_positions(machine, positions)
    here = _at(machine, float(places[0]))
    steps, agreement = [here], [np.ones(here.freq.size)]
    for place in places[1:]:
        here, worst = _step(machine, here, float(place), halvings)
        steps.append(here)
        agreement.append(worst)
    poles = np.array([_poles(s.system, s.loss, s.freq, s.shapes) for s in steps])
    freq, shapes = np.array([s.freq for s in steps]), np.array([s.shapes for s in steps])
    return TrackedModes(places, freq, _ratio(poles), poles, shapes, np.array(agreement), here.system.dofs)


@dataclass(frozen=True)
class _Place:
    """Undamped modes at a position, and the matrices there."""

    position: float
    system: SecondOrder
    loss: FloatArray
    freq: FloatArray
    shapes: FloatArray


def _at(machine: Machine, position: float) -> _Place:
    system, loss = _matrices(machine, position)
    return _Place(position, system, loss, *_undamped(system))


def _step(machine: Machine, start: _Place, position: float, halvings: int) -> tuple[_Place, FloatArray]:
    end = _at(machine, position)
    # Half of each end's mass: neither end is privileged, and there and back is the same pairing.
    weight = (start.system.mass + end.system.mass) / 2
    agreement = mac(start.shapes, end.shapes, weight)
    order = optimize.linear_sum_assignment(agreement, maximize=True)[1]
    agreed = agreement[np.arange(order.size), order]
    if agreed.min() >= _SAME_MODE or halvings == 0:
        shapes = end.shapes[:, order]
        overlap = np.einsum("ik,ij,jk->k", start.shapes, weight, shapes)
        shapes = shapes * np.where(overlap < 0, -1.0, 1.0)
        return replace(end, freq=end.freq[order], shapes=shapes), agreed
    middle, first = _step(machine, start, (start.position + position) / 2, halvings - 1)
    last, second = _step(machine, middle, position, halvings - 1)
    return last, np.minimum(first, second)


def _matrices(machine: Model, position: float | None) -> tuple[SecondOrder, FloatArray]:
    """Mass, damping and stiffness without hysteresis, and the matrix H of the hysteretic elements."""
    system = _with_springs(machine, 0.0).second_order(position)
    if not any(isinstance(a.element, SpringDamperMass) and a.element.loss_stiffness for a in machine.attachments):
        return system, np.zeros_like(system.mass)
    return system, _with_springs(machine, 1.0).second_order(position).stiffness - system.stiffness


def _with_springs(machine: ModelT, share: float) -> ModelT:
    """The model with a share of each hysteretic element's loss stiffness as an elastic one."""
    attachments = []
    for a in machine.attachments:  # type: ignore[attr-defined]
        e = a.element
        if isinstance(e, SpringDamperMass):
            e = replace(e, stiffness=e.stiffness + share * e.loss_stiffness, loss_stiffness=0.0)
        attachments.append(replace(a, element=e))
    return replace(machine, attachments=tuple(attachments))  # type: ignore[type-var]


def _undamped(system: SecondOrder) -> tuple[FloatArray, FloatArray]:
    try:
        squares, shapes = linalg.eigh(system.stiffness, system.mass)
    except linalg.LinAlgError as error:
        raise CouplingError("the mass matrix is not positive definite: the model has no natural modes") from error
    squares[np.abs(squares) < _RIGID * squares[-1]] = 0.0
    largest = np.argmax(np.abs(shapes), axis=0)
    shapes = shapes * np.where(shapes[largest, np.arange(squares.size)] < 0, -1.0, 1.0)
    # A negative square would be a structure that runs away; models with one are refused where they are read.
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), shapes


def _ratio(poles: ComplexArray) -> FloatArray:
    size = np.abs(poles)
    out: FloatArray = np.divide(-poles.real, size, out=np.zeros(size.shape), where=size > 0)
    return out


def _poles(system: SecondOrder, loss: FloatArray, freq: FloatArray, shapes: FloatArray) -> ComplexArray:
    """The pole that continues each undamped mode."""
    n, omega = freq.size, 2 * np.pi * freq
    scale = float(omega.max()) or 1.0
    damping = shapes.T @ system.damping @ shapes
    stiffness = np.diag(omega**2)
    if loss.any():
        stiffness = stiffness + 1j * (shapes.T @ loss @ shapes)
    values, vectors = linalg.eig(np.block([[np.zeros((n, n)), scale * np.eye(n)], [-stiffness / scale, -damping]]))
    values[np.abs(values) < 1e-7 * scale] = 0.0
    values.imag[np.abs(values.imag) < 1e-12 * scale] = 0.0
    oscillating = np.flatnonzero(values.imag > 0.0)
    if oscillating.size < n:
        slowest = [i for i in np.argsort(-values.real) if values[i].imag == 0.0]
        oscillating = np.concatenate([oscillating, slowest[: n - oscillating.size]]).astype(np.intp)
    oscillating = oscillating[:n]
    motion = np.abs(vectors[:n, oscillating]) ** 2
    motion = motion / motion.sum(axis=0)
    # Participation tells modes apart; among those it cannot, the distance in frequency decides.
    distance = np.abs(np.abs(values[oscillating])[None, :] - omega[:, None]) / scale
    pairs = optimize.linear_sum_assignment(motion - 1e-3 * distance, maximize=True)[1]
    poles: ComplexArray = values[oscillating[pairs]]
    return poles
