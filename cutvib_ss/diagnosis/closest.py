"""Where a hypothesis' model by itself, without the discrepancy inferred beside it, is closest to the records."""

from __future__ import annotations

import numpy as np

from cutvib_ss.diagnosis.climb import Climb
from cutvib_ss.diagnosis.likelihood import Quadratic, solved
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.results import FloatArray


def closest_by_quadratic(search: Climb, quadratic: Quadratic, offsets: FloatArray) -> FloatArray:
    """Unknowns of the model that is closest to the records without a discrepancy: to first order, within priors and bounds."""
    # The posterior shares what is measured between the unknowns and the discrepancy. Here that which it infers is residual
    # again, and the mean square of the whole residual stands for the noise, drift and hits held where they are: the calibration in
    # mean square of Tuo and Wu (2015), Annals of Statistics 43, 2331-2352.
    lay, x = quadratic.layout, search.at.x
    own, inferred = slice(0, lay.unknowns), slice(lay.first_nominal, lay.first_hit)
    scale = lay.scale(search.sizes)
    drift = offsets - quadratic.offsets / scale
    drift[inferred] = 0.0
    of_data = quadratic.matrix * (scale * scale[:, None] / search.sizes.noise)
    gradient = quadratic.gradient * (scale / search.sizes.noise)
    squares = quadratic.squares / search.sizes.noise - 2.0 * float(gradient @ drift) + float(drift @ of_data @ drift)
    heat = max(squares / search.count, 1.0)
    prior = np.diag(quadratic.precision + SETTINGS.likelihood_precision_floor)
    step, free = np.zeros(x.size), quadratic.free
    pulled = of_data[own, inferred] @ offsets[inferred]
    step[free] = solved((of_data[own, own] / heat + prior)[np.ix_(free, free)], pulled[free] / heat)
    return search.towards(x + scale[own] * step) if np.any(step) else x


def closest_simulated(search: Climb, start: FloatArray, steps: int, tolerance: float) -> FloatArray:
    """The same of a restoring force, which may lie far from the posterior's maximum: climbed to, without drift."""
    alone = Climb(search.drifted.problems, search.at.x, False, search.beside)
    least = alone.at.squares
    alone.try_from(start)
    alone.climb(steps, tolerance)
    return alone.at.x if alone.at.squares < least else search.at.x
