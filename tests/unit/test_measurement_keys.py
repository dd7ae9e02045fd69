"""Keys of campaign.toml beyond file, kind and position: read, checked, carried on the record, written back."""

import numpy as np
import pytest
from scipy.io import savemat

from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.measurement import Campaign, Record, read_campaign
from cutvib_ss.measurement.campaign import write_campaign
from cutvib_ss.measurement.mapping import turned
from cutvib_ss.model.machine import published_machine
from cutvib_ss.results import MeasuredFrequencyResponse

SINE = '[[record]]\nfile = "r.csv"\nkind = "frf"\nexcitation = "sine"\nposition = 0.3\n'


def _frf_csv(path, head="freq [Hz],force amplitude [N],tool_x re [g/N],tool_x im [g/N]", lines=60, order=1):
    freq = np.linspace(20.0, 60.0, lines)
    table = np.column_stack([freq, 2.0 + 0.01 * freq, np.cos(freq), 0.1 + 0.0 * freq])[::order]
    path.write_text(head + "\n" + "\n".join(",".join(f"{x:.12g}" for x in row) for row in table) + "\n")
    return freq, table


def _folder(tmp_path, toml):
    (tmp_path / "campaign.toml").write_text(toml, encoding="utf-8")
    return tmp_path


def _refused(folder, *words):
    with pytest.raises(DataFormatError) as caught:
        read_campaign(folder)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value), str(caught.value)


KEYS = (
    'session = "monday"\nband_hz = [21.0, 59.0]\nsweep = "down"\ncontrolled = "response"\npeak_response = 0.5\n'
    'input = "head_x"\nuse = "check"\naverages = 4\npeak_force = 3\n'
)


@pytest.mark.parametrize("format_", ["csv", "mat"])
def test_every_key_is_carried_and_written_back(tmp_path, format_):
    freq, _ = _frf_csv(tmp_path / "r.csv")
    campaign = read_campaign(_folder(tmp_path, SINE + KEYS))
    again = read_campaign(write_campaign(campaign, tmp_path / "again", format=format_))
    for record in (campaign.records[0], again.records[0]):
        assert (record.session, record.band_hz, record.sweep) == ("monday", (21.0, 59.0), "down")
        assert (record.controlled, record.input, record.use) == ("response", "head_x", "check")
        assert record.peak_response == pytest.approx(0.5 * 9.80665)  # stated in the channel's unit, g
        np.testing.assert_allclose(record.force_amplitude, 2.0 + 0.01 * freq)
        np.testing.assert_allclose(record.frf.freq, freq)


def test_absent_keys_are_none(tmp_path):
    _frf_csv(tmp_path / "r.csv")
    record = read_campaign(_folder(tmp_path, SINE)).records[0]
    for key in ("session", "band_hz", "sweep", "controlled", "peak_response", "input", "use", "peak_force"):
        assert getattr(record, key) is None


def test_force_amplitude_of_a_mat_file(tmp_path):
    freq = np.linspace(20.0, 60.0, 50)
    savemat(tmp_path / "r.mat", {"freq": freq, "tool_x": np.ones(50) + 0.1j, "force_amplitude": np.full(50, 3.0)})
    record = read_campaign(_folder(tmp_path, SINE.replace("r.csv", "r.mat"))).records[0]
    np.testing.assert_array_equal(record.force_amplitude, np.full(50, 3.0))


def test_lines_from_the_top_down_are_sorted(tmp_path):
    freq, table = _frf_csv(tmp_path / "r.csv", order=-1)
    record = read_campaign(_folder(tmp_path, SINE + 'sweep = "down"\n')).records[0]
    np.testing.assert_allclose(record.frf.freq, freq)
    np.testing.assert_allclose(record.force_amplitude, table[::-1, 1])
    np.testing.assert_allclose(record.frf.data[0, 0, 0].real, 9.80665 * np.cos(freq), rtol=1e-9)


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        (SINE + 'sweep = "sideways"\n', ["record[1].sweep"]),
        (SINE + 'controlled = "phase"\n', ["record[1].controlled"]),
        (SINE + "peak_response = 1\n", ["record[1]", "peak_response", 'controlled = "response"']),
        (SINE + 'controlled = "response"\npeak_response = -1\n', ["record[1].peak_response"]),
        (SINE.replace("sine", "random") + 'sweep = "up"\n', ["record[1]", "sweep", "sine"]),
        (SINE + 'input = "elbow"\n', ["record[1].input", "elbow", "head_x"]),
        (SINE + 'input = "rail@1.5"\n', ["record[1].input", "strictly inside (0, 1)"]),
        (SINE + "band_hz = [50, 20]\n", ["record[1].band_hz = [50, 20]: give the lower end first"]),
        (SINE + '[channels]\ntip = "Acc 1"\n', ["[channels]", "'tip'", "tool_x"]),
        (SINE + '[channels]\ntool_x = { name = "Acc 1" }\n', ["Acc 1", "1: 'tool_x'", "tool_x = { name ="]),
        (SINE + "[channels]\ntool_x = { index = 2 }\n", ["channels.tool_x.index", "unknown key"]),
        (SINE + "[channels]\ntool_x = { sign = 2 }\n", ["channels.tool_x.sign"]),
        (SINE + "[channels]\ntool_x = { gain = 0 }\n", ["channels.tool_x.gain"]),
        (SINE + '[csv]\nencoding = "ebcdik"\n', ["csv.encoding", "cp1252"]),
        (SINE + '[csv]\ncolumns = "a"\n', ["csv.columns", "unknown key"]),
    ],
)
def test_impossible_values(tmp_path, toml, words):
    _frf_csv(tmp_path / "r.csv")
    _refused(_folder(tmp_path, toml), *words)


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ("block = 0.5\nblow_at = 0.6\n", "block of 0.5 s"),
        ("blow_at = 1.5\n", "block of 1.475 s"),
        ("blow_at = 0.6\n", ""),
    ],
)
def test_a_blow_lies_in_its_block(tmp_path, stated, said):
    _frf_csv(tmp_path / "r.csv")
    folder = _folder(tmp_path, SINE.replace("sine", "impact") + stated)
    if said:
        _refused(folder, "blow_at", said)
    else:
        assert read_campaign(folder).records[0].blow_at == 0.6


