"""The family of plants: exact at every position, common states, and a table whose error stays within its bound."""

from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from scipy import io

import cutvib_ss as cv
from cutvib_ss.effects.channel_delay import ChannelDelay
from cutvib_ss.effects.guide_compliance import GuideCompliance
from cutvib_ss.effects.rail_torsion import RailTorsion
from cutvib_ss.effects.structural_damping import StructuralDamping
from cutvib_ss.effects.support_compliance import SupportCompliance
from cutvib_ss.errors import CouplingError, ParameterError
from cutvib_ss.interchange import write_plant
from cutvib_ss.model.machine import Machine
from cutvib_ss.plant import PlantSchedule, schedule
from tests.properties.machines import machines

MACHINE = cv.published_machine()
SOFT = GuideCompliance("head_base", 2e7, 300.0).apply(
    SupportCompliance("rail_ends", 3e7, 5e7, 500.0, 700.0).apply(MACHINE)
)
FREQ = np.array([12.0, 24.6, 77.0, 126.0, 211.0, 217.0, 240.0, 410.0, 507.0])
GRID = np.linspace(0.02, 0.98, 41)
HALF_WAY = (GRID[:-1] + GRID[1:]) / 2


@pytest.mark.parametrize("machine", [MACHINE, SOFT], ids=["published", "soft"])
@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_the_exact_plant_is_the_machine_s(machine: Machine, quantity: str) -> None:
    family = cv.schedule(machine, [0.1, 0.9], inputs=["force", "head_x"], quantity=quantity)  # type: ignore[arg-type]
    for y in (0.013, 0.31, 0.75):
        ours, theirs = family.exact(y), machine.plant(y, inputs=["force", "head_x"], quantity=quantity)  # type: ignore[arg-type]
        assert (ours.input_labels, ours.output_labels) == (theirs.input_labels, theirs.output_labels)
        one, other = (control.frequency_response(p, 2 * np.pi * FREQ).frdata for p in (ours, theirs))
        assert np.abs(one - other).max() < 1e-9 * np.abs(other).max()
        direct = family.frequency_response(y, FREQ).data[0]
        assert np.abs(direct - other).max() < 1e-9 * np.abs(other).max()
        poles, expected = np.sort_complex(ours.poles()), np.sort_complex(theirs.poles())
        assert np.abs(poles - expected).max() < 1e-7 * np.abs(expected).max()


def test_states_mean_the_same_at_every_position() -> None:
    family = schedule(MACHINE, GRID)
    a, b, c, d = family.state_matrices()
    assert a.shape == (41, 12, 12)
    assert family.exact(0.3).state_labels == list(family.states) == family.interpolated(0.3).state_labels
    # The rates' rows are constant, plants between two neighbours lie between them, and joints are read in the same way.
    assert np.ptp(a[:, :6], axis=0).max() == 0.0
    middle = np.array([family.exact(float(y)).A for y in HALF_WAY])
    off = np.abs(middle - (a[:-1] + a[1:]) / 2).max(axis=(1, 2))
    assert (off < 0.05 * np.abs(middle).max(axis=(1, 2))).all()
    assert np.ptp(c[:, 0, 4:6], axis=0).max() == 0.0
    assert not d.any()
    assert b.shape == (41, 12, 1)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_the_table_is_exact_at_its_points(interpolation: str) -> None:
    family = schedule(SOFT, GRID, interpolation=interpolation)  # type: ignore[arg-type]
    assert family.error(GRID, FREQ).max() <= 1e-12 * np.abs(family.frequency_response(GRID, FREQ).data).max()


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("machine", [MACHINE, SOFT], ids=["published", "soft"])
def test_the_bound_holds_and_is_not_idle(machine: Machine, interpolation: str) -> None:
    family = schedule(machine, GRID, outputs=["tool_x", "base_x"], quantity="acceleration", interpolation=interpolation)  # type: ignore[arg-type]
    places = np.concatenate([HALF_WAY, GRID[:-1] + 0.2 * np.diff(GRID)])
    error, bound = family.error(places, FREQ), family.error_bound(places, FREQ)
    assert (error <= bound).all()
    assert np.isfinite(bound).mean() > 0.95
    finite = np.isfinite(bound)
    assert np.median(bound[finite] / np.maximum(error[finite], 1e-300)) < 25.0


@settings(max_examples=10, phases=[Phase.explicit, Phase.generate])
@given(machines().filter(lambda m: m.rail.torsion is None))
def test_the_bound_holds_for_any_machine(machine: Machine) -> None:
    family = schedule(machine, GRID[::2], interpolation="cubic")
    places = (family.positions[:-1] + family.positions[1:]) / 2
    error, bound = family.error(places, FREQ), family.error_bound(places, FREQ)
    response = np.abs(family.frequency_response(places, FREQ).data)
    assert (error <= bound + 1e-9 * response).all()


