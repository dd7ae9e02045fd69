"""Unknown elements along the rail, in guide and supports, and in the channels: each is the best where the fault is its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cutvib_ss.diagnosis.fit import Fit, fit
from cutvib_ss.diagnosis.hypotheses import candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.ranking import Ranked, first_steps, refit
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.unknown_element import (
    UnknownChannelError,
    UnknownPole,
    UnknownSensor,
    unknown_candidates,
    unknown_places,
)
from cutvib_ss.diagnosis.unknown_search import _known_there, best_unknown
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.elements import Attachment, Guide, SpringDamperMass, SprungMass
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.rail import EndSupports, RailAttachment
from cutvib_ss.response.frequency import frequency_response
from cutvib_ss.response.modes import modes
from tests.unit.diagnosis_example import example_structure
from tests.unit.record_example import entry_of

FREQ = np.linspace(60.0, 260.0, 40)
BAND = (60.0, 260.0)
CHANNELS = ("tool_x", "tool_z")


def carrier() -> Machine:
    """A mass on a spring to ground at a point of the rail: no cause of the catalogue has that form."""
    machine = published_machine()
    lump = RailAttachment(SpringDamperMass(stiffness=4e5, damping=60.0, mass=3.0), 0.37)
    return replace(machine, rail=replace(machine.rail, attachments=(lump,)))


def on_ends() -> Machine:
    """The machine on ends that give."""
    machine = published_machine()
    return replace(machine, rail=replace(machine.rail, supports=EndSupports(4e7, 4e7, 300.0, 300.0)))


def filtered(machine: Machine, channel: str, data: np.ndarray) -> np.ndarray:
    """A channel behind a first-order low pass of 300 Hz."""
    out = data.copy()
    out[..., CHANNELS.index(channel), :] /= 1.0 + 1j * FREQ / 300.0
    return out


def records(true: Machine, late: str = "") -> Records:
    """Three positions with noise of half a percent."""
    rng, entries = np.random.default_rng(3), []
    for i, position in enumerate((0.22, 0.5, 0.81)):
        data = frequency_response(true, [position], FREQ, outputs=list(CHANNELS)).data[0, :, 0]
        data = filtered(true, late, data) if late else data
        size = 0.005 * np.abs(data)
        noise = size / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        entries.append(
            entry_of(i, position, 50.0, data + noise, size**2, FREQ, CHANNELS, ("acceleration",) * 2, blow_at=0.0)
        )
    return Records(tuple(entries))


def found_at(measured: Records, sites: set[str]) -> dict[str, Fit]:
    """The best fit at each site on the way that the search takes: few lines with a widened noise first."""
    nominal = published_machine()
    few = measured.coarse(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error)
    out: dict[str, Fit] = {}
    for element in (e for c in unknown_candidates(nominal, BAND, CHANNELS) for e in c.starts):
        if element.site not in sites:  # type: ignore[attr-defined]
            continue
        rough = first_steps(nominal, few, Hypothesis((element,)), None, SETTINGS.search_later_steps)
        fine = rough and refit(nominal, measured, rough.hypothesis, rough.x, SETTINGS.search_most_steps)
        own = out.get(element.site)  # type: ignore[attr-defined]
        if fine and (own is None or fine.log_evidence > own.log_evidence):
            out[element.site] = fine  # type: ignore[attr-defined]
    return out


@pytest.mark.parametrize(
    ("true", "late", "site", "other"),
    [
        (carrier(), "", "rail", "head_base"),
        (replace(published_machine(), guide=Guide(4e7, 900.0)), "", "head_base", "joint1"),
        (on_ends(), "", "rail_ends", "joint1"),
        (published_machine(), "tool_z", "channel tool_z", "channel tool_x"),
    ],
)
def test_the_site_of_the_fault_has_most_evidence(true: Machine, late: str, site: str, other: str) -> None:
    fits = found_at(records(true, late), {site, other})
    found = fits[site]
    assert (
        found.log_evidence > max((f.log_evidence for name, f in fits.items() if name != site), default=-np.inf) + 10.0
    )
    assert found.reduced < 1.2
    [element] = found.hypothesis.effects
    if site == "rail":
        assert element.position == pytest.approx(0.37, abs=0.03)  # type: ignore[attr-defined]
    if not late:
        # The modes of a model with it are those of what equals it at each pole.
        assert modes(found.model, 0.5).natural_freq[1] == pytest.approx(modes(true, 0.5).natural_freq[1], rel=0.02)


def test_a_resonance_in_a_joint_is_a_pair_of_poles_there() -> None:
    nominal, resonance = published_machine(), SprungMass(2.7e-4, 130.0, 0.02)
    measured = records(replace(nominal, attachments=(Attachment("joint2", resonance),)))
    few = measured.coarse(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error)
    elements = [Hypothesis(c.starts[:1]) for c in unknown_candidates(nominal, BAND, CHANNELS)]
    with Workers(1) as workers:
        found = best_unknown(nominal, measured, few, elements, None, workers)
    best = max(found, key=lambda r: r.fit.log_evidence).fit
    assert (best.hypothesis.effect, best.hypothesis.place) == ("unknown", "joint2")
    _, pole = best.hypothesis.effects
    assert isinstance(pole, UnknownPole)
    assert pole.mass == pytest.approx(resonance.mass, rel=0.02)
    assert pole.frequency == pytest.approx(resonance.frequency, rel=1e-3)
    assert pole.damping_ratio == pytest.approx(resonance.damping_ratio, rel=0.05)
    assert best.reduced < 1.2
    # A smooth function holds no resonance: alone it leaves hundreds of times the noise.
    assert fit(nominal, measured, Hypothesis(best.hypothesis.effects[:1]), best.x[: best.first_effect]).reduced > 100.0


def test_no_element_is_fitted_on_all_lines_that_lies_far_behind_a_cause_that_leaves_noise() -> None:
    nominal, measured = published_machine(), records(on_ends())
    few = measured.coarse(SETTINGS.search_coarse_lines, SETTINGS.search_coarse_error)
    elements = [
        Hypothesis(c.starts[:1]) for c in unknown_candidates(nominal, BAND, CHANNELS) if c.starts[0].place == "joint1"
    ]
    right = fit(nominal, measured, Hypothesis((SupportCompliance("rail_ends", 3e7, 3e7, 300.0, 300.0),)))
    wrong = fit(nominal, measured, Hypothesis((AddedMass("tool", 0.01),)))
    assert right.reduced < 1.1
    with Workers(1) as workers:
        beside = [
            best_unknown(nominal, measured, few, elements, None, workers, Ranked("rival", r, True))
            for r in (right, wrong)
        ]
    assert beside[0] == []
    assert len(beside[1]) > 0


def test_every_site_is_counted_among_the_places() -> None:
    for model in (published_machine(), example_structure()):
        assert [c.starts[0].place for c in unknown_candidates(model, BAND, CHANNELS)] == list(
            unknown_places(model, CHANNELS)
        )
    assert not {"rail", "head_base", "rail_ends"} & set(unknown_places(example_structure(), CHANNELS))


def test_an_error_of_no_channel_is_refused() -> None:
    error = unknown_candidates(published_machine(), BAND, ("shaker",))[-1].starts[0]
    with pytest.raises(ParameterError, match="no channel 'shaker'"):
        error.apply(published_machine())


def test_known_causes_are_fitted_where_something_unknown_leads_all_of_them() -> None:
    nominal, measured = published_machine(), records(RailAddedMass("rail", 0.37, 1.5, 0.0).apply(published_machine()))
    [unknown] = [f for site, f in found_at(measured, {"rail"}).items() if site == "rail"]
    leading = Ranked("unknown", unknown, True)
    known = [c for c in candidates(nominal, BAND, CHANNELS) if c.starts[0].effect in ("rail_added_mass", "rail_shear")]
    with Workers(1, None) as workers:
        found = {r.name: r for r in _known_there(nominal, measured, leading, known, [], workers)}
        assert set(found) == {c.name for c in known}
        mass = found["rail_added_mass"]
        assert mass.refined
        assert mass.fit.log_evidence > unknown.log_evidence
        # One that leads is enough.
        assert not _known_there(nominal, measured, leading, known, [mass], workers)


def test_an_error_of_a_channel_within_its_tolerance_is_no_cause() -> None:
    machine = published_machine()
    tolerance = machine.tolerance.calibration
    assert tolerance is not None
    over = 2j * np.pi * np.geomspace(*BAND, 200)
    unit = UnknownChannelError("measurement", "tool_x", 1.0, *BAND, c8=1.0, c7=-0.5, c17=0.4)
    error = unit.element.dynamic_stiffness(over)
    size = float(np.sqrt(np.mean(error.real**2)))
    assert size > np.sqrt(np.mean(error.imag**2)) > 0.0
    within, beyond = (replace(unit, scale=part * tolerance / size) for part in (1.9, 2.1))
    assert within.tolerated(machine)
    assert not beyond.tolerated(machine)
    # A phase counts as a gain does.
    assert not replace(unit, scale=10.0 * tolerance, c8=0.0, c7=0.0).tolerated(machine)
    # A sensor that errs with the level is not one that is calibrated badly.
    assert not UnknownSensor("measurement", "tool_x", within.scale, *BAND, c8=1.0).tolerated(machine)
