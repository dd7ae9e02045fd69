"""Files as measuring systems write them, mapped by [channels]: the same three blows from each."""

import contextlib

import nptdms
import numpy as np
import pytest
from scipy.io import savemat

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement import read_campaign
from cutvib_ss.measurement.conversion import histories_of
from cutvib_ss.measurement.layout import layout_of
from cutvib_ss.measurement.reading import read_file
from cutvib_ss.measurement.schema import ChannelTable
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from tests.unit import lab_files as lab

ALL = ("tool_x", "tool_z", "base_x")


def _channels(*names, **more):
    lines = ["[channels]"]
    for channel, name in zip(("force", *ALL), names, strict=True):
        text = name if isinstance(name, int) else f'"{name}"'
        lines.append(f"{channel} = {{ name = {text}{more.get(channel, '')} }}")
    return "\n".join(lines) + "\n"


def _campaign(tmp_path, files, channels, kind="impact", extra=""):
    listed = ", ".join(f'"{file}"' for file in files)
    toml = f'[[record]]\nfile = [{listed}]\nkind = "{kind}"\nposition = 0.4\n{extra}' + channels
    (tmp_path / "campaign.toml").write_text(toml, encoding="utf-8")
    return read_campaign(tmp_path)


def _same(record, tables, rtol=1e-7):
    assert record.channels == ALL
    assert len(record.histories) == len(tables)
    for history, table in zip(record.histories, tables, strict=True):
        assert history.fs == pytest.approx(lab.FS, rel=1e-6)
        np.testing.assert_allclose(history.force, table[0], rtol=rtol, atol=1e-7)
        np.testing.assert_allclose(history.responses, table[1:], rtol=rtol, atol=1e-6)


@pytest.fixture(scope="module")
def tables():
    return lab.blows()


def _one_file_a_blow(tmp_path, tables, write, suffix, **options):
    names = []
    for k, table in enumerate(tables):
        names.append(f"blow_{k + 1}{suffix}")
        write(tmp_path / names[-1], table, **options)
    return names


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_german_csv(tmp_path, tables, encoding):
    files = _one_file_a_blow(tmp_path, tables, lab.german_csv, ".csv", encoding=encoding)
    _same(_campaign(tmp_path, files, _channels("Hammer", "Beschl 1", "Beschl 2", "Beschl 3")).records[0], tables)


def test_dewesoft_text(tmp_path, tables):
    files = _one_file_a_blow(tmp_path, tables, lab.dewesoft_csv, ".txt")
    names = ("AI 1/Hammer", "AI 2/Acc tool X", "AI 3/Acc tool Z", "AI 4/Acc base X")
    _same(_campaign(tmp_path, files, _channels(*names)).records[0], tables)


@pytest.mark.parametrize("days", [False, True])
def test_dewesoft_mat(tmp_path, tables, days):
    files = _one_file_a_blow(tmp_path, tables, lab.dewesoft_mat, ".mat", days=days)
    names = ("AI_1_Hammer", "AI_2_Acc_X", "AI_3_Acc_Z", "AI_4_Acc_base")
    _same(_campaign(tmp_path, files, _channels(*names)).records[0], tables)


def test_testlab_mat(tmp_path, tables):
    files = _one_file_a_blow(tmp_path, tables, lab.testlab_mat, ".mat")
    _same(_campaign(tmp_path, files, _channels("Hammer:+X", "Tool:+X", "Tool:+Z", "Base:+X")).records[0], tables)


def test_bk_mat(tmp_path, tables):
    files = _one_file_a_blow(tmp_path, tables, lab.bk_mat, ".mat")
    _same(_campaign(tmp_path, files, _channels("Hammer", "Tool X", "Tool Z", "Base X")).records[0], tables)


def test_structs_of_values_and_unit(tmp_path, tables):
    lab.struct_mat(tmp_path / "r.mat", tables)
    _same(_campaign(tmp_path, ["r.mat"], _channels("Hammer", "a_x", "a_z", "a_b")).records[0], tables)


@pytest.mark.parametrize("clock", ["dt", "t", "Time", "fs"])
def test_mat_with_any_clock_and_a_labelled_matrix(tmp_path, tables, clock):
    axis = {"dt": 1 / lab.FS, "t": lab.time_axis(), "Time": lab.time_axis()[:, np.newaxis], "fs": lab.FS}[clock]
    labels = np.array(["F", "1x", "1z", "2x"], dtype=object)
    savemat(tmp_path / "r.mat", {"data": tables[0].T, "labels": labels, clock: axis})
    _same(_campaign(tmp_path, ["r.mat"], _channels("F", "1x", "1z", "2x")).records[0], tables[:1])


