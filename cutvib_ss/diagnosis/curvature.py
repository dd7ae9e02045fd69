"""
Derivatives of what a discrepancy takes up: by them an iteration ends where the posterior is largest.

A prediction with its discrepancy is f(x) + Σ ψ_k(ω) ∂f/∂x_k, with ψ_k the relative error of element k's dynamic stiffness in the
element's unit. Its derivative to an unknown x_j is

    ∂f/∂x_j + Σ ψ_k(ω) ∂²f/∂x_j∂x_k,

and near a resonance the sum is ψ over the loss factor of the first part. Gauss-Newton steps without it end elsewhere than at the
optimum, by many times the noise where the discrepancy takes up many times the noise, and the evidence about such a point promises
gains that there are not. Second derivatives are differences of the Jacobian along the few unknowns with a discrepancy. (Golub and
Pereyra 1973, SIAM Journal on Numerical Analysis 10, 413-432: separable least squares need the derivative of the linear part.)
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from cutvib_ss.diagnosis.directions import Bent, Directions
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import ComplexArray, FloatArray


def bent(directions: Directions, each: list[FloatArray], coefficients: FloatArray) -> Bent | None:
    """
    What the discrepancy of given coefficients, at unit sizes, adds to derivatives; None where it is too small to.

    `each` holds the unknowns of every group.
    """
    moved = list(_moved(directions, each[0].size, coefficients))
    if max(float(np.abs(e).max()) for _, error in moved for e in error) < SETTINGS.fit_bends:
        return None
    shared = [np.zeros_like(rows) for rows in directions.shared]
    plain = [np.zeros_like(rows) for rows in directions.plain]
    for way, error in moved:
        ahead = [x + SETTINGS.fit_difference * way for x in each]
        for i, (x, p) in enumerate(zip(ahead, directions.problem.aside(ahead), strict=True)):
            first = directions.shared[i]
            shared[i] += error[i] * (directions.problem.jacobian(x, p) - first) / SETTINGS.fit_difference
            plain[i] += error[i] * np.tensordot(way[directions.problem.shared], first, 1)
    return Bent(shared, plain)


def _moved(
    directions: Directions, size: int, coefficients: FloatArray
) -> Iterator[tuple[FloatArray, list[ComplexArray]]]:
    """Ways of the unknowns that have a discrepancy, and the discrepancy of each over frequency, by group."""
    lay, problem = directions.layout, directions.problem
    nominal = coefficients[lay.first_nominal : lay.first_cause].reshape(len(lay.nominal), 2, lay.shapes)
    for k, (real, imaginary) in zip(lay.nominal, nominal, strict=True):
        way = np.zeros(size)
        way[k] = directions.nominal[k]
        yield way, [(real + 1j * imaginary) @ smooth for smooth in directions.smooth]
    if lay.pivots:
        way = np.zeros(size)
        way[problem.first_effect :] = directions.cause
        real, imaginary = coefficients[lay.first_cause : lay.first_form].reshape(2, -1)
        shapes = [directions.of_cause(i, np.arange(len(g.data))) for i, g in enumerate(directions.groups)]
        yield way, [np.einsum("p,rpf->rf", real + 1j * imaginary, own)[:, None] for own in shapes]
