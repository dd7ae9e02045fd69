"""Cases of the trial: drawn from a seed, labelled, written so that the package reads them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("exudyn")

import cutvib_ss as cv
from cutvib_ss.validation.rig import CAUSES, OUTSIDE_KINDS, Case, bulk, draw_case, write_campaign
from cutvib_ss.validation.rig.blows import FINE, FS, Blow, Pulse, antialiased
from cutvib_ss.validation.rig.causes import LOSING, STORING
from cutvib_ss.validation.rig.chain import frequencies, smooth_error
from cutvib_ss.validation.rig.conditions import FORMATS
from cutvib_ss.validation.rig.structure import TOLERANCE, Rig, scattered

SMALL = {"positions": (0.2, 0.6), "levels": (50.0,), "blows": 2, "overloads": 0}
EVERY = [("single", cause) for cause in CAUSES] + [("outside", kind) for kind in OUTSIDE_KINDS]


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_the_catalogue_is_the_contracts_and_there_is_enough_outside_it() -> None:
    assert len(CAUSES) == len(set(CAUSES)) == 22
    assert len(OUTSIDE_KINDS) >= 6
    assert not set(CAUSES) & set(OUTSIDE_KINDS)


@pytest.mark.parametrize(("kind", "cause"), EVERY)
def test_every_cause_is_drawn_with_a_place_and_changes_the_machine(kind: str, cause: str) -> None:
    case = draw_case(7, kind, cause, severity=(1.0, 1.001))
    (fault,) = case.faults
    assert (fault.effect, case.kind) == (cause, kind)
    assert fault.place
    assert all(isinstance(value, str) or np.isfinite(value) for value in fault.parameters.values())
    assert (case.rig == case.plain) == (cause == "modal_truncation")


@pytest.mark.parametrize("cause", ["added_mass", pytest.param("cubic_stiffness", marks=pytest.mark.slow)])
def test_a_seed_gives_one_case_and_another_seed_another(cause: str, tmp_path: Path) -> None:
    for name, seed in (("a", 11), ("b", 11), ("c", 12)):
        write_campaign(draw_case(seed, "single", cause, conditions=SMALL), tmp_path / name)
    first, again, other = (contents(tmp_path / name) for name in "abc")
    assert first == again
    assert first != other


def test_the_digitiser_s_ranges_hold_the_hardest_blow_whatever_the_levels() -> None:
    hardest = 1.4 * 100.0
    for seed in range(12):
        drawn = draw_case(seed, "none", conditions={"levels": (20.0, 100.0)}).conditions
        assert min(drawn.force_range, drawn.response_range) > hardest


@pytest.mark.parametrize("file_format", FORMATS)
def test_the_package_reads_every_format(file_format: str, tmp_path: Path) -> None:
    channels = ("tool_x", "base_x")
    conditions = SMALL | {"file_format": file_format, "unit": "g", "channels": channels, "levels": (20.0, 60.0)}
    case = draw_case(3, "none", conditions=conditions)
    write_campaign(case, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"campaign.toml", "machine.toml", "records"}
    campaign = cv.read_campaign(tmp_path)
    assert [(r.position, r.peak_force) for r in campaign.records] == list(case.campaign.records)
    assert all(record.channels == channels for record in campaign.records)
    if case.conditions.frf:
        data = campaign.records[0].frf.data[0, :, 0]
        kept = [0, 2]
        assert data == pytest.approx(case.campaign.frf(0).data[kept], rel=1e-6)
        assert campaign.records[0].frf.averages == 2
    else:
        assert len(campaign.records[0].histories) == 2
        force, shown = case.campaign.recording(0, 1)
        assert campaign.records[0].histories[1].force == pytest.approx(force, rel=1e-6, abs=1e-5)
        assert campaign.records[0].histories[1].responses == pytest.approx(shown[[0, 2]], rel=1e-5, abs=1e-5)
    assert campaign.machine.head.k1 == case.nominal.head.k1
    assert campaign.machine.tolerance.k1 == TOLERANCE["k1"]


def test_nothing_in_the_files_tells_the_cause(tmp_path: Path) -> None:
    for cause in ("crack", "cable_pull"):
        write_campaign(draw_case(3, "outside", cause, conditions=SMALL), tmp_path / cause)
    one, other = (contents(tmp_path / cause) for cause in ("crack", "cable_pull"))
    assert list(one) == list(other)
    assert one["campaign.toml"] == other["campaign.toml"]
    assert one["machine.toml"] == other["machine.toml"]


def test_labels_are_json_and_say_how_large_the_gap_is() -> None:
    def label(case: Case) -> dict[str, object]:
        read: dict[str, object] = json.loads(json.dumps(case.label, allow_nan=False))
        named = {"effect", "place", "parameters", "severity", "kind", "gap_sigma", "conditions"}
        assert set(read) == named | {"machine", "form", "grade", "equivalent_places", "unstable_blows"}
        return read

    assert label(draw_case(5, "none", conditions=SMALL))["gap_sigma"] == 0.0
    weak, strong = (
        label(draw_case(5, "single", "guide_compliance", severity=(s, 1.001 * s), conditions=SMALL)) for s in (0.3, 1.5)
    )
    assert 0.1 < weak["gap_sigma"] < 0.5 * strong["gap_sigma"] < 5.0
    assert label(draw_case(5, "outside", "crack", conditions=SMALL))["effect"] == "outside:crack"


def test_of_a_pair_the_larger_share_comes_first() -> None:
    for order in ("guide_compliance+cross_axis", "cross_axis+guide_compliance"):
        label = draw_case(5, "pair", order, severity=(1.0, 1.001), conditions=SMALL).label
        assert (label["effect"], label["place"]) == ("guide_compliance+cross_axis", "head_base+measurement")
        assert set(label["parameters"]) == {"guide_compliance", "cross_axis"}


def test_two_forces_of_a_pair_share_a_place_only_where_one_stores_energy_and_one_loses_it() -> None:
    shared = 0
    for seed in range(100):
        a, b = draw_case(seed, "pair").faults
        assert a.effect != b.effect
        if a.place == b.place:
            shared += 1
            assert (
                len({a.effect, b.effect}.intersection(STORING)) == len({a.effect, b.effect}.intersection(LOSING)) == 1
            )
    assert 0 < shared < 20
    assert [f.place for f in draw_case(2, "pair", "cubic_stiffness+joint_slip").faults] == ["joint2", "joint2"]


def test_a_truncated_nominal_model_is_what_lacks_modes() -> None:
    case = draw_case(5, "single", "modal_truncation", severity=(1.0, 1.001), conditions=SMALL)
    assert case.nominal.n_modes < 5 < case.faults[0].parameters["n_modes"]
    assert case.gap_sigma > 0.3


def test_machines_as_built_scatter_within_the_tolerance() -> None:
    rng = np.random.default_rng(1)
    rigs = [scattered(Rig(), rng) for _ in range(400)]
    for name, tolerance in TOLERANCE.items():
        if name != "calibration":
            values = np.log([rig.value(name) / Rig().value(name) for rig in rigs])
            assert np.std(values) == pytest.approx(tolerance, rel=0.15)
            assert abs(np.mean(values)) < 4 * tolerance / 20


def test_calibration_errors_are_smooth_and_of_a_percent() -> None:
    rng = np.random.default_rng(1)
    freq = frequencies()
    errors = np.array([smooth_error(rng, freq) for _ in range(300)]) - 1.0
    band = (freq > 30) & (freq < 450)
    assert np.std(errors.real[:, band]) == pytest.approx(0.01, rel=0.3)
    assert np.std(errors.imag[:, band]) == pytest.approx(0.01, rel=0.3)
    assert np.abs(np.diff(errors[:, band], axis=1)).max() < 1e-3  # in a step of 0.25 Hz
    assert np.abs(errors.imag[:, 0]).max() == 0.0  # what a real filter does at 0 Hz is real


def test_the_digitisers_filter_neither_delays_nor_changes_the_band() -> None:
    history = Blow((Pulse(0.05, 50.0, 2.8e-3, -0.1),)).force()
    time = np.arange(history.size) / (FS * FINE)
    kept = antialiased(history)
    freq = np.arange(15.0, 450.0, 40.0)
    exact = np.exp(-2j * np.pi * np.outer(freq, time)) @ history / (FS * FINE)
    sampled = np.exp(-2j * np.pi * np.outer(freq, np.arange(kept.size) / FS)) @ kept / FS
    assert sampled == pytest.approx(exact, rel=3e-4)
    tone = antialiased(np.sin(2 * np.pi * 2600.0 * time))
    assert np.abs(tone[400:-400]).max() < 1e-3  # above half the rate: gone, not folded


def test_overloads_clip_a_channel_in_histories_and_are_left_out_of_responses() -> None:
    case = draw_case(9, "none", conditions=SMALL | {"file_format": "tdms", "overloads": 1})
    ((record, blow),) = case.campaign.overloaded()
    quiet = replace(case, conditions=replace(case.conditions, overloads=0))
    peaks = [np.abs(c.campaign.recording(record, blow)[1]).max(axis=1) for c in (case, quiet)]
    assert np.sum(peaks[0] < 0.95 * peaks[1]) == 1
    assert case.campaign.frf(record).averages == 1


def test_bulk_resumes_and_keeps_labels_apart_from_campaigns(tmp_path: Path) -> None:
    plan = bulk.plan(40, 5, {"none": 0.3, "single": 0.5, "outside": 0.1, "pair": 0.1})
    assert plan[:10] == bulk.plan(10, 5, {"none": 0.3, "single": 0.5, "outside": 0.1, "pair": 0.1})
    assert [kind for _, kind, _ in plan].count("single") == 20
    label = bulk.make(tmp_path / "c0001", 4, "single", "cross_axis", (1.0, 1.001))
    written = contents(tmp_path)
    assert bulk.make(tmp_path / "c0001", 4, "single", "cross_axis", (1.0, 1.001)) == label
    assert contents(tmp_path) == written
    assert not any(b"cross_axis" in text for name, text in written.items() if name.startswith("c0001/"))


def test_a_channel_that_is_at_fault_is_measured() -> None:
    channels = set()
    for seed in range(30):
        case = draw_case(seed, "single", "channel_delay", conditions={"channels": ("tool_x",)})
        channel = case.faults[0].parameters["channel"]
        assert channel in (*case.conditions.channels, "all")
        channels.add(channel)
    assert channels == {"tool_x", "tool_z", "base_x", "all"}


def test_an_unknown_cause_is_refused() -> None:
    with pytest.raises(ValueError, match="'gremlins' is no single cause"):
        draw_case(1, "single", "gremlins")
