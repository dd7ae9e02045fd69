"""A residual below what counts as a gap, but not white: something unknown is looked for all the same."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from cutvib_ss.diagnosis.fit import Fit
from cutvib_ss.diagnosis.layout import Layout, Sizes
from cutvib_ss.diagnosis.observations import observe
from cutvib_ss.diagnosis.predictive import Spread
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.search import _beside, search, search_linear
from cutvib_ss.diagnosis.settings import SETTINGS
from cutvib_ss.diagnosis.workers import Workers
from cutvib_ss.measurement.records import Campaign, Record
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.parameters import StructureTolerances
from cutvib_ss.results import MeasuredFrequencyResponse

FREQ = np.arange(8.0, 50.0, 0.1)
MASS, DAMPING, STIFFNESS = 1.0, 2.0, (2 * np.pi * 20.0) ** 2


def structure() -> Structure:
    system = SecondOrder(
        np.array([[MASS]]), np.array([[DAMPING]]), np.array([[STIFFNESS]]), ("x",), {"p": np.array([1.0])}
    )
    return Structure(system, {"y": Channel("p", "acceleration")}, "p", tolerance=StructureTolerances())


def campaign(folder: Path, ripple: float) -> Campaign:
    """Three records of one mass on a spring whose stiffness has a ripple over frequency, with noise of a known variance."""
    rng = np.random.default_rng(3)
    omega = 2 * np.pi * FREQ
    spring = STIFFNESS * (1.0 + ripple * np.sin(2 * np.pi * FREQ / 9.0))
    shown = (-(omega**2) / (spring - omega**2 * MASS + 1j * omega * DAMPING))[None, None, None]
    std = 0.02 * np.abs(shown)
    records = []
    for k in range(3):
        noise = std * (rng.standard_normal(shown.shape) + 1j * rng.standard_normal(shown.shape)) / np.sqrt(2)
        frf = MeasuredFrequencyResponse(
            shown + noise, FREQ, np.array([np.nan]), ("y",), ("force",), ("acceleration",), variance=std**2, averages=4
        )
        records.append(
            Record(f"r{k}", "frf", None, None, None, ("y",), ("acceleration",), (), frf, 4, "multisine", session="one")
        )
    return Campaign("ripple", folder, structure(), tuple(records))


def searched(folder: Path, ripple: float) -> tuple[float, float, set[str]]:
    """What the re-tuned model leaves, its correlation, and which effects were fitted on all lines."""
    measured = campaign(folder, ripple)
    observed, workers = observe(measured, measured.machine), Workers(1)
    with threadpool_limits(1):
        linear = search_linear(measured.machine, Records(observed.entries), observed, workers)
        ranked = search(
            measured.machine, observed, linear, lambda r: r.reduced, lambda r: r.reduced, lambda f: (), workers
        )
    none = ranked[0]
    return none.reduced, none.fit.correlation, {r.fit.hypothesis.effect for r in ranked if r.refined}


def test_a_small_residual_that_is_not_white_is_searched_for_something_unknown(tmp_path: Path) -> None:
    left, correlation, fitted = searched(tmp_path, 0.005)
    assert left < SETTINGS.search_enough
    assert correlation > 1.0
    assert "unknown" in fitted


def test_white_noise_is_not(tmp_path: Path) -> None:
    left, correlation, fitted = searched(tmp_path, 0.0)
    assert left < SETTINGS.search_enough
    assert correlation == 1.0
    assert "unknown" not in fitted


@pytest.mark.parametrize(
    ("left", "sizes", "beside"),
    [
        (1.0, Sizes(), True),
        (1.0, Sizes(drift=0.03), False),
        (1.0, Sizes(parts=0.3), True),
        (1.0, Sizes(parts=1.0), False),
        (3.0, Sizes(), False),
    ],
)
def test_causes_start_beside_the_tuned_model_unless_it_may_have_taken_them_up(
    left: float, sizes: Sizes, beside: bool
) -> None:
    """A delay of all channels that drift of 3 % had taken up was caught beside that fit, 13 000 nats below its own maximum."""

    class Tuned(SimpleNamespace):
        taken_up = Fit.taken_up

    none = cast(
        Fit, Tuned(reduced=left, spread=Spread(Layout(0, (), (), (), (), (), 0), sizes, np.zeros(0), np.zeros((0, 0))))
    )
    assert _beside(none) is (none if beside else None)
