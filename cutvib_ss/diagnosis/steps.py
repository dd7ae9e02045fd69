"""Steps within bounds on a quadratic, and where the last ones lead."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import FloatArray


class Trail:
    """
    The last steps of an iteration, and where they lead: Anderson's extrapolation (Walker and Ni 2011, SIAM J. Numer. Anal. 49).

    A plain step takes the directions of drift and discrepancy for constant. They change with the unknowns, so the steps shrink by a
    constant factor near the optimum, tens of them where the noise is small.
    """

    def __init__(self) -> None:
        self.points: list[FloatArray] = []
        self.steps: list[FloatArray] = []

    def add(self, point: FloatArray, step: FloatArray) -> None:
        """One more step; the oldest is forgotten."""
        self.points = [*self.points, point][-SETTINGS.fit_trail :]
        self.steps = [*self.steps, step][-SETTINGS.fit_trail :]

    def forget(self) -> None:
        """Start anew."""
        self.points, self.steps = [], []

    def ahead(self, point: FloatArray, step: FloatArray, weight: FloatArray) -> FloatArray | None:
        """Where a step from a point leads once the steps' own change is followed to zero; None without steps before."""
        if not self.points:
            return None
        changes = np.array([step - s for s in self.steps]).T
        moves = np.array([point - p for p in self.points]).T
        parts = linalg.lstsq(weight[:, None] * changes, weight * step, cond=1e-8, check_finite=False)[0]
        return np.asarray(point + step - (moves + changes) @ parts)


def bounded_step(
    matrix: FloatArray, gradient: FloatArray, damping: FloatArray, x: FloatArray, low: FloatArray, high: FloatArray
) -> FloatArray:
    """A step that leaves alone the unknowns that a bound holds, and is cut off or turns where it comes to others."""
    # Damping is in parts of the curvatures.
    held = ((x <= low) & (gradient < 0)) | ((x >= high) & (gradient > 0))
    step, free = np.zeros(x.size), ~held
    step[free] = way = _solved(matrix, gradient, damping, step, free)
    cut = np.clip(x + step, low, high) - x
    if 2.0 * gradient @ cut - cut @ matrix @ cut > 0.0:
        return np.asarray(cut)
    # Along a narrow valley what is cut off leads uphill. It turns at the first bound instead: what comes to it ends there.
    step[:] = 0.0
    while free.any():
        room = np.where(way > 0.0, high[free] - x[free], low[free] - x[free]) - step[free]
        part = np.divide(room, way, out=np.full(way.size, np.inf), where=way != 0.0)
        first = max(float(part.min()), 0.0)
        step[free] += min(first, 1.0) * way
        if first >= 1.0:
            break
        free[np.flatnonzero(free)[part <= first]] = False
        way = _solved(matrix, gradient, damping, step, free)
    return np.asarray(np.clip(x + step, low, high) - x)


def _solved(
    matrix: FloatArray, gradient: FloatArray, damping: FloatArray, step: FloatArray, free: np.ndarray
) -> FloatArray:
    """What is left to go for the free unknowns, the others being where a step has taken them."""
    inner = matrix[np.ix_(free, free)]
    # Unknowns of unlike size: equilibrated, the system is as well conditioned as its physics.
    size = np.sqrt(np.diag(inner) + 1e-12)
    scaled = inner / np.outer(size, size) + np.diag(damping[free])
    pulled = gradient[free] - matrix[np.ix_(free, ~free)] @ step[~free]
    return np.asarray(linalg.solve(scaled, pulled / size, assume_a="sym") / size - step[free])
