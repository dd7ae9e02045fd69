"""Measured campaigns with a documented cause in one table, and an element that arithmetic adds to a record."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.cli import main
from cutvib_ss.errors import DataFormatError, ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.measurement.records import History, Record
from cutvib_ss.report.blind import measured_html
from cutvib_ss.report.frame import plotly_script
from cutvib_ss.results import MeasuredFrequencyResponse
from cutvib_ss.validation.measured import MeasuredRow, add_element, halved, read_label

MASS, DAMPING, STIFFNESS = 2.0, 8.0, 8.0e4
FREQ = np.arange(10.0, 80.0, 0.5)
MACHINE = f"""
[model]
kind = "second_order"
dofs = ["x"]
mass = [[{MASS}]]
damping = [[{DAMPING}]]
stiffness = [[{STIFFNESS}]]
[ports]
drive = [1.0]
[channels]
a = {{ port = "drive", quantity = "acceleration" }}
[input]
force = "drive"
[tolerance]
mass = 0.002
damping = 0.1
stiffness = 0.002
calibration = 0.002
drift = 0.0005
"""


def receptance(freq: np.ndarray, mass: float = MASS) -> np.ndarray:
    s = 2j * np.pi * freq
    return 1.0 / (mass * s**2 + DAMPING * s + STIFFNESS)


def write(folder: Path, mass: float, label: str | None, seed: int, records: int = 2) -> None:
    """A campaign of an oscillator by its formula, with noise of a known spread."""
    folder.mkdir(parents=True)
    (folder / "machine.toml").write_text(MACHINE)
    rng = np.random.default_rng(seed)
    text = '[campaign]\ntitle = "oscillator"\nmachine = "machine.toml"\n'
    for k in range(records):
        data = receptance(FREQ, mass) * (2j * np.pi * FREQ) ** 2
        std = 3e-3 * np.abs(data).max()
        data = data + std * (rng.standard_normal(FREQ.size) + 1j * rng.standard_normal(FREQ.size)) / np.sqrt(2)
        rows = [f"{f},{d.real},{d.imag}" for f, d in zip(FREQ, data, strict=True)]
        (folder / f"r{k}.csv").write_text("freq [Hz],a re [m/s^2/N],a im [m/s^2/N]\n" + "\n".join(rows) + "\n")
        text += f'[[record]]\nfile = "r{k}.csv"\nkind = "frf"\nexcitation = "multisine"\nsession = "s{k}"\n'
    (folder / "campaign.toml").write_text(text)
    if label is not None:
        (folder / "label.toml").write_text(label)


@pytest.fixture(scope="module")
def rigs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A heavier oscillator, one as its model, and one that nobody labelled and that cannot be read."""
    root = tmp_path_factory.mktemp("rigs")
    # A resonance far above the band is a mass too.
    mass = 'effect = ["added_mass", "parameter_shift", "local_resonator"]\nplace = ["drive", "structure"]\n'
    write(root / "heavier" / "monday", 1.1 * MASS, mass, 1)
    write(root / "plain", MASS, 'effect = "none"\nplace = "none"\n', 2)
    write(root / "spoilt", MASS, None, 3)
    (root / "spoilt" / "r1.csv").unlink()
    return root


