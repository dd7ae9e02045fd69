"""The examples and the README's lines run as they stand."""

import re
import runpy
from pathlib import Path

import pytest

import cutvib_ss
from cutvib_ss.model.machine import Machine
from cutvib_ss.model_files import read_machine

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLES = [
    pytest.param(path, marks=pytest.mark.slow) if "diagnose" in path.name else path
    for path in sorted((ROOT / "examples").glob("*.py"))
]


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out
    assert any(tmp_path.iterdir())


def _blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_readme_machine_reads(tmp_path: Path) -> None:
    [machine] = [block for block in _blocks("toml") if "[head]" in block]
    (tmp_path / "machine.toml").write_text(machine, encoding="utf-8")
    model = read_machine(tmp_path / "machine.toml")
    assert isinstance(model, Machine)
    assert model.rail.parameters.n_modes == 20


def test_the_readme_campaign_reads(tmp_path: Path) -> None:
    [campaign] = [block for block in _blocks("toml") if "[[record]]" in block]
    demo = Path(cutvib_ss.__file__).parent / "data" / "demo"
    (tmp_path / "records").mkdir()
    (tmp_path / "records" / "p1.tdms").write_bytes((demo / "records" / "p2.tdms").read_bytes())
    (tmp_path / "machine.toml").write_bytes((demo / "machine.toml").read_bytes())
    (tmp_path / "campaign.toml").write_text(campaign, encoding="utf-8")
    record = cutvib_ss.read_campaign(tmp_path).records[0]
    assert (record.position, record.peak_force) == (0.27, 60.0)


def test_the_readme_program_runs_up_to_the_campaign(capsys: pytest.CaptureFixture[str]) -> None:
    [program] = _blocks("python")
    before, _, after = program.partition("campaign = ")
    assert "cv.diagnose(campaign)" in after
    exec(compile(before, "README.md", "exec"), {})
    assert "(2, 3, 1, 490) m/s^2/N" in capsys.readouterr().out
