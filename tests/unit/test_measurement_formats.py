"""Every format read back as it was written, and files as other programs write them."""

from types import SimpleNamespace

import nptdms
import numpy as np
import pytest
import pyuff
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.io import savemat

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.measurement import Campaign, History, Record, read_campaign
from cutvib_ss.measurement.campaign import write_campaign
from cutvib_ss.measurement.formats import FORMATS, uff_body
from cutvib_ss.measurement.formats.raw import (
    Contents,
    RawFrf,
    RawHistory,
    RawResponse,
    Signal,
    even_sampling,
    sampling_frequency,
)
from cutvib_ss.measurement.layout import layout_of
from cutvib_ss.measurement.reading import read_file
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel
from cutvib_ss.results import MeasuredFrequencyResponse
from tests.unit.lab_files import set58
from tests.unit.measurement_rig import lvm_text, small_campaign

LAYOUT = layout_of(published_machine())
HISTORY_FORMATS = [".tdms", ".uff", ".unv", ".csv", ".mat"]
FRF_FORMATS = [".uff", ".unv", ".csv", ".mat"]

_values = st.floats(-1e5, 1e5).map(lambda x: 0.0 if abs(x) < 1e-90 else x)  # an E20.12 field holds no E-100


def _columns(samples):
    return arrays(np.float64, samples, elements=_values)


@pytest.mark.parametrize("suffix", HISTORY_FORMATS)
@given(data=st.data())
def test_histories_read_back_as_written(suffix, data, tmp_path_factory):
    samples = data.draw(st.integers(16, 40))
    blows = data.draw(st.integers(1, 3))
    fs = data.draw(st.sampled_from([4000.0, 4096.0, 610.3515625, 44100.0, 1e6, 51200.0, 0.5]))
    names = ["force", *data.draw(st.sampled_from([["tool_x"], ["tool_z", "base_x"], ["tool_x", "tool_z", "base_x"]]))]
    histories = tuple(
        RawHistory(
            f"blow {k + 1}",
            fs,
            tuple(
                Signal(
                    name, "N" if name == "force" else "m/s^2", data.draw(arrays(np.float64, samples, elements=_values))
                )
                for name in names
            ),
        )
        for k in range(blows)
    )
    path = tmp_path_factory.mktemp("round") / f"record{suffix}"
    FORMATS[suffix].write(path, Contents(histories=histories), LAYOUT)
    back = read_file(path, False, LAYOUT).histories
    assert len(back) == blows
    for written, read in zip(histories, back, strict=True):
        assert read.fs == fs
        columns = {signal.name: signal for signal in read.signals}
        assert set(columns) == set(names)
        for signal in written.signals:
            assert columns[signal.name].unit == signal.unit
            np.testing.assert_allclose(columns[signal.name].values, signal.values, rtol=1e-11, atol=0)


@pytest.mark.parametrize("suffix", FRF_FORMATS)
@given(data=st.data())
def test_frequency_responses_read_back_as_written(suffix, data, tmp_path_factory):
    lines = data.draw(st.integers(4, 30))
    even = data.draw(st.booleans())
    freq = 0.5 * np.arange(lines) + 10.0 if even else np.cumsum(np.arange(1.0, lines + 1))
    coherent = data.draw(st.booleans())
    parts = arrays(np.float64, lines, elements=_values)
    responses = tuple(
        RawResponse(
            name,
            "m/s^2/N",
            data.draw(parts) + 1j * data.draw(parts),
            data.draw(arrays(np.float64, lines, elements=st.floats(0, 1, width=16))) if coherent else None,
        )
        for name in ("tool_x", "tool_z", "base_x")
    )
    path = tmp_path_factory.mktemp("round") / f"record{suffix}"
    FORMATS[suffix].write(path, Contents(frf=RawFrf(freq, responses)), LAYOUT)
    back = read_file(path, True, LAYOUT).frf
    np.testing.assert_allclose(back.freq, freq, rtol=1e-12)
    for written, read in zip(responses, back.responses, strict=True):
        assert (read.name, read.unit) == (written.name, written.unit)
        np.testing.assert_allclose(read.values.real, written.values.real, rtol=1e-11)
        np.testing.assert_allclose(read.values.imag, written.values.imag, rtol=1e-11)
        if coherent:
            np.testing.assert_allclose(read.coherence, written.coherence, rtol=1e-11)
        else:
            assert read.coherence is None