def test_tdms_with_a_group_for_each_module(tmp_path, tables):
    files = _one_file_a_blow(tmp_path, tables, lab.tdms_by_sensor, ".tdms")
    channels = _channels("Mod1/Impact Hammer", "Mod2/Acc 1", "Mod2/Acc 2", "Mod2/Acc 3")
    _same(_campaign(tmp_path, files, channels).records[0], tables)


def test_tdms_with_a_group_for_each_blow_by_name_and_by_number(tmp_path, tables):
    lab.tdms_by_blow(tmp_path / "r.tdms", tables)
    _same(_campaign(tmp_path, ["r.tdms"], _channels("Force", "Acc1", "Acc2", "Acc3")).records[0], tables)
    _same(_campaign(tmp_path, ["r.tdms"], _channels(1, 2, 3, 4)).records[0], tables)


def test_lvm_under_the_users_names(tmp_path, tables):
    lab.lvm(tmp_path / "r.lvm", tables)
    names = ("Dev1_ai0 (Hammer)", "Dev1_ai1", "Dev1_ai2", "Dev1_ai3")
    _same(_campaign(tmp_path, ["r.lvm"], _channels(*names)).records[0], tables)


# --- frequency responses ---------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def responses():
    freq = np.arange(20.0, 300.0, 0.5)
    inputs = ["force", "head_x", "rail(0.25)"]
    data = frequency_response(published_machine(), [0.4], freq, inputs=inputs, outputs=ALL).data[0]
    return freq, data.transpose(1, 0, 2)


def test_testlab_frfs(tmp_path, responses):
    freq, data = responses
    lab.testlab_frf_mat(tmp_path / "r.mat", freq, data[0])
    names = '[channels]\ntool_x = "Tool:+X"\ntool_z = "Tool:+Z"\nbase_x = "Base:+X"\n'
    record = _campaign(tmp_path, ["r.mat"], names, "frf").records[0]
    np.testing.assert_allclose(record.frf.freq, freq)
    np.testing.assert_allclose(record.frf.data[0, :, 0], data[0])


def test_uff_without_dofs_is_answered_with_the_lines_that_map_it(tmp_path, responses):
    freq, data = responses
    lab.uff_frfs(tmp_path / "r.uff", freq, data[:1])
    with pytest.raises(DataFormatError) as caught:
        _campaign(tmp_path, ["r.uff"], "", "frf")
    message = str(caught.value)
    for words in ("101:+X", "101:+Z", "102:+X", "[dofs]", "tool = 101", "base = 102"):
        assert words in message, message
    record = _campaign(tmp_path, ["r.uff"], "[dofs]\ntool = 101\nbase = 102\n", "frf").records[0]
    np.testing.assert_allclose(record.frf.data[0, :, 0], data[0], rtol=1e-9)


def test_uff_mapped_by_name(tmp_path, responses):
    freq, data = responses
    lab.uff_frfs(tmp_path / "r.uff", freq, data[:1])
    names = '[channels]\nforce = "101:+X"\ntool_x = "101:+X"\ntool_z = "101Z"\nbase_x = "102:X"\n'
    record = _campaign(tmp_path, ["r.uff"], names, "frf").records[0]
    np.testing.assert_allclose(record.frf.data[0, :, 0], data[0], rtol=1e-9)


def test_uff_of_several_references_a_record_each(tmp_path, responses):
    freq, data = responses
    lab.uff_frfs(tmp_path / "r.uff", freq, data, references=((101, 1), (103, 1), (201, 1)))
    toml = ""
    for line in ("", 'input = "head_x"\n', 'input = "rail@0.25"\n'):
        toml += f'[[record]]\nfile = "r.uff"\nkind = "frf"\nposition = 0.4\n{line}'
    toml += '[dofs]\ntool = 101\nbase = 102\nhead = 103\n"rail@0.25" = 201\n'
    (tmp_path / "campaign.toml").write_text(toml)
    campaign = read_campaign(tmp_path)
    for record, expected, input_ in zip(campaign.records, data, (None, "head_x", "rail@0.25"), strict=True):
        assert record.input == input_
        np.testing.assert_allclose(record.frf.data[0, :, 0], expected, rtol=1e-9)
    assert any("of other inputs" in warning for warning in campaign.warnings)


