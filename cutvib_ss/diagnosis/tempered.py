"""
The evidence of a fit where its likelihood counts as a power: residuals that tell the same thing count once, priors as they are.

∫ p(D|θ)^(1/T) p(θ) dθ by Laplace about the fit. A tuned value far out of its tolerance costs what its prior says, however many
residuals tell the same of it, and a parameter's Occam factor is that of the data that there are (Bissiri, Holmes and Walker 2016,
Journal of the Royal Statistical Society B 78, 1103-1130).
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.likelihood import EVEN, log_determinant, solved
from cutvib_ss.diagnosis.settings import SETTINGS


def tempered_evidence(fit: Fit, heat: float) -> float:
    """Log evidence of the likelihood to the power of 1/`heat`, drift and discrepancy being the fit's."""
    if heat == 1.0:
        return fit.log_evidence
    x, even = fit.x, fit.precision == EVEN
    prior = np.where(even, 0.0, fit.precision)
    size = np.sqrt(np.diag(fit.covariance))
    whole = linalg.inv(fit.covariance / np.outer(size, size)) / np.outer(size, size)
    of_data = whole - np.diag(fit.precision)
    # At the fit the data pull as much as the priors; with fewer data the unknowns go back to where these leave them. What a bound
    # holds stays there.
    free = np.abs(x) < SETTINGS.fit_within
    inner = (of_data / heat + np.diag(prior + SETTINGS.likelihood_precision_floor))[np.ix_(free, free)]
    step = np.zeros(x.size)
    step[free] = solved(inner, (1.0 / heat - 1.0) * (prior * x)[free])
    gained = (prior * x) @ step - 0.5 * step @ of_data @ step
    priors = fit.log_prior + 0.5 * float(np.sum(np.log(prior[~even])))
    likelihood = fit.log_evidence - priors + 0.5 * (float(prior @ x**2) + log_determinant(whole))
    fewer = log_determinant(of_data / heat + np.diag(fit.precision))
    return float((likelihood + gained) / heat + priors - 0.5 * (float(prior @ (x + step) ** 2) + fewer))
