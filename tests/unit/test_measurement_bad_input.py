"""What cannot be used is refused with the file, what is wrong, and how to mend it."""

import nptdms
import numpy as np
import pytest
import pyuff
from scipy.io import savemat

from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement import Campaign, Record, read_campaign
from cutvib_ss.measurement.campaign import write_campaign
from cutvib_ss.measurement.formats import FORMATS
from cutvib_ss.measurement.formats.raw import Contents, Layout
from cutvib_ss.measurement.summary import summarise
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel
from tests.unit.measurement_rig import OneMass, lvm_text, small_campaign

RECORD = '[[record]]\nfile = "r.csv"\nkind = "impact"\nposition = 0.3\n'


def _refused(folder, *words, machine=None):
    """Reading the campaign fails with one line that holds these words."""
    with pytest.raises(DataFormatError) as caught:
        read_campaign(folder, machine)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
    return message


def _campaign(tmp_path, toml=RECORD, csv=None, **files):
    (tmp_path / "campaign.toml").write_text(toml, encoding="utf-8")
    (tmp_path / "r.csv").write_text(_csv() if csv is None else csv, encoding="utf-8")
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def _csv(head="time [s],force [N],tool_x [m/s^2]", samples=200, change=None):
    rng = np.random.default_rng(0)
    force = 40 * np.exp(-(((np.arange(samples) - 60) / 3.0) ** 2))
    table = np.column_stack([np.arange(samples) / 1000, force, rng.standard_normal(samples)])
    if change is not None:
        change(table)
    return head + "\n" + "\n".join(",".join(f"{x:.10g}" for x in row) for row in table) + "\n"


def _frf_csv(head="freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N],tool_x coherence", change=None):
    table = np.column_stack([np.arange(50.0), np.ones(50), np.linspace(0, 1, 50), np.full(50, 0.9)])
    if change is not None:
        change(table)
    return head + "\n" + "\n".join(",".join(f"{x:.10g}" for x in row) for row in table) + "\n"


FRF_RECORD = RECORD.replace("impact", "frf")


def test_the_campaign_that_the_bad_ones_are_made_of_is_good(tmp_path):
    assert len(read_campaign(_campaign(tmp_path)).records) == 1


def test_a_record_without_response_is_left_out_where_another_tells(tmp_path):
    """A soft blow may be less than a step of a coarse converter."""
    empty = _csv(change=lambda t: t.__setitem__((slice(None), 2), 0.0))
    folder = _campaign(tmp_path, RECORD + RECORD.replace("r.csv", "soft.csv"), **{"soft.csv": empty.encode()})
    read = read_campaign(folder)
    assert [record.name for record in read.records] == ["r.csv"]
    [said] = [w for w in read.warnings if "left out" in w]
    assert said.startswith(f"{folder / 'soft.csv'}: ")
    assert "every response channel is constant" in said
    assert len(read_campaign(_campaign(tmp_path, FRF_RECORD, _frf_csv()), None).records) == 1


# --- campaign.toml ---------------------------------------------------------------------------------------------------


