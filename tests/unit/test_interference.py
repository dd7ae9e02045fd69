"""Tones that no structure makes are told, left out, and no cause is fitted to them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.measurement import read_campaign
from cutvib_ss.measurement.checks import check_record
from cutvib_ss.measurement.estimation import measured_response
from cutvib_ss.measurement.interference import interference
from cutvib_ss.measurement.records import History, Record
from cutvib_ss.measurement.summary import summarise
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files import write_machine
from cutvib_ss.report.answer import to_do, why_sentences
from cutvib_ss.report.wording import verdict_sentence
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.stepping import modal_form, step
from cutvib_ss.results import MeasuredFrequencyResponse
from cutvib_ss.results.arrays import optional_array
from tests.unit.struck_oscillator import MASS, OSCILLATOR, struck

FREQ = np.arange(14.0, 310.0, 0.5)
CHANNELS = ("tool_x", "tool_z")
BLOWS = 3


def tone(rng, f0, shape):
    """Transforms of tones over the noise: each blow meets another phase; boxcar of one over the lines' distance."""
    phase = rng.uniform(0, 2 * np.pi, (*shape[:2], 1))
    off = (FREQ - f0) / 0.5
    return np.exp(1j * (phase - np.pi * off)) * np.sinc(off)


def records(tones=(), power=0.0, scatter=None, averages=BLOWS, seed=3):
    """Three positions, H1 of blows by a unit force: noise, tones of a power over it, and what scatters besides."""
    rng, out = np.random.default_rng(seed), []
    for y in (0.2, 0.5, 0.7):
        true = frequency_response(published_machine(), y, freq=FREQ, outputs=CHANNELS, inputs=("force",)).data[0, :, 0]
        noise = np.full(true.shape, 1e-3 * np.median(np.abs(true)))
        shape = (BLOWS, *true.shape)
        each = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)
        for f0 in tones:
            each = each + np.sqrt(power) * tone(rng, f0, shape)
        each = true + noise * each
        if scatter is not None:
            each = each + scatter(true) * rng.standard_normal((BLOWS, 1, 1))
        mean = each.mean(axis=0)
        spread = np.sum(np.abs(each - mean) ** 2, axis=0) / np.sum(np.abs(each) ** 2, axis=0)
        seen = {"coherence": 1.0 - spread[None, :, None], "averages": averages} if averages > 1 else {}
        out.append(
            MeasuredFrequencyResponse(
                mean[None, :, None], FREQ, optional_array([y]), CHANNELS, ("force",), ("acceleration",) * 2,
                variance=noise[None, :, None] ** 2 / BLOWS, **seen,
            )
        )  # fmt: skip
    return out


@pytest.mark.parametrize("tones", [(47.3,), (33.4, 181.1)])
def test_a_tone_is_told_by_what_scatters(tones):
    found = interference(records(tones, 100.0))
    assert found.mains is None
    assert len(found.widths) == len(tones)
    for f0 in tones:
        assert found.spoils(np.array([f0])).all()
    # A boxcar's skirts fall with the square of the distance.
    assert max(found.widths.values()) == pytest.approx(0.5 * np.sqrt(100.0 / 0.5) / np.pi, rel=0.5)
    assert 0.9 < np.mean(~found.spoils(FREQ)) < 1.0


@pytest.mark.parametrize(("averages", "f0", "mains"), [(BLOWS, 50.0, 50.0), (1, 60.0, 60.0), (1, 57.0, None)])
def test_mains_need_nobody_to_have_seen_the_scatter(averages, f0, mains):
    found = interference(records(f0 * np.arange(1, 6), 100.0, averages=averages))
    assert (found and found.mains) == mains
    if mains:
        assert found.excess > 0.1
        assert set(found.widths) >= set(f0 * np.arange(1, 6)) - {100.0}


def test_noise_is_none():
    assert all(interference(records(seed=s)) is None for s in range(20))
    assert interference(records(averages=1)) is None
    assert all(interference(records(averages=1, seed=s)[:1]) is None for s in range(20))


