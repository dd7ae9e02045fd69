"""Elements added to measured rigs: a sealed set whose causes are known exactly."""

from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.cli import main
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.validation.cases import answer_of, truth_of
from cutvib_ss.validation.files import unpack
from cutvib_ss.validation.measured_set import available, elements, measured_trial
from cutvib_ss.validation.plan import requests
from tests.unit.test_blind_measured import FREQ, MASS, receptance, write

LABEL = 'effect = ["dry_friction", "joint_slip"]\nplace = "drive"\n'


def test_elements_are_added_to_every_record_and_the_label_says_which(tmp_path: Path) -> None:
    write(tmp_path / "rigs" / "slips", MASS, LABEL, 1)
    write(tmp_path / "rigs" / "unlabelled", MASS, None, 2)
    assert available(tmp_path / "rigs") == ("slips|spring|0", "slips|mass|0", "slips|resonator|0")
    asked, tools = measured_trial(tmp_path / "rigs", 5)
    planned = requests(asked, tools.causes, tools.outside)
    assert sorted(str(r.cause) for r in planned) == sorted(tools.causes)
    mass = next(r for r in planned if r.cause == "slips|mass|0")
    made = tools.rig(mass)
    assert tools.rig(mass) == made, "the same seed makes the same case"
    label = made.label
    assert (label["effect"], label["place"]) == ("dry_friction+added_mass", "drive+drive")
    assert label["or"] == [{"effect": "joint_slip+added_mass", "place": "drive+drive"}]
    unpack(made.campaign, tmp_path / "made")
    before, after = (read_campaign(folder) for folder in (tmp_path / "rigs" / "slips", tmp_path / "made"))
    added = label["parameters"]["added_mass"]["mass"]
    assert 0.04 * MASS < added < 0.2 * MASS
    s = 2j * np.pi * FREQ
    for one, other in zip(before.records, after.records, strict=True):
        # y / F / (1 + z H), z H = m s^2 H: the channel is the acceleration itself
        exact = one.frf.data[0, 0, 0] / (1 + added * one.frf.data[0, 0, 0])
        np.testing.assert_allclose(other.frf.data[0, 0, 0], exact, rtol=1e-9)
        assert other.session == one.session
    ideal = receptance(FREQ, MASS + added) * s**2
    assert np.abs(other.frf.data[0, 0, 0] - ideal).max() < 0.1 * np.abs(ideal).max()


def test_rigs_without_a_cause_make_no_set(tmp_path: Path) -> None:
    write(tmp_path / "unlabelled", MASS, None, 2)
    with pytest.raises(ParameterError, match=r"label\.toml"):
        available(tmp_path)
    assert main(["blind", "measured", str(tmp_path / "absent"), "--out", str(tmp_path / "out")]) == 2


def test_elements_leave_the_resonance_in_the_band() -> None:
    centre = 80.0
    for room in (0.01, 0.05, 1.0):
        for seed in range(20):
            made = elements(2.0, 2.0 * (2 * np.pi * centre) ** 2, centre, room, np.random.default_rng(seed))
            s = 2j * np.pi * centre * np.linspace(1 - room, 1 + room, 4001)[1:-1]
            for one in made.values():
                shown = np.abs(1 / (2.0 * s**2 + 0.02 * s + 2.0 * (2 * np.pi * centre) ** 2 + one.stiffness(s)))
                assert 0 < int(np.argmax(shown)) < s.size - 1


def test_a_spring_on_one_coordinate_may_be_called_a_shift_of_the_stiffness() -> None:
    def says(parameter: str) -> dict[str, object]:
        row = {
            "effect": "cubic_stiffness+parameter_shift", "place": "spring+structure", "probability": 1.0,
            "parameters": {"parameter_shift.parameter": {"value": parameter}},
        }  # fmt: skip
        return {"verdict": "explained", "causes": [row], "ambiguity_set": [0], "where": {"place": "spring"}}

    label = {"effect": "cubic_stiffness+tool_contact", "place": "spring+spring", "kind": "pair"}
    shifts = {"stiffness": ["tool_contact", "spring"]}
    for parameter, right in (("stiffness", True), ("mass", False)):
        first = answer_of(says(parameter), shifts).first
        assert first is not None
        assert truth_of(label).holds(first) is right


def test_the_shown_rigs_allow_ten_cases(shared: Path, tmp_path: Path) -> None:
    names = available(shared / "data")
    # the band of the bolted beam is too narrow for a spring or a mass beyond its tolerances
    assert len(names) == 10
    assert {n for n in names if n.startswith("brb") and "resonator" not in n} == set()
    asked, tools = measured_trial(shared / "data", 1)
    for request in requests(asked, tools.causes, ()):
        if request.cause in ("silverbox/campaign|spring|0", "brb/force_control|resonator|0"):
            made = tools.rig(request)
            unpack(made.campaign, tmp_path / str(request.seed))
            campaign = read_campaign(tmp_path / str(request.seed))
            assert len(campaign.records) == 4
            assert made.label["machine"] == "measured"
