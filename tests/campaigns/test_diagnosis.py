"""The diagnosis end to end: on the demonstration, whose maker shares no code with it, and on labelled campaigns where they are."""

import json
import math
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.diagnose import diagnose
from cutvib_ss.errors import ParameterError
from cutvib_ss.measurement.campaign import read_campaign
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.stepping import modal_form, step

# What docs/demo_campaign.md says that its maker put into the demonstration.
DEMO = {"mass": 1.5604, "frequency": 171.624, "damping_ratio": 0.04846}


@pytest.fixture(scope="module")
def campaign():
    return read_campaign(Path(str(files("cutvib_ss"))) / "data" / "demo")


@pytest.fixture(scope="module")
def diagnosis(campaign):
    return diagnose(campaign, seed=1)


def test_the_demonstration_is_explained(diagnosis):
    assert diagnosis.verdict == "explained"
    assert (diagnosis.causes[0].effect, diagnosis.causes[0].place) == ("local_resonator", "head")
    assert diagnosis.where.place == "head"
    assert diagnosis.next_test is None


def test_its_parameters_are_recovered_within_their_deviations(diagnosis):
    for name, truth in DEMO.items():
        fitted = diagnosis.causes[0].parameters[name]
        assert abs(fitted.value - truth) < 4 * fitted.std
        assert fitted.std < 0.05 * truth


def test_the_gap_shrinks_to_noise_on_records_that_were_not_fitted(diagnosis):
    gap = diagnosis.gap
    assert gap.before > gap.tuned > gap.after
    assert gap.after < 1.05 * gap.noise_floor
    assert gap.shrinkage == pytest.approx(1 - gap.after / gap.before)
    assert gap.shrinkage_interval[0] < gap.shrinkage < gap.shrinkage_interval[1]
    assert diagnosis.causes[0].reduced_chi2 == pytest.approx(1.0, abs=0.1)


def test_json_holds_to_the_contract(diagnosis):
    def refuse(name):
        raise AssertionError(f"{name} in JSON")

    data = json.loads(diagnosis.to_json(), parse_constant=refuse)
    assert data["schema"] == "cutvib-diagnosis/1"
    assert set(data["gap"]) == {
        "unit", "before", "tuned", "after", "noise_floor", "band_hz", "shrinkage", "shrinkage_interval",
    }  # fmt: skip
    assert data["gap"]["unit"] == "g/N"
    assert math.isclose(sum(c["probability"] for c in data["causes"]), 1.0, abs_tol=1e-9)
    probabilities = [c["probability"] for c in data["causes"]]
    assert probabilities == sorted(probabilities, reverse=True)
    assert {("none", "none")} <= {(c["effect"], c["place"]) for c in data["causes"]}
    assert "unknown" in {c["effect"] for c in data["causes"]}
    assert math.isclose(sum(p["probability"] for p in data["where"]["places"]), 1.0, abs_tol=1e-9)
    assert data["ambiguity_set"] == [0]
    assert data["next_test"] is None
    assert {"position", "error", "noise", "floor"} == set(data["where"]["by_position"][0])
    assert {"channel", "error", "noise", "floor"} == set(data["where"]["by_channel"][0])


def test_the_corrected_machine_is_a_machine(diagnosis):
    machine = diagnosis.corrected_machine
    assert machine.plant(0.5).nstates > diagnosis.nominal.plant(0.5).nstates
    assert frequency_response(machine, [0.3], [171.0]).data.shape == (1, 3, 1, 1)


@pytest.mark.slow
def test_names_titles_and_order_do_not_matter(campaign, diagnosis):
    shuffled = replace(
        campaign, title="another", records=tuple(replace(r, name=f"x{i}") for i, r in enumerate(campaign.records[::-1]))
    )
    again = diagnose(shuffled, seed=1)
    assert again.verdict == diagnosis.verdict
    assert again.causes[0].effect == diagnosis.causes[0].effect
    assert again.gap.before == pytest.approx(diagnosis.gap.before)
    assert again.causes[0].parameters["mass"].value == pytest.approx(
        diagnosis.causes[0].parameters["mass"].value, rel=1e-3
    )


@pytest.mark.parametrize("arguments", [{"hold_out": 0.0}, {"hold_out": 1.5}, {"jobs": 0}])
def test_impossible_arguments(campaign, arguments):
    with pytest.raises(ParameterError):
        diagnose(campaign, **arguments)


# Machines that move between positions: what they do not repeat is left by a right model, too.
DRIFTING = ("c10", "c11", "c12")
# c02 was made with a twist mesh that is 2.5 % off at midspan: the discrepancy carries that, the corrected machine does not.
COARSE = ("c02",)


def labelled(shared, name):
    label = json.loads((shared / "campaigns" / "labels.json").read_text())[name]
    return label, diagnose(read_campaign(shared / "campaigns" / name))


def leaves_noise(name, diagnosis):
    """Whether a right model's error is left: of noise, and where the machine moves of what it does not repeat."""
    floor = diagnosis.gap.noise_floor
    if name in DRIFTING:
        floor = np.mean([row.floor for row in diagnosis.where.by_position])
    return diagnosis.gap.after < (1.2 if name in COARSE else 1.1) * floor


def is_right(name, label, diagnosis):
    if label["effect"] == "none":
        return diagnosis.verdict == "no_gap" and diagnosis.where.place == "none"
    first = diagnosis.causes[0]
    return (
        diagnosis.verdict == "explained"
        and (first.effect, first.place) == (label["effect"], label["place"])
        and leaves_noise(name, diagnosis)
    )


LINEAR = [pytest.param(f"c{k:02}", marks=pytest.mark.slow) for k in (2, 3, 4, 7, 8, 9, 10, 11)]


@pytest.mark.parametrize("name", ["c01", *LINEAR])
def test_labelled_campaigns(shared, name):
    assert is_right(name, *labelled(shared, name))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["c05", "c06", "c12"])
def test_labelled_nonlinear_campaigns(shared, name):
    label, diagnosis = labelled(shared, name)
    assert is_right(name, label, diagnosis)
    assert diagnosis.where.level_dependent


def free_run_error(model, history):
    """Error of a simulation that knows the force alone, after the first 200 samples, over the motion."""
    form = modal_form(model, None, history.channels)
    simulated = step(form, history.force[None], history.fs, model.nonlinear).responses[0, 0, 200:]
    measured = history.responses[0, 200:]
    return np.sqrt(np.mean((simulated - measured) ** 2) / np.var(measured))


@pytest.mark.slow
def test_measured_duffing_circuit(shared):
    folder = shared / "data" / "silverbox" / "campaign"
    if not folder.is_dir():
        pytest.skip("no silverbox records")
    campaign = read_campaign(folder)
    diagnosis = diagnose(campaign)
    first = diagnosis.causes[0]
    assert (diagnosis.verdict, first.effect, first.place) == ("explained", "cubic_stiffness", "spring")
    assert diagnosis.gap.after < 0.1 * diagnosis.gap.tuned
    assert diagnosis.gap.after < 1.1 * diagnosis.gap.noise_floor
    # The loudest record, which no fit has seen: a linear model leaves a third of it.
    (held_out,) = [r.histories[0] for r in campaign.records if r.use == "check"]
    assert free_run_error(diagnosis.nominal, held_out) > 0.3
    assert free_run_error(diagnosis.corrected_machine, held_out) < 0.02