def test_beside_blows_what_scatters_in_blocks_is_no_tone_of_its_own():
    """What leaks from blocks at a sharp resonance scatters there as a tone does: rail modes of 25 and 13.5 Hz were tones."""
    blocks = records((47.3,), 100.0, seed=4)
    assert interference(records(), blocks) is None
    alone, both = interference([], blocks), interference(records((47.3,), 30.0), blocks)
    assert set(alone.widths) == set(both.widths)
    # Where blows show it, too, blocks tell how far it reaches in them.
    assert (
        max(both.widths.values())
        == max(alone.widths.values())
        > max(interference(records((47.3,), 30.0)).widths.values())
    )


def test_excess_is_the_power_over_the_lines():
    found = interference(records((47.3,), 30.0))
    assert found.excess == pytest.approx(30.0 * np.sinc(0.4) ** 2 / FREQ.size, rel=0.5)


def test_a_zero_of_the_response_is_none():
    # what scatters in proportion to the response is noise as well, and vanishes with it; the rest does not
    clean = records(scatter=None)
    zero = 1.0 - np.exp(-(((FREQ - 90.0) / 1.5) ** 2))
    shown = [replace(r, variance=r.variance * np.maximum(zero, 1e-3)) for r in clean]
    assert interference(shown) is None


def test_resonances_that_scatter_are_none():
    # What a restoring force does from blow to blow is largest at the peaks, and in the response as well.
    assert interference(records(scatter=lambda h: 0.02 * h * np.abs(h) / np.abs(h).max())) is None


def test_where_nothing_would_be_left_all_lines_stay():
    campaign = struck(hum=1.0)
    narrow = replace(campaign, records=tuple(replace(r, band_hz=(48.0, 52.0)) for r in campaign.records))
    assert [e.freq.size for e in observe(narrow, narrow.machine).entries] == [9, 9, 9]
    assert all(e.freq.size < 452 for e in observe(campaign, campaign.machine).entries)


def test_what_a_campaign_holds_says_so():
    assert any("interference of the mains" in w for w in summarise(struck(hum=1.0)).warnings)
    assert any("trigger jitter" in w for w in summarise(struck(jitter=2e-4)).warnings)
    assert summarise(struck()).warnings == ()
    quiet, loud = (summarise(struck(hum=h)) for h in (0.0, 10.0))
    assert max(p.difference for p in loud.levels) < max(p.difference for p in quiet.levels) + 0.02


def test_hum_is_no_cause() -> None:
    assert diagnose(struck()).verdict == "no_gap"
    found = diagnose(struck(hum=1.0))
    assert (found.verdict, found.causes[0].effect, found.causes[0].place) == ("unknown", "unknown", "measurement")
    assert found.where.place == "measurement"
    assert any("interference of the mains of 50 Hz" in w for w in found.warnings)
    assert verdict_sentence(found).startswith("The measurement is disturbed (interference of the mains of 50 Hz)")
    assert any(step.startswith("Measure again without interference of the mains") for step in to_do(found))
    assert not any("tolerances make credible" in s for s in why_sentences(found))


def test_hum_hides_no_cause() -> None:
    first = diagnose(struck(hum=1.0, mass=1.1 * MASS)).causes[0]
    assert first.place != "measurement"
    assert first.effect in ("added_mass", "parameter_shift")


@pytest.mark.parametrize(("hum", "sign"), [(30.0, 1.0), (30.0, -1.0), (1000.0, 1.0)])
def test_hum_turns_no_sensor(hum, sign):
    record = struck(hum=hum).records[0]
    turned = replace(record, histories=tuple(replace(h, responses=sign * h.responses) for h in record.histories))
    said = check_record(turned, OSCILLATOR, "r0")[1]
    assert any("opposite" in w for w in said) == (sign < 0.0), said