@pytest.mark.parametrize("format_", ["tdms", "uff", "csv", "mat"])
@pytest.mark.parametrize("kind", ["impact", "timeseries"])
def test_campaign_reads_back_as_written(format_, kind, tmp_path):
    campaign = small_campaign(tmp_path, kind)
    written = write_campaign(campaign, tmp_path / "new" / "c", format=format_)
    back = read_campaign(written)
    assert back.title == campaign.title
    assert back.machine == campaign.machine
    before, after = campaign.records[0], back.records[0]
    assert after.name == f"records/p1.{format_}"
    for field in ("kind", "position", "peak_force", "use", "channels", "quantities", "averages", "excitation"):
        assert getattr(after, field) == getattr(before, field), field
    for history, again in zip(before.histories, after.histories, strict=True):
        assert again.fs == history.fs
        np.testing.assert_allclose(again.force, history.force, rtol=1e-10)
        np.testing.assert_allclose(again.responses, history.responses, rtol=1e-10)
    assert sorted(p.name for p in (tmp_path / "new").iterdir()) == ["c"]  # no temporary names are left


@pytest.mark.parametrize("format_", ["uff", "csv", "mat"])
def test_campaign_of_frequency_responses_reads_back_as_written(format_, tmp_path):
    campaign = _frf_campaign(tmp_path)
    back = read_campaign(write_campaign(campaign, tmp_path / "c", format=format_))
    before, after = campaign.records[0], back.records[0]
    np.testing.assert_allclose(after.frf.data, before.frf.data, rtol=1e-9)
    np.testing.assert_allclose(after.frf.coherence, before.frf.coherence, rtol=1e-9)
    for field in ("averages", "excitation", "block", "blow_at", "exponential_decay"):
        assert getattr(after, field) == getattr(before, field), field
    assert after.frf.averages == 5


def _frf_campaign(folder):
    rng = np.random.default_rng(0)
    shape = (1, 2, 1, 50)
    frf = MeasuredFrequencyResponse(
        data=rng.standard_normal(shape) + 1j * rng.standard_normal(shape),
        freq=np.arange(50) * 0.5,
        positions=[0.4],
        outputs=("tool_x", "base_x"),
        inputs=("force",),
        quantities=("acceleration",) * 2,
        variance=np.ones(shape),
        coherence=rng.uniform(0.5, 1, shape),
        averages=5,
    )
    record = Record(
        "a/p.uff", "frf", 0.4, 20.0, "check", frf.outputs, frf.quantities, (), frf, 5, "sine", 2.0, 0.1, 1.5
    )  # fmt: skip
    return Campaign("t", folder, published_machine(), (record,))


def test_what_a_format_cannot_hold_leaves_nothing_behind(tmp_path):
    with pytest.raises(DataFormatError, match="uff, csv or mat"):
        write_campaign(_frf_campaign(tmp_path), tmp_path / "c", format="tdms")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ParameterError, match="lvm"):
        write_campaign(_frf_campaign(tmp_path), tmp_path / "c", format="lvm")


def test_records_that_share_a_file_name_are_numbered_and_stay_in_the_folder(tmp_path):
    campaign = small_campaign(tmp_path)
    record = campaign.records[0]
    outside = Record(**{**record.__dict__, "name": "../elsewhere/p1.tdms"})
    several = Campaign("t", tmp_path, campaign.machine, (record, record, outside))
    back = read_campaign(write_campaign(several, tmp_path / "c", format="csv"))
    assert [r.name for r in back.records] == ["records/p1.csv", "records/p1_2.csv", "records/p1_3.csv"]


# --- CSV -------------------------------------------------------------------------------------------------------------


