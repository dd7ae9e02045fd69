"""The simpler methods: features of campaigns, lookups, a forest."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.validation import baselines
from cutvib_ss.validation.baselines import (
    answer,
    answered,
    forest,
    nearest_signature,
    seen_as,
    with_baselines,
)
from cutvib_ss.validation.cases import NONE, UNKNOWN, Case, read_cases
from cutvib_ss.validation.features import BANDS, CHANNELS, features
from cutvib_ss.validation.files import read_json
from cutvib_ss.validation.rows import rows
from cutvib_ss.validation.score import scored
from cutvib_ss.validation.seal import Trial
from tests.unit.blind_example import diagnosis, label, opened_trial
from tests.unit.test_blind_score import ABOUT

JOINT, GUIDE = frozenset({("cubic_stiffness", "joint2")}), frozenset({("guide_compliance", "head_base")})


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """Features of a campaign whose tool_x is 10 % too large, and twice that at the higher level; nothing else measured."""
    folder = tmp_path_factory.mktemp("campaign")
    freq = np.arange(10.0, 460.0, 0.5)
    machine = published_machine()
    lines = ['[campaign]\ntitle = "t"\n']
    for position in (0.3, 0.7):
        frf = frequency_response(machine, [position], freq, form="accelerance", outputs=["tool_x"]).data[0, 0, 0]
        for level, gain in ((20, 1.1), (80, 1.2)):
            name = f"p{position}_{level}.csv"
            table = np.column_stack([freq, gain * frf.real, gain * frf.imag, np.full(freq.size, 0.999)])
            head = "freq [Hz],tool_x re [m/s^2/N],tool_x im [m/s^2/N],tool_x coherence"
            np.savetxt(folder / name, table, delimiter=",", header=head, comments="")
            lines.append(f'[[record]]\nfile = "{name}"\nkind = "frf"\nposition = {position}')
            lines.append(f"peak_force = {level}\naverages = 3\n")
    (folder / "campaign.toml").write_text("\n".join(lines))
    return features(folder).reshape(len(CHANNELS), -1)


def test_features_tell_the_errors_size_and_phase(seen: np.ndarray) -> None:
    size, in_phase, quadrature = seen[0, : 3 * BANDS].reshape(3, -1)
    assert size == pytest.approx(np.mean(np.log10([0.1, 0.2])) * np.ones(BANDS), abs=1e-4)
    assert in_phase == pytest.approx(0.15 * np.ones(BANDS))
    assert quadrature == pytest.approx(np.zeros(BANDS), abs=1e-9)
    zones = seen[0, -5:]
    assert zones[[1, 3]] == pytest.approx(np.log10(np.sqrt((0.1**2 + 0.2**2) / 2)) * np.ones(2), abs=1e-4)
    assert not zones[[0, 2, 4]].any(), "no record there"


def test_features_tell_what_moves_with_the_level_and_what_coherence_is_lost(seen: np.ndarray) -> None:
    moved, lost = seen[0, 3 * BANDS : 4 * BANDS], seen[0, 4 * BANDS : 5 * BANDS]
    assert moved.min() > 0.5, "a tenth is far more than the noise that such a coherence allows"
    assert lost == pytest.approx(0.001 * np.ones(BANDS))


def test_features_of_what_was_not_measured_are_zero(seen: np.ndarray) -> None:
    assert not seen[1:].any()


@pytest.fixture
def clusters() -> tuple[np.ndarray, list, np.ndarray, list]:
    rng = np.random.default_rng(0)
    width = len(CHANNELS) * (5 * BANDS + 5)
    centres = rng.standard_normal((3, width))
    truths = [NONE, JOINT, GUIDE]
    pick = rng.integers(0, 3, 60)
    x = centres[pick] + 0.3 * rng.standard_normal((60, width))
    return x[:40], [truths[k] for k in pick[:40]], x[40:], [truths[k] for k in pick[40:]]


@pytest.mark.parametrize("method", ["nearest", "forest"])
def test_what_is_easy_is_learnt(method: str, clusters: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    learnt, truths, asked, expected = clusters
    if method == "forest":
        pytest.importorskip("sklearn")
        monkeypatch.setattr(baselines, "TREES", 30)
    odds = (nearest_signature if method == "nearest" else forest)(learnt, truths, asked)
    assert [max(o, key=lambda k: o[k]) for o in odds] == expected
    for o in odds:
        assert sum(o.values()) == pytest.approx(1.0)


def test_a_lookup_does_not_look_at_the_errors_size(clusters: Any) -> None:
    learnt, truths, asked, _ = clusters
    centre = learnt.mean(axis=0)
    stronger = centre + 3.0 * (asked - centre)
    assert nearest_signature(learnt, truths, stronger) == [
        {k: pytest.approx(v) for k, v in o.items()} for o in nearest_signature(learnt, truths, asked)
    ]


def test_an_answer_is_read_as_the_diagnosis_would_give_it() -> None:
    found = answer({JOINT: 0.6, GUIDE: 0.36, NONE: 0.04})
    assert (found.verdict, found.first, found.confidence) == ("ambiguous", JOINT, 0.6)
    assert found.likely == {JOINT, GUIDE}
    assert found.place == {"joint2"}
    assert answer({NONE: 0.7, JOINT: 0.3}).verdict == "no_gap"
    assert answer({UNKNOWN: 0.7, JOINT: 0.3}).verdict == "unknown"
    assert answer({JOINT: 1.0}).verdict == "explained"
    assert answer({}).verdict == "failed"


def test_baselines_stand_beside_the_score(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("sklearn")
    monkeypatch.setattr(baselines, "TREES", 20)
    effects = {"none": NONE, "cubic_stiffness": JOINT}
    truths = ["none", "cubic_stiffness"] * 6

    def cases() -> list:
        return [
            (label(e, "none" if e == "none" else "joint2"),
             diagnosis([("none", "none", 0.6), ("cubic_stiffness", "joint2", 0.4)], "ambiguous"))
            for e in truths
        ]  # fmt: skip

    learnt, asked = opened_trial(tmp_path / "a", cases(), 1), opened_trial(tmp_path / "b", cases(), 2)
    centre = {e: np.random.default_rng(i).standard_normal(3 * (5 * BANDS + 5)) for i, e in enumerate(effects)}

    def seen(folder: Path) -> np.ndarray:
        return centre[truths[int(folder.name[1:])]] + 0.01 * int(folder.name[1:])

    monkeypatch.setattr(baselines, "features", seen)
    score = scored(read_cases(Trial(asked), read_json(asked / "labels.json")["labels"]), ABOUT)
    found = with_baselines(score, [asked], [learnt])
    assert list(found.baselines) == ["nearest signature", "classifier"]
    right = {name: next(r for r in own if r.key == "right_all").estimate.value for name, own in found.baselines.items()}
    assert right == {"nearest signature": 1.0, "classifier": 1.0}
    # They name causes and correct no model.
    closed = {r.estimate.cases for own in found.baselines.values() for r in own if r.key == "achieved"}
    assert closed == {0}
    assert set(json.loads(json.dumps(found.to_dict(), allow_nan=False))["baselines"]) == set(right)
    for bad in (asked, tmp_path):
        with pytest.raises(ParameterError, match=r"the trial to be scored|is not open"):
            with_baselines(score, [asked], [bad])


def test_another_structure_is_left_without_an_answer(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(
        '[model]\nkind = "second_order"\ndofs = ["x"]\nmass = [[1.0]]\ndamping = [[1.0]]\nstiffness = [[1e6]]\n'
        '[ports]\ndrive = [1.0]\n[channels]\ny = { port = "drive", quantity = "acceleration" }\n[input]\nforce = "drive"\n'
    )
    freq = np.arange(10.0, 300.0)
    np.savetxt(
        tmp_path / "r.csv",
        np.column_stack([freq, freq, freq, np.ones_like(freq)]),
        delimiter=",",
        header="freq [Hz],y re [m/s^2/N],y im [m/s^2/N],y coherence",
        comments="",
    )
    (tmp_path / "campaign.toml").write_text(
        '[campaign]\ntitle = "t"\nmachine = "machine.toml"\n[[record]]\nfile = "r.csv"\nkind = "frf"\naverages = 3\n'
    )
    assert seen_as(tmp_path) is None


def test_another_methods_answers_take_no_time_and_no_gap_figures() -> None:
    one = Case("c", scored_truth(), answer({NONE: 1.0}), {"cpu_seconds": 3.0})
    (found,) = answered([one], [{JOINT: 1.0}])
    by_key = {r.key: r for r in rows([found])}
    assert by_key["right_large"].estimate.value == 1.0
    assert by_key["time_linear"].estimate.cases == 0
    assert by_key["excess_closed"].estimate.cases == 0


def scored_truth() -> Any:
    from cutvib_ss.validation.cases import truth_of

    return truth_of(label("cubic_stiffness", "joint2"))
