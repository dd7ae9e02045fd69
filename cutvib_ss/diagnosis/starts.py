"""Where a fit may start besides the nominal model: many side minima are looked through instead of climbed from one place."""

from __future__ import annotations

import numpy as np

from cutvib_ss.diagnosis.prediction import light_poles, slow_frequencies
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.errors import CutvibError
from cutvib_ss.parameters import MATRICES
from cutvib_ss.results import FloatArray


def at_instants(problem: Problem, x: FloatArray, tries: int) -> list[FloatArray]:
    """Unknowns, then with the blow up to a period of the slowest mode earlier or later, where its instant is not stated."""
    if not problem.n_blow or not (slow := slow_frequencies(problem.predictions(x))):
        return [x]
    # What a block cuts off of a mode that has not died out is periodic in the instant of the blow.
    steps = np.array([side * k for k in range(1, tries + 1) for side in (-1, 1)]) / (tries * min(slow))
    return [x, *(problem.struck_at(x, problem.blow_at(x) + late) for late in steps)]


def at_stiffnesses(problem: Problem, x: FloatArray) -> FloatArray:
    """
    Unknowns with the stiffness of all of a structure where its model comes closest to the records, within three tolerances.

    A resonance is seen as wide as its damping or its block makes it. Where tolerances move it by more than that, records and model
    beat against each other, and every beat is a side minimum.
    """
    index = {path: k for k, (path, _) in enumerate(problem.tuning)}.get(("scales", MATRICES.index("stiffness")))
    if index is None or not (width := _narrowest(problem)):
        return x
    # A frequency moves by half of what the stiffness does.
    far = SETTINGS.fit_looked_through
    step = 2.0 * SETTINGS.fit_looked_step * width / problem.tuning[index][1]
    each = far * np.linspace(-1.0, 1.0, 2 * min(int(np.ceil(far / step)), SETTINGS.fit_looked_most) + 1)
    tried = [np.where(np.arange(x.size) == index, x[index] + move, x) for move in each]
    return min(tried, key=lambda moved: _distance(problem, moved))


def _distance(problem: Problem, x: FloatArray) -> float:
    """Squares of the residuals and the priors."""
    try:
        return problem.residuals(x)[2] + float(problem.prior_precision() @ x**2)
    except (CutvibError, np.linalg.LinAlgError):
        return np.inf


def _narrowest(problem: Problem) -> float:
    """Relative width of the narrowest resonance in the band, as the records show it; 0 where there is none."""
    (poles,) = light_poles(problem.nominal, np.array([np.nan]))
    within = poles[np.abs(poles) < 2 * np.pi * problem.band[1]]
    blocks = [float(block) for g in problem.groups for block in g.block if np.isfinite(block)]
    by_block = 2 * np.pi / (np.abs(within) * max(blocks, default=np.inf))
    return float(np.min(np.maximum(-within.real / np.abs(within), by_block), initial=np.inf)) if within.size else 0.0