def test_uff_of_several_references_that_nothing_tells_apart(tmp_path, responses):
    freq, data = responses
    lab.uff_frfs(tmp_path / "r.uff", freq, data[:2], references=((101, 1), (103, 1)))
    extra = 'input = "head_x"\n'
    with pytest.raises(DataFormatError, match=r"101:\+X, 103:\+X.*\[dofs\]"):
        _campaign(tmp_path, ["r.uff"], "[dofs]\ntool = 101\nbase = 102\n", "frf", extra)
    lab.uff_frfs(tmp_path / "r.uff", freq, data[1:2], references=((103, 1),))
    record = _campaign(tmp_path, ["r.uff"], "[dofs]\ntool = 101\nbase = 102\n", "frf", extra).records[0]
    np.testing.assert_allclose(record.frf.data[0, :, 0], data[1], rtol=1e-9)


# --- text tables -----------------------------------------------------------------------------------------------------


def _text(tmp_path, text, toml="", encoding="utf-8", channels="", kind="impact", name="r.csv"):
    (tmp_path / name).write_bytes(text.encode(encoding))
    return _campaign(tmp_path, [name], toml + channels, kind).records[0]


def _rows(separator=",", decimal=".", columns=3, samples=64, first=0.0):
    rng = np.random.default_rng(3)
    pulse = 30 * np.exp(-(((np.arange(samples) - 20) / 2) ** 2))
    noise = rng.standard_normal((samples, columns - 2))
    table = np.column_stack([first + np.arange(samples) / 1000, pulse, noise])
    rows = "\n".join(separator.join(f"{x:.9g}".replace(".", decimal) for x in row) for row in table)
    return table, rows + "\n"


@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (" ", "."), ("|", ",")]
)
def test_separators_and_decimals(tmp_path, separator, decimal):
    table, rows = _rows(separator, decimal)
    head = "time force tool_x" if separator == " " else separator.join(["time [s]", "force [N]", "tool_x [m/s^2]"])
    units = '[channels]\nforce = { unit = "N" }\ntool_x = { unit = "m/s^2" }\n'
    record = _text(tmp_path, head + "\n" + rows, channels=units)
    np.testing.assert_allclose(record.histories[0].force, table[:, 1], rtol=1e-7)
    np.testing.assert_allclose(record.histories[0].responses[0], table[:, 2], rtol=1e-7)


def test_no_headings_at_all(tmp_path):
    table, rows = _rows()
    names = '[channels]\nforce = { name = 1, unit = "N" }\ntool_x = { name = 2, unit = "g" }\n'
    record = _text(tmp_path, rows, channels=names)
    np.testing.assert_allclose(record.histories[0].responses[0], 9.80665 * table[:, 2], rtol=1e-7)


def test_time_anywhere_and_in_milliseconds(tmp_path):
    table, _ = _rows()
    lines = ["force [N],tool_x [m/s^2],Time [ms]"] + [f"{f:.9g},{a:.9g},{1e3 * t:.9g}" for t, f, a in table]
    record = _text(tmp_path, "\n".join(lines))
    assert record.histories[0].fs == pytest.approx(1000.0)
    np.testing.assert_allclose(record.histories[0].force, table[:, 1], rtol=1e-7)


def test_time_column_stated(tmp_path):
    table, rows = _rows()
    record = _text(tmp_path, "Clock A,force [N],tool_x [g]\n" + rows, '[csv]\ntime = "clock a"\n')
    np.testing.assert_allclose(record.histories[0].force, table[:, 1], rtol=1e-7)


def test_sampling_frequency_from_the_head(tmp_path):
    table, _ = _rows()
    lines = ["Sampling rate: 1.0 kHz", "force [N];tool_x [g]"] + [f"{f:.9g};{a:.9g}" for _, f, a in table]
    assert _text(tmp_path, "\n".join(lines)).histories[0].fs == 1000.0


def test_head_that_holds_numbers_and_a_stated_number_of_lines(tmp_path):
    table, rows = _rows()
    head = "1,2,3\n4,5,6\n"
    record = _text(tmp_path, head + "time [s],force [N],tool_x [g]\n" + rows, "[csv]\nheader_lines = 2\n")
    np.testing.assert_allclose(record.histories[0].force, table[:, 1], rtol=1e-7)
    # the headings counted, too
    record = _text(tmp_path, "a\nb\n" + "time [s],force [N],tool_x [g]\n" + rows, "[csv]\nheader_lines = 3\n")
    np.testing.assert_allclose(record.histories[0].force, table[:, 1], rtol=1e-7)