def test_missing_campaign(tmp_path):
    _refused(tmp_path, "campaign.toml", "no such file")
    _refused(tmp_path / "nowhere", "no such file")


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        ("[campaign\n", ["not valid TOML"]),
        ("", ["no [[record]]"]),
        ('[campaign]\ntitle = "t"\n', ["no [[record]]"]),
        (RECORD + "colour = 1\n", ["record[1].colour", "unknown key"]),
        ("[campaign]\nowner = 1\n" + RECORD, ["campaign.owner", "unknown key"]),
        (RECORD + RECORD.replace("kind", "kin"), ["record[2].kin", "unknown key"]),
        (RECORD + "[extra]\n", ["extra", "unknown key"]),
        (RECORD.replace('kind = "impact"\n', ""), ["record[1].kind", "missing"]),
        (RECORD.replace('file = "r.csv"\n', ""), ["record[1].file", "missing"]),
        (RECORD.replace("impact", "hammer"), ["record[1].kind", "'impact', 'frf' or 'timeseries'"]),
        (RECORD + 'use = "train"\n', ["record[1].use"]),
        (RECORD.replace("0.3", "0"), ["record[1].position", "strictly inside (0, 1)"]),
        (RECORD.replace("0.3", "0.0"), ["record[1].position", "strictly inside (0, 1)"]),
        (RECORD.replace("0.3", "1.2"), ["record[1].position = 1.2", "strictly inside (0, 1)"]),
        (RECORD.replace("0.3", "1.0"), ["record[1].position", "strictly inside (0, 1)"]),
        (RECORD.replace("0.3", "nan"), ["record[1].position"]),
        (RECORD.replace("0.3", '"0.3"'), ["record[1].position"]),
        (RECORD.replace("position = 0.3\n", ""), ["record[1].position", "missing"]),
        (RECORD + "peak_force = -3\n", ["record[1].peak_force"]),
        (RECORD + "peak_force = inf\n", ["record[1].peak_force"]),
        (RECORD + "averages = 0\n", ["record[1].averages"]),
        (RECORD + "averages = 2.5\n", ["record[1].averages"]),
        (RECORD + "block = 0\n", ["record[1].block"]),
        (RECORD + "exponential_decay = -1\n", ["record[1].exponential_decay"]),
        (RECORD + 'excitation = "shaker"\n', ["record[1].excitation"]),
        (RECORD.replace('"r.csv"', "[]"), ["record[1].file", "at least one file"]),
        (RECORD.replace('"r.csv"', '["r.csv", "r.csv"]'), ["record[1].file", "twice"]),
        (RECORD.replace('"r.csv"', "3"), ["record[1].file"]),
        (RECORD + "[dofs]\ntip = 3\n", ["dofs.tip", "tool"]),
        (RECORD + '[dofs]\ntool = "one"\n', ["dofs.tool"]),
        (RECORD.replace("r.csv", "absent.csv"), ["absent.csv", "no such file"]),
        (RECORD.replace("r.csv", "r.wav"), ["r.wav", ".wav", ".tdms"]),
        (RECORD.replace("r.csv", "r"), ["is not read", ".tdms"]),
        ('[campaign]\nmachine = "absent.toml"\n' + RECORD, ["absent.toml", "no such file"]),
        ("record = 3\n", ["record"]),
    ],
)
def test_campaign_file(tmp_path, toml, words):
    _refused(_campaign(tmp_path, toml), *words)


def test_position_for_a_model_without(tmp_path):
    folder = _campaign(tmp_path, csv=_csv("time [s],force [N],a [m/s^2]"))
    _refused(folder, "record[1].position", "has no position", machine=OneMass())


def test_campaign_file_that_is_no_text(tmp_path):
    (tmp_path / "campaign.toml").write_bytes(b"\xff\xfe\x00")
    _refused(tmp_path, "not valid TOML")


# --- time records ----------------------------------------------------------------------------------------------------


def _set(row, column, value):
    def change(table):
        table[row, column] = value

    return change


@pytest.mark.parametrize(
    ("csv", "words"),
    [
        ("", ["r.csv", "empty"]),
        ("time [s],force [N],tool_x [m/s^2]\n", ["r.csv", "no rows"]),
        (_csv(samples=2), ["2 samples"]),
        (_csv(samples=1), ["1 sample"]),
        (_csv(change=_set(3, 2, np.nan)), ["'tool_x'", "NaN or Inf at sample 4"]),
        (_csv(change=_set(5, 1, np.inf)), ["'force'", "NaN or Inf at sample 6"]),
        (_csv(change=_set(5, 0, np.nan)), ["time column"]),
        (_csv(change=_set(5, 0, 0.004)), ["time does not increase at sample 6"]),
        (_csv(change=_set(5, 0, 0.0055)), ["uneven"]),
        (_csv(change=_set(5, 2, 2e6)), ["'tool_x'", "2e+06", "no measurement"]),
        (_csv("time [s],force [N],tool_x [mm]"), ["'tool_x'", "'mm'", "displacement", "m/s^2"]),
        (_csv("time [s],force [g],tool_x [m/s^2]"), ["'force'", "'g'", "acceleration"]),
        (_csv("time [s],force [N],tool_x [V/V]"), ["'V/V'", "not read"]),
        (_csv("time [s],force [V],tool_x [m/s^2]"), ["'V'", "not read"]),
        (_csv("time [s],force [N],tool_x"), ["'tool_x'", "no unit"]),
        (_csv("time [s],force [N],tip_x [m/s^2]"), ["'tip_x'", "not known", "tool_x, tool_z, base_x"]),
        (_csv("time [s],force [N],force [N]"), ["'force'", "2 times"]),
        (_csv("time [s],tool_z [m/s^2],tool_x [m/s^2]"), ["no channel 'force'"]),
        (_csv("time [s],force [N],blow"), ["blow 0.12573", "1 sample"]),
        (_csv("time [s],force [N],blow", change=lambda t: t.__setitem__((slice(None), 2), 1)), ["no response channel"]),
        (_csv("time [h],force [N],tool_x [m/s^2]"), ["`time [s]`"]),
        (_csv("force [N],clock,tool_x [m/s^2]"), ["`time [s]`", "'clock'", "[csv]"]),
        (_csv("time [s];force [N];tool_x [m/s^2]"), ["r.csv", "3 columns", "names 1"]),
        (_csv("time [s],force [N]"), ["3 columns", "names 2"]),
        (_csv().rstrip("\n").rsplit(",", 1)[0] + "\n", ["truncated"]),
        (_csv() + "0.2,1\n", ["truncated"]),
        (_csv() + "0.2,abc,1\n", ["not numeric"]),
        (_csv(change=lambda t: t.__setitem__((slice(None), 1), 0.0)), ["force is constant (zero)"]),
        (_csv(change=lambda t: t.__setitem__((slice(None), 2), 1.0)), ["every response channel is constant"]),
        (_frf_csv(), ["`time [s]`"]),
    ],
)
def test_time_record(tmp_path, csv, words):
    _refused(_campaign(tmp_path, csv=csv), "r.csv", *words)


