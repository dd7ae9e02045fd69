"""Set-ups that are off in position, and in the force's direction and point, are repeatability; records of one share it."""

from dataclasses import replace

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.layout import Sizes
from cutvib_ss.diagnosis.records import Entry, Records, merged
from cutvib_ss.diagnosis.set_ups import misaimed, placed_by, with_set_ups, words_on_aim
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.end_fixity import EndFixity
from cutvib_ss.effects.rail_added_mass import RailAddedMass
from cutvib_ss.model.machine import published_machine
from tests.unit.diagnosis_example import example_structure
from tests.unit.record_example import entry_of

MACHINE = published_machine()
CHANNELS, FREQ = ("tool_x", "tool_z", "base_x"), np.arange(20.0, 300.0, 0.5)
LENGTH = MACHINE.rail.parameters.length


def measured(number: int, position: float, session: str, off: tuple[float, float, float], seed: int) -> Entry:
    """A record of a set-up that is off by some millimetres, hundredths of a radian and millimetres."""
    placing, tilt, beside = off
    inputs = ("force", "tool_z", "joint1", "joint2")
    h = cv.frequency_response(
        MACHINE, [position + 1e-3 * placing / LENGTH], FREQ, inputs=inputs, outputs=CHANNELS
    ).data[0]
    data = h[:, 0] + 1e-2 * tilt * h[:, 1] + 1e-3 * beside * (h[:, 2] + h[:, 3])
    noise, rng = 0.002 * np.abs(data), np.random.default_rng(seed)
    data = data + noise / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
    units = ("acceleration",) * 3
    return entry_of(number, position, 20.0, data, noise**2, FREQ, CHANNELS, units, session=session)


def campaign(size: float) -> list[Entry]:
    """Two records in each of six set-ups."""
    rng, out = np.random.default_rng(3), []
    for k, position in enumerate((0.1, 0.25, 0.4, 0.55, 0.7, 0.85)):
        off = tuple(size * rng.standard_normal(3))
        out += [measured(2 * k + i, position, str(k), off, 50 + 2 * k + i) for i in range(2)]
    return out


def test_directions_are_what_a_set_up_does() -> None:
    (e,) = with_set_ups(MACHINE, [measured(0, 0.4, "a", (0.0, 0.0, 0.0), 1)])
    assert list(e.hits) == [("placing", 0, 0), ("aim", 0, 0), ("aim", 0, 1)]
    still = measured(0, 0.4, "a", (0.0, 0.0, 0.0), 1).data
    for unit, direction in zip(np.eye(3), e.hits.values(), strict=True):
        # The noise of one seed goes with the response
        moved = (measured(0, 0.4, "a", tuple(0.01 * unit), 1).data - still) / 0.01
        np.testing.assert_allclose(direction, moved, atol=0.02 * np.abs(direction).max())


def test_an_exponential_window_and_another_quantity_are_seen() -> None:
    e = measured(0, 0.4, "a", (0.0, 0.0, 0.0), 1)
    (plain,) = with_set_ups(MACHINE, [e])
    (other,) = with_set_ups(MACHINE, [replace(e, response=replace(e.response, quantities=("displacement",) * 3))])
    for key, direction in plain.hits.items():
        np.testing.assert_allclose(other.hits[key] * (2j * np.pi * FREQ) ** 2, direction)


def test_set_ups_are_told_by_the_evidence() -> None:
    # Of the size to which they move a response in proportion
    off = campaign(0.4)
    known = fit(MACHINE, Records(with_set_ups(MACHINE, off)), Hypothesis())
    blind = fit(MACHINE, Records(tuple(off)), Hypothesis())
    assert known.log_evidence - blind.log_evidence > 100.0
    assert known.reduced < 1.1
    assert known.spread.sizes.nominal < blind.spread.sizes.nominal
    assert 0.1 <= known.spread.sizes.aim <= 1.0
    assert 0.1 <= known.spread.sizes.placing <= 1.0
    # One of each direction a set-up, whatever the number of its records
    assert len(known.spread.layout.hits) == 18
    assert np.abs(known.x[: known.n_tuning]).max() < 2.0


def test_set_ups_that_repeat_are_of_no_size() -> None:
    found = fit(MACHINE, Records(with_set_ups(MACHINE, campaign(0.0))), Hypothesis())
    least = SETTINGS.sizes["aim"][0][0]
    assert (found.spread.sizes.aim, found.spread.sizes.placing) == (least, least)
    assert Sizes().aim > least


