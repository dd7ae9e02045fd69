"""Linear algebra on stacks of small matrices, frequency last."""

from __future__ import annotations

import numpy as np

from cutvib_ss.results import ComplexArray, FloatArray

CLOSED_FORM = 3
"""Order up to which a matrix is inverted in closed form."""


def mixed(weights: FloatArray, stack: ComplexArray) -> ComplexArray:
    """
    Real combinations of the entries of a complex stack, as one product of real matrices.

    numpy would promote the weights to complex and take twice as long.
    """
    parts = np.ascontiguousarray(stack).reshape(stack.shape[0], -1).view(np.float64)
    product: ComplexArray = (weights.reshape(-1, weights.shape[-1]) @ parts).view(np.complex128)
    return product.reshape(weights.shape[:-1] + stack.shape[1:])


def inverse(matrices: ComplexArray) -> ComplexArray:
    """Inverses of a stack of matrices; up to `CLOSED_FORM` in closed form, shape (n, n, frequency)."""
    n = matrices.shape[0]
    if n == 1:
        one: ComplexArray = 1.0 / matrices
        return one
    if n == 2:
        (a, b), (c, d) = matrices
        two: ComplexArray = np.array([[d, -b], [-c, a]]) * (1.0 / (a * d - b * c))
        return two
    if n == 3:
        # By bordering the first two: with P⁻¹, s = t - rᵀ P⁻¹ q.
        inner = inverse(matrices[:2, :2])
        column, row = dot(np.moveaxis(inner, 1, 0), matrices[:2, 2, None]), dot(matrices[2, :2, None], inner)
        below = 1.0 / (matrices[2, 2] - dot(matrices[2, :2], column))
        out = np.empty_like(matrices)
        out[:2, :2] = inner + column[:, None] * row * below
        out[:2, 2], out[2, :2], out[2, 2] = -column * below, -row * below, below
        return out
    return np.ascontiguousarray(np.moveaxis(np.linalg.inv(np.moveaxis(matrices, -1, 0)), 0, -1))


def dot(left: FloatArray | ComplexArray, right: FloatArray | ComplexArray) -> ComplexArray:
    """Sum of products over the first axis, the others broadcast."""
    total: ComplexArray = left[0] * right[0]
    for i in range(1, len(left)):
        total = total + left[i] * right[i]
    return total