def test_csv_that_is_no_text(tmp_path):
    folder = _campaign(tmp_path)
    (folder / "r.csv").write_bytes(bytes(range(256)) * 10)
    _refused(folder, "r.csv", "not a CSV text file")


def test_blows_with_different_channels_or_rates(tmp_path):
    toml = RECORD.replace('"r.csv"', '["r.csv", "s.csv"]')
    other = _csv("time [s],force [N],tool_z [m/s^2]").encode()
    _refused(_campaign(tmp_path, toml, **{"s.csv": other}), "every blow of a record needs the same")
    faster = _csv(change=lambda t: t.__setitem__((slice(None), 0), t[:, 0] / 2)).encode()
    _refused(_campaign(tmp_path, toml, **{"s.csv": faster}), "2000 Hz", "1000 Hz")


# --- frequency responses ---------------------------------------------------------------------------------------------

_FRF_HEAD = "freq [Hz],tool_x re [{0}],tool_x im [{0}],tool_x coherence"


def _never_moved(table):
    table[:, 1:3], table[:, 3] = 0.0, np.nan


@pytest.mark.parametrize(
    ("csv", "words"),
    [
        (_frf_csv(change=_set(3, 3, 1.2)), ["coherence", "1.2", "0 to 1"]),
        (_frf_csv(change=_set(3, 3, -0.1)), ["coherence", "0 to 1"]),
        (_frf_csv(change=_set(3, 3, np.nan)), ["coherence", "NaN"]),
        (_frf_csv(change=_set(3, 1, np.nan)), ["'tool_x'", "NaN or Inf at line 4"]),
        (_frf_csv(change=_set(3, 0, 1.0)), ["lines ", " are both of 1 Hz", "leave one out"]),
        (_frf_csv(change=_set(0, 0, -1.0)), ["line 1 is -1", "from 0 Hz up"]),
        (_frf_csv(change=_set(3, 0, -1.0)), ["line 4 is -1", "from 0 Hz up"]),
        (_frf_csv(_FRF_HEAD.format("V/V")), ["'V/V'", "m/s^2/N"]),
        (_frf_csv(_FRF_HEAD.format("m/N")), ["'m'", "displacement"]),
        (_frf_csv(_FRF_HEAD.format("m/s^2/g")), ["'g'", "force"]),
        (_frf_csv(_FRF_HEAD.format("m/s^2")), ["'m/s^2'", "per input"]),
        (_frf_csv("freq [Hz],tool_x re,tool_x im,tool_x coherence"), ["no unit"]),
        (_frf_csv("freq [Hz],tool_x re [g/N],tool_x im [m/s^2/N],tool_x coherence"), ["one unit"]),
        (_frf_csv("freq [Hz],tool_x re [g/N],tool_z im [g/N],tool_x coherence"), ["tool_x im"]),
        (_frf_csv("freq [Hz],tool_x re [g/N],tool_x im [g/N],tool_x phase"), ["'tool_x phase'"]),
        (_frf_csv("freq [Hz],tip re [g/N],tip im [g/N],tip coherence"), ["'tip'", "not known"]),
        (_frf_csv("freq [rpm],tool_x re [g/N],tool_x im [g/N],tool_x coherence"), ["`freq [Hz]`"]),
        ("\n".join(_frf_csv().split("\n")[:3]) + "\n", ["2 frequency lines"]),
        (_frf_csv(change=lambda t: t.__setitem__((slice(None), slice(1, 3)), 0.0)), ["zero throughout"]),
        # Coherence of a channel that never moved is 0/0: the channel is what has to be named.
        (_frf_csv(change=_never_moved), ["zero throughout"]),
        (_csv(), ["`freq [Hz]`"]),
    ],
)
def test_frequency_response(tmp_path, csv, words):
    _refused(_campaign(tmp_path, FRF_RECORD, csv), "r.csv", *words)


