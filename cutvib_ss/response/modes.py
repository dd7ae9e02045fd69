"""Natural modes, poles and damping of a model at a position, and modes followed over positions as they veer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, optimize

from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.model.elements import SpringDamperMass, of_known_poles
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.paths import ModelT
from cutvib_ss.model.protocol import Model
from cutvib_ss.model.second_order import MatrixStack
from cutvib_ss.response.axes import as_positions
from cutvib_ss.results import ComplexArray, FloatArray, Modes, TrackedModes

_RIGID = 1e-12
"""Squared natural frequencies below this part of the largest are a free body's."""
_START, _STEPS = 600j, 30
"""First s [rad/s], and most steps, in the search of a mode's pole where elements have no finite form."""
_SAME_MODE = 0.9
"""Where the modal assurance criterion falls below this, a step along the rail is halved."""
_ENTRIES = 10_000
"""Entries of the stacked matrices that are worked on at once, so that they stay in the cache."""
_FEW = 100
"""Below so many entries all poles are computed at once, which then takes less time than to follow each from its mode."""
_PASSES, _SETTLED = 20, 1e-7
"""Most passes that follow poles from their modes, and the change of a mode's parts that ends them: a pole errs by its square."""
_LEADING = 0.6
"""A pole whose motion is that of one undamped mode to at least this part continues that mode without doubt."""


@overload
def modes(machine: Model, position: float | None = None) -> Modes: ...
@overload
def modes(machine: Model, position: Sequence[float] | FloatArray) -> tuple[Modes, ...]: ...
def modes(machine: Model, position: float | Sequence[float] | FloatArray | None = None) -> Modes | tuple[Modes, ...]:
    """
    Natural modes and poles at a position, or at several at once.

    Parameters
    ----------
    machine : Machine or Structure
        The model; nonlinear elements and the measurement chain do not matter here.
    position : float or array_like, shape (position,), optional
        y_b / L of the head, strictly inside (0, 1); left out for a structure. Several positions in one call take a small part of
        the time of as many calls.

    Returns
    -------
    Modes or tuple of Modes
        Undamped modes from the symmetric problem, ascending [Hz], each with the pole [rad/s] that continues it as damping is added.
        Of several positions a tuple, one a position in the order given.

    Raises
    ------
    ParameterError
        If a machine has no position, one lies outside the rail, or a list of positions is empty.
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
    >>> [float(at.natural_freq[0].round(1)) for at in modes(published_machine(), [0.25, 0.5])]
    [27.3, 24.5]
    """
    places = _places(machine, position)
    if any(of_known_poles(e, 1j) is not e for e in machine.elements):
        found = [_each_at_its_own(machine, place) for place in places.tolist()]
    else:
        stack, loss = _matrices(machine, places)
        freq, shapes = _undamped(stack)
        poles = _poles(stack.damping, loss, freq, shapes)
        each = zip(freq, _ratio(poles), poles, shapes, places.tolist(), strict=True)
        found = [Modes(f, ratio, p, shape, stack.dofs, place) for f, ratio, p, shape, place in each]
    return tuple(found) if np.ndim(np.asarray(position)) else found[0]


def _places(machine: Model, positions: object) -> FloatArray:
    """Positions, at least one, checked against the model."""
    if np.asarray(positions).size == 0:
        raise ParameterError("the list of positions is empty: modes are of at least one position")
    return as_positions(machine, positions)


