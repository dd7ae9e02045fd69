"""Complex modes of a second-order system, and what forces that go evenly do to them in a step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg

from cutvib_ss.errors import CouplingError
from cutvib_ss.model.second_order import SecondOrder
from cutvib_ss.results import ComplexArray, FloatArray

_RIGID = 1e-7
"""Undamped poles closer to zero than this part of the fastest are rounding error, and set apart: a free body has a double pole."""
_APART = 3e-7
"""By which part of the fastest: less leaves more rounding error of a double pole, more a spring that is felt."""


@dataclass(frozen=True)
class ModalBasis:
    """Complex modes of a second-order system."""

    poles: ComplexArray  # Poles of positive imaginary part, and real ones [rad/s], the slowest first
    # Displacement of the degrees of freedom by the modes' amplitudes; of a conjugate pair twice its half, so that the
    # real part of the sum over these modes is the motion
    shapes: ComplexArray
    drives: ComplexArray  # How forces on the degrees of freedom drive the modes
    from_state: ComplexArray  # Amplitudes of an initial displacement and velocity


def modal_basis(system: SecondOrder, classical_above: float = np.inf) -> ModalBasis:
    """
    Complex modes of a second-order system.

    With p the undamped modes' amplitudes the states are (p, ṗ/w); right and left vectors of that small matrix give the sum.
    A mode that damping does not couple is such a matrix by itself, of two rows.
    """
    try:
        squares, basis = linalg.eigh(system.stiffness, system.mass)
    except linalg.LinAlgError as error:
        raise CouplingError("the mass matrix is not positive definite: there are no modes to step") from error
    w = float(np.sqrt(np.abs(squares).max())) or 1.0
    squares = np.where(np.abs(squares) < (_RIGID * w) ** 2, (_APART * w) ** 2, squares)
    damping = basis.T @ system.damping @ basis
    n = int(np.searchsorted(squares, (2 * np.pi * classical_above) ** 2))
    poles, right, from_place, from_rate = _halves(squares[:n], damping[:n, :n], w)
    alone = _pairs(squares[n:], np.diag(damping)[n:], w)
    weighted = basis.T @ system.mass
    values = np.concatenate([poles, alone.poles])
    # A real pole's shape is real up to a factor of its own, which inverse and vector share; a pair counts twice.
    twice = np.where(values.imag > 0.0, 2.0, 1.0)
    own = n + alone.mode
    shapes: ComplexArray = np.hstack([basis[:, :n] @ right, basis[:, own] * alone.right]) * twice
    drives = (
        np.asarray(np.vstack([from_rate @ basis.T[:n], alone.from_rate[:, None] * basis.T[own]]), np.complex128) / w
    )
    placed = np.vstack([from_place @ weighted[:n], alone.from_place[:, None] * weighted[own]])
    moving = np.vstack([from_rate @ weighted[:n], alone.from_rate[:, None] * weighted[own]]) / w
    order = np.argsort(np.abs(values), kind="stable")
    return ModalBasis(values[order], shapes[:, order], drives[order], np.hstack([placed, moving])[order])


def _halves(
    squares: FloatArray, damping: FloatArray, w: float
) -> tuple[ComplexArray, ComplexArray, ComplexArray, ComplexArray]:
    """Modes that damping couples: one pole of each pair and the real ones, right vectors, left ones over amplitudes and rates."""
    n = squares.size
    a = np.block([[np.zeros((n, n)), w * np.eye(n)], [-np.diag(squares) / w, -damping]])
    values, vectors = linalg.eig(a)
    inverse: ComplexArray = linalg.inv(vectors)
    values.imag[np.abs(values.imag) < 1e-13 * w] = 0.0
    kept = np.flatnonzero(values.imag >= 0.0)
    return values[kept], vectors[:n, kept], inverse[kept, :n], inverse[kept, n:]


class _Pairs(NamedTuple):
    """Modes by themselves: of each pole that is kept, its mode and the entries of its vectors."""

    poles: ComplexArray
    mode: np.ndarray
    right: ComplexArray
    from_place: ComplexArray
    from_rate: ComplexArray


def _pairs(squares: FloatArray, damping: FloatArray, w: float) -> _Pairs:
    a = np.zeros((squares.size, 2, 2))
    a[:, 0, 1], a[:, 1, 0], a[:, 1, 1] = w, -squares / w, -damping
    values, vectors = np.linalg.eig(a.astype(np.complex128))
    inverse = np.linalg.inv(vectors)
    values.imag[np.abs(values.imag) < 1e-13 * w] = 0.0
    mode, which = np.nonzero(values.imag >= 0.0)
    return _Pairs(values[mode, which], mode, vectors[mode, 0, which], inverse[mode, which, 0], inverse[mode, which, 1])


def linear_course(poles: ComplexArray, drives: ComplexArray, h: float) -> tuple[ComplexArray, ComplexArray]:
    """
    What a step under forces that go evenly from one value to another does to the modes.

    With x = p h, φ₁ = (e^x - 1)/x and φ₂ = (e^x - 1 - x)/x²: h (φ₁ - φ₂) and h φ₂.
    """
    x = poles * h
    near = np.abs(x) < 1e-3
    safe = np.where(near, 1.0, x)
    first = np.where(near, 1 + x / 2 + x**2 / 6 + x**3 / 24, np.expm1(safe) / safe)
    second = np.where(near, 0.5 + x / 6 + x**2 / 24 + x**3 / 120, (np.expm1(safe) - safe) / safe**2)
    return np.exp(x), h * np.stack([(first - second) * drives, second * drives])


def parts(values: ComplexArray) -> FloatArray:
    """Real and imaginary part, one after the other, shape (2, ...)."""
    return np.ascontiguousarray([values.real, values.imag])


def reading(shapes: ComplexArray) -> FloatArray:
    """Factors that make the real part of a sum over modes from their real and imaginary parts, shape (2, ...)."""
    return np.ascontiguousarray([shapes.real, -shapes.imag])
