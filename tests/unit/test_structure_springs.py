"""Springs at the ports of a structure whose matrices are written to a few digits."""

from pathlib import Path

import numpy as np
import pytest

from cutvib_ss.diagnosis.hypotheses import candidates, nonlinear_candidates
from cutvib_ss.diagnosis.hypothesis import Hypothesis
from cutvib_ss.diagnosis.result import FittedParameter
from cutvib_ss.effects.added_mass import AddedMass
from cutvib_ss.effects.base import Measured, Motion, parameter_fields
from cutvib_ss.effects.catalogue import EFFECTS
from cutvib_ss.effects.freeplay import Freeplay
from cutvib_ss.effects.local_resonator import LocalResonator
from cutvib_ss.effects.tool_contact import ToolContact
from cutvib_ss.errors import ParameterError
from cutvib_ss.model.machine import published_machine
from cutvib_ss.model.second_order import Channel, SecondOrder
from cutvib_ss.model.structure import Structure
from cutvib_ss.model_files import read_machine, write_machine
from cutvib_ss.report.wording import cause_name, inspection_text

SPRINGS = (1.234567891e7, 0.987654321e7, 1.111111119e7)


def chain(digits: int) -> Structure:
    """Four masses on a row, the first held to the ground, with numbers of so many digits."""
    k = np.diag([2.5e7, *np.zeros(3)])
    for i, s in enumerate(SPRINGS):
        k[i : i + 2, i : i + 2] += s * np.array([[1.0, -1.0], [-1.0, 1.0]])
    k = np.array([[float(f"{x:.{digits}g}") for x in row] for row in k])
    ports = {"held": np.eye(4)[0], "free": np.eye(4)[2], "between": np.array([0.0, 1.0, -1.0, 0.0])}
    system = SecondOrder(np.diag([3.0, 2.0, 1.0, 4.0]), 1e-5 * k, k, tuple("abcd"), ports)
    return Structure(system, {"y": Channel("free", "acceleration")}, "free")


@pytest.mark.parametrize("digits", [6, 8, 12])
def test_what_rounding_leaves_of_a_row_is_no_spring(digits: int) -> None:
    model = chain(digits)
    assert model.spring_at("free") is None
    held, between = model.spring_at("held"), model.spring_at("between")
    assert held is not None
    assert between is not None
    assert held[0] == pytest.approx(2.5e7, rel=1e-4)
    assert between[0] == pytest.approx(SPRINGS[1], rel=1e-4)


def test_starts_of_laws_lie_in_their_ranges_at_every_port() -> None:
    model = chain(6)
    motion = Motion(1e-6, 2e-5, 5e-3, 50.0)
    measured = Measured((10.0, 400.0), ("y",), dict.fromkeys(("held", "free", "between"), motion))
    looked_at = 0
    for kind in EFFECTS.values():
        if kind.linear:
            continue
        for place, starts in kind.starts(model, measured):
            port = starts[0].place
            ranges = kind.ranges(model, port, motion.high)
            for name in (f.name for f in parameter_fields(kind)):
                values = [getattr(e, name) for e in starts if getattr(e, name) is not None]
                low, high = ranges[name].low, ranges[name].high
                # The strongest may lie beyond.
                inside = [v for v in values if np.isfinite(v) and min(low, high) <= v <= max(low, high)]
                assert inside or not values, (kind.effect, place, name, low, high, values)
                looked_at += 1
    assert looked_at > 10


def test_a_spring_may_be_nearly_gone_and_the_structure_still_stands() -> None:
    model = chain(8)
    for place in ("held", "between"):
        spring = model.spring_at(place)
        assert spring is not None
        low = ToolContact.ranges(model, place)["stiffness"].low
        assert low == pytest.approx(-0.95 * spring[0])
        left = ToolContact(place, low).apply(model).second_order().stiffness
        assert np.linalg.eigvalsh(left).min() > 0.0
        row = model.system.port(place)
        np.testing.assert_allclose(left, model.system.stiffness + low * np.outer(row, row), rtol=1e-12)
    # What spans no spring has none to lose.
    assert ToolContact.ranges(model, "free")["stiffness"].low == 0.0
    assert ToolContact.ranges(published_machine(), "tool")["stiffness"].low == 0.0


def test_a_softer_spring_and_a_missing_mass_are_said_to_be_so() -> None:
    softer = {"stiffness": FittedParameter(-2e6, 1e4, "N/m"), "damping": FittedParameter(0.0, 1.0, "N s/m")}
    assert cause_name("tool_contact", "between", softer) == "between is softer than the model has it"
    assert "crack" in inspection_text("tool_contact", "between", softer)
    both = {
        "tool_contact.stiffness": FittedParameter(2e6, 1e4, "N/m"),
        "added_mass.mass": FittedParameter(-0.1, 0.01, "kg"),
    }
    assert cause_name("tool_contact+added_mass", "between+free", both).endswith(
        "free weighs less than the model has it"
    )
    assert cause_name("tool_contact+added_mass", "between+free", both).startswith("something touches between")