def _read_one(tmp_path, text, frf=False, layout=LAYOUT, name="r.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read_file(path, frf, layout)


def test_csv_of_another_program(tmp_path):
    """Byte order mark, Windows line ends, blanks after commas, times with six digits, columns in any order."""
    rows = "\r\n".join(f"{k * 0.0016384:.6g}, {k}, {-k}, 1" for k in range(20000))
    contents = _read_one(tmp_path, "\ufefftime [s], tool_x [g], force [N], base_x [m/s^2]\r\n" + rows)
    (history,) = contents.histories
    assert history.fs == 610.3515625
    assert [(s.name, s.unit) for s in history.signals] == [("tool_x", "g"), ("force", "N"), ("base_x", "m/s^2")]


def test_csv_blows_keep_their_order_and_may_start_anew(tmp_path):
    rows = [f"{b},{k / 1000},{b * 10 + k},0" for b in (2, 1) for k in range(20)]
    contents = _read_one(tmp_path, "blow,time [s],force [N],tool_x [m/s^2]\n" + "\n".join(rows))
    assert [h.name for h in contents.histories] == ["blow 2", "blow 1"]
    assert contents.histories[0].signals[0].values[0] == 20


# --- UFF -------------------------------------------------------------------------------------------------------------


def _uff(tmp_path, sets, name="r.uff", **options):
    path = tmp_path / name
    pyuff.UFF(str(path)).write_sets(sets, mode="overwrite", **options)
    return path


def _binary(path, numbers, order="<", line_end=b"", real="f8"):
    """Turn the one ASCII data set of a file into 58b, as other programs write it."""
    lines = path.read_bytes().split(b"\n")
    values = np.asarray(numbers).astype(order + real).tobytes()
    header = b"    58b%6d%6d%12d%12d%6d%6d%12d%12d" % (1 if order == "<" else 2, 2, 11, len(values), 0, 0, 0, 0)
    path.write_bytes(b"\n".join([lines[0], header, *lines[2:13]]) + b"\n" + values + line_end + b"    -1\n")
    return path


def _interleaved(freq, data, spacing):
    columns = [] if spacing else [freq]
    columns += [data.real, data.imag] if np.iscomplexobj(data) else [data]
    return np.column_stack(columns).ravel()


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("spacing", [0, 1])
@pytest.mark.parametrize("data", [np.arange(1, 42) * (1 + 2j), np.arange(1, 42) * 1.5])
def test_uff_ascii_and_binary_even_and_uneven_real_and_complex(tmp_path, binary, spacing, data):
    freq = np.arange(1.0, 42.0)
    path = _uff(tmp_path, [set58(abscissa_spacing=spacing, x=freq, data=data)])
    if binary:
        _binary(path, _interleaved(freq, data, spacing))
    frf = read_file(path, True, LAYOUT).frf
    np.testing.assert_allclose(frf.freq, freq)
    np.testing.assert_allclose(frf.responses[0].values, data)


@pytest.mark.parametrize("data", [np.arange(1, 42) * (1 + 2j), np.arange(1, 42) * 1.5])
def test_uff_single_precision(tmp_path, data):
    order = 5 if np.iscomplexobj(data) else 2
    path = _uff(tmp_path, [set58(data=data, x=np.arange(1.0, 42.0), ord_data_type=order)], force_double=False)
    np.testing.assert_allclose(read_file(path, True, LAYOUT).frf.responses[0].values, data, rtol=1e-5)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("line_end", [b"", b"\n", b"\r\n"])
def test_uff_58b_of_either_byte_order_with_or_without_a_line_end_after_the_data(tmp_path, order, line_end):
    data = np.arange(40) * (1 + 2j)
    path = _binary(_uff(tmp_path, [set58()]), _interleaved(None, data, 1), order, line_end)
    np.testing.assert_allclose(read_file(path, True, LAYOUT).frf.responses[0].values, data)


def test_uff_58b_of_single_precision(tmp_path):
    data = np.arange(41) * (1 + 2j)
    path = _uff(tmp_path, [set58(data=data, x=np.arange(41.0), ord_data_type=5)], force_double=False)
    _binary(path, _interleaved(None, data, 1), real="f4")
    np.testing.assert_allclose(read_file(path, True, LAYOUT).frf.responses[0].values, data)


def test_uff_numbers_that_touch_blank_line_ends_and_fortran_exponents(tmp_path):
    path = _uff(tmp_path, [set58(data=-1e-3 * np.arange(1, 42) * (1 + 2j), x=np.arange(1.0, 42.0))])
    head, body = path.read_text().split("\n")[:13], path.read_text().split("\n")[13:]
    body = [line.replace("e-", "D-").replace("e+", "D+").ljust(80) if "e" in line else line for line in body]
    path.write_text("\r\n".join(head + body))
    expected = -1e-3 * np.arange(1, 42) * (1 + 2j)
    np.testing.assert_allclose(read_file(path, True, LAYOUT).frf.responses[0].values, expected)


def test_uff_several_records_a_node(tmp_path):
    """X, Y and Z, coherence and power spectra of one node; only the model's channels are taken, each with its own."""
    level = {4: 1 + 1j, 6: 0.3, 2: 5.0}
    sets = [
        set58(
            func_type=function,
            rsp_dir=direction,
            data=np.full(40, direction * level[function]),
        )
        for direction in (1, 2, 3)
        for function in (2, 4, 6)
    ]
    contents = read_file(_uff(tmp_path, sets), True, LAYOUT)
    assert [r.name for r in contents.frf.responses] == ["tool_x", "tool_z"]
    np.testing.assert_allclose(contents.frf.responses[1].values, 3 + 3j)
    np.testing.assert_allclose(contents.frf.responses[1].coherence, 0.9)
    np.testing.assert_allclose(contents.frf.responses[0].coherence, 0.3)
    assert "(1, 2)" in contents.warnings[0]


def test_uff_negative_directions_turn_the_sign(tmp_path):
    sets = [set58(rsp_dir=-1, data=np.ones(40) * 1j), set58(rsp_dir=3, ref_dir=-1, data=np.ones(40) * 1j)]
    frf = read_file(_uff(tmp_path, sets), True, LAYOUT).frf
    np.testing.assert_allclose(frf.responses[0].values, -1j)
    np.testing.assert_allclose(frf.responses[1].values, -1j)


def test_uff_units_of_label_and_of_data_set_164(tmp_path):
    labelled = set58(ordinate_axis_units_lab="g", orddenom_axis_units_lab="N")
    assert read_file(_uff(tmp_path, [labelled]), True, LAYOUT).frf.responses[0].unit == "g/N"
    whole = set58(ordinate_axis_units_lab="g/N")
    assert read_file(_uff(tmp_path, [whole]), True, LAYOUT).frf.responses[0].unit == "g/N"
    millimetres = {
        "type": 164, "units_code": 5, "units_description": "mm", "temp_mode": 1,
        "length": 1000.0, "force": 1000.0, "temp": 1.0, "temp_offset": 0.0,
    }  # fmt: skip
    frf = read_file(_uff(tmp_path, [millimetres, set58(data=np.full(40, 2.0 + 0j))]), True, LAYOUT).frf
    np.testing.assert_allclose(frf.responses[0].values, 2.0)  # mm/s^2 per mN is m/s^2 per N
    long = millimetres | {"force": 1.0}
    frf = read_file(_uff(tmp_path, [long, set58(data=np.full(40, 2.0 + 0j))]), True, LAYOUT).frf
    np.testing.assert_allclose(frf.responses[0].values, 2e-3)


def test_uff_time_records_of_several_blows(tmp_path):
    time = np.arange(100) / 4096
    sets = [
        set58(
            func_type=1, x=time, data=100.0 * blow + np.arange(100.0), rsp_dir=direction, ref_node=0, ref_dir=0,
            abscissa_spec_data_type=17, ordinate_spec_data_type=kind, orddenom_spec_data_type=0,
        )
        for blow in (1, 2)
        for direction, kind in ((1, 13), (1, 12), (3, 12))
    ]  # fmt: skip
    histories = read_file(_uff(tmp_path, sets), False, LAYOUT).histories
    assert [h.fs for h in histories] == [4096.0, 4096.0]
    assert [s.name for s in histories[1].signals] == ["force", "tool_x", "tool_z"]
    assert histories[1].signals[0].values[0] == 200


def test_uff_time_records_on_an_uneven_axis_that_is_even(tmp_path):
    time = np.arange(100) * 0.001
    sets = [
        set58(
            func_type=1, x=time, data=np.arange(100.0), ref_node=0, ref_dir=0, abscissa_spacing=0,
            abscissa_spec_data_type=17, ordinate_spec_data_type=kind, orddenom_spec_data_type=0,
        )
        for kind in (13, 12)
    ]  # fmt: skip
    assert read_file(_uff(tmp_path, sets), False, LAYOUT).histories[0].fs == 1000.0


def test_layout_of_another_structure():
    machine = SimpleNamespace(
        channels={
            "y1": Channel("p1", "displacement"),
            "y2": Channel("p2", "velocity"),
            "a2": Channel("p2", "acceleration"),
        },
        input_port="p2",
        input_quantity="force",
        has_position=False,
    )  # fmt: skip
    assert layout_of(machine).nodes == {"y1": (1, None), "y2": (2, None), "a2": (2, None), "force": (2, None)}
    given = layout_of(machine, {"p1": 11, "p2": 12})
    assert given.nodes["y1"] == (11, None)
    assert given.nodes["force"] == (12, None)
    with pytest.raises(DataFormatError, match=r"dofs\.tip.*p1"):
        layout_of(machine, {"tip": 1})


def test_layout_of_the_cutting_machine():
    expected = {"force": (7, 1), "tool_x": (7, 1), "tool_z": (7, 3), "base_x": (2, 1)}
    assert layout_of(published_machine(), {"tool": 7}).nodes == expected


def test_uff_quantity_tells_channels_of_one_place_apart(tmp_path):
    machine = SimpleNamespace(
        channels={"d": Channel("p", "displacement"), "a": Channel("p", "acceleration")},
        input_port="p", input_quantity="force", has_position=False,
    )  # fmt: skip
    sets = [set58(ordinate_spec_data_type=12), set58(ordinate_spec_data_type=8)]
    frf = read_file(_uff(tmp_path, sets), True, layout_of(machine)).frf
    assert {r.name: r.unit for r in frf.responses} == {"d": "m/N", "a": "m/s^2/N"}


# --- TDMS, MAT, LVM --------------------------------------------------------------------------------------------------


def test_tdms_scaling_and_integers(tmp_path):
    path = tmp_path / "r.tdms"
    scale = {
        "NI_Number_Of_Scales": 1,
        "NI_Scale[0]_Scale_Type": "Linear",
        "NI_Scale[0]_Linear_Slope": 0.5,
        "NI_Scale[0]_Linear_Y_Intercept": 1.0,
        "NI_Scale[0]_Linear_Input_Source": 0xFFFFFFFF,
    }
    common = {"unit_string": "N", "wf_increment": 1e-3}
    with nptdms.TdmsWriter(path) as writer:
        for part in range(2):  # a recorder writes a segment a second
            values = np.arange(10, dtype=np.int16) + 10 * part
            writer.write_segment([nptdms.ChannelObject("g", "force", values, properties=common | scale)])
    (history,) = read_file(path, False, LAYOUT).histories
    assert history.fs == 1000.0
    np.testing.assert_allclose(history.signals[0].values, 1.0 + 0.5 * np.arange(20))


def test_mat_blows_as_rows_or_columns_and_units(tmp_path):
    blows = np.arange(60.0).reshape(20, 3)
    for turn in (blows, blows.T):
        savemat(tmp_path / "r.mat", {"fs": 1000.0, "force": turn, "tool_x": turn, "units": {"tool_x": "g"}})
        histories = read_file(tmp_path / "r.mat", False, LAYOUT).histories
        assert len(histories) == 3
        np.testing.assert_allclose(histories[1].signals[0].values, blows[:, 1])
        assert {s.name: s.unit for s in histories[0].signals} == {"force": "N", "tool_x": "g"}


def test_mat_of_version_7_3(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "r.mat", "w", userblock_size=512) as file:
        for name, values in {"fs": [[1000.0]], "force": [np.arange(30.0)], "tool_x": [np.arange(30.0)]}.items():
            variable = file.create_dataset(name, data=np.array(values))
            variable.attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "r.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    (history,) = read_file(tmp_path / "r.mat", False, LAYOUT).histories
    np.testing.assert_allclose(history.signals[0].values, np.arange(30.0))


@pytest.mark.parametrize("columns", ["One", "No"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_lvm_segments_are_blows(tmp_path, columns, decimal):
    contents = _read_one(tmp_path, lvm_text(2, columns, decimal), name="r.lvm")
    assert len(contents.histories) == 2
    last = contents.histories[1]
    assert last.fs == 1000.0
    assert [(s.name, s.unit) for s in last.signals] == [("force", "N"), ("tool_x", "g")]
    np.testing.assert_allclose(last.signals[0].values, 100 + np.arange(20))
    np.testing.assert_allclose(last.signals[1].values, -np.arange(20.0))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.lvm"]  # the library would leave a pickle


def test_lvm_pickle_beside_the_data_is_not_loaded(tmp_path):
    path = tmp_path / "r.lvm"
    path.write_text(lvm_text())
    hole = tmp_path / "hole"
    # a pickle that runs a command when it is loaded, as a hostile folder might hold
    (tmp_path / "r.lvm.pkl").write_bytes(f"cos\nsystem\n(S'touch {hole}'\ntR.".encode())
    assert len(read_file(path, False, LAYOUT).histories) == 2
    assert not hole.exists()


# --- time axes -------------------------------------------------------------------------------------------------------


@given(st.sampled_from([4000.0, 4096.0, 44100.0, 25600.0, 51200.0, 610.3515625, 131072.0, 1.0]), st.integers(6, 12))
def test_sampling_frequency_from_a_printed_step(fs, digits):
    step = float(f"{1 / fs:.{digits - 1}e}")
    assert sampling_frequency(step, max(1e-9, 5.1 * 10.0**-digits)) == pytest.approx(fs, rel=1e-12)


@given(st.floats(0.1, 1e6), st.integers(0, 5))
def test_sampling_frequency_stays_within_the_rounding(fs, start):
    assert sampling_frequency(1 / fs) == pytest.approx(fs, rel=1.1e-9)
    assert even_sampling(start + np.arange(50) / fs, "t") == pytest.approx(fs, rel=1e-4)


def test_uneven_time_beyond_rounding():
    rng = np.random.default_rng(0)
    time = np.arange(1000) * 1e-3 + rng.uniform(-1e-4, 1e-4, 1000)
    with pytest.raises(DataFormatError, match="uneven"):
        even_sampling(time, "t")
    lost = np.delete(np.arange(1000) * 1e-3, 500)  # a sample that was dropped
    with pytest.raises(DataFormatError, match="uneven"):
        even_sampling(lost, "t")


def test_history_and_record_refuse_what_does_not_fit():
    with pytest.raises(ParameterError, match="sampling frequency"):
        History(0.0, np.ones(3), np.ones((1, 3)), ("a",))
    with pytest.raises(ParameterError, match="shape"):
        History(1.0, np.ones(3), np.ones((2, 3)), ("a",))
    with pytest.raises(ParameterError, match="needs histories"):
        Record("r", "impact", None, None, None, ("a",), ("acceleration",))
    history = History(10.0, np.ones(20), np.ones((1, 20)), ("a",))
    assert history.duration == 2.0
    assert history.time[-1] == pytest.approx(1.9)
    with pytest.raises(ValueError, match="read-only"):
        history.force[0] = 2.0


def test_values_of_another_width_than_their_type_are_shown_as_read():
    body = b" -1.35548e-03 -2.17900e-01  4.00000e-02\n"
    with pytest.raises(DataFormatError, match=r"'-1.35548e-03 -2.179', where its .* says 20 characters"):
        uff_body._ascii(body, 6, True, "r.uff: dataset 58")
