"""What was found beside the verdict, in the report and in words."""

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.consequence_result import Consequence, Consequences, Loop
from cutvib_ss.diagnosis.findings import (
    Band,
    ChannelGap,
    Distances,
    DynamicStiffness,
    ElementType,
    Findings,
    Metric,
    NuGap,
    PlaceScore,
)
from cutvib_ss.plot import stiffness_grid
from cutvib_ss.report import details, report_html
from tests.unit.diagnosis_example import example_diagnosis

FREQ = np.linspace(20.0, 400.0, 200)
NEAR, FAR = Distances(0.002, 0.99, 0.4, 0.02), Distances(0.03, 0.6, 4.0, 0.5)


def stiffness(**changes):
    z = 2e5 + 150j * 2 * np.pi * FREQ
    plain = DynamicStiffness(
        place="head", variant="head_x", label="head_x", quantity="dynamic stiffness", unit="N/m", shape=None, freq=FREQ,
        levels=(None,), value=z[None], std=np.full((1, FREQ.size), 1e4),
        element_type=ElementType("spring and damper", "k + iωc", {"stiffness": 2e5, "damping": 150.0}, 0.97),
    )  # fmt: skip
    return replace(plain, **changes)


FINDINGS = Findings(
    metrics=tuple(
        Metric(y, 50.0, c, FAR, replace(FAR, mean_modulus=0.02), NEAR, replace(FAR, mean_modulus=0.011), 0.0019, 0.03)
        for y in (0.1, 0.5)
        for c in ("tool_x", "base_x", "all")
    ),
    nu_gap=NuGap((ChannelGap("tool_x", 0.61, 0.5, 0.41, 0.02, 0.03, 0.52),), "holds", "at every measured position"),
    bands=(
        Band(20.0, 180.0, 0.004, 0.003, 0.002, 0.0019, 0.003, False, (), False, False, float("nan")),
        Band(180.0, 240.0, 0.12, 0.1, 0.002, 0.0019, 0.05, True, ((0.1, 210.0), (0.5, 223.0)), True, False, 0.98),
    ),
    place_scores=(PlaceScore("head", "head_x", 0.7, 0.95), PlaceScore("joint1", "joint1", 1.4, 0.05)),
    stiffness=(stiffness(),),
    consequences=Consequences(
        frequency=217.0,
        channel="tool_x",
        unit="g/N",
        vibration=(Consequence(0.5, 0.21, (0.2, 0.22), 0.15, (0.14, 0.17), (0.67, 0.78), 0.209),),
        controller="resonant",
        loops=(Loop(0.5, True, 1.4, 0.6, 12.0, 4.5),),
        warnings=("one level was measured",),
    ),
)
DIAGNOSIS = replace(example_diagnosis(lines=30, records=1), findings=FINDINGS)


@pytest.fixture(scope="module")
def page():
    return " ".join(report_html(DIAGNOSIS).split())


@pytest.mark.parametrize(
    "said",
    [
        "looks like a spring and damper",
        "stiffness 2·10⁵ N/m",
        "Would a controller notice?",
        "is not sure of its margins",
        "The winding condition holds",
        "moves with the position, 210 to 223 Hz",
        "98 % is common to all records of a position",
        "What it means",
        "0.21 (0.2 to 0.22)",
        "-28.6 % (-33.0 to -22.0 %)",
        "attenuates 4.5 dB at worst, 12.0 dB intended",
        "one level was measured",
        "times the best",
    ],
)
def test_page_says_what_was_found(page, said):
    assert said in page.replace("&#39;", "'")


def test_rows_average_over_records_and_leave_the_joint_channel_out():
    rows = details.metric_rows(FINDINGS.metrics, "channel")
    assert [r[0] for r in rows] == ["tool_x", "base_x"]
    assert rows[0][1:6] == ("0.03", "0.02", "0.002", "0.011", "0.0019")
    assert [r[0] for r in details.metric_rows(FINDINGS.metrics, "position")] == ["0.1", "0.5"]


@pytest.mark.parametrize(("distance", "said"), [(0.05, "hardly any"), (0.2, "small margins"), (0.6, "not sure")])
def test_sentence_follows_the_distance(distance, said):
    row = replace(FINDINGS.nu_gap.channels[0], before=distance, models=0.0)
    assert said in details.nu_gap_sentence(replace(FINDINGS.nu_gap, channels=(row,)))


def test_unstable_loop_is_said():
    consequences = replace(FINDINGS.consequences, loops=(Loop(0.5, False, 1.4, 0.0, 12.0, float("nan")),))
    assert "unstable at 1 of 1" in details.consequences_sentence(consequences)
    assert details.loop_rows(consequences.loops)[0][-2:] == ("unstable", "-")


def test_picture_shows_each_level_and_the_law():
    [real, imaginary] = stiffness_grid([stiffness()]).axes
    assert len(real.lines) == len(imaginary.lines) == 3  # zero, the function, the law
    np.testing.assert_allclose(imaginary.lines[2].get_ydata(), 150 * 2 * np.pi * FREQ)
    value = np.array([[1.0], [2.0]]) * stiffness().value
    two = stiffness(levels=(15.0, 60.0), value=value, std=np.full(value.shape, 1e4), element_type=None)
    assert [line.get_label() for line in stiffness_grid([two]).axes[0].lines[1:]] == ["at 15 N", "at 60 N"]


def test_json_has_it_all_and_no_nan():
    data = DIAGNOSIS.to_dict()
    assert data["where"]["metrics"][0]["before"]["nu_gap"] == 0.5
    assert data["where"]["bands"][0]["coherence"] is None
    assert data["where"]["dynamic_stiffness"][0]["rows"][0]["imag"][0] == pytest.approx(150 * 2 * np.pi * 20)
    assert data["consequences"]["vibration"][0]["ratio_interval"] == [0.67, 0.78]
    assert "NaN" not in DIAGNOSIS.to_json()
