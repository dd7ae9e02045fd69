"""Modes that a structure's model leaves out give way far below their frequencies: no cause, and no fault."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import linalg

from cutvib_ss.diagnosis.directions import Directions
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
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


def measured(whole: SecondOrder) -> Records:
    """Two sessions of all its modes, with noise of two thousandths of the largest response."""
    rng, entries = np.random.default_rng(4), []
    s = 2j * np.pi * FREQ
    motion = np.array(
        [np.linalg.solve(whole.mass * z**2 + whole.damping * z + whole.stiffness, ROWS["tip"]) for z in s]
    )
    data = np.array([motion @ ROWS["middle"] * s, motion @ ROWS["tip"] * s**2])
    size = 2e-3 * np.abs(data).mean(axis=1, keepdims=True)
    for k in range(2):
        noise = size / np.sqrt(2) * (rng.standard_normal(data.shape) + 1j * rng.standard_normal(data.shape))
        variance = np.full(data.shape, size**2)
        entries.append(entry_of(k, None, 1.0, data + noise, variance, FREQ, ("m", "t"), ("velocity", "acceleration")))
    return Records(tuple(entries))


def test_the_scale_is_what_the_ports_mass_gives_way_at_the_highest_natural_frequency() -> None:
    model = truncated(3)
    square = linalg.eigvalsh(chain().stiffness, chain().mass)[2]
    modes = model.system.ports["tip"]
    assert model.flexibility_left_out("t") == pytest.approx(float(modes @ modes) / square)
    assert model.flexibility_left_out("force") == model.flexibility_left_out("tip")
    # What a shaker moves has another input; a body that nothing holds, and the machine with its rail, have no scale.
    assert replace(model, input_quantity="acceleration").flexibility_left_out("t") == 0.0
    assert published_machine().flexibility_left_out("tool_x") == 0.0


def test_modes_that_are_left_out_are_no_gap() -> None:
    nominal, records = truncated(3), measured(chain())
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
    assert directions.layout.left_out == (("force", "m"), ("force", "t"))
    matrix, gradient = directions.normal(residuals)
    flat = directions.flat()
    left = np.concatenate([np.concatenate([r.real.ravel(), r.imag.ravel()]) for r in residuals])
    np.testing.assert_allclose(matrix, flat @ flat.T, rtol=1e-9, atol=1e-9 * np.abs(matrix).max())
    np.testing.assert_allclose(gradient, flat @ left, rtol=1e-7, atol=1e-9 * np.abs(gradient).max())