def test_a_resonator_far_above_the_band_is_a_mass_on_a_structure() -> None:
    model, unseen, seen = chain(8), {"frequency": 400.0}, {"frequency": 40.0}
    resonator = LocalResonator("free", 0.5, 700.0, 0.1)
    assert resonator.alias(model, unseen) == AddedMass("free", 0.5)
    assert resonator.alias(model, seen) is resonator
    # On the machine a mass moves in X and Z, which a resonator in X does not.
    on_tool = LocalResonator("tool", 0.5, 700.0, 0.1)
    assert on_tool.alias(published_machine(), unseen) is on_tool


def test_one_degree_of_freedom_has_one_name_for_each_of_its_values() -> None:
    one = SecondOrder(np.eye(1), 5.0 * np.eye(1), 1e5 * np.eye(1), ("x",), {"x": np.ones(1)})
    names = [c.name for c in candidates(Structure(one, {"y": Channel("x", "displacement")}, "x"), (10.0, 90.0), ("y",))]
    assert [n for n in names if n.startswith("parameter_shift")] == ["parameter_shift structure.damping"]
    several = [c.name for c in candidates(chain(8), (10.0, 400.0), ("y",))]
    assert sum(n.startswith("parameter_shift") for n in several) == 3


def test_restoring_forces_of_a_structure_are_in_newtons_and_metres() -> None:
    found = {
        (e.effect, name): unit
        for c in nonlinear_candidates(chain(8), {"between": Motion(1e-6, 2e-5, 5e-3, 50.0)})
        for e in c.starts[:1]
        for name, unit in e.units(chain(8)).items()
    }
    assert found["cubic_stiffness", "stiffness3"] == "N/m^3"
    assert found["quadratic_damping", "coefficient"] == "N s^2/m^2"
    assert found["freeplay", "gap"] == "m"
    assert found["joint_slip", "slip_torque"] == "N"
    assert found["joint_slip", "spread"] == "1"
    assert Freeplay("joint2", 1e-5).units(published_machine())["gap"] == "rad"


def test_two_causes_at_one_place_are_at_that_place() -> None:
    both = Hypothesis((ToolContact("between", 1e5), AddedMass("between", 0.1)))
    assert (both.place, both.places) == ("between+between", "between")
    assert Hypothesis((ToolContact("between", 1e5), AddedMass("free", 0.1))).places == "between+free"


def test_play_of_a_part_of_a_spring_leaves_the_rest_at_work() -> None:
    model = chain(8)
    spring = model.spring_at("between")
    assert spring is not None
    part, gap = 0.3 * spring[0], 1e-4
    [element] = Freeplay("between", gap, part, within=True).apply(model).nonlinear
    q = np.linspace(-5e-4, 5e-4, 41)
    beyond = q - np.clip(q, -gap, gap)
    force = spring[0] * q + element.restoring_force.force(q, np.zeros(q.size))
    assert force == pytest.approx((spring[0] - part) * q + part * beyond)
    with pytest.raises(ParameterError, match="contact_stiffness"):
        Freeplay("between", gap, within=True)
    with pytest.raises(ParameterError, match="neither true nor false"):
        Freeplay("between", gap, part, within="yes")  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match="give at most that"):
        Freeplay("between", gap, 1.01 * spring[0], within=True).apply(model)
    Freeplay("between", gap, 1.01 * spring[0]).apply(model)
    of_all, of_part = (
        Freeplay("between", gap, part, within=within).ranges_here(model, 1e-3) for within in (False, True)
    )
    assert of_part["contact_stiffness"].high == spring[0] < of_all["contact_stiffness"].high


def test_play_is_tried_beside_and_within_a_spring() -> None:
    found = {c.name: c for c in nonlinear_candidates(chain(8), {"between": Motion(1e-5, 1e-4, 1e-2, 1.0)})}
    assert {"freeplay between", "freeplay between within"} <= set(found)
    assert all(e.within and e.vanishes for e in found["freeplay between within"].starts)  # type: ignore[attr-defined]


def test_play_within_a_joint_is_written_and_read(tmp_path: Path) -> None:
    machine = Freeplay("joint2", 1e-4, 3e3, within=True).apply(published_machine())
    write_machine(machine, tmp_path / "machine.toml")
    assert read_machine(tmp_path / "machine.toml").nonlinear == machine.nonlinear
