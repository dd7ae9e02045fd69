"""The demonstration campaign: independent of the package, small, silent about its answer, and right."""

import ast
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import nptdms
import numpy as np
import pytest

import cutvib_ss
from cutvib_ss.measurement import read_campaign
from cutvib_ss.model.elements import Attachment, SprungMass
from cutvib_ss.model.machine import Machine
from cutvib_ss.model.rail import Rail
from cutvib_ss.parameters import HeadParameters, RailParameters
from cutvib_ss.response.frequency import frequency_response

GENERATOR = Path(__file__).parents[1] / "demo_campaign" / "make_demo_campaign.py"
DEMO = Path(cutvib_ss.__file__).parent / "data" / "demo"


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_demo_campaign", GENERATOR)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # dataclasses look their module up by name
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "make_demo_campaign", module)
        spec.loader.exec_module(module)
    return module


def test_the_generator_imports_nothing_of_the_package() -> None:
    imported = set()
    for node in ast.walk(ast.parse(GENERATOR.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(str(node.module).split(".")[0])
    assert imported == {"argparse", "sys", "dataclasses", "pathlib", "numpy", "scipy", "nptdms"}


def test_the_campaign_is_small_and_reads_without_a_remark() -> None:
    files = [file for file in DEMO.rglob("*") if file.is_file()]
    assert sum(file.stat().st_size for file in files) < 1_200_000
    campaign = read_campaign(DEMO)
    assert campaign.warnings == ()
    assert [record.position for record in campaign.records] == [0.06, 0.27, 0.46, 0.68, 0.9]
    assert all(len(record.histories) == 3 for record in campaign.records)


def test_the_folder_says_nothing_of_the_answer() -> None:
    for file in DEMO.rglob("*"):
        if file.is_file():
            content = file.read_bytes().lower()
            assert not any(word in content for word in (b"compliance", b"support", b"k_left", b"resonator", b"hidden"))


def test_its_physics_are_those_of_the_closed_form(generator: ModuleType) -> None:
    rng = np.random.default_rng(generator.SEED)
    hidden, built = generator.draw_hidden(rng), generator.draw_as_built(rng)
    head = HeadParameters(
        *(built[n] for n in ("m1", "m2", "l1", "l2")), *generator.ANGLES, *(built[n] for n in ("k1", "k2", "c1", "c2"))
    )
    bare = RailParameters(generator.LENGTH, built["mass"], built["first_frequency"], built["damping_ratio"], 100)
    mass, frequency, ratio = hidden.resonator
    machine = Machine(head, Rail(bare), attachments=(Attachment("head_x", SprungMass(mass, frequency, ratio)),))
    freq = np.array([25.0, 90.0, 150.0, 217.0, 300.0, 430.0])
    for position in (0.06, 0.68):
        expected = frequency_response(machine, [position], freq).data[0, :, 0]
        made = generator.assemble(position, built, hidden)
        for f, column in zip(freq, expected.T, strict=True):
            s = 2j * np.pi * f
            motion = np.linalg.solve(
                made.stiffness + s * made.damping + s**2 * made.mass, made.rows["tool_x"].astype(complex)
            )
            got = np.array([s**2 * row @ motion for row in made.rows.values()])
            assert np.abs(got - column).max() < 2e-5 * np.abs(expected).max()


@pytest.mark.slow
def test_the_same_seed_makes_the_same_records(
    generator: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", ["make_demo_campaign.py", str(tmp_path)])
    generator.main()
    assert (tmp_path / "campaign.toml").read_text() == (DEMO / "campaign.toml").read_text()
    for name in ("p1", "p5"):
        made, shipped = (nptdms.TdmsFile.read(f / "records" / f"{name}.tdms") for f in (tmp_path, DEMO))
        for group in shipped.groups():
            for channel in group.channels():
                # another linear algebra library may round the last bit of the converter the other way
                same = made[group.name][channel.name][:]
                assert np.abs(same - channel[:]).max() <= 2 * generator.FULL_SCALE[channel.name] / 2**23