def test_separators_at_row_ends_quotes_and_an_empty_column(tmp_path):
    table, _ = _rows()
    lines = ['"time [s]";"force [N]";"spare";"tool_x [g]";']
    lines += [f'"{t:.9g}";"{f:.9g}";;"{a:.9g}";'.replace(".", ",") for t, f, a in table]
    (tmp_path / "r.csv").write_text("\n".join(lines))
    campaign = _campaign(tmp_path, ["r.csv"], "")
    np.testing.assert_allclose(campaign.records[0].histories[0].force, table[:, 1], rtol=1e-7)
    assert any("'spare' is empty" in warning for warning in campaign.warnings)


def test_tabs_at_row_ends(tmp_path):
    table, _ = _rows()
    lines = ["time [s]\tforce [N]\ttool_x [g]\t"] + [f"{t:.9g}\t{f:.9g}\t{a:.9g}\t" for t, f, a in table]
    record = _text(tmp_path, "\n".join(lines))
    np.testing.assert_allclose(record.histories[0].force, table[:, 1], rtol=1e-7)


def test_a_time_column_before_each_channel(tmp_path):
    table, _ = _rows()
    lines = ["time [s];force [N];time [s];tool_x [g]"] + [f"{t:.9g};{f:.9g};{t:.9g};{a:.9g}" for t, f, a in table]
    assert _text(tmp_path, "\n".join(lines)).channels == ("tool_x",)


def test_an_empty_column_that_is_missed_is_named(tmp_path):
    table, _ = _rows()
    lines = ["time [s];force [N];tool_x [g]"] + [f"{t:.9g};{f:.9g};" for t, f, _ in table]
    for toml in ("", '[channels]\ntool_x = { name = "tool_x" }\n'):
        with pytest.raises(DataFormatError, match="column 'tool_x' is empty"):
            _text(tmp_path, "\n".join(lines), channels=toml)


def test_columns_of_text_beside_the_numbers(tmp_path):
    table, _ = _rows()
    lines = ["Date;time [s];force [N];tool_x [g];Remark"]
    lines += [f"12.03.2024 10:14:05,{k:03d};{t:.9g};{f:.9g};{a:.9g};good" for k, (t, f, a) in enumerate(table)]
    (tmp_path / "r.csv").write_text("\n".join(lines))
    campaign = _campaign(tmp_path, ["r.csv"], "")
    np.testing.assert_allclose(campaign.records[0].histories[0].force, table[:, 1], rtol=1e-7)
    assert any("'Date'" in warning and "no numbers" in warning for warning in campaign.warnings)


def test_tdms_channels_of_text_and_without_a_clock_are_passed_over(tmp_path, tables):
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        properties = {"wf_increment": 1 / lab.FS, "unit_string": "N"}
        writer.write_segment(
            [
                nptdms.ChannelObject("g", "force", tables[0][0], properties=properties),
                nptdms.ChannelObject("g", "tool_x", tables[0][1], properties={**properties, "unit_string": "m/s^2"}),
                nptdms.ChannelObject("g", "remark", ["good"] * 5, properties={}),
            ]
        )
    campaign = _campaign(tmp_path, ["r.tdms"], "")
    assert campaign.records[0].channels == ("tool_x",)
    assert any("'remark'" in warning and "left out" in warning for warning in campaign.warnings)


def test_tdms_with_a_time_channel(tmp_path, tables):
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        columns = {"Time": lab.time_axis(), "force (N)": tables[0][0], "tool_x (m/s²)": tables[0][1]}
        writer.write_segment([nptdms.ChannelObject("g", name, values) for name, values in columns.items()])
    record = _campaign(tmp_path, ["r.tdms"], "").records[0]
    assert record.histories[0].fs == lab.FS
    np.testing.assert_allclose(record.histories[0].force, tables[0][0])


