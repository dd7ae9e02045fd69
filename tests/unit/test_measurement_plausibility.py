"""Units off by a known factor, data that come twice, drifts of sensors: noticed, and no more than that."""

from types import SimpleNamespace

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.errors import DataFormatError
from cutvib_ss.measurement import History, read_campaign
from cutvib_ss.measurement.inputs import response_to
from cutvib_ss.measurement.plausibility import levels_over_nominal, same_data, without_drift
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from tests.unit import lab_files as lab
from tests.unit.measurement_rig import FS, impact

HEAD = "blow,time [s],force [N],tool_x [{}],tool_z [{}],base_x [{}]"


@pytest.fixture(scope="module")
def tables():
    return lab.blows(noise=1e-3)


def _csv(path, tables, unit="m/s^2", scale=(1.0, 1.0, 1.0, 1.0)):
    lines = [HEAD.format(unit, unit, unit)]
    for k, table in enumerate(tables):
        for t, row in zip(lab.time_axis(), (table * np.array(scale)[:, np.newaxis]).T, strict=True):
            lines.append(f"{k + 1},{t:.9g}," + ",".join(f"{x:.9g}" for x in row))
    path.write_text("\n".join(lines))


RECORD = '[[record]]\nfile = "{}"\nkind = "impact"\nposition = 0.4\n'


def _read(tmp_path, toml):
    (tmp_path / "campaign.toml").write_text(toml)
    return read_campaign(tmp_path)


@pytest.mark.parametrize(
    ("unit", "scale", "words"),
    [
        ("g", (1, 1, 1, 1), ["every response looks 9.81 times too large"]),
        ("m/s^2", (1, 1 / lab.G, 1 / lab.G, 1 / lab.G), ["every response looks 9.81 times too small"]),
        ("m/s^2", (1e-3, 1, 1, 1), ["every response looks 1000 times too large", "a force in kN that is called N"]),
        ("m/s^2", (1, 1e-3, 1, 1), ["tool_x looks 1000 times too small", "[channels]"]),
        ("m/s^2", (1, 1, 9.81, 1), ["tool_z looks 9.81 times too large"]),
        ("m/s^2", (1, 51.3, 1, 1), ["tool_x 51.3 times", "sensitivity"]),
    ],
)
def test_units_that_look_wrong(tmp_path, tables, unit, scale, words):
    _csv(tmp_path / "r.csv", tables, unit, scale)
    campaign = _read(tmp_path, RECORD.format("r.csv"))
    hints = [w for w in campaign.warnings if "nominal model" in w]
    assert len(hints) == 1
    for word in ("r.csv", *words):
        assert word in hints[0]
    # pointed out, not changed
    factor = lab.G if unit == "g" else 1.0
    np.testing.assert_allclose(
        campaign.records[0].histories[0].responses[0], factor * scale[1] * tables[0][1], rtol=1e-6, atol=1e-6
    )


def test_units_that_are_right(tmp_path, tables):
    _csv(tmp_path / "r.csv", tables, scale=(1, 1.3, 0.7, 1))
    assert not _read(tmp_path, RECORD.format("r.csv")).warnings


def test_machines_with_a_gap_are_not_suspected(shared):
    for name in ("c02", "c03", "c06", "c11"):
        assert not [w for w in read_campaign(shared / "campaigns" / name).warnings if "nominal model" in w]


def test_what_hardly_moves_by_symmetry_is_not_suspected():
    """A rotor that was hit across moved by what its bearings differ: thirty times as much as in the model, by no sensor's fault."""
    c = np.diag([2.0, 2.0])
    k = np.array([[8e4, 80.0], [80.0, 8e4]])
    ports = {"along": np.array([1.0, 0.0]), "across": np.array([0.0, 1.0])}
    channels = {n: Channel(n, "acceleration") for n in ports}
    rotor = Structure(SecondOrder(np.eye(2), c, k, ("a", "b"), ports), channels, "along")
    freq = np.arange(5.0, 100.0, 0.5)
    data = response_to("force", rotor, None, freq, tuple(ports)).data.reshape(1, 2, 1, -1).copy()
    seen = SimpleNamespace(freq=freq, data=data, variance=np.full(data.shape, 1e-20))
    record = SimpleNamespace(
        input="force", position=None, channels=tuple(ports), quantities=("acceleration",) * 2, band_hz=None
    )
    assert levels_over_nominal(record, rotor, seen)["along"][0] == pytest.approx(1.0)
    data[0, 1] *= 30.0
    assert "across" not in levels_over_nominal(record, rotor, seen)