@pytest.mark.parametrize(
    ("columns", "mapped", "line"),
    [
        ("Acc 1 [m/s^2],Hammer [N],Acc 2 [m/s^2]", "", 'force = { name = "Hammer" }'),
        ("Hammer [N],tool_x [m/s^2],tool_z [m/s^2]", 'force = "Hamer"', 'force = { name = "Hammer" }'),
        ("force [N],Sensor 7 [m/s^2],tool_z [m/s^2]", 'tool_x = "sensor7b"', 'tool_x = { name = "Sensor 7" }'),
        ("tool_x [m/s^2],tool_z [m/s^2]", "", 'force = { name = "…" }'),
    ],
)
def test_the_line_that_would_map_a_channel(tmp_path, columns, mapped, line):
    rows = "\n".join(f"{k / 1000}" + f",{k % 7}" * (1 + columns.count(",")) for k in range(50))
    (tmp_path / "r.csv").write_text(f"time [s],{columns}\n{rows}\n")
    toml = '[[record]]\nfile = "r.csv"\nkind = "impact"\nposition = 0.4\n[channels]\n' + mapped
    _refused(_folder(tmp_path, toml), line)


@pytest.mark.parametrize(
    ("head", "change", "words"),
    [
        ("freq [Hz],force amplitude [g],tool_x re [g/N],tool_x im [g/N]", 1.0, ["force amplitude", "'g'"]),
        (
            "freq [Hz],force amplitude [N],tool_x re [g/N],tool_x im [g/N]",
            0.0,
            ["force amplitude", "positive", "line 4"],
        ),
    ],
)
def test_force_amplitude_that_is_none(tmp_path, head, change, words):
    _, table = _frf_csv(tmp_path / "r.csv", head)
    table[3, 1] = change
    (tmp_path / "r.csv").write_text(head + "\n" + "\n".join(",".join(f"{x:.12g}" for x in row) for row in table))
    _refused(_folder(tmp_path, SINE), *words)


def test_force_amplitude_needs_a_value_for_each_line():
    frf = MeasuredFrequencyResponse(
        np.ones((1, 1, 1, 5), complex), np.arange(1.0, 6.0), np.array([0.5]), ("tool_x",), ("force",),
        ("acceleration",), variance=np.ones((1, 1, 1, 5)), coherence=np.ones((1, 1, 1, 5)), averages=1,
    )  # fmt: skip
    with pytest.raises(ParameterError, match="each line"):
        Record("r", "frf", 0.5, None, None, ("tool_x",), ("acceleration",), (), frf, force_amplitude=np.ones(4))


def test_uff_has_no_place_for_the_force_amplitude(tmp_path):
    _frf_csv(tmp_path / "r.csv")
    with pytest.raises(DataFormatError, match="write csv or mat"):
        write_campaign(read_campaign(_folder(tmp_path, SINE)), tmp_path / "again", format="uff")


@pytest.mark.parametrize(
    ("stated", "carried"),
    [("tool_x", None), ("force", None), ("base_x", "base"), ("rail@0.25", "rail@0.25"), ("rail@.5", "rail@0.5")],
)
def test_input(tmp_path, stated, carried):
    _frf_csv(tmp_path / "r.csv")
    record = read_campaign(_folder(tmp_path, SINE + f'input = "{stated}"\n')).records[0]
    assert record.input == carried


# --- [channels] ------------------------------------------------------------------------------------------------------


def _blow_csv(path, head, samples=256):
    rng = np.random.default_rng(1)
    force = 40 * np.exp(-(((np.arange(samples) - 60) / 3.0) ** 2))
    table = np.column_stack([np.arange(samples) / 1000, force, rng.standard_normal((samples, 2))])
    path.write_text(head + "\n" + "\n".join(",".join(f"{x:.12g}" for x in row) for row in table) + "\n")
    return table


IMPACT = '[[record]]\nfile = "r.csv"\nkind = "impact"\nposition = 0.3\n'