def test_structs_in_a_file_of_version_7_3(tmp_path, tables):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "r.mat", "w", userblock_size=512) as file:

        def put(where, name, values, kind="double"):
            variable = where.create_dataset(name, data=values)
            variable.attrs["MATLAB_class"] = np.bytes_(kind)

        put(file, "dt", np.array([[1 / lab.FS]]))
        for name, row, unit in zip(("force", *ALL), tables[0], ("N", "m/s^2", "m/s^2", "m/s^2"), strict=True):
            struct = file.create_group(name)
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
            put(struct, "values", row[np.newaxis])
            put(struct, "unit", np.array([[ord(c)] for c in unit], dtype=np.uint16), "char")
    with (tmp_path / "r.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")
    _same(_campaign(tmp_path, ["r.mat"], "").records[0], tables[:1])


def test_magnitude_and_phase_and_kilohertz(tmp_path):
    freq = np.linspace(0.02, 0.06, 40)
    h = (1 + 0.1 * freq) * np.exp(1j * 10 * freq)
    lines = ["Frequency (kHz);Tool X mag (m/s²/N);Tool X phase (deg)"]
    lines += [f"{f:.9g};{abs(x):.9g};{np.degrees(np.angle(x)):.9g}" for f, x in zip(freq, h, strict=True)]
    names = '[channels]\ntool_x = "Tool X"\n'
    record = _text(tmp_path, "\n".join(lines), channels=names, kind="frf")
    np.testing.assert_allclose(record.frf.freq, 1e3 * freq)
    np.testing.assert_allclose(record.frf.data[0, 0, 0], h, rtol=1e-7)


@pytest.mark.parametrize(
    ("text", "toml", "words"),
    [
        ("time [s];force [N];tool_x [g]\n0;1;\n0,001;2;\n0,002;3;\n", "", ["r.csv"]),
        ("a b c\nd e f\n", "", ["not numeric"]),
        ("time [s],force [N],tool_x [g]\n0,1,2\n0.001,1,2\n", "", ["2 samples"]),
        ("time [s],hammer [N],acc [g]\n" + _rows()[1], "", ["'hammer'", "[channels]", "force = { name"]),
        ("time [s],force [V],tool_x [g]\n" + _rows()[1], "", ["'V'", "[channels]", "gain"]),
        ("time [s],force [N],tool_x [g]\n" + _rows()[1], '[csv]\ntime = "clock"\n', ["'clock'", "'time'"]),
        ("\xe4\n".encode("utf-16").decode("latin-1") + "\0", "", ["r.csv"]),
    ],
)
def test_what_cannot_be_used(tmp_path, text, toml, words):
    with pytest.raises(DataFormatError) as caught:
        _text(tmp_path, text, toml, "latin-1")
    for word in ("r.csv", *words):
        assert word in str(caught.value), str(caught.value)


def test_names_that_differ_by_case_and_signs_alone(tmp_path):
    table, rows = _rows()
    record = _text(tmp_path, "Time [s],FORCE [N],Tool X [g]\n" + rows)
    np.testing.assert_allclose(record.histories[0].responses[0], 9.80665 * table[:, 2], rtol=1e-7)


@pytest.mark.parametrize(
    "write", [lab.german_csv, lab.dewesoft_csv, lab.lvm, lab.tdms_by_blow], ids=lambda w: w.__name__
)
def test_damaged_files_are_refused_or_read_but_never_a_fault(tmp_path, tables, write):
    """Bytes changed, cut out and cut off anywhere: a DataFormatError, or numbers."""
    rng = np.random.default_rng(11)
    suffix = {"german_csv": ".csv", "dewesoft_csv": ".txt", "lvm": ".lvm", "tdms_by_blow": ".tdms"}[write.__name__]
    path = tmp_path / f"r{suffix}"
    write(path, tables[:1] if write in (lab.lvm, lab.tdms_by_blow) else tables[0])
    whole = path.read_bytes()
    layout = layout_of(published_machine())
    channels = {name: ChannelTable(name=k) for k, name in enumerate(("force", *ALL), start=1)}
    for _ in range(25):
        content = bytearray(whole)
        at = int(rng.integers(len(content) if rng.random() < 0.5 else 400))
        match int(rng.integers(3)):
            case 0:
                content = content[:at]
            case 1:
                content[at] = int(rng.integers(256))
            case _:
                del content[at : at + int(rng.integers(1, 60))]
        path.write_bytes(bytes(content))
        with contextlib.suppress(DataFormatError):
            for history in histories_of(read_file(path, False, layout, channels), layout, path.name):
                assert np.all(np.isfinite(history.responses))