def test_files_of_one_frf_record_must_fit(tmp_path):
    toml = FRF_RECORD.replace('"r.csv"', '["r.csv", "s.csv"]')
    _refused(_campaign(tmp_path, toml, _frf_csv(), **{"s.csv": _frf_csv().encode()}), "s.csv", "another file")
    other = _frf_csv().replace("tool_x", "tool_z")
    folder = _campaign(tmp_path, toml, _frf_csv(), **{"s.csv": other.encode()})
    assert read_campaign(folder).records[0].channels == ("tool_x", "tool_z")
    shifted = _frf_csv(change=lambda t: t.__setitem__((slice(None), 0), t[:, 0] + 0.5)).replace("tool_x", "tool_z")
    _refused(_campaign(tmp_path, toml, _frf_csv(), **{"s.csv": shifted.encode()}), "s.csv", "frequency axis")


# --- binary formats --------------------------------------------------------------------------------------------------


def _written(tmp_path, format_, kind="impact"):
    campaign = small_campaign(tmp_path, kind)
    return write_campaign(campaign, tmp_path / "c", format=format_).parent, tmp_path / "c" / "records" / f"p1.{format_}"


@pytest.mark.parametrize("format_", ["tdms", "uff", "mat"])
@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.95])
def test_truncated_file(tmp_path, format_, share):
    folder, file = _written(tmp_path, format_)
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    _refused(folder, file.name)


@pytest.mark.parametrize("cut", [1, 2, 3, 8, 100])
def test_truncated_by_a_few_bytes(tmp_path, cut):
    folder, file = _written(tmp_path, "tdms")
    file.write_bytes(file.read_bytes()[:-cut])
    _refused(folder, "p1.tdms", "truncated")


@pytest.mark.parametrize("format_", ["tdms", "uff", "mat"])
@pytest.mark.parametrize("content", [b"", b"not this format at all\n" * 30, bytes(range(256)) * 20])
def test_file_of_another_format(tmp_path, format_, content):
    folder, file = _written(tmp_path, format_)
    file.write_bytes(content)
    _refused(folder, file.name)


def _tdms(path, *channels, group="g"):
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject(group, n, v, properties=p) for n, v, p in channels])


def _tdms_campaign(tmp_path, *channels):
    (tmp_path / "campaign.toml").write_text(RECORD.replace("r.csv", "r.tdms"))
    _tdms(tmp_path / "r.tdms", *channels)
    return tmp_path


def test_tdms_channels_of_different_length_step_or_none(tmp_path):
    values = np.sin(np.arange(100.0))
    newton, metres = {"unit_string": "N", "wf_increment": 1e-3}, {"unit_string": "m/s^2", "wf_increment": 1e-3}
    force = ("force", values, newton)
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", values[:-1], metres)), "different lengths")
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", values, metres | {"wf_increment": 2e-3})), "time steps")
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", values, {"unit_string": "m/s^2"})), "wf_increment")
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", values, metres | {"wf_increment": 0.0})), "wf_increment")
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", values, {"wf_increment": 1e-3})), "names no unit")
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", ["a"] * 100, metres)), "not numbers")
    _refused(_tdms_campaign(tmp_path, force, ("tool_x", values, metres | {"unit_string": "Volts"})), "'Volts'")
    _refused(_tdms_campaign(tmp_path, ("force", values[:5], newton), ("tool_x", values[:5], metres)), "5 samples")


