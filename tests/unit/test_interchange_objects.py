"""Round trips: to files of other programs and objects of other libraries, and back."""

from dataclasses import fields
from pathlib import Path

import control
import numpy as np
import pytest
from scipy.io import loadmat

import cutvib_ss as cv
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.interchange import (
    from_control,
    from_dataframe,
    from_sdypy,
    from_xarray,
    read_frf,
    read_plant,
    to_control,
    to_sdypy,
    write_frf,
    write_plant,
)
from cutvib_ss.results import FrequencyResponse, MeasuredFrequencyResponse
from tests.unit.diagnosis_example import measured

MACHINE = cv.published_machine()
FREQ = np.arange(100.0, 300.25, 0.5)
OMEGA = 2 * np.pi * FREQ
OUTPUTS = ("tool_x", "joint1", "eta2", "base_x")


@pytest.fixture(scope="module")
def frf() -> FrequencyResponse:
    """Two positions, two inputs of different units, outputs of three."""
    return cv.frequency_response(MACHINE, [0.5, 1 / 3], FREQ, inputs=["force", "joint2"], outputs=OUTPUTS)


def _same(back: FrequencyResponse, sent: FrequencyResponse, tolerance: float = 0.0) -> None:
    assert type(back) is type(sent)
    for f in fields(sent):
        ours, theirs = getattr(sent, f.name), getattr(back, f.name)
        if isinstance(ours, np.ndarray):
            assert ours.shape == theirs.shape
            scale = float(np.nanmax(np.abs(ours))) if np.isfinite(ours).any() else 0.0
            assert np.allclose(theirs, ours, rtol=0.0, atol=tolerance * scale, equal_nan=True), f.name
        else:
            assert theirs == ours, f.name


@pytest.mark.parametrize(("suffix", "tolerance"), [(".mat", 0.0), (".npz", 0.0), (".uff", 1e-10), (".nc", 0.0)])
def test_files_read_back_with_every_label(
    frf: FrequencyResponse, tmp_path: Path, suffix: str, tolerance: float
) -> None:
    if suffix == ".nc":
        pytest.importorskip("h5netcdf")
    write_frf(frf, tmp_path / f"frf{suffix}")
    _same(read_frf(tmp_path / f"frf{suffix}"), frf, tolerance)


def test_an_even_axis_of_a_uff_keeps_more_than_the_format_s_six_digits(tmp_path: Path) -> None:
    odd = cv.frequency_response(MACHINE, 0.5, 100.0 + np.arange(50) / 3.0, outputs="tool_x")
    write_frf(odd, tmp_path / "frf.uff")
    assert np.abs(read_frf(tmp_path / "frf.uff").freq - odd.freq).max() < 1e-9


def test_csv_reads_back_rotations(frf: FrequencyResponse, tmp_path: Path) -> None:
    one = frf.sel(input="force")
    write_frf(one, tmp_path / "frf.csv")
    _same(read_frf(tmp_path / "frf.csv"), one)


