"""Estimated responses of blows that state no block: cut off after 1/Δf, or as if nothing had been cut off."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.blocks import longer_blocks
from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure, StructureTolerances
from cutvib_ss.results import MeasuredFrequencyResponse

MASS, DAMPING, SPRING = 2.0, 2.0, 8e4
BAR = Structure(
    SecondOrder(np.array([[MASS]]), np.array([[DAMPING]]), np.array([[SPRING]]), ("x",), {"tip": np.ones(1)}),
    {"y": Channel("tip", "displacement")},
    "tip",
    tolerance=StructureTolerances(0.01, 0.1, 0.01, 0.01),
)
BLOCK, BLOW_AT, LEVEL = 1.0, 0.05, 40.0


def estimated(seconds: float, peak_force: float | None) -> Campaign:
    """Its decay after an impulse, transformed over so many seconds: in closed form, e^(pt) integrated."""
    freq = np.arange(5.0, 90.0) / BLOCK
    pole = -DAMPING / (2 * MASS) + 1j * np.sqrt(SPRING / MASS - (DAMPING / (2 * MASS)) ** 2)
    s, rest = 2j * np.pi * freq, seconds - BLOW_AT
    data = sum(w * (1 - np.exp((p - s) * rest)) / (s - p) for p, w in ((pole, 1.0), (pole.conjugate(), -1.0)))
    data = np.asarray(data / (2j * pole.imag * MASS))
    noise = 2e-3 * np.median(np.abs(data))
    rng = np.random.default_rng(5)
    data = data + noise / np.sqrt(2) * (rng.standard_normal(freq.size) + 1j * rng.standard_normal(freq.size))
    shape = (1, 1, 1, freq.size)
    variance, coherence = np.full(shape, noise**2), np.full(shape, 0.9999)
    frf = MeasuredFrequencyResponse(
        data=data.reshape(shape), freq=freq, positions=np.array([np.nan]), outputs=("y",), inputs=("force",),
        quantities=("displacement",), input_unit="N", variance=variance, coherence=coherence, averages=5,
    )  # fmt: skip
    record = Record(
        "r0", "frf", None, peak_force, None, ("y",), ("displacement",), (), frf=frf, averages=5,
        excitation="impact", blow_at=BLOW_AT,
    )  # fmt: skip
    return Campaign("", Path(), BAR, (record,), ())


@pytest.mark.parametrize("peak_force", [None, LEVEL])
@pytest.mark.parametrize(("seconds", "cut"), [(BLOCK, True), (40.0, False)])
def test_whether_anything_was_cut_off_the_responses_say(seconds: float, cut: bool, peak_force: float | None) -> None:
    observed = observe(estimated(seconds, peak_force), BAR)
    longer = longer_blocks(BAR, observed)
    assert (longer is None) is cut
    observed = longer or observed
    (entry,) = observed.entries
    assert any("state `block`" in word for word in observed.warnings) is not cut
    assert (entry.replay is None) is (peak_force is None)
    if entry.replay is not None:
        # The lines of a longer transform are further apart.
        ratio = round(entry.estimator.block / BLOCK)
        assert np.array_equal(entry.replay.lines, np.round(entry.freq * BLOCK * ratio).astype(int))
    found = fit(BAR, Records(observed.entries), Hypothesis())
    assert found.reduced == pytest.approx(1.0, abs=0.3)
    assert np.abs(found.x[: found.n_tuning]).max() < 0.5


def test_a_block_that_is_stated_is_believed() -> None:
    campaign = estimated(40.0, None)
    stated = replace(campaign, records=tuple(replace(r, block=BLOCK) for r in campaign.records))
    assert longer_blocks(BAR, observe(stated, BAR)) is None


def test_longer_blocks_are_taken_where_no_cause_explains_the_records() -> None:
    for seconds, longer in ((BLOCK, False), (40.0, True)):
        found = diagnose(estimated(seconds, LEVEL))
        assert found.verdict == "no_gap"
        assert any("state `block`" in word for word in found.warnings) is longer
