"""Every bad input: exit status 2, one line on standard error that says file and remedy, and no output left."""

import shutil
from collections.abc import Callable
from pathlib import Path

import nptdms
import numpy as np
import pytest

from cutvib_ss.cli import campaigns, main
from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.errors import ParameterError
from cutvib_ss.interchange import write_frf
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response

DEMO = Path(campaigns.__file__).parents[1] / "data" / "demo"
P2 = "records/p2.tdms"


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A copy of the demonstration campaign, to be spoiled."""
    return Path(shutil.copytree(DEMO, tmp_path / "campaign"))


def _refused(arguments: list[str], said: list[str], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    outputs = ["--json", str(folder / "out.json")]
    if arguments[0] in ("diagnose", "identify"):
        outputs += ["--save-machine", str(folder / "out.toml")]
    if arguments[0] == "diagnose":
        outputs += ["--report", str(folder / "out.html")]
    before = sorted(folder.rglob("*"))
    status = main([*arguments, *outputs])
    printed = capsys.readouterr()
    assert status == 2, printed.err
    assert printed.out == ""
    assert len(printed.err.splitlines()) == 1, printed.err
    for words in said:
        assert words in printed.err
    assert sorted(folder.rglob("*")) == before


def _rewrite(path: Path, change: Callable[[str, np.ndarray], tuple[np.ndarray, dict[str, object]]]) -> None:
    """A TDMS file with its channels changed."""
    objects: list[object] = []
    for group in nptdms.TdmsFile.read(path).groups():
        objects.append(nptdms.GroupObject(group.name))
        for channel in group.channels():
            values, properties = change(channel.name, channel[:].copy())
            merged = {**channel.properties, **properties}
            objects.append(nptdms.ChannelObject(group.name, channel.name, values, properties=merged))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(objects)


def _replace(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def missing_campaign(folder: Path) -> list[str]:
    shutil.rmtree(folder)
    return ["campaign.toml", "no such file"]


def missing_record(folder: Path) -> list[str]:
    (folder / P2).unlink()
    return [P2, "no such file"]


def missing_machine(folder: Path) -> list[str]:
    (folder / "machine.toml").unlink()
    return ["machine.toml", "no such file"]


def truncated_tdms(folder: Path) -> list[str]:
    content = (folder / P2).read_bytes()
    (folder / P2).write_bytes(content[: len(content) // 2])
    return [P2, "truncated", "copy it again"]


def empty_record(folder: Path) -> list[str]:
    (folder / P2).write_bytes(b"")
    return [P2, "empty"]


def truncated_uff(folder: Path) -> list[str]:
    frf = frequency_response(published_machine(), [0.27], np.arange(10.0, 400.0))
    write_frf(frf, folder / "p2.uff")
    content = (folder / "p2.uff").read_bytes()
    (folder / "p2.uff").write_bytes(content[: int(0.7 * len(content))])
    _replace(folder / "campaign.toml", f'file = "{P2}"\nkind = "impact"', 'file = "p2.uff"\nkind = "frf"')
    return ["p2.uff", "truncated"]


def nan_in_a_channel(folder: Path) -> list[str]:
    def spoil(name: str, values: np.ndarray) -> tuple[np.ndarray, dict[str, object]]:
        if name == "tool_z":
            values[1000] = np.nan
        return values, {}

    _rewrite(folder / P2, spoil)
    return [P2, "tool_z", "NaN"]


def wrong_unit(folder: Path) -> list[str]:
    _rewrite(folder / P2, lambda name, values: (values, {"unit_string": "V/V"} if name == "tool_x" else {}))
    return [P2, "tool_x", "'V/V'"]


def unit_of_another_quantity(folder: Path) -> list[str]:
    _rewrite(folder / P2, lambda name, values: (values, {"unit_string": "mm"} if name == "base_x" else {}))
    return [P2, "base_x", "displacement"]


def zero_force(folder: Path) -> list[str]:
    _rewrite(folder / P2, lambda name, values: (values * (name != "force"), {}))
    return [P2, "force"]


def two_samples(folder: Path) -> list[str]:
    _rewrite(folder / P2, lambda name, values: (values[:2], {}))
    return [P2, "2 samples"]


def negative_mass(folder: Path) -> list[str]:
    _replace(folder / "machine.toml", "m1 = 24.88", "m1 = -24.88")
    return ["machine.toml", "head.m1 = -24.88", "greater than 0"]


def unknown_key_of_the_machine(folder: Path) -> list[str]:
    _replace(folder / "machine.toml", "m2 = 0.60", "m3 = 0.60")
    return ["machine.toml", "head.m3", "unknown key"]


def unknown_key_of_the_campaign(folder: Path) -> list[str]:
    _replace(folder / "campaign.toml", "peak_force = 60", "peek_force = 60")
    return ["campaign.toml", "record[1].peek_force", "unknown key"]


def position_at_the_end(folder: Path) -> list[str]:
    _replace(folder / "campaign.toml", "position = 0.27", "position = 0.0")
    return ["campaign.toml", "record[2].position", "(0, 1)"]


def position_beyond_the_end(folder: Path) -> list[str]:
    _replace(folder / "campaign.toml", "position = 0.27", "position = 1.2")
    return ["campaign.toml", "record[2].position", "(0, 1)"]


def no_toml(folder: Path) -> list[str]:
    _replace(folder / "campaign.toml", "[campaign]", "[campaign")
    return ["campaign.toml", "not valid TOML"]


def text_in_place_of_a_number(folder: Path) -> list[str]:
    _replace(folder / "machine.toml", "k2 = 10442.0", 'k2 = "stiff"')
    return ["machine.toml", "head.k2"]


SPOILERS = [
    missing_campaign, missing_record, missing_machine, truncated_tdms, empty_record, truncated_uff, nan_in_a_channel,
    wrong_unit, unit_of_another_quantity, zero_force, two_samples, negative_mass, unknown_key_of_the_machine,
    unknown_key_of_the_campaign, position_at_the_end, position_beyond_the_end, no_toml, text_in_place_of_a_number,
]  # fmt: skip


@pytest.mark.parametrize("command", ["diagnose", "identify"])
@pytest.mark.parametrize("spoil", SPOILERS, ids=lambda spoil: spoil.__name__)
def test_a_campaign_that_cannot_be_used(
    command: str,
    spoil: Callable[[Path], list[str]],
    campaign: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    said = spoil(campaign)
    _refused([command, str(campaign)], said, tmp_path, capsys)


@pytest.mark.parametrize("command", ["modes", "frf"])
@pytest.mark.parametrize("position", ["0", "1.2", "-0.5", "nan", "inf", "half"])
def test_a_position_off_the_rail(
    command: str, position: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _refused([command, "--position", position], ["position"], tmp_path, capsys)


@pytest.mark.parametrize(
    "freq", ["100:50:1", "1:2", "a:b:c", "-5:10:1", "0:10:0", "0:10:-1", "0:inf:1", "nan:5:1", "0:1e9:1e-3"]
)
def test_frequencies_that_make_no_sense(freq: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _refused(["frf", "--position", "0.5", "--freq", freq], [f"--freq {freq}"], tmp_path, capsys)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["modes"], "--position is missing"),
        (["modes", "--position", "0.5", "--machine", "absent.toml"], "absent.toml"),
        (["modes", "--position", "0.5", "--speed", "3"], "--speed"),
        (["frf", "--position", "0.5", "--form", "inertance"], "inertance"),
        (["frf", "--position", "0.5", "--output", "wing"], "wing"),
        (["frf", "--position", "0.5", "--position", "0.5"], "given twice"),
        (["frf", "--position", "0.5", "--out", "frf.xls"], "'.xls'"),
        (["bode", "--position", "0.5", "--out", "bode.txt"], "'.txt'"),
        (["schedule", "--positions", "2"], "--positions"),
        (["absorber", "check", "--mass", "-0.1"], "'--mass': -0.1"),
        (["absorber", "design", "--tuning", "250:200:1"], "250:200:1"),
        (["absorber", "check", "--position", "1"], "position"),
        (["identify", "absent"], "absent"),
        (["identify", str(DEMO), "--band", "300:150"], "300:150"),
        (["diagnose", "absent"], "absent"),
        (["diagnose", str(DEMO), "--hold-out", "1.5"], "--hold-out 1.5"),
        (["diagnose", str(DEMO), "--effort", "0"], "effort = 0.0 must be above 0"),
        (["diagnose", str(DEMO), "--seed", "-1"], "--seed"),
        (["diagnose", str(DEMO), "--jobs", "0"], "--jobs"),
        (["diagnose"], "CAMPAIGN"),
        (["simulate"], "--position"),
    ],
)
def test_arguments_that_cannot_be_used(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _refused(arguments, [said], tmp_path, capsys)


def test_an_output_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["modes", "--position", "0.5", "--json", str(tmp_path / "absent" / "a.json")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert main(["bode", "--position", "0.5", "--out", str(tmp_path)]) == 2
    assert "is a folder" in capsys.readouterr().err
    same = str(tmp_path / "same.html")
    assert main(["diagnose", str(DEMO), "--json", same, "--report", same]) == 2
    assert "named for two outputs" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_a_folder_is_no_campaign() -> None:
    with pytest.raises(ParameterError, match=r"read a folder with cutvib_ss\.read_campaign first"):
        diagnose(DEMO)  # type: ignore[arg-type]
