"""Normal equations of some unknowns with the others integrated out."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from cutvib_ss.diagnosis.likelihood import log_determinant
from cutvib_ss.results import FloatArray


class Marginal:
    """
    The Schur complement of normal equations in some of their unknowns: the quadratic in which the others follow.

    By what the others take already of the squares no step can gain.
    """

    def __init__(self, matrix: FloatArray, gradient: FloatArray, kept: NDArray[np.intp]) -> None:
        others = np.ones(gradient.size, dtype=bool)
        others[kept] = False
        self._own, self._across, self._pull = matrix[np.ix_(kept, kept)], matrix[np.ix_(others, kept)], gradient[kept]
        self._factor = linalg.cholesky(matrix[np.ix_(others, others)], lower=True, check_finite=False)
        self._taken = self._eliminated(gradient[others])

    @property
    def taken(self) -> float:
        """By what the squares fall as the others follow."""
        return float(self._taken @ self._taken)

    @property
    def log_determinant(self) -> float:
        """Logarithm of the determinant of the others' matrix."""
        return 2.0 * float(np.sum(np.log(np.diag(self._factor))))

    @property
    def diagonal(self) -> FloatArray:
        """Curvatures of the kept unknowns, the others following."""
        return np.asarray(np.diag(self._own) - np.sum(self._coupled**2, axis=0))

    def of_own(self, which: NDArray[np.intp]) -> float:
        """Logarithm of the determinant of some of the kept unknowns, by their number among them."""
        if not which.size:
            return 0.0
        across = self._coupled[:, which]
        return log_determinant(self._own[np.ix_(which, which)] - across.T @ across)

    @cached_property
    def _coupled(self) -> FloatArray:
        return self._eliminated(self._across)

    def gain(self, step: FloatArray) -> float:
        """By what the squares fall along a step, the others following."""
        across = self._coupled @ step
        fall = 2.0 * (self._pull @ step - self._taken @ across) - step @ self._own @ step + across @ across
        return float(fall)

    def _eliminated(self, right: FloatArray) -> FloatArray:
        return np.asarray(linalg.solve_triangular(self._factor, right, lower=True, check_finite=False))
