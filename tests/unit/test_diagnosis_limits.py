"""Limits of causes that are not there, on the published machine with noise and no gap."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.limits import limits
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.posterior import Counts
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.result import Limit
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.small_sizes import small_sizes
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.parameter_shift import ParameterShift
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.results import MeasuredFrequencyResponse

MACHINE = published_machine()
FREQ = np.arange(16.0, 300.0, 3.0)
CHANNELS, KINDS = ("tool_x", "base_x"), ("acceleration",) * 2
COUNTS = Counts(30, 6)


def measured(noise: float, mass: float = 0.0, model: Machine = MACHINE) -> tuple[Records, object]:
    """Responses of a machine, tool heavier by a mass, at three positions in one session."""
    rng = np.random.default_rng(11)
    model = AddedMass("tool", mass).apply(model) if mass else model
    records = []
    for y in (0.2, 0.45, 0.8):
        data = frequency_response(model, [y], FREQ, outputs=CHANNELS).data
        std = noise * np.abs(data).max(axis=-1, keepdims=True) * np.ones(FREQ.size)
        data = data + std * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape)) / np.sqrt(2)
        frf = MeasuredFrequencyResponse(
            data, FREQ, np.array([y]), CHANNELS, ("force",), KINDS, variance=std**2, averages=4
        )
        records.append(
            Record(f"r{y}", "frf", y, None, None, CHANNELS, KINDS, (), frf, 4, "multisine", session="monday")
        )
    observed = observe(Campaign("none", Path(), MACHINE, tuple(records)), MACHINE)
    return Records(observed.entries), observed


def limits_of(accepted: Fit, records: Records, observed: object) -> dict[tuple[str, str], Limit]:
    sizes = small_sizes(MACHINE, accepted, records, observed)
    return {(x.effect, x.place): x for x in limits(MACHINE, accepted, sizes, COUNTS) if x.parameter != "c1"}


def table(noise: float) -> dict[tuple[str, str], Limit]:
    records, observed = measured(noise)
    return limits_of(fit(MACHINE, records, Hypothesis()), records, observed)


@pytest.fixture(scope="module")
def found() -> dict[tuple[str, str], Limit]:
    return table(3e-3)


def test_added_mass_is_bounded_as_by_the_profile_likelihood(found: dict[tuple[str, str], Limit]) -> None:
    records, _ = measured(3e-3)

    def profile(mass: float) -> float:
        # All that the fit may move is fitted anew at each mass, and summed over, sizes as well.
        return -2.0 * fit(AddedMass("tool", mass).apply(MACHINE), records, Hypothesis()).log_evidence

    masses = np.linspace(-0.8, 0.8, 9) * found["added_mass", "tool"].allowed
    curve = np.polynomial.Polynomial.fit(masses, [profile(m) for m in masses], 2)
    # What is added is not negative: 95 % of the posterior of masses from zero on, the objective being -2 log of it.
    added = np.linspace(0.0, 5.0 * masses[-1], 20001)
    posterior = np.cumsum(np.exp(0.5 * (curve(added).min() - curve(added))))
    expected = added[np.searchsorted(posterior, 0.95 * posterior[-1])]
    limit = found["added_mass", "tool"]
    assert (limit.parameter, limit.unit) == ("mass", "kg")
    assert expected / 1.5 < limit.allowed < 1.5 * expected
    # Tuning within tolerance hides nearly all of a small mass: the bound is not that of the noise alone.
    assert limit.allowed > MACHINE.tolerance.m2 * MACHINE.head.m2


def test_the_bound_contains_a_mass_that_is_there() -> None:
    mass = 0.0174
    records, observed = measured(3e-3, mass)
    allowed = limits_of(fit(MACHINE, records, Hypothesis()), records, observed)["added_mass", "tool"].allowed
    assert mass < allowed < 3.0 * mass


def test_a_mass_is_named_from_what_is_visible(found: dict[tuple[str, str], Limit]) -> None:
    def odds(mass: float) -> float:
        """Logarithm of the odds of the mass against nothing, by both fits and the priors."""
        records, _ = measured(3e-3, mass)
        with_mass = fit(MACHINE, records, Hypothesis((AddedMass("tool", mass),)))
        gain = with_mass.log_evidence - fit(MACHINE, records, Hypothesis()).log_evidence
        return gain + np.log(SETTINGS.priors["known"] / COUNTS.known / SETTINGS.priors["none"])

    visible = found["added_mass", "tool"].visible
    assert odds(visible / 1.3) < np.log(9.0) < odds(1.3 * visible)


def test_limits_state_stiffnesses_from_below_and_all_are_finite(found: dict[tuple[str, str], Limit]) -> None:
    assert {"guide_compliance", "support_compliance", "added_mass", "tool_contact"} <= {e for e, _ in found}
    assert "structural_damping" not in {e for e, _ in found}
    for cause, limit in found.items():
        if cause[0] in ("parameter_shift", "calibration_error"):
            low, high = limit.allowed  # type: ignore[misc]
            assert 0.0 < low < 1.0 < high < np.inf
            assert limit.visible > 1.0
        elif cause[0] in ("channel_delay", "cross_axis"):
            low, high = limit.allowed  # type: ignore[misc]
            assert -np.inf < low < high < np.inf
        else:
            assert 0.0 < limit.allowed < np.inf  # type: ignore[operator]
        assert 0.0 < limit.visible < np.inf
    noisier = table(1.2e-2)
    # Four times the noise: a softer guide and a heavier tool pass unseen.
    guide, contact = ("guide_compliance", "head_base"), ("tool_contact", "tool")
    assert noisier[guide].visible < found[guide].visible
    assert noisier[contact].visible > found[contact].visible


def test_the_limit_of_a_shifted_value_is_that_of_its_tolerance_and_the_noise(
    found: dict[tuple[str, str], Limit],
) -> None:
    shift, gain = found["parameter_shift", "joint1"], found["calibration_error", "measurement"]
    assert (shift.parameter, shift.unit, gain.parameter) == ("k1", "1", "gain")
    # Within its tolerance a value is free; what the machine as a whole tells of it is less than that.
    assert np.log(shift.allowed[1]) == pytest.approx(1.96 * MACHINE.tolerance.k1, rel=0.5)  # type: ignore[index]
    # A shift that half of campaigns would name is allowed by none that does not show it.
    assert np.log(shift.visible) > 1.96 * MACHINE.tolerance.k1

    def odds(factor: float) -> float:
        records, _ = measured(3e-3, model=ParameterShift("joint1", "k1", factor).apply(MACHINE))
        shifted = fit(MACHINE, records, Hypothesis((ParameterShift("joint1", "k1", factor),)))
        gain = shifted.log_evidence - fit(MACHINE, records, Hypothesis()).log_evidence
        return gain + np.log(SETTINGS.priors["known"] / COUNTS.known / SETTINGS.priors["none"])

    size = np.log(shift.visible)
    assert odds(np.exp(size / 1.3)) < np.log(9.0) < odds(np.exp(1.3 * size))


def test_of_a_value_that_hardly_shows_the_limit_is_its_range() -> None:
    """As much noise as response: a joint's damping could be anything, and nothing fails."""
    records, observed = measured(2.0)
    sizes = small_sizes(MACHINE, fit(MACHINE, records, Hypothesis()), records, observed)
    found = {(x.place, x.parameter): x for x in limits(MACHINE, fit(MACHINE, records, Hypothesis()), sizes, COUNTS)}
    bounds = ParameterShift.ranges(MACHINE, "joint1")["factor"]
    for limit in found.values():
        assert np.isfinite([*np.atleast_1d(limit.allowed), limit.visible]).all()
    damping = found["joint1", "c1"]
    assert damping.visible == pytest.approx(bounds.high)
    low, high = damping.allowed  # type: ignore[misc]
    assert bounds.low <= low < 0.5
    assert 2.0 < high <= bounds.high * (1.0 + 1e-9)


def test_a_cause_that_was_named_has_no_limit() -> None:
    records, observed = measured(3e-3, 0.5)
    accepted = fit(MACHINE, records, Hypothesis((AddedMass("tool", 0.4),)))
    beside = limits_of(accepted, records, observed)
    assert ("added_mass", "tool") not in beside
    assert ("guide_compliance", "head_base") in beside
    several = replace(accepted, hypothesis=Hypothesis((AddedMass("tool", 0.4), AddedMass("head", 0.1))))
    assert not limits_of(several, records, observed)
