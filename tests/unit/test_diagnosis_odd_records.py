"""A record that was measured wrong is left out by name; what shows in all records is the machine's."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.discrepancy import smooth_shapes
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.odd_records import odd_records
from cutvib_ss.diagnosis.ranking import Ranked
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import unknown_candidates
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.measurement.records import Campaign
from tests.unit.test_diagnosis_drift import MACHINE, campaign

COARSE = 16
PLACES = (0.1, 0.35, 0.6, 0.85)


def with_gain(found: Campaign, records: tuple[int, ...], gain: float) -> Campaign:
    """The same with the first channel of some records on a wrong range."""
    changed = list(found.records)
    for k in records:
        frf = changed[k].frf
        assert frf is not None
        data = np.array(frf.data)
        data[:, 0] *= gain
        changed[k] = replace(changed[k], frf=replace(frf, data=data))
    return replace(found, records=tuple(changed))


def found_odd(measured: Campaign) -> dict[int, float]:
    """Odd records beside the tuned model alone."""
    records = Records(observe(measured, MACHINE).entries)
    return odd_records(MACHINE, records, Ranked("none", fit(MACHINE, records, Hypothesis()), True), [])


# At 0.95 both channels together leave eight times their noise.
@pytest.mark.parametrize("gain", [0.7, 0.95])
def test_a_record_on_a_wrong_range_is_odd(tmp_path: Path, gain: float) -> None:
    right = campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3)
    wrong = with_gain(right, (5,), gain)
    odd = found_odd(wrong)
    assert list(odd) == [5]
    assert odd[5] > 10.0


def test_a_diagnosis_says_which_record_it_left_out(tmp_path: Path) -> None:
    right = campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3)
    # A record 5 % off may be a hammer that struck askew.
    found = diagnose(with_gain(right, (5,), 0.9))
    assert found.verdict == "no_gap"
    assert any(w.startswith("r5: left out") for w in found.warnings)


@pytest.mark.parametrize("records", [(5, 6), (4, 5, 6, 7)], ids=["two", "a whole session"])
def test_what_shows_in_several_records_is_not_left_out(tmp_path: Path, records: tuple[int, ...]) -> None:
    right = campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3)
    assert found_odd(with_gain(right, records, 0.7)) == {}


def test_a_cause_that_all_records_show_leaves_none_out(tmp_path: Path) -> None:
    right = campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3)
    heavier = replace(right, machine=AddedMass("tool", -0.4).apply(MACHINE))
    records = Records(observe(heavier, heavier.machine).entries)
    none, cause = (
        Ranked(name, fit(heavier.machine, records, Hypothesis(effects)), True)
        for name, effects in (("none", ()), ("added_mass", (AddedMass("tool", 0.3),)))
    )
    assert cause.reduced < 1.5 < none.reduced
    assert odd_records(heavier.machine, records, none, [cause]) == {}


def test_a_record_whose_position_no_other_has_stays(tmp_path: Path) -> None:
    alone = campaign(tmp_path, {"Monday": PLACES, "Tuesday": (0.2, 0.45, 0.7, 0.95)}, 3)
    assert found_odd(with_gain(alone, (5,), 0.7)) == {}


def test_a_record_is_odd_beside_a_fault_of_unknown_form_too(tmp_path: Path) -> None:
    filtered = []
    for record in campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3).records:
        assert record.frf is not None
        data = np.array(record.frf.data)
        data[:, -1] *= 1.0 + 0.3 * np.sin(4.0 * np.log(record.frf.freq))
        filtered.append(replace(record, frf=replace(record.frf, data=data)))
    measured = campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3)
    wrong = with_gain(replace(measured, records=tuple(filtered)), (5,), 0.7)
    observed = observe(wrong, MACHINE)
    records = Records(observed.entries).coarse(60, 0.0)
    none = Ranked("none", fit(MACHINE, records, Hypothesis()), True)
    assert odd_records(MACHINE, records, none, []) == {}
    [error] = [
        c.starts[0]
        for c in unknown_candidates(MACHINE, observed.band, observed.channels)
        if getattr(c.starts[0], "site", "") == f"channel {observed.channels[-1]}"
    ]
    unknown = Ranked("unknown", fit(MACHINE, records, Hypothesis((error,))), True)
    assert list(odd_records(MACHINE, records, none, [unknown])) == [5]


def test_few_lines_may_end_in_a_lower_band(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the last of few lines lies below the last of all, a discrepancy over frequency may have a shape less there."""
    right = campaign(tmp_path, {"Monday": PLACES, "Tuesday": PLACES}, 3)
    monkeypatch.setattr("cutvib_ss.diagnosis.odd_records.SETTINGS", replace(SETTINGS, search_coarse_lines=COARSE))
    measured = with_gain(right, (5,), 0.7)
    freq = observe(measured, MACHINE).entries[0].freq
    steps = {size: max(1, size // COARSE) for size in range(COARSE, freq.size + 1)}
    last = {size: float(freq[(size - 1) // step * step]) for size, step in steps.items()}
    size = next(
        size
        for size in reversed(steps)
        if shapes_to(float(freq[0]), last[size]) < shapes_to(float(freq[0]), float(freq[size - 1]))
    )
    band = (float(freq[0]), float(freq[size - 1]))
    assert list(found_odd(replace(measured, records=tuple(replace(r, band_hz=band) for r in measured.records)))) == [5]


def shapes_to(low: float, high: float) -> int:
    """Number of smooth shapes over a band."""
    return smooth_shapes(np.array([low, high]), (low, high)).shape[0]
