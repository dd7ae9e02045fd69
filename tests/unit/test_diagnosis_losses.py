"""Dampings of single rail modes err beside what all of them do; drift of another fit is followed where it leads closer."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import cutvib_ss as cv
from cutvib_ss.diagnosis import climb
from cutvib_ss.diagnosis.candidate_evidence import out_of_tolerance
from cutvib_ss.diagnosis.fit import fit
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.prediction import Prediction
from cutvib_ss.diagnosis.problem import Problem
from cutvib_ss.diagnosis.records import Records
from cutvib_ss.diagnosis.unknowns import tuning_paths
from cutvib_ss.effects.modal_truncation import ModalTruncation
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import Machine, published_machine
from cutvib_ss.model.paths import with_values
from cutvib_ss.model.rail import EndSupports, Shear
from cutvib_ss.model.rail import rail as rail_system
from cutvib_ss.response.frequency import ChainedResponse
from tests.unit.record_example import entry_of

MACHINE = published_machine()
CHANNELS, FREQ = ("tool_x", "tool_z", "base_x"), np.arange(20.0, 400.0, 0.5)


def scattered(factors: tuple[float, ...]) -> Machine:
    """The machine with dampings of its lowest rail modes of their own."""
    return with_values(MACHINE, {("rail", "losses", k): f for k, f in enumerate(factors)})


def records(of: dict[float, Machine], error: float, level: float = 20.0) -> Records:
    """One record a position of each machine, with noise of a part of the response."""
    out = []
    for number, (position, model) in enumerate(of.items()):
        shape = (3, FREQ.size)
        blank = entry_of(
            number,
            position,
            level,
            np.zeros(shape, dtype=complex),
            np.ones(shape),
            FREQ,
            CHANNELS,
            ("acceleration",) * 3,
        )
        data = Prediction(model, blank.group).data[0]
        rng = np.random.default_rng(number)
        noise = error * np.abs(data) / np.sqrt(2)
        out.append(
            blank.showing(data + noise * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)), 2 * noise**2)
        )
    return Records(tuple(out))


@pytest.mark.parametrize(
    "rail",
    [
        MACHINE.rail,
        replace(MACHINE.rail, shear=Shear(30.0)),
        replace(MACHINE.rail, supports=EndSupports(2e7, 3e7, 1e3, 1e3)),
    ],
)
@pytest.mark.parametrize("name", ["losses", "frequencies"])
def test_derivatives_to_the_damping_and_the_frequency_of_one_mode(rail, name) -> None:
    machine = replace(MACHINE, rail=rail)
    at, s = np.array([0.2, 0.4]), 2j * np.pi * FREQ

    def response(model: Machine) -> ChainedResponse:
        return ChainedResponse(model, at, s, ("acceleration",) * 3, CHANNELS, ("force",))

    for k in range(len(getattr(machine.rail, name))):
        path = ("rail", name, k)
        own = response(machine).derivatives([path])[0]
        ends = [response(with_values(machine, {path: 1.0 + h})).data() for h in (1e-5, -1e-5)]
        np.testing.assert_allclose(own, (ends[0] - ends[1]) / 2e-5, atol=1e-5 * np.abs(own).max())


def test_a_damping_of_one_mode_is_written_as_a_damping_ratio_a_mode(tmp_path: Path) -> None:
    machine, file = scattered((1.2, 0.7)), tmp_path / "machine.toml"
    cv.write_machine(machine, file)
    again = cv.read_machine(file)
    assert again.rail.losses == (1.0,) * len(machine.rail.losses)
    expected = [r * f for r, f in zip(MACHINE.rail.parameters.damping_ratios, (1.2, 0.7, 1.0, 1.0), strict=True)]
    assert again.rail.parameters.damping_ratios == pytest.approx(expected)
    one, two = (cv.frequency_response(m, [0.4], FREQ).data for m in (machine, again))
    np.testing.assert_allclose(one, two, rtol=1e-9)


@pytest.mark.parametrize("shear", [None, Shear(30.0)])
def test_frequencies_of_single_modes_are_those_of_the_pinned_rail(tmp_path: Path, shear: Shear | None) -> None:
    factors = {("rail", "frequencies", k): f for k, f in enumerate((1.02, 0.97))}
    bare = replace(MACHINE, rail=replace(MACHINE.rail, shear=shear))
    one, two = (rail_system(m.rail, {}) for m in (bare, with_values(bare, factors)))
    ratio = np.sqrt(np.diag(two.stiffness) / np.diag(one.stiffness))
    np.testing.assert_allclose(ratio[:2], (1.02, 0.97))
    np.testing.assert_allclose(ratio[2:], 1.0)
    if shear is None:
        file = tmp_path / "machine.toml"
        cv.write_machine(with_values(MACHINE, factors), file)
        again = cv.read_machine(file)
        assert again.rail.parameters.frequency_profile[:2] == pytest.approx((1.02, 0.97))
        shown = [cv.frequency_response(m, [0.4], FREQ).data for m in (with_values(MACHINE, factors), again)]
        np.testing.assert_allclose(*shown, rtol=1e-9)


def test_dampings_of_a_rail_of_few_modes_are_written_beside_modes_that_it_leaves_out(tmp_path: Path) -> None:
    few = replace(MACHINE, rail=replace(MACHINE.rail, parameters=replace(MACHINE.rail.parameters, n_modes=3)))
    tuned = with_values(few, {path: 1.3 for path, _ in tuning_paths(few) if path[1] == "losses"})
    file = tmp_path / "machine.toml"
    machine = ModalTruncation("rail", 20).apply(tuned)
    cv.write_machine(machine, file)
    one, two = (cv.frequency_response(m, [0.4], FREQ).data for m in (machine, cv.read_machine(file)))
    np.testing.assert_allclose(one, two, rtol=1e-9)


def test_modal_dampings_that_scatter_leave_no_discrepancy() -> None:
    """Against one damping ratio for all modes, which a discrepancy of the nominal model has to help."""
    factors = (1.15, 0.85, 1.1)
    measured = records(dict.fromkeys((0.15, 0.4), scattered(factors)), 0.002)
    found = fit(MACHINE, measured, Hypothesis())
    assert found.reduced < 1.05
    of_modes = [
        k for k, (path, _) in enumerate(Problem(MACHINE, measured.merged, Hypothesis()).tuning) if path[1] == "losses"
    ]
    ratio = np.exp(0.15 * found.x[of_modes])
    # The damping ratio of all modes moves them together.
    np.testing.assert_allclose(ratio[:2] / ratio[0], np.array(factors[:2]) / factors[0], rtol=0.03)
    held = [k for k in range(found.n_tuning) if k not in of_modes]
    assert np.abs(found.x[held]).max() < 2.0
    assert not out_of_tolerance(MACHINE, found)


def test_a_damping_far_off_is_named_by_its_mode() -> None:
    found = fit(MACHINE, records(dict.fromkeys((0.15, 0.4), scattered((3.0,))), 0.002), Hypothesis())
    (warning,) = [w for w in out_of_tolerance(MACHINE, found) if "mode" in w]
    assert "damping_ratio of mode 1 of the rail" in warning


def test_a_start_beside_another_fit_takes_its_drift_only_where_that_leads_closer(monkeypatch) -> None:
    moved = {y: with_values(MACHINE, {("head", "k2"): f * MACHINE.head.k2}) for y, f in ((0.15, 1.004), (0.4, 0.996))}
    still = records(moved, 0.002)
    near = fit(MACHINE, still, Hypothesis())
    began = []
    climbed = climb.Climb.climb

    def watched(self, *steps):
        began.append(self.at.drift.copy())
        return climbed(self, *steps)

    monkeypatch.setattr(climb.Climb, "climb", watched)
    fit(MACHINE, still, Hypothesis(), near.x, 0, near=near)
    assert np.abs(began[0]).max() > 1e-3
    wrong = replace(near.spread, offsets=-20.0 * near.spread.offsets)
    began.clear()
    fit(MACHINE, still, Hypothesis(), near.x, 0, near=replace(near, spread=wrong))
    assert not began[0].any()

    residuals = Problem.residuals

    def refused(self, x):
        if len({own.tobytes() for own in self.each(x)}) > 1:
            raise ParameterError("more than the model takes")
        return residuals(self, x)

    monkeypatch.setattr(Problem, "residuals", refused)
    began.clear()
    fit(MACHINE, still, Hypothesis(), near.x, 0, near=near)
    assert not began[0].any()
