"""
Blows whose force goes on acting after them, as an AC-coupled one swings back for seconds.

The closed form of a blow's tail holds the force to its pulse; a simulation lets all of it act that was recorded, its sensor's noise
too. Where the two differ, whichever the records bear out predicts them for every cause: restoring forces are simulated in any case,
and what sets a predictor apart from another is no evidence of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.records import Entry, Records, merged
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.simulated import simulated
from cutvib_ss.effects.base import Model
from cutvib_ss.results import ComplexArray, FloatArray


def with_lasting(nominal: Model, entries: Sequence[Entry]) -> tuple[Entry, ...]:
    """The records, those of blows marked as lasting where a simulation of the tuned model is what they show."""
    marked = [_lasting(e) for e in entries]
    if _differ(nominal, [e for e in marked if e.replay is not None and e.replay.lasting]) <= SETTINGS.record_lasting:
        return tuple(entries)
    # Record by record: what merging takes from the closed form, where instants of blows differ, is no force that lasts.
    options = [tuple(entries), tuple(marked)]
    return max(options, key=lambda each: fit(nominal, Records(each, moving=True), Hypothesis()).log_evidence)


def _lasting(e: Entry) -> Entry:
    """A record of blows marked as lasting."""
    blows = e.replay is not None and not e.replay.block and not e.replay.assumed
    return replace(e, replay=replace(e.replay, lasting=True)) if blows and e.replay is not None else e


def _differ(nominal: Model, entries: Sequence[Entry]) -> float:
    """Squares of what closed form and simulation of the nominal model differ by, over the noise."""
    total = 0.0
    for group in merged(entries, apart=True):
        total += over_noise(Prediction(nominal, group).data - simulated(nominal, group).data, group.variance)
    return total


def over_noise(difference: ComplexArray, variance: FloatArray) -> float:
    """Squares of the difference of two predictions over the noise, of all lines that have any."""
    squares = np.abs(difference) ** 2 / variance
    return float(np.sum(squares[np.isfinite(squares)]))