def test_tdms_without_groups_and_as_frequency_responses(tmp_path):
    (tmp_path / "campaign.toml").write_text(RECORD.replace("r.csv", "r.tdms"))
    with nptdms.TdmsWriter(tmp_path / "r.tdms") as writer:
        writer.write_segment([nptdms.RootObject({"title": "t"})])
    _refused(tmp_path, "no time record")
    (tmp_path / "campaign.toml").write_text(FRF_RECORD.replace("r.csv", "r.tdms"))
    _refused(tmp_path, "TDMS holds time records")


def test_tdms_with_damaged_names_leaves_one_line(tmp_path, capfd):
    """The library would print what it found between the names, as long as it is."""
    folder, file = _written(tmp_path, "tdms")
    content = file.read_bytes()
    file.write_bytes(content.replace(b"tool_x", b"tool\xff\xfe"))
    _refused(folder, "p1.tdms")
    assert capfd.readouterr() == ("", "")


def test_tdms_that_its_recorder_did_not_close(tmp_path):
    folder, file = _written(tmp_path, "tdms")
    content = bytearray(file.read_bytes())
    content[12:20] = b"\xff" * 8
    file.write_bytes(content)
    _refused(folder, "p1.tdms", "before it closed")


def test_uff_frequency_responses_of_another_node_or_twice(tmp_path):
    sets = [
        pyuff.prepare_58(
            binary=0, func_type=4, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, load_case_id=0, abscissa_spacing=1,
            abscissa_spec_data_type=18, ordinate_spec_data_type=12, orddenom_spec_data_type=13, z_axis_spec_data_type=0,
            x=np.arange(50.0), data=np.ones(50) * (1 + 1j),
        )
        for _ in range(2)
    ]  # fmt: skip

    def folder(*data_sets, dofs="", record=FRF_RECORD):
        pyuff.UFF(str(tmp_path / "r.uff")).write_sets(list(data_sets), mode="overwrite")
        (tmp_path / "campaign.toml").write_text(record.replace("r.csv", "r.uff") + dofs)
        return tmp_path

    assert read_campaign(folder(sets[0])).records[0].channels == ("tool_x",)
    _refused(folder(*sets), "data sets 1 and 2", "'tool_x'", "split it")
    _refused(folder(sets[0], dofs="[dofs]\ntool = 5\n"), "node 5", "[dofs]")
    _refused(folder(sets[0] | {"rsp_dir": 2}), "at the node and direction of a channel", "[dofs]")
    _refused(folder(sets[0] | {"ordinate_spec_data_type": 8}), "displacement", "acceleration")
    _refused(folder(sets[0] | {"ordinate_spec_data_type": 0}), "names no unit")
    _refused(folder(sets[0] | {"ordinate_axis_units_lab": "mm"}), "'mm'")
    _refused(folder(sets[0], sets[1] | {"rsp_dir": 3, "x": np.arange(50) * 2.0}), "different frequency axes")
    coherence = sets[1] | {"func_type": 6, "data": np.ones(49), "x": np.arange(49.0)}
    _refused(folder(sets[0], coherence), "49 lines")
    _refused(folder(sets[0], record=RECORD), "no time record", "kind")
    time = sets[0] | {"func_type": 1, "data": np.sin(np.arange(50.0)), "abscissa_spec_data_type": 17}
    _refused(folder(time, record=RECORD), "no channel 'force'")
    _refused(folder(time, record=FRF_RECORD), "no frequency response")
    force = time | {"ordinate_spec_data_type": 13}
    _refused(folder(force, time, time, record=RECORD), "different numbers of time records")
    _refused(folder(force, time | {"x": np.arange(50) * 2.0}, record=RECORD), "different sampling frequencies")


def test_uff_without_data_set_58(tmp_path):
    (tmp_path / "campaign.toml").write_text(FRF_RECORD.replace("r.csv", "r.uff"))
    (tmp_path / "r.uff").write_text("    -1\n   151\nmodel\n    -1\n")
    _refused(tmp_path, "r.uff", "no data set 58")


