"""
Which: every cause fitted together with the tuning, and the evidence for each.

Starts are first fitted on few lines with a noise widened by some percent of the response: sharp peaks then pull from afar, and
no start is lost in a side minimum of a precise measurement. The best are fitted again on all lines as measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cutvib_ss.effects.base import Model
from cutvib_ss.gap.fit import Fit, fit
from cutvib_ss.gap.hypotheses import Candidate
from cutvib_ss.gap.observations import Group
from cutvib_ss.gap.problem import Hypothesis

COARSE_LINES = 120
"""Lines of a group on which starts are fitted."""
COARSE_ERROR = 0.03
"""Relative error by which the noise is widened there."""
REFINED = 3
"""Causes that are fitted again on all lines, at least."""
CLOSE = 60.0
"""… and all whose objective on few lines lies within this of the best."""


FIRST_STEPS, LATER_STEPS = 3, 10
"""Steps from each start, and from the best of them."""
ROUGH = 1e-2
"""Relative gain at which steps on few lines end."""


@dataclass(frozen=True)
class Ranked:
    """
    A cause, fitted.

    Parameters
    ----------
    name : str
        Candidate's name; ``"none"`` without a cause.
    fit : Fit
        Its best fit.
    refined : bool
        Whether it was fitted on all lines; if not, its evidence is a bound.
    """

    name: str
    fit: Fit
    refined: bool


def coarse(groups: Sequence[Group]) -> tuple[Group, ...]:
    """
    Groups with few lines and a widened noise.

    Parameters
    ----------
    groups : sequence of Group
        Measured responses.

    Returns
    -------
    tuple of Group
        The same records, coarser.
    """
    out = []
    for g in groups:
        step = max(1, g.freq.size // COARSE_LINES)
        data = g.data[..., ::step]
        variance = g.variance[..., ::step] + (COARSE_ERROR * np.abs(data)) ** 2
        out.append(replace(g, freq=g.freq[::step], data=data, variance=variance))
    return tuple(out)


def search(nominal: Model, groups: Sequence[Group], found: Sequence[Candidate]) -> tuple[Ranked, ...]:
    """
    Fit every candidate.

    Parameters
    ----------
    nominal : Machine or Structure
        The nominal model.
    groups : sequence of Group
        Measured responses.
    found : sequence of Candidate
        The causes.

    Returns
    -------
    tuple of Ranked
        The tuned nominal model first, then the causes by evidence.
    """
    few = coarse(groups)
    none = fit(nominal, groups, Hypothesis(), fit(nominal, few, Hypothesis(), None, LATER_STEPS, ROUGH).x)
    rough = [(candidate, _roughly(nominal, few, candidate)) for candidate in found]
    rough.sort(key=lambda pair: pair[1].objective)
    ahead = rough[0][1].objective if rough else 0.0
    ranked: list[Ranked] = []
    for i, (candidate, start) in enumerate(rough):
        behind = start.objective - ahead
        if i < REFINED or behind < CLOSE:
            ranked.append(Ranked(candidate.name, fit(nominal, groups, start.hypothesis, start.x), True))
        else:
            # Few lines and a widened noise understate how far behind it is.
            best = max(r.fit.log_evidence for r in ranked)
            ranked.append(Ranked(candidate.name, replace(start, log_evidence=best - behind / 2), False))
    ranked.sort(key=lambda r: -r.fit.log_evidence)
    return (Ranked("none", none, True), *ranked)


def _roughly(nominal: Model, few: Sequence[Group], candidate: Candidate) -> Fit:
    """The best of a candidate's starts, on few lines."""
    # All start from the untuned model: the tuning of a model that lacks the cause leads away.
    tries = [fit(nominal, few, Hypothesis((e,)), None, FIRST_STEPS, ROUGH) for e in candidate.starts]
    best = min(tries, key=lambda f: f.objective)
    return fit(nominal, few, best.hypothesis, best.x, LATER_STEPS, ROUGH)
