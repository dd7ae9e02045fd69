"""A record of a test from plain arrays, as the diagnosis fits it."""

import numpy as np

from cutvib_ss.diagnosis.records import Entry
from cutvib_ss.results import Estimator, MeasuredFrequencyResponse
from cutvib_ss.results.arrays import optional_array


def entry_of(
    record, position, level, data, variance, freq, channels, quantities, *, block=np.inf, blow_at=None, input="force",
    **more,
):  # fmt: skip
    """An entry with responses and their variance of shape (channel, frequency)."""
    response = MeasuredFrequencyResponse(
        data[None, :, None], freq, optional_array([position]), channels, input, quantities,
        variance=variance[None, :, None], estimator=Estimator(block=block, blow_at=blow_at),
    )  # fmt: skip
    return Entry(record, response, level, **more)
