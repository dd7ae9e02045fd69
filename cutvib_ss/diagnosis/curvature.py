"""
Derivatives of what a discrepancy takes up: by them an iteration ends where the posterior is largest.

A prediction with its discrepancy is f(x) + Σ ψ_k(ω) ∂f/∂x_k, with ψ_k the relative error of element k's dynamic stiffness and x_k
its logarithm. Its derivative to an unknown x_j is

    ∂f/∂x_j + Σ ψ_k(ω) ∂²f/∂x_j∂x_k,

and near a resonance the sum is ψ over the loss factor of the first part. Gauss-Newton steps without it end elsewhere than at the
optimum, by many times the noise where the discrepancy takes up many times the noise, and the evidence about such a point promises
gains that there are not. Weights of a cause's parameters in its size are taken for constant. Second derivatives are differences
of the Jacobian along the few unknowns with a discrepancy. (Golub and Pereyra 1973, SIAM Journal on Numerical Analysis 10,
413-432: separable least squares need the derivative of the linear part.)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cutvib_ss.diagnosis.directions import Curvature, Directions
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray


class _Way(NamedTuple):
    """How a relative error of one element moves the unknowns, and the errors of each group over rows, channels and lines."""

    unknowns: FloatArray
    errors: list[ComplexArray]


def curvature_of(directions: Directions, each: list[FloatArray], coefficients: FloatArray) -> Curvature | None:
    """
    What a discrepancy of given coefficients, at unit sizes, adds to derivatives; None where it is too small to.

    `each` holds the unknowns of every group.
    """
    found = [*_of_tuned(directions, coefficients, each[0].size), *_of_cause(directions, coefficients, each[0].size)]
    ways = [w for w in found if max(float(np.abs(e).max()) for e in w.errors) > SETTINGS.fit_curvature]
    if not ways:
        return None
    problem, step = directions.problem, SETTINGS.fit_difference
    shared = [np.zeros_like(rows) for rows in directions.shared]
    plain = [np.zeros_like(rows) for rows in directions.plain]
    for way, errors in ways:
        # Groups that share their unknowns share the model.
        moved = {id(x): x + step * way for x in each}
        ahead = [moved[id(x)] for x in each]
        for i, (x, p) in enumerate(zip(ahead, problem.aside(ahead), strict=True)):
            first = directions.shared[i]
            shared[i] += errors[i] * (problem.jacobian(x, p) - first) / step
            plain[i] += errors[i] * np.tensordot(way[problem.shared], first, 1)
    return Curvature(shared, plain)


def _of_tuned(directions: Directions, coefficients: FloatArray, size: int) -> Iterator[_Way]:
    """Of each tuned value with a discrepancy that over frequency. Drift is followed by itself."""
    lay = directions.layout
    nominal = coefficients[lay.first_nominal : lay.first_cause].reshape(len(lay.nominal), 2, lay.shapes)
    for k, (real, imaginary) in zip(lay.nominal, nominal, strict=True):
        way = np.zeros(size)
        way[k] = directions.nominal[k]
        yield _Way(way, [(real + 1j * imaginary) @ smooth for smooth in directions.smooth])


def _of_cause(directions: Directions, coefficients: FloatArray, size: int) -> Iterator[_Way]:
    """Of a cause with a size the discrepancy over frequency and what else its form depends on."""
    lay, way = directions.layout, np.zeros(size)
    if lay.pivots:
        way[directions.problem.first_effect :] = directions.cause
        real, imaginary = coefficients[lay.first_cause : lay.first_form].reshape(2, -1)
        shapes = [directions.of_cause(i, np.arange(len(g.data))) for i, g in enumerate(directions.groups)]
        yield _Way(way, [np.einsum("p,rpf->rf", real + 1j * imaginary, own)[:, None] for own in shapes])
