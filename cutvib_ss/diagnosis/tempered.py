"""
The evidence of a fit where residuals that tell the same thing count once, and the priors of tuning and calibration as they are.

Those are beliefs about parts and instruments, which no number of residuals changes: a value far out of its tolerance costs what its
prior says. What a hypothesis brings of its own, its parameters' Occam factors too, counts as the power 1/T of the likelihood does:
at T = 20 an element of unknown form, of thirty parameters, would else be impossible beside any known one.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.settings import SETTINGS


def tempered_evidence(fit: Fit, heat: float) -> float:
    """Log evidence to the power of 1/`heat` but for the priors of the unknowns that all hypotheses share, to second order."""
    if heat == 1.0:
        return fit.log_evidence
    x, shared = fit.x, np.zeros(fit.x.size)
    shared[: fit.first_effect] = fit.shared_precision
    size = np.sqrt(np.diag(fit.covariance))
    whole = linalg.inv(fit.covariance / np.outer(size, size)) / np.outer(size, size)
    own = whole - np.diag(shared)
    # At the fit the data pull as much as the priors; weaker data leave shared unknowns nearer to their middle. What a bound holds
    # stays there.
    free = np.abs(x) < SETTINGS.fit_within
    inner = (own / heat + np.diag(shared + SETTINGS.likelihood_precision_floor))[np.ix_(free, free)]
    step = np.zeros(x.size)
    # Where two unknowns are nearly one, the inverse of their covariance is a precision only up to rounding: no Cholesky factor.
    size, pulled = np.sqrt(np.abs(np.diag(inner))), (1.0 / heat - 1.0) * (shared * x)[free]
    step[free] = linalg.solve(inner / np.outer(size, size), pulled / size, assume_a="sym") / size
    gained = (shared * x) @ step - 0.5 * step @ own @ step
    return float((fit.log_evidence + 0.5 * shared @ x**2 + gained) / heat - 0.5 * shared @ (x + step) ** 2)
