"""Resonances of the records above the highest mode of the model: the band ends below them where no cause explains them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.modes_beyond import resonance_beyond
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.structure import Structure
from cutvib_ss.results import FloatArray
from tests.unit.test_diagnosis_residual_modes import CHANNELS, chain, measured, truncated

TO_70_HZ = np.linspace(5.0, 70.0, 260)
"""Three modes below 45 Hz, the fourth at 58 Hz."""


def campaign(model: Structure, freq: FloatArray, band: tuple[float, float] | None = None) -> Campaign:
    """Two sessions of the whole chain, as responses."""
    entries = measured(chain(), freq).entries
    signals = entries[0].channels, entries[0].quantities
    records = tuple(
        Record(
            f"r{e.record}",
            "frf",
            None,
            None,
            None,
            *signals,
            frf=e.response,
            excitation="multisine",
            band_hz=band,
            session=str(e.record),
        )
        for e in entries
    )
    return Campaign("chain", Path(), model, records)


def test_a_resonance_above_the_highest_mode_is_seen() -> None:
    entries = measured(chain(), TO_70_HZ).entries
    assert resonance_beyond(truncated(3), entries) == pytest.approx(58.3, abs=0.5)
    # Not where the model has it, or has all modes there are, nor where the records end below it.
    assert resonance_beyond(truncated(4), entries) is None
    assert resonance_beyond(published_machine(), entries) is None
    assert resonance_beyond(truncated(3), measured(chain(), np.linspace(5.0, 54.0, 160)).entries) is None


def test_a_peak_of_one_record_is_none() -> None:
    first, *others = measured(chain(), np.linspace(5.0, 40.0, 400)).entries
    data = first.response.data.copy()
    data[..., -30:-25] *= 5.0
    odd = replace(first, response=replace(first.response, data=data))
    assert resonance_beyond(truncated(2), [odd]) is not None
    assert resonance_beyond(truncated(2), [odd, *others]) is None


def test_a_band_that_is_stated_is_kept() -> None:
    model = Structure(truncated(3).system, CHANNELS, "tip")
    assert observe(campaign(model, TO_70_HZ), model).beyond is not None
    stated = observe(campaign(model, TO_70_HZ, (5.0, 65.0)), model)
    assert stated.beyond is None
    assert stated.band[1] == pytest.approx(65.0, abs=0.5)
    assert observe(campaign(model, TO_70_HZ), model, 50.0).band[1] == pytest.approx(50.0, abs=0.5)


def test_a_mode_that_the_model_lacks_is_no_gap_and_said() -> None:
    model = truncated(3)
    found = diagnose(campaign(model, TO_70_HZ))
    assert found.verdict == "no_gap"
    assert any("highest mode is at 44.2" in w and "state band_hz" in w for w in found.warnings)
