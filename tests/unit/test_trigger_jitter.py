"""Devices that start together only about: told, undone, and no cause."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.measurement.estimation import estimate
from cutvib_ss.measurement.records import Campaign
from cutvib_ss.measurement.trigger_jitter import aligned, trigger_jitter
from tests.unit.struck_oscillator import struck

JITTER = 2e-4


def test_jitter_is_told_and_undone() -> None:
    late = struck(jitter=JITTER)
    found = trigger_jitter(late.records)
    assert found is not None
    assert found.std == pytest.approx(JITTER, rel=0.5)
    assert all(abs(float(d.mean())) < 0.2 * JITTER for d in found.delays)
    for record, delays in zip(late.records, found.delays, strict=True):
        as_recorded, undone = (estimate(r, band=(20.0, 60.0)) for r in (record, aligned(record, delays)))
        assert np.median(undone.variance / as_recorded.variance) < 0.1
    assert any("trigger jitter" in w for w in observe(late, late.machine).warnings)


def test_aligned_is_its_own_inverse() -> None:
    record = struck().records[0]
    there = aligned(record, np.full(3, 3.3e-4))
    back = aligned(there, np.full(3, -3.3e-4))
    inner = slice(32, -32)
    for old, new in zip(record.histories, back.histories, strict=True):
        assert new.responses[:, inner] == pytest.approx(old.responses[:, inner], abs=1e-2 * np.abs(old.responses).max())


def windowed() -> Campaign:
    """Responses under an exponential window, which leaves less of their noise than there is before the blow."""
    campaign = struck()
    return replace(
        campaign,
        records=tuple(
            replace(r, histories=tuple(replace(h, responses=h.responses * np.exp(-4.0 * h.time)) for h in r.histories))
            for r in campaign.records
        ),
    )


@pytest.mark.parametrize(
    "campaign", [struck(), struck(hum=3.0), struck(late=1e-3), windowed()], ids=["quiet", "hum", "late", "windowed"]
)
def test_blows_that_start_together_do_not_jitter(campaign) -> None:
    assert trigger_jitter(campaign.records) is None


def test_jitter_is_no_cause() -> None:
    found = diagnose(struck(jitter=JITTER))
    assert found.causes[0].place in ("measurement", "none")
    assert found.causes[0].effect in ("unknown", "none")
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.3)


def test_a_channel_that_is_late_is_told_beside_jitter() -> None:
    first = diagnose(struck(jitter=JITTER, late=3e-3)).causes[0]
    assert first.place == "measurement"
    assert "channel_delay" in first.effect