def test_uff_number_that_is_none(tmp_path):
    folder, file = _written(tmp_path, "uff")
    text = file.read_text().split("\n")
    text[13] = "   not-a-number" + text[13][15:]
    file.write_text("\n".join(text))
    _refused(folder, "p1.uff", "not a number")


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ({"force": np.ones(50), "tool_x": np.ones(50)}, ["no variable `fs`"]),
        ({"fs": -1.0, "force": np.ones(50), "tool_x": np.ones(50)}, ["`fs`", "positive"]),
        ({"fs": [1.0, 2.0], "force": np.ones(50), "tool_x": np.ones(50)}, ["`fs`"]),
        ({"fs": 1e3, "force": np.ones(50), "tool_x": np.ones(40)}, ["different (samples, blows)"]),
        ({"fs": 1e3, "force": np.ones(50), "tool_x": "text"}, ["'tool_x'", "numbers"]),
        ({"fs": 1e3, "force": np.ones(50), "tool_x": 1j * np.ones(50)}, ["complex"]),
        ({"fs": 1e3, "force": np.ones(50), "tip": np.ones(50)}, ["'tip'", "not known"]),
        ({"fs": 1e3, "force": np.ones(50), "tool_x": np.ones(50), "units": 3.0}, ["`units`"]),
        ({"fs": 1e3, "force": np.ones(50), "tool_x": np.ones(50), "units": {"tool_x": 3.0}}, ["units.tool_x"]),
        ({"fs": 1e3, "force": np.ones(50), "tool_x": np.ones(50), "units": {"tool_x": "mm"}}, ["'mm'"]),
        ({"fs": 1e3}, ["no time record"]),
    ],
)
def test_mat_time_record(tmp_path, variables, words):
    (tmp_path / "campaign.toml").write_text(RECORD.replace("r.csv", "r.mat"))
    savemat(tmp_path / "r.mat", variables)
    _refused(tmp_path, "r.mat", *words)


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        ({"tool_x": np.ones(50) * 1j}, ["no variable `freq`"]),
        ({"freq": np.arange(50.0), "tool_x": np.ones(40) * 1j}, ["40 values"]),
        ({"freq": np.arange(50.0), "tool_x_coherence": np.ones(50)}, ["belongs to no variable"]),
        ({"freq": np.arange(50.0)}, ["no frequency response"]),
    ],
)
def test_mat_frequency_response(tmp_path, variables, words):
    (tmp_path / "campaign.toml").write_text(FRF_RECORD.replace("r.csv", "r.mat"))
    savemat(tmp_path / "r.mat", variables)
    _refused(tmp_path, "r.mat", *words)


def test_lvm(tmp_path):
    (tmp_path / "campaign.toml").write_text(RECORD.replace("r.csv", "r.lvm"))
    good = lvm_text(1)
    for text, words in (
        ("\n".join(good.split("\n")[:-8]), ["truncated", "13 of 20"]),
        ("nothing of the kind\n", ["r.lvm"]),
        (good.replace("Samples\t20\t20", "Samples\t20\t19"), ["different lengths"]),
        (good.replace("0.001000\t0.001000", "0.001000\t0.002000"), ["Delta_X"]),
        (good.replace("0.001000\t0.001000", "0\t0"), ["Delta_X"]),
        (good.replace("X_Dimension\tTime", "X_Dimension\tFrequency"), ["Frequency"]),
        (good.replace("Y_Unit_Label\tN\tg", "Y_Unit_Label\tN\tV"), ["'V'"]),
        (good.replace("force\ttool_x", "force\ttip"), ["'tip'"]),
        (good.replace("\t-7.000000", "\tseven"), ["NaN"]),
    ):
        (tmp_path / "r.lvm").write_text(text)
        _refused(tmp_path, "r.lvm", *words)
    (tmp_path / "r.lvm").write_text(good)
    assert read_campaign(tmp_path).records[0].histories[0].fs == 1000.0
    (tmp_path / "campaign.toml").write_text(FRF_RECORD.replace("r.csv", "r.lvm"))
    _refused(tmp_path, "LVM holds time records")
    with pytest.raises(DataFormatError, match="read only"):
        FORMATS[".lvm"].write(tmp_path / "r.lvm", Contents(), Layout({}, {}))


def test_blows_that_do_not_fit_one_matrix(tmp_path):
    campaign = small_campaign(tmp_path)
    first, second = campaign.records[0].histories
    shorter = type(second)(second.fs, second.force[:-1], second.responses[:, :-1], second.channels, "b")
    record = Record(**{**campaign.records[0].__dict__, "histories": (first, shorter)})
    with pytest.raises(DataFormatError, match="one matrix"):
        write_campaign(Campaign("t", tmp_path, published_machine(), (record,)), tmp_path / "c", format="mat")
    assert not (tmp_path / "c").exists()