@pytest.mark.parametrize(("interpolation", "order"), [("linear", 2), ("cubic", 4)])
def test_the_error_falls_with_the_order_of_the_interpolation(interpolation: str, order: int) -> None:
    def worst(points: int) -> float:
        family = schedule(MACHINE, np.linspace(0.02, 0.98, points), interpolation=interpolation)  # type: ignore[arg-type]
        places = (family.positions[:-1] + family.positions[1:]) / 2
        return float(family.error(places, FREQ).max())

    assert np.log2(worst(61) / worst(121)) == pytest.approx(order, abs=0.4)


def test_plants_between_the_points_of_a_coarse_table_are_stable_and_passive() -> None:
    family = schedule(MACHINE, [0.02, 0.2, 0.5, 0.8, 0.98], outputs=["tool_x"], quantity="velocity")
    for y in np.linspace(0.02, 0.98, 23):
        plant = family.interpolated(float(y))
        assert plant.poles().real.max() < 0.0
        assert control.frequency_response(plant, 2 * np.pi * np.arange(5.0, 600.0, 2.0)).frdata.real.min() > 0.0


def test_a_coarse_grid_says_so() -> None:
    family = schedule(MACHINE, [0.02, 0.5, 0.98], outputs=["tool_x"])
    assert np.isinf(family.error_bound([0.3], [217.0])).all()


def test_chain_and_hysteresis_are_carried_as_in_the_plant() -> None:
    late = ChannelDelay("measurement", delay=1e-4, channel="tool_x").apply(MACHINE)
    family = schedule(late, GRID, outputs=["tool_x"], pade_order=3)
    plant = late.plant(0.4, outputs=["tool_x"], pade_order=3)
    assert family.exact(0.4)(2j * np.pi * 217.0) == pytest.approx(plant(2j * np.pi * 217.0), rel=1e-9)
    hysteretic = StructuralDamping("joint2", 0.05).apply(MACHINE)
    with pytest.raises(CouplingError):
        schedule(hysteretic, GRID)
    viscous = schedule(hysteretic, GRID, outputs=["tool_x"], viscous_at=217.0)
    expected = hysteretic.plant(0.4, outputs=["tool_x"], viscous_at=217.0)
    assert viscous.exact(0.4)(2j * np.pi * 217.0) == pytest.approx(expected(2j * np.pi * 217.0), rel=1e-9)


def test_what_has_no_table_is_refused() -> None:
    with pytest.raises(ParameterError, match="two of them"):
        schedule(MACHINE, [0.5, 0.5])
    with pytest.raises(ParameterError, match="'spline'"):
        schedule(MACHINE, GRID, interpolation="spline")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="outside the grid"):
        schedule(MACHINE, [0.2, 0.8]).interpolated(0.1)
    twisting = schedule(RailTorsion("rail", 0.05, 1.0, 120.0, 0.02).apply(MACHINE), [0.3, 0.4], outputs=["tool_x"])
    assert twisting.error([0.35], FREQ).max() > 0.0
    with pytest.raises(CouplingError, match="place of the head"):
        twisting.error_bound([0.35], FREQ)


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_the_table_is_written_for_other_programs(tmp_path: Path, suffix: str) -> None:
    family = schedule(MACHINE, [0.1, 0.3, 0.6], outputs=["tool_x", "tool_z"], quantity="acceleration")
    file = tmp_path / f"plants{suffix}"
    write_plant(family, file)
    back = np.load(file) if suffix == ".npz" else io.loadmat(file, simplify_cells=True)
    assert back["A"].shape == (12, 12, 3)
    plant = control.ss(*(back[name][..., 1].reshape(getattr(family.exact(0.3), name).shape) for name in "ABCD"))
    assert plant.frequency_response(1363.0).frdata == pytest.approx(family.exact(0.3).frequency_response(1363.0).frdata)
    assert list(back["outputs"]) == ["tool_x", "tool_z"]
    assert list(back["states"])[:2] == ["eta1", "eta2"]
    with pytest.raises(ParameterError, match="holds no plants"):
        write_plant(family, tmp_path / "plants.csv")


def test_the_family_is_that_of_the_machine_given() -> None:
    other = replace(MACHINE, head=replace(MACHINE.head, m1=30.0))
    family: PlantSchedule = schedule(other, GRID)
    assert family.machine is other
    assert not np.allclose(family.exact(0.5).poles(), schedule(MACHINE, GRID).exact(0.5).poles())