def test_channels_by_name_index_gain_sign_and_unit(tmp_path):
    table = _blow_csv(tmp_path / "r.csv", "time [s],Hammer [N],Acc 1 [mV],Acc 2 [g]")
    toml = IMPACT + (
        '[channels]\nforce = "Hammer"\ntool_x = { name = "acc 1", unit = "g", gain = 1.02, sign = -1 }\n'
        "base_x = { name = 3 }\n"
    )
    record = read_campaign(_folder(tmp_path, toml)).records[0]
    assert record.channels == ("tool_x", "base_x")
    history = record.histories[0]
    np.testing.assert_allclose(history.force, table[:, 1])
    np.testing.assert_allclose(history.responses[0], -1.02 * 9.80665 * table[:, 2])
    np.testing.assert_allclose(history.responses[1], 9.80665 * table[:, 3])


def test_a_record_overrides_the_campaigns_channels_key_by_key(tmp_path):
    table = _blow_csv(tmp_path / "r.csv", "time [s],Hammer [N],Acc 1 [g],Acc 2 [g]")
    toml = (
        IMPACT + "[record.channels]\ntool_x = { sign = -1 }\n" + IMPACT.replace("0.3", "0.4") + "[channels]\n"
        'force = "Hammer"\ntool_x = { name = "Acc 1", gain = 2 }\n'
    )
    first, second = read_campaign(_folder(tmp_path, toml)).records
    np.testing.assert_allclose(first.histories[0].responses[0], -2 * 9.80665 * table[:, 2])
    np.testing.assert_allclose(second.histories[0].responses[0], 2 * 9.80665 * table[:, 2])


def test_columns_that_nothing_maps_are_named(tmp_path):
    _blow_csv(tmp_path / "r.csv", "time [s],Hammer [N],Acc 1 [g],Mic [Pa]")
    campaign = read_campaign(_folder(tmp_path, IMPACT + '[channels]\nforce = "Hammer"\ntool_x = "Acc 1"\n'))
    assert any("Mic" in warning and "not used" in warning for warning in campaign.warnings)


def test_one_column_for_two_channels(tmp_path):
    _blow_csv(tmp_path / "r.csv", "time [s],Hammer [N],Acc 1 [g],Acc 2 [g]")
    toml = IMPACT + '[channels]\nforce = "Hammer"\ntool_x = "Acc 1"\ntool_z = "Acc 1"\n'
    _refused(_folder(tmp_path, toml), "'Acc 1'", "both tool_x and tool_z")


def test_phase_turns_the_spectrum_and_no_more():
    rng = np.random.default_rng(0)
    for samples in (400, 401):
        values = rng.standard_normal(samples)
        spectrum, after = np.fft.rfft(values), np.fft.rfft(turned(values, 0.3))
        inner = slice(1, -1 if samples % 2 == 0 else None)
        np.testing.assert_allclose(after[inner], spectrum[inner] * np.exp(0.3j), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(after[0], spectrum[0])


def test_gain_sign_and_phase_of_a_ratio(tmp_path):
    _frf_csv(tmp_path / "r.csv")
    plain = read_campaign(_folder(tmp_path, SINE)).records[0].frf.data
    toml = SINE + "[channels]\nforce = { gain = 4, sign = -1, phase_deg = 10 }\ntool_x = { gain = 2, phase_deg = 40 }\n"
    stated = read_campaign(_folder(tmp_path, toml)).records[0]
    np.testing.assert_allclose(stated.frf.data, -0.5 * np.exp(1j * np.radians(30)) * plain)
    np.testing.assert_allclose(stated.force_amplitude, 4 * (2.0 + 0.01 * stated.frf.freq))


@pytest.mark.parametrize(
    ("unit", "channels", "factor"),
    [
        ("mV/mV", 'force = { unit = "N" }\ntool_x = { unit = "g" }', 9.80665),
        ("g", 'force = { unit = "N" }', 9.80665),
        ("m/s^2", 'force = { unit = "N" }', 1.0),
        ("m/s^2/lbf", 'force = { unit = "N" }', 1.0),
        ("V/N", 'tool_x = { unit = "g" }', 9.80665),
        ("V/V", 'tool_x = { unit = "g/N" }', 9.80665),
        ("V/V", 'tool_x = { unit = "m/s^2/N", gain = 3 }', 3.0),
    ],
)
def test_unit_of_a_ratio(tmp_path, unit, channels, factor):
    _frf_csv(tmp_path / "r.csv", f"freq [Hz],force amplitude [N],tool_x re [{unit}],tool_x im [{unit}]")
    record = read_campaign(_folder(tmp_path, SINE + "[channels]\n" + channels + "\n")).records[0]
    np.testing.assert_allclose(record.frf.data[0, 0, 0].imag, 0.1 * factor)


def test_other_campaigns_are_written_as_before(tmp_path):
    _frf_csv(tmp_path / "r.csv")
    record = read_campaign(_folder(tmp_path, SINE)).records[0]
    written = write_campaign(Campaign("t", tmp_path, published_machine(), (record,)), tmp_path / "w", format="csv")
    assert "sweep" not in written.read_text()
