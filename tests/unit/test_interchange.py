"""Exported frequency responses: exact round trips, what other programs read, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import pyuff
from scipy.io import loadmat

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.interchange import frf_csv, read_frf, staged, write_frf
from cutvib_ss.measurement import read_campaign
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import FrequencyResponse, MeasuredFrequencyResponse
from tests.unit.diagnosis_example import example_structure, measured

FREQ = np.arange(100.0, 300.25, 0.5)


@pytest.fixture
def frf() -> FrequencyResponse:
    return frequency_response(published_machine(), [0.5, 1 / 3], FREQ)


def test_csv_columns_are_those_of_the_contract(frf: FrequencyResponse) -> None:
    first, second = frf_csv(frf).splitlines()[:2]
    assert first == (
        "position,freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N],tool_z re [m/s^2/N],tool_z im [m/s^2/N],"
        "base_x re [m/s^2/N],base_x im [m/s^2/N]"
    )
    value = frf.data[0, 0, 0, 0]
    assert [float(cell) for cell in second.split(",")][:4] == [0.5, 100.0, value.real, value.imag]


@pytest.mark.parametrize("form", ["receptance", "mobility", "accelerance"])
@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_csv_and_npz_read_back_without_losing_a_digit(
    frf: FrequencyResponse, tmp_path: Path, form: str, suffix: str
) -> None:
    sent = frf.to_form(form)  # type: ignore[arg-type]
    write_frf(sent, tmp_path / f"frf{suffix}")
    back = read_frf(tmp_path / f"frf{suffix}")
    assert np.array_equal(back.data, sent.data)
    assert np.array_equal(back.freq, sent.freq)
    assert np.array_equal(back.positions, sent.positions)
    assert (back.outputs, back.inputs, back.quantities) == (sent.outputs, sent.inputs, sent.quantities)
    assert back.units == sent.units


def test_a_structure_without_position_and_with_mixed_units_reads_back(tmp_path: Path) -> None:
    sent = frequency_response(example_structure(), None, FREQ)
    write_frf(sent, tmp_path / "frf.csv")
    back = read_frf(tmp_path / "frf.csv")
    assert np.isnan(back.positions).all()
    assert back.units == ("m/N", "m/s^2/N")
    assert np.array_equal(back.data, sent.data)
    assert "nan" not in (tmp_path / "frf.csv").read_text()


def test_npz_keeps_variance_coherence_and_averages(tmp_path: Path) -> None:
    sent = measured(published_machine(), 0.4, FREQ)
    write_frf(sent, tmp_path / "frf.npz")
    back = read_frf(tmp_path / "frf.npz")
    assert isinstance(back, MeasuredFrequencyResponse)
    assert np.array_equal(back.variance, sent.variance)
    assert np.array_equal(back.coherence, sent.coherence, equal_nan=True)
    assert back.averages == 3


def test_a_uff_of_one_position_is_a_record_of_a_campaign(tmp_path: Path) -> None:
    sent = frequency_response(published_machine(), [0.5], FREQ)
    write_frf(sent, tmp_path / "frf.uff")
    (tmp_path / "campaign.toml").write_text('[[record]]\nfile = "frf.uff"\nkind = "frf"\nposition = 0.5\n')
    got = read_campaign(tmp_path).records[0].frf
    assert got is not None
    assert got.outputs == sent.outputs
    assert np.abs(got.data - sent.data).max() < 1e-9 * np.abs(sent.data).max()


@pytest.mark.parametrize("suffix", [".csv", ".mat"])
def test_a_csv_or_mat_of_one_position_is_a_record_and_of_several_is_refused(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "campaign.toml").write_text(f'[[record]]\nfile = "r{suffix}"\nkind = "frf"\nposition = 0.5\n')
    one = frequency_response(published_machine(), 0.5, np.linspace(20.0, 200.0, 31), form="accelerance")
    write_frf(one, tmp_path / f"r{suffix}")
    found = read_campaign(tmp_path).records[0].frf
    assert found is not None
    assert found.outputs == one.outputs
    assert np.abs(found.data - one.data).max() < 1e-12 * np.abs(one.data).max()
    write_frf(
        frequency_response(published_machine(), [0.2, 0.5], one.freq, form="accelerance"), tmp_path / f"r{suffix}"
    )
    with pytest.raises(DataFormatError, match="several positions"):
        read_campaign(tmp_path)


def test_a_uff_of_several_positions_keeps_them_apart_by_node_and_name(frf: FrequencyResponse, tmp_path: Path) -> None:
    write_frf(frf, tmp_path / "frf.uff")
    sets = pyuff.UFF(str(tmp_path / "frf.uff")).read_sets()
    assert [(s["rsp_node"], s["rsp_dir"], s["ref_node"], s["id1"].strip()) for s in sets] == [
        (1, 1, 1, "tool_x at 0.5"),
        (1, 3, 1, "tool_z at 0.5"),
        (2, 1, 1, "base_x at 0.5"),
        (101, 1, 101, "tool_x at 0.333333"),
        (101, 3, 101, "tool_z at 0.333333"),
        (102, 1, 101, "base_x at 0.333333"),
    ]
    assert np.abs(sets[4]["data"] - frf.data[1, 1, 0]).max() < 1e-9 * np.abs(frf.data).max()


def test_mat_holds_a_matrix_a_channel(frf: FrequencyResponse, tmp_path: Path) -> None:
    write_frf(frf, tmp_path / "frf.mat")
    got = loadmat(tmp_path / "frf.mat")
    assert np.array_equal(got["tool_z"], frf.data[:, 1, 0].T)
    assert np.array_equal(got["freq"][:, 0], FREQ)
    assert got["units"]["tool_z"][0, 0][0] == "m/s^2/N"


@pytest.mark.parametrize(
    ("name", "said"),
    [("frf.xlsx", "suffix '.xlsx' is not written"), ("frf", "suffix '' is not written")],
)
def test_an_unknown_suffix_is_refused(frf: FrequencyResponse, tmp_path: Path, name: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        write_frf(frf, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_what_csv_has_no_place_for_is_refused(tmp_path: Path) -> None:
    two = frequency_response(published_machine(), [0.5], FREQ, inputs=("force", "base"))
    with pytest.raises(ParameterError, match="one input"):
        write_frf(two, tmp_path / "frf.csv")
    damped = frequency_response(published_machine(), [0.5], FREQ, decay_rate=2.0)
    with pytest.raises(ParameterError, match="decay rate"):
        write_frf(damped, tmp_path / "frf.uff")
    write_frf(damped, tmp_path / "frf.npz")
    assert read_frf(tmp_path / "frf.npz").decay_rate == 2.0


def _cut_last_row(text: str) -> str:
    return text[: text.rindex(",")]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (_cut_last_row, "truncated"),
        (lambda text: text.splitlines()[0] + "\n", "no rows"),
        (lambda text: text.replace("position,freq", "place,freq"), "first line"),
        (lambda text: text.replace("tool_x im [m/s^2/N]", "tool_x im [g/N]"), "tool_x"),
        (lambda text: text.replace("m/s^2/N", "V/V"), "unit 'V/V'"),
        (lambda text: text.replace("0.5,100.0,", "0.5,hundred,"), "not numeric"),
        (lambda text: text.replace("0.5,100.0,", "0.5,100.1,"), "different frequencies"),
    ],
)
def test_a_damaged_csv_is_refused(frf: FrequencyResponse, tmp_path: Path, spoil, said: str) -> None:
    path = tmp_path / "frf.csv"
    path.write_text(spoil(frf_csv(frf)))
    with pytest.raises(DataFormatError, match=said) as caught:
        read_frf(path)
    assert str(path) in str(caught.value)


def test_a_damaged_or_foreign_npz_is_refused(frf: FrequencyResponse, tmp_path: Path) -> None:
    path = tmp_path / "frf.npz"
    write_frf(frf, path)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(DataFormatError, match="not a readable NPZ"):
        read_frf(path)
    np.savez(path, a=np.ones(3))
    with pytest.raises(DataFormatError, match="holds no 'data'"):
        read_frf(path)
    with pytest.raises(DataFormatError, match="no such file"):
        read_frf(tmp_path / "absent.csv")


def test_a_staged_file_appears_only_when_it_is_complete(tmp_path: Path) -> None:
    target = tmp_path / "out.txt"
    target.write_text("old")

    def fail_halfway() -> None:
        with staged(target) as draft:
            draft.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail_halfway()
    assert target.read_text() == "old"
    with staged(target) as draft:
        draft.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert [p.name for p in tmp_path.iterdir()] == ["out.txt"]


def test_a_target_that_cannot_be_written_is_refused_before_the_work(tmp_path: Path) -> None:
    with pytest.raises(DataFormatError, match="no folder"), staged(tmp_path / "absent" / "out.txt"):
        pytest.fail("the block must not run")
    with pytest.raises(DataFormatError, match="is a folder"), staged(tmp_path):
        pytest.fail("the block must not run")