def test_table(rigs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "table.json"
    assert main(["blind", "real", str(rigs), "--json", str(target), "--halves"]) == 0
    said = capsys.readouterr().out
    assert "r1.csv" in said
    data = json.loads(target.read_text())
    assert data["schema"] == "cutvib-blind-real/1"
    rows = {row["campaign"]: row for row in data["campaigns"]}
    assert list(rows) == ["heavier/monday", "plain", "spoilt"]
    heavier, plain, spoilt = rows.values()
    # 10 % more mass against a tolerance of 0.2 %: seen, under any of its three names.
    assert heavier["rank"] == 1
    assert heavier["probability"] > 0.9
    assert heavier["place_right"] is True
    assert heavier["share"] > 0.9
    assert (plain["verdict"], plain["rank"], plain["place_right"]) == ("no_gap", 1, True)
    assert plain["halves"] == ["no_gap", "no_gap"]
    assert plain["halves_agree"] is True
    assert (spoilt["verdict"], spoilt["effects"]) == (None, None)
    assert "r1.csv" in spoilt["error"]


def test_labels(tmp_path: Path) -> None:
    assert read_label(tmp_path) is None
    (tmp_path / "label.toml").write_text('effect = "freeplay"\nplace = ["joint1", "joint2"]\n')
    label = read_label(tmp_path)
    assert label is not None
    assert label.names("freeplay", "joint2")
    assert not label.names("freeplay", "tool")
    for wrong in ('effect = "freeplay"\n', "effect = 3\nplace = 'tool'\n", "effect = ["):
        (tmp_path / "label.toml").write_text(wrong)
        with pytest.raises(DataFormatError, match=r"label\.toml"):
            read_label(tmp_path)


def test_halves_share_every_record(tmp_path: Path) -> None:
    write(tmp_path / "five", MASS, None, 4, records=5)
    campaign = read_campaign(tmp_path / "five")
    one, two = halved(campaign)
    assert [r.name for r in one.records] == ["r0.csv", "r2.csv", "r4.csv"]
    assert [r.name for r in two.records] == ["r1.csv", "r3.csv"]
    write(tmp_path / "single", MASS, None, 4, records=1)
    with pytest.raises(ParameterError, match="at least two"):
        halved(read_campaign(tmp_path / "single"))


def frf_record(data: np.ndarray, variance: np.ndarray, **more: object) -> Record:
    names, kinds = ("a", "v"), ("acceleration", "velocity")
    frf = MeasuredFrequencyResponse(
        data[None, :, None], FREQ, np.array([np.nan]), names, ("force",), kinds, variance=variance[None, :, None]
    )
    return Record("r", "frf", None, 2.0, None, names, kinds, (), frf, **more)


@pytest.mark.parametrize("z", [lambda s: 0.3 * s**2, lambda s: 5.0 * s + 2e4])
def test_element_added_to_frequency_responses_is_that_of_the_oscillator(z) -> None:
    s = 2j * np.pi * FREQ
    data = receptance(FREQ) * np.array([s**2, s])
    exact = 1.0 / (1.0 / receptance(FREQ) + z(s)) * np.array([s**2, s])
    record = frf_record(data, np.ones(data.shape), excitation="sine")
    changed = add_element(record, z, channel="a")
    assert changed.frf is not None
    np.testing.assert_allclose(changed.frf.data[0, :, 0], exact, rtol=1e-12)
    # The motion is as it was: x = H F.
    np.testing.assert_allclose(changed.force_amplitude * np.abs(exact[0]), 2.0 * np.abs(data[0]), rtol=1e-12)
    back = add_element(changed, lambda s: -z(s), channel="a")
    np.testing.assert_allclose(back.frf.data, record.frf.data, rtol=1e-10)


def test_variance_is_that_of_repetitions() -> None:
    s = 2j * np.pi * FREQ
    data = receptance(FREQ) * np.array([s**2, s])
    std = 1e-3 * np.abs(data)
    rng = np.random.default_rng(6)
    several = []
    for _ in range(600):
        noise = std * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
        several.append(add_element(frf_record(data + noise, std**2), lambda s: 0.3 * s**2, channel="a").frf.data)
    stated = add_element(frf_record(data, std**2), lambda s: 0.3 * s**2, channel="a").frf.variance
    seen = np.mean(np.abs(np.array(several) - np.mean(several, axis=0)) ** 2, axis=0)
    np.testing.assert_allclose(seen.mean(axis=-1), stated.mean(axis=-1), rtol=0.05)


def test_element_added_to_histories_is_the_force_that_it_takes() -> None:
    # A nonlinear oscillator in a steady motion of two lines: f = m a + c v + k x + k3 x^3.
    fs, n = 1024.0, 2048
    t = np.arange(n) / fs
    lines = ((12.0, 2e-3, 0.3), (31.0, 1e-3, 1.1))
    x, v, a = (
        sum(b * (2 * np.pi * f) ** q * np.sin(2 * np.pi * f * t + p + q * np.pi / 2) for f, b, p in lines)
        for q in range(3)
    )
    force = MASS * a + DAMPING * v + STIFFNESS * x + 3e9 * x**3
    extra = (0.3, 5.0, 2e4)
    exact = force + extra[0] * a + extra[1] * v + extra[2] * x
    for response, quantity in ((x, "displacement"), (v, "velocity"), (a, "acceleration")):
        history = History(fs, force, response[None], ("y",))
        record = Record("r", "timeseries", None, float(force.max()), None, ("y",), (quantity,), (history,))
        changed = add_element(record, lambda s: extra[0] * s**2 + extra[1] * s + extra[2])
        np.testing.assert_allclose(changed.histories[0].force, exact, atol=1e-9 * np.abs(exact).max())
        np.testing.assert_array_equal(changed.histories[0].responses, history.responses)
        assert changed.peak_force == pytest.approx(force.max() * np.abs(exact).max() / np.abs(force).max())


def test_element_needs_a_drive_point_and_a_force() -> None:
    s = 2j * np.pi * FREQ
    record = frf_record(receptance(FREQ) * np.array([s**2, s]), np.ones((2, FREQ.size)))
    with pytest.raises(ParameterError, match="a, v"):
        add_element(record, lambda s: s**2)
    with pytest.raises(ParameterError, match="base"):
        add_element(
            frf_record(record.frf.data[0, :, 0], np.ones((2, FREQ.size)), input_quantity="acceleration"), lambda s: s**2
        )
    with pytest.raises(ParameterError, match="not finite at 10 Hz"):
        add_element(record, lambda s: np.full(s.shape, np.inf), channel="a")


def test_the_page_of_measured_campaigns_holds_every_row_and_loads_nothing() -> None:
    rows = (
        MeasuredRow("beam", ("added_mass",), ("tip",), "explained", 0.97, 1, "added_mass at tip", True, 0.9, 0.01),
        MeasuredRow(
            "frame", ("support_compliance",), ("rail_ends",), "ambiguous", 0.1, 3, "guide_compliance at head_base", False,
            limits=({"effect": "support_compliance", "place": "rail_ends", "parameter": "k_left", "unit": "N/m",
                     "allowed": 2e7, "visible": (-9e6, 9e6)},),
        ),
        MeasuredRow("broken", error="records/p1.csv: <truncated>"),
    )  # fmt: skip
    page = measured_html(rows).replace(plotly_script(), "")
    assert not re.search(r'(?:src|href)="[^"#]|https?://|url\(', page)
    assert "The documented cause is named first in 1 of 2; its place is in the set of places in 1." in page
    assert "-9e+06 to 9e+06" in page
    assert "records/p1.csv: &lt;truncated&gt;" in page
    found = re.search(r'id="charts-data">(.*?)</script>', page, re.DOTALL)
    assert found
    assert [(c["name"], c["probability"], c["rank"]) for c in json.loads(found[1])["campaigns"]] == [
        ("beam", 0.97, 1),
        ("frame", 0.1, 3),
    ]
    assert "charts-data" not in measured_html(rows[2:])
