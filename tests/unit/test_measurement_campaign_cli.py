"""From a lab's folder to a campaign with the command line alone: `campaign init`, then `campaign show`."""

import json
import re
import tomllib

import numpy as np
import pytest

from cutvib_ss.cli.app import main
from cutvib_ss.measurement import estimate, read_campaign
from cutvib_ss.measurement.survey import guess_position
from cutvib_ss.model.machine import published_machine
from cutvib_ss.report.frame import plotly_script, unpacked
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes
from tests.unit import lab_files as lab

ALL = ("tool_x", "tool_z", "base_x")
POSITIONS = (0.25, 0.4)


@pytest.fixture(scope="module")
def tables():
    return {y: lab.blows(y, noise=1e-3, seed=k) for k, y in enumerate(POSITIONS)}


def _one_file_a_blow(write, pattern):
    def write_all(folder, tables):
        for y, blows in tables.items():
            for k, table in enumerate(blows):
                write(folder / pattern.format(y=y, percent=round(100 * y), k=k + 1), table)

    return write_all


def _one_file_a_position(write, pattern):
    def write_all(folder, tables):
        for y, blows in tables.items():
            write(folder / pattern.format(y=y), blows)

    return write_all


# style: writer, whether the names say it all, flags that say the rest
STYLES = {
    "diadem": (_one_file_a_blow(lab.german_csv, "pos{y:.2f}_schlag{k}.csv"), False, []),
    "dewesoft text": (_one_file_a_blow(lab.dewesoft_csv, "pos{y:.2f}_hit_{k}.txt"), True, []),
    "dewesoft mat": (_one_file_a_blow(lab.dewesoft_mat, "y{y:.2f}_{k}.mat"), False, []),
    "testlab": (_one_file_a_blow(lab.testlab_mat, "{percent}%_run{k}.mat"), True, []),
    "bk": (_one_file_a_blow(lab.bk_mat, "pos{y:.2f}_{k}.mat"), True, []),
    "structs": (_one_file_a_position(lab.struct_mat, "pos{y:.2f}.mat"), False, ["--channel", "base_x=a_b:g"]),
    "flexlogger": (_one_file_a_blow(lab.tdms_by_sensor, "pos{y:.2f}_{k}.tdms"), False, []),
    "tdms": (_one_file_a_position(lab.tdms_by_blow, "pos{y:.2f}.tdms"), False, ["--channel", "force=Force"]),
    "lvm": (_one_file_a_position(lab.lvm, "pos{y:.2f}.lvm"), False, []),
}


@pytest.mark.parametrize("style", STYLES)
def test_a_folder_of_each_style_becomes_the_campaign_it_is(style, tmp_path, tables, capsys):
    write, told, flags = STYLES[style]
    write(tmp_path, tables)
    assert main(["campaign", "init", str(tmp_path), *flags]) == 0
    said = capsys.readouterr()
    assert "not yet readable" not in said.err
    text = (tmp_path / "campaign.toml").read_text(encoding="utf-8")
    assert ("TODO" not in text.split("\n", 1)[1]) == told
    assert "TODO" in (tmp_path / "machine.toml").read_text()
    campaign = read_campaign(tmp_path)
    assert campaign.machine == published_machine()
    assert [r.position for r in campaign.records] == list(POSITIONS)
    for record in campaign.records:
        assert (record.kind, record.channels, len(record.histories)) == ("impact", ALL, 3)
        assert record.peak_force == pytest.approx(60, rel=0.01)
        for history, table in zip(record.histories, tables[record.position], strict=True):
            np.testing.assert_allclose(history.force, table[0], atol=1e-6)
            np.testing.assert_allclose(history.responses, table[1:], atol=2e-6, rtol=1e-6)
    assert main(["campaign", "show", str(tmp_path)]) == 0
    assert "3 " in capsys.readouterr().out