def _each_at_its_own(machine: Model, position: float) -> Modes:
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
        If the model has no position, one lies outside the rail, or there is none.

    Notes
    -----
    From one position to the next, modes are paired so that the sum of their assurance criteria is largest, with the
    mass matrix as weight. Where a pair agrees less than 0.9 the step is halved. A veering narrower than the finest step
    is passed as a crossing; ``mac`` tells where.
    """
    if not machine.has_position:
        raise ParameterError("modes are followed over positions; a second_order model has none")
    places = _places(machine, positions)
    stack, loss = _matrices(machine, places)
    freq, shapes = _undamped(stack)
    ends = [_Place(*at, np.arange(freq.shape[1])) for at in zip(places.tolist(), stack.mass, freq, shapes, strict=True)]
    steps, agreement = ends[:1], [np.ones(freq.shape[1])]
    for end in ends[1:]:
        here, worst = _step(machine, steps[-1], end, halvings)
        steps.append(here)
        agreement.append(worst)
    poles = np.take_along_axis(_poles(stack.damping, loss, freq, shapes), np.array([s.order for s in steps]), axis=1)
    freq, shapes = np.array([s.freq for s in steps]), np.array([s.shapes for s in steps])
    return TrackedModes(places, freq, _ratio(poles), poles, shapes, np.array(agreement), stack.dofs)


@dataclass(frozen=True)
class _Place:
    """Undamped modes at a position, the mass there, and the number of each mode in ascending order."""

    position: float
    mass: FloatArray
    freq: FloatArray
    shapes: FloatArray
    order: NDArray[np.intp]


def _step(machine: Machine, start: _Place, end: _Place, halvings: int) -> tuple[_Place, FloatArray]:
    # Half of each end's mass: neither end is privileged, and there and back is the same pairing.
    weight = (start.mass + end.mass) / 2
    agreement = mac(start.shapes, end.shapes, weight)
    order = optimize.linear_sum_assignment(agreement, maximize=True)[1]
    agreed = agreement[np.arange(order.size), order]
    if agreed.min() >= _SAME_MODE or halvings == 0:
        shapes = end.shapes[:, order]
        overlap = np.einsum("ik,ij,jk->k", start.shapes, weight, shapes)
        shapes = shapes * np.where(overlap < 0, -1.0, 1.0)
        return replace(end, freq=end.freq[order], shapes=shapes, order=order), agreed
    place = (start.position + end.position) / 2
    stack, _ = _matrices(machine, [place])
    freq, shapes = _undamped(stack)
    middle, first = _step(machine, start, _Place(place, stack.mass[0], freq[0], shapes[0], end.order), halvings - 1)
    last, second = _step(machine, middle, end, halvings - 1)
    return last, np.minimum(first, second)


def _matrices(machine: Model, positions: ArrayLike) -> tuple[MatrixStack, FloatArray | None]:
    """Mass, damping and stiffness without hysteresis, and the matrices H of the hysteretic elements where there are any."""
    if not any(isinstance(a.element, SpringDamperMass) and a.element.loss_stiffness for a in machine.attachments):
        return machine.matrices(positions), None
    stack = _with_springs(machine, 0.0).matrices(positions)
    return stack, _with_springs(machine, 1.0).matrices(positions).stiffness - stack.stiffness


def _with_springs(machine: ModelT, share: float) -> ModelT:
    """The model with a share of each hysteretic element's loss stiffness as an elastic one."""
    attachments = []
    for a in machine.attachments:  # type: ignore[attr-defined]
        e = a.element
        if isinstance(e, SpringDamperMass):
            e = replace(e, stiffness=e.stiffness + share * e.loss_stiffness, loss_stiffness=0.0)
        attachments.append(replace(a, element=e))
    return replace(machine, attachments=tuple(attachments))  # type: ignore[type-var]


def _undamped(stack: MatrixStack) -> tuple[FloatArray, FloatArray]:
    """Natural frequencies [Hz] and mass-normalised shapes, ascending: with M = LLᵀ those of L⁻¹KL⁻ᵀ."""
    try:
        inverse = np.linalg.inv(np.linalg.cholesky(stack.mass))
        across = inverse.swapaxes(1, 2)
        shapes = across @ np.linalg.eigh(inverse @ stack.stiffness @ across)[1]
    except np.linalg.LinAlgError as error:
        raise CouplingError("the mass matrix is not positive definite: the model has no natural modes") from error
    # Rayleigh's quotient: a stiff guide or many modes cost the low frequencies no digits.
    squares = _sum(shapes, stack.stiffness @ shapes)
    squares[np.abs(squares) < _RIGID * squares[:, -1:]] = 0.0
    size = np.abs(shapes)
    # Of parts that are as large as the largest the first is made positive, whatever rounding makes of them.
    largest = np.argmax(size > (1.0 - 1e-9) * size.max(axis=1, keepdims=True), axis=1)
    shapes = shapes * np.where(np.take_along_axis(shapes, largest[:, None], axis=1) < 0, -1.0, 1.0)
    # A negative square would be a structure that runs away; models with one are refused where they are read.
    return np.sqrt(np.maximum(squares, 0.0)) / (2 * np.pi), shapes