FRF_HEAD = "freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N]"


def _levels(tmp_path, machine, responses):
    """Stepped sines at levels of 1, 4 and 12 N, each what a function of the level makes of the machine's own response."""
    freq = np.arange(20.0, 80.0, 0.5)
    own = cv.frequency_response(machine, [0.4], freq, inputs=["force"], outputs=["tool_x"]).data[0, 0, 0]
    toml = ""
    for level in (1.0, 4.0, 12.0):
        lines = [FRF_HEAD, *(f"{f},{h.real},{h.imag}" for f, h in zip(freq, responses(own, level), strict=True))]
        (tmp_path / f"at_{level:.0f}.csv").write_text("\n".join(lines))
        toml += f'[[record]]\nfile = "at_{level:.0f}.csv"\nkind = "frf"\nexcitation = "sine"\nposition = 0.4\n'
        toml += f"peak_force = {level}\n"
    return toml


def test_spectra_that_were_not_divided_by_the_force_are_refused(tmp_path):
    # Drag holds the resonance back, so that not all lines grow alike.
    toml = _levels(tmp_path, cv.published_machine(), lambda h, level: level * h / (1.0 + 0.05 * level * np.abs(h)))
    with pytest.raises(DataFormatError, match=r"campaign.toml: .*at_4.csv against at_1.csv.* divided by the force"):
        _read(tmp_path, toml)


def test_levels_that_differ_are_responses_all_the_same(tmp_path):
    toml = _levels(tmp_path, cv.published_machine(), lambda h, level: h * level**0.5)
    assert len(_read(tmp_path, toml).records) == 3


def test_the_same_data_in_fit_and_check(tmp_path, tables):
    _csv(tmp_path / "a.csv", tables)
    _csv(tmp_path / "b.csv", tables[:1], "g", (1, 1 / lab.G, 1 / lab.G, 1 / lab.G))  # another file, another unit
    toml = RECORD.format("a.csv") + 'use = "fit"\n' + RECORD.format("b.csv") + 'use = "check"\n'
    found = [w for w in _read(tmp_path, toml).warnings if "same data" in w]
    assert len(found) == 1
    assert "a.csv" in found[0]
    assert "b.csv" in found[0]
    assert "judged on" in found[0]


def test_the_same_data_without_use_and_a_blow_twice():
    record = impact(3, noise=0.01)
    one, other = same_data([record, record])[0], same_data([record])
    assert "count as one measurement" in one
    assert not other
    first = record.histories[0]
    twice = History(FS, first.force, first.responses, first.channels, "blow 9")
    doubled = type(record)(**{**record.__dict__, "histories": (*record.histories, twice)})
    assert "same blow twice (blow 1 is blow 9)" in same_data([doubled])[0]


def test_a_drift_is_taken_off_and_said():
    record = impact(2, noise=0.02)
    peak = float(np.max(np.abs(record.histories[0].responses)))
    slope = 0.2 * peak / 4.0
    drifting = tuple(History(h.fs, h.force, h.responses + slope * h.time, h.channels, h.name) for h in record.histories)
    steady, words = without_drift(type(record)(**{**record.__dict__, "histories": drifting}), "r.csv")
    assert len(words) == 1
    assert "r.csv: a drifts by 20 %" in words[0]
    for before, after in zip(record.histories, steady.histories, strict=True):
        off = (after.responses - before.responses)[0]
        assert np.ptp(off) < 0.02 * slope * 4.0
        np.testing.assert_array_equal(after.force, before.force)


def test_ringing_offsets_and_free_bodies_are_no_drift():
    for record in (impact(2, seconds=1.0), impact(2, offset=3.0, noise=0.05)):
        same, words = without_drift(record, "r")
        assert not words
        assert same is record
    record = impact(2)
    away = tuple(History(h.fs, h.force, h.responses + 5.0 * h.time, h.channels) for h in record.histories)
    body = type(record)(**{**record.__dict__, "histories": away, "quantities": ("displacement",)})
    assert without_drift(body, "r")[0] is body