def leaning(shared: float, scatter: float) -> list[Entry]:
    """One record in each of six set-ups, tilted all alike and each by itself, in hundredths of a radian."""
    rng = np.random.default_rng(5)
    tilts = shared + scatter * rng.standard_normal(6)
    return [
        measured(k, p, str(k), (0.0, t, 0.0), 50 + k)
        for k, (p, t) in enumerate(zip(np.linspace(0.1, 0.85, 6), tilts, strict=True))
    ]


@pytest.mark.parametrize(("shared", "scatter", "tells"), [(12.0, 1.0, True), (1.0, 0.3, False), (0.0, 4.0, False)])
def test_a_force_that_is_off_alike_in_all_set_ups_is_told(shared: float, scatter: float, tells: bool) -> None:
    entries = with_set_ups(MACHINE, leaning(shared, scatter))
    made = fit(MACHINE, Records(entries, moving=True), Hypothesis())
    found = misaimed(made)
    assert (found is not None) is tells
    if found is not None:
        # A tilt is an offset times the length of the tool's link, but for what this moves by itself.
        tilt, offset = found
        assert 0.6 * shared < 1e2 * (tilt + abs(offset) / MACHINE.head.l2) < 1.4 * shared
        (words,) = words_on_aim(made)
        assert "off alike" in words


def test_heads_are_placed_where_they_are_found() -> None:
    off = with_set_ups(MACHINE, campaign(3.0))
    first = fit(MACHINE, Records(off), Hypothesis())
    again, placed = first, off
    for _ in range(SETTINGS.set_up_passes):
        placed = placed_by(again, placed)
        assert placed is not None
        again = fit(MACHINE, Records(placed), Hypothesis())
    # To first order errors of 10 mm leave much
    assert again.reduced < 1.05 < 2.0 < first.reduced
    rng = np.random.default_rng(3)
    true = np.array([3.0 * rng.standard_normal(3)[0] for _ in range(6)])
    lay = again.spread.layout
    columns = [lay.first_hit + lay.hits.index(("placing", k, 0)) for k in range(6)]
    found = again.spread.sizes.placing * again.spread.offsets[columns]
    np.testing.assert_allclose(found, true, atol=0.05)
    # Errors are those from the stated position, and have its prior
    assert np.std(lay.placed(np.zeros((6, len(lay.drifting))))[columns]) > 1.0
    # Where the mean stands does not matter to first order: records that were not fitted are judged alike
    stands = replace(placed[0], placed=None)
    assert stands.head_at == stands.position != placed[0].head_at


def test_heads_that_are_where_they_should_be_stay_there() -> None:
    on = with_set_ups(MACHINE, campaign(0.0))
    assert placed_by(fit(MACHINE, Records(on), Hypothesis()), on) is None


def test_records_of_one_set_up_share_its_directions_when_they_are_merged() -> None:
    first = replace(measured(0, 0.4, "a", (1.0, 1.0, 1.0), 1))
    (group,) = merged(with_set_ups(MACHINE, [first, measured(1, 0.4, "a", (1.0, 1.0, 1.0), 2)]))
    (row,) = group.hits
    alone = with_set_ups(MACHINE, [first])[0].hits
    assert set(row) == set(alone)
    for key, direction in alone.items():
        np.testing.assert_allclose(row[key], direction)


def test_a_structure_has_no_set_ups() -> None:
    e = entry_of(0, None, 1.0, np.ones((1, 3), complex), np.ones((1, 3)), FREQ[:3], ("upper",), ("acceleration",))
    assert with_set_ups(example_structure(), [e]) == (e,)


@pytest.mark.parametrize(
    ("effect", "tolerated"),
    [
        (RailAddedMass("rail", 0.5, 0.2, 0.0), True),
        (RailAddedMass("rail", 0.5, 3.0, 0.0), False),
        (RailAddedMass("rail", 0.5, 0.2, 200.0), False),
        (EndFixity("rail_ends", 1e3, 2e3), True),
        (EndFixity("rail_ends", 2e4, 5e4), False),
    ],
)
def test_what_a_rail_may_differ_by_is_tolerated(effect: RailAddedMass | EndFixity, tolerated: bool) -> None:
    assert effect.tolerated(MACHINE) is tolerated