# --- units -----------------------------------------------------------------------------------------------------------


class Displacement(OneMass):
    channels = {"y": Channel("drive", "displacement")}


class OnShaker(Displacement):
    input_quantity = "acceleration"


def test_units_are_converted(tmp_path):
    raw = np.loadtxt(_csv().split("\n")[1:-1], delimiter=",")
    record = read_campaign(_campaign(tmp_path, csv=_csv("time [s],force [N],tool_x [g]"))).records[0]
    np.testing.assert_allclose(record.histories[0].responses[0], 9.80665 * raw[:, 2])
    bare = RECORD.replace("position = 0.3\n", "")
    folder = _campaign(tmp_path, bare, _csv("time [s],force [N],y [mm]"))
    (history,) = read_campaign(folder, Displacement()).records[0].histories
    np.testing.assert_allclose(history.responses[0], 1e-3 * raw[:, 2])
    folder = _campaign(tmp_path, bare, _csv("time [s],force [g],y [mm]"))
    on_shaker = read_campaign(folder, OnShaker()).records[0]
    np.testing.assert_allclose(on_shaker.histories[0].force, 9.80665 * raw[:, 1])
    assert on_shaker.input_unit == "m/s^2"
    _refused(_campaign(tmp_path, bare, _csv("time [s],force [N],y [mm]")), "'force'", "'N'", machine=OnShaker())


def test_a_response_to_a_force_is_none_to_a_base_acceleration(tmp_path):
    folder = _campaign(
        tmp_path, FRF_RECORD.replace("position = 0.3\n", ""), _frf_csv(_FRF_HEAD.format("m/N").replace("tool_x", "y"))
    )
    _refused(folder, "input of 'm/N'", "'N' is one of force where acceleration is expected", machine=OnShaker())


@pytest.mark.parametrize(
    ("unit", "machine", "factor"),
    [
        ("g/N", None, 9.80665),
        ("(m/s^2)/N", None, 1.0),
        ("mm/N", Displacement(), 1e-3),
        ("mm/g", OnShaker(), 1e-3 / 9.80665),
        ("m/m/s^2", OnShaker(), 1.0),
        ("mm/(m/s^2)", OnShaker(), 1e-3),
    ],
)
def test_units_of_frequency_responses_are_converted(tmp_path, unit, machine, factor):
    channel = "tool_x" if machine is None else "y"
    toml = FRF_RECORD if machine is None else FRF_RECORD.replace("position = 0.3\n", "")
    folder = _campaign(tmp_path, toml, _frf_csv(_FRF_HEAD.format(unit).replace("tool_x", channel)))
    frf = read_campaign(folder, machine).records[0].frf
    np.testing.assert_allclose(frf.data[0, 0, 0], factor * (1 + 1j * np.linspace(0, 1, 50)))


def _three_channels(samples=200):
    table = np.random.default_rng(1).standard_normal((samples, 5))
    table[:, 0], table[:, 1] = np.arange(samples) / 1000, 40 * np.exp(-(((np.arange(samples) - 60) / 3.0) ** 2))
    head = "time [s],force [N],A1 [m/s^2],A2 [m/s^2],A3 [m/s^2]"
    return head + "\n" + "\n".join(",".join(f"{x:.10g}" for x in row) for row in table) + "\n"


@pytest.mark.parametrize("third", ['"A3"', "4", '"a 3"'])
def test_the_line_that_is_proposed_names_no_column_that_is_mapped(tmp_path, third):
    mapped = '[channels]\nforce = { name = "force" }\ntool_x = { name = "A1" }\ntool_z = { name = "A33" }\n'
    folder = _campaign(tmp_path, RECORD + mapped + f"base_x = {{ name = {third} }}\n", _three_channels())
    _refused(folder, "'A33'", 'for instance: tool_z = { name = "A2" }')


def test_channels_that_no_record_has_are_named(tmp_path):
    mapped = '[channels]\nforce = { name = "force" }\ntool_x = { name = "A1" }\n'
    said = " ".join(summarise(read_campaign(_campaign(tmp_path, RECORD + mapped, _three_channels()))).sentences())
    assert "No record has the model's channel tool_z" in said
    assert "channel tool_x:" not in said