@pytest.mark.parametrize("suffix", [".npz", ".nc"])
def test_a_measured_response_keeps_its_noise(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("h5netcdf")
    sent = measured(MACHINE, 0.4, FREQ)
    write_frf(sent, tmp_path / f"frf{suffix}")
    back = read_frf(tmp_path / f"frf{suffix}")
    assert isinstance(back, MeasuredFrequencyResponse)
    _same(back, sent)


def test_arguments_of_matlab_s_frd_are_output_input_frequency_position(frf: FrequencyResponse, tmp_path: Path) -> None:
    write_frf(frf, tmp_path / "frf.mat")
    held = loadmat(tmp_path / "frf.mat", simplify_cells=True)
    assert held["ResponseData"].shape == (4, 2, FREQ.size, 2)
    assert held["ResponseData"][1, 0, 7, 1] == frf.data[1, 1, 0, 7]
    assert np.allclose(held["Frequency"], OMEGA, rtol=1e-15)
    assert list(held["outputs"]) == list(OUTPUTS)
    assert held["units"]["joint1"] == "rad/s^2/N"


@pytest.mark.parametrize("suffix", [".uff", ".mat", ".nc"])
def test_damaged_or_missing_files_are_refused(frf: FrequencyResponse, tmp_path: Path, suffix: str) -> None:
    if suffix == ".nc":
        pytest.importorskip("h5netcdf")
    file = tmp_path / f"frf{suffix}"
    with pytest.raises(DataFormatError, match="no such file"):
        read_frf(file)
    write_frf(frf, file)
    file.write_bytes(file.read_bytes()[:300])
    with pytest.raises(DataFormatError, match=r"frf\."):
        read_frf(file)


def test_python_control_gives_the_response_back_and_that_of_its_plant(frf: FrequencyResponse) -> None:
    sent = to_control(frf, position=0.5)
    assert list(sent.output_labels) == list(OUTPUTS)
    assert np.array_equal(sent.frdata, frf.data[0])
    back = from_control(sent, quantities=frf.quantities, position=0.5)
    assert np.allclose(back.freq, FREQ, rtol=1e-15)
    assert np.array_equal(back.data[0], frf.data[0])
    plant = MACHINE.plant(0.5, outputs=["tool_x", "base_x"], quantity="acceleration")
    theirs = from_control(control.frequency_response(plant, OMEGA), quantities="acceleration", position=0.5)
    ours = frf.sel(position=0.5, output=["tool_x", "base_x"], input="force")
    assert theirs.outputs == ours.outputs
    assert np.abs(theirs.data - ours.data).max() < 1e-9 * np.abs(ours.data).max()
    with pytest.raises(ParameterError, match="choose one of the positions"):
        to_control(frf)


def test_a_point_of_the_rail_is_a_signal_of_plants_and_of_python_control_too() -> None:
    plant = MACHINE.plant(0.5, inputs=["force", "rail@0.25"], outputs=["tool_x", "rail(0.4)"])
    assert (plant.input_labels, plant.output_labels) == (["force", "rail@0_25"], ["tool_x", "rail(0_4)"])
    ours = cv.frequency_response(
        MACHINE, 0.5, FREQ, form="receptance", inputs=["force", "rail@0.25"], outputs=["tool_x", "rail@0.4"]
    )
    theirs = control.frequency_response(plant, OMEGA).frdata
    assert np.abs(theirs - ours.data[0]).max() < 1e-9 * np.abs(ours.data).max()
    assert list(to_control(ours).input_labels) == ["force", "rail@0_25"]


def test_xarray_and_pandas_give_the_response_back(frf: FrequencyResponse) -> None:
    pytest.importorskip("xarray")
    pytest.importorskip("pandas")
    _same(from_xarray(frf.to_xarray()), frf)
    noisy = measured(MACHINE, 0.4, FREQ)
    _same(from_xarray(noisy.to_xarray()), noisy)
    _same(from_dataframe(frf.to_dataframe(), frf.quantities), frf)
    with pytest.raises(ParameterError, match="to_xarray"):
        from_xarray(frf.to_xarray().drop_vars("quantity"))


def test_sdypy_s_names_are_those_of_its_modal_model(frf: FrequencyResponse) -> None:
    sent = to_sdypy(frf, position=0.5)
    assert set(sent) == {"frf", "freq", "frf_type"}
    assert sent["frf"].shape == (4, FREQ.size)
    assert sent["frf_type"] == "accelerance"
    back = from_sdypy(**sent, outputs=OUTPUTS)
    assert np.array_equal(back.data[0, :, 0], frf.data[0, :, 0])
    assert back.quantities == frf.quantities
    with pytest.raises(ParameterError, match="receptance, mobility, accelerance"):
        from_sdypy(sent["frf"], FREQ, "inertance", outputs=OUTPUTS)


@pytest.mark.parametrize("suffix", [".mat", ".npz"])
def test_a_plant_and_a_family_read_back_with_their_names(tmp_path: Path, suffix: str) -> None:
    plant = MACHINE.plant(0.5, inputs=["force", "head_x"])
    write_plant(plant, tmp_path / f"one{suffix}", positions=0.5)
    back = read_plant(tmp_path / f"one{suffix}")
    for name in "ABCD":
        assert np.array_equal(getattr(back, name), getattr(plant, name)), name
    for name in ("state_labels", "input_labels", "output_labels"):
        assert list(getattr(back, name)) == list(getattr(plant, name))
    family = MACHINE.plants([0.25, 0.5])
    write_plant(family, tmp_path / f"many{suffix}", positions=[0.25, 0.5])
    many = read_plant(tmp_path / f"many{suffix}")
    assert len(many) == 2
    for ours, theirs in zip(family, many, strict=True):
        assert np.array_equal(ours(2j * np.pi * 217.0), theirs(2j * np.pi * 217.0))
    with pytest.raises(ParameterError, match="2 plants need as many positions"):
        write_plant(family, tmp_path / f"few{suffix}", positions=0.5)


def test_the_plant_s_arrays_are_what_matlab_s_ss_takes(tmp_path: Path) -> None:
    write_plant(cv.schedule(MACHINE, [0.2, 0.4, 0.6]), tmp_path / "plants.mat")
    held = loadmat(tmp_path / "plants.mat")
    assert held["A"].shape == (12, 12, 3)
    assert held["B"].shape == (12, 1, 3)
    assert held["positions"].ravel().tolist() == [0.2, 0.4, 0.6]
    # cells of texts, a row, as 'StateName' and its like take them
    assert held["states"].shape == (1, 12)
    assert held["states"].dtype == object
    assert held["outputs"][0, 0].item() == "tool_x"
