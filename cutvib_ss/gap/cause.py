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
from cutvib_ss.gap.fit import Fit, Hypothesis, fit
from cutvib_ss.gap.hypotheses import Candidate
from cutvib_ss.gap.observations import Group

COARSE_LINES = 160
"""Lines of a group on which starts are fitted."""
COARSE_ERROR = 0.03
"""Relative error by which the noise is widened there."""
REFINED = 5
"""Causes that are fitted again on all lines, at least."""
CLOSE = 60.0
"""… and all whose objective on few lines lies within this of the best."""


FIRST_STEPS, LATER_STEPS = 4, 12
"""Steps from each start, and from the best of them."""


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
        Whether it was fitted on all lines.
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
    none_few = fit(nominal, few, Hypothesis())
    best: list[tuple[Candidate, Fit]] = []
    for candidate in found:
        # A few steps tell the starts apart; the best goes on. All start from the untuned model: the tuning of a model that
        # lacks the cause leads away.
        tries = [fit(nominal, few, Hypothesis((e,)), None, FIRST_STEPS) for e in candidate.starts]
        first = min(tries, key=lambda f: f.objective)
        best.append((candidate, fit(nominal, few, first.hypothesis, first.x, LATER_STEPS)))
    best.sort(key=lambda pair: pair[1].objective)
    none = fit(nominal, groups, Hypothesis(), none_few.x)
    ranked = []
    for i, (candidate, rough) in enumerate(best):
        close = rough.objective < best[0][1].objective + CLOSE
        if i < REFINED or close:
            full = fit(nominal, groups, rough.hypothesis, rough.x)
            ranked.append(Ranked(candidate.name, full, True))
        else:
            # Far behind: what it reaches on all lines without another step bounds its evidence well enough.
            full = fit(nominal, groups, rough.hypothesis, rough.x, 2)
            ranked.append(Ranked(candidate.name, full, False))
    ranked.sort(key=lambda r: -r.fit.log_evidence)
    return (Ranked("none", none, True), *ranked)

