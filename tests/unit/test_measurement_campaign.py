"""Campaigns as people write them, and those that were measured."""

import numpy as np
import pytest

from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement import Campaign, History, Record, estimate, read_campaign
from cutvib_ss.measurement.campaign import _told_once, write_campaign
from cutvib_ss.model.machine import published_machine
from tests.unit.measurement_rig import small_campaign


def test_folder_file_default_title_and_published_machine(tmp_path):
    write_campaign(small_campaign(tmp_path), tmp_path / "north hall", format="csv")
    folder = tmp_path / "north hall"
    (folder / "campaign.toml").write_text('[[record]]\nfile = "records/p1.csv"\nkind = "impact"\nposition = 0.25\n')
    for path in (folder, folder / "campaign.toml", str(folder)):
        campaign = read_campaign(path)
        assert campaign.title == "north hall"
        assert campaign.folder == folder
        assert campaign.machine == published_machine()


def test_machine_overrides_the_one_that_is_named(tmp_path):
    folder = write_campaign(small_campaign(tmp_path), tmp_path / "c").parent
    (folder / "machine.toml").write_text("not read")
    machine = published_machine()
    assert read_campaign(folder, machine=machine).machine is machine


def test_list_of_files_is_one_blow_each(tmp_path):
    campaign = small_campaign(tmp_path)
    for k, history in enumerate(campaign.records[0].histories):
        record = Record(**{**campaign.records[0].__dict__, "name": f"blow{k}.tdms", "histories": (history,)})
        write_campaign(Campaign("t", tmp_path, campaign.machine, (record,)), tmp_path / "c", format="tdms")
    (tmp_path / "c" / "campaign.toml").write_text(
        '[[record]]\nfile = ["blow0.tdms", "blow1.tdms"]\nkind = "impact"\nposition = 0.25\n'
    )
    (record,) = read_campaign(tmp_path / "c").records
    assert (record.averages, len(record.histories)) == (2, 2)
    np.testing.assert_array_equal(record.histories[1].force, campaign.records[0].histories[1].force)


def test_writing_again_replaces_and_leaves_other_files(tmp_path):
    folder = tmp_path / "c"
    write_campaign(small_campaign(tmp_path, seed=0), folder, format="csv")
    (folder / "notes.txt").write_text("kept")
    write_campaign(small_campaign(tmp_path, seed=1), folder, format="csv")
    expected = small_campaign(tmp_path, seed=1).records[0].histories[0].responses
    np.testing.assert_allclose(read_campaign(folder).records[0].histories[0].responses, expected)
    assert (folder / "notes.txt").read_text() == "kept"


def test_what_is_alike_in_several_files_is_said_once():
    said = ["a.csv: tool_x is dead", "b.csv: tool_x is dead", "b.csv: blow 1: double hit", "c.csv: tool_x is dead"]
    assert _told_once([*said, said[0]]) == ("a.csv and 2 more: tool_x is dead", "b.csv: blow 1: double hit")


def test_record_of_one_kind_holds_what_it_needs():
    history = History(10.0, np.ones(20), np.ones((1, 20)), ("a",))
    with pytest.raises(ParameterError, match="no histories"):
        Record("r", "frf", None, None, None, ("a",), ("acceleration",), (history,))


def test_impacts_of_a_measured_campaign(shared):
    campaign = read_campaign(shared / "campaigns" / "c01")
    assert (campaign.title, len(campaign.records)) == ("c01", 18)
    record = campaign.records[1]
    assert (record.name, record.kind, record.position, record.peak_force) == ("records/p1_l2.tdms", "impact", 0.02, 50)
    assert record.channels == ("tool_x", "tool_z", "base_x")
    assert [h.fs for h in record.histories] == [4000.0] * 3
    assert record.histories[0].responses.shape == (3, 8000)
    found = estimate(record, band=(15, 450))
    assert found.freq[1] - found.freq[0] == 0.5
    assert found.averages == 3


def test_frequency_responses_of_a_measured_campaign(shared):
    record = read_campaign(shared / "campaigns" / "c09").records[0]
    assert record.frf.data.shape == (1, 3, 1, 1001)
    assert (record.frf.freq[0], record.frf.freq[-1]) == (0.0, 500.0)
    assert (record.averages, record.frf.averages) == (3, 3)
    assert np.all(record.frf.variance > 0)


def test_circuit_read_as_a_structure(shared):
    campaign = read_campaign(shared / "data" / "silverbox" / "campaign")
    assert [r.use for r in campaign.records] == [None, None, "check", None]
    record = campaign.records[0]
    assert (record.position, record.channels, record.quantities) == (None, ("y",), ("displacement",))
    assert record.histories[0].fs == 610.3515625
    found = estimate(record)
    assert np.isnan(found.positions[0])
    assert found.unit == "m/N"
    peak = np.argmax(np.abs(found.data[0, 0, 0]))
    assert found.freq[peak] == pytest.approx(68.4, abs=1.5)
    assert found.data[0, 0, 0, peak].imag < 0
    assert found.data[0, 0, 0, 10].real == pytest.approx(1.0, abs=0.15)  # 1 / stiffness, well below resonance


@pytest.mark.slow
@pytest.mark.parametrize("format_", ["tdms", "mat", "csv", "uff"])
def test_a_million_samples_take_seconds(tmp_path, format_):
    import time

    campaign = small_campaign(tmp_path, "timeseries", blows=1, samples=1_000_000)
    folder = write_campaign(campaign, tmp_path / "c", format=format_)
    start = time.perf_counter()
    record = read_campaign(folder).records[0]
    estimate(record)
    assert time.perf_counter() - start < 20
    assert record.histories[0].force.size == 1_000_000
