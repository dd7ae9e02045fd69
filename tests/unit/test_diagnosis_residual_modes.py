"""Modes that a structure's model leaves out give way far below their frequencies: no cause, and no fault."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import linalg

from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.residual_modes import residual_modes
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.results import FloatArray
from tests.unit.record_example import entry_of

FREQ = np.linspace(5.0, 45.0, 160)
ROWS = {"middle": np.eye(6)[2], "tip": np.eye(6)[5]}
CHANNELS = {"m": Channel("middle", "velocity"), "t": Channel("tip", "acceleration")}


def chain(mass: float = 0.0) -> SecondOrder:
    """Six masses on six springs, the tip's with something added."""
    ends = np.eye(6) - np.eye(6, k=-1)
    stiffness = 6e4 * ends.T @ ends
    return SecondOrder(np.diag([1.0] * 5 + [1.0 + mass]), 2e-5 * stiffness, stiffness, tuple("abcdef"), ROWS)


def truncated(kept: int) -> Structure:
    """The first modes of the chain, as an engineer writes them down."""
    whole = chain()
    squares, shapes = linalg.eigh(whole.stiffness, whole.mass)
    modes = shapes[:, :kept]
    system = SecondOrder(
        np.eye(kept),
        2e-5 * np.diag(squares[:kept]),
        np.diag(squares[:kept]),
        tuple(f"q{k}" for k in range(kept)),
        {name: row @ modes for name, row in ROWS.items()},
    )
    return Structure(system, CHANNELS, "tip")


def measured(whole: SecondOrder, freq: FloatArray = FREQ) -> Records:
    """Two sessions of all its modes, with noise of two thousandths of the largest response."""
    rng, entries = np.random.default_rng(4), []
    s = 2j * np.pi * freq
    motion = np.array(
        [np.linalg.solve(whole.mass * z**2 + whole.damping * z + whole.stiffness, ROWS["tip"]) for z in s]
    )
    data = np.array([motion @ ROWS["middle"] * s, motion @ ROWS["tip"] * s**2])
    size = 2e-3 * np.abs(data).mean(axis=1, keepdims=True)
    for k in range(2):
        noise = size / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        variance = np.full(data.shape, size**2)
        entries.append(entry_of(k, None, 1.0, data + noise, variance, freq, ("m", "t"), ("velocity", "acceleration")))
    return Records(tuple(entries))


def test_the_scale_is_what_the_ports_masses_give_way_at_the_frequency_of_a_mode() -> None:
    model, groups = truncated(3), measured(chain()).merged
    square = linalg.eigvalsh(chain().stiffness, chain().mass)[2]
    last = float(np.sqrt(square)) / (2 * np.pi)
    assert model.highest_mode == pytest.approx((last, 1e-5 * np.sqrt(square)))
    rows = [model.system.ports[name] for name in ("tip", "middle")]
    assert model.accelerance_above("t") == pytest.approx(float(rows[0] @ rows[0]))
    assert model.accelerance_above("force") == model.accelerance_above("tip")
    found = residual_modes(model, groups, float(FREQ[-1]))
    assert {(m.input, m.channel) for m in found} == {("force", "m"), ("force", "t")}
    for m in found:
        assert m.frequency > max(last, FREQ[-1])
        masses = np.sqrt(np.prod([row @ row for row in (rows if m.channel == "m" else [rows[0]] * 2)]))
        assert m.flexibility == pytest.approx(masses / (2 * np.pi * m.frequency) ** 2)
        assert m.receptance(np.zeros(1))[0] == pytest.approx(m.flexibility)


def test_what_a_shaker_moves_is_all_mass_above_all_modes() -> None:
    shaken = Structure(chain(), CHANNELS, "tip", "acceleration")
    carried = shaken.influence
    assert carried is not None
    assert shaken.accelerance_above("force") == pytest.approx(float(carried @ chain().mass @ carried))


def test_a_free_mass_and_a_machine_with_a_rail_leave_nothing_out() -> None:
    free = SecondOrder(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), ("x",), {"middle": np.ones(1), "tip": np.ones(1)})
    for model in (Structure(free, CHANNELS, "tip"), published_machine()):
        assert model.highest_mode is None
        assert residual_modes(model, measured(chain()).merged, 50.0) == ()