def _ratio(poles: ComplexArray) -> FloatArray:
    size = np.abs(poles)
    out: FloatArray = np.divide(-poles.real, size, out=np.zeros(size.shape), where=size > 0)
    return out


def _poles(damping: FloatArray, loss: FloatArray | None, freq: FloatArray, shapes: FloatArray) -> ComplexArray:
    """The pole that continues each undamped mode, shape (position, mode)."""
    omega, across = 2 * np.pi * freq, shapes.swapaxes(1, 2)
    damping = across @ damping @ shapes
    loss = None if loss is None else across @ loss @ shapes
    poles, sure = np.empty(omega.shape, dtype=np.complex128), np.zeros(len(omega), dtype=bool)
    for some in np.array_split(np.arange(len(omega)), min(len(omega), 1 + damping.size // _ENTRIES)):
        lost = None if loss is None else loss[some]
        if damping.size >= _FEW:
            poles[some], sure = _continued(omega[some], damping[some], lost)
        for k in some[~sure]:
            poles[k] = _paired(omega[k], damping[k], None if loss is None else loss[k])
    return poles


def _continued(
    omega: FloatArray, damping: FloatArray, loss: FloatArray | None
) -> tuple[ComplexArray, NDArray[np.bool_]]:
    """Poles of light damping in modal coordinates, found from the undamped modes, and at which positions beyond doubt."""
    # Each pass takes from a mode's other parts the residual of their rows over what they would resist alone, and moves its pole
    # by Newton's step in ψᵀ(p² + pC + K + jH)ψ = 0, whose error is the square of that of ψ, the matrices being symmetric.
    at = np.arange(omega.shape[1])
    own, squares = damping[:, at, at], omega[:, :, None] ** 2 + 0j
    if loss is not None:
        squares = squares + 1j * loss[:, at, at, None]
    poles = -own / 2 + 1j * np.sqrt(np.maximum(omega**2 - own**2 / 4, 0.0))
    vectors = np.zeros(damping.shape, dtype=np.complex128)
    vectors[:, at, at] = 1.0
    with np.errstate(all="ignore"):  # what divides by nothing is in doubt
        p = poles[:, None]
        flexibility = 1.0 / (p * (p + own[:, :, None]) + squares)
        flexibility[:, at, at] = 0.0
        for k in range(_PASSES):
            p = poles[:, None]
            resisted = _product(damping, vectors)
            left = vectors * (p * p + omega[:, :, None] ** 2) + p * resisted
            if loss is not None:
                left += 1j * _product(loss, vectors)
            slope = 2 * poles * _sum(vectors, vectors) + _sum(vectors, resisted)
            poles = poles - _sum(vectors, left) / slope
            left *= flexibility
            vectors -= left
            moved = np.abs(left.view(np.float64)).max(axis=(1, 2))
            # Where it does not halve from pass to pass it would not settle in time.
            if not ((moved > _SETTLED) & (moved < 10 * 0.5**k)).any():
                break
        leading = (1.0 / _sum(vectors, vectors.conj()).real).min(axis=1)
        sure = (moved <= _SETTLED) & (leading > _LEADING) & (poles.imag > 1e-6 * omega).all(axis=1)
    return poles, sure


def _sum(left: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Products of the columns of one stack with those of another, shape (position, column)."""
    return np.asarray(np.einsum("pij,pij->pj", left, right))


def _product(real: FloatArray, vectors: ComplexArray) -> ComplexArray:
    """Real matrices times complex ones, as a product of real ones."""
    return np.asarray((real @ vectors.view(np.float64)).view(np.complex128))


def _paired(omega: FloatArray, damping: FloatArray, loss: FloatArray | None) -> ComplexArray:
    """All poles at a position in modal coordinates, and of these the one in which each undamped mode takes part."""
    n = omega.size
    scale = float(omega.max()) or 1.0
    stiffness = np.diag(omega**2) if loss is None else np.diag(omega**2) + 1j * loss
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