@pytest.mark.parametrize("averages", [BLOWS, 1])
def test_resonances_beside_multiples_of_the_mains_are_none(averages):
    freq = np.arange(7.0, 664.0, 0.5)
    natural = np.array([57.97, 101.24, 152.47, 247.98, 358.92, 400.21])
    modes = 1.0 / (natural[:, None] ** 2 - freq**2 + 2j * 0.012 * natural[:, None] * freq)
    true = np.array([modes.sum(axis=0), (modes * np.array([1, -1, 1, -1, 1, -1])[:, None]).sum(axis=0)])
    rng, noise = np.random.default_rng(5), np.full(true.shape, 1e-3 * np.median(np.abs(true)))
    each = true + noise * (rng.standard_normal((BLOWS, 2, freq.size, 2)) @ [1, 1j]) / np.sqrt(2)
    mean = each.mean(axis=0)
    spread = np.sum(np.abs(each - mean) ** 2, axis=0) / np.sum(np.abs(each) ** 2, axis=0)
    seen = {"coherence": 1.0 - spread[None, :, None], "averages": averages} if averages > 1 else {}
    shown = MeasuredFrequencyResponse(
        mean[None, :, None], freq, optional_array([None]), CHANNELS, ("force",), ("displacement",) * 2,
        variance=noise[None, :, None] ** 2 / BLOWS, **seen,
    )  # fmt: skip
    assert interference([shown]) is None


@pytest.mark.parametrize("kind", ["noise", "multisine", "sweep"])
def test_a_resonance_that_a_sweep_has_left_behind_is_no_tone(kind, tmp_path) -> None:
    """An oscillator of 30 Hz, struck by nothing, rings on at its own frequency in blocks whose force has gone elsewhere."""
    fs, block, count = 512.0, 1024, 12
    t, rng = np.arange(block * count) / fs, np.random.default_rng(0)
    force = {
        "noise": rng.standard_normal(t.size),
        "multisine": np.tile(rng.standard_normal(block), count),
        "sweep": signal.chirp(t, 8.0, t[-1], 110.0, method="logarithmic"),
    }[kind]
    model = Structure(
        SecondOrder(*(np.array([[x]]) for x in (1.0, 1.5, (2 * np.pi * 30.0) ** 2)), ("x",), {"p": np.ones(1)}),
        {"y": Channel("p", "acceleration")}, "p",
    )  # fmt: skip
    moved = step(modal_form(model), force[None], fs).responses[0, 0]
    rows = np.column_stack([t, force, moved + 1e-3 * moved.std() * rng.standard_normal(t.size)])
    write_machine(model, tmp_path / "machine.toml")
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="time [s],force [N],y [m/s^2]", comments="")
    (tmp_path / "campaign.toml").write_text(
        '[campaign]\ntitle = "t"\nmachine = "machine.toml"\n\n[[record]]\nfile = "r.csv"\nkind = "timeseries"\nblock = 2.0\n'
    )
    campaign = read_campaign(tmp_path)
    (entry,) = observe(campaign, campaign.machine).entries
    assert (entry.replay.shared < SETTINGS.record_swept) == (kind == "sweep")
    assert not any(w.startswith("interference") for w in observe(campaign, campaign.machine).warnings)
    # The sweep's scatter would be one.
    assert (interference([entry.response]) is not None) == (kind == "sweep")


def test_what_leaks_from_blocks_at_a_resonance_is_no_tone(monkeypatch) -> None:
    """Two light modes under noise, in blocks of 1.28 s, in which neither has died out."""
    fs, count, rng = 800.0, 48000, np.random.default_rng(1)
    model = Structure(
        SecondOrder(
            np.eye(2), 0.02 * np.eye(2), np.array([[1.5e4, -5e3], [-5e3, 2.5e4]]), ("a", "b"), {"p": np.eye(2)[0]}
        ),
        {"y": Channel("p", "displacement")}, "p",
    )  # fmt: skip
    out = []
    for level in (1.0, 3.0, 9.0):
        force = level * rng.standard_normal(count)
        moved = step(modal_form(model), force[None], fs).responses[0, 0]
        shown = moved + 1e-3 * moved.std() * rng.standard_normal(count)
        history = History(fs, force + 1e-3 * level * rng.standard_normal(count), shown[None], ("y",))
        record = Record("r", "timeseries", None, level, None, ("y",), ("displacement",), (history,), block=1.28)
        out.append(measured_response(record))
    assert interference([], out) is None
    monkeypatch.setattr("cutvib_ss.measurement.interference._Lines.resonates", lambda self, tone: False)
    assert interference([], out) is not None