@given(
    distances=st.lists(st.floats(0.06, 9.0), min_size=1, max_size=4),
    parts=st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4),
)
def test_a_few_frequencies_hold_any_modes_above_the_band(distances: list[float], parts: list[float]) -> None:
    model, groups = truncated(3), measured(chain()).merged
    freq = np.linspace(1.0, 50.0, 300)
    found = [m for m in residual_modes(model, groups, 50.0) if m.channel == "t"]
    basis = np.array([m.receptance(freq) / m.flexibility for m in found]).T
    top = found[0].frequency / SETTINGS.likelihood_residual_modes[0]
    others = [replace(found[0], frequency=top * (1 + d), flexibility=a) for d, a in zip(distances, parts, strict=False)]
    whole = np.sum([m.receptance(freq) for m in others], axis=0)
    size = np.sum([np.abs(m.receptance(freq)) for m in others], axis=0).max()
    left = whole - basis @ np.linalg.lstsq(basis, whole, rcond=None)[0]
    assert np.abs(left).max() <= 0.02 * size


@pytest.mark.parametrize("highest", [45.0, 54.0])
def test_modes_that_are_left_out_are_no_gap(highest: float) -> None:
    """The fourth mode lies at 58 Hz."""
    nominal, records = truncated(3), measured(chain(), np.linspace(5.0, highest, 160))
    none = fit(nominal, records, Hypothesis())
    assert none.reduced < 1.15
    assert none.spread.sizes.flexibility > 1e-2
    mass = fit(nominal, records, Hypothesis((AddedMass("tip", 0.05),)))
    assert mass.log_evidence < none.log_evidence + 1.0


def test_a_model_with_all_modes_needs_no_more_flexibility() -> None:
    none = fit(truncated(6), measured(chain()), Hypothesis())
    assert none.spread.sizes.flexibility == 1e-4


def test_a_mass_stands_out_of_modes_that_are_left_out() -> None:
    nominal, records = truncated(3), measured(chain(0.4))
    none, mass = fit(nominal, records, Hypothesis()), fit(nominal, records, Hypothesis((AddedMass("tip", 0.1),)))
    assert mass.log_evidence > none.log_evidence + 10.0


def test_products_of_what_is_added_are_those_of_its_columns() -> None:
    nominal, records = truncated(3), measured(chain())
    problem = Problem(nominal, records.merged, Hypothesis())
    x = problem.start()
    predictions, residuals, _ = problem.residuals(x)
    directions = Directions(problem, x, predictions)
    assert directions.layout.residual_modes == problem.residual_modes != ()
    matrix, gradient = directions.normal(residuals)
    flat = directions.flat()
    left = np.concatenate([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in residuals])
    np.testing.assert_allclose(matrix, flat @ flat.T, rtol=1e-9, atol=1e-9 * np.abs(matrix).max())
    np.testing.assert_allclose(gradient, flat @ left, rtol=1e-7, atol=1e-9 * np.abs(gradient).max())


def test_a_record_struck_elsewhere_knows_its_residual_modes_by_their_size_only() -> None:
    nominal, records = truncated(3), measured(chain())
    first, other = records.entries
    other = replace(other, response=replace(other.response, inputs=("middle",)))
    none = fit(nominal, Records((first,)), Hypothesis())
    problem = Problem(nominal, Records((first,)).merged, Hypothesis())
    modes = residual_modes(nominal, [other.group], problem.band[1])
    own = none.spread.of_record(("",), 1, {}, modes)
    assert len(own.layout.residual_modes) == 2 * len(problem.residual_modes)
    new = own.layout.first_residual + len(problem.residual_modes) + np.arange(len(modes))
    np.testing.assert_array_equal(own.precision[np.ix_(new, new)], np.eye(len(modes)))
    assert np.all(own.offsets[new] == 0.0)
    # Of one that was struck at the same place all is known that there is.
    again = none.spread.of_record(("",), 1, {}, residual_modes(nominal, [first.group], problem.band[1]))
    assert again.layout.residual_modes == none.spread.layout.residual_modes
