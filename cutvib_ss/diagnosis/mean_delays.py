"""
Mean delays of records whose blows are late by a jittering trigger, as the tuned model sees them.

To first order a delay moves a response along -iω H. A tenth of a radian at the end of the band is too much for that beside noise of
a thousandth, and would be taken for a cause. Records are moved by what each is late; what is left of it is of first order. What all
of them are late together stays in the records where jitter alone does not explain it: a channel may be late besides.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import Observations
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.base import Model
from cutvib_ss.measurement.records import Campaign
from cutvib_ss.measurement.trigger_jitter import TriggerJitter, aligned


def without_mean_delays(nominal: Model, campaign: Campaign, observed: Observations, jitter: TriggerJitter) -> Campaign:
    """The campaign with its jittering records early by as much as the tuned model sees them late."""
    spread = fit(nominal, Records(observed.entries), Hypothesis()).spread
    late, std = np.zeros((2, len(campaign.records)))
    for e in observed.entries:
        std[e.record] = jitter.of_mean(e.record)
        if std[e.record]:
            column = spread.layout.first_hit + spread.layout.hits.index(("late", e.record, 0))
            late[e.record] = spread.offsets[column] * std[e.record]
    told = std > 0.0
    mean = float(np.average(late[told], weights=std[told] ** -2))
    together = mean**2 * float(np.sum(std[told] ** -2.0))
    if together > SETTINGS.record_late_together**2:
        late[told] -= mean
    records = [
        aligned(r, np.full(len(r.histories), d)) if d else r for r, d in zip(campaign.records, late, strict=True)
    ]
    return replace(campaign, records=tuple(records))