@pytest.mark.parametrize("write", [lab.uff_frfs, lab.testlab_frf_mat])
def test_a_folder_of_frequency_responses(write, tmp_path, capsys):
    freq = np.arange(20.0, 300.0, 0.5)
    expected = {}
    for y in POSITIONS:
        data = frequency_response(published_machine(), [y], freq, inputs=["force", "head_x"], outputs=ALL).data[0]
        expected[y] = data[:, 0]
        if write is lab.uff_frfs:
            write(tmp_path / f"pos{y}.uff", freq, data.transpose(1, 0, 2), references=((101, 1), (103, 1)))
        else:
            write(tmp_path / f"pos{y}.mat", freq, data[:, 0])
    assert main(["campaign", "init", str(tmp_path)]) == 0
    assert "not yet readable" not in capsys.readouterr().err
    text = (tmp_path / "campaign.toml").read_text()
    assert "averages = 1  # TODO" in text
    campaign = read_campaign(tmp_path)
    for record in campaign.records:
        np.testing.assert_allclose(record.frf.data[0, :, 0], expected[record.position], rtol=1e-8)
    # What is still marked is pointed out wherever the campaign is read, until the marks are gone.
    line = 1 + next(n for n, row in enumerate(text.splitlines()) if "# TODO" in row)
    marked = [w for w in campaign.warnings if "marked TODO" in w]
    assert marked[0].startswith(f"campaign.toml, line {line}: averages: marked TODO")
    assert marked[1].startswith("machine.toml, line 1: the nominal model: marked TODO")
    assert not [w for w in read_campaign(tmp_path, published_machine()).warnings if "machine.toml" in w]
    for name in ("campaign.toml", "machine.toml"):
        (tmp_path / name).write_text((tmp_path / name).read_text().replace("TODO", ""))
    assert not [w for w in read_campaign(tmp_path).warnings if "marked TODO" in w]


def test_averages_and_levels_of_frequency_responses(tmp_path, capsys):
    freq = np.arange(20.0, 300.0, 0.5)
    for y in POSITIONS:
        data = frequency_response(published_machine(), [y], freq, outputs=ALL).data[0].transpose(1, 0, 2)
        lab.uff_frfs(tmp_path / f"pos{y}_50N.uff", freq, data)
    assert main(["campaign", "init", str(tmp_path), "--averages", "5"]) == 0
    out = capsys.readouterr().out
    # the files are alike: their channels stand there once, and nothing is left to do
    assert out.count("Channels of") == 1
    assert "To do" not in out
    for record in read_campaign(tmp_path).records:
        assert record.averages == 5
        assert record.peak_force == 50.0


def test_nothing_is_overwritten(tmp_path, tables, capsys):
    STYLES["bk"][0](tmp_path, tables)
    (tmp_path / "campaign.toml").write_text("# mine\n")
    (tmp_path / "machine.toml").write_text("# mine as well\n")
    assert main(["campaign", "init", str(tmp_path)]) == 0
    assert (tmp_path / "campaign.toml").read_text() == "# mine\n"
    assert (tmp_path / "machine.toml").read_text() == "# mine as well\n"
    assert capsys.readouterr().err.count("is there already and is left as it is") == 2


def test_json_lists_what_was_found(tmp_path, tables, capsys):
    STYLES["lvm"][0](tmp_path, tables)
    (tmp_path / "notes.txt").write_text("Monday\nwarm\n")
    assert main(["campaign", "init", str(tmp_path), "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["schema"] == "cutvib-campaign-init/1"
    assert [f["file"] for f in data["files"]] == ["pos0.25.lvm", "pos0.40.lvm"]
    assert data["files"][0]["blows"] == 3
    assert data["files"][0]["peak_forces"] == pytest.approx([40, 60, 80], rel=0.01)
    assert data["channels"]["pos0.25.lvm"]["force"] == "Dev1_ai0 (Hammer)"
    assert "notes.txt" in data["not_read"][0]
    assert sorted(data["written"]) == ["campaign.toml", "machine.toml"]
    tomllib.loads(data["campaign_toml"])


def test_flags_take_the_place_of_names(tmp_path, tables, capsys):
    """Columns that say nothing, a position that no name gives: flags say both."""
    lines = ["t;c1;c2;c3;c4"]
    for t, row in zip(lab.time_axis(), tables[0.4][0].T, strict=True):
        lines.append(";".join(f"{x:.9g}".replace(".", ",") for x in (t, *row[[3, 0, 1, 2]])))
    (tmp_path / "a.csv").write_text("\n".join(lines))
    flags = ["--position", "0.4", "--title", "Row B"]
    for flag in ("force=c2:N", "tool_x=c3:m/s^2", "tool_z=C4", "base_x=c1"):
        flags += ["--channel", flag]
    assert main(["campaign", "init", str(tmp_path), *flags]) == 0
    campaign = read_campaign(tmp_path)
    assert (campaign.title, campaign.records[0].position) == ("Row B", 0.4)
    np.testing.assert_allclose(campaign.records[0].histories[0].responses, tables[0.4][0][1:], atol=1e-6, rtol=1e-6)
    assert "TODO the file names no unit" in (tmp_path / "campaign.toml").read_text()


def test_without_a_force_it_says_what_to_do(tmp_path, tables, capsys):
    lines = ["time [s],c1 [g],c2 [g]"]
    lines += [f"{t:.9g},{row[1]:.9g},{row[2]:.9g}" for t, row in zip(lab.time_axis(), tables[0.4][0].T, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    assert main(["campaign", "init", str(tmp_path)]) == 0
    said = capsys.readouterr()
    assert "force: no column found" in said.out
    assert "not yet readable" in said.err
    assert '# force = { name = "…" }  # TODO' in (tmp_path / "campaign.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "no such folder"),
        (["."], "is empty; give the folder"),
        ([".", "--channel", "tip=a"], "--channel tip=a"),
        ([".", "--position", "1.5"], "--position 1.5"),
    ],
)
def test_what_cannot_be_begun(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["campaign", "init", *arguments]) == 2
    assert words in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_several_hits_in_one_recording_are_said(tmp_path, tables, capsys):
    whole = np.concatenate(list(tables[0.4]), axis=1)
    lines = ["time [s],force [N],tool_x [m/s^2]"]
    lines += [f"{k / lab.FS:.9g},{row[0]:.9g},{row[1]:.9g}" for k, row in enumerate(whole.T)]
    (tmp_path / "all.csv").write_text("\n".join(lines))
    assert main(["campaign", "init", str(tmp_path)]) == 0
    text = (tmp_path / "campaign.toml").read_text(encoding="utf-8")
    assert 'kind = "timeseries"' in text
    assert "TODO 3 hits in one recording" in text


def test_another_structure(tmp_path, capsys):
    (tmp_path / "model.toml").write_text(
        '[model]\nkind = "second_order"\ndofs = ["x"]\nmass = [[2.0]]\ndamping = [[8.0]]\nstiffness = [[2.8e5]]\n'
        '[ports]\ndrive = [1.0]\n[channels]\ny = { port = "drive", quantity = "acceleration" }\n[input]\nforce = "drive"\n'
    )
    folder = tmp_path / "lab"
    folder.mkdir()
    rng = np.random.default_rng(0)
    table = np.column_stack([np.arange(400) / 1000, rng.standard_normal((400, 2))])
    np.savetxt(folder / "run.csv", table, delimiter=",", header="time [s],Shaker force [N],Acc [m/s^2]", comments="")
    assert main(["campaign", "init", str(folder), "--machine", str(tmp_path / "model.toml")]) == 0
    campaign = read_campaign(folder)
    assert (campaign.records[0].kind, campaign.records[0].position) == ("timeseries", None)
    np.testing.assert_allclose(campaign.records[0].histories[0].responses[0], table[:, 2])
    assert main(["campaign", "show", str(folder)]) == 0


def test_it_asks_on_a_terminal(tmp_path, tables, monkeypatch):
    import sys

    STYLES["tdms"][0](tmp_path, tables)
    asked = []
    answers = iter(["3", "Acc1", ""])

    def prompt(text, **options):
        asked.append(text)
        return next(answers)

    monkeypatch.setattr("typer.prompt", prompt)
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    assert main(["campaign", "init", str(tmp_path)]) == 0
    assert [re.search(r"is (\w+)\?", text)[1] for text in asked] == list(ALL)
    channels = tomllib.loads((tmp_path / "campaign.toml").read_text())["channels"]
    assert channels["tool_x"]["name"] == "Acc2"
    assert channels["tool_z"]["name"] == "Acc1"


@pytest.mark.parametrize(
    ("name", "position"),
    [
        ("pos0.25_1", 0.25), ("y=0,33", 0.33), ("p0p4 hit", 0.4), ("25%_run1", 0.25), ("40 percent", 0.4),
        ("blow_12", None), ("acc1", None), ("pos1.5", None), ("row0/x0.125", 0.125),
    ],
)  # fmt: skip
def test_positions_from_names(name, position):
    assert guess_position(name) == position


# --- show ------------------------------------------------------------------------------------------------------------


def _shown(tmp_path, records, capsys):
    (tmp_path / "campaign.toml").write_text("\n".join(records))
    assert main(["campaign", "show", str(tmp_path), "--json", "-"]) == 0
    return json.loads(capsys.readouterr().out)


def _csv(path, blows, scale=None):
    lines = ["blow,time [s],force [N],tool_x [m/s^2],tool_z [m/s^2],base_x [m/s^2]"]
    for k, table in enumerate(blows):
        factor = 1.0 if scale is None else scale[k]
        for t, row in zip(lab.time_axis(), table.T, strict=True):
            values = [row[0], *(factor * row[1:])]
            lines.append(f"{k + 1},{t:.9g}," + ",".join(f"{x:.9g}" for x in values))
    path.write_text("\n".join(lines))


RECORD = '[[record]]\nfile = "{}"\nkind = "impact"\nposition = 0.4\n'


def test_show_tells_repeatability_and_levels(tmp_path, capsys):
    """Two of one thing that differ by a gain of 4 %, and a third at another level that differs by 20 %."""
    low, high = (45.0, 50.0, 55.0), (180.0, 200.0, 220.0)
    _csv(tmp_path / "a.csv", lab.blows(peaks=low, noise=1e-4, seed=1))
    _csv(tmp_path / "b.csv", lab.blows(peaks=low, noise=1e-4, seed=2), scale=[1.04] * 3)
    _csv(tmp_path / "c.csv", lab.blows(peaks=high, noise=1e-4, seed=3), scale=[1.2] * 3)
    data = _shown(tmp_path, [RECORD.format(f"{n}.csv") for n in "abc"], capsys)
    assert data["schema"] == "cutvib-campaign-show/1"
    # two that differ by the factor 1.04 have rms(a - b) / (√2 rms) = 0.04 / √(1 + 1.04²)
    assert data["repeatability"] == pytest.approx(0.04 / np.sqrt(1 + 1.04**2), rel=0.03)
    assert [(p["first"], p["second"]) for p in data["levels"]] == [("a.csv", "c.csv"), ("b.csv", "c.csv")]
    assert data["levels"][0]["difference"] == pytest.approx(0.2 / np.sqrt(1 + 1.2**2), rel=0.03)
    # One repetition alone does not tell a difference of four times as much from chance.
    assert any("so few of these (1 pair)" in s for s in data["sentences"])
    assert [r["level"] for r in data["records"]] == pytest.approx([50, 50, 200], rel=0.02)


def test_records_of_one_stated_level_are_repetitions_however_they_were_hit(tmp_path, capsys):
    for k, (name, peak) in enumerate((("a", 63.0), ("b", 49.0))):
        _csv(tmp_path / f"{name}.csv", lab.blows(peaks=(0.9 * peak, peak, 1.1 * peak), noise=1e-4, seed=k))
    stated = [RECORD.format(f"{n}.csv") + "peak_force = 60.0\n" for n in "ab"]
    assert [len(_shown(tmp_path, stated, capsys)[key]) for key in ("repeated", "levels")] == [1, 0]


def test_show_of_a_linear_machine_that_repeats_within_its_noise(tmp_path, capsys):
    for k, (name, peak) in enumerate((("a", 50.0), ("b", 50.0), ("c", 200.0))):
        _csv(tmp_path / f"{name}.csv", lab.blows(peaks=(0.9 * peak, peak, 1.1 * peak), noise=0.02, seed=k))
    data = _shown(tmp_path, [RECORD.format(f"{n}.csv") for n in "abc"], capsys)
    assert data["repeatability"] == 0.0
    assert not any("depends on the level" in s for s in data["sentences"])
    assert not data["warnings"]


def test_show_tells_blows_that_order_with_the_force(tmp_path, capsys):
    peaks = (40.0, 50.0, 60.0, 70.0, 80.0, 100.0)
    _csv(tmp_path / "a.csv", lab.blows(peaks=peaks, noise=1e-4), scale=[1 - 0.001 * p for p in peaks])
    data = _shown(tmp_path, [RECORD.format("a.csv")], capsys)
    assert data["records"][0]["channels"][0]["ordered"] < 0.01
    assert any("orders with the peak force" in s for s in data["sentences"])


def test_report_is_one_page_that_loads_nothing(tmp_path, tables, capsys):
    STYLES["lvm"][0](tmp_path, tables)
    assert main(["campaign", "init", str(tmp_path)]) == 0
    page = tmp_path / "page.html"
    assert main(["campaign", "show", str(tmp_path), "--report", str(page)]) == 0
    text = page.read_text(encoding="utf-8").replace(plotly_script(), "")
    assert not re.search(r'(?:src|href)="[^"#]|https?://|url\(', text)
    assert "prefers-color-scheme: dark" in text
    assert "width=device-width" in text
    found = re.search(r'id="charts-data">(.*?)</script>', text, re.DOTALL)
    data = unpacked(found[1])
    assert [g["title"] for g in data["groups"]] == ["y/L = 0.25", "y/L = 0.4"]
    first = data["groups"][0]["records"][0]["channels"]["tool_z"]
    assert first["unit"] == "g/N"
    # What is drawn is what the estimator gives of the file, in g/N.
    frf = estimate(read_campaign(tmp_path).records[0]).sel(output="tool_z")
    k = int(np.abs(frf.freq - first["freq"][7]).argmin())
    assert first["h"]["re"][7] == pytest.approx(frf.data[0, 0, 0, k].real / 9.80665, rel=1e-4)
    assert set(data["groups"][1]["nominal"]) == {"tool_x", "tool_z", "base_x"}
    # The records are of the published machine: its modes stay in the diagram of poles.
    found = [float(row[0]) for row in data["poles"][1]["columns"]]
    natural = modes(published_machine(), 0.4).natural_freq
    assert min(abs(f - natural[2]) for f in found) < 2.0
    assert [len(b["force"]) for b in data["blows"]] == [3, 3]
    for words in ("pos0.25.lvm", "nominal model", "tool_z", "y/L = 0.4"):
        assert words in text


def test_show_of_what_cannot_be_read(tmp_path, capsys):
    page = tmp_path / "page.html"
    assert main(["campaign", "show", str(tmp_path), "--report", str(page)]) == 2
    assert "no such file" in capsys.readouterr().err
    assert not page.exists()


def test_show_of_measured_rigs(shared, capsys):
    """What is documented of them is seen: the beam depends on its level at every pair; an axis under feedback is not turned."""
    assert main(["campaign", "show", str(shared / "data" / "brb" / "constant_force"), "--json", "-"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert len(data["levels"]) == 10
    assert min(pair["difference"] for pair in data["levels"]) > 0.1
    assert any("in 10 of 10 pairs of levels" in sentence for sentence in data["sentences"])
    assert not read_campaign(shared / "data" / "emps" / "free_axis").warnings


def test_show_of_a_linear_and_a_nonlinear_machine(shared, capsys):
    """Sensor noise explains the blows of a simulated machine whose sensors are all that is noisy; a law shows between levels."""
    said = {}
    for name in ("c01", "c12"):
        assert main(["campaign", "show", str(shared / "campaigns" / name), "--json", "-"]) == 0
        said[name] = json.loads(capsys.readouterr().out)
    ratios = [c["blow_ratio"] for r in said["c01"]["records"] for c in r["channels"]]
    assert np.median(ratios) == pytest.approx(1.0, abs=0.1)
    assert not any("depends on the level" in s for s in said["c01"]["sentences"])
    assert any("differ in 18 of 18 pairs of levels" in s for s in said["c12"]["sentences"])
